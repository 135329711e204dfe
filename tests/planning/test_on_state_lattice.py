"""Plans on a state lattice are shortest paths of its graph, as plain Dijkstra has them."""

from __future__ import annotations

import heapq
import itertools
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from maneuver_automaton._kept import Prepared
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.formats.lattice import Lattice, Move, automaton_of_lattice
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search import state_lattice
from maneuver_automaton.search._kernels_state_lattice import least_to_go
from tests.formats.outside import DATA, needs_data
from tests.planning.test_off_lattice import CELL, QUARTER, library, moves

BODY = Box([0.5, 0.3], center=[0.1, 0.0])
BOUNDS = Bounds(x=(-2.0, 4.0), y=(-3.0, 3.0))
WORK = SearchSettings(max_expansions=200_000)
THICK = 2e-3  # [m] by which solids grow for the search that is surely too careful


def with_reverse():
    """The library and the same motions in reverse, which cost twice as much."""
    headings = [k * QUARTER for k in range(4)]
    back = []
    for move in moves():
        poses = (SE2(np.append(-move.poses[-1, :2], 0.0)) @ SE2(move.poses[::-1])).pose
        back.append(Move(start=move.end, end=move.start, poses=poses, cost_multiplier=2.0))
    return automaton_of_lattice(
        Lattice(resolution=CELL, headings=headings, moves=(*moves(), *back), turning_radius=1.0)
    )


def shortest(problem, grown=0.0):
    """Least cost by Dijkstra, bodies held against solids by shapely at many poses; inf for none.

    Nodes are (column, row, trim, sign of the last speed), the lattice begins at the start.
    """
    automaton, model, cost = problem.automaton, problem.automaton.model, problem.cost
    box = problem.footprint[0]
    solids = shapely.union_all([
        shapely.Polygon(one.shape.corners) if hasattr(one.shape, "corners")
        else shapely.Point(one.shape.center).buffer(one.shape.radius, 64)
        for one in problem.obstacles
    ]).buffer(grown)  # fmt: skip
    shape = shapely.box(*(np.array(box.center) - np.array(box.size) / 2.0),
                        *(np.array(box.center) + np.array(box.size) / 2.0))  # fmt: skip
    first = problem.first_trim
    turn = problem.start[2] - model.heading(first.reduced_state)
    base = SE2(np.array([*problem.start[:2], turn]))

    def pose_of(node):
        heading = model.heading(automaton[node[2]].reduced_state)
        return base @ SE2(np.array([node[0] * CELL, node[1] * CELL, heading]))

    low = np.array([problem.bounds.x[0], problem.bounds.y[0]]) - 1e-9
    high = np.array([problem.bounds.x[1], problem.bounds.y[1]]) + 1e-9
    shapely.prepare(solids)

    def is_free(swept, places, at):
        if (places + at < low).any() or (places + at > high).any():
            return False
        return not solids.intersects(translate(swept, *at))

    def is_goal(node):
        here = pose_of(node).pose
        return any(
            np.hypot(*(here - goal.pose)[:2]) <= goal.tolerance_m + 1e-9
            and (
                goal.free_heading
                or abs(math.remainder(here[2] - goal.pose[2], 2 * math.pi))
                <= goal.tolerance_rad + 1e-9
            )
            for goal in problem.goals
        )

    courses = {}
    for one in automaton.maneuvers:
        twists = SE2(one.course.pose[:-1]).inverse() @ SE2(one.course.pose[1:])
        shares = np.linspace(0.0, 1.0, 5)
        steps = SE2.exp(shares[:, None, None] * twists.log()).pose
        dense = [(SE2(a) @ SE2(steps[:, n])).pose for n, a in enumerate(one.course.pose[:-1])]
        end = SE2(np.array([0, 0, model.heading(automaton[one.source].reduced_state)]))
        cells = np.round((end @ SE2(one.displacement)).pose[:2] / CELL).astype(int)
        forward = int(np.sign(one.course.control[0, 0]))
        price = one.cost_multiplier * one.duration * cost.time + cost.switch
        turned = (SE2(np.array([0.0, 0.0, pose_of((0, 0, one.source)).pose[2]]))
                  @ SE2(np.concatenate(dense))).pose  # fmt: skip
        swept = shapely.union_all([
            translate(rotate(shape, p[2], (0, 0), use_radians=True), *p[:2]) for p in turned
        ])  # fmt: skip
        courses.setdefault(one.source, []).append(
            (swept, turned[:, :2], cells, one.target, forward, price)
        )
    frontier, known, count = [(0.0, 0, (0, 0, first.name, 0))], set(), itertools.count(1)
    while frontier:
        spent, _, node = heapq.heappop(frontier)
        if node in known:
            continue
        known.add(node)
        if is_goal(node):
            return spent - (cost.switch if spent else 0.0)
        here = pose_of(node).pose[:2]
        for swept, places, cells, target, forward, price in courses.get(node[2], []):
            sign = forward or node[3]
            after = (node[0] + int(cells[0]), node[1] + int(cells[1]), target, sign)
            if after in known or not is_free(swept, places, here):
                continue
            price = price + cost.direction_change * (node[3] * sign < 0)
            heapq.heappush(frontier, (spent + price, next(count), after))
    return math.inf


