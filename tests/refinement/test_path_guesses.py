"""Guesses for a car with a trailer along plans of the car alone."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import CarWithTrailer, Unicycle
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.refinement.guesses import path_guesses

TRUCK = CarWithTrailer(
    wheelbase=2.5, hitch_length=4.0, max_steering=0.6, max_speed=2.0, max_hitch=0.7
)


def guess(name, seconds, first=0.0, last=0.0):
    """Along one trim of the library that turns most tightly."""
    led = path_guesses(TRUCK)
    library = led.libraries[0]
    path = Plan([0.0, 0.0, 0.0], (library.trims[library.index_of(name)],), durations=[seconds])
    return led.guess(path, np.array([first]), np.array([last]), lambda duration: 100)


def test_the_car_turns_no_tighter_than_its_trailer_follows_at_its_limit():
    left = path_guesses(TRUCK).libraries[0]
    curvature = left.body_velocities[:, 2].max()
    assert curvature == pytest.approx(np.sin(0.7) / 4.0)
    assert path_guesses(Unicycle()) is None


def test_a_pulled_trailer_follows_as_it_would():
    one = guess("ahead left", 9.0, first=-0.3)
    course = drive(TRUCK, [-0.3], control=one.control, durations=np.full(100, one.duration / 100))
    there = np.interp(np.linspace(0.0, one.duration, 101), course.time, course.reduced_state[:, 0])
    np.testing.assert_allclose(one.state[:, 3], there, atol=0.01)


def test_a_pushed_trailer_comes_to_its_last_angle_and_does_not_jackknife():
    one = guess("back straight", 9.0, first=0.0, last=0.2)
    assert one.state[-1, 3] == 0.2
    assert one.state[0, 3] == pytest.approx(0.2 * np.exp(-9.0 / 4.0), rel=0.1)
    assert (np.diff(one.state[:, 3]) >= 0.0).all()
