"""Trims and maneuvers that are stated along the world's axes, seen from the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import OnlyTranslated
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trajectory import Trajectory
from maneuver_automaton.primitives.trim import Trim


def trim_in_world(model: OnlyTranslated, trim: Trim) -> Trim:
    """A trim whose velocity is along the world's axes, seen from the body; any other as it is.

    Examples
    --------
    >>> from maneuver_automaton.groups import translations
    >>> from maneuver_automaton.models import UserModel, in_world
    >>> boat = UserModel(name="boat", group=translations(2), control_names=("turn_rate",),
    ...                  reduced_names=("heading",), dynamics=lambda z, u: [u[0]],
    ...                  velocity=lambda z, u: [np.cos(z[0]) + 0.5, np.sin(z[0])])
    >>> north = Trim(name="north", body_velocity=[0.5, 1.0], control=[0.0],
    ...              reduced_state=[np.pi / 2])
    >>> seen = trim_in_world(in_world(boat), north)
    >>> seen.body_velocity.tolist(), seen.reduced_state.tolist()
    ([1.0, -0.5, 0.0], [0.0, 1.0])
    """
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

    Raises
    ------
    ValueError
        If it has no course: then it does not say how far it turns.
    """
    if not _is_stated(model, maneuver.displacement):
        return maneuver
    if maneuver.course is None:
        raise ValueError(
            f"maneuver {maneuver.name!r}: has no course, need one to know how far the "
            f"{model.name} turns"
        )
    course = maneuver.course
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
