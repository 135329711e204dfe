"""Poses on the way: exact, in order or in the best order, the best headings, for all vehicles."""

from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.scenario.scenario import scenario_of_text
from maneuver_automaton.scenario.writing import to_yaml

ROBOT = ma.Automaton.of_controls(
    ma.Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
)
PLACES = ((1.2, 0.4), (1.9, 1.9), (0.5, 2.6))
START, GOAL = [0.0, 0.0, 0.0], [-1.0, 1.0, -1.5]


def planned(problem, expansions=300):
    """The answer, which passes all that is on the way; anybody's checks find so too."""
    search = replace(problem.search, max_expansions=expansions)
    problem = replace(problem, search=search)
    result = ma.plan(problem, time_limit=600.0)
    assert result.status is ma.PlanStatus.FOUND, result.reason
    assert result.audit.passed
    assert ma.verify(problem, result.plan).passed
    assert len(result.via) == len(problem.via)
    for one in result.via:
        assert max(problem.via[one.number - 1].off(one.pose)) < 1e-8
    return result


def dubins(begins, ends):
    """Shortest ways (...) forwards at radius 1 between poses (..., 3); Shkel, Lumelsky (2001)."""
    way = ends - begins
    d, along = np.hypot(way[..., 0], way[..., 1]), np.arctan2(way[..., 1], way[..., 0])
    a, b = begins[..., 2] - along, ends[..., 2] - along
    sin, cos, same = np.sin, np.cos, np.cos(a - b)

    def turn(angle):
        return np.mod(angle + 1e-12, 2 * np.pi) - 1e-12

    found = []
    with np.errstate(invalid="ignore"):
        for s in (1.0, -1.0):  # left first, or right
            u, v = s * a, s * b
            t = np.arctan2(cos(v) - cos(u), d + sin(u) - sin(v))
            straight = np.sqrt(2 + d * d - 2 * same + 2 * d * (sin(u) - sin(v)))
            found.append(turn(t - u) + straight + turn(v - t))
            p = np.sqrt(-2 + d * d + 2 * same + 2 * d * (sin(u) + sin(v)))
            t = np.arctan2(-cos(u) - cos(v), d + sin(u) + sin(v)) - np.arctan2(-2.0, p)
            found.append(turn(t - u) + p + turn(t - v))
            middle = (6 - d * d + 2 * same + 2 * d * (sin(v) - sin(u))) / 8
            p = turn(2 * np.pi - np.arccos(middle))
            t = turn(-u + np.arctan2(cos(v) - cos(u), d + sin(u) - sin(v)) + p / 2)
            found.append(t + p + turn(v - u - t + p))
    return np.fmin.reduce(found)


def cheapest(places, goal, *, count=720):
    """Cost, and heading at the first place, of the best way: by all headings of half a degree."""
    costs, poses, firsts = np.zeros(1), np.array([START]), None
    for place in (*places, None):
        angles = 2 * np.pi * np.arange(count) / count
        ends = np.column_stack([np.tile(place, (count, 1)), angles]) if place else np.array([goal])
        sums = costs[:, None] + dubins(poses[:, None], ends[None])
        before = sums.argmin(axis=0)
        firsts = angles if firsts is None else firsts[before]
        costs, poses = sums.min(axis=0), ends
    return costs[0], firsts[0]


@pytest.mark.slow
def test_the_best_heading_at_the_first_depends_on_the_third():
    """One search, not pieces glued together: beside it all headings of half a degree."""
    found = {}
    for third in ((0.5, 2.6), (3.9, 2.4)):
        places = (*PLACES[:2], third)
        least, first = cheapest(places, GOAL)
        via = [ma.Via(place, free_heading=True) for place in places]
        result = planned(ma.Problem(ROBOT, START, GOAL, via=via))
        assert result.cost == pytest.approx(least, rel=2e-3)
        assert result.lower_bound <= least
        found[third] = result.via[0].pose[2], first
    (one, best), (other, best_other) = found.values()
    assert abs(best - best_other) > 0.02
    assert abs(np.angle(np.exp(1j * (one - other)))) > 0.01


