"""What a motion costs because of where it goes: its place costs, integrated along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups.se2 import after, displacements
from maneuver_automaton.models import Model
from maneuver_automaton.places import (
    PlaceCost,
    allowed,
    gradient_of,
    jumps_along,
    rates_along,
    scale_of,
    smoothed,
)
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import along
from maneuver_automaton.primitives.primitive import Trajectory

SHARE = 2e-4  # of a plan's whole cost: by how much a price may be off, as estimated
TURN = 0.4  # [rad] of an interval at most, before any is halved
ROUNDS = 24  # in which intervals are halved
DENSE = 0.25  # of a scale, and [rad], between samples of a course that is driven as sampled
GAUSS = 0.5 + 0.5 * np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
LONGER, LEAST_S = 1.5, 0.5  # than a coast is, and [s]: for how long points are close enough
MOMENT = 1e-12  # [s] that every coast lasts there
MOST_INTERVALS = 1 << 16
MOST_STRETCHES = 1 << 20  # to begin with
KINKED = 1.0 / 3.0  # of what two rules differ by, that the finer one is off at a kink of a rate
NODES = np.linspace(0.0, 1.0, 5)
ASIDE = 0.5  # of second differences of nodes, by which a course is off their chords; 0.13 on an arc
COARSE, FINE = np.array([1, 0, 4, 0, 1]) / 6.0, np.array([1, 4, 2, 4, 1]) / 12.0  # Simpson's rule


_Known: TypeAlias = dict[int, tuple[Array, Array, Array]]


class PlacePrice(NamedTuple):
    """The price of the places along a motion."""

    price: float
    error: float  # by how much it is off, as the last halving shows
    refused: float | None  # [s] when it first is where it must not be; None: never


class _Intervals(NamedTuple):
    """Stretches of a plan, each within one primitive."""

    piece: IntArray  # (n,)
    begin: Array  # (n,) [s] since the primitive began
    end: Array  # (n,)


def price_along(cost: PlaceCost, plan: Plan, model: Model, *, beside: float) -> PlacePrice:
    """The integral of a cost along a plan, to `SHARE` of it and of what the plan costs `beside`.

    Simpson's rule over stretches not longer than the finest feature; those whose halves say
    something else are halved again, until what they differ by in all is small enough, and those
    which the border of an area comes near, until what a piece over it between nodes costs is. What
    has kinks at most is off the finer rule by a `KINKED` share of what both rules differ by: halves
    are off by a quarter of what the whole is.
    """
    motion = _Motion(cost, plan, model)
    sure = KINKED if getattr(cost, "continuous", False) else 1.0
    todo, done, doubt, refused = _first_stretches(plan, scale_of(cost)), 0.0, 0.0, None
    seen, new = np.empty((len(todo.piece), len(NODES), 4)), slice(None)
    for left in reversed(range(ROUNDS)):
        if not len(todo.piece):
            break
        spans = todo.end - todo.begin
        since = todo.begin[:, None] + spans[:, None] * NODES[new]
        seen[:, new], good = motion.at(todo.piece, since)
        if refused is None and not good.all():
            row, node = np.argwhere(~good)[0]
            refused = float(plan.switching_times[todo.piece[row]] + since[row, node])
        rates, paces, lines = seen[..., 0], seen[..., 1], seen[..., 2:]
        fine = spans * (rates @ FINE)
        off = sure * np.abs(fine - spans * (rates @ COARSE))
        most = SHARE * (beside + done + float(fine.sum()))
        aside = ASIDE * np.linalg.norm(np.diff(lines, 2, axis=1), axis=2).max(axis=1)
        hidden = 0.25 * spans * paces.max(axis=1) * jumps_along(cost, lines, aside) > most
        close = doubt + off.sum() <= most and not hidden.any()
        split = hidden | (off > 0.25 * most / len(off))
        split &= not (close or not left or len(off) > MOST_INTERVALS)
        done += float(fine[~split].sum())
        doubt += float(off[~split].sum())
        whole, (piece, begin, end) = seen[split], (one[split] for one in todo)
        middle = 0.5 * (begin + end)
        begin, end = np.stack([begin, middle, middle, end], axis=1).reshape(-1, 2).T
        todo = _Intervals(np.repeat(piece, 2), begin, end)
        seen, new = np.empty((len(todo.piece), *seen.shape[1:])), slice(1, None, 2)
        seen[::2, ::2], seen[1::2, ::2] = whole[:, :3], whole[:, 2:]  # every other node is known
    return PlacePrice(done, doubt, refused)


class TimedPrices:
    """What the places of a word cost, by its coasting times: a smooth stand-in for the price.

    Gauss's rule with as many points as suit the times it begins with, so that the price changes
    smoothly with them. A trim that lasts longer moves its own points in its direction, each by its
    share, and all that follows with its end; so the gradients of rates add up, backwards over the
    word, to the derivatives of the same sum.
    """

    def __init__(self, costs: Sequence[PlaceCost], plan: Plan, model: Model) -> None:
        self.costs, self.plan, self.model = [smoothed(one) for one in costs], plan, model
        longer = replace(plan, durations=np.maximum(LONGER * plan.durations, LEAST_S))
        self.timed = np.flatnonzero([isinstance(one, Trim) for one in longer.primitives])
        stretches = _first_stretches(longer, min(map(scale_of, costs)))
        lasting = longer.primitive_durations[stretches.piece]
        begin, end = stretches.begin / lasting, stretches.end / lasting
        self.piece = np.repeat(stretches.piece, len(GAUSS))
        self.shares = (begin[:, None] + (end - begin)[:, None] * GAUSS).ravel()
        self.weights = ((end - begin)[:, None] * WEIGHTS).ravel()
        self.known: list[_Known] = [{} for _ in costs]

    def at(self, durations: Array) -> tuple[float, Array]:
        """The price, and its derivatives (n,) by the coasting times (n,) [s]."""
        # Beside maneuvers a plan leaves trims out that last no time.
        plan = replace(self.plan, durations=np.maximum(durations, MOMENT))
        lasting = plan.primitive_durations[self.piece]
        weights = self.weights * lasting
        spatial = self._spatial(plan)
        price, slopes = 0.0, np.zeros(len(self.timed))
        for cost, known in zip(self.costs, self.known, strict=True):
            motion = _Motion(cost, plan, self.model, known)
            poses, twists, states = motion.steps(self.piece, self.shares * lasting)
            rates, moved = motion.slopes(poses, twists, states)
            price += float(weights @ rates)
            x, y = (poses[:, :2] - plan.start[:2]).T
            moved[:, 2] += x * moved[:, 1] - y * moved[:, 0]  # about the start
            moved *= weights[:, None]
            longer = np.zeros(len(plan.primitives))
            inside, later = (np.zeros((len(plan.primitives), plan.start.size)) for _ in range(2))
            np.add.at(longer, self.piece, self.weights * rates)
            np.add.at(inside, self.piece, self.shares[:, None] * moved)
            np.add.at(later, self.piece, moved)
            inside += later[::-1].cumsum(axis=0)[::-1] - later
            slopes += (longer + (spatial * inside).sum(axis=1))[self.timed]
        return price, slopes

    def _spatial(self, plan: Plan) -> Array:
        """Twists (n, dof) of the coasts, seen from the place of the start; 0 of maneuvers."""
        rest, begins = np.zeros(plan.start.size), plan.switching_poses[:-1]
        every = [one.body_velocity if isinstance(one, Trim) else rest for one in plan.primitives]
        spatial = np.array(every)
        (x, y), (v, w) = (begins[:, :2] - plan.start[:2]).T, spatial[:, :2].T
        c, s = np.cos(begins[:, 2]), np.sin(begins[:, 2])
        turn = spatial[:, 2]
        spatial[:, 0], spatial[:, 1] = c * v - s * w + turn * y, s * v + c * w - turn * x
        return spatial


class _Motion:
    """Rates along a plan; `known` keeps what was seen in maneuvers, at times that stay the same."""

    def __init__(
        self, cost: PlaceCost, plan: Plan, model: Model, known: _Known | None = None
    ) -> None:
        self.cost, self.plan, self.model, self.known = cost, plan, model, known
        self.begins = plan.switching_poses
        self.linked = [k for k, one in enumerate(plan.primitives) if not isinstance(one, Trim)]
        dof, n_z = plan.start.size, len(model.reduced_names)
        self.twists, self.states = (np.zeros((len(plan.primitives), n)) for n in (dof, n_z))
        for k, one in enumerate(plan.primitives):
            if isinstance(one, Trim):
                self.twists[k], self.states[k] = one.body_velocity, one.reduced_state

    def at(self, piece: IntArray, since: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Rates per second, paces, x, y (n, k, 4) at times [s]; where the vehicle may be (n, k)."""
        pieces = np.repeat(piece, since.shape[1])
        poses, twists, states = (
            one.reshape(*since.shape, -1) for one in self.steps(pieces, since.ravel())
        )
        paces = self._paces(twists)
        rates = paces * rates_along(self.cost, poses, twists, states)
        seen = np.stack([rates, paces, poses[..., 0], poses[..., 1]], axis=-1)
        return seen, allowed(self.cost, poses, twists)

    def slopes(self, poses: Array, twists: Array, states: Array) -> tuple[Array, Array]:
        """Rates per second (n,) at poses (n, dof), and their derivatives (n, dof) by the pose."""
        paces = self._paces(twists)
        rates = rates_along(self.cost, poses, twists, states) * paces
        return rates, gradient_of(self.cost, poses, twists, states) * paces[:, None]

    def _paces(self, twists: Array) -> Array:
        """Factors (...,) of rates to be rates per second."""
        return np.ones(twists.shape[:-1]) if self.cost.per == "second" else _speeds(twists)

    def steps(self, piece: IntArray, since: Array) -> tuple[Array, Array, Array]:
        """Poses, twists and reduced states (n, ...) in pieces (n,) at times (n,) [s] in each."""
        twists, states = self.twists[piece], self.states[piece]
        steps = displacements(twists, since)
        for k in self.linked:
            here = np.flatnonzero(piece == k)
            if here.size:
                seen = self.known.get(k) if self.known else None
                seen = seen or self._along(k, since[here])
                if self.known is not None:
                    self.known[k] = seen
                steps[here], twists[here], states[here] = seen
        return after(self.begins[piece], steps), twists, states

    def _along(self, k: int, since: Array) -> tuple[Array, Array, Array]:
        """Motion since a maneuver began, twists and reduced states, at times (n,) [s]."""
        primitive: Any = self.plan.primitives[k]
        course = primitive.course
        if course is None:
            raise ValueError(f"maneuver {primitive.name!r}: has no course, so no price of places")
        row = np.clip(np.searchsorted(course.time, since, "right") - 1, 0, len(course.time) - 2)
        if course.model is not None and self._is_coarse(course):
            steps, states = along(course, since, course.model)
        else:
            span = np.diff(course.time)[row]
            share = np.divide(
                since - course.time[row], span, out=np.zeros_like(since), where=span > 0
            )
            states = course.reduced_state[row]
            states = states + share[:, None] * (course.reduced_state[row + 1] - states)
            steps = course.pose_at(since)
        return steps, self.model.body_velocity(states, course.control[row]), states

    def _is_coarse(self, course: Trajectory) -> bool:
        """Whether samples are too far apart for one twist from each to the next."""
        steps = np.abs(np.diff(course.pose, axis=0))
        way = np.hypot(steps[:, 0], steps[:, 1]).max(initial=0.0)
        return bool(way > DENSE * scale_of(self.cost) or steps[:, 2].max(initial=0.0) > DENSE)


