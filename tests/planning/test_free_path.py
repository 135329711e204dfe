"""Words along a free path of poses: bends and slots in which the lattice finds no word."""

import dataclasses
import math
import sys

import numpy as np
import pytest
import shapely

from benchmarks.unreachable import FAMILIES
from maneuver_automaton import Automaton, Box, Car, Disc, Obstacle, plan, verify
from maneuver_automaton.bounds import Reachability, widest_path
from maneuver_automaton.bounds.separation import connectivity
from maneuver_automaton.collision import Motion
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.result import PlanStatus
from maneuver_automaton.problem import SearchSettings
from tests.bounds.scenes import BODY, bend, dead_end, walled

WORK = SearchSettings(max_expansions=90_000, improve=False)
CAR = {"ahead": (1, 0), "back": (-1, 0), "left": (1, 0.58), "right": (1, -0.58)}


def with_library(problem):
    car = Automaton.of_controls(Car(wheelbase=2.7, max_steering=0.58), CAR)
    return dataclasses.replace(problem, automaton=car, search=WORK)


def swept(found, *, every=0.01):
    """Bodies along a plan, by the closed form of constant twists alone."""
    x, y, turn = found.problem.start.tolist()
    poses = []
    for trim, lasts in zip(found.plan.trims, found.plan.durations.tolist(), strict=True):
        v, _, w = trim.body_velocity.tolist()
        at = np.linspace(0.0, lasts, 2 + int(lasts * (abs(v) + 4.0 * abs(w)) / every))
        ahead = np.sin(w * at) / w * v if w else v * at
        aside = (1.0 - np.cos(w * at)) / w * v if w else 0.0 * at
        c, s = math.cos(turn), math.sin(turn)
        poses.append(
            np.stack([x + c * ahead - s * aside, y + s * ahead + c * aside, turn + w * at])
        )
        x, y, turn = poses[-1][:, -1]
    x, y, turn = np.concatenate(poses, axis=1)[..., None]
    (b_x, b_y), c, s = np.array(BODY.corners).T, np.cos(turn), np.sin(turn)
    corners = np.stack([x + c * b_x - s * b_y, y + s * b_x + c * b_y], axis=-1)
    return shapely.polygons(corners), np.array([x[-1, 0], y[-1, 0], turn[-1, 0]])


def is_driven(found):
    """Whether shapely says that a plan touches nothing, and ends where it should."""
    bodies, end = swept(found)
    walls = shapely.union_all(
        [shapely.Polygon(one.shape.corners) for one in found.problem.obstacles]
    )
    off = end - found.problem.goals[0].pose
    turn = (off[2] + math.pi) % (2.0 * math.pi) - math.pi
    return (
        bool(shapely.distance(bodies, walls).min() > 0.0)
        and max(*np.abs(off[:2]), abs(turn)) < 1e-9
    )


def test_a_bend_hardly_wider_than_it_has_to_be():
    """At 3.005 m there is no path; the lattice alone finds none up to 3.3 m."""
    found = plan(with_library(bend(3.12)), time_limit=300.0)
    assert found.status is PlanStatus.FOUND
    assert is_driven(found)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_path_that_was_broken_off_is_followed_to_its_end(monkeypatch):
    """Where the time is short the search gets its share first; then the path has what is left."""
    monkeypatch.setattr("maneuver_automaton.search.lattice.ASIDE_SHARE", 1e-9)
    problem = dataclasses.replace(with_library(bend(3.12)), search=SearchSettings(improve=False))
    assert is_driven(plan(problem, time_limit=300.0))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_bend_beside_which_something_moves():
    """Far away, and across the way: the path is followed all the same."""
    for way in ([[0, -5, 0], [10, -5, 0]], [[14.4, 3, 0], [14.4, 30, 0]]):
        mover = Obstacle(Disc(0.3), motion=Motion([0.0, 6.0], np.array(way, dtype=float)))
        problem = with_library(bend(3.12))
        among = dataclasses.replace(problem, obstacles=(*problem.obstacles, mover))
        found = plan(among, time_limit=300.0)
        assert found.status is PlanStatus.FOUND
        assert verify(among, found.plan).passed


@pytest.mark.slow
def test_a_moved_bend_has_the_moved_plan():
    problem = with_library(FAMILIES["bend"](np.random.default_rng(5), 0.2))
    by = SE2([300.0, -50.0, 2.0])
    found, moved = (plan(one, time_limit=300.0) for one in (problem, problem.moved(by)))
    assert found.plan.word == moved.plan.word
    assert np.allclose(found.plan.durations, moved.plan.durations, atol=1e-6)


def test_a_bus_gets_into_a_slot_that_is_a_metre_longer():
    bus = Box([11.0, 2.55], [2.9, 0.0])
    walls = [(-30, -2.6, 0, 0), (12, -2.6, 40, 0), (-30, -3.6, 40, -2.6), (-30, 7, 40, 8)]
    scene = walled(walls, [-14, 2.5, 0], [3.1, -1.3, 0], (-25, -4, 35, 8))
    long = Automaton.of_controls(Car(wheelbase=5.9, max_steering=0.7), {**CAR, "left": (1, 0.7)})
    found = plan(
        dataclasses.replace(scene, automaton=long, footprint=bus, search=WORK), time_limit=300.0
    )
    assert found.status is PlanStatus.FOUND


def test_a_proof_ends_the_search(monkeypatch):
    made = []

    def counted(*args, give=0.0, **more):
        found = connectivity(*args, give=give, **more)
        made.extend([found] if give == 0.0 and found.answer is Reachability.SEPARATED else [])
        return found

    monkeypatch.setattr(
        sys.modules["maneuver_automaton.bounds.separation"], "connectivity", counted
    )
    found = plan(with_library(dead_end(4.8)), time_limit=300.0)
    assert found.status is PlanStatus.UNREACHABLE
    assert found.counts["expansions"] <= 50_000
    assert len(made) == 1  # which the search and what follows it share
    assert len(found.reached) == len(made[0].reached) > 0


def test_the_widest_path_is_as_wide_as_there_is_room():
    walls = [(-1, -9, 20, 0), (-1, 2.5, 20, 9)]
    problem = walled(walls, [1, 1.25, 0], [17, 1.25, 0], (0, -1, 20, 4))
    answer, path, apart = widest_path(problem, first=0.5)
    assert answer is Reachability.CONNECTED
    assert 0.15 < apart < 0.3  # of 0.3 m on either side
    assert np.abs(path[:, 1] - 1.25).max() < 0.3 - apart + 0.01
