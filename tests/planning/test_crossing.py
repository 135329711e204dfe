"""Zones that are crossed slowly by vehicles that do not switch at will."""

from __future__ import annotations

import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.planning import plan
from maneuver_automaton.planning.among_zones import coasts_through
from maneuver_automaton.problem import Problem, SearchSettings
from tests.planning.test_among_zones import ACROSS, ALONG, ROBOT, posed
from tests.search.cases import compiled_only


def test_zones_are_crossed_where_a_plan_meets_them():
    """Whoever does not switch at will is slow from just before a zone until the body has left."""
    known = Plan([0.0, 0.0, 0.0], (ROBOT["fast"],), durations=[6.0])
    (coast,) = coasts_through(posed(ALONG, Zone(shape=ACROSS, max_speed=0.5)), known)
    assert coast.word == ("slow",)
    assert coast.start[0] == pytest.approx(2.0 - 0.2, abs=0.04)
    assert coast.end[0] == pytest.approx(4.0 + 0.2, abs=0.04)
    assert coast.start[0] < 1.8 < 4.2 < coast.end[0]
    assert not coasts_through(posed(ALONG, Zone(shape=ACROSS, max_speed=0.1)), known)


@pytest.mark.exhaustive
@pytest.mark.slow
@compiled_only
def test_without_a_slow_trim_the_whole_way_is_driven_slowly():
    """The slower trims of the library only drive back: 24.3 s ahead, more than 50 s with them."""
    library = load_stock_library("car_with_trailer")
    strip = Box([5.0, 400.0], [12.0, 0.0])
    problem = Problem(
        library,
        [0.0, 0.0, 0.0],
        (24.0, 0.0, 0.0),
        footprint=Box([4.2, 1.8], [1.2, 0.0]),
        zones=[Zone(shape=strip, max_speed=1.02)],
        search=SearchSettings(max_expansions=400),
    )
    result = plan(problem, time_limit=30.0)
    assert result.cost < 26.0
    assert result.audit.passed
