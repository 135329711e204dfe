"""Libraries of vehicles whose rates are limited: no solver, hundreds of maneuvers at once."""

from __future__ import annotations

from collections.abc import Sequence

from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.bang_bang import Pairs
from maneuver_automaton.primitives.quickest import quickest_maneuvers


def bang_bang_library(
    model: Model,
    trims: Sequence[Trim],
    *,
    pairs: Pairs = "neighbours",
    late: bool = False,
    strokes: Sequence[float] = (),
    turns: Sequence[float] = (),
    name: str = "",
) -> Automaton:
    """Trims joined by the quickest maneuvers, and rest to rest by strokes of given lengths.

    The arguments are those of `quickest_maneuvers`; `Automaton.of_model` finds the trims as well.

    Examples
    --------
    >>> import numpy as np
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> from maneuver_automaton.primitives.equilibrium import trims_of
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> trims = trims_of(car, {"speed": [-1.0, 0.0, 2.0], "steering": [-0.7, 0.0, 0.7]}).trims
    >>> len(bang_bang_library(car, trims, strokes=[0.5, -0.5]).maneuvers)
    46
    """
    maneuvers = quickest_maneuvers(
        model, trims, pairs=pairs, late=late, strokes=strokes, turns=turns
    )
    return Automaton(model, tuple(trims), maneuvers, name=name)
