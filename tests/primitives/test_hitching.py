"""A car with a trailer: trims at angles of its hitch, and full steering between them."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.models import CarWithTrailer, rollout
from maneuver_automaton.primitives.connecting import maneuver_defect
from maneuver_automaton.primitives.on_the_spot import (
    all_maneuvers_between,
    maneuvers_between,
    trim_at,
)
from maneuver_automaton.primitives.turning import connect_hitches, hitch_trims
from tests.reference_dynamics import trim_defect

TRUCK = CarWithTrailer(
    wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5, min_speed=-0.1
)


def test_trims_hold_their_angle():
    trims = hitch_trims(TRUCK, [-0.6, 0.0, 0.3])
    assert len(trims) == 9
    assert max(trim_defect(TRUCK, trim) for trim in trims) < 1e-8


def test_where_the_wheels_cannot_hold_an_angle_there_is_rest_alone():
    stiff = CarWithTrailer(wheelbase=1.0, hitch_length=0.5, max_steering=0.2, max_speed=1.0)
    assert [trim.name for trim in hitch_trims(stiff, [1.0])] == ["rest, hitch 1"]


def test_maneuvers_end_at_their_trims_and_join_all():
    trims = hitch_trims(TRUCK, np.linspace(-0.7, 0.7, 5).tolist())
    maneuvers = connect_hitches(TRUCK, trims)
    assert len(maneuvers) == 2 * 5 * 4
    automaton = Automaton(TRUCK, trims, maneuvers)
    assert validate(automaton).connected
    for one in maneuvers:
        ends = {"source": automaton[one.source], "target": automaton[one.target]}
        assert maneuver_defect(TRUCK, one, **ends) < 1e-9


def test_no_steering_is_quicker():
    trims = hitch_trims(TRUCK, [0.0, 0.5])
    (one,) = (m for m in connect_hitches(TRUCK, trims) if m.name == "ahead from hitch 0 to 0.5")
    for steering in np.linspace(-1.0, 0.99, 9):
        state = rollout(
            TRUCK, np.zeros(4), control=[0.5, steering], times=[0.0, one.duration]
        )  # fmt: skip
        assert state[-1, 3] < 0.5


def test_where_the_wheels_cannot_bring_the_hitch_there_is_no_maneuver():
    stiff = CarWithTrailer(wheelbase=1.0, hitch_length=0.5, max_steering=0.2, max_speed=1.0)
    made = connect_hitches(stiff, hitch_trims(stiff, [0.0, 0.5]))
    assert {one.name for one in made} == {"ahead from hitch 0.5 to 0", "back from hitch 0 to 0.5"}


def test_maneuvers_to_several_trims_at_once_are_those_to_each():
    here = trim_at(TRUCK, np.array([0.23]), "here")
    pairs = [(here, trim) for trim in hitch_trims(TRUCK, [-0.6, 0.3, 0.6])[::3]]
    for pair, together in zip(pairs, all_maneuvers_between(TRUCK, pairs), strict=True):
        alone = maneuvers_between(TRUCK, *pair)
        assert [one.name for one in together] == [one.name for one in alone]
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-13)
