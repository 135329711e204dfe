"""Plans among obstacles: what is promised holds, the verdicts are true, the law moves plans."""

from __future__ import annotations

import functools
import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle, UserModel
from maneuver_automaton.places import Ground
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from tests import scenes, test_planning
from tests.matrix.vehicles import VEHICLES
from tests.quickly import quick_are
from tests.solids import check_plan

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
ROBOT, CAR = scenes.differential_robot(), scenes.reeds_shepp(1.0)
BODY = (Box([0.8, 0.5], [0.1, 0.0]),)
RING = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BLOCKS = (
    Obstacle(Box([2.0, 0.4], [2.0, 0.6], 0.4), name="shelf"),
    Obstacle(Disc(0.5, [3.4, -0.9])),
    Obstacle(Box([0.6, 2.0], [1.0, -1.8])),
)
QUICK = SearchSettings(max_expansions=400)
BASE = Problem(CAR, [0, 0, 0], [4.5, 1.0, 0.5], obstacles=BLOCKS, footprint=BODY, search=QUICK)
ROBOTS = replace(BASE, automaton=ROBOT)
EASY = replace(ROBOTS, obstacles=(Obstacle(Box([0.5, 0.5], [1.0, 3.0])),), footprint=(Disc(0.2),),
               goals=(Goal(pose=[2.0, 1.0, 0.0]),))  # fmt: skip


def planned(problem, **more):
    """Plan, and check all that holds for every answer."""
    result = plan(problem, time_limit=LIMIT, **more)
    assert_consistent(result)
    return result


def found(problem, **more):
    result = planned(problem, **more)
    assert result.status is PlanStatus.FOUND, result.reason
    return result


def assert_consistent(result):
    n, problem, horizon = len(result.alternatives), result.problem, result.problem.horizon
    test_planning.assert_consistent(result, alternatives=n, price=Problem.cost_of)
    if result.plan is None:
        return
    for one in (result, *result.alternatives):
        assert one.cost == problem.cost_of(one.plan)
        assert one.plan.start_time == problem.start_time
        assert all(a != b for a, b in itertools.pairwise(one.plan.word))
        moving = [
            d for trim, d in zip(one.plan.trims, one.plan.durations, strict=True)
            if trim.body_velocity.any()
        ]  # fmt: skip
        assert min(moving, default=math.inf) >= horizon.min_coast - 1e-9
    slow = check_plan(problem, result.plan, result.goal_index)
    assert slow.passes(problem, result.goal_index), slow
    goal = problem.goals[result.goal_index]
    assert slow.terminal_m < goal.tolerance_m + 1e-8
    assert slow.terminal_rad < goal.tolerance_rad + 1e-8
    if problem.obstacles:
        clear = result.clearance_m
        assert clear is None or slow.clearance_m >= clear - 0.11 * clear - 1e-3
    costs = [result.cost, *(other.cost for other in result.alternatives)]
    assert costs == sorted(costs)


# --- what is promised, for every kind of problem ---

KINDS = {
    "car": BASE,
    "robot": ROBOTS,
    "dubins": replace(BASE, automaton=scenes.dubins(0.8), footprint=(Disc(0.25),)),
    "prices": replace(BASE, cost=Cost(time=1.0, switch=0.2, direction_change=0.7)),
    "effort": replace(ROBOTS, cost=Cost(effort=1.0, norm=0.5)),
    "few trims": replace(
        BASE, horizon=Horizon(max_trims=5), search=SearchSettings(max_expansions=1200)
    ),
    "long trims": replace(BASE, horizon=Horizon(min_coast=0.25)),
    "little time": replace(ROBOTS, horizon=Horizon(max_time=13.0), cost=Cost(effort=1.0)),
    "fixed time": replace(ROBOTS, horizon=Horizon(time=25.0), cost=Cost(effort=1.0)),
    "margin": replace(BASE, margin=0.06),
    "wide margin": replace(ROBOTS, margin=0.12, footprint=(Disc(0.2),)),
    "bounds": replace(BASE, bounds=Bounds(x=(-0.6, 5.0), y=(-1.5, 2.5))),
    "point": replace(BASE, footprint=()),
    "two parts": replace(BASE, footprint=(*BODY, Disc(0.2, [0.6, 0.1]))),
    "map": replace(BASE, obstacles=(
        OccupancyMap(np.random.default_rng(1).random((9, 12)) < 0.12, resolution=0.25,
                     origin=[1.0, -1.5, 0.3]),)),
    "started late": replace(ROBOTS, start_time=100.0),
    "nothing there": replace(BASE, obstacles=(), search=replace(QUICK, method="lattice")),
    "free heading": replace(BASE, goals=(Goal(pose=[4.5, 1.0, 0.5], free_heading=True),)),
    "tolerance": replace(BASE, goals=(Goal(pose=[4.5, 1.0, 0.5], tolerance_m=0.1),)),
}  # fmt: skip


