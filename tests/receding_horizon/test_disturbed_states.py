"""Loops whose speeds and steering angles are disturbed, for every vehicle with inertia."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.automaton.cutting import begin_state, end_state
from maneuver_automaton.receding_horizon import Guarantee
from maneuver_automaton.receding_horizon.log import Decision
from maneuver_automaton.receding_horizon.simulation import Disturbance, simulate
from tests.quickly import quick_are

CASES = {  # length and width [m], state at the start, deviation per step, way [m]
    "second_order_car": ((4.0, 1.8), [1.37, 0.12], (0.05, 0.02), 24.0),
    "second_order_unicycle": ((0.5, 0.3), [0.2, -0.13], (0.02, 0.02), 4.0),
    "single_track": ((4.5, 1.8), [15.0, 0.1, 0.05, 0.01], (0.2, 0.02, 0.01, 0.002), 100.0),
    "hovercraft": ((0.6, 0.4), [0.7, 0.1, 0.2], (0.02, 0.01, 0.02), 6.0),
    "helicopter": (
        (1.0, 1.0),
        [3.3, 0.4, 0.2, 0.1, 0.05, 0.02],
        (0.05, 0.02, 0.02, 0.01, 0.005, 0.005),
        30.0,
    ),
    "car_with_trailer": ((0.3, 0.2), [0.23], (0.005,), 3.0),
}
OTHERS = [name for name in CASES if name != "hovercraft"]
SEEDS = 12  # of each vehicle: 72 loops in all
SHORT = 4  # steps
FIRST = ma.SearchSettings(improve=False, polish=False)
GIVEN_AWAY = {Guarantee.DECREASE, Guarantee.FEASIBILITY}  # what a disturbance may take


def problem_of(name: str, seed: int) -> ma.Problem:
    """A way past a box, begun in a state beside the trims."""
    library = ma.load_stock_library(name)
    size, state, _, far = CASES[name]
    rng = np.random.default_rng(seed)
    end = np.zeros(library.model.group.dof)
    end[:2] = far, far * rng.uniform(-0.2, 0.2)
    goal = ma.Goal(
        end,
        trim=None if library.rest is not None else "speed 15, turn_rate 0",
        tolerance_m=size[0],
        tolerance_rad=0.5,
    )
    box = ma.Box([0.08 * far, 0.08 * far], [0.5 * far, far * rng.uniform(0.25, 0.35)])
    return ma.Problem(
        library,
        np.zeros(end.size),
        goal,
        start_state=state,
        footprint=ma.Box(size),
        obstacles=box,
        search=FIRST,
    )


def loop_of(name: str, seed: int, steps: int = SHORT) -> ma.ClosedLoop:
    """A loop whose state is disturbed after every step."""
    upset = Disturbance(reduced_state=CASES[name][2], seed=seed)
    return simulate(
        problem_of(name, seed), step=0.5, steps=steps, time_limit=2.0, disturbance=upset
    )


def check(loop: ma.ClosedLoop) -> None:
    """Driven as the model says from each measured state, free, and no guarantee broken."""
    assert loop.steps, loop.reason
    low, high = loop.problem.automaton.model.reduced_limits.T
    for step, audit in zip(loop.steps, loop.audits, strict=True):
        assert audit.passed, audit.reason
        assert not step.violations
        assert {one.guarantee for one in step.disturbed} <= GIVEN_AWAY
        assert step.decision is not Decision.MITIGATED
        assert step.clearance_m is None or step.clearance_m > 0.0
    for piece in loop.driven:
        for state in (begin_state(piece), end_state(piece)):
            assert (low - 1e-6 <= state).all()
            assert (state <= high + 1e-6).all()
    np.testing.assert_allclose(begin_state(loop.driven[0]), loop.problem.start_state, atol=1e-12)


@pytest.mark.parametrize("name", quick_are(["car_with_trailer", "hovercraft"], CASES))
def test_goes_on_from_a_disturbed_state(name: str) -> None:
    check(loop_of(name, 0))


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(SEEDS))
@pytest.mark.parametrize("name", CASES)
def test_many_loops(name: str, seed: int) -> None:
    check(loop_of(name, seed))


@pytest.mark.parametrize(
    "name",
    [
        "hovercraft",
        *(pytest.param(one, marks=[pytest.mark.slow, pytest.mark.exhaustive]) for one in OTHERS),
    ],
)
def test_the_value_falls_by_what_was_driven_between_disturbances(name: str) -> None:
    """One disturbance, then none: the paper's decrease holds in every step but that one."""
    problem = problem_of(name, 0)
    loop = ma.RecedingHorizon(problem, step=0.2, time_limit=2.0)
    rng = np.random.default_rng(7)
    low, high = problem.automaton.model.reduced_limits.T
    pose, state, taken = problem.start, problem.start_state, []
    for number in range(6):
        if number == 2:
            disturbed = np.add(state, 2.0 * np.array(CASES[name][2]) * rng.choice([-1.0, 1.0]))
            state = np.clip(disturbed, low, high)
        _, step = loop.step(pose, state)
        assert step.decision.leads, step.reason
        assert (number == 2) == bool(step.off_plan)
        pose, state = step.piece.end, end_state(step.piece)
        taken.append(step)
        if step.arrived:
            break
    pairs = [(a, b) for a, b in itertools.pairwise(taken) if not b.off_plan]
    assert len(pairs) >= 3
    for before, after in pairs:
        assert before.applied_cost > 0.0
        assert after.value <= before.value - before.applied_cost + 1e-6


