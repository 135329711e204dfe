"""All maneuvers of a vehicle of limited rates: between its trims, and from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence

from maneuver_automaton.models import Model
from maneuver_automaton.primitives.bang_bang import Pairs, connect_bang_bang, differing
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.strokes import strokes as strokes_of
from maneuver_automaton.primitives.strokes import turns as turns_of
from maneuver_automaton.primitives.trim import Trim


def quickest_maneuvers(
    model: Model,
    trims: Sequence[Trim],
    *,
    pairs: Pairs = "neighbours",
    late: bool = False,
    strokes: Sequence[float] = (),
    turns: Sequence[float] = (),
) -> tuple[Maneuver, ...]:
    """Quickest maneuvers between trims; strokes and turns on the spot at every trim that rests.

    In narrow places a maneuver between speed trims is longer than the room there is: short
    strokes are what parking is made of.

    Parameters
    ----------
    model : Model
        A vehicle whose control is the rate of its reduced state.
    trims : sequence of Trim
        Its trims.
    pairs : "all", "neighbours" or a sequence of pairs of int
        See `connect_bang_bang`.
    late : bool
        Whether to add the maneuvers that are as quick but change late what has time, where these
        lead elsewhere.
    strokes, turns : sequences of float
        Lengths, negative in reverse [m], and angles of turns on the spot [rad].

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> from maneuver_automaton.primitives.equilibrium import trims_of
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> trims = trims_of(car, {"speed": [-1.0, 0.0, 2.0], "steering": [-0.7, 0.0, 0.7]}).trims
    >>> len(quickest_maneuvers(car, trims, strokes=[0.5, -0.5]))
    46
    """
    early = connect_bang_bang(model, trims, pairs=pairs)
    others = connect_bang_bang(model, trims, pairs=pairs, late=True) if late else early
    rests = [trim for trim in trims if trim.is_rest]
    return (
        *early,
        *differing(early, others),
        *(strokes_of(model, rests, strokes) if strokes else ()),
        *(turns_of(model, rests, turns) if turns else ()),
    )
