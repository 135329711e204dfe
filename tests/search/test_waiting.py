"""Rests along a path so that moving obstacles pass."""

import pytest

from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.words.library import SWITCH
from tests.fleet.robots import ROBOT


@pytest.mark.parametrize(
    ("stops_s", "passes"), [(16.0, True), (9.0, False)], ids=["in time", "too late"]
)
def test_what_comes_to_rest_on_the_path_has_to_be_passed_before(stops_s, passes):
    """It first waits 2 s for another one, and is past the place 10 s after its start."""
    crosses = Motion([3.0, 5.0], [[2.0, 0.0, 0.0], [2.0, 4.0, 0.0]])
    stays = Motion([stops_s - 2.0, stops_s], [[7.0, -4.0, 0.0], [7.0, 0.0, 0.0]])
    body = Disc(0.4)
    others = tuple(Obstacle(body, motion=one) for one in (crosses, stays))
    problem = Problem(ROBOT, [0, 0, 0], [10, 0, 0], footprint=body, obstacles=others)
    query = lattice_query(problem, (0,))
    ahead = query.automaton.index_of("on")
    word = with_waits(query, query.word_of([(SWITCH, ahead, 10.0)], goal=0))
    assert (word is not None) == passes
    if word is not None:
        assert 11.5 < word.durations.sum() < 12.5
