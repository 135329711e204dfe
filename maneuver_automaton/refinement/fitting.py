"""Which conditions of a problem a plan breaks, and the same word with times that keep them.

A search that knows no least coasting time, or no exact final time, finds words that break them. The
word is kept and its times are solved for once more, under the conditions of the horizon. Whether
the new times are collision-free is to be checked by whoever asked.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem, Unstated
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words._kernels_steering import pairs_ending
from maneuver_automaton.words.closing import EndConditions, closest_times, conjugated, times_through

TIME_TOLERANCE = 1e-9  # [s] by which a time may miss a limit, and as a share of the limit
NO_TIME = 0.0  # [s] a trim that lasts no longer is not one of the word


def broken_condition(problem: Problem, plan: Plan) -> str:
    """Which condition on its word and times a plan breaks, in one line; empty if it keeps them all.

    These are the conditions that no collision check and no simulation can see: the horizon, the
    number of trims, the least time of a trim that moves, and the longest time of every trim.
    """
    horizon, duration = problem.horizon, plan.duration
    if horizon.time is not None and abs(duration - horizon.time) > _slack(horizon.time):
        return f"it takes {duration:.6g} s, {horizon.time:g} s are asked"
    if horizon.max_time is not None and duration > horizon.max_time + _slack(horizon.max_time):
        return f"it takes {duration:.6g} s, at most {horizon.max_time:g} s are admitted"
    times = zip(plan.trims, plan.durations.tolist(), strict=True)
    lasting = [(trim, time) for trim, time in times if time > NO_TIME]
    if horizon.max_trims is not None and len(lasting) > horizon.max_trims:
        return f"it has {len(lasting)} trims, {horizon.max_trims} are admitted"
    for trim, time in lasting:
        if time < horizon.min_coast - TIME_TOLERANCE and not trim.is_rest:
            return f"trim {trim.name!r} lasts {time:.6g} s, less than {horizon.min_coast:g} s"
        if time > (most := trim.max_duration) and time > most + _slack(most):
            return f"trim {trim.name!r} lasts {time:.6g} s, more than {trim.max_duration:g} s"
    return ""


def _slack(limit: float) -> float:
    """By how much rounding may exceed a limit [s]."""
    return TIME_TOLERANCE * (1.0 + limit)


CHANGED = 2  # trims at most that are left out, or no longer so, to meet a least coasting time
RESTARTS = 2
NEAR = 2  # trims on either side of a short one
LOOKED_AT = 1000  # trims of plans in which short ones in a row stay, before no more are tried
SHORT = 0.02  # [s] that a trim lasts, unless the horizon says otherwise ...
COSTLIER = 1e-3  # ... or the plan would become costlier by more than this share of its cost
CLOSED = 1e-12  # [m, rad, s] that an exact end may miss
MET = 1e-9  # [m, rad] from a goal, beyond its tolerance, where the checks take it to be met
BESIDE = 1e-6  # [m, rad] from a goal, per metre to it, where exact times are worth a look
Passage = tuple[float, Goal]
"""Where in a word, 1 after its first trim, 1.5 in the midst of its second, what is passed."""

ROUNDED = 1e-3  # share of it that rounding may take
Complexes = NDArray[np.complex128]
NONE = 1e-8  # [s, rad] of a coast that is none, or of one that misses a whole turn
MOST_TRIMS = 40  # of a library, of which every two are tried


def fitted_plans(
    problem: Problem, plan: Plan, goal: Goal, *, budget: Budget = UNLIMITED
) -> Iterator[Plan]:
    """Plans of the same word that keep to the horizon, the cheapest first; none if none is known.

    A moment after the time of a `budget` is over, those that were found by then.
    """
    plan = padded(problem, plan)
    if not broken_condition(problem, plan):
        yield plan
        return
    if not plan.trims:
        return
    found: list[Plan] = []
    for least, longest in _coasting_limits(problem, plan):
        if budget.left_to_check == 0.0:
            break
        again = _solved(problem, plan, goal, least, longest)
        if again is None or broken_condition(problem, again):
            continue
        if not any(np.allclose(again.durations, one.durations, atol=1e-9) for one in found):
            found.append(again)
    yield from sorted(found, key=problem.cost_of)


def nearly_met(problem: Problem) -> Iterator[tuple[Plan, int]]:
    """Plans of at most two trims that meet a goal for the checks, and the goal; cheapest first.

    An exact end next to that of so short a word may need whole turns, or not exist: then the few
    digits by which coordinates are rounded decide what a plan costs.
    """
    automaton, found = problem.automaton, list[tuple[Plan, int]]()
    start, clock = problem.start, problem.start_time
    for index, goal in enumerate(problem.goals):
        distance, turn = goal.off(start)
        first, last = problem.first_trim, problem.last_trim(goal)
        if distance <= goal.tolerance_m + MET and turn <= goal.tolerance_rad + MET:
            if np.array_equal(first.reduced_state, last.reduced_state):
                restless = automaton.is_kinematic and automaton.rest is None
                word = [] if restless else [first]
                plan = Plan(start, word, durations=[0.0] * len(word), start_time=clock)
                found.append((plan, index))
        elif len(joined := _joined(automaton, first.name, last.name)) <= MOST_TRIMS:
            asked = [(goal.pose, joined)]
            if goal.free_heading:
                asked = [(pose, (trim,)) for trim in joined for pose in _passed(start, goal, trim)]
            for pose, trims in asked:
                for word, times in _short_words(problem, pose, trims):
                    plan = Plan(start, word, durations=times, start_time=clock)
                    found.append((plan, index))
    yield from sorted(found, key=lambda one: problem.cost_of(one[0]))


@kept_by_first
def _joined(automaton: Automaton, first: str, last: str) -> tuple[Trim, ...]:
    """The moving trims that need no maneuver on the way from the first trim to the last."""
    classes = automaton.trim_classes.tolist()
    a, b = (classes[automaton.index_of(name)] for name in (first, last))
    both = zip(automaton.trims, classes, strict=True)
    return tuple(trim for trim, kind in both if kind == a == b and not trim.is_rest)


def _passed(start: Array, goal: Goal, trim: Trim) -> Iterator[Array]:
    """The pose in which a trim passes right beside a goal of any heading."""
    (v_x, v_y, w), way = trim.body_velocity[:3].tolist(), goal.pose - start
    v, z = complex(v_x, v_y), complex(way[0], way[1]) * cmath.rect(1.0, -start[2])
    if v:
        r = -1j * v / w if w else 0.0
        turn = cmath.phase((z + r) / r) if r else 0.0
        aside = abs(z + r) - abs(r) if r else (z / v).imag * abs(v)
        if abs(aside) <= BESIDE * (1.0 + abs(z)):
            yield np.array([*goal.pose[:2], start[2] + turn, *goal.pose[3:]])


def _short_words(
    problem: Problem, goal: Array, trims: tuple[Trim, ...]
) -> Iterator[tuple[list[Trim], list[float]]]:
    """Words of at most two of these trims that end at a goal but for `MET`, with their times."""
    rows = np.array([trim.body_velocity for trim in trims]).reshape(-1, problem.start.size)
    way = goal - problem.start
    z, heading = complex(way[0], way[1]) * cmath.rect(1.0, -problem.start[2]), float(way[2])
    i, j = pairs_ending(z, heading, rows, BESIDE * (1.0 + abs(z))).T
    if not i.size:
        return
    v, w = rows[:, 0] + 1j * rows[:, 1], rows[:, 2]
    turns = w != 0.0

    def ended(h: Array) -> tuple[Array, Complexes, Complexes]:
        """Of words that end heading `h`: heading at the switch, what is left, what stays aside."""
        last = np.exp(1j * h)
        centres = np.angle((z + r[i] - r[j] * last) / (r[i] - r[j]))  # of two turns decide
        between = np.where(turns[j] & (r[i] != r[j]), centres, h) * turns[i]
        switch = np.exp(1j * between)
        left = z - r[i] * (switch - 1.0) - r[j] * (last - switch)  # for straights to cover
        straight = np.where(turns[j], v[i], v[j] * switch)
        aside = 1j * (left / straight).imag * straight
        return between, left, np.where(turns[i] & turns[j], left, aside)

    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(turns, -1j * v / w, 0.0)  # from the centre of a turn to the pose
        h = np.full(i.size, heading)
        aside = ended(h)[2]
        slope = (ended(h + BESIDE)[2] - aside) / BESIDE
        most = (1.0 - ROUNDED) * MET  # by which the last heading may be off as well
        h = h + np.where(np.abs(aside) > most, (-aside / slope).real.clip(-most, most), 0.0)
        between, left, _ = ended(h)
        first, second = v[i], v[j] * np.exp(1j * between)
        area = (first.conj() * second).imag
        times = np.array([(left.conj() * second).imag / area, (first.conj() * left).imag / area])
        one = turns[i] | turns[j] | (np.abs(area) <= NONE * np.abs(first * second))
        alone = [(left / first).real, np.where(turns[i], (left / second).real, 0.0)]
        times = np.where(one, alone, times)
        angles = np.array([between, h - between]) * np.sign(w[[i, j]])
        angles = np.remainder(angles + NONE, math.tau) - NONE
        times = np.where(turns[[i, j]], angles / np.abs(w[[i, j]]), times)
    times[~((np.abs(times) < np.inf) & ((times > 0.0) | (times < -NONE)))] = 0.0
    group, seen = problem.automaton.model.group, set[tuple[int, ...]]()
    ends = group.exp(times[0, :, None] * rows[i]) @ group.exp(times[1, :, None] * rows[j])
    off = ends.pose - np.array([z.real, z.imag, heading, *way[3:]])
    turned = np.abs(wrapped(off[:, 2]))
    off = np.maximum(turned, np.linalg.norm(np.delete(off, 2, axis=1), axis=1))
    for k in np.flatnonzero((times >= 0.0).all(axis=0) & (off <= MET)).tolist():
        both = zip((i[k], j[k]), times[:, k].tolist(), strict=True)
        word = [(n, time) for n, time in both if time]
        if (numbers := tuple(int(n) for n, _ in word)) not in seen:
            seen.add(numbers)
            yield [trims[n] for n in numbers], [time for _, time in word]


def with_lasting_coasts(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    *,
    is_free: Callable[[Plan], bool],
    passes: Callable[[Plan], Sequence[tuple[float, Goal]]],
) -> Plan:
    """The plan without trims of less than 20 ms, as far as that is free and hardly costlier.

    Such a trim is left out, or lasts so long; others change as little as they can: all of them,
    those near it, after it, or before it, whatever is free. Where that fails another trim stands
    beside it, which takes back what it turns too far. Where the horizon states a least time, be it
    zero, the plan stays as it is. What a plan `passes` on its way, each after some seconds, the
    other passes too.
    """
    if not has_short_coasts(problem, plan):
        return plan
    most, failed = problem.cost_of(plan) * (1.0 + COSTLIER), 0
    through = _within(plan, passes(plan))
    while failed < min(len(short := _short(plan)), LOOKED_AT // max(len(plan.trims), 1)):
        for other in _without_short(problem, plan, goal, short[failed], through):
            if (
                other is not None
                and goal.off(other.end)[1] <= goal.tolerance_rad + MET
                and len(_short(other)) < len(short)
                and problem.cost_of(other) <= most
                and not broken_condition(problem, other)
                and is_free(other)
            ):
                plan, through, failed = other, _within(other, passes(other)), -1
                break
        failed += 1
    return plan


def _within(plan: Plan, passes: Sequence[tuple[float, Goal]]) -> list[Passage]:
    """Where in its word a plan passes each goal; what it passes in a maneuver, it still begins."""
    lasting = [0.0, *(one.duration if one else 0.0 for one in plan.maneuvers)]
    begins = np.cumsum([0.0, *plan.durations[:-1]]) + np.cumsum(lasting)[: len(plan.trims)]
    found = list[Passage]()
    for time, goal in passes:
        k = max(int(np.searchsorted(begins, time - TIME_TOLERANCE)) - 1, 0)
        passed, lasts = time - float(begins[k]), float(plan.durations[k])
        if passed > lasts + TIME_TOLERANCE:
            goal = Goal(plan.pose_at(plan.start_time + begins[k] + lasts))
        share = 1.0 if passed > lasts - TIME_TOLERANCE else passed / lasts
        if k + share > 0.0:
            found.append((k + share, goal))
    return found


def _without_short(
    problem: Problem, plan: Plan, goal: Goal, short: int, through: Sequence[Passage]
) -> Iterator[Plan | None]:
    """Plans in which a short trim lasts longer or not at all; None where no times are found.

    They end where the plan does; where the heading may be another one at the goal, at any.
    """
    turns = goal.free_heading or goal.tolerance_rad > 0.0
    end = Goal(plan.end if turns or goal.tolerance_m else goal.pose, free_heading=turns)
    away = np.arange(plan.durations.size) - short
    times = (np.where(away == 0, lasting, plan.durations) for lasting in (0.0, SHORT))
    changing = (away != 0, (away != 0) & (np.abs(away) <= NEAR), away > 0, away < 0)
    for some, of_these, least in itertools.product(times, changing, (0.0, SHORT)):
        yield _with_times(problem, plan, end, some, of_these, least, through)
    if plan.maneuvers:
        return
    moving = [one for one in problem.automaton.trims if not one.is_rest][:MOST_TRIMS]
    beside = (short - 1 if short else 1) % away.size  # a neighbour gives what both take
    every = np.ones(away.size + 1, dtype=np.bool_)
    ways = itertools.product((SHORT, 2.0 * SHORT), (short, short + 1), moving)
    for longer, at, trim in ways:
        if trim not in plan.trims[max(at - 1, 0) : at + 1]:
            lasting = plan.durations + longer * (away == 0)
            lasting[beside] = max(lasting[beside] - 2.0 * longer, SHORT)
            trims = (*plan.trims[:at], trim, *plan.trims[at:])
            more = replace(plan, trims=trims, durations=np.insert(lasting, at, longer))
            later = [(place + (place > at), one) for place, one in through]
            yield _with_times(problem, more, end, more.durations, every, SHORT, later)


def has_short_coasts(problem: Problem, plan: Plan) -> bool:
    """Whether a plan has trims of less than 20 ms, and no horizon that says whether it may."""
    return isinstance(problem.horizon.min_coast, Unstated) and bool(_short(plan))


def _short(plan: Plan) -> list[int]:
    """Trims of a plan that move for less than 20 ms and could last longer, the shortest first."""
    times, trims = plan.durations.tolist(), plan.trims
    short = [k for k, one in enumerate(times) if 0.0 < one < SHORT and not trims[k].is_rest]
    short = [k for k in short if times[k] < min(SHORT, trims[k].max_duration) * (1.0 - 1e-9)]
    return sorted(short, key=times.__getitem__)


def _with_times(
    problem: Problem,
    plan: Plan,
    end: Goal,
    times: Array,
    free: NDArray[np.bool_],
    least: float,
    through: Sequence[Passage] = (),
) -> Plan | None:
    """The word of a plan with times near some, those that are free at least so long, to an end."""
    group, n = problem.automaton.model.group, len(times)
    places = np.unique([*range(1, n + 1), *(place for place, _ in through)])
    shares, whose = np.diff(places, prepend=0.0), np.ceil(places).astype(int) - 1
    lasting, frees = times[whose] * shares, free[whose]
    twists = np.array([trim.body_velocity for trim in plan.trims])[whose]
    held = group.exp(np.where(frees, 0.0, lasting)[:, None] * twists)  # as displacements
    steps = np.vstack([_displacements(plan), np.zeros(plan.start.size)])[whose]
    steps = (held @ group(steps * (places == whose + 1)[:, None])).pose
    conditions = []
    for place, passed in (*through, (n, end)):
        last = int(np.searchsorted(places, place))
        before = np.vstack([steps[:last], held.pose[last]])
        seen, product = conjugated((twists * frees[:, None])[: last + 1], before)
        one = EndConditions(
            start=plan.start,
            twists=seen,
            goal=passed.pose,
            free_heading=passed.free_heading,
            product=product,
        )
        conditions.append(one)
    if problem.horizon.time is not None:
        total = np.array([plan.durations.sum() - times[~free].sum()])
        conditions[-1] = replace(one, rows=frees[None].astype(float), targets=total)
    if through:
        least_of = np.where(shares == 1.0, least, 0.0)
        changed, missing = times_through(conditions, lasting, at_least=least_of)
        changed = np.bincount(whose, weights=changed, minlength=n).astype(np.float64)
    else:
        changed, missing = closest_times(conditions[-1], lasting, at_least=least)
    if missing >= CLOSED:
        return None
    return without_nothing(replace(plan, durations=np.where(free, changed, times)))


def _displacements(plan: Plan) -> Array:
    """Displacement (n - 1, dof) after each trim but the last; zero for a switch."""
    steps = np.zeros((len(plan.trims) - 1, plan.start.size))
    for k, one in enumerate(plan.maneuvers):
        steps[k] = one.displacement if one else 0.0
    return steps


def padded(problem: Problem, plan: Plan) -> Plan:
    """The plan with a rest that fills a fixed time, at its end or else at its begin."""
    total = problem.horizon.time
    if total is None or not plan.trims or plan.duration >= total:
        return plan if plan.duration > 0.0 else without_nothing(plan)
    durations = plan.durations.copy()
    for place in (-1, 0):
        if plan.trims[place].is_rest:
            durations[place] += total - plan.duration
            return replace(plan, durations=durations)
    return plan


def without_nothing(plan: Plan) -> Plan:
    """The plan without trims that last no time, and neighbours that are one trim joined.

    Beside maneuvers such trims stay: they are what a maneuver begins and ends in. A plan that lasts
    no time and stays where it is becomes an empty word.
    """
    if any(one and one.displacement.any() for one in plan.maneuvers) or (
        plan.maneuvers and plan.duration > 0.0
    ):
        return plan
    word, lasting = list[int](), list[float]()
    for k, time in enumerate(plan.durations.tolist()):
        if time == 0.0:
            continue
        if word and plan.trims[word[-1]] is plan.trims[k]:
            lasting[-1] += time
        else:
            word.append(k)
            lasting.append(time)
    if len(word) == len(plan.trims):
        return plan
    trims = tuple(plan.trims[k] for k in word)
    return replace(plan, trims=trims, durations=np.array(lasting), maneuvers=())


def _coasting_limits(problem: Problem, plan: Plan) -> Iterator[tuple[Array, Array]]:
    """Least and greatest coasting times (n,) [s] to try."""
    least_coast = problem.horizon.min_coast
    longest = np.array([trim.max_duration for trim in plan.trims])
    still = np.array([trim.is_rest for trim in plan.trims])
    yield np.zeros(len(longest)), longest  # maybe only the times are wrong
    if least_coast == 0.0:
        return
    moving = np.flatnonzero(~still & (longest >= least_coast)).tolist()
    for count in range(CHANGED + 1):
        for changed in itertools.combinations(moving, count):
            lasts = plan.durations > 0.0
            lasts[list(changed)] ^= True
            lasts &= longest >= least_coast
            floors = np.where(still | ~lasts, 0.0, least_coast)
            yield floors, np.where(still | lasts, longest, 0.0)


def _solved(problem: Problem, plan: Plan, goal: Goal, least: Array, longest: Array) -> Plan | None:
    """The word of a plan with the best times within limits, as long as the horizon asks for."""
    group = problem.automaton.model.group
    lasting = sum(one.duration for one in plan.maneuvers if one)
    time, most = problem.horizon.time, problem.horizon.max_time
    totals = [time] if most is None else [None, most]
    rates = problem.rates_of(plan)
    for total in totals:
        left = None if total is None else total - lasting
        if left is not None and left < 0.0:
            return None
        solved = solve_switching_times(
            np.array([trim.body_velocity for trim in plan.trims]),
            rates,
            (group(plan.start).inverse() @ group(goal.pose)).pose,
            displacements=_displacements(plan),
            total=left,
            free_heading=goal.free_heading,
            least=least,
            longest=longest,
            guesses=[np.clip(plan.durations, least, longest)],
            restarts=RESTARTS,
        )
        if solved.status is TimesStatus.FAILED:
            continue
        again = replace(plan, durations=solved.durations)
        if not broken_condition(problem, again):
            return again
    return None
