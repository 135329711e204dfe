"""Libraries of vehicles whose rates are limited: no solver, hundreds of maneuvers at once."""

from __future__ import annotations

from collections.abc import Sequence

from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.bang_bang import Pairs, connect_bang_bang, differing
from maneuver_automaton.primitives.strokes import strokes as strokes_of
from maneuver_automaton.primitives.strokes import turns as turns_of


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

    In narrow places a maneuver between speed trims is longer than the room there is: short
    strokes, one for every rest, are what parking is made of.

    Parameters
    ----------
    model : Model
        A vehicle whose control is the rate of its reduced state.
    trims : sequence of Trim
        The nodes.
    pairs : "all" or "neighbours"
        See `connect_bang_bang`.
    late : bool
        Whether to add the maneuvers that wait first, where they lead elsewhere.
    strokes : sequence of float
        Lengths, negative in reverse [m].
    turns : sequence of float
        Angles of turns on the spot [rad], for vehicles that can.
    name : str
        Of the library.

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
    early = connect_bang_bang(model, trims, pairs=pairs)
    more: list[Maneuver] = []
    if late:
        more += differing(early, connect_bang_bang(model, trims, pairs=pairs, late=True))
    rests = [trim for trim in trims if trim.is_rest]
    if strokes and rests:
        more += strokes_of(model, rests, strokes)
    for rest in rests if turns else ():
        more += turns_of(model, rest, turns)
    return Automaton(model, tuple(trims), (*early, *more), name=name)
