"""Improving a word: never worse, always free, within all limits, and the same every time."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.refinement.improve import Patience, WordSchedule, words_of
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.words.library import SWITCH
from tests import scenes
from tests.quickly import quick_are
from tests.reference import plain_end
from tests.reference_collision import driven
from tests.solids import World, outside

EXPANSIONS = 900
ROBOT, CAR = scenes.differential_robot(), scenes.reeds_shepp(1.0)
BODY = (Box([0.8, 0.5], [0.1, 0.0]),)
BLOCKS = (
    Obstacle(Box([2.0, 0.4], [2.0, 0.6], 0.4)),
    Obstacle(Disc(0.5, [3.4, -0.9])),
    Obstacle(Box([0.6, 2.0], [1.0, -1.8])),
)
CROSSING = Obstacle(Disc(0.4), motion=Motion([0, 4, 9], [[2, -3, 0], [2.4, 0.2, 1], [2, 3, 2]]))
BASE = Problem(CAR, [0, 0, 0], [4.5, 1.0, 0.5], obstacles=BLOCKS, footprint=BODY)
PROBLEMS = {
    "car": BASE,
    "robot": replace(BASE, automaton=ROBOT, cost=Cost(effort=1.0, time=0.1)),
    "prices": replace(BASE, cost=Cost(time=1.0, switch=0.2, direction_change=0.7)),
    "few trims": replace(BASE, horizon=Horizon(max_trims=5)),
    "long trims": replace(BASE, horizon=Horizon(min_coast=0.25)),
    "little time": replace(BASE, automaton=ROBOT, horizon=Horizon(max_time=13.0),
                           cost=Cost(effort=1.0)),
    "fixed time": replace(BASE, automaton=ROBOT, cost=Cost(effort=1.0), horizon=Horizon(time=25.0)),
    "margin": replace(BASE, margin=0.06),
    "moving": replace(BASE, automaton=ROBOT, obstacles=(*BLOCKS, CROSSING)),
    "bounds": replace(BASE, bounds=Bounds(x=(-0.6, 5.0), y=(-1.5, 2.5))),
    "free heading": replace(BASE, goals=(Goal(pose=[4.5, 1.0, 0.5], free_heading=True),)),
    "nothing in the way": replace(BASE, obstacles=()),
}  # fmt: skip


def query_of(problem):
    return lattice_query(problem, tuple(range(len(problem.goals))))


PATIENT = Patience()


def improving(query, word, *, budget=UNLIMITED, patience=PATIENT, **more):
    schedule = WordSchedule(patience=patience, **more)
    return words_of(query, budget=budget, schedule=schedule, known=word)


@functools.cache
def improved(name, *, expansions=EXPANSIONS):
    """First word, words found on the way, and what came of it."""
    query = query_of(PROBLEMS[name])
    first = first_plan(query, budget=replace(UNLIMITED, expansions=20_000)).word
    assert first is not None
    incumbents = []
    counted = replace(UNLIMITED, expansions=expansions)
    better = improving(query, first, budget=counted)
    incumbents += better
    return query, with_cost(first, query), incumbents, better


def assert_admitted(query, word, *, first=False):
    """Exactly at the goal, free, and within every limit."""
    problem = query.problem
    horizon = problem.horizon
    twists = problem.automaton.body_velocities[word.trims]
    end = (SE2(query.start[:3]) @ SE2(plain_end(twists, word.durations)[:3])).pose
    off = np.abs(end - query.goals[word.goal, :3])
    assert off[:2].max() < 1e-6
    assert query.free_heading[word.goal] or abs(math.remainder(off[2], 2 * math.pi)) < 1e-6
    assert len(word.trims) <= (horizon.max_trims or math.inf)
    assert word.durations.min() >= horizon.min_coast - 1e-12
    limit = horizon.time or horizon.max_time or math.inf
    assert word.durations.sum() <= limit + 1e-9
    assert all(a != b for a, b in itertools.pairwise(word.trims.tolist()))
    rates = problem.rates[word.trims] - query.library.rest_rate
    cost = float(rates @ word.durations) + problem.cost.switching(twists)
    assert word.cost == pytest.approx(cost, rel=1e-12)
    world = World(problem)
    pose = (SE2(query.world.frame) @ SE2(query.start[:3])).pose.copy()
    pose[:2] -= problem.start[:2]
    now = problem.start_time
    for twist, duration in zip(twists, word.durations, strict=True):
        since = np.linspace(0.0, duration, 80)
        way = driven(pose, twist, since)
        assert world.clearance(way, now + since).min() > problem.margin - 1e-7
        assert outside(problem, way[:, :2] + problem.start[:2]).max() < 1e-6
        pose, now = way[-1], now + duration


@pytest.mark.parametrize("name", quick_are(list(PROBLEMS)[:4], PROBLEMS))
def test_never_worse_always_admitted(name):
    query, first, incumbents, better = improved(name)
    costs = [first.cost, *(word.cost for word in incumbents)]
    assert all(b < a for a, b in itertools.pairwise(costs))
    assert better.word.cost == costs[-1]
    for word in [first, *incumbents[-2:], better.word, *better.others[:4]]:
        assert_admitted(query, word)
    if name not in ("few trims", "nothing in the way"):
        assert better.word.cost < first.cost


@pytest.mark.parametrize("name", ["car", "moving", "prices"])
def test_the_same_twice_to_the_last_bit(name):
    _, _, incumbents, better = improved(name)
    improved.cache_clear()
    _, _, again, better_again = improved(name)
    assert [word.cost.hex() for word in incumbents] == [word.cost.hex() for word in again]
    assert better.word.durations.tobytes() == better_again.word.durations.tobytes()
    assert better.attempts == better_again.attempts


def test_less_patience_gives_the_beginning_too():
    query, first, incumbents, _ = improved("car")
    counted = replace(UNLIMITED, expansions=EXPANSIONS)
    impatient = Patience(attempts=1, passes=1)
    short = list(improving(query, first, budget=counted, patience=impatient))
    costs = [word.cost for word in incumbents]
    assert [word.cost for word in short] == costs[: len(short)]


def test_it_ends_at_the_floor():
    query, first, _, better = improved("car")
    floor = 1.02 * better.word.cost
    ended = improving(query, first, floor=floor).to_the_end()
    assert ended.word.cost <= floor
    assert ended.attempts <= better.attempts


def test_no_time_at_all():
    query, first, _, _ = improved("car")
    budget = Budget(began=0.0, deadline=-math.inf)
    ended = improving(query, first, budget=budget).to_the_end()
    assert ended.word.cost <= first.cost
    assert (ended.attempts, ended.expansions, ended.is_late) == (0, 0, True)


def test_the_empty_word_stays_empty():
    query = query_of(replace(BASE, goals=(Goal(pose=BASE.start),)))
    ended = improving(query, query.word_of([], 0), floor=0.0).to_the_end()
    assert (len(ended.word.trims), ended.word.cost) == (0, 0.0)


def test_a_detour_round_nothing_is_cut_short():
    problem = replace(BASE, obstacles=(Obstacle(Box([0.1, 0.1], [0.0, 9.0])),), goals=(
        Goal(pose=[6.0, 0.0, 0.0]),))  # fmt: skip
    query = query_of(problem)
    index = {
        tuple(t): k for k, t in enumerate(query.library.arrays.library.twists[:6, :3].tolist())
    }
    left, ahead, right = index[1.0, 0.0, 1.0], index[1.0, 0.0, 0.0], index[1.0, 0.0, -1.0]
    quarter = 0.5 * math.pi
    there = [(left, quarter), (ahead, 1.0), (right, 2 * quarter), (ahead, 1.0), (left, quarter),
             (ahead, 2.0)]  # fmt: skip
    word = query.word_of([(SWITCH, int(query.library.trims[k]), t) for k, t in there], 0)
    assert_admitted(query, with_cost(word, query))
    patience = Patience(attempts=2000, passes=1)
    ended = improving(query, word, patience=patience).to_the_end()
    assert ended.word.trims.tolist() == query.library.trims[[ahead]].tolist()
    assert ended.word.cost == pytest.approx(6.0, abs=1e-9)
