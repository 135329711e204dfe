"""Rigid parts of a vehicle along trims and maneuvers, as motions of constant twist.

A trim moves every part by one twist. The course of a maneuver is cut into pieces that one twist
each follows closely; how far the true motion may be from them is kept beside every piece.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.body import Body, body_of, fastest_points
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.search.arrays import BodyArrays

CLOSE = 0.02  # [half widths of the body] that a piece of constant twist may be off
BETWEEN = 0.25  # of the change of twist from sample to sample times their spacing


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Part:
    """One rigid part of a vehicle, and where it is along trims and maneuvers."""

    shapes: tuple[Shape, ...]  # in the frame of the part
    trim_poses: Array  # (m, 3) seen from the vehicle, in every trim
    course_poses: tuple[Array, ...]  # (n, 3) each, at the samples of every maneuver's course


class Pieces(NamedTuple):
    """Motions of constant twist, one after the other."""

    pose: Array  # (n, 3) where they begin
    twist: Array  # (n, 3)
    time: Array  # (n,) [s]
    error: Array  # (n,) [m] by which a point of the body may be off
    first: IntArray  # (k + 1,) piece with which each of k courses begins
    begin: IntArray  # (n,) sample where each begins, of all courses one after the other
    end: IntArray  # (n,) and where it ends


def parts_of(
    automaton: Automaton, footprint: Sequence[Shape], carried: Sequence[Sequence[Shape]] = ()
) -> tuple[Part, ...]:
    """The vehicle's own body, and its other parts where its model says, each in its own frame."""
    model = automaton.model
    if len(carried) != len(model.part_names):
        raise ValueError(
            f"parts: got the bodies of {len(carried)} parts, need {len(model.part_names)} for the "
            f"{model.name}"
        )
    courses = [maneuver.course for maneuver in automaton.maneuvers]
    counts = [2 if course is None else len(course.time) for course in courses]
    m = len(automaton)
    own = Part(
        shapes=tuple(footprint),
        trim_poses=np.zeros((m, 3)),
        course_poses=tuple(np.zeros((n, 3)) for n in counts),
    )
    if not carried:
        return (own,)
    trims = {trim.name: trim.reduced_state for trim in automaton.trims}
    states = [
        np.array([trims[maneuver.source], trims[maneuver.target]])
        if maneuver.course is None
        else maneuver.course.reduced_state
        for maneuver in automaton.maneuvers
    ]
    in_trims = model.part_poses(np.array([trim.reduced_state for trim in automaton.trims]))
    along = [model.part_poses(state) for state in states]
    parts = [own]
    for k, shapes in enumerate(carried):
        followed = tuple(poses[:, k] for poses in along)
        part = Part(shapes=tuple(shapes), trim_poses=in_trims[:, k], course_poses=followed)
        parts.append(part)
    return tuple(parts)


def posed_parts(
    automaton: Automaton,
    footprint: tuple[Shape, ...],
    carried: Mapping[str, tuple[Shape, ...]],
    trims: IntArray,
) -> tuple[Part, ...]:
    """The vehicle's own body and those parts that have one, in `trims` (m,) of the automaton."""
    names = automaton.model.part_names
    own, *others = parts_of(automaton, footprint, [carried.get(name, ()) for name in names])
    bodies = [part for name, part in zip(names, others, strict=True) if name in carried]
    return tuple(replace(part, trim_poses=part.trim_poses[trims]) for part in (own, *bodies))


def body_arrays(bodies: Sequence[Body]) -> BodyArrays:
    """The arrays of several bodies as one."""
    offsets = np.cumsum([0, *(len(body.edges) for body in bodies)])
    first = [body.first[:-1] + offset for body, offset in zip(bodies, offsets, strict=False)]
    sizes = [
        (body.middle_x, body.middle_y, body.reach, body.inscribed, body.half_width)
        for body in bodies
    ]
    return BodyArrays(
        edges=np.concatenate([body.edges for body in bodies]),
        first=np.concatenate([*first, offsets[-1:]]).astype(np.int64),
        radius=np.concatenate([body.radius for body in bodies]),
        discs=np.concatenate([body.discs for body in bodies]),
        piece_of=np.cumsum([0, *(len(body.radius) for body in bodies)]),
        disc_of=np.cumsum([0, *(len(body.discs) for body in bodies)]),
        sizes=np.array(sizes, dtype=np.float64),
    )


