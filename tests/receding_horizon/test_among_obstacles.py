"""Closed loops among static obstacles: every guarantee holds, as in the open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import (
    Decision,
    Disturbance,
    Guarantee,
    RecedingHorizon,
    simulate,
)
from tests.quickly import quick_are
from tests.receding_horizon.loops import off_goal, totals
from tests.receding_horizon.scenes import among, clearances
from tests.scenes import differential_robot, parallel_slot
from tests.solids import World

WALL = Obstacle(Box([0.2, 4.0], [3.0, 1.5]))
NOISE = Disturbance(position_m=0.02, heading_rad=0.02, seed=1)


def seeded(seed: int) -> Problem:
    """The robot at a free pose before a wall and two parked boxes."""
    parked = [Obstacle(Box([1.0, 0.5], [1.5, -1.5], 0.4)), Obstacle(Box([0.8, 0.8], [4.5, 1.0]))]
    rng = np.random.default_rng(seed)
    problem = among(WALL, *parked, goal=[6.0, 0.0, 0.0], bounds=Bounds(x=(-2, 8), y=(-4, 5)))
    while True:
        start = np.array([*rng.uniform([-1.5, -3.0], [2.5, 4.0]), rng.uniform(-3.0, 3.0)])
        if World(replace(problem, start=start)).clearance(start[None] * [0, 0, 1])[0] > 0.05:
            return replace(problem, start=start)


@pytest.mark.parametrize("seed", quick_are([6], range(7)))
def test_undisturbed_all_that_is_promised_is_kept(seed):
    loop = simulate(seeded(seed), step=1.0)
    assert loop.reached
    assert list(loop.violations) == []
    total = totals(loop)
    assert (total[1:] <= total[:-1] + 1e-8).all()
    assert clearances(loop).min() > 0.0
    for one in loop.steps:
        assert off_goal(loop, one) <= 1e-8
        assert one.shifted_value is not None or one.number == 0
        assert one.lower_bound <= one.value
        assert one.clearance_m is not None
        assert one.decision in (
            Decision.PLANNED,
            Decision.KEPT,
            Decision.IMPROVED,
            Decision.REPLANNED,
        )
    assert loop.min_clearance_m == min(one.clearance_m or 0.0 for one in loop.steps)
    assert loop.steps_bound is not None
    assert len(loop.steps) <= loop.steps_bound


def test_a_margin_is_kept_and_what_is_promised_too():
    problem = replace(seeded(4), margin=0.05)
    loop = simulate(problem, step=1.0)
    assert loop.reached
    assert list(loop.violations) == []
    assert clearances(loop).min() >= 0.05


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("seed", quick_are([4], range(6)))
def test_with_noise_it_arrives_free_and_says_what_the_noise_took(seed):
    problem = replace(
        seeded(seed), goals=(Goal(pose=[6, 0, 0], tolerance_m=0.1, tolerance_rad=0.1),)
    )
    problem = replace(problem, margin=0.1)
    loop = simulate(problem, step=1.0, disturbance=replace(NOISE, seed=seed))
    assert loop.reached
    assert list(loop.collisions) == []
    assert clearances(loop).min() > 0.0
    assert not list(loop.violations)
    for _, violation in loop.disturbed:
        assert violation.guarantee in (Guarantee.DECREASE, Guarantee.FEASIBILITY, Guarantee.SAFETY)
        if violation.guarantee is not Guarantee.SAFETY:
            assert "off the plan" in violation.reason


def test_a_car_that_cannot_rest_parks():
    loop = simulate(parallel_slot(5.9), step=2.0)
    assert loop.reached
    assert list(loop.violations) == []
    assert clearances(loop).min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("cost", [Cost(effort=1.0), Cost(effort=0.5, norm=0.5)])
def test_a_fixed_time_is_kept(cost):
    problem = among(WALL, goal=[6.0, 0.0, 0.0], cost=cost, horizon=Horizon(time=15.0))
    loop = simulate(problem, step=1.0)
    assert loop.reached
    assert list(loop.violations) == []
    assert clearances(loop).min() > 0.0
    assert all(one.plan.duration == pytest.approx(15.0) for one in loop.steps)


def test_where_the_goal_is_closed_in_it_says_so_and_stays():
    cage = [Box([0.2, 4.2], [6.0 + side, 0.0]) for side in (2.0, -2.0)]
    cage += [Box([4.2, 0.2], [6.0, side]) for side in (2.0, -2.0)]
    loop = simulate(among(*cage), step=1.0)
    assert (loop.status, loop.steps) == ("no_plan", ())
    assert "no safe plan leads to the goal" in loop.reason


@pytest.mark.slow
def test_pushed_closer_than_the_margin_it_goes_on_with_what_it_has():
    problem = among(WALL, margin=0.3, start=(2.5, 1.5, np.pi))
    loop = simulate(problem, step=0.5)
    assert loop.reached
    assert clearances(loop).min() >= 0.04  # a half of 0.1, or of what is known of it
    assert loop.steps[0].violations[0].guarantee is Guarantee.SAFETY
    assert "need more than 0.3 m" in loop.steps[0].violations[0].reason
    assert clearances(loop)[-1] >= 0.3 - 1e-9


def test_pushed_out_of_the_bounds_it_comes_back():
    push = Disturbance(pushes={0: (0.0, 6.0, 0.0)})
    loop = simulate(among(WALL, bounds=Bounds(y=(-4.0, 5.0))), step=1.0, disturbance=push)
    assert loop.reached
    assert clearances(loop).min() > 0.0


def test_pushed_into_a_wall_it_stays_and_says_so():
    push = Disturbance(pushes={0: (1.9, 0.0, 0.0)})
    problem = among(WALL, start=(2.0, 1.5, 0.0), goal=[-4.0, 1.5, 0.0])
    loop = simulate(problem, step=1.0, disturbance=push)
    assert loop.poses[-1] == pytest.approx([2.9, 1.5, 0.0])
    assert (loop.status, len(loop.steps)) == ("no_plan", 1)
    assert "contact is predicted at 1 s" in loop.reason


@pytest.mark.slow
def test_a_margin_for_new_words_keeps_the_old_one():
    loop = simulate(seeded(3), step=1.0, margin=0.5)
    assert loop.reached
    assert list(loop.violations) == []


@pytest.mark.slow
def test_retimed_plans_stay_on_their_free_path():
    # continuous controls never quite arrive: each step leaves the same share of the effort
    problem = among(WALL, goal=[6.0, 0.0, 0.0], cost=Cost(effort=1.0), horizon=Horizon(time=20.0))
    loop = simulate(problem, step=2.0, steps=8, retimed=True)
    assert list(loop.violations) == []
    assert clearances(loop).min() > 0.0
    assert loop.value < 0.25 * loop.steps[0].value


@pytest.mark.slow
def test_held_in_the_goal_beside_a_wall():
    goal = Goal(pose=[6.0, 0.0, 0.0], tolerance_m=0.2, tolerance_rad=0.3)
    problem = among(WALL, Disc(0.5, [7.1, 0.0]), goal=goal)
    loop = simulate(problem, step=0.5, steps=40, stay=True, disturbance=NOISE)
    assert loop.reached
    assert list(loop.collisions) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_a_moved_scene_has_the_moved_loop(seed):
    problem = replace(seeded(seed), bounds=Bounds())
    move = SE2(np.array([30.0, -7.0, 2.2]))
    one, two = (simulate(each, step=1.0) for each in (problem, problem.moved(move)))
    assert [step.plan.word for step in one.steps] == [step.plan.word for step in two.steps]
    assert [step.value for step in two.steps] == pytest.approx(
        [step.value for step in one.steps], abs=1e-6
    )
    assert (move @ SE2(one.poses)).pose == pytest.approx(two.poses, abs=1e-6)


def test_the_first_plan_must_be_free():
    ahead = next(trim for trim in differential_robot(1.0, 1.5).trims if trim.name == "ahead")
    through = Plan([0.0, 0.0, 0.0], (ahead,), durations=[6.0])
    controller = RecedingHorizon(among(WALL), step=1.0, first=through)
    with pytest.raises(ValueError, match="first hits an obstacle"):
        controller.step([0.0, 0.0, 0.0])
    controller = RecedingHorizon(among(Disc(1.0, [3.0, 4.0])), step=1.0, first=through)
    assert controller.step([0.0, 0.0, 0.0])[1].plan.word == ("ahead",)


@pytest.mark.parametrize(("name", "value"), [("look_ahead", 0.0), ("stand", -1.0)])
def test_numbers_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=f"receding horizon: {name} must be"):
        RecedingHorizon(among(WALL), step=1.0, **{name: value})


class TestAGoalThatBecomesOccupied:
    """Seen on the way: a vehicle that can stop comes near, stops, and stays."""

    BOX = Obstacle(Box([0.6, 0.6], [6.0, 0.0]))
    CORRIDOR = tuple(Obstacle(Box([12.0, 0.2], [3.0, side])) for side in (0.8, -0.8))

    def driven(self, *walls, goes=99, where=BOX, **changed):
        problem = among(*walls, goal=[6.0, 0.0, 0.0], footprint=Disc(0.22), **changed)

        def seen(number: int) -> list[Obstacle]:
            return [*walls, where] if 3 <= number < goes else [*walls]

        return simulate(problem, step=0.5, steps=24, obstacles=seen)

    @pytest.mark.parametrize("walls", [(), CORRIDOR])
    def test_it_comes_near_and_stops(self, walls):
        loop = self.driven(*walls)
        assert not loop.reached
        assert "the goal is blocked: at the goal the vehicle touches" in loop.reason
        far = np.hypot(*(loop.poses[:, :2] - [6.0, 0.0]).T)
        assert far.min() == far[-1] < 0.3 + 0.22 + 0.15
        assert (np.diff(far) <= 1e-9).all()  # never away
        assert loop.steps[-1].decision is Decision.STOPPED
        assert {one.decision for one in loop.steps} >= {Decision.APPROACHED}

    def test_it_goes_on_when_the_goal_is_free_again(self):
        assert self.driven(goes=12).reached

    def test_what_closes_the_way_is_no_reason_to_leave(self):
        closed = Obstacle(Box([0.2, 60.0], [4.0, 0.0]))
        loop = self.driven(where=closed, bounds=Bounds(x=(-1, 8), y=(-2, 2)))
        assert loop.poses[:, 0].max() == loop.poses[-1, 0] < 4.0
        assert loop.poses[-1, 0] > 3.5

    def test_the_reason_names_a_goal_that_is_blocked_from_the_start(self):
        loop = simulate(among(self.BOX, goal=[6.0, 0.0, 0.0]), step=0.5)
        assert loop.status == "no_plan"
        assert loop.reason.startswith("the goal is blocked: at the goal the vehicle touches")
