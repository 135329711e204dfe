"""Certified lower bounds: admissible, below every plan, and refused where they are not."""

import math
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.bounds import cell_proofs, pose_scene
from maneuver_automaton.bounds.cells import PoseCells, finer, first_cells, on_finer
from maneuver_automaton.bounds.families import motions_of
from maneuver_automaton.bounds.levels import _goal_cells, _in_the_plane, _nodes_of
from maneuver_automaton.bounds.program import program_of, slope
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.models import UserModel
from tests.quickly import quick_are

CAR = ma.Car(wheelbase=2.8, max_steering=0.6)
SHUTTLE = ma.Automaton.of_controls(
    CAR, {f"{v} {s}": (v, s) for v in (1, -1) for s in (-0.6, 0.0, 0.6)}
)
BODY = ma.Box([4.7, 1.9], [1.35, 0.0])
LENGTH = ma.Cost(length=1.0)
WORK = 2_000_000
WALL = [ma.Box([1.0, 7.0], [8.0, 9.5]), ma.Box([1.0, 10.0], [8.0, -2.0])]  # a gap of 3 m


def among(obstacles, goal=(15.0, 1.0, 0.3), **more):
    more = {"cost": LENGTH, "footprint": BODY} | more
    return ma.Problem(SHUTTLE, [0, 0, 0], list(goal), obstacles=obstacles, **more)


def solved(problem, *, steps=400, size=0.8):
    """A program of one level after some steps, and where it starts."""
    scene, motions = pose_scene(problem, frame=problem.goals[0].pose), motions_of(problem)
    start = scene.world.into(problem.start)
    box = np.array([-20.0, -10.0, 6.0, 10.0])
    cells = first_cells(scene, size=size, headings=32, box=box)
    goals = tuple(
        ma.Goal(pose=scene.world.into(goal.pose), free_heading=goal.free_heading)
        for goal in problem.goals
    )
    node = tuple(np.rint(cells.coordinates(goals[0].pose)).astype(int).tolist())
    fixed = _nodes_of(cells, _goal_cells(cells, goals), exact=node)
    gears = 2 if motions.price else 1
    value = _in_the_plane(cells, fixed, gears) / motions.speed
    program = program_of(cells, motions, start=start, goal_nodes=fixed, value=value)
    program.weight = 100.0
    program.run(steps)
    return scene, program, cells.coordinates(start)


def falls(value, cells, at, direction, turn):
    """How fast a function (nodes) falls at coordinates along a motion, by small differences."""
    step = 1e-6
    heading = (at[2] + cells.low[2]) * cells.turn
    moved = at.copy()
    moved[0] += step * direction * math.cos(heading) / cells.size
    moved[1] += step * direction * math.sin(heading) / cells.size
    moved[2] += step * turn / cells.turn
    return (cells.value_at(value[None], at) - cells.value_at(value[None], moved)) / step


