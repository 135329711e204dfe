"""Left and right: where a vehicle has a mirror image of itself, one maneuver serves two pairs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.models import Model
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trajectory import Trajectory
from maneuver_automaton.primitives.trim import Trim

POSE_SIGNS = (1.0, -1.0, -1.0, 1.0)  # x, y, heading, z, and their rates
SAMPLES = 40
AGREES = 1e-12  # [-] of the largest rate


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mirror:
    """What left and right exchange: signs of the reduced state, and a matrix of the controls."""

    reduced: Array  # (n_z,) signs
    control: Array  # (n_u, n_u): signs, and at most one pair of controls exchanged

    def __post_init__(self) -> None:
        freeze(self, "reduced")
        freeze(self, "control")

    def trajectory(self, course: Trajectory) -> Trajectory:
        """The course on the other side."""
        return Trajectory(
            time=course.time,
            pose=course.pose * _pose_signs(course.pose.shape[-1]),
            reduced_state=course.reduced_state * self.reduced,
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
        )

    def takes(self, trim: Trim, other: Trim) -> bool:
        """Whether `other` is the image of `trim`, to the last bits."""
        pairs = (
            (trim.reduced_state * self.reduced, other.reduced_state),
            (self.control @ trim.control, other.control),
            (trim.body_velocity * _pose_signs(trim.body_velocity.size), other.body_velocity),
        )
        return all(
            image.shape == there.shape
            and bool(np.all(np.abs(image - there) <= AGREES * np.maximum(1.0, np.abs(there))))
            for image, there in pairs
        )


def mirror_of(model: Model, *, seed: int = 0) -> Mirror | None:
    """The mirror symmetry of a model, limits included, or None if it has none.

    It is searched, not assumed: signs of reduced state and control, and exchanges of two
    controls, are tried on random states, fewest changes first. It must hold
    ``xi(M z, N u) = S xi(z, u)`` and ``f(M z, N u) = M f(z, u)`` with S the mirror of the plane.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> mirror_of(Car(wheelbase=2.0)).control.tolist()
    [[1.0, 0.0], [0.0, -1.0]]
    """
    rng = np.random.default_rng(seed)
    state = _draws(rng, model.reduced_limits)
    control = _draws(rng, model.control_limits)
    few = slice(0, 2)  # most candidates fail on the first
    for mirror in _candidates(len(model.reduced_names), len(model.control_names)):
        if _holds(model, mirror, state[few], control[few]) and _holds(
            model, mirror, state, control
        ):
            return mirror
    return None


def _candidates(n_z: int, n_u: int) -> Iterator[Mirror]:
    every = [
        Mirror(reduced=np.array(reduced), control=exchange * np.array(signs)[:, None] + 0.0)
        for exchange in _exchanges(n_u)
        for reduced in itertools.product((1.0, -1.0), repeat=n_z)
        for signs in itertools.product((1.0, -1.0), repeat=n_u)
    ]
    unchanged = np.eye(n_u)
    every.sort(key=lambda m: (m.reduced < 0.0).sum() + np.abs(m.control - unchanged).sum() / 2.0)
    yield from every


def _exchanges(n: int) -> Iterator[Array]:
    yield np.eye(n)
    for a, b in itertools.combinations(range(n), 2):
        order = list(range(n))
        order[a], order[b] = b, a
        yield np.eye(n)[order]


def _holds(model: Model, mirror: Mirror, state: Array, control: Array) -> bool:
    signs = _pose_signs(model.group.dof)
    for limits, image in (
        (model.reduced_limits, _image(model.reduced_limits, np.diag(mirror.reduced))),
        (model.control_limits, _image(model.control_limits, mirror.control)),
    ):
        if not np.array_equal(limits, image):
            return False
    there = (state * mirror.reduced, control @ mirror.control.T)
    for mine, other in (
        (model.body_velocity(state, control) * signs, model.body_velocity(*there)),
        (model.reduced_dynamics(state, control) * mirror.reduced, model.reduced_dynamics(*there)),
    ):
        if np.abs(mine - other).max(initial=0.0) > AGREES * np.abs(mine).max(initial=1.0):
            return False
    return True


def _image(limits: Array, matrix: Array) -> Array:
    """Limits (n, 2) of what `matrix`, signs and exchanges, makes of values within limits."""
    if not len(limits):
        return limits
    order = np.abs(matrix).argmax(axis=1)
    signs = matrix[np.arange(len(matrix)), order]
    image = limits[order] * signs[:, None]
    return np.sort(image, axis=1)


def _draws(rng: np.random.Generator, limits: Array) -> Array:
    """Random values (SAMPLES, n) well within limits (n, 2)."""
    low, high = limits.T
    low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0, -1.0))
    high = np.where(np.isfinite(high), high, low + 2.0)
    return low + (high - low) * rng.uniform(0.1, 0.9, size=(SAMPLES, len(limits)))


def _pose_signs(dof: int) -> Array:
    return np.array(POSE_SIGNS[:dof])
