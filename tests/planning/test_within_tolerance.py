"""Goals with tolerance: plans end within, cost less, and pass every check; 0 stays exact."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import SecondOrderUnicycle, Unicycle
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.planning.within_tolerance import free_aims
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from tests import scenes
from tests.quickly import quick_are
from tests.search.cases import TABLE_2, robot
from tests.solids import check_plan

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
FAR, TURNED = 0.3, 0.2
AXIS = np.linspace(-2.0, 2.0, 9)
VEHICLES = {
    "unicycle": robot(TABLE_2),
    "car": scenes.reeds_shepp(1.0),
    "dubins": scenes.dubins(0.8),
    "grid": Automaton.of_grid(Unicycle(), [AXIS, AXIS]),
}
STONE = Disc(0.4, [2.2, 0.5])
QUICK = SearchSettings(max_expansions=2000)
GOAL = np.array([4.5, 1.0, 0.5])


def to_goal(name, far=0.0, turned=0.0, **more):
    goal = Goal(pose=GOAL, tolerance_m=far, tolerance_rad=turned)
    return Problem(VEHICLES[name], [0, 0, 0], goal, search=QUICK, **more)


def found(problem, **more):
    """A plan that ends where it says, within tolerance; nothing in the package measures it."""
    result = plan(problem, time_limit=LIMIT, **more)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.problem is problem
    for one in (result, *result.alternatives):
        goal = problem.goals[0]
        off = one.plan.end - goal.pose
        way, turn = float(np.hypot(*off[:2])), abs(float((off[2] + np.pi) % (2 * np.pi) - np.pi))
        assert way <= goal.tolerance_m + 1e-9
        assert goal.free_heading or turn <= goal.tolerance_rad + 1e-9
        assert one.terminal_error.position_m == pytest.approx(way, abs=1e-9)
        assert one.cost == problem.cost_of(one.plan)
    assert result.lower_bound <= result.cost
    slow = check_plan(problem, result.plan, result.goal_index)
    assert max(slow.terminal_m - FAR, slow.terminal_rad - TURNED) < 1e-8
    return result


@pytest.mark.slow
@pytest.mark.parametrize("name", VEHICLES)
def test_a_tolerance_is_used_in_free_space(name):
    exact = found(to_goal(name))
    near, turned = found(to_goal(name, FAR)), found(to_goal(name, 0.0, TURNED))
    both = found(to_goal(name, FAR, TURNED))
    assert exact.terminal_error.position_m < 1e-9
    assert exact.terminal_error.heading_rad < 1e-9
    assert near.cost < exact.cost - 0.1  # 0.3 m at 1 to 2 m/s
    assert turned.cost < exact.cost
    assert both.cost <= min(near.cost, turned.cost) + 1e-6


@pytest.mark.parametrize(
    "name", quick_are(["unicycle"], ["unicycle", "car", "dubins"], exhaustive=True)
)
def test_a_tolerance_is_used_among_obstacles(name):
    body = {"obstacles": [STONE], "footprint": Box([0.4, 0.3])}
    exact, near = found(to_goal(name, **body)), found(to_goal(name, FAR, TURNED, **body))
    assert near.cost < exact.cost - 0.1
    assert near.audit.min_clearance_m > 0.0


def test_turning_at_the_end_is_left_out():
    body = {"obstacles": [STONE], "footprint": Box([0.4, 0.3])}
    exact, turned = found(to_goal("unicycle", **body)), found(to_goal("unicycle", 0, 0.2, **body))
    assert exact.plan.word[-1] == "spin"
    assert turned.cost < exact.cost - 0.02
    assert turned.terminal_error.heading_rad > 0.02


HORIZONS = {
    "fixed time": Horizon(time=20.0),
    "greatest time": Horizon(max_time=9.0),
    "few trims": Horizon(max_trims=3),
    "long trims": Horizon(min_coast=0.3, max_trims=3),
}


@pytest.mark.slow
@pytest.mark.parametrize("horizon", HORIZONS.values(), ids=HORIZONS.keys())
def test_other_conditions_hold_too(horizon):
    cost = Cost(effort=1.0) if horizon.time or horizon.max_time else Cost(time=1.0)
    exact = found(to_goal("unicycle", cost=cost, horizon=horizon))
    near = found(to_goal("unicycle", FAR, TURNED, cost=cost, horizon=horizon))
    assert near.cost < exact.cost
    if horizon.time:
        assert near.plan.duration == pytest.approx(horizon.time, abs=1e-9)
    assert near.plan.duration <= (horizon.max_time or np.inf) + 1e-9
    assert len(near.plan.word) <= (horizon.max_trims or np.inf)
    plan_ = zip(near.plan.trims, near.plan.durations.tolist(), strict=True)
    lasting = [time for trim, time in plan_ if not trim.is_rest]
    assert min(lasting) >= horizon.min_coast - 1e-9


@pytest.mark.slow
def test_a_blocked_goal_is_reached_beside_it():
    on_it = Disc(0.05, [4.5, 1.0])
    exact = to_goal("car", obstacles=[on_it], footprint=Disc(0.1))
    assert plan(exact, time_limit=LIMIT).status is PlanStatus.GOAL_BLOCKED
    near = replace(exact, goals=(replace(exact.goals[0], tolerance_m=FAR),))
    result = found(near)
    assert result.terminal_error.position_m > 0.15
    blocked = replace(near, obstacles=[Disc(0.5, [4.5, 1.0])])
    assert plan(blocked, time_limit=LIMIT).status is PlanStatus.GOAL_BLOCKED


def test_trims_that_are_slower_than_the_vehicle_bound_nothing():
    """Its trims need 14 s to the nearest place within; it accelerates to 1.87 m/s and brakes."""
    model = SecondOrderUnicycle(
        max_speed=2.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=10.0
    )
    slow = Automaton.of_model(model, {"speed": [0.0, 0.25], "turn_rate": [-1.0, 0.0, 1.0]})
    goal = Goal([4.0, 0.0, 0.0], tolerance_m=0.5)
    stones = [Disc(0.1, [4.1, 0.0]), Disc(0.3, [2.0, 0.0])]
    search = SearchSettings(max_expansions=300, polish=False)
    body = Disc(0.2)
    problem = Problem(slow, [0, 0, 0], goal, obstacles=stones, footprint=body, search=search)
    bound = plan(problem, time_limit=LIMIT).lower_bound
    assert 0.0 < bound <= 2.0 * 3.5**0.5


def test_a_slot_is_found_within_the_tolerance_of_a_blocked_goal():
    at = SE2([4.63, 1.17, 0.81])
    walls = [Box([3.0, 1.0], [0.0, 0.57]).moved(at), Box([3.0, 1.0], [0.0, -0.57]).moved(at)]
    problem = to_goal("unicycle", 0.4, 0.5, obstacles=walls, footprint=Box([0.8, 0.1]))
    aims = list(itertools.islice(free_aims(problem, problem.goals[0]), 3))
    assert len(aims) == 3
    for aim in aims:
        body = shapely.Polygon(problem.footprint[0].moved(SE2(aim.pose)).corners)
        assert not any(body.intersects(shapely.Polygon(wall.corners)) for wall in walls)
        off = problem.goals[0].off(aim.pose)
        assert off[0] <= 0.4
        assert off[1] <= 0.5


def test_who_is_there_already_need_not_move():
    problem = replace(to_goal("car", FAR, TURNED), start=np.add(GOAL, [0.2, 0.1, 0.1]))
    result = found(problem)
    assert (result.cost, result.plan.trims) == (0.0, ())


def test_unreachable_exactly_but_within_tolerance():
    ahead = robot({"ahead": (1, 0)})
    goal = Goal(pose=[2, 0.1, 0.05], tolerance_m=0.3, tolerance_rad=0.1)
    result = found(Problem(ahead, [0, 0, 0], goal))
    assert result.cost == pytest.approx(2.0 - np.sqrt(0.3**2 - 0.1**2), abs=1e-5)
    far = Goal(pose=[2, 0, 0.5], tolerance_rad=0.1)
    verdict = plan(Problem(ahead, [0, 0, 0], far), time_limit=LIMIT)
    assert verdict.status is PlanStatus.UNREACHABLE  # the heading is beyond the tolerance


@pytest.mark.slow
def test_alternatives_end_within_too():
    result = found(to_goal("car", FAR, TURNED), alternatives=2)
    assert len(result.alternatives) == 2


@pytest.mark.parametrize("beyond", [2e-5, 1e-4, 5e-4])
def test_no_trim_of_milliseconds_keeps_a_heading_within(beyond):
    car = VEHICLES["car"]
    x, y, heading = Plan([0, 0, 0], [car["S+"], car["L+"]], durations=[1.2, 1.5]).end
    goal = Goal(pose=[x, y, heading + TURNED + beyond], tolerance_rad=TURNED)
    result = found(Problem(car, [0, 0, 0], goal, search=QUICK))
    assert result.plan.durations.min() >= 0.02
    assert result.cost == pytest.approx(2.7, rel=1e-3)