def test_a_moved_problem_has_the_moved_plan():
    via = [ma.Via([3, 3], free_heading=True, tolerance_m=0.3), ma.Via([6, 1], free_heading=True)]
    post = ma.Disc(0.3, [5, 1.2])
    problem = ma.Problem(ROBOT, START, [9, 0, 0], via=via, obstacles=post, footprint=ma.Disc(0.2))
    by = ma.SE2([4.0, -7.0, 2.0])
    result, moved = planned(problem, 30), planned(problem.moved(by), 30)
    assert moved.cost == pytest.approx(result.cost, rel=1e-9)
    ends = [by.act(one.pose[:2]).tolist() for one in result.via]
    assert [one.pose[:2].tolist() for one in moved.via] == [pytest.approx(end) for end in ends]


def test_of_headings_that_cost_the_same_a_moved_problem_has_the_moved_one():
    """Between those a vehicle that turns on the spot is free."""
    turns = {"right": (-0.25, -1), "left": (-0.25, 1), "spin": (0, 1)}
    trims = {"rest": (0, 0), "ahead": (1.5, 0)} | turns
    problem = ma.Problem(
        ma.Automaton.of_controls(ma.Unicycle(), trims),
        START,
        [4.7, 1.5, 0.3],
        via=[
            ma.Via([1.7, 1.8], free_heading=True, stay_s=1.2),
            ma.Via(gate=[[2.0, -1.3], [1.1, -1.6]]),
            ma.Via([1.9, -2.0], free_heading=True, stop=True),
        ],
        order="free",
        obstacles=[
            ma.Disc(0.3, [2.7, -1.5]),
            ma.Box([0.7, 0.3], [1.4, -1.1], 2.2),
            ma.Disc(0.2, [4.1, -1.2]),
            ma.Box([0.4, 0.2], [4.9, 0.8], 0.8),
        ],
        footprint=ma.Disc(0.2),
    )
    result, moved = (planned(one, 100) for one in (problem, problem.moved(ma.SE2([-3, 5, 0.3]))))
    assert moved.cost == pytest.approx(result.cost, rel=1e-9)


@pytest.mark.parametrize("kind", [{}, {"free_heading": True}, {"tolerance_m": 0.1}])
@pytest.mark.parametrize("lasting", [4e-9, 8e-5, 3e-3])
def test_no_trim_of_milliseconds_stays_beside_a_pose_on_the_way(kind, lasting):
    word = [ROBOT.trims[k] for k in (2, 1, 3, 2, 1, 3, 1)]
    for short in (2, 3):
        durations = np.array([0.4, 6.0, 0.3, 0.2, 5.0, 0.5, 9.0])
        durations[short] = lasting
        given = ma.Plan(START, word, durations=durations)
        via = ma.Via(given.pose_at(durations[:3].sum()), **kind)
        problem = ma.Problem(ROBOT, START, given.end, via=via)
        found = Incumbents(problem, UNLIMITED, Workspace(obstacles=()))
        assert found.offer(given, 0)
        best = found.plans[0].plan
        assert best.durations.min() >= 0.02
        assert ma.verify(problem, best).passed
        assert found.cost <= 1.001 * problem.cost_of(given)


def test_an_order_that_is_free_is_the_best_of_all():
    poses = [[6, 0, 0], [2, 0, 0], [4, 0, 0]]
    given = ma.Problem(ROBOT, START, [8, 0, 0], via=poses)
    result = planned(replace(given, order="free"))
    assert [one.number for one in result.via] == [2, 3, 1]
    assert result.cost == pytest.approx(8.0) == result.lower_bound
    assert planned(given).cost > 8.0
    turning = [[6, 2, 1], [2, -1, 3], [4, 4, -1]]
    result = planned(replace(given, order="free", via=turning))
    assert result.lower_bound == result.cost  # words of three trims are enough


def test_past_a_wide_gate_the_bound_is_no_lower_than_without_it():
    """The disc around the gate holds the start."""
    via = [ma.Via(gate=[[5, -9], [5, 9]]), ma.Via([7, 0], free_heading=True, stay_s=1.5)]
    for order in ("given", "free"):
        result = planned(ma.Problem(ROBOT, START, [9, 0, 0], via=via, order=order))
        assert result.lower_bound == pytest.approx(10.5) == result.cost