def drawn(seed, automaton):
    """A room with a few solids, and a goal on the lattice, near it, or several."""
    rng = np.random.default_rng(seed)
    obstacles = [
        Box(rng.uniform(0.2, 1.5, 2), rng.uniform([-2.0, -3.0], [4.0, 3.0]), rng.uniform(0.0, 3.0))
        for _ in range(rng.integers(1, 5))
    ] + [Disc(rng.uniform(0.1, 0.5), rng.uniform([-1.0, -2.0], [4.0, 3.0]))]
    obstacles = [
        one for one in obstacles
        if shapely.Point(0, 0).distance(shapely.Point(one.center)) > 1.6
    ]  # fmt: skip
    goals = []
    for _ in range(rng.integers(1, 3)):
        cell = rng.integers([-3, -5], [8, 6]) * CELL
        kind = rng.integers(4)
        heading = rng.integers(4) * QUARTER
        if kind == 0:
            goals.append(Goal(pose=[*cell, heading]))
        elif kind == 1:
            goals.append(Goal(pose=[*cell, rng.uniform(-3, 3)], free_heading=True))
        else:
            pose = [*(cell + rng.uniform(-0.3, 0.3, 2)), heading + rng.uniform(-0.5, 0.5)]
            goals.append(
                Goal(
                    pose=pose, tolerance_m=rng.uniform(0.5, 1.0), tolerance_rad=rng.uniform(0.5, 2)
                )
                if kind == 2
                else Goal(pose=pose, tolerance_m=rng.uniform(0.5, 1.0), free_heading=True)
            )
    prices = [
        Cost(time=1.0),
        Cost(time=1.0, direction_change=0.7),
        Cost(time=1.0, switch=0.2, direction_change=0.3),
    ]
    return Problem(
        automaton, [0, 0, 0], goals, footprint=BODY, obstacles=obstacles, bounds=BOUNDS,
        search=WORK, cost=prices[seed % 3],
    )  # fmt: skip


def check(problem):
    least, most = shortest(problem), shortest(problem, THICK)
    result = plan(problem, time_limit=60.0)
    if least == math.inf:
        assert result.status in (PlanStatus.UNREACHABLE, PlanStatus.GOAL_BLOCKED), result.reason
    elif most < math.inf or result.status is PlanStatus.FOUND:
        assert result.status is PlanStatus.FOUND, result.reason
        assert least - 1e-9 <= result.cost <= most + 1e-9
        assert (result.bound.kind, result.lower_bound, result.gap) == ("exhaustive", result.cost, 0)
        assert result.cost == pytest.approx(problem.cost_of(result.plan), rel=1e-12)
    return result


