"""Headings of the trims of a vehicle that translations alone move, and poses that have one."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.turning import HEADING_TOLERANCE


def trim_headings(automaton: Automaton) -> Array | None:
    """Heading (m,) [rad] that each trim has; None if a trim is driven at any heading."""
    model = automaton.translated
    if model is None:
        return None
    return np.array([model.heading(trim.reduced_state) for trim in automaton.trims])


def trim_facing(automaton: Automaton, heading: float, what: str) -> Trim:
    """The first trim of a heading; `what` has it, in the words of a message."""
    headings = trim_headings(automaton)
    assert headings is not None
    off = [abs(math.remainder(one - heading, 2.0 * math.pi)) for one in headings.tolist()]
    nearest = int(np.argmin(off))
    if off[nearest] > HEADING_TOLERANCE:
        raise ValueError(
            f"{what}: the {automaton.model.name} has no trim of heading {heading:.6g} rad, the "
            f"nearest is {headings[nearest]:.6g} rad; translations alone move it, so a trim keeps "
            "its heading"
        )
    return automaton.trims[nearest]


def distinct_headings(automaton: Automaton) -> tuple[float, ...]:
    """Headings of the trims modulo a full turn, each once, in the order of the trims."""
    headings = trim_headings(automaton)
    assert headings is not None
    found: list[float] = []
    for heading in headings.tolist():
        off = (abs(math.remainder(one - heading, 2.0 * math.pi)) for one in found)
        if all(one > HEADING_TOLERANCE for one in off):
            found.append(heading)
    return tuple(found)


def origin_of(automaton: Automaton, trim: Trim) -> Array:
    """A pose (dof,) at the origin in which the vehicle may be in a trim."""
    pose = np.zeros(automaton.model.group.dof)
    if automaton.translated is not None:
        pose[2] = automaton.translated.heading(trim.reduced_state)
    return pose


def posed(
    automaton: Automaton, pose: Array, what: str, *, trim: str | None = None, free: bool = False
) -> tuple[tuple[Array, str | None], ...]:
    """Poses with a heading, and the trims in which the vehicle is there: one for each heading.

    `automaton`: of a vehicle that translations alone move. `pose`: with or without a heading.
    `what`: what messages call it. `trim`: the trim there, if it is known. `free`: whether any
    heading will do.
    """
    model, kinematic = automaton.translated, automaton.is_kinematic
    assert model is not None
    stated = pose.shape == (model.stated.group.dof,)
    if not stated and pose.shape != (model.group.dof,):
        raise ValueError(
            f"{what}: pose has shape {pose.shape}, need {model.stated.group.dof} numbers for the "
            f"{model.name}, or {model.group.dof} with a heading"
        )
    names: tuple[str | None, ...]
    headings: tuple[float, ...]
    if trim is not None:
        headings, names = (model.heading(automaton[trim].reduced_state),), (trim,)
    elif free or stated:
        headings = distinct_headings(automaton)
        names = tuple(trim_facing(automaton, heading, what).name for heading in headings)
    else:
        headings, names = (float(pose[2]),), (trim_facing(automaton, pose[2], what).name,)
    if stated and len(headings) > 1 and not free:
        some = ", ".join(f"{heading:.4g}" for heading in headings[:12])
        raise ValueError(
            f"{what}: got no heading, need [x, y, heading]: the {model.name} has trims of the "
            f"headings {some} rad"
        )
    if not (stated or free):
        off = abs(math.remainder(float(pose[2]) - headings[0], 2.0 * math.pi))
        if off > HEADING_TOLERANCE:
            raise ValueError(
                f"{what}: has the heading {pose[2]:.6g} rad, but trim {trim!r} of the "
                f"{model.name} has {headings[0]:.6g} rad"
            )
        headings = (float(pose[2]),)
    place = pose if stated else np.delete(pose, 2)
    return tuple(
        (np.insert(place, 2, heading), trim if kinematic else name)
        for heading, name in zip(headings, names, strict=True)
    )


def motion_of(automaton: Automaton, by: LieGroup) -> LieGroup:
    """The motion `by` on the poses of an automaton, by which the vehicle looks the same."""
    model = automaton.translated
    if model is None:
        return by
    if by.dof == model.stated.group.dof and "heading" not in by.coordinates:
        return model.group(np.insert(by.pose, 2, 0.0))
    turn = math.remainder(float(by.pose[2]), 2.0 * math.pi)
    if abs(turn) > HEADING_TOLERANCE:
        raise ValueError(
            f"problem: translations alone move the {model.name}, but the motion turns by "
            f"{turn:.6g} rad"
        )
    return by