def test_a_leg_leaves_the_time_that_what_follows_needs_and_proves_nothing_for_others():
    controls = {"slow": (0.5, 0, 0), "fast": (2, 0, 0), "up": (0, 2, 0), "down": (0, -2, 0)}
    robot = ma.Automaton.of_controls(ma.Omnidirectional(), controls)
    problem = ma.Problem(robot, START, [4, 0, 0], via=[2.0, 0.0, 0.0], cost=ma.Cost(effort=1.0),
                         horizon=ma.Horizon(max_time=3.0))  # fmt: skip
    assert planned(problem).cost == pytest.approx(7.0)  # 4 / 3 s slow, 5 / 3 s fast
    # Round a wall the rest takes longer than the straight way for which the first leg leaves time.
    wall = {"obstacles": ma.Box([0.2, 4.0], [4.0, 0.0]), "footprint": ma.Disc(0.05)}
    problem = replace(problem, goals=[6.0, 0.0, 0.0], horizon=ma.Horizon(max_time=5.3), **wall)
    word = [robot[name] for name in ("fast", "up", "fast", "down")]
    assert ma.verify(problem, ma.Plan(START, word, durations=[1.0, 1.1, 2.0, 1.1])).passed
    result = ma.plan(problem, time_limit=600.0)
    assert result.status is not ma.PlanStatus.UNREACHABLE, result.reason


def test_a_gate_is_crossed_and_a_stop_lasts():
    via = [ma.Via(gate=[[3, -1], [3, 2]]), ma.Via([6, 0, 0], stay_s=2.0)]
    result = planned(ma.Problem(ROBOT, START, [9, 0, 0], via=via))
    assert result.cost == pytest.approx(11.0)
    assert "rest" in result.plan.word
    (entry, stop) = plan_to_dict(result)["via"]
    assert (entry["number"], stop["number"], stop["time_s"]) == (1, 2, pytest.approx(6.0))


def by_one_maneuver(model, driven, *, goal, via, **more):
    """A problem whose library is a rest and one maneuver that ends in it, and the plan of that."""
    none, state = np.zeros(2), np.zeros(len(model.reduced_names))
    rest = ma.Trim(name="rest", body_velocity=START, control=none, reduced_state=state)
    controls, times = zip(*driven, strict=True)
    course = drive(model, state, control=controls, durations=times)
    there = ma.Maneuver.along(course, name="there", source="rest", target="rest")
    known = ma.Plan(START, [rest, rest], durations=[0.0, 0.0], maneuvers=[there])
    library = ma.Automaton(model, (rest,), (there,))
    return ma.Problem(library, START, goal, via=ma.Via(via), **more), known


def in_motion():
    limits = {"max_acceleration": 0.2, "max_angular_acceleration": 2.0}
    model = ma.SecondOrderUnicycle(max_speed=1.0, max_turn_rate=1.0, **limits)
    driven = [([0.2, 0], 5), ([0, 0], 1), ([-0.2, 0], 5)]
    return by_one_maneuver(model, driven, goal=[6, 0, 0], via=[3, 0, 0])


def out_and_back():
    driven, one = (
        [([1, 0], 4), ([-1, 0], 5)],
        drive(ma.Unicycle(), [], control=[[1, 0]], durations=[1]),
    )
    problem, known = by_one_maneuver(ma.Unicycle(), driven, goal=[-1, 0, 0], via=[4, 0, 0])
    step = ma.Maneuver.along(one, name="step", source="rest", target="rest", cost_multiplier=9.0)
    maneuvers = *problem.automaton.maneuvers, step
    return replace(problem, automaton=replace(problem.automaton, maneuvers=maneuvers)), known


def bent():
    """With its trailer straight, it would touch a disc behind it."""
    model = ma.CarWithTrailer(wheelbase=1.0, hitch_length=1.5, max_steering=0.6, max_speed=1.0)
    there = SE2.exp([2.0, 0.0, 2.0 * np.tan(0.5)])
    disc = ma.Disc(0.1, there.act(np.array([-1.5, 0.0])))
    driven = [([1, 0.5], 2), ([-1, 0.5], 2), ([1, 0], 1)]
    bodies = {"footprint": ma.Box([0.3, 0.2]), "parts": {"trailer": ma.Box([0.3, 0.1])}}
    return by_one_maneuver(model, driven, goal=[1, 0, 0], via=there.pose, obstacles=disc, **bodies)


