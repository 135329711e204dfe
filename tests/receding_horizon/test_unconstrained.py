from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidAutomaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.primitives import Trim
from maneuver_automaton.receding_horizon.unconstrained import (
    FixedHorizon,
    HorizonSearch,
    MixedOrderCost,
    UnconstrainedProblem,
    search_horizon,
    shifted,
    simulate_unconstrained,
)
from tests.receding_horizon.unconstrained_cases import (
    MIXED,
    PARKING,
    QUADRATIC,
    even,
    octaves,
    problem_of,
)
from tests.reference_unconstrained import best_of_all, exhausted, horizon_cost, rolled_out

POSES = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
FEW = settings(max_examples=15)


@given(
    pose=POSES, trims=st.lists(st.integers(0, 24), min_size=3, max_size=3), quadratic=st.booleans()
)
@FEW
def test_the_cost_of_a_sequence_is_its_integral(pose, trims, quadratic):
    problem = problem_of(even(5), QUADRATIC if quadratic else MIXED, intervals=3)
    assert rolled_out(problem, pose, trims) == pytest.approx(
        horizon_cost(problem, pose, trims), rel=1e-10
    )


def test_orders_that_are_not_even_cost_digits_but_few():
    cost = MixedOrderCost(
        pose_weights=np.ones(3), control_weights=np.ones(2), pose_orders=[1, 3, 1]
    )
    problem = problem_of(even(3), cost, intervals=2)
    assert rolled_out(problem, [0.3, 0.1, -0.2], [8, 0]) == pytest.approx(
        horizon_cost(problem, [0.3, 0.1, -0.2], [8, 0]), rel=2e-2
    )


@given(start=POSES, goal=POSES, shift=POSES)
@FEW
def test_a_moved_problem_has_the_moved_plan(start, goal, shift):
    library, move = even(3), SE2(np.array(shift))
    fixed = problem_of(library, MIXED, intervals=4, goal=goal)
    moved = problem_of(library, MIXED, intervals=4, goal=(move @ SE2(np.array(goal))).pose)
    there = (move @ SE2(np.array(start))).pose
    trims = search_horizon(fixed, start).trims
    # rounding may break a tie between mirror images in another way: values are compared
    assert search_horizon(moved, there).value == pytest.approx(
        search_horizon(fixed, start).value, rel=1e-9
    )
    assert rolled_out(moved, there, trims) == pytest.approx(
        rolled_out(fixed, start, trims), rel=1e-9
    )


def test_a_moved_loop_is_the_loop_moved():
    shift = SE2(np.array([3.0, -2.0, 0.7]))
    start = np.array([-0.6, 0.4, 0.3])
    fixed = simulate_unconstrained(problem_of(even(5), MIXED, intervals=4), start, steps=6)
    problem = problem_of(even(5), MIXED, intervals=4, goal=shift.pose)
    moved = simulate_unconstrained(problem, (shift @ SE2(start)).pose, steps=6)
    assert moved.trims.tolist() == fixed.trims.tolist()
    np.testing.assert_allclose(moved.poses, (shift @ SE2(fixed.poses)).pose, atol=1e-9)


def test_the_mirror_image_costs_the_same():
    problem = problem_of(even(3), MIXED, intervals=5)
    image = np.array([0.4, -0.8, -0.5])
    assert search_horizon(problem, -image * [-1, 1, 1]).value == pytest.approx(
        search_horizon(problem, image).value
    )


@pytest.mark.slow
@pytest.mark.parametrize("cost", [MIXED, QUADRATIC])
@pytest.mark.parametrize("pose", [PARKING, (0.5, -0.4, 1.0), (0.0, 0.05, 0.0)])
def test_depth_first_finds_the_best_of_all(pose, cost):
    problem = problem_of(even(3), cost, intervals=3)
    found = exhausted(problem, pose, first=[0, 0, 0])
    _, value = best_of_all(lambda word: rolled_out(problem, pose, word), 9, 3)
    assert found.proven
    assert found.value == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("cost", [MIXED, QUADRATIC])
