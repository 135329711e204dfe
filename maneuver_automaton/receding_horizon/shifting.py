"""The rest of a plan, in the order that costs most first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan, Primitive
from maneuver_automaton.automaton.cutting import NOTHING, joined, tail_of
from maneuver_automaton.primitives import Maneuver, Trim


def rest_of(
    plan: Plan, after: float, *, start: Array | None = None, pad: Trim | None = None
) -> Plan:
    """The rest of a plan after `after` seconds, from `start`; `pad` makes it last as long again.

    Of a maneuver under way its end remains. This is the plan that makes the loop recursively
    feasible: where the goal was to be met after T, it is met after T - `after`, and the vehicle
    rests there.

    Source: the paper, Sec. 4, after Algorithm 14.

    Parameters
    ----------
    plan : Plan
    after : float
        [s] that have passed since its start.
    start : (dof,) array, optional
        Where the vehicle is [m, m, rad(, m)]; if omitted, where the plan says.
    pad : Trim, optional
        A rest, appended for as long as has passed; a plan that ends in a rest stays in that.

    Returns
    -------
    Plan

    Examples
    --------
    >>> ahead = Trim(name="ahead", body_velocity=[1, 0, 0], control=[1, 0])
    >>> rest = Trim(name="rest", body_velocity=[0, 0, 0], control=[0, 0])
    >>> left = rest_of(Plan([0, 0, 0], (ahead,), durations=[2.0]), 0.5, pad=rest)
    >>> left.word, left.durations.tolist(), left.end.tolist()
    (('ahead', 'rest'), [1.5, 0.5], [2.0, 0.0, 0.0])
    """
    left = without_nothing(tail_of(plan, after, start=start))
    return left if pad is None else rested(left, pad, after)


def rested(plan: Plan, pad: Trim, duration: float) -> Plan:
    """The plan with `duration` more seconds of rest: of the one it ends in, otherwise of `pad`."""
    if not duration > NOTHING:
        return plan
    times, between = plan.durations.tolist(), plan.maneuvers
    if plan.trims and plan.trims[-1].is_rest:
        word, times[-1] = plan.trims, times[-1] + duration
    else:
        word, times = (*plan.trims, pad), [*times, duration]
        between = (*between, None) if between else ()
    if not between:
        return Plan.of_parts(plan.start, *merged(word, times), start_time=plan.start_time)
    return without_nothing(replace(plan, trims=word, durations=times, maneuvers=between))


def followed_by(first: Plan, second: Plan) -> Plan:
    """One plan, then another that begins where the first one ends."""
    if not first.trims:
        return replace(second, start=first.start, start_time=first.start_time)
    return without_nothing(joined(first, second)) if second.trims else first


def without_nothing(plan: Plan) -> Plan:
    """The plan without trims that last no time; beside maneuvers they stay."""
    if plan.maneuvers:
        return plan
    word, times = merged(plan.trims, plan.durations.tolist())
    if len(word) == len(plan.trims):
        return plan
    return Plan.of_parts(plan.start, word, times, start_time=plan.start_time)


def moving_pieces(plan: Plan) -> Iterator[Primitive]:
    """The trims and maneuvers of a plan that last, without those that stand still."""
    durations: list[float] = plan.primitive_durations.tolist()
    for piece, duration in zip(plan.primitives, durations, strict=True):
        if isinstance(piece, Maneuver) or (duration > NOTHING and not piece.is_rest):
            yield piece


def moves_on(plan: Plan) -> bool:
    """Whether a plan is more than to stand still."""
    return any(True for _ in moving_pieces(plan))


def merged(
    trims: Sequence[Trim], durations: Sequence[float]
) -> tuple[tuple[Trim, ...], list[float]]:
    """Equal neighbours as one trim, and trims that last no time left out."""
    word: list[Trim] = []
    times: list[float] = []
    for trim, duration in zip(trims, durations, strict=True):
        if duration <= NOTHING:
            continue
        if word and _same(word[-1], trim):
            times[-1] += duration
        else:
            word.append(trim)
            times.append(duration)
    return tuple(word), times


def _same(one: Trim, other: Trim) -> bool:
    if one is other:
        return True
    return one.name == other.name and bool((one.body_velocity == other.body_velocity).all())


def costliest_first(plan: Plan, rates: Array) -> Plan:
    """A plan whose trims that commute are ordered by falling cost per second, rest last.

    The order of trims that share a centre, or are all straight, does not change where they lead.
    Among these orders this one costs most early on, which the paper's tie rule asks for: with the
    opposite one the closed loop of its Table 1 never arrives.

    Source: the paper, Sec. 4.2 (rest to the end) and 5.1 (greatest cost first).
    """
    if len(plan.trims) < 2:
        return plan
    twists = [trim.body_velocity.tolist() for trim in plan.trims]
    moves = [any(twist) for twist in twists]
    moving = [k for k, move in enumerate(moves) if move]
    order: list[int] = []
    block: list[int] = []
    costly: list[float] = (-rates).tolist()
    for k in moving:
        if not all(commute(twists[j], twists[k]) for j in block):  # a climb commutes with both
            order += block if len(block) == 1 else sorted(block, key=costly.__getitem__)
            block = []
        block.append(k)
    order += sorted(block, key=costly.__getitem__)
    order += [k for k, move in enumerate(moves) if not move]
    if order == list(range(len(twists))):
        return plan
    word, times = merged([plan.trims[k] for k in order], plan.durations[order].tolist())
    return Plan.of_parts(plan.start, word, times, start_time=plan.start_time)


def commute(one: Sequence[float] | Array, other: Sequence[float] | Array) -> bool:
    """Whether two twists commute: their Lie bracket is zero.

    Examples
    --------
    >>> commute([1.0, 0.0, 0.0], [-2.0, 0.0, 0.0])
    True
    >>> commute([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    False
    """
    bracket = max(
        abs(one[2] * other[0] - other[2] * one[0]), abs(one[2] * other[1] - other[2] * one[1])
    )
    if not bracket:
        return True
    scale = max(map(abs, one)) * max(map(abs, other))
    return bool(bracket <= 1e-12 * scale)