@pytest.mark.parametrize("price", [0.0, 0.5])
def test_no_motion_in_an_active_cell_falls_faster_than_the_slope_says(price):
    problem = among(WALL, cost=ma.Cost(length=1.0, direction_change=price))
    _, program, _ = solved(problem, steps=150)
    cells, value = program.cells, program.value.astype(float)
    steep = slope(cells, program.columns, program.motions, value)
    rng = np.random.default_rng(1)
    chosen = rng.permutation(np.argwhere(cells.active))[:400]
    worst = 0.0
    for cell in chosen:
        at = cell + rng.uniform(0.01, 0.99, 3)
        for direction in (1.0, -1.0):
            gear = 1 if price and direction < 0.0 else 0
            for turn in (-1.0, 0.0, 1.0):
                rate = turn * program.motions.turn_rate
                worst = max(worst, falls(value[gear], cells, at, direction, rate))
    assert 0.3 * steep < worst <= steep * (1.0 + 1e-4)
    if price:
        assert np.abs(value[0] - value[1])[cells.active.shape[0] // 2].max() <= price * steep + 1e-6


@pytest.mark.slow
def test_a_function_raised_at_a_node_that_carries_flow_is_refused():
    _, program, at = solved(among(WALL), steps=1500)
    cells, value = program.cells, program.value.astype(float)
    motions, columns = program.motions, program.columns
    value /= slope(cells, columns, motions, value)
    nodes, weights = cells.corners(at)
    node = (0, *nodes[int(weights.argmax())])
    value[node] += 0.01 * value[node]
    assert slope(cells, columns, motions, value) > 1.001


def test_a_finer_level_holds_the_same_function():
    problem = among(WALL)
    scene, program, _ = solved(problem, steps=20)
    cells, value = program.cells, program.value.astype(float)
    halved = finer(cells, cells.active > 0, scene)
    same = on_finer(cells, halved, value)
    rng = np.random.default_rng(2)
    for pose in rng.uniform(-3, 3, (50, 3)):
        coarse = cells.value_at(value, cells.coordinates(pose))
        assert halved.value_at(same, halved.coordinates(pose)) == pytest.approx(coarse, abs=1e-9)


@pytest.mark.parametrize(
    "goal", quick_are([(0, 2, 0)], [(6, 3, 0.9), (0, 2, 0), (-3, 1, 2.5), (2, -4, -1.5)])
)
def test_no_bound_in_free_space_exceeds_the_shortest_path(goal):
    problem = among((), goal=goal)
    shortest = ma.plan(problem).cost
    bound = ma.lower_bound(problem, max_work=WORK, time_limit=1e3)
    assert 0.5 * shortest < bound.value <= shortest * (1.0 + 1e-9)


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("price", quick_are([0.0], [0.0, 1.0]))
def test_a_bound_among_obstacles_knows_no_plan_and_lies_below_it(price):
    problem = among(WALL, cost=ma.Cost(length=1.0, direction_change=price))
    cost = ma.plan(problem, time_limit=1.0).cost
    uncut = ma.lower_bound(problem, max_work=WORK, time_limit=1e3)
    cut = ma.lower_bound(problem, max_work=8 * WORK, time_limit=1e3, incumbent=cost)
    assert uncut.value <= cost * (1.0 + 1e-9)
    assert 0.8 * cost < cut.value <= cost
    assert cut.kind == "cells"
    assert [value for _, value in cut.history] == sorted(value for _, value in cut.history)


def test_a_goal_has_cells_at_both_ends_of_a_circle_that_is_opened():
    """Those of one end were left out: 1.89 m were proven of a straight way of 0.8 m."""
    active = np.ones((1, 1, 7), dtype=np.uint8)
    sizes = {"size": 1.0, "headings": 8, "low": np.array([0, 0, 2])}
    cells = PoseCells(active=active, round_trip=False, **sizes)
    at = cells.coordinates(np.array([0.5, 0.5, 0.4]))
    assert [k for *_, k in cells.around(at, (0.0, 2.5))] == [0, 1, 4, 5, 6]


def test_no_motions_are_known_where_to_sink_costs_less_than_to_rest():
    """Of a fixed time, less rest is left: 12.8 were proven of a plan of 9.9."""
    names = {"control_names": ("speed", "turn_rate", "lift")}
    heavy = UserModel(
        name="heavy", group=SE2xR, velocity=lambda z, u: [u[0], 0, u[1], u[2] - 1], **names
    )
    controls = {"rest": (0, 0, 1), "ahead": (1, 0, 1), "left": (1, 1, 1), "sink": (0, 0, 0.5)}
    robot = ma.Automaton.of_controls(heavy, controls)
    cost, fixed = ma.Cost(effort=1.0), ma.Horizon(time=9.0)
    sinking = ma.Problem(robot, [0, 0, 0, 0], [3, 0, 0, -3], cost=cost, horizon=fixed)
    assert motions_of(sinking) is None
    assert motions_of(replace(sinking, horizon=ma.Horizon())) is not None


def test_every_sideways_motion_is_an_average_of_motions_of_its_own_gear():
    """One ahead and aside lay between others that drive back: 4.5 s were proven, and it took 4."""
    controls = {"ahead": (1, 0, 0), "back": (-1, 0, 0), "slant back": (-0.9, 1, 0)}
    controls |= {"slant": (0.02, 0.5, 0), "aside": (0, -1, 0), "turn": (0, 0, 0.05)}
    robot = ma.Automaton.of_controls(ma.Omnidirectional(), controls)
    cost = ma.Cost(time=1.0, direction_change=3.0)
    families = motions_of(ma.Problem(robot, [0, 0, 0], [1, 2, 0], cost=cost)).families
    angles = np.linspace(-np.pi, np.pi, 100)
    along = np.array([np.cos(angles), np.sin(angles)])
    for gear, sign in enumerate((1.0, -1.0)):
        own = families.gear == gear
        offs = np.cos(angles - families.angle[own, None])
        most = (families.speed[own, None] * offs).max(axis=0, initial=0.0)
        motions = robot.body_velocities[sign * robot.body_velocities[:, 0] >= 0.0, :2]
        assert (motions @ along <= most + 1e-12).all()


def test_a_moved_scene_has_the_moved_bound():
    problem = among(WALL)
    move = ma.SE2([30.0, -20.0, 0.7])
    walls = [ma.Polygon(move.act(np.asarray(wall.shape.corners))) for wall in problem.obstacles]
    moved = ma.Problem(
        SHUTTLE,
        (move @ ma.SE2(problem.start)).pose,
        (move @ ma.SE2([15.0, 1.0, 0.3])).pose,
        cost=LENGTH,
        footprint=BODY,
        obstacles=walls,
    )
    here, there = (
        list(cell_proofs(one, incumbent=lambda: 30.0, ends=lambda work: work > WORK))
        for one in (problem, moved)
    )
    assert [one.cells for one in there] == [one.cells for one in here]
    assert there[-1].value == pytest.approx(here[-1].value, rel=1e-4)


def test_nothing_cheaper_than_a_straight_line_is_left():
    bound = ma.lower_bound(among((), goal=(8.0, 0.0, 0.0)), incumbent=8.0)
    assert (bound.value, bound.optimal) == (8.0, True)


SPINNER = ma.SecondOrderUnicycle(
    max_speed=2.0, max_turn_rate=1.0, max_acceleration=0.5, max_angular_acceleration=10.0
)
QUICK = ma.SecondOrderCar(
    wheelbase=2.5, max_steering=0.5, max_speed=10.0, max_acceleration=1.0, max_steering_rate=10.0
)


@pytest.mark.parametrize(
    ("model", "goal", "seconds"),
    [
        (SPINNER, ma.Goal([0, 0, math.pi / 2]), math.pi / 2 + 0.1),
        (replace(QUICK, min_speed=-1.0), ma.Goal([-5, 0, 0]), 6.0),
        (
            replace(QUICK, max_steering=math.atan(0.5), max_lateral_acceleration=0.5),
            ma.Goal([0, 10, math.pi], tolerance_m=3.0),
            (5.0 * math.pi + 2.5) / math.sqrt(2.5) + 0.2 * math.atan(0.5),
        ),
    ],
    ids=["on the spot", "in reverse", "within a lateral limit"],
)
def test_what_is_not_driven_at_full_speed_starts_and_stops_sooner(model, goal, seconds):
    rest = ma.Automaton.of_model(model, {name: [0.0] for name in model.reduced_names})
    problem = ma.Problem(rest, [0, 0, 0], goal)
    bound = ma.lower_bound(problem, incumbent=2.0 * seconds, max_work=500_000)
    assert 0.7 * seconds < bound.value <= seconds * (1.0 + 1e-12)


@pytest.mark.slow
def test_the_bound_of_a_time_counts_slow_reverse_and_a_start_from_rest():
    slow = {"ahead": (2, 0.0), "left": (2, 0.6), "right": (2, -0.6), "back": (-0.5, 0.0)}
    problem = ma.Problem(
        ma.Automaton.of_controls(CAR, slow), [0, 0, 0], [-5, 0, 0], cost=ma.Cost(time=1.0)
    )
    best = ma.plan(problem).cost
    assert (
        0.6 * best
        < ma.lower_bound(problem, max_work=WORK, time_limit=1e3).value
        <= best * (1.0 + 1e-9)
    )


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"time_limit": 0.0}, "time_limit must be positive, got 0.0 s"),
        ({"gap": 1.5}, "gap must be a share from 0 to 1, got 1.5"),
    ],
)
def test_bad_limits_are_refused(more, message):
    with pytest.raises(ValueError) as caught:
        ma.lower_bound(among(()), **more)
    assert str(caught.value) == message


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("kind", [ma.CarWithTrailer, ma.TractorWithTrailers])
def test_a_trailer_moves_at_most_as_the_car_that_pulls_it(kind):
    car = kind(
        wheelbase=2.8, hitch_length=3.0, max_steering=0.6, max_speed=2.0, min_speed=-1.0,
        max_hitch=1.2,
    )  # fmt: skip
    straight = ma.Automaton.of_model(car, {"speed": [2.0, 0.0, -1.0], "steering": [0.0]})
    problem = ma.Problem(
        straight, [0, 0, 0], [15.0, 1.0, 0.3], cost=ma.Cost(time=1.0), obstacles=WALL,
        footprint=BODY,
    )  # fmt: skip
    fast = ma.Automaton.of_controls(
        CAR, {f"{v} {s}": (v, s) for v in (2, -1) for s in (-0.6, 0.0, 0.6)}
    )
    alone = ma.plan(replace(problem, automaton=fast), time_limit=1.0).cost
    bound = ma.lower_bound(problem, max_work=20 * WORK, time_limit=1e3, incumbent=1.1 * alone)
    assert bound.kind == "cells"
    assert 0.5 * math.hypot(15.0, 1.0) < bound.value <= alone
