"""Rests along a path: as early as a search over all joints and ticks, and proven free."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.waiting import MOST_PIECES, is_free, with_waits
from maneuver_automaton.words.word import Word, word_of_steps
from tests.quickly import draws

ROBOT = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
WAY = word_of_steps([(-1, 1, 6.0)], goal=0)
BODY = Disc(0.3)


def query(*obstacles, automaton=ROBOT, **more):
    problem = Problem(
        automaton,
        [0, 0, 0],
        [6, 0, 0],
        cost=Cost(time=1.0),
        obstacles=obstacles,
        footprint=BODY,
        **more,
    )
    return lattice_query(problem, (0,))


def passing(at, begin, speed=1.0, far=8.0):
    """A disc that crosses the way at a place, from a time on."""
    way = [[at, -far, 0.0], [at, far, 0.0]]
    return Obstacle(Disc(0.4), motion=Motion([begin, begin + 2.0 * far / speed], way))


def discs_apart(word, obstacles, until=40.0):
    """Least distance of the discs at short steps, also once it has arrived."""
    times = np.linspace(0.0, until, 8001)
    clock = np.cumsum(np.append(0.0, word.durations))
    places = np.cumsum(np.append(0.0, word.durations * (word.trims == 1)))
    x = np.interp(times, clock, places)
    return min(
        float(np.hypot(*(one.motion.at(times)[:, :2] - np.stack([x, 0.0 * x], axis=1)).T).min())
        - 0.7
        for one in obstacles
    )


def by_ticks(obstacles, tick=0.05, pieces=MOST_PIECES):
    """Arrival by a search over joints and ticks of the clock, with exact discs."""
    length = 6.0 / pieces
    ticks = int(45.0 / tick)
    steps = round(length / tick)

    def free(x, time):
        return all(np.hypot(*(one.motion.at(time)[:2] - [x, 0.0])) > 0.7 for one in obstacles)

    reached = {0}
    for n in range(ticks):
        time = n * tick
        now = set()
        for place in reached:  # in pieces of a piece, one a tick
            x = place * length / steps
            ahead = x + length / steps
            if free(ahead, time + tick):
                now.add(place + 1)
            if place % steps == 0 and free(x, time + tick):
                now.add(place)
        if pieces * steps in now:
            return time + tick
        reached = now
    return None


def test_a_free_way_needs_no_rest():
    timed = with_waits(query(passing(3.0, 20.0)), WAY)
    assert timed.trims.tolist() == [1]
    assert timed.duration == pytest.approx(6.0)


@settings(max_examples=draws(8))
@given(
    st.lists(
        st.tuples(st.floats(1.0, 5.0), st.floats(-8.0, 0.0), st.floats(0.4, 2.0)),
        min_size=1,
        max_size=3,
    )
)
def test_it_arrives_as_early_as_rests_allow(rows):
    obstacles = [passing(*row) for row in rows]
    timed = with_waits(query(*obstacles), WAY)
    expected = by_ticks(obstacles)
    assert (timed is None) == (expected is None)
    if timed is not None:
        assert timed.duration <= expected + 0.3
        assert discs_apart(timed, obstacles) > 0.0


def test_it_waits_until_what_stands_for_a_while_is_gone():
    door = Obstacle(Disc(0.4, [3.0, 0.0]), present_s=(0.0, 9.0))
    timed = with_waits(query(door), WAY)
    assert timed.duration == pytest.approx(9.0 + 6.0 - 2.3, abs=0.15)
    for_ever = Obstacle(Disc(0.4, [3.0, 0.0]), present_s=(0.0, 1e6))
    assert with_waits(query(for_ever), WAY) is None


def test_it_leaves_a_place_before_it_is_taken():
    """It stands where something comes: it cannot wait there, and drives ahead of it."""
    comes = Obstacle(Disc(0.4), motion=Motion([0.0, 8.0], [[-4.0, 0, 0], [0.0, 0, 0]]))
    timed = with_waits(query(comes), WAY)
    assert timed.duration == pytest.approx(6.0)


def test_who_stays_arrives_after_all_have_passed():
    later = passing(6.0, 10.0, far=8.0)
    assert with_waits(query(later), WAY).duration == pytest.approx(6.0)
    stays = with_waits(query(later, horizon=Horizon(stay=True)), WAY)
    assert stays.duration > 18.0
    assert discs_apart(stays, [later], until=60.0) > 0.0


def test_an_empty_word_stands_as_long_as_it_has_to():
    empty = Word(trims=[], durations=[])
    stays = Horizon(stay=True)
    aside = Obstacle(Disc(0.4), motion=Motion([0.0, 9.0], [[-6.0, 3.0, 0], [6.0, 3.0, 0]]))
    over = Obstacle(Disc(0.4), motion=Motion([0.0, 9.0], [[-6.0, 0.0, 0], [6.0, 0.0, 0]]))
    gone = Obstacle(Disc(0.4, [0.0, 0.0]), present_s=(5.0, 9.0))
    assert with_waits(query(aside, horizon=stays), empty).duration == 0.0
    assert with_waits(query(over), empty).duration == 0.0  # it need not stay
    assert with_waits(query(over, horizon=stays), empty) is None
    assert with_waits(query(gone, horizon=stays), empty) is None


def test_without_a_rest_a_way_is_free_or_is_none():
    driver = Automaton.of_controls(Unicycle(), {"on": (1, 0), "left": (1, 1), "right": (1, -1)})
    way = word_of_steps([(-1, 0, 6.0)], goal=0)
    assert with_waits(query(passing(3.0, 20.0), automaton=driver), way) is not None
    assert with_waits(query(passing(3.0, -5.0), automaton=driver), way) is None


def test_a_word_is_free_as_it_is_or_not():
    assert is_free(query(passing(3.0, 20.0)), WAY)
    assert not is_free(query(passing(3.0, -5.0)), WAY)


def test_a_moved_way_has_the_moved_rests():
    by = SE2([40.0, -7.0, 1.0])
    obstacles = [passing(2.0, -6.0), passing(4.0, -3.0, 0.7)]
    one = query(*obstacles)
    other = lattice_query(one.problem.moved(by), (0,))
    assert with_waits(other, WAY).durations == pytest.approx(with_waits(one, WAY).durations)