def carried_twists(twists: Array, poses: Array) -> Array:
    """Twists (m, 3) of parts at planar poses (m, 3) on vehicles with twists (m, 3 or more).

    Source: Ad(pose^-1) twist.
    """
    x, y, turn = poses[:, 0], poses[:, 1], poses[:, 2]
    c, s = np.cos(turn), np.sin(turn)
    v_x, v_y = twists[:, 0] - twists[:, 2] * y, twists[:, 1] + twists[:, 2] * x
    return np.stack([c * v_x + s * v_y, c * v_y - s * v_x, twists[:, 2]], axis=1)


def pieces_of(
    courses: Sequence[tuple[Array, Array]],
    *,
    ends: Array,
    reach: float,
    close: float,
    timed: bool,
    stepwise: bool = False,
) -> Pieces:
    """Cut courses of a part into pieces that one twist each follows closely.

    All courses at once: spans that are not followed closely are halved, until they are or lie
    between two samples.

    `courses`: poses (n, 3) of the part and their times; `ends`: twists (k, 2, 3) in the trims
    before and after each; `reach` [m] of the farthest point of the body; `close` [m]: what a piece
    may be off beside between two samples; `timed`: it matters when the part is where; `stepwise`:
    one twist leads from each sample to the next, so that nothing is unknown between.
    """
    if not courses:
        none, nowhere = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        first = np.zeros(1, dtype=np.int64)
        return Pieces(nowhere, nowhere, np.zeros(0), np.zeros(0), first, none, none)
    poses = np.concatenate([poses for poses, _ in courses])
    times = np.concatenate([times for _, times in courses])
    sizes = np.array([len(times) for _, times in courses])
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    if not stepwise:
        between = _between(poses, times, first, sizes, ends, reach, timed=timed)
    length = np.zeros(len(poses))
    length[1:] = np.linalg.norm(_moves(poses[:-1], poses[1:]) * [1.0, 1.0, reach], axis=1)
    length = np.cumsum(length)
    begin, end = first, first + sizes - 1
    begins, finals, errors = [], [], []
    while begin.size:
        off = _deviations(poses, times if timed else length, begin, end, reach, timed=timed)
        split = (off > close) & (end - begin > 1)
        kept = ~split
        begins.append(begin[kept])
        finals.append(end[kept])
        # Two twists whose ends are so far apart are no farther apart between them, but for a share
        # of that: the second `off` stands for it.
        more = off[kept] if stepwise else _greatest(between, begin[kept], end[kept])
        errors.append(off[kept] + more)
        middle = (begin[split] + end[split]) // 2
        begin, end = (np.concatenate([begin[split], middle]), np.concatenate([middle, end[split]]))
    start, stop, error = (np.concatenate(parts) for parts in (begins, finals, errors))
    order = np.argsort(start, kind="stable")
    start, stop = start[order], stop[order]
    spent = times[stop] - times[start]
    return Pieces(
        pose=poses[start],
        twist=_logs(_moves(poses[start], poses[stop])) / np.maximum(spent, 1e-300)[:, None],
        time=spent,
        error=error[order],
        first=np.searchsorted(start, np.append(first, len(poses))),
        begin=start,
        end=stop,
    )


def course_of(maneuver: Maneuver, poses: Array) -> tuple[Array, Array]:
    """Planar poses of a part along a maneuver, and their times."""
    course = maneuver.course
    if course is None:
        own = np.array([np.zeros(3), maneuver.displacement[:3]])
        times = np.array([0.0, max(maneuver.duration, 1e-9)])
    else:
        own, times = course.pose[:, :3], course.time
    return ((SE2(own) @ SE2(poses)).pose if poses.any() else own), times


def _moves(begin: Array, end: Array) -> Array:
    """Motions (n, 3) between planar poses."""
    c, s = np.cos(begin[:, 2]), np.sin(begin[:, 2])
    x, y = end[:, 0] - begin[:, 0], end[:, 1] - begin[:, 1]
    return np.stack([c * x + s * y, c * y - s * x, end[:, 2] - begin[:, 2]], axis=1)