@pytest.mark.parametrize(
    "name", quick_are(KINDS.keys() - {"long trims", "point", "tolerance"}, KINDS)
)
def test_plans_keep_what_is_promised(name):
    result = found(KINDS[name], alternatives=2)
    expected = {"search", "first_plan", "refine", "audit"}
    assert expected <= result.timing_s.keys()
    assert result.counts["expansions"] > 0
    times = [time for time, _ in result.improvements]
    costs = [cost for _, cost in result.improvements]
    assert times == sorted(times)
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] == pytest.approx(result.cost, rel=1e-7)  # before its end is closed


def test_a_price_on_a_fixed_time_changes_no_plan():
    # what the rest that pads costs is no reason to stop looking for something cheaper
    horizon = Horizon(time=32.0)
    free = found(replace(ROBOTS, cost=Cost(effort=1.0), horizon=horizon))
    priced = found(replace(ROBOTS, cost=Cost(effort=1.0, time=1.0), horizon=horizon))
    assert priced.counts == free.counts
    assert priced.plan.word == free.plan.word
    assert priced.cost == pytest.approx(free.cost + 32.0, abs=1e-9)
    assert priced.lower_bound == pytest.approx(free.lower_bound + 32.0, abs=1e-9)


@pytest.mark.slow
def test_hardly_turning_costs_what_driving_straight_does():
    costs = []
    for turn in (0.0, 5.6e-17):
        automaton = Automaton.of_controls(
            Unicycle(), {"on": (1.0, turn), "left": (1.0, 1.0), "right": (1.0, -1.0)}
        )
        wall = (Obstacle(Box([1.0, 2.0], [4.0, 0.0])),)
        problem = replace(BASE, automaton=automaton, goals=(Goal(pose=[8, 0, 0]),),
                          obstacles=wall, footprint=(Box([1.0, 0.5]),),
                          search=SearchSettings(max_expansions=1500))  # fmt: skip
        costs.append(plan(problem, time_limit=LIMIT).cost)
    assert costs[1] == pytest.approx(costs[0], rel=0.01)


OMNI = UserModel(name="omni", group=SE2, control_names=("ahead", "aside", "turn"),
                 velocity=lambda z, u: [u[0], u[1], u[2]])  # fmt: skip
UNSTEERED = {  # what no three trims with a turn among them can reach
    "one straight": (Unicycle(), {"on": (1, 0)}, [3, 0, 0]),
    "to and fro": (Unicycle(), {"on": (1, 0), "back": (-1, 0)}, [-3, 0, 0]),
    "one circle": (Unicycle(), {"left": (1, 1)}, [1, 1, math.pi / 2]),
    "one spin": (Unicycle(), {"spin": (0, 1)}, [0, 0, 2]),
    "shifts": (OMNI, {"e": (1, 0, 0), "w": (-1, 0, 0), "n": (0, 1, 0), "s": (0, -1, 0)}, [3, 2, 0]),
}  # fmt: skip


