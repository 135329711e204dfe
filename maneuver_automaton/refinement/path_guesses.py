"""The kinematic vehicles whose paths lead to guesses for one with inertia, and those guesses."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.models import CarWithTrailer, Model, SecondOrderCar, SecondOrderUnicycle
from maneuver_automaton.optimal_control import Guess
from maneuver_automaton.refinement.gear_sequences import car_library, unicycle_library
from maneuver_automaton.refinement.guesses import (
    Pace,
    Step,
    car_guess,
    pace_of_car,
    pace_of_trailer,
    pace_of_unicycle,
    trailer_guess,
    unicycle_guess,
)

TURNS = (1.0, 0.8)  # of the greatest curvature that lasts, with which they turn
ALONG = 0.5 * math.pi  # [rad] at the hitch, beyond which a trailer is pulled no more


class PathGuesses(NamedTuple):
    """Guesses along plans of kinematic vehicles."""

    libraries: Sequence[Automaton]  # of vehicles that turn as tightly as can be, and less
    pace: Pace  # along their paths
    guess: Callable[[Plan, Array, Array, Step], Guess]
    """From a plan, the first and last reduced state (n_z,), and how many intervals it gets."""


def path_guesses(model: Model) -> PathGuesses | None:
    """How guesses are made along kinematic plans; None for a vehicle that is led by no path."""
    if isinstance(model, SecondOrderCar):
        return _of_car(model)
    if isinstance(model, SecondOrderUnicycle):
        return _of_unicycle(model)
    return _of_trailer(model) if isinstance(model, CarWithTrailer) else None


def _of_car(model: SecondOrderCar) -> PathGuesses:
    library = functools.partial(
        car_library, wheelbase=model.wheelbase, max_steering=model.max_steering
    )
    return PathGuesses(
        [library(share=share) for share in TURNS],
        pace_of_car(model),
        lambda plan, first, last, intervals: car_guess(model, plan, intervals=intervals),
    )


def _of_unicycle(model: SecondOrderUnicycle) -> PathGuesses:
    library = functools.partial(
        unicycle_library, max_speed=model.max_speed, max_turn_rate=model.max_turn_rate
    )
    return PathGuesses(
        [library(share=share) for share in TURNS],
        pace_of_unicycle(model),
        lambda plan, first, last, intervals: unicycle_guess(model, plan, intervals=intervals),
    )


def _of_trailer(model: CarWithTrailer) -> PathGuesses:
    """The car alone, which turns no tighter than its trailer can follow for long.

    Source: the hitch stands still where ``tan(steering) / wheelbase = sin(hitch) / hitch_length``.
    """
    hitch = min(float(model.reduced_limits[0, 1]), ALONG)
    followed = math.sin(hitch) / model.hitch_length * model.wheelbase
    share = min(followed / math.tan(model.max_steering), 1.0)
    library = functools.partial(
        car_library, wheelbase=model.wheelbase, max_steering=model.max_steering
    )
    return PathGuesses(
        [library(share=share * turn) for turn in TURNS],
        pace_of_trailer(model),
        lambda plan, first, last, intervals: trailer_guess(
            model, plan, (float(first[0]), float(last[0])), intervals=intervals
        ),
    )
