"""Plans of a fleet, proven again: what keeps the margin by a hair passes, what misses it fails."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.fleet import FleetProblem, verify_fleet
from maneuver_automaton.fleet.verdict import NEAR
from maneuver_automaton.problem import Problem
from tests.fleet.fleets import car
from tests.inertia import unicycle_automaton

BODY = (Disc(0.5),)
SHARPLY = 1e-5  # [m] beside the margin, where it is decided


def lanes(apart, *, margin, body=BODY, turned=0.0):
    """Two cars that drive past each other, their bodies so far apart [m], and their plans."""
    robot, along = car(), [8.0 * math.cos(turned), 8.0 * math.sin(turned)]
    beside = 1.0 + apart
    shift = [-beside * math.sin(turned), beside * math.cos(turned)]
    there = ([0.0, 0.0, turned], [*along, turned])
    back = (
        [along[0] + shift[0], along[1] + shift[1], turned + math.pi],
        [*shift, turned + math.pi],
    )
    problems = [Problem(robot, *ends, footprint=body) for ends in (there, back)]
    fleet = FleetProblem(problems, names=["there", "back"], margin=margin)
    on = robot["on"]
    plans = {
        name: Plan(problem.start, (on,), durations=[8.0])
        for name, problem in zip(fleet.names, problems, strict=True)
    }
    return fleet, plans


@given(st.floats(0.0, 3.0), st.floats(SHARPLY, 0.02), st.floats(-3.0, 3.0))
def test_what_keeps_the_margin_by_a_hair_passes(margin, more, turned):
    fleet, plans = lanes(margin + more, margin=margin, turned=turned)
    verdict = verify_fleet(fleet, plans)
    assert verdict.passed, verdict
    assert verdict.closest[0].distance_m <= margin + more + 1e-9


@given(st.floats(0.1, 3.0), st.floats(SHARPLY, 0.05), st.floats(-3.0, 3.0))
def test_what_misses_it_by_a_hair_does_not(margin, less, turned):
    fleet, plans = lanes(margin - less, margin=margin, turned=turned)
    verdict = verify_fleet(fleet, plans)
    assert not verdict.passed
    assert all(one.passed for one in verdict.verdicts.values())
    assert [row.pair for row in verdict.too_near] == [("there", "back")]
    assert 3.0 <= verdict.too_near[0].time_s <= 5.0


@given(st.floats(0.05, 0.7), st.floats(SHARPLY, 0.004), st.floats(1.0, 6.0))
def test_around_another_one_too(margin, more, turn):
    """A car on a circle of a metre around a disc: its left side, 0.2 m aside, is the nearest."""
    robot, side = car(), 0.2
    disc = Disc(1.0 - side - margin - more)
    end = [math.cos(turn), math.sin(turn), turn + math.pi / 2]
    around = Problem(robot, [1, 0, math.pi / 2], end, footprint=Box([0.8, 2.0 * side]))
    stands = Problem(robot, [0, 0, 0], [0, 0, 0], footprint=disc)
    fleet = FleetProblem([around, stands], names=["around", "stands"], margin=margin)
    plans = {
        "around": Plan([1, 0, math.pi / 2], (robot["left"],), durations=[turn]),
        "stands": Plan([0, 0, 0], (), durations=[]),
    }
    assert verify_fleet(fleet, plans).passed
    nearer = FleetProblem(fleet.problems, names=fleet.names, margin=margin + 2.0 * more)
    assert not verify_fleet(nearer, plans).passed


def test_who_is_farther_is_not_measured():
    fleet, plans = lanes(2.0 * NEAR, margin=0.5)
    verdict = verify_fleet(fleet, plans)
    assert (verdict.passed, verdict.closest) == (True, ())


@pytest.mark.parametrize("standing", ["there", "back"])
def test_who_has_no_plan_stands_at_its_start(standing):
    fleet, plans = lanes(-0.3, margin=0.0, body=(Box([1.0, 0.9]),))
    verdict = verify_fleet(fleet, {name: one for name, one in plans.items() if name != standing})
    assert not verdict.passed  # one has none
    assert verdict.too_near[0].pair == ("there", "back")


@pytest.mark.parametrize(("apart", "passes"), [(1e-3, True), (3e-4, False), (-1e-4, False)])
def test_pairs_are_apart_between_samples_of_maneuvers_too(apart, passes):
    """One brakes and one speeds up before it: nearest half way, amid a step of both courses."""
    robot, first = unicycle_automaton(), {"1, 0": 0.0, "rest": 1.25 + apart}  # 0.25 m are lost
    plans = {}
    for one in robot.maneuvers:
        if {one.source, one.target} == {"1, 0", "rest"}:
            trims = (robot[one.source], robot[one.target])
            start = [first[one.source], 0.0, 0.0]
            plans[one.source] = Plan(start, trims, durations=[0.0, 0.0], maneuvers=[one])
    ends = [(robot, plan.start, plan.end) for plan in plans.values()]
    problems = [Problem(*each, footprint=BODY) for each in ends]
    verdict = verify_fleet(FleetProblem(problems, names=list(plans), margin=5e-4), plans)
    assert (not verdict.too_near) == passes
    assert apart - 1.2e-4 <= verdict.closest[0].distance_m <= max(apart, 0.0)
