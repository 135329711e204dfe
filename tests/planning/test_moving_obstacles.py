"""Plans among moving obstacles: the vehicle waits or evades, and passes where none is then."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from tests import scenes
from tests.planning.test_among_obstacles import assert_consistent
from tests.quickly import quick_are
from tests.solids import check_plan, driven

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
ROBOT = scenes.differential_robot(speed=1.0)
DISC = (Disc(0.3),)


def crossing(at, *, time, speed=1.0, radius=0.5):
    """A disc that crosses the x axis at x = `at`, upwards, at `time` [s]."""
    knots = [[at, -20.0 * speed, 0.0], [at, 20.0 * speed, 0.0]]
    return Obstacle(Disc(radius), motion=Motion([time - 20.0, time + 20.0], knots))


def corridor(length=6.0):
    """Walls above and below: there is no way round."""
    return tuple(Obstacle(Box([length + 2.0, 0.5], [0.5 * length, y])) for y in (0.62, -0.62))


def planned(problem):
    result = plan(problem, time_limit=LIMIT)
    assert_consistent(result)
    return result


def found(problem):
    result = planned(problem)
    assert result.status is PlanStatus.FOUND, result.reason
    return result


BASE = Problem(ROBOT, [0, 0, 0], [6, 0, 0], footprint=DISC, obstacles=crossing(3.0, time=3.0),
               search=SearchSettings(max_expansions=1500))  # fmt: skip


def test_what_crosses_in_time_is_let_pass():
    # at 1 m/s straight on it would be hit at 3 s
    result = found(BASE)
    assert result.cost > 6.0
    assert result.cost < 8.5
    assert result.lower_bound == pytest.approx(6.0)


def test_where_there_is_no_way_round_it_waits_or_dawdles():
    # it may pass when the gate is half a metre up, and wait no nearer than 0.7 m before its middle
    gate = Obstacle(
        Box([1.0, 0.5]), motion=Motion([0.0, 5.0, 6.0], [[3, 0, 0], [3, 0, 0], [3, 9, 0]])
    )
    result = found(replace(BASE, obstacles=(*corridor(), gate),
                           search=SearchSettings(max_expansions=6000)))  # fmt: skip
    assert result.plan.duration > 5.0 + 6.0 - 2.3
    assert result.plan.duration < 11.0


def test_a_word_that_waits_once_is_improved():
    controls = {"rest": (0, 0), "ahead": (1, 0), "left": (0.8, 0.8), "right": (0.8, -0.8)}
    way = Motion([0.0, 8.0], [[3.0, -4.0, 1.57], [3.0, 4.0, 1.57]])
    walls = [Obstacle(Box([2.8, 0.2], [x, y])) for x in (0.9, 5.1) for y in (1.0, -1.0)]
    robot = Automaton.of_controls(Unicycle(), controls)
    around = [Obstacle(Box([1.4, 0.8]), motion=way), *walls]
    body = Box([0.8, 0.6])
    asked = Problem(robot, [0, 0, 0], [6, 0, 0], obstacles=around, footprint=body, margin=0.05,
                    search=SearchSettings(max_expansions=10_000))  # fmt: skip
    assert found(asked).cost < 8.74  # straight on after one rest: 8.873


def test_without_a_rest_it_evades():
    dubins = scenes.dubins(0.6)
    result = found(replace(BASE, automaton=dubins))
    assert "rest" not in result.plan.word
    assert result.cost > 6.0


def test_what_crossed_before_or_comes_later_does_not_matter():
    for time in (-3.0, 30.0):
        result = found(replace(BASE, obstacles=(crossing(3.0, time=time),)))
        assert result.plan.word == ("ahead",)
        assert result.gap == pytest.approx(0.0, abs=1e-9)
    # a plan ends at arrival: what crosses the goal afterwards is none of its business
    result = found(replace(BASE, obstacles=(crossing(6.0, time=9.0),)))
    assert result.plan.word == ("ahead",)


def test_time_begins_at_the_start_time():
    late = replace(BASE, start_time=100.0)
    assert found(late).plan.word == ("ahead",)
    met = replace(late, obstacles=(crossing(3.0, time=103.0),))
    result = found(met)
    assert result.cost > 6.0
    assert check_plan(met, result.plan, 0).clearance_m > 0.0


def door(opens):
    """A door across a corridor that is lifted within a second."""
    return Obstacle(
        Box([0.2, 0.7]), motion=Motion([0.0, opens, opens + 1.0], [[3, 0, 0], [3, 0, 0], [3, 9, 0]])
    )


def arrival_at_the_door(problem, result):
    times, poses = driven(result.plan, problem.start[:2], step_m=0.01, step_rad=0.01)
    return float(times[np.argmax(poses[:, 0] > 3.0)])


def test_a_door_that_opens_is_passed_after_it_opened():
    problem = replace(BASE, obstacles=(*corridor(), door(5.0)),
                      search=SearchSettings(max_expansions=6000))  # fmt: skip
    result = found(problem)
    assert arrival_at_the_door(problem, result) > 5.0
    assert result.plan.duration > 8.0


def test_a_door_that_opens_late_is_waited_for():
    # forwards and wait: a lattice of a few places, however long one stands in front of the door
    forward = Automaton.of_controls(
        Unicycle(), {"rest": (0.0, 0.0), "on": (1.0, 0.0), "left": (1.0, 1.0)}
    )
    problem = replace(BASE, automaton=forward, obstacles=(*corridor(), door(400.0)),
                      search=SearchSettings(max_expansions=50_000))  # fmt: skip
    result = plan(problem, time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.plan.duration > 400.0


def test_who_never_moves_away_blocks_the_goal():
    parked = Obstacle(Disc(0.5), motion=Motion([0.0, 2.0], [[6, 9, 0], [6, 0, 0]]))
    result = planned(replace(BASE, goals=(Goal(pose=[6, 0, 0]),), obstacles=(parked,),
                             automaton=scenes.differential_robot(speed=0.2),
                             bounds=Bounds(x=(-1.0, 7.0), y=(-1.0, 1.0)),
                             search=SearchSettings(max_expansions=300)))  # fmt: skip
    assert result.status in (PlanStatus.OUT_OF_BUDGET, PlanStatus.NO_PLAN)


FIXED = replace(BASE, horizon=Horizon(time=20.0), cost=Cost(effort=1.0))


def test_with_a_fixed_time_rest_fills_it():
    result = found(replace(FIXED, obstacles=(crossing(3.0, time=3.0),)))
    assert result.plan.duration == pytest.approx(20.0)
    assert result.plan.word[-1] == "rest" or "rest" in result.plan.word


def test_with_a_fixed_time_it_does_not_rest_where_something_comes():
    # it may arrive before 12 s, but not stay: wait at the start, and arrive when it has passed
    problem = replace(FIXED, obstacles=(crossing(6.0, time=12.0),))
    result = found(problem)
    assert check_plan(problem, result.plan, 0).clearance_m > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", quick_are(range(2), range(6)))
def test_lively_places(seed):
    problem = replace(
        scenes.moving_scene(seed, moving=6), search=SearchSettings(max_expansions=900)
    )
    result = planned(problem)
    if result.plan is not None:
        assert result.plan.duration >= math.hypot(*(result.plan.end - problem.start)[:2]) - 1e-6