def _logs(moves: Array) -> Array:
    """Twists of moves (n, 3) that turn by less than a full turn."""
    return SE2(moves).log(position_tolerance=np.inf)


def _between(
    poses: Array,
    times: Array,
    first: IntArray,
    sizes: IntArray,
    ends: Array,
    reach: float,
    *,
    timed: bool,
) -> Array:
    """Bound (n,) [m] of the deviation between each sample and the next."""
    lasting = np.zeros(len(poses))
    lasting[:-1] = np.diff(times)
    last = first + sizes - 1
    steps = np.zeros_like(poses)
    inner = np.ones(len(poses), dtype=np.bool_)
    inner[last] = False
    k = np.flatnonzero(inner)
    steps[k] = _logs(_moves(poses[k], poses[k + 1])) / np.maximum(lasting[k], 1e-300)[:, None]
    steps[last] = ends[:, 1]
    before = np.roll(steps, 1, axis=0)
    before[first] = ends[:, 0]
    weights = np.array([1.0, 1.0, reach])
    here = steps[k] * weights
    square = np.maximum((here * here).sum(axis=1), 1e-300)
    worst = np.zeros(len(k))
    for beside in (before[k] * weights, steps[k + 1] * weights):
        along = (beside * here).sum(axis=1) / square
        whole = np.linalg.norm(beside - here, axis=1)
        aside = np.linalg.norm(beside - along[:, None] * here, axis=1)
        worst = np.maximum(worst, whole if timed else np.where(along < 0.0, whole, aside))
    bound = np.zeros(len(poses))
    bound[k] = np.sqrt(2.0) * BETWEEN * worst * lasting[k]
    return bound


def _deviations(
    poses: Array, progress: Array, begin: IntArray, end: IntArray, reach: float, *, timed: bool
) -> Array:
    """Farthest (n,) that a point of a body is, at samples, from the one twist over each span."""
    count = end - begin + 1
    span = np.repeat(np.arange(len(count)), count)
    ahead = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    k = begin[span] + ahead
    moves = _moves(poses[begin[span]], poses[k])
    twists = _logs(_moves(poses[begin], poses[end]))[span]
    whole = (progress[end] - progress[begin])[span]
    share = (progress[k] - progress[begin[span]]) / np.where(whole > 0.0, whole, 1.0)
    weights = np.array([1.0, 1.0, reach])
    off = _off(moves, share, twists, weights)
    if not timed:  # the nearest place on the path of the twist
        square = ((twists * weights) ** 2).sum(axis=1)
        missing = _logs(_moves(SE2.exp(share[:, None] * twists).pose, moves))
        more = ((missing * weights * weights) * twists).sum(axis=1) / np.maximum(square, 1e-300)
        nearer = np.clip(share + more, 0.0, 1.0)
        off = np.minimum(off, _off(moves, nearer, twists, weights))
    return np.asarray(np.maximum.reduceat(off, np.cumsum(count) - count))


def _off(moves: Array, share: Array, twists: Array, weights: Array) -> Array:
    difference = np.abs(moves - SE2.exp(share[:, None] * twists).pose) * weights
    return np.asarray(np.hypot(difference[:, 0], difference[:, 1]) + difference[:, 2])


def _greatest(values: Array, begin: IntArray, end: IntArray) -> Array:
    """Greatest value (n,) from each begin up to, and without, its end."""
    if not begin.size:
        return np.zeros(0)
    bounds = np.stack([begin, end], axis=1).ravel()
    return np.asarray(np.maximum.reduceat(np.append(values, 0.0), bounds)[::2])


def fastest_of(body: Body, twists: Array) -> Array:
    """Greatest speed of any point of a body under each twist (n, 3)."""
    return fastest_points(body, twists) if len(twists) else np.zeros(0)


def bodies_of(parts: Sequence[Part]) -> tuple[Body, ...]:
    """The body of each part, for the kernels."""
    return tuple(body_of(part.shapes) for part in parts)