@pytest.mark.parametrize("name", UNSTEERED)
def test_libraries_that_cannot_be_steered(name):
    model, controls, goal = UNSTEERED[name]
    automaton = Automaton.of_controls(model, controls)
    problem = replace(EASY, automaton=automaton, goals=(Goal(pose=goal),),
                      obstacles=(Obstacle(Box([0.5, 0.5], [1.0, 5.0])),))  # fmt: skip
    free = plan(replace(problem, obstacles=(), search=SearchSettings()), time_limit=LIMIT)
    result = plan(problem, time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.cost == pytest.approx(free.cost)


def test_a_library_that_does_not_move():
    still = Automaton.of_controls(Unicycle(), {"rest": (0, 0)})
    result = plan(replace(EASY, automaton=still), time_limit=LIMIT)
    assert (result.status, result.reason) == (
        PlanStatus.UNREACHABLE, "no trim of the library moves"
    )  # fmt: skip


def test_the_bound_knows_every_trim_of_a_large_library():
    controls = {f"{v} {w}": (v, 0.0, w) for v in (1.0, -1.0) for w in (-1.0, -0.5, 0.0, 0.5, 1.0)}
    sideways = {"left": (0.0, 0.5, 0.0), "right": (0.0, -0.5, 0.0)}
    automaton = Automaton.of_controls(OMNI, {**controls, **sideways})
    problem = replace(EASY, automaton=automaton, goals=(Goal(pose=[0.0, 8.0, 0.0]),),
                      obstacles=(Obstacle(Box([1.0, 1.0], [4.0, 0.0])),),
                      cost=Cost(effort=1.0))  # fmt: skip
    result = plan(problem, time_limit=LIMIT)
    assert result.lower_bound <= 4.0 + 1e-9  # straight to the left at 0.5 m/s, for 16 s


@pytest.mark.slow
def test_a_start_that_keeps_the_margin_at_a_corner_is_left():
    place = 1.0 - 0.27 / math.sqrt(2.0)  # corner to corner 0.27 m
    problem = replace(ROBOTS, start=np.array([place, place, 0.0]), footprint=(Box([2.0, 2.0]),),
                      goals=(Goal(pose=[-2.0, -1.0, 0.0]),), margin=0.2,
                      obstacles=(Obstacle(Box([2.0, 2.0], [3.0, 3.0])),))  # fmt: skip
    assert plan(problem, time_limit=LIMIT).status is PlanStatus.FOUND


# --- determinism ---


def test_with_max_expansions_the_time_limit_changes_nothing():
    results = [plan(BASE, time_limit=limit) for limit in (20.0, 60.0)]
    assert results[0].plan.word == results[1].plan.word
    assert results[0].plan.durations.tobytes() == results[1].plan.durations.tobytes()
    costs = [[cost for _, cost in result.improvements] for result in results]
    assert costs[0] == costs[1]
    assert results[0].counts == results[1].counts


# --- several goals, no way to go, any heading ---


@pytest.mark.parametrize(("off", "heading"), [((-1e-8, 0.0, 0.0), 0.0), ((1e-9, 2e-9, 1e-9), 2.3)])
def test_what_no_check_takes_for_the_goal_yet_is_reached_once_round(off, heading):
    always_on = Automaton.of_controls(ROBOT.model, {"S": (1, 0), "L": (1, 1), "R": (1, -1)})
    obstacles = (Obstacle(Disc(0.5, [9.0, 9.0])),)
    start = np.array([0.0, 0.0, heading])
    result = found(Problem(always_on, start, start + off, obstacles=obstacles, search=QUICK))
    assert result.cost <= 2.0 * math.pi + 1e-6  # a full turn, and what is left
    met = found(Problem(always_on, start, start + np.array(off) / 20.0, obstacles=obstacles))
    assert met.cost <= 1e-8


def test_straight_on_by_hand():
    result = found(replace(BASE, goals=(Goal(pose=[-2.0, 0.0, 0.0]),)))
    assert result.plan.word == ("S-",)
    assert result.cost == pytest.approx(2.0)
    assert result.gap == pytest.approx(0.0, abs=1e-9)


# --- verdicts ---

COURT = Obstacle(Polygon(3.0 * RING, [2.5 * RING]), name="court")


def test_a_goal_walled_in_cannot_be_reached():
    outside = replace(BASE, start=np.array([9.0, 1.0, 0.0]), obstacles=(COURT,),
                      goals=(Goal(pose=[0.0, 0.0, 0.3]),))  # fmt: skip
    result = planned(outside)
    assert (result.status, result.reason) == (
        PlanStatus.UNREACHABLE, "obstacles enclose the goal"
    )  # fmt: skip
    inside = replace(outside, start=np.zeros(3), goals=(Goal(pose=[9.0, 1.0, 0.0]),))
    result = planned(inside)
    assert (result.status, result.reason) == (
        PlanStatus.UNREACHABLE, "obstacles enclose the start"
    )  # fmt: skip


def gapped(width):
    """A court with a gate of `width` [m] on its right side."""
    half = 0.5 * width
    sides = [Box([0.5, 6.0], [-2.75, 0.0]), Box([6.0, 0.5], [0.0, 2.75]),
             Box([6.0, 0.5], [0.0, -2.75])]  # fmt: skip
    posts = [Box([0.5, 3.0 - half], [2.75, sign * (half + 0.5 * (3.0 - half))]) for sign in (1, -1)]
    return tuple(map(Obstacle, (*sides, *posts)))


@pytest.mark.parametrize("width", [0.01, 0.49, 0.51, 0.6])
def test_an_open_court_is_never_said_to_be_closed(width):
    """A way for the reference point's disc counts: the gate need not be wide enough for it."""
    problem = replace(ROBOTS, obstacles=gapped(width), goals=(Goal(pose=[6.0, 0.0, 0.0]),))
    result = planned(problem)
    if width > 0.5:
        assert result.status is not PlanStatus.UNREACHABLE
    if width > 0.55:
        assert result.status is PlanStatus.FOUND
    if width < 0.3:
        assert result.status is PlanStatus.UNREACHABLE


def test_a_goal_on_the_rim_of_the_bounds_can_be_reached():
    wall = (Obstacle(Box([1.0, 4.0], [5.5, 0.0])),)
    problem = replace(ROBOTS, start=np.array([1.0, 0.0, 0.0]), goals=(Goal(pose=[10, 0, 0]),),
                      obstacles=wall, footprint=(Box([2.0, 2.0]),),
                      bounds=Bounds(x=(0.0, 10.0), y=(-10.0, 10.0)))  # fmt: skip
    assert plan(problem, time_limit=LIMIT).status is not PlanStatus.UNREACHABLE


def test_bounds_are_walls():
    # the gap beside the wall is outside the bounds
    wall = (Obstacle(Box([0.5, 4.0], [2.5, 0.0])),)
    problem = replace(ROBOTS, obstacles=wall, goals=(Goal(pose=[5.0, 0.0, 0.0]),))
    assert found(problem).cost > 5.0
    closed = planned(replace(problem, bounds=Bounds(x=(-2.0, 7.0), y=(-2.05, 2.05))))
    assert (closed.status, closed.reason[:17]) == (PlanStatus.UNREACHABLE, "obstacles enclose")


def test_out_of_budget():
    hidden = scenes.bay(2.1, 4.3)
    result = planned(replace(hidden, search=SearchSettings(max_expansions=5)))
    assert result.status is PlanStatus.OUT_OF_BUDGET
    assert "5 expansions" in result.reason
    assert re.search(r"the nearest node is \S+ m and \S+ rad off", result.reason)
    late = plan(hidden, time_limit=1e-6)
    assert late.status is PlanStatus.OUT_OF_BUDGET


def test_too_little_time_is_named():
    problem = replace(ROBOTS, horizon=Horizon(max_time=2.0))
    result = planned(problem)
    assert result.status is PlanStatus.UNREACHABLE
    assert result.reason.startswith("the goal cannot be reached in 2 s: way and turn alone take at")


@pytest.mark.parametrize("place_costs", [(), Ground(Box([1.0, 1.0]), 3.0)])
def test_a_start_that_is_the_goal_takes_no_time_of_a_large_library(place_costs):
    robot = VEHICLES["four_wheel_steering_car"]
    problem = robot.problem(
        goals=np.zeros(3),
        obstacles=Disc(0.5, [3.0, 0.0]),
        horizon=Horizon(max_time=1.0),
        place_costs=place_costs,
    )
    assert found(problem).plan.word == ()


def test_a_library_that_cannot_turn():
    straight = Automaton.of_controls(Unicycle(), {"on": (1.0, 0.0), "back": (-1.0, 0.0)})
    result = planned(replace(BASE, automaton=straight))
    assert result.status is PlanStatus.UNREACHABLE
    assert result.reason == "no trim of the library turns, and the goal is 0.5 rad away"


# --- a moved problem has the moved plan ---


def quick(problem, n=250):
    return replace(problem, bounds=Bounds(), search=SearchSettings(max_expansions=n))


def assert_moved(problem, by, *, atol=1e-7):
    here, there = (plan(one, time_limit=LIMIT) for one in (problem, problem.moved(by)))
    assert here.status is there.status, there.reason
    if here.plan is None:
        return False
    assert here.plan.word == there.plan.word
    assert there.plan.durations == pytest.approx(here.plan.durations, abs=atol)
    assert there.cost == pytest.approx(here.cost, rel=atol)
    assert here.goal_index == there.goal_index
    return True


@functools.cache
def lively_scenes():
    """Random scenes whose ends are free, still and moving."""
    seeds = [seed for seed in range(120) if plan_is_worth_it(scenes.random_scene(seed))]
    return [scenes.random_scene(seed) for seed in seeds]


def plan_is_worth_it(problem):
    from maneuver_automaton.planning.blocked import blocked_ends

    return blocked_ends(replace(problem, bounds=Bounds())) is None and bool(problem.obstacles)


@pytest.mark.slow
def test_turned_and_shifted_a_little():
    rng = np.random.default_rng([1, 0])
    plans = 0
    for problem in lively_scenes()[::4][:4]:
        by = SE2([*rng.uniform(-50.0, 50.0, 2), rng.uniform(-3.0, 3.0)])
        plans += assert_moved(quick(problem), by)
    assert plans >= 2


@pytest.mark.slow
def test_far_away():
    # on a raster that numbers hold exactly, so that the far problem is the same one
    rng = np.random.default_rng(9)
    blocks = [
        Obstacle(Box(rng.integers(4, 16, 2) / 8.0, rng.integers(-30, 30, 2) / 8.0))
        for _ in range(6)
    ]
    cells = OccupancyMap(rng.random((8, 8)) < 0.1, resolution=0.25, origin=[3.0, 2.0, 0.0])
    cart = Obstacle(Disc(0.25), motion=Motion([0, 8], [[-4, -5, 0], [4, 5, 0]]))
    far = 2.0 ** round(9 * math.log2(10.0))
    start, goal = [-5.0, -5.0, 0.5], [5.5, 5.5, 0.0]
    for obstacles in (blocks, [*blocks, cells], [*blocks, cart]):
        problem = Problem(ROBOT, start, goal, obstacles=obstacles, footprint=Disc(0.25),
                          search=replace(QUICK, max_expansions=150))  # fmt: skip
        assert_moved(problem, SE2([far, -far, 0.0]))


@pytest.mark.slow
def test_among_what_moves():
    rng = np.random.default_rng(4)
    for seed in range(2):
        problem = quick(scenes.moving_scene(seed, moving=5), n=1000)
        by = SE2([*rng.integers(-99, 99, 2).astype(float), 0.0])
        assert_moved(problem, by)


@pytest.mark.slow
def test_a_costly_price_of_a_switch_is_no_wall():
    problem = replace(KINDS["dubins"], cost=Cost(time=1.0, switch=240), obstacles=(BLOCKS[1],))
    costly = found(replace(problem, search=SearchSettings(max_expansions=4000)))
    plain = found(replace(problem, cost=Cost(time=1.0)))
    assert len(costly.plan.word) <= len(plain.plan.word)
    assert len(costly.plan.word) <= 5


@pytest.mark.slow
@pytest.mark.parametrize("heading", ["free", "several"])
def test_the_table_of_costs_serves_every_goal(heading):
    # a bay: what guides the search is the cost to go without obstacles
    bay = scenes.bay(2.6, 6.0)
    goal = bay.goals[0]
    goals = (
        (replace(goal, free_heading=True),)
        if heading == "free"
        else (goal, replace(goal, pose=goal.pose + np.array([0.0, 0.05, 0.0])))
    )
    result = found(replace(bay, goals=goals, search=SearchSettings(max_expansions=3000)))
    alone = found(replace(bay, search=SearchSettings(max_expansions=3000)))
    assert result.cost <= alone.cost * 1.05


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.05, 0.22])
def test_a_small_disc_finds_the_way_round_a_thin_wall(radius):
    walls = [Box([60, 0.05], [50, 50]), Box([0.05, 60], [20, 20]), Box([0.05, 60], [80, 20])]
    problem = Problem(
        ROBOT, [50, 45, 0], [50, 52, 0], obstacles=walls, footprint=Disc(radius),
        search=SearchSettings(max_expansions=20_000),
    )  # fmt: skip
    result = found(problem)
    assert result.cost > 2 * 130.0  # at 0.5 m/s, out of the trap and round it
