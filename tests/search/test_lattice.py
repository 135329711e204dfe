"""The lattice: nodes hold exact poses of free ways, and what they add up to."""

from __future__ import annotations

import itertools
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Polygon
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search.lattice import distance_grids, first_plan
from maneuver_automaton.search.lattice_pass import (
    pass_of,
    with_cost,
)
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_task import Resolution
from maneuver_automaton.words.library import SWITCH
from tests import scenes
from tests.collision.scenes import random_map
from tests.quickly import quick_are
from tests.reference import plain_end
from tests.reference_collision import driven
from tests.solids import World, outside

ROOT = Path(__file__).parents[2]
COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
EXPANSIONS = 1200 if COMPILED else 12
COST, TIME, COAST, RUN, CLEARANCE = range(4, 9)
PARENT, TRIM, GEAR, COUNT = range(4)

ROBOT, CAR, DUBINS = scenes.differential_robot(), scenes.reeds_shepp(1.0), scenes.dubins(0.8)
BODY = (Box([0.8, 0.5], [0.1, 0.0]),)
CLUTTER = (
    Obstacle(Box([2.0, 0.4], [2.0, 0.6], 0.4)),
    Obstacle(Disc(0.5, [3.4, -0.9])),
    Obstacle(Polygon([[1, -2], [2.5, -2], [2.5, -1.2], [2, -1.2], [2, -1.7], [1, -1.7]])),
    random_map(np.random.default_rng(3)),
)
CROSSING = Obstacle(Box([1.0, 0.5]), motion=Motion([0, 4, 9], [[2, -3, 0], [2, 1, 1], [2, 3, 2]]))
BASE = Problem(CAR, [0, 0, 0], [4.5, 1.0, 0.5], obstacles=CLUTTER[:3], footprint=BODY)
PRICES = Cost(time=1.0, switch=0.2, direction_change=0.7)
PROBLEMS = {
    "car": BASE,
    "robot": replace(BASE, automaton=ROBOT, cost=Cost(effort=1.0, time=0.1)),
    "prices": replace(BASE, cost=PRICES),
    "few": replace(BASE, horizon=Horizon(max_trims=4, min_coast=0.1)),
    "slow": replace(BASE, automaton=ROBOT, horizon=Horizon(max_time=14.0)),
    "fixed": replace(BASE, automaton=ROBOT, horizon=Horizon(time=30.0)),
    "margin": replace(BASE, margin=0.05),
    "map": replace(BASE, obstacles=CLUTTER),
    "moving": replace(BASE, automaton=ROBOT, obstacles=(*CLUTTER[:2], CROSSING)),
    "point": replace(BASE, footprint=()),
    "bounds": replace(BASE, bounds=Bounds(x=(-0.5, 5.0), y=(-1.5, 2.5))),
    "goals": replace(BASE, goals=(Goal(pose=[4.5, 1.0, 0.5]), Goal(pose=[-2.0, 2.0, 1.0]))),
    "free heading": replace(BASE, goals=(Goal(pose=[4.5, 1.0, 0.5], free_heading=True),)),
}


def query_of(problem):
    return lattice_query(problem, tuple(range(len(problem.goals))))


def grown(problem, *, sign=1.0, one=None, n=EXPANSIONS):
    """A pass that does not stop at a connection, its nodes and links."""
    query = query_of(problem)
    resolution = Resolution(stop=False) if one is None else one
    grid = distance_grids(query)[0 if sign > 0.0 else 1]
    one = pass_of(query, resolution, grid=grid, sign=sign)
    one.run(n, math.inf)
    used = int(one.arrays.state[layout.N_NODES])
    return one, one.arrays.nodes[:used], one.arrays.links[:used]


def in_the_problem(query, nodes):
    """Poses of nodes in the coordinates of the problem, relative to its start's place."""
    poses = (SE2(query.world.frame) @ SE2(nodes[:, :3])).pose.copy()
    poses[:, :2] -= query.problem.start[:2]
    return poses


@pytest.mark.parametrize("name", ["map", "goals", "free heading"])
def test_words_left_out_or_looked_for_late_change_no_search(name):
    query = query_of(PROBLEMS[name])
    grid, resolution = distance_grids(query)[0], Resolution(stop=False)
    one, other = (pass_of(query, resolution, grid=grid) for _ in range(2))
    task = other.search.task  # without the shortest path, and with all words at once
    estimates = task.estimates._replace(radius=0.0)
    task = task._replace(
        estimates=estimates, connecting=task.connecting._replace(checks_words=True)
    )
    other.search = other.search._replace(task=task)
    assert one.search.task.estimates.radius > 0.0
    one.run(EXPANSIONS, math.inf)
    other.run(EXPANSIONS, math.inf)
    assert one.arrays.state[layout.FOUND] or not COMPILED
    used = int(one.arrays.state[layout.N_NODES])
    assert np.array_equal(one.arrays.nodes[:used], other.arrays.nodes[:used])
    assert np.array_equal(one.arrays.found[:5], other.arrays.found[:5])