def _speeds(twists: Array) -> Array:
    """Speeds (...,) of velocities (..., dof), whatever they turn by."""
    return np.asarray(np.sqrt((np.delete(twists, 2, axis=-1) ** 2).sum(axis=-1)))


def _first_stretches(plan: Plan, scale: float) -> _Intervals:
    """Stretches of a plan that are not longer than a scale [m], and do not turn far."""
    count, lasting = len(plan.primitives), plan.primitive_durations
    steps = np.zeros((count, plan.start.size))
    linked = list[tuple[int, Array, Array]]()
    for k, one in enumerate(plan.primitives):
        if isinstance(one, Trim):
            steps[k] = one.body_velocity * lasting[k]
        elif lasting[k] > 0.0:
            linked.append((k, *_between_controls(one)))
    is_trim = np.array([isinstance(one, Trim) for one in plan.primitives], dtype=bool)
    coasts = np.flatnonzero(is_trim & (lasting > 0.0))
    piece = np.concatenate([coasts, *(np.full(len(ways), k) for k, _, ways in linked)])
    begin = np.concatenate([np.zeros(len(coasts)), *(edges[:-1] for _, edges, _ in linked)])
    end = np.concatenate([lasting[coasts], *(edges[1:] for _, edges, _ in linked)])
    ways = np.abs(np.concatenate([steps[coasts], *(ways for _, _, ways in linked)]))
    far = float(_speeds(ways).sum())
    if far > MOST_STRETCHES * scale:
        raise ValueError(
            f"place costs: the finest feature has a scale of {scale:g} m, need at least "
            f"{1.01 * far / MOST_STRETCHES:.2g} m along a way of {far:.3g} m"
        )
    most = np.maximum(_speeds(ways) / scale, ways[:, 2] / TURN)
    parts = np.maximum(np.ceil(most), 1.0).astype(np.int64)
    row = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    length = ((end - begin) / parts)[row]
    first = begin[row] + number * length
    return _Intervals(piece[row].astype(np.int64), first, first + length)


def _between_controls(maneuver: Maneuver) -> tuple[Array, Array]:
    """Times (n + 1,) [s] at which controls change, and the ways (n, dof) between, added up."""
    course = maneuver.course
    if course is None:
        return np.array([0.0, maneuver.duration]), np.abs(maneuver.displacement[None])
    changes = (course.control[1:-1] != course.control[:-2]).any(axis=1)
    rows = np.concatenate([[0], 1 + np.flatnonzero(changes), [len(course.time) - 1]])
    return course.time[rows], np.add.reduceat(np.abs(np.diff(course.pose, axis=0)), rows[:-1])