@pytest.mark.parametrize("seed", [3, 4, 7, 11])
def test_a_plan_is_a_shortest_path_whatever_its_goal_and_prices(seed):
    problem = drawn(seed, with_reverse() if seed % 2 else library())
    result = check(problem)
    back = plan(replace(problem, search=replace(WORK, backwards=True)), time_limit=60.0)
    assert back.status is result.status
    assert back.cost == pytest.approx(result.cost, rel=1e-12)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_interpreted_kernels_find_the_same_word():
    """Numbers of 32 bits overflow in plain NumPy where a compiled kernel widens them."""
    order = (
        "from tests.planning.test_on_state_lattice import *\n"
        "print(plan(drawn(4, library()), time_limit=600.0).plan.word)"
    )
    done = subprocess.run(
        [sys.executable, "-c", order], cwd=Path(__file__).parents[2], capture_output=True,
        text=True, check=False, env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.stdout.strip() == str(plan(drawn(4, library())).plan.word), done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(18, 200, 14))
def test_many_plans_are_shortest_paths(seed):
    """Seeds of all kinds; `python -m tests.planning.test_on_state_lattice 18 200` tries others."""
    check(drawn(seed, with_reverse() if seed % 2 else library()))


@pytest.mark.parametrize("goal", [
    Goal(pose=[3.0, 1.0, 0.3], free_heading=True),
    Goal(pose=[3.1, 1.1, 0.2], tolerance_m=0.6, tolerance_rad=1.6),
])  # fmt: skip
def test_what_moves_aside_and_limits_of_time_leave_the_optimum_and_its_proof(goal):
    wall = Box([0.4, 1.0], center=[1.5, 0.6])
    still = Problem(library(), [0, 0, 0], goal, footprint=BODY, obstacles=wall, search=WORK)
    least = plan(still, time_limit=60.0)
    crossing = Motion([0.0, 9.0], [[-9.0, -3.0, 0.0], [9.0, -3.0, 0.0]])
    others = [
        replace(still, obstacles=[wall, Obstacle(Disc(0.3), motion=crossing)]),
        replace(still, horizon=Horizon(max_time=least.plan.duration + 0.1)),
        replace(still, horizon=Horizon(stay=True)),
    ]
    for problem in others:
        result = plan(problem, time_limit=60.0)
        assert (result.cost, result.bound.kind) == (pytest.approx(least.cost), "exhaustive")
    waits = Motion([0.0, 3.0, 6.0], [[1.5, -0.6, 0.0], [1.5, -0.6, 0.0], [9.0, -9.0, 0.0]])
    in_the_way = replace(still, obstacles=[wall, Obstacle(Disc(0.3), motion=waits)])
    result = plan(in_the_way, time_limit=60.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert least.cost <= result.lower_bound + 1e-9 <= result.cost + 2e-9
    assert result.gap < 0.001  # it knows what waiting may save to a part of a tick


def test_it_waits_as_long_as_a_closed_lane_takes_to_open():
    """One lane only: what stands in it until 3 s, and leaves at 1 m/s, is waited for."""
    lane = Bounds(x=(-0.3, 4.3), y=(-0.1, 0.1))
    leaves = Motion([0.0, 3.0, 13.0], [[2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 10.0, 0.0]])
    disc = Obstacle(Disc(0.35), motion=leaves)
    problem = Problem(
        library(), [0, 0, 0], [4.0, 0.0, 0.0], footprint=BODY, bounds=lane, obstacles=disc
    )
    free = plan(replace(problem, obstacles=[]), time_limit=60.0).cost
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.gap < 0.001
    assert result.cost == pytest.approx(result.plan.duration)
    waited = result.cost - free
    assert 0.0 < waited < 3.5
    stays = plan(replace(problem, obstacles=Disc(0.35, center=[2.0, 0.0])), time_limit=60.0)
    assert stays.status is PlanStatus.UNREACHABLE


def test_a_longest_time_shorter_than_the_quickest_way_is_told():
    problem = Problem(
        with_reverse(), [0, 0, 0], [3.0, 1.0, 0.0], footprint=BODY, bounds=BOUNDS,
        obstacles=Box([0.4, 1.0], center=[1.5, 0.0]),
    )  # fmt: skip
    least = plan(problem, time_limit=60.0)
    hurry = replace(problem, horizon=Horizon(max_time=0.9 * least.plan.duration))
    result = plan(hurry, time_limit=60.0)
    assert result.status is PlanStatus.UNREACHABLE
    assert result.reason.startswith(f"the quickest way takes {least.plan.duration:.6g} s, at most")


@pytest.mark.parametrize("backwards", [False, True])
def test_the_bound_of_the_cost_to_go_is_consistent(backwards):
    """It is 0 at the goal, and no edge lowers it by more than it costs: no plan costs less."""
    problem = Problem(with_reverse(), [0, 0, 0], [2 * CELL, CELL, QUARTER], footprint=BODY)
    graph = state_lattice.graph_of(problem, [0], Prepared())
    if backwards:
        graph = graph.backwards()
    lattice, place = graph.lattice, np.round(graph.aims.place[0] / CELL).astype(int)
    states = range(len(lattice.heading))

    def bound(i, j, state):
        return least_to_go(graph.aims, CELL, i, j, state)

    end = int(graph.aims.admits[0].argmax())
    assert bound(*place, end) == 0.0
    for i, j, state in itertools.product(range(-3, 5), range(-3, 4), states):
        here = bound(i, j, state)
        assert here >= 0.0
        for e in range(lattice.first[state], lattice.first[state + 1]):
            there = bound(i + lattice.step[e, 0], j + lattice.step[e, 1], lattice.target[e])
            assert here <= lattice.cost[e] + there + 1e-12


def test_a_moved_problem_has_the_moved_plan():
    problem = replace(drawn(4, with_reverse()), bounds=Bounds())
    by = SE2(np.array([113.0, -57.0, 0.7]))  # the start keeps its heading of the lattice
    one, other = (plan(p, time_limit=60.0) for p in (problem, problem.moved(by)))
    assert one.plan.word == other.plan.word
    assert other.cost == pytest.approx(one.cost, rel=1e-12)
    assert other.counts["expansions"] == one.counts["expansions"]
    np.testing.assert_allclose((by @ SE2(one.plan.end)).pose, other.plan.end, atol=1e-9)


def test_the_window_hides_no_cheaper_plan():
    """A long wall leads beyond every window that is drawn round start, goal and obstacles."""
    wall = Obstacle(Box([0.4, 60.0], center=[2.0, 25.0]))
    problem = Problem(library(), [0, 0, 0], [4.0, 0.0, 0.0], footprint=BODY, obstacles=wall)
    result = plan(problem, time_limit=60.0)
    assert (result.bound.kind, result.gap) == ("exhaustive", 0.0)
    bounded = replace(problem, bounds=Bounds(x=(-9.0, 9.0), y=(-12.0, 9.0)))
    assert result.cost == pytest.approx(shortest(bounded), rel=1e-9)


def test_a_pen_around_the_goal_proves_that_there_is_no_plan():
    sides = [Box([0.2, 2.2], [x, 0.0]) for x in (3.0, 5.0)] + [
        Box([2.2, 0.2], [4.0, y]) for y in (1.0, -1.0)
    ]
    problem = Problem(library(), [0, 0, 0], [4.0, 0.0, 0.0], footprint=BODY, obstacles=sides)
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.UNREACHABLE, result.reason
    open_pen = plan(replace(problem, obstacles=problem.obstacles[1:]), time_limit=60.0)
    assert open_pen.status is PlanStatus.FOUND


def test_with_few_expansions_the_bound_is_that_of_the_most_promising_node():
    problem = drawn(58, library())
    best = plan(problem, time_limit=60.0)
    few = plan(replace(problem, search=SearchSettings(max_expansions=20)), time_limit=60.0)
    assert few.status is PlanStatus.OUT_OF_BUDGET
    assert few.counts["expansions"] == 20
    first = plan(replace(problem, search=replace(WORK, improve=False)), time_limit=60.0)
    assert first.lower_bound <= best.cost <= first.cost
    assert first.counts["expansions"] < best.counts["expansions"]


@needs_data
def test_a_lattice_of_nav2_is_left_by_no_cheaper_plan():
    """All headings of a file's goals beside the optimum of plain Dijkstra, without obstacles."""
    automaton = read_primitives(DATA / "field/nova04.json").automaton
    problem = Problem(automaton, [0, 0, 0], Goal(pose=[3.2, 1.6, 0], free_heading=True))
    known, goals = dijkstra(automaton, 12.0), set()
    result = plan(problem, time_limit=60.0)
    assert result.cost == pytest.approx(min(known[8, 4, t] for t in automaton.trim_names))
    for trim in automaton.trims:
        for cell in ((8, 4),):
            heading = math.atan2(trim.reduced_state[1], trim.reduced_state[0])
            pose = [0.4 * cell[0], 0.4 * cell[1], heading]
            result = plan(Problem(automaton, [0, 0, 0], pose), time_limit=60.0)
            assert result.cost == pytest.approx(known[(*cell, trim.name)], rel=1e-9)
            assert result.gap == 0.0
            goals.add((*cell, trim.name))
    assert len(goals) == 8


@needs_data
def test_a_primitive_that_ends_on_the_bounds_stays_inside_them():
    automaton = read_primitives(DATA / "sbpl/mprim/unicycle_first_order_0.mprim").automaton
    for name in ("heading 1", "heading 13"):
        start = np.array([0.0, 0.0, automaton.model.heading(automaton[name].reduced_state)])
        tried = 0
        for one in automaton.maneuvers:
            y = (SE2(start) @ SE2(one.course.pose)).pose[:, 1]
            side = np.sign(y[-1])
            if one.source != name or (side * np.diff(y) <= 0.0).any():
                continue
            bounds = Bounds(y=(min(0.0, y[-1]), max(0.0, y[-1])))
            goal = (SE2(start) @ SE2(one.displacement)).pose
            problem = Problem(automaton, start, goal, start_trim=name, bounds=bounds)
            result = plan(problem, time_limit=60.0)
            assert result.status is PlanStatus.FOUND, (one.name, result.reason)
            assert result.cost == pytest.approx(one.duration * one.cost_multiplier)
            tried += 1
        assert tried > 1


def dijkstra(automaton, most):
    """Costs up to a limit from the origin at the first trim, without obstacles."""
    cell, edges = automaton.model.resolution, {}
    for one in automaton.maneuvers:
        state = automaton[one.source].reduced_state
        base = SE2(np.array([0.0, 0.0, math.atan2(state[1], state[0])]))
        step = np.round((base @ SE2(one.displacement)).pose[:2] / cell).astype(int).tolist()
        price = one.duration * one.cost_multiplier
        edges.setdefault(one.source, []).append((*step, one.target, price))
    known, frontier = {}, [(0.0, 0, 0, automaton.trim_names[0])]
    while frontier:
        spent, i, j, trim = heapq.heappop(frontier)
        if (i, j, trim) in known or spent > most:
            continue
        known[i, j, trim] = spent
        for di, dj, target, price in edges[trim]:
            heapq.heappush(frontier, (spent + price, i + di, j + dj, target))
    return known


@needs_data
@pytest.mark.parametrize("backwards", [False, True])
def test_primitives_of_a_car_reach_the_least_cost(backwards):
    automaton = read_primitives(DATA / "field/carina16.mprim").automaton
    search = SearchSettings(max_expansions=200_000, backwards=backwards)
    problem = Problem(automaton, [0, 0, 0], [-5.2, 0.6, QUARTER], search=search)
    result = plan(problem, time_limit=60.0)
    assert result.cost == pytest.approx(9.86127818874, rel=1e-9)
    assert (result.bound.kind, result.gap) == ("exhaustive", 0.0)


if __name__ == "__main__":
    for number in range(*map(int, sys.argv[1:])):
        check(drawn(number, with_reverse() if number % 2 else library()))