TIGHT = Resolution(truncated=True, scale=0.5, durations=0.5, stop=False)


@pytest.mark.slow
@pytest.mark.parametrize("sign", quick_are([1.0], [1.0, -1.0]))
@pytest.mark.parametrize("resolution", [Resolution(stop=False), TIGHT])
@pytest.mark.parametrize("name", PROBLEMS)
def test_nodes_are_ends_of_free_ways(name, resolution, sign):
    problem = PROBLEMS[name]
    if sign < 0.0 and problem.moves:
        pytest.skip("no search from a goal where something moves")
    one, nodes, links = grown(problem, sign=sign, one=resolution)
    library, query = one.query.library.arrays.library, one.query
    children = np.flatnonzero(links[:, PARENT] >= 0)
    if not (
        one.arrays.state[layout.FOUND] or problem.horizon.max_trims
    ):  # what is costlier than a connection is left out
        assert len(children) > (40 if COMPILED else 5)
    elif not len(children):
        return
    parents = links[children, PARENT]
    trims, times = links[children, TRIM], nodes[children, COAST]
    # exact poses: those of the edge done from the parent's
    steps = [
        plain_end([library.twists[k, :3]], [sign * t]) for k, t in zip(trims, times, strict=True)
    ]
    expected = (SE2(nodes[parents, :3]) @ SE2(np.array(steps)[:, :3])).pose
    assert np.abs(expected - nodes[children, :3]).max() < 1e-11
    # costs, times and counts add up
    before, gear = links[parents, TRIM], links[parents, GEAR]
    switched = (before >= 0) & (before != trims)
    turned = gear * library.gears[trims] < 0
    price = library.switch * switched + library.direction_change * turned
    cost = nodes[parents, COST] + library.rates[trims] * times + price
    assert nodes[children, COST] == pytest.approx(cost, abs=1e-12)
    assert nodes[children, TIME] == pytest.approx(nodes[parents, TIME] + times, abs=1e-12)
    assert np.array_equal(links[children, COUNT], links[parents, COUNT] + (before != trims))
    run = np.where(before == trims, nodes[parents, RUN], 0.0) + times
    assert nodes[children, RUN] == pytest.approx(run, abs=1e-12)
    assert np.array_equal(
        links[children, GEAR], np.where(library.gears[trims] != 0, library.gears[trims], gear)
    )
    # limits
    horizon = problem.horizon
    assert nodes[:, TIME].max() <= (horizon.time or horizon.max_time or math.inf) * (1 + 1e-9)
    assert links[:, COUNT].max() <= (horizon.max_trims or math.inf)
    assert (run[switched] > 0.0).all()
    assert (nodes[parents[switched], RUN] >= horizon.min_coast).all()
    # and nothing is hit on the way
    clock = problem.start_time
    world = World(problem)
    poses = in_the_problem(query, nodes)
    kept = world.clearance(poses[children], clock + nodes[children, TIME]) - problem.margin
    assert kept.min() > -1e-8
    assert (nodes[children, CLEARANCE] <= np.maximum(kept, 0.0) + 1e-8).all()
    rng = np.random.default_rng(1)
    for k in rng.permutation(len(children))[: 150 if COMPILED else 10]:
        since = np.linspace(0.0, times[k], 12)
        way = driven(poses[parents[k]], library.twists[trims[k], :3], sign * since)
        at = clock + nodes[parents[k], TIME] + since
        assert (world.clearance(way, at) > problem.margin - 1e-8).all()
        assert outside(problem, way[:, :2] + problem.start[:2]).max() < 1e-6


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_connection_ends_at_a_goal_and_costs_what_it_says(name):
    problem = PROBLEMS[name]
    query = query_of(problem)
    found = first_plan(query, budget=UNLIMITED._replace(expansions=20_000 if COMPILED else 60))
    if found.word is None:
        assert not COMPILED
        return
    word = with_cost(found.word, query)
    twists = problem.automaton.body_velocities[word.trims]
    goal = problem.goals[query.goal_index[word.goal]]
    start = SE2(query.start[:3])
    end = (start @ SE2(plain_end(twists, word.durations)[:3])).pose if len(twists) else start.pose
    off = np.abs(end - query.goals[word.goal, :3])
    assert off[:2].max() < 1e-7
    assert goal.free_heading or abs(math.remainder(off[2], 2 * math.pi)) < 1e-7
    assert (word.durations > 0.0).all()
    assert all(a != b for a, b in itertools.pairwise(word.trims.tolist()))
    rates = problem.rates[word.trims] - query.library.rest_rate
    assert word.cost == pytest.approx(
        float(rates @ word.durations) + problem.cost.switching(twists), rel=1e-12
    )
    horizon = problem.horizon
    assert word.durations.sum() <= (horizon.time or horizon.max_time or math.inf) + 1e-9
    assert len(word.trims) <= (horizon.max_trims or math.inf)
    assert word.durations.min() >= horizon.min_coast
    times = np.concatenate([[0.0], np.cumsum(word.durations)])
    poses = in_the_problem(query, query.start[None, :3])
    world = World(problem)
    for twist, begin, end_ in zip(twists, times[:-1], times[1:], strict=True):
        since = np.linspace(0.0, end_ - begin, 60)
        way = driven(poses[-1], twist, since)
        clear = world.clearance(way, problem.start_time + begin + since)
        assert (clear > problem.margin - 1e-7).all()
        assert outside(problem, way[:, :2] + problem.start[:2]).max() < 1e-6
        poses = way[-1:]


