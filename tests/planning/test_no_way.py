"""A search that ends without a plan: the proof that there is none, or its own verdict."""

import dataclasses

import pytest

from maneuver_automaton import Cost, Horizon, SearchSettings, plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.bounds.levels import Proof
from maneuver_automaton.budget import Budget
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.planning import PlanResult, PlanStatus, proving
from maneuver_automaton.planning.no_way import (
    FIRST_BOXES,
    FIRST_LOOK,
    before_proof,
    too_long,
    with_proof,
)
from maneuver_automaton.plotting import save_picture
from tests.bounds.scenes import bend, gap
from tests.bounds.test_cell_bound import WALL, among
from tests.quickly import quick_are


def ended(problem, status=PlanStatus.OUT_OF_BUDGET):
    return PlanResult(problem=problem, status=status, reason="no plan within 1 s")


def test_a_plan_for_a_gap_that_is_too_narrow_does_not_exist(tmp_path):
    settings = SearchSettings(max_expansions=300)
    result = plan(dataclasses.replace(gap(1.6), search=settings), time_limit=30.0)
    assert result.status is PlanStatus.UNREACHABLE
    assert result.reason.startswith("no collision-free path leads from the start to the goal")
    written = plan_to_dict(result)
    assert written["status"] == "unreachable"
    assert written["narrowest"]["place"] == pytest.approx([10.0, 0.0], abs=0.5)
    assert written["narrowest"]["missing_m"] == pytest.approx(0.3, rel=0.2)
    save_picture(result, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000


@pytest.mark.parametrize(
    "library",
    quick_are(["second_order_car"], ["second_order_car", "car_with_trailer"], exhaustive=True),
)
def test_the_proof_does_not_wait_until_the_time_is_over(library):
    """Also for a vehicle with inertia, of whose body alone the proof speaks."""
    problem = dataclasses.replace(gap(1.6), automaton=load_stock_library(library))
    result = plan(problem, time_limit=100.0)
    assert result.status is PlanStatus.UNREACHABLE
    assert result.counts["expansions"] < 20_000


@pytest.mark.parametrize("status", [PlanStatus.OUT_OF_BUDGET, PlanStatus.NO_PLAN])
def test_a_way_leaves_the_verdict_of_the_search(status):
    result = ended(bend(3.2), status)
    assert with_proof(result, Budget.from_now(30.0)) is result
    assert "narrowest" not in plan_to_dict(result)


def test_nothing_is_proven_of_other_verdicts_or_without_time():
    blocked = ended(gap(1.6), PlanStatus.GOAL_BLOCKED)
    assert with_proof(blocked, Budget.from_now(30.0)) is blocked
    late = ended(gap(1.6))
    for seconds in (-1.0, 0.9 * FIRST_BOXES):
        assert with_proof(late, Budget.from_now(seconds)) is late


@pytest.mark.exhaustive
@pytest.mark.slow
def test_no_plan_is_as_quick_as_the_horizon_admits():
    problem = among(WALL, cost=Cost(time=1.0))
    duration = plan(problem, time_limit=1.0).plan.duration
    for share, status in ((0.9, PlanStatus.UNREACHABLE), (0.99, PlanStatus.OUT_OF_BUDGET)):
        short = dataclasses.replace(problem, horizon=Horizon(max_time=share * duration))
        result = with_proof(ended(short), Budget.from_now(1e3))
        assert result.status is status
        assert ("s: no path that leads to the goal is short enough" in result.reason) == (
            status is PlanStatus.UNREACHABLE
        )


@pytest.mark.parametrize(("seconds", "yields"), [(0.9 * FIRST_LOOK, 0), (1e3, 1)])
def test_work_that_nobody_can_stop_is_not_begun_late(monkeypatch, seconds, yields):
    """A level of many cells takes longer to polish than there is time."""
    asked = []

    def proofs_of(problem, *, incumbent, ends):
        for work in (1, 2):
            asked.append(work)
            yield Proof(value=0.0, optimal=False, cells=10**12, size=1.0, work=work)

    monkeypatch.setattr(proving, "proofs_of", proofs_of)
    problem = dataclasses.replace(bend(3.2), horizon=Horizon(max_time=1e3))
    assert too_long(problem, Budget.from_now(seconds)) == ""
    assert len(asked) == yields


def test_a_share_of_the_time_is_left_for_a_proof():
    budget = Budget.from_now(10.0)
    assert before_proof(budget).deadline == pytest.approx(budget.deadline - 1.0)
