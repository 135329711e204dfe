"""The loop behind every check: move one coordinate, look what changes, keep the worst."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, vector_text
from maneuver_automaton.analysis.region import Region
from maneuver_automaton.analysis.report import SymmetryReport, listed, motion_of
from maneuver_automaton.groups import LieGroup

Draw = Callable[[np.random.Generator], tuple[Array, Array]]
"""Draws a state and a control."""

NOWHERE = np.zeros(0)


class Defect(Protocol):
    """What changes at a state when it is moved: (n,), and the greatest value met there."""

    def __call__(self, by: LieGroup, state: Array, control: Array) -> tuple[Array, float]: ...


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Question:
    """What is asked, and the words for the answer."""

    what: str  # "vector field"
    names: Callable[[int], str]  # of the components of the defect
    units: Callable[[int], str]  # of the same, with a space in front
    cause: Callable[[tuple[str, ...], tuple[int, ...]], str]  # from motions, components


@dataclass(frozen=True, slots=True, eq=False)
class Worst:
    """The sample, among those that move one coordinate, where most changes."""

    defect: Array
    admitted: float  # in the units of the defect
    state: Array
    control: Array
    by: LieGroup

    @property
    def violation(self) -> float:
        """Greatest change of a component."""
        return float(np.abs(self.defect).max(initial=0.0))

    @property
    def excess(self) -> float:
        """Violation over what is admitted."""
        return self.violation / self.admitted


def examine(
    question: Question,
    defect: Defect,
    *,
    region: Region,
    draw: Draw,
    rng: np.random.Generator | None,
    samples: int,
    tolerance: float,
) -> SymmetryReport:
    """Try `samples` random states for every coordinate of the group."""
    if samples < 1:
        raise ValueError(f"samples: got {samples}, need at least 1")
    if not tolerance > 0.0:
        raise ValueError(f"tolerance: got {tolerance}, need a positive number")
    rng = np.random.default_rng(0) if rng is None else rng
    by_motion = {
        motion_of(name): max(
            (_try(defect, region, draw, rng, axis, tolerance) for _ in range(samples)),
            key=lambda worst: worst.excess,
        )
        for axis, name in enumerate(region.group.coordinates)
    }
    return _report(question, by_motion, tolerance, samples)


def _try(
    defect: Defect,
    region: Region,
    draw: Draw,
    rng: np.random.Generator,
    axis: int,
    tolerance: float,
) -> Worst:
    by = region.element(rng, axis=axis)
    state, control = draw(rng)
    change, size = defect(by, state, control)
    return Worst(change, tolerance * max(1.0, size), state, control, by)


def _report(
    question: Question, by_motion: dict[str, Worst], tolerance: float, samples: int
) -> SymmetryReport:
    ranked = sorted(by_motion, key=lambda motion: -by_motion[motion].excess)
    broken = tuple(motion for motion in ranked if by_motion[motion].excess > 1.0)
    intact = tuple(motion for motion in by_motion if motion not in broken)
    worst = by_motion[ranked[0]]
    size = np.abs(worst.defect)
    order = np.argsort(-size, kind="stable")
    violated = tuple(int(i) for i in order if size[i] > worst.admitted)
    if broken:
        message = _complaint(question, worst, broken, intact, violated)
    else:
        message = (
            f"{question.what} is invariant under {listed(intact)} "
            f"(worst violation {worst.violation:.3g} in {samples} samples each)"
        )
    return SymmetryReport(
        what=question.what,
        holds=not broken,
        worst_violation=worst.violation,
        tolerance=tolerance,
        state=worst.state,
        control=worst.control,
        group_element=worst.by,
        components=tuple(question.names(i) for i in violated),
        broken=broken,
        intact=intact,
        message=message,
    )


def _complaint(
    question: Question,
    worst: Worst,
    broken: tuple[str, ...],
    intact: tuple[str, ...],
    violated: tuple[int, ...],
) -> str:
    first = violated[0]
    where = f"at x = {vector_text(worst.state)}"
    if worst.control.size:
        where += f", u = {vector_text(worst.control)}"
    still = f"; still invariant under {listed(intact)}" if intact else ""
    return (
        f"{question.what} is not invariant under {listed(broken)}: {question.names(first)} changes "
        f"by {abs(worst.defect[first]):.4g}{question.units(first)} {where}, moved by "
        f"{vector_text(worst.by.pose)}{still}; {question.cause(broken, violated)}"
    )


def values_of(name: str, value: ArrayLike) -> Array:
    """Numbers in a row (n,), from a row or from one number."""
    return np.atleast_1d(as_array(name, value))