ORDER = """
import hashlib, math
from dataclasses import replace
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import UNLIMITED
from tests.search.test_lattice import PROBLEMS, TIGHT, grown, query_of
from maneuver_automaton.search.lattice import first_plan
for name in ("car", "moving", "prices"):
    found = first_plan(query_of(PROBLEMS[name]), budget=UNLIMITED._replace(expansions=25))
    word = found.word
    print(name, found.expansions, found.queries, *map(float.hex, found.nearest), found.exhausted,
          word and ([int(k) for k in word.trims], [float(t).hex() for t in word.durations]))
for name in ("robot", "prices", "map"):
    _, nodes, links = grown(PROBLEMS[name], one=TIGHT, n=15)
    print(name, len(nodes), hashlib.sha256(nodes.tobytes() + links.tobytes()).hexdigest())
"""


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="compares compiled kernels with these")
def test_compiled_and_not_the_first_plan_is_the_same_to_the_last_bit():
    said = [
        subprocess.run(
            [sys.executable, "-c", ORDER], cwd=ROOT, check=True, capture_output=True, text=True,
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
        ).stdout
        for disabled in ("0", "1")
    ]  # fmt: skip
    assert said[0].count("\n") == 6
    assert said[0] == said[1]


@pytest.mark.slow
def test_who_waits_until_contact_is_still_somewhere():
    order = "from tests.search.test_lattice import *; grown(PROBLEMS['moving'], one=TIGHT, n=15)"
    done = subprocess.run(
        [sys.executable, "-c", order], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_joined_and_priced_by_hand():
    query = query_of(PROBLEMS["prices"])
    gears = query.library.arrays.library.gears
    ahead = int(np.flatnonzero(gears > 0)[0])
    back = int(np.flatnonzero(gears < 0)[0])
    steps = [(ahead, 1.0), (ahead, 0.5), (back, 2.0), (ahead, 1.0)]
    word = query.word_of([(SWITCH, int(query.library.trims[k]), t) for k, t in steps], 0)
    assert word.trims.tolist() == query.library.trims[[ahead, back, ahead]].tolist()
    assert word.durations.tolist() == [1.5, 2.0, 1.0]
    assert with_cost(word, query).cost == pytest.approx(4.5 + 2 * 0.2 + 2 * 0.7)
    assert with_cost(query.word_of([], 0), query).cost == 0.0


def test_a_maneuver_is_searched_at_the_price_of_its_switches():
    """The search prefers few maneuvers where switches cost something: one to each, as in a plan."""
    automaton, still = load_stock_library("hovercraft"), [0.0, 0.0, 0.0]
    problem = Problem(automaton, still, [9.0, 3.0, 0.5], cost=PRICES)
    library = query_of(problem).library
    edges = library.arrays.edges
    for maneuver, cost in zip(edges.maneuver[:9], edges.cost[:9], strict=True):
        one = library.priced.automaton.maneuvers[maneuver]
        ends = (automaton[one.source], automaton[one.target])
        alone = Plan(still, ends, durations=[0.0, 0.0], maneuvers=(one,))
        assert cost == pytest.approx(problem.cost_of(alone) + PRICES.switch)