def cheaper_rest():
    controls = {"steered": (0.0, 0.6), "rest": (0.0, 0.0), "ahead": (1.0, 0.0)}
    car = ma.Automaton.of_controls(ma.Car(wheelbase=1.0, max_steering=0.8), controls)
    trims = [car["ahead"], car["rest"], car["ahead"]]
    known = ma.Plan(START, trims, durations=[3.0, 2.0, 3.0])
    stay, cost = ma.Via([3, 0, 0], stay_s=2.0), ma.Cost(time=0.1, effort=1.0)
    return ma.Problem(car, START, [6, 0, 0], via=stay, cost=cost), known


@pytest.mark.parametrize("stated", [in_motion, out_and_back, bent, cheaper_rest])
def test_nothing_is_proven_against_a_plan_that_passes(stated):
    problem, known = stated()
    assert (judged := ma.verify(problem, known)).passed
    result = ma.plan(replace(problem, search=ma.SearchSettings(max_expansions=100)))
    assert result.status in (ma.PlanStatus.FOUND, ma.PlanStatus.NO_PLAN)
    assert (result.lower_bound or 0.0) <= judged.cost * (1.0 + 1e-9)


def test_among_obstacles():
    wall = ma.Box([0.4, 4.0], [4.0, 0.0])
    via = [ma.Via([2, -2], free_heading=True, tolerance_m=0.2), ma.Via([4, 3, 0])]
    planned(
        ma.Problem(ROBOT, START, [8, 0, 0], via=via, obstacles=wall, footprint=ma.Box([0.4, 0.3]))
    )
    inside = ma.Problem(ROBOT, START, [8, 0, 0], via=ma.Via([4, 0, 0]), obstacles=wall)
    result = ma.plan(inside, time_limit=1.0)
    assert result.status is ma.PlanStatus.GOAL_BLOCKED
    assert result.reason.startswith("pose 1 on the way: the vehicle touches")


@pytest.mark.slow
def test_with_inertia_it_passes_in_motion_or_stops():
    car = ma.load_stock_library("second_order_car")
    passing = ma.Problem(car, [0, 0, 0], [20, 0, 0], via=ma.Via([10, 0, 0]))
    fast = planned(passing)
    stops = planned(replace(passing, via=(ma.Via([10, 0, 0], stop=True),)))
    assert fast.cost < stops.cost
    assert not ma.verify(replace(passing, via=(ma.Via([10, 0, 0], stop=True),)), fast.plan).passed
    beside = ma.Via([10, 3, 0], free_heading=True, stay_s=2.0)  # polished by legs alone: 25.1
    stays = planned(replace(passing, via=(beside,)))
    assert stays.cost < 16.0
    assert 2.0 in stays.plan.durations


def test_with_inertia_backwards_alone():
    car = ma.load_stock_library("second_order_car")
    back = [one for one in car.trims if one.reduced_state[0] == -1.0]
    names = {one.name for one in back}
    joins = [one for one in car.maneuvers if {one.source, one.target} <= names]
    trim = "speed -1, steering 0"
    problem = ma.Problem(
        ma.Automaton(car.model, back, joins), [0, 0, 0], ma.Goal([-20, 0, 0], trim=trim),
        start_trim=trim, via=ma.Via([-8, 0], free_heading=True, tolerance_m=1.0),
        search=ma.SearchSettings(polish=False),
    )  # fmt: skip
    assert planned(problem).plan.word == (trim,)


def test_in_space():
    controls = {"on": (1, 0, 0), "left": (1, 1, 0), "right": (1, -1, 0), "up": (1, 0, 0.5)}
    controls["down"] = (1, 0, -0.5)
    flyer = ma.UserModel(
        name="flyer",
        group=ma.SE2xR,
        control_names=("v", "w", "c"),
        velocity=lambda z, u: [u[0], 0 * u[0], u[1], u[2]],
    )
    robot = ma.Automaton.of_controls(flyer, controls)
    planned(ma.Problem(robot, [0, 0, 0, 0], [8, 0, 0, 0], via=ma.Via([4, 2, 0.3, 1])))


