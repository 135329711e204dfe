"""What a vehicle carries, say a trailer: the motion of its own frame, as a plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.plan import Plan
from maneuver_automaton.groups import LieGroup, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim


def carried(plan: Plan, model: Model, part: str) -> Plan:
    """The motion of a carried part, at the pose ``g b(z)`` if the vehicle is at g.

    In a trim b is constant, so the part runs along a one-parameter group too, with the twist
    ``Ad(b^-1) xi``; its courses are those of the vehicle, moved sample by sample.

    Parameters
    ----------
    plan : Plan
        Of the vehicle.
    model : Model
        Has `part_names` and ``part_poses(z)`` (..., parts, dof): the frames of the parts seen from
        the vehicle.
    part : str
        Name of the part.

    Examples
    --------
    >>> from maneuver_automaton.models import UserModel
    >>> from maneuver_automaton.groups import SE2
    >>> class Cart:
    ...     part_names = ("cart",)
    ...     def part_poses(self, z):  # one metre behind, whatever z is
    ...         return np.broadcast_to([[-1.0, 0.0, 0.0]], (*np.shape(z)[:-1], 1, 3))
    >>> turn = Trim(name="turn", body_velocity=[0.0, 0.0, 1.0], control=[0.0, 1.0])
    >>> behind = carried(Plan([0, 0, 0], (turn,), durations=[np.pi / 2]), Cart(), "cart")
    >>> behind.start.tolist(), behind.end.round(9).tolist()
    ([-1.0, 0.0, 0.0], [-0.0, -1.0, 1.570796327])
    """
    if not plan.trims:
        return plan
    which = model.part_names.index(part)
    group = group_of(plan.start.size)

    def frame(states: Array) -> LieGroup:
        """Where the part is, seen from the vehicle."""
        return group(np.asarray(model.part_poses(states)[..., which, :], dtype=np.float64))

    def trim_of(trim: Trim) -> Trim:
        seen = frame(trim.reduced_state).inverse().adjoint() @ trim.body_velocity
        return replace(trim, body_velocity=seen)

    start = group(plan.start) @ frame(_first_state(plan))
    return replace(
        plan,
        start=start.pose,
        trims=tuple(trim_of(trim) for trim in plan.trims),
        maneuvers=tuple(None if m is None else _maneuver(m, frame) for m in plan.maneuvers),
    )


def _first_state(plan: Plan) -> Array:
    """Reduced state at the begin of a plan, which may be cut within a maneuver."""
    first = plan.primitives[0] if plan.primitives else plan.trims[0]
    if isinstance(first, Maneuver) and first.course is not None:
        begin: Array = first.course.reduced_state[0]
        return begin
    return plan.trims[0].reduced_state


def _maneuver(maneuver: Maneuver, frame: Callable[[Array], LieGroup]) -> Maneuver:
    """The maneuver of the part, its displacement seen from where the part begins."""
    course = maneuver.course
    if course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so nothing can be carried")
    frames = frame(course.reduced_state)
    group = type(frames)
    pose = (group(frames.pose[0]).inverse() @ group(course.pose) @ frames).pose.copy()
    pose[0] = 0.0
    return replace(maneuver, displacement=pose[-1], course=replace(course, pose=pose))
