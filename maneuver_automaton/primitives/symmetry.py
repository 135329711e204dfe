"""Primitives seen another way: mirrored, left and right, and stated along the world's axes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.models import Model, OnlyTranslated
from maneuver_automaton.primitives.primitive import Maneuver, Trajectory, Trim

POSE_SIGNS = (1.0, -1.0, -1.0, 1.0)  # x, y, heading, z, and their rates
SAMPLES = 40
AGREES = 1e-12  # [-] of the largest rate, or of a limit
MOST_SWAPS = 2  # pairs of components that are exchanged, of the reduced state and of the control
MOST_CANDIDATES = 20_000  # that are tried


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mirror:
    """What left and right exchange: signs, and pairs of components that change places.

    The image of a reduced state z is ``reduced * z[order]``, that of a control u ``control @ u``.
    """

    reduced: Array  # (n_z,) signs
    control: Array  # (n_u, n_u): signs and exchanges
    order: tuple[int, ...] | None = None  # of the reduced state's components; None: as they are

    def __post_init__(self) -> None:
        freeze(self, "reduced")
        freeze(self, "control")

    def state(self, reduced_state: Array) -> Array:
        """Reduced states (..., n_z) on the other side."""
        there = reduced_state if self.order is None else reduced_state[..., list(self.order)]
        return np.asarray(there * self.reduced)

    def trajectory(self, course: Trajectory) -> Trajectory:
        """The course on the other side."""
        return replace(
            course,
            pose=course.pose * _pose_signs(course.pose.shape[-1]),
            reduced_state=self.state(course.reduced_state),
            control=course.control @ self.control.T,
        )

    def maneuver(self, maneuver: Maneuver, *, source: str, target: str) -> Maneuver:
        """The maneuver on the other side, between the trims of these names."""
        course = maneuver.course
        return Maneuver(
            name=f"{source} to {target}",
            source=source,
            target=target,
            displacement=maneuver.displacement * _pose_signs(maneuver.displacement.size),
            duration=maneuver.duration,
            course=None if course is None else self.trajectory(course),
            cost_multiplier=maneuver.cost_multiplier,
        )

    def takes(self, trim: Trim, other: Trim) -> bool:
        """Whether `other` is the image of `trim`, to the last bits."""
        pairs = (
            (self.state(trim.reduced_state), other.reduced_state),
            (self.control @ trim.control, other.control),
            (trim.body_velocity * _pose_signs(trim.body_velocity.size), other.body_velocity),
        )
        return all(
            image.shape == there.shape
            and bool(np.all(np.abs(image - there) <= AGREES * np.maximum(1.0, np.abs(there))))
            for image, there in pairs
        )


def mirror_of(model: Model) -> Mirror | None:
    """The mirror symmetry of a model, limits included, or None if it has none.

    It is searched, not assumed, for a user's model as for those of the package: signs of reduced
    state and control, and exchanges of up to two pairs of their components, such as the wheels of
    either side, are tried on random states, fewest changes first. It must hold
    ``xi(M z, N u) = S xi(z, u)`` and ``f(M z, N u) = M f(z, u)`` with S the mirror of the plane.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> mirror_of(Car(wheelbase=2.0)).control.tolist()
    [[1.0, 0.0], [0.0, -1.0]]
    """
    rng = np.random.default_rng(0)
    state = _draws(rng, model.reduced_limits)
    control = _draws(rng, model.control_limits)
    few = slice(0, 2)  # most candidates fail on the first
    candidates = _candidates(_changes(model.reduced_limits), _changes(model.control_limits))
    for of_state, of_control in itertools.islice(candidates, MOST_CANDIDATES):
        exchanged = np.eye(len(of_control.order))[list(of_control.order)]
        mirror = Mirror(
            reduced=of_state.signs,
            control=of_control.signs[:, None] * exchanged + 0.0,
            order=of_state.order if of_state.swaps else None,
        )
        if _holds(model, mirror, state[few], control[few]) and _holds(
            model, mirror, state, control
        ):
            return mirror
    return None


class _Exchange(NamedTuple):
    """Signs and exchanges of the components of a vector, which undo themselves."""

    order: tuple[int, ...]
    signs: Array
    swaps: int

    @property
    def size(self) -> int:
        """How much it changes: a sign counts once, an exchange twice."""
        kept = sum(int(sign < 0.0) for sign in self.signs)
        return kept + 2 * self.swaps


def _changes(limits: Array) -> list[_Exchange]:
    """All changes that leave limits (n, 2) as they are, those with the fewest exchanges first."""
    n = len(limits)
    found: list[_Exchange] = []
    for swaps in range(min(MOST_SWAPS, n // 2) + 1):
        for order in _exchanges(n, swaps):
            for signs in itertools.product((1.0, -1.0), repeat=n):
                undone = all(signs[k] == signs[other] for k, other in enumerate(order))
                image = np.sort(limits[list(order)] * np.array(signs)[:, None], axis=1)
                same = np.isclose(image, limits, rtol=AGREES, atol=0.0).all()
                if undone and same:
                    found.append(_Exchange(order, np.array(signs), swaps))
                if len(found) >= MOST_CANDIDATES:
                    return found
    return found


def _exchanges(n: int, swaps: int) -> Iterator[tuple[int, ...]]:
    """Orders of n components in which so many pairs have changed places."""
    pairs = itertools.combinations(range(n), 2)
    for chosen in itertools.combinations(pairs, swaps):
        if len({k for pair in chosen for k in pair}) == 2 * swaps:
            order = list(range(n))
            for a, b in chosen:
                order[a], order[b] = b, a
            yield tuple(order)


def _candidates(
    states: list[_Exchange], controls: list[_Exchange]
) -> Iterator[tuple[_Exchange, _Exchange]]:
    """Pairs of changes, by how much they change together."""
    by_size: tuple[dict[int, list[_Exchange]], ...] = ({}, {})
    for table, changes in zip(by_size, (states, controls), strict=True):
        for change in changes:
            table.setdefault(change.size, []).append(change)
    for total in range(max(by_size[0]) + max(by_size[1]) + 1):
        for size in range(total + 1):
            yield from itertools.product(by_size[0].get(total - size, ()), by_size[1].get(size, ()))


def _holds(model: Model, mirror: Mirror, state: Array, control: Array) -> bool:
    signs = _pose_signs(model.group.dof)
    there = (mirror.state(state), control @ mirror.control.T)
    for mine, other in (
        (model.body_velocity(state, control) * signs, model.body_velocity(*there)),
        (mirror.state(model.reduced_dynamics(state, control)), model.reduced_dynamics(*there)),
    ):
        if np.abs(mine - other).max(initial=0.0) > AGREES * np.abs(mine).max(initial=1.0):
            return False
    return True


def _draws(rng: np.random.Generator, limits: Array) -> Array:
    """Random values (SAMPLES, n) well within limits (n, 2)."""
    low, high = limits.T
    low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0, -1.0))
    high = np.where(np.isfinite(high), high, low + 2.0)
    return low + (high - low) * rng.uniform(0.1, 0.9, size=(SAMPLES, len(limits)))


def _pose_signs(dof: int) -> Array:
    return np.array(POSE_SIGNS[:dof])


def trim_in_world(model: OnlyTranslated, trim: Trim) -> Trim:
    """A trim whose velocity is along the world's axes, seen from the body; any other as it is."""
    if not _is_stated(model, trim.body_velocity):
        return trim
    reduced = model.seen(trim.reduced_state)
    heading = model.heading(reduced)
    return replace(
        trim, body_velocity=_from_body(trim.body_velocity, heading, 0.0), reduced_state=reduced
    )