@pytest.mark.slow
def test_arrives_though_disturbed_in_every_step() -> None:
    loop = loop_of("hovercraft", 0, steps=60)
    check(loop)
    assert loop.reached, loop.reason


def test_it_rests_in_the_state_in_which_it_arrives() -> None:
    library = ma.load_stock_library("car_with_trailer")
    near = ma.Problem(library, [0.0, 0.0, 0.0], ma.Goal([3.2, 0.0, 0.0], tolerance_m=0.5))
    first = ma.Plan(near.start, (library["speed 3, hitch 0"],), durations=[1.0])
    loop = simulate(near, step=1.0, steps=2, first=first, stay=True)
    assert [one.trims[-1].name for one in loop.driven] == ["speed 3, hitch 0", "speed 0, hitch 0"]


@pytest.mark.parametrize(("speed", "arrived"), [(0.2, False), (0.0, True)])
def test_one_that_still_rolls_at_the_goal_brakes(speed: float, arrived: bool) -> None:
    library = ma.load_stock_library("second_order_car")
    goal = ma.Goal([6.0, 0.0, 0.0], tolerance_m=1.0)
    loop = ma.RecedingHorizon(ma.Problem(library, [0.0, 0.0, 0.0], goal, search=FIRST), step=20.0)
    there = loop.step([0.0, 0.0, 0.0])[1].piece.end
    control, step = loop.step(there, [speed, 0.1])
    assert step.arrived == arrived
    assert control is not None
    assert control.tolist() == ([0.0, 0.0] if arrived else [-1.0, -0.5])
    if not arrived:
        np.testing.assert_allclose(end_state(step.piece), 0.0, atol=1e-12)


def test_it_brakes_from_a_speed_that_no_trim_has() -> None:
    """Its plan drives at 0.29 m/s, from where the pushed robot finds no way, but could stop."""
    goal = ma.Goal([2.3708, 0.7903, 0.5], tolerance_m=0.253, tolerance_rad=0.6)
    boxes = [([0.2377, 0.3118], [1.6858, 1.1754]), ([0.1767, 0.2849], [1.4925, 0.1558])]
    problem = ma.Problem(
        ma.load_stock_library("second_order_unicycle"),
        [0.0, 0.0, 0.0],
        goal,
        footprint=ma.Box([0.5, 0.25]),
        obstacles=[ma.Box(size, center) for size, center in boxes],
        search=ma.SearchSettings(improve=False, polish=False, max_expansions=1500),
    )
    loop = ma.RecedingHorizon(problem, step=0.316, time_limit=60.0)
    pose, state = problem.start, np.zeros(2)
    for _ in range(2):
        piece = loop.step(pose, state)[1].piece
        pose, state = piece.end, end_state(piece)
    step = loop.step(pose, [0.2194, 0.1577])[1]
    assert step.decision is Decision.APPROACHED
    assert {one.guarantee for one in step.disturbed} <= GIVEN_AWAY


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_step_takes_the_measured_state() -> None:
    library = ma.load_stock_library("second_order_car")
    problem = ma.Problem(library, [0, 0, 0], ma.Goal([20, 2, 0], tolerance_m=1.0), search=FIRST)
    loop = ma.RecedingHorizon(problem, step=1.0, time_limit=2.0)
    _, first = loop.step([0, 0, 0])
    pose, state = first.piece.end, end_state(first.piece)
    _, same = loop.step(pose, state)
    assert same.off_plan == 0.0
    disturbed = np.add(end_state(same.piece), [0.1, -0.05])
    _, other = loop.step(same.piece.end, disturbed)
    np.testing.assert_allclose(begin_state(other.plan), disturbed, atol=1e-12)
    assert other.off_plan == pytest.approx(0.1)
    with pytest.raises(ValueError, match="measured: state: speed is 9"):
        loop.step(pose, {"speed": 9.0})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"reduced_state": (-0.1, 0.0)}, "reduced_state must be numbers of at least 0"),
        ({"reduced_state": (0.1, 0.0), "delay": 1}, "is for a delay of 0"),
    ],
)
def test_what_is_no_disturbance_is_told(given: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Disturbance(**given)


def test_as_many_deviations_as_the_state_has_numbers() -> None:
    library = ma.load_stock_library("second_order_car")
    problem = ma.Problem(library, [0, 0, 0], [9, 0, 0])
    with pytest.raises(ValueError, match="has 1 numbers, need 2 for the second_order_car"):
        simulate(problem, step=1.0, disturbance=Disturbance(reduced_state=(0.1,)))
