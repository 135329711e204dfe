"""Nobody goes on after the deadline: a clock that jumps past it after so many looks."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Literal

import pytest

from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Disc
from maneuver_automaton.planning import steps
from maneuver_automaton.planning.no_way import with_proof
from maneuver_automaton.planning.plan import prepare
from maneuver_automaton.planning.result import PlanStatus, workspace_of
from maneuver_automaton.problem import Horizon, Problem, SearchSettings
from tests.inertia import unicycle_automaton
from tests.matrix.vehicles import VEHICLES

FEW = 60  # looks at the clock once the time is over: every loop has one, and they are nested
VEHICLE = VEHICLES["unicycle"]
WAY = [Disc(0.4, [2.0, 0.3])]
TASKS = {
    "among obstacles": VEHICLE.problem(obstacles=WAY),
    "free": VEHICLE.problem(),
    "a fixed time": VEHICLE.problem(horizon=Horizon(time=9.0)),
    "a tolerance": VEHICLE.problem(
        goals=VEHICLE.target(tolerance_m=0.1, tolerance_rad=0.1), obstacles=WAY
    ),
    "words among obstacles": VEHICLE.problem(horizon=Horizon(max_trims=4)),
}


def looks_after(
    problem: Problem, looks: int, alternatives: int, late: float
) -> tuple[int, PlanStatus]:
    """How often the clock is looked at once it shows `late` [s] of 1 s, and the answer."""
    seen = itertools.count()
    budget = Budget(began=0.0, deadline=1.0, clock=lambda: 0.0 if next(seen) < looks else late)
    workspace = workspace_of(problem.obstacles)
    result = steps.answer(problem, budget, workspace, alternatives=alternatives)
    return next(seen) - looks, with_proof(result, budget).status


@pytest.mark.parametrize("name", TASKS)
def test_nobody_goes_on_after_the_deadline(name: str) -> None:
    problem = TASKS[name]
    prepare(problem)
    for looks, alternatives in ((0, 0), (10, 4), (100, 4), (400, 4)):
        after, _ = looks_after(problem, looks, alternatives, 1.5)
        assert after <= FEW, f"{after} looks after the first {looks}"


@pytest.mark.parametrize(
    ("looks", "late", "status"),
    [
        pytest.param(400, 1.02, PlanStatus.FOUND, id="found in time it is checked and returned"),
        pytest.param(20, 1.1, PlanStatus.FOUND, id="a first plan a while after the deadline"),
        pytest.param(20, 1.5, PlanStatus.OUT_OF_BUDGET, id="not late for its checks"),
        pytest.param(400, 1.5, PlanStatus.FOUND, id="a first plan before it is improved"),
    ],
)
def test_when_a_plan_is_checked(looks: int, late: float, status: PlanStatus) -> None:
    assert looks_after(TASKS["among obstacles"], looks, 0, late)[1] is status


def test_what_checks_is_imported_before_the_clock_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first check of a process would be late for its imports, and its plan lost."""
    loaded: list[str] = []
    monkeypatch.setattr(steps, "load_checking", lambda: loaded.append("checks"))
    prepare(replace(TASKS["among obstacles"]))  # one for which nothing is ready yet
    assert loaded == ["checks"]


@pytest.mark.parametrize("method", ["insertion", "lattice"])
def test_prices_of_maneuvers_are_known_before_the_clock_starts(
    monkeypatch: pytest.MonkeyPatch, method: Literal["insertion", "lattice"]
) -> None:
    """The bound of a plan needs them, 25 ms for a helicopter."""
    priced: list[str] = []
    monkeypatch.setattr(steps.bounds, "least_price_per_metre", lambda *_: priced.append(method))
    linked = unicycle_automaton()
    prepare(Problem(linked, [0, 0, 0], [2, 1, 0], search=SearchSettings(method=method)))
    assert priced == [method]