def test_a_plan_that_misses_is_refused():
    straight = ma.Plan(START, [ROBOT["ahead"]], durations=[8.0])
    for via, passed in (([3, 0, 0], True), ([3, 0, 0.1], False), ([3, 1e-6, 0], False)):
        problem = ma.Problem(ROBOT, START, [8, 0, 0], via=[via])
        assert ma.verify(problem, straight).passed is passed
    back = ma.Problem(ROBOT, START, [8, 0, 0], via=[[5, 0, 0], [3, 0, 0]])
    assert ma.verify(back, straight).reason == (
        "pose 2 on the way is not passed after those before it"
    )
    assert ma.verify(replace(back, order="free"), straight).passed


@pytest.mark.parametrize("last", [0.0202, 0.013])
def test_a_pose_just_before_the_end_of_a_turn_is_passed(last):
    """Then it turns back: how far it is off, place and turn together, may go on falling."""
    trims = [ROBOT[name] for name in ("ahead", "right", "left", "ahead")]
    plan = ma.Plan(START, trims, durations=[1.0, 1.0 + last, last, 1.7])
    problem = ma.Problem(ROBOT, START, plan.end, via=[plan.pose_at(2.0)])
    assert ma.verify(problem, plan).passed


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ma.Via(), "via: has neither a pose nor a gate"),
        (lambda: ma.Via([0, 0, 0], stay_s=-1), "via: stay_s must be at least 0"),
        (lambda: ma.Via(gate=[[1, 1], [1, 1]]), "need two places"),
        (lambda: ma.Via([5, 0, 0], gate=[[1, -1], [1, 1]]), "beside the gate"),
        (lambda: ma.Problem(ROBOT, START, GOAL, order="best"), "order must be one of"),
        (lambda: ma.Problem(ROBOT, START, GOAL, via=[START] * 13, order="free"), "at most 12"),
        (lambda: ma.Problem(ROBOT, START, GOAL, via=ma.Via([0, 0, 0, 1])), "need 3"),
        (
            lambda: ma.Problem(ROBOT, START, GOAL, via=[START], horizon=ma.Horizon(time=9)),
            "need a free final time",
        ),
        (
            lambda: ma.FleetProblem([ma.Problem(ROBOT, START, GOAL, via=[START])]),
            "has poses on its way",
        ),
    ],
)
def test_what_is_wrong_is_told(make, said):
    with pytest.raises(ValueError, match=said):
        make()


HEAD = """
schema: 1
vehicle: {model: unicycle}
automaton: {preset: table2}
start: {pose: [0, 1, 0]}
goal: {pose: [0, 0, 0]}
"""


def test_a_file_reads_back():
    text = HEAD + "order: free\nvia:\n  - {pose: [1, 2], free_heading: true, tolerance_m: 0.5}\n"
    text += "  - {gate: [[1, 2], [3, 4]], stop: true}\n  - {pose: [1, 2, 3], stay_s: 2}\n"
    once = scenario_of_text(text, name="via")
    assert once.problem.order == "free"
    assert len(once.problem.via) == 3
    assert to_yaml(scenario_of_text(to_yaml(once), name="via")) == to_yaml(once)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{pose: [1, 2]}", "need \\[x, y, heading\\], or free_heading: true"),
        ("{stop: true}", "got neither pose nor gate"),
        ("{gate: [[1, 2]]}", "need a list of two points"),
        ("{pose: [1, 2, 0], heading: free}", "unknown key"),
    ],
)
def test_a_malformed_file_is_told(line, said):
    with pytest.raises(InvalidScenario, match=said):
        scenario_of_text(HEAD + f"via:\n  - {line}\n", name="via")


def test_a_planner_passes_poses_on_the_way():
    robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "left": (1.0, 1.0)})
    way = [ma.Via([4, 0, 0])]
    result = ma.Planner(robot).plan([0, 0, 0], [8, 0, 0], via=way, time_limit=20.0)
    assert result.cost == pytest.approx(8.0)
    assert len(result.via) == 1