def maneuver_in_world(model: OnlyTranslated, maneuver: Maneuver) -> Maneuver:
    """A maneuver whose displacement is along the world's axes, seen from where it begins.

    Any other maneuver is returned as it is.
    """
    if not _is_stated(model, maneuver.displacement):
        return maneuver
    course = maneuver.known_course(f"need one to know how far the {model.name} turns")
    reduced = model.seen(course.reduced_state)
    headings = np.unwrap([model.heading(state) for state in reduced])
    pose = np.array(
        [
            _from_body(place, headings[0], heading - headings[0])
            for place, heading in zip(course.pose, headings, strict=True)
        ]
    )
    seen = Trajectory(time=course.time, pose=pose, reduced_state=reduced, control=course.control)
    return replace(maneuver, displacement=pose[-1], course=seen)


def _is_stated(model: OnlyTranslated, numbers: Array) -> bool:
    """Whether numbers of a twist or a displacement are those of the group of translations."""
    return numbers.shape == (model.stated.group.dof,) != (model.group.dof,)


def _from_body(place: Array, heading: float, turn: float) -> Array:
    """Numbers along the world's axes, seen from a body of that heading; and a turn."""
    cos, sin = np.cos(heading), np.sin(heading)
    cos, sin = (0.0 if abs(value) < 1e-15 else float(value) for value in (cos, sin))
    ahead, aside = cos * place[0] + sin * place[1], cos * place[1] - sin * place[0]
    return np.array([ahead, aside, turn, *place[2:]]) + 0.0