def test_the_search_finds_what_is_proven(cost):
    rng = np.random.default_rng(3)
    problem = problem_of(even(5), cost, intervals=4)
    for pose in rng.uniform(-1.0, 1.0, (6, 3)):
        best = exhausted(problem, pose)
        assert best.proven
        assert search_horizon(problem, pose).value == pytest.approx(best.value, rel=1e-12)


def test_a_beam_that_keeps_everything_is_exhaustive():
    problem, pose = problem_of(even(3), MIXED, intervals=3), [0.1, 0.9, -0.4]
    wide = search_horizon(problem, pose, search=HorizonSearch(width=9**3, same=0.0))
    assert wide.value == pytest.approx(exhausted(problem, pose).value, rel=1e-12)


def test_no_single_change_gains():
    problem, pose = problem_of(even(5), MIXED, intervals=4), [0.2, -0.7, 0.3]
    plan = search_horizon(problem, pose, search=HorizonSearch(width=1))
    for k in range(4):
        for trim in range(25):
            other = np.array(plan.trims)
            other[k] = trim
            assert rolled_out(problem, pose, other) >= plan.value * (1.0 - 1e-11)


def test_the_warm_sequence_is_never_lost():
    problem = problem_of(even(5), MIXED, intervals=5)
    best = exhausted(problem, PARKING)
    poor = HorizonSearch(width=1)
    assert search_horizon(problem, PARKING, warm=best.trims, search=poor).value == best.value


def test_by_hand_on_a_straight():
    # a metre ahead of the goal at 1 m/s for a second: the integral of (1 - t)^4 is 1/5
    robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    problem = UnconstrainedProblem(
        robot, [1.0, 0.0, 0.0], cost=MIXED, horizon=FixedHorizon(interval=1.0, intervals=1)
    )
    assert rolled_out(problem, [0, 0, 0], [1]) == pytest.approx(0.2 + 1.0)


def test_mixed_orders_park_where_squares_stall():
    mixed = simulate_unconstrained(problem_of(octaves(5), MIXED), PARKING, steps=40)
    square = simulate_unconstrained(problem_of(octaves(5), QUADRATIC), PARKING, steps=40)
    assert mixed.settled
    assert square.settled
    assert abs(mixed.poses[-1, 1]) < 0.003
    assert np.hypot(*mixed.poses[-1, :2]) < 0.05
    assert abs(square.poses[-1, 1]) > 0.09


def test_where_squares_stall_no_sequence_is_better_than_rest():
    problem = problem_of(even(3), QUADRATIC, intervals=6)
    stalled = exhausted(problem, [0.0, 0.1, 0.0])
    assert stalled.proven
    assert not problem.automaton.body_velocities[stalled.trims].any()


def test_the_neighbourhood_shrinks_with_the_least_speed():
    ends = [
        np.abs(simulate_unconstrained(problem_of(octaves(n), MIXED), PARKING, steps=60).poses[-1])
        for n in (2, 4, 6)
    ]
    assert ends[0][1] > 4.0 * ends[1][1] > 16.0 * ends[2][1]


def test_several_intervals_may_be_driven_at_once():
    problem = problem_of(even(5), MIXED, intervals=6, applied=2)
    loop = simulate_unconstrained(problem, PARKING, steps=3)
    assert loop.trims.shape == (3, 2)
    plan = search_horizon(problem, PARKING)
    assert loop.trims[0].tolist() == plan.trims[:2].tolist()
    assert shifted(problem, plan).tolist() == [*plan.trims[2:], 12, 12]
    np.testing.assert_allclose(loop.poses[1], plan.poses[2], atol=1e-12)
    assert loop.cost == pytest.approx(loop.stage_costs.sum())


