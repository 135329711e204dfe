"""What a vehicle carries, say a trailer: the motion of its own frame, as a plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.cutting import begin_state
from maneuver_automaton.automaton.plan import Plan
from maneuver_automaton.groups import LieGroup, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.primitives.primitive import Trajectory


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
    >>> from maneuver_automaton.primitives import Trim
    >>> class Cart:
    ...     part_names = ("cart",)
    ...     def part_poses(self, z):  # one metre behind, whatever z is
    ...         return np.broadcast_to([[-1.0, 0.0, 0.0]], (*np.shape(z)[:-1], 1, 3))
    >>> turn = Trim(name="turn", body_velocity=[0.0, 0.0, 1.0], control=[0.0, 1.0])
    >>> behind = carried(Plan([0, 0, 0], (turn,), durations=[np.pi / 2]), Cart(), "cart")
    >>> behind.start.tolist(), behind.end.round(9).tolist()
    ([-1.0, 0.0, 0.0], [-0.0, -1.0, 1.570796327])
    """
    which = model.part_names.index(part)
    group = group_of(plan.start.size)

    def frame(states: Array) -> LieGroup:
        """Where the part is, seen from the vehicle."""
        return group(np.asarray(model.part_poses(states)[..., which, :], dtype=np.float64))

    if not plan.trims:  # it rests, with all at zero
        behind = group(plan.start) @ frame(np.zeros(len(model.reduced_names)))
        return replace(plan, start=behind.pose)
    states = np.array([trim.reduced_state for trim in plan.trims])
    adjoints = frame(states).inverse().adjoint()
    start = group(plan.start) @ frame(begin_state(plan))
    return replace(
        plan,
        start=start.pose,
        trims=tuple(
            replace(trim, body_velocity=adjoint @ trim.body_velocity)
            for trim, adjoint in zip(plan.trims, adjoints, strict=True)
        ),
        maneuvers=_maneuvers(plan.maneuvers, frame),
    )


def _maneuvers(
    maneuvers: Sequence[Maneuver | None], frame: Callable[[Array], LieGroup]
) -> tuple[Maneuver | None, ...]:
    """The maneuvers of the part, their displacements seen from where the part begins."""
    courses: list[Trajectory] = []
    for one in maneuvers:
        if one is not None and one.course is None:
            raise ValueError(f"maneuver {one.name!r}: has no course, so nothing can be carried")
        courses += [one.course] if one is not None and one.course is not None else []
    if not courses:
        return tuple(maneuvers)
    counts = [len(course.time) for course in courses]
    firsts = np.cumsum(counts) - counts
    frames = frame(np.concatenate([course.reduced_state for course in courses]))
    group = type(frames)
    begins = group(frames.pose[np.repeat(firsts, counts)]).inverse()
    poses = (begins @ group(np.concatenate([one.pose for one in courses])) @ frames).pose.copy()
    poses[firsts] = 0.0
    seen = iter(zip(courses, np.split(poses, firsts[1:]), strict=True))
    moved: list[Maneuver | None] = []
    for one in maneuvers:
        if one is None:
            moved.append(None)
        else:
            course, pose = next(seen)
            there = replace(course, pose=pose, model=None)  # the vehicle's equations lead it
            moved.append(replace(one, displacement=pose[-1], course=there))
    return tuple(moved)
