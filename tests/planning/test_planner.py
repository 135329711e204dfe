"""A planner keeps all that a problem states but its start, its goals and its start time."""

from __future__ import annotations

import copy
import functools
import multiprocessing
import pickle
from dataclasses import fields

import numpy as np
import pytest

from maneuver_automaton import _kept
from maneuver_automaton.collision import Box, Disc, Zone, fcl_checker
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import Planner, plan, result
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search import cost_to_go, lattice_library, scene
from tests import inertia, scenes
from tests.search.cases import TABLE_2, robot

QUERY = {"start", "goals", "start_time", "start_state", "via", "order"}


def test_every_field_of_a_problem_is_stated_once():
    of_problem = {one.name for one in fields(Problem)} - QUERY
    assert {one.name for one in fields(Planner)} - {"_first"} == of_problem | {"workspace"}


@pytest.mark.slow
def test_zones_hold_in_every_query():
    zone = Zone(shape=Box([1.0, 2.0], [2.0, 0.0]), trims=("spin", "acw"))
    planner = Planner(robot(TABLE_2), zones=[zone], footprint=Disc(0.1))
    for goal in ([4.0, 0.0, 0.0], [4.0, 0.5, 0.0]):
        result = planner.plan([0, 0, 0], goal, time_limit=3.0)
        poses = result.plan.pose_at(np.linspace(0.0, result.plan.duration, 400))
        inside = (np.abs(poses[:, 0] - 2.0) < 0.5) & (np.abs(poses[:, 1]) < 1.0)
        assert not inside.any()
        free = plan(Problem(robot(TABLE_2), [0, 0, 0], goal), time_limit=3.0)
        assert result.cost > free.cost


def test_parts_heights_and_trims_reach_the_problem():
    trailer = inertia.resting(inertia.TRAILER)
    part = {name: Box([0.3, 0.2]) for name in trailer.model.part_names}
    name = trailer.trim_names[0]
    planner = Planner(trailer, parts=part, body_height=(-0.1, 0.4), start_trim=name)
    problem = planner.problem([0, 0, 0], Goal(pose=[1, 0, 0], trim=name))
    assert set(problem.parts) == set(part)
    assert problem.body_height == (-0.1, 0.4)
    assert problem.start_trim == name
    again = Planner(trailer, parts=part).problem([0, 0, 0], [1, 0, 0], start_trim=name)
    assert again.start_trim == name


@pytest.mark.slow
def test_planners_used_in_turn_keep_what_they_prepared(monkeypatch):
    """Each has its own map and body: none makes anything twice, however many there are."""
    # What all planners load is made before anything is counted.
    Planner(scenes.differential_robot(1.0, 1.5), obstacles=[Disc(0.5, [6.0, 2.0])])
    made = []

    def counted(module, name):
        make = getattr(module, name)

        def counting(*args, **more):
            made.append(name)
            return make(*args, **more)

        monkeypatch.setattr(module, name, counting)

    kinds = (
        (fcl_checker, "FclChecker"),
        (result, "surroundings_around"),
        (lattice_library, "_library"),
        (scene, "_worlds"),
        (cost_to_go, "_kept"),
    )
    for kind in kinds:
        counted(*kind)
    monkeypatch.setattr(_kept, "MOST", 3)  # are remembered for callers that hold no planner
    monkeypatch.setattr(_kept, "RECENT", _kept.Prepared())
    n = 5
    vehicle = scenes.differential_robot(1.0, 1.5)
    planners = [
        Planner(
            vehicle,
            obstacles=[Box([1.0, 4.0], [3.0, 0.1 * k]), Disc(0.5, [6.0, 2.0])],
            cost=Cost(time=1.0 + 0.01 * k),
            footprint=Box([0.4, 0.4 + 0.01 * k]),
            search=SearchSettings(max_expansions=200),
            horizon=Horizon(
                min_coast=0.0
            ),  # what is tried without short trims may need a finer look
        )
        for k in range(n)
    ]
    assert sorted(made) == sorted(n * [name for _, name in kinds])  # when they are made
    for goal in ([8.0, 0.5, 0.2], [7.0, -0.5, 0.0]):
        for planner in planners:
            assert planner.plan([0, 0, 0], goal, time_limit=60.0).audit.passed
    assert sorted(made) == sorted(n * [name for _, name in kinds])


def test_another_map_has_another_workspace():
    planner = Planner(robot(TABLE_2), obstacles=[Disc(0.5, [2.0, 0.0])], footprint=Disc(0.1))
    other = planner.with_obstacles([Disc(0.5, [2.0, 1.0])])
    assert other.workspace is not planner.workspace
    assert planner.workspace.on(planner.obstacles) is planner.workspace
    assert planner.workspace.on(other.obstacles) is not planner.workspace


@pytest.mark.slow
def test_a_planner_is_copied_and_sent_to_other_processes():
    search = SearchSettings(max_expansions=200, improve=False)
    wall = Box([1.0, 1.0], [2.0, 0.5])
    planner = Planner(robot(TABLE_2), obstacles=[wall], margin=0.1, search=search)
    query = functools.partial(_cost, planner, [4.0, 0.0, 0.0])
    for again in (pickle.loads(pickle.dumps(planner)), copy.deepcopy(planner), copy.copy(planner)):
        assert again.margin == 0.1
        assert _cost(again, [4.0, 0.0, 0.0]) == query()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(query) == query()


def _cost(planner, goal):
    return planner.plan([0, 0, 0], goal, time_limit=60.0).cost