def test_a_loop_repeats_itself_exactly():
    problem = problem_of(octaves(3), MIXED, intervals=5)
    first, second = (simulate_unconstrained(problem, PARKING, steps=10) for _ in range(2))
    assert np.array_equal(first.poses, second.poses)
    assert np.array_equal(first.values, second.values)


def test_at_the_goal_it_settles_at_once():
    loop = simulate_unconstrained(problem_of(even(3), MIXED), [0, 0, 2 * np.pi], steps=3)
    assert loop.settled
    assert loop.trims.shape == (0, 1)
    assert loop.values.tolist() == pytest.approx([0.0], abs=1e-40)


def test_headings_count_modulo_a_turn_from_the_start():
    problem = problem_of(even(3), MIXED, goal=[1.0, 2.0, 3.0])
    seen = problem.seen([1.0, 2.0, 3.5 + 4 * np.pi])
    np.testing.assert_allclose(seen, [0.0, 0.0, 0.5], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: FixedHorizon(interval=0.0, intervals=3),
            "fixed horizon: interval must be positive, got 0.0 s",
        ),
        (
            lambda: FixedHorizon(interval=1.0, intervals=3, applied=4),
            "fixed horizon: applied must be at least 1 and at most the number of intervals, "
            "got 4 of 3",
        ),
        (lambda: HorizonSearch(width=0), "horizon search: width must be at least 1, got 0"),
        (
            lambda: HorizonSearch(growth=-1.0),
            "horizon search: growth must be at least 0, got -1.0",
        ),
        (
            lambda: MixedOrderCost(pose_weights=[1, 0, 1], control_weights=[1, 1]),
            "mixed-order cost: pose_weights must be positive, got [1.0, 0.0, 1.0]",
        ),
        (
            lambda: MixedOrderCost(
                pose_weights=[1, 1, 1], control_weights=[1, 1], pose_orders=[2, 0.5, 2]
            ),
            "mixed-order cost: pose_orders must be at least 1, got [2.0, 0.5, 2.0]",
        ),
        (
            lambda: MixedOrderCost(
                pose_weights=[1, 1, 1], control_weights=[1, 1], control_orders=[2]
            ),
            "mixed-order cost: got 1 control_orders for 2 control_weights, need one each",
        ),
        (
            lambda: problem_of(even(3), MIXED, goal=[[0, 0, 0]]),
            "goal: got shape (1, 3), need one pose (3,)",
        ),
        (
            lambda: problem_of(even(3), MixedOrderCost.quadratic([1, 1, 1], [1])),
            "mixed-order cost: got 1 control_weights, need 2 (speed, turn_rate)",
        ),
        (
            lambda: search_horizon(problem_of(even(3), MIXED), PARKING, warm=[9] * 8),
            "sequence: got trim 9, need an index from 0 to 8",
        ),
        (
            lambda: search_horizon(problem_of(even(3), MIXED), PARKING, warm=[0]),
            "sequence: got shape (1,), need (8,), a trim for each interval",
        ),
        (
            lambda: search_horizon(problem_of(even(3), MIXED), [PARKING]),
            "pose: got shape (1, 3), need one pose (3,)",
        ),
        (
            lambda: simulate_unconstrained(problem_of(even(3), MIXED), PARKING, steps=0),
            "steps must be at least 1, got 0",
        ),
    ],
)
def test_wrong_input_is_named(make, message):
    with pytest.raises(ValueError) as caught:
        make()
    assert str(caught.value) == message


def test_a_trim_must_last_for_the_horizon():
    robot = Automaton(
        Unicycle(),
        (Trim(name="dash", body_velocity=[1, 0, 0], control=[1, 0], max_duration=0.5),),
    )
    with pytest.raises(InvalidAutomaton) as caught:
        problem_of(robot, MIXED)
    assert str(caught.value) == (
        "trim 'dash': max_duration is 0.5 s, need at least the horizon of 4 s"
    )
