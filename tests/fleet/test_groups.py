"""Groups planned as a whole: over all priorities, and conflict by conflict."""

from __future__ import annotations

import itertools
import math

import pytest

from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet import FleetStatus, plan_fleet, verify_fleet
from maneuver_automaton.fleet.coordination import (
    Turns,
    _closed,
    _until,
    _within,
    by_conflicts,
    by_priorities,
)
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.scenario import load_scenario
from tests.fleet import fleets
from tests.scenario.test_vehicles import SCENARIOS

SEARCHES = [by_priorities, by_conflicts]


def turns_of(fleet):
    """Vehicles that know their ways alone."""
    budget = Budget.from_now(100.0)
    vehicles = vehicles_of(fleet)
    for one in vehicles:
        one.plan_alone(budget)
    return Turns(vehicles, fleet.margin, budget)


def cost_of(held):
    return math.fsum(one.cost for one in held.values())


def alcove():
    return load_scenario(SCENARIOS / "fleets" / "alcove.yaml").fleet


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("fleet", [fleets.crossing(), fleets.swap(3)], ids=["crossing", "swap"])
def test_plans_keep_apart_and_cost_no_more_than_the_best_order(search, fleet):
    turns = turns_of(fleet)
    numbers = range(len(fleet))
    held = search(turns, numbers, {}, math.inf)
    assert sorted(held) == list(numbers)
    assert not meetings({k: one.course for k, one in held.items()}, keep=fleet.margin)
    assert verify_fleet(fleet, {fleet.names[k]: one.plan for k, one in held.items()}).passed
    orders = [turns.one_after_another(order, {}) for order in itertools.permutations(numbers)]
    best = min(cost_of(one) for one in orders)
    if search is by_priorities:
        assert cost_of(held) <= best * (1.0 + 1e-3)
    assert search(turns, numbers, {}, cost_of(held)) is None  # nothing costs less


def test_others_are_kept_clear_of():
    fleet = fleets.random_fleet(4, 3)
    turns = turns_of(fleet)
    first = turns.one_after_another([3], {})
    for search in SEARCHES:
        held = search(turns, (0, 1), first, math.inf)
        courses = {k: one.course for k, one in {**first, **held}.items()}
        courses[2] = turns.vehicles[2].standing
        assert not meetings(courses, keep=fleet.margin, among=[0, 1])


def test_who_meets_nobody_keeps_its_way_alone():
    ends = [([0, y, 0], [5, y, 0]) for y in (0.0, 5.0)]
    turns = turns_of(fleets.fleet_of(ends))
    for search in SEARCHES:
        held = search(turns, (0, 1), {}, math.inf)
        assert cost_of(held) == pytest.approx(10.0)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_both_give_way_in_the_alcove():
    """One after another the second waits until the first has gone by: 26.9 s."""
    result = plan_fleet(alcove(), time_limit=60.0, max_rounds=6)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s < 23.5


@pytest.mark.slow
def test_a_moved_group_has_the_moved_plans():
    by = SE2([30.0, -20.0, 2.0])
    for search in SEARCHES:
        one = search(turns_of(fleets.swap(3)), range(3), {}, math.inf)
        other = search(turns_of(fleets.swap(3).moved(by)), range(3), {}, math.inf)
        for k, found in one.items():
            assert other[k].plan.word == found.plan.word
            assert other[k].plan.durations == pytest.approx(found.plan.durations, abs=1e-5)


def test_who_gives_way_does_so_to_all_above():
    assert _closed(frozenset({(0, 1), (1, 2), (2, 3)})) == {
        (0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3),
    }  # fmt: skip


def test_a_conflict_lasts_until_both_are_apart():
    turns = turns_of(fleets.crossing())
    one, other = (turns.vehicles[k].alone.course for k in (0, 1))
    (met,) = meetings({0: one, 1: other}, keep=0.0)
    until = _until(one, other, met.time, 0.0)
    assert met.time < until < 6.0
    bodies = _within(other.obstacles, (met.time, until))
    assert [body.present_s for body in bodies] == [(met.time, until)]
    assert _within(bodies, (until + 1.0, math.inf)) == []
    later = {0: one.after(until + 0.05), 1: other.after(until + 0.05)}
    assert not meetings(later, keep=0.0)
