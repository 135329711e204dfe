"""Plans made of plans: cut in time, in the midst of a maneuver too, joined, and carried along."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.plan import Plan
from maneuver_automaton.groups import LieGroup, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.primitives.driving import along

NOTHING = 1e-9  # [s] what lasts no longer has passed, or has not begun


def with_samples_at(plan: Plan, times: ArrayLike, model: Model) -> Plan:
    """A plan whose maneuvers have samples at `times` (n,) [s] too, where it can be cut exactly."""
    if not any(plan.maneuvers):
        return plan
    due = np.asarray(times, dtype=np.float64)
    maneuvers, k = list(plan.maneuvers), 0
    for piece, begin in zip(plan.primitives, plan.switching_times, strict=False):
        if not isinstance(piece, Maneuver):
            continue
        while maneuvers[k] is not piece:
            k += 1
        maneuvers[k] = _sampled(piece, due - begin, model)
        k += 1
    return replace(plan, maneuvers=tuple(maneuvers))


@lru_cache(maxsize=4096)
def sampled_finely(one: Maneuver, reaches: tuple[tuple[str, float], ...], off: float) -> Maneuver:
    """A maneuver of so many samples that no point is farther than `off` [m] from its coasts.

    Points are within reaches [m] of the vehicle's pose, named "", and of the parts it carries.
    What no equations lead stays as it is.
    """
    if one.course is None or (model := one.course.model) is None:
        return one
    begins, lasting = one.course.time[:-1], np.diff(one.course.time)
    middles, farthest = begins + 0.5 * lasting, np.zeros(begins.size)
    pair: Sequence[Maneuver | None] = (one, _sampled(one, middles, model))
    for part, reach in reaches:
        frame = partial(_part_frame, model, part, group_of(one.displacement.size))
        own = _maneuvers(pair, frame) if part else pair
        coasts, there = (seen.course.pose_at(middles) for seen in own if seen and seen.course)
        x, y, turn = np.abs(coasts - there).T[:3]
        farthest = np.maximum(farthest, np.hypot(x, y) + reach * turn)
    counts = np.ceil(np.sqrt(farthest / off))  # off a coast it is farthest half way, about
    dues = [a + t * np.arange(1, n) / n for a, t, n in zip(begins, lasting, counts, strict=True)]
    return _sampled(one, np.concatenate(dues), model)


def head_of(plan: Plan, until: float) -> Plan:
    """The first `until` seconds of a plan; of a maneuver that is cut, its begin."""
    if not plan.maneuvers:
        heads = first_times(plan.durations.tolist(), until)
        trims = plan.trims[: len(heads)]
        return Plan.of_parts(plan.start, trims, heads, start_time=plan.start_time)
    word, times, between, left = [plan.trims[0]], [0.0], list[Maneuver | None](), until
    for k, (trim, duration) in enumerate(zip(plan.trims, plan.durations.tolist(), strict=True)):
        if k and left <= NOTHING:
            break
        if k:
            maneuver = plan.maneuvers[k - 1]
            if maneuver is not None:
                lasting = maneuver.duration
                cut = left < lasting - NOTHING
                maneuver, left = (_begin_of(maneuver, left) if cut else maneuver), left - lasting
            between.append(maneuver)
            word.append(trim)
            times.append(0.0)
        times[-1] += min(duration, max(left, 0.0))
        left -= duration
    return _plan(plan, plan.start, word, times, between, plan.start_time)


def tail_of(plan: Plan, after: float, *, start: Array | None = None) -> Plan:
    """The rest of a plan `after` seconds, from `start`; of a maneuver under way, its end.

    `after`: [s] that have passed since its start. `start`: where the vehicle is [m, m, rad(, m)];
    if omitted, where the plan says.
    """
    if not plan.maneuvers:
        lasting = last_times(plan.durations.tolist(), after)
        at = plan.start_time + after
        begin = plan.pose_at(at) if start is None else start
        trims = plan.trims[len(plan.trims) - len(lasting) :]
        return Plan.of_parts(begin, trims, lasting, start_time=at)
    word, times, between, passed = list[Trim](), list[float](), list[Maneuver | None](), after
    for k, (trim, duration) in enumerate(zip(plan.trims, plan.durations.tolist(), strict=True)):
        if k:
            maneuver = plan.maneuvers[k - 1]
            if word:
                between.append(maneuver)
            elif maneuver is not None and passed < maneuver.duration - NOTHING:
                word, times = [plan.trims[k - 1]], [0.0]
                between = [_end_of(maneuver, passed) if passed > NOTHING else maneuver]
                passed = 0.0
            elif maneuver is not None:
                passed = max(passed - maneuver.duration, 0.0)
        if word or duration - passed > NOTHING or k == len(plan.trims) - 1:
            word.append(trim)
            times.append(max(duration - passed, 0.0))
            passed = 0.0
        else:
            passed = max(passed - duration, 0.0)
    at = plan.start_time + after
    return _plan(plan, plan.pose_at(at) if start is None else start, word, times, between, at)


def first_times(durations: Sequence[float], until: float) -> list[float]:
    """How long the first trims of a word last in its first `until` seconds; one at least."""
    times, left = list[float](), until
    for duration in durations:
        if times and left <= NOTHING:
            break
        times.append(min(duration, max(left, 0.0)))
        left -= duration
    return times


def last_times(durations: Sequence[float], after: float) -> list[float]:
    """How long the last trims of a word last after `after` [s]; the last one stays in any case."""
    passed = after
    for k, duration in enumerate(durations):
        if duration - passed > NOTHING or k == len(durations) - 1:
            return [max(duration - passed, 0.0), *durations[k + 1 :]]
        passed = max(passed - duration, 0.0)
    return []


def committed(plan: Plan, after: float) -> float:
    """Seconds until the maneuver ends that is under way `after` seconds; 0 in a trim.

    What is left of a plan may start within a maneuver: then that is under way from its start on.
    """
    if not any(plan.maneuvers):
        return 0.0
    begins = plan.switching_times - plan.start_time
    for k, piece in enumerate(plan.primitives):
        begun = begins[k] + NOTHING < after
        if k == 0 and not begun and isinstance(piece, Maneuver):  # it may start within this
            number = next(n for n, one in enumerate(plan.maneuvers) if one is not None)
            begun = not same_state(begin_state(plan), plan.trims[number].reduced_state)
        if begun and after < begins[k + 1] - NOTHING and isinstance(piece, Maneuver):
            return float(begins[k + 1] - after)
    return 0.0


def begin_state(plan: Plan) -> Array:
    """Reduced state (n_z,) in which a plan of at least one trim starts, say within a maneuver."""
    return _end_of_plan(plan, 0)


def end_state(plan: Plan) -> Array:
    """Reduced state (n_z,) in which a plan of at least one trim ends, say within a maneuver."""
    return _end_of_plan(plan, -1)


def _end_of_plan(plan: Plan, k: int) -> Array:
    one = plan.primitives[k] if plan.primitives else plan.trims[k]
    if isinstance(one, Maneuver):
        return plan.trims[k].reduced_state if one.course is None else one.course.reduced_state[k]
    return one.reduced_state


def joined(first: Plan, second: Plan) -> Plan:
    """One plan after another, which starts in the trim, or its class, where the first one ends."""
    same = first.trims[-1].name == second.trims[0].name
    kept, times = len(first.trims) - int(same), first.durations.tolist()
    lasting = [*second.durations.tolist()]
    if same:
        lasting[0] += times[-1]
    link: tuple[Maneuver | None, ...] = () if same else (None,)
    between = (
        *(first.maneuvers or (None,) * (len(first.trims) - 1)),
        *link,
        *(second.maneuvers or (None,) * (len(second.trims) - 1)),
    )
    return _plan(
        first,
        first.start,
        [*first.trims[:kept], *second.trims],
        [*times[:kept], *lasting],
        list(between),
        first.start_time,
    )


def _plan(
    plan: Plan,
    start: Array,
    word: Sequence[Trim],
    times: Sequence[float],
    between: Sequence[Maneuver | None],
    start_time: float,
) -> Plan:
    maneuvers = tuple(between) if any(between) else ()
    return Plan(start, word, durations=times, maneuvers=maneuvers, start_time=start_time)


def _cut_at(maneuver: Maneuver, time: float) -> tuple[Trajectory, int]:
    """The course of a maneuver with a sample at a time since its begin [s], and its number."""
    course = maneuver.known_course("so it cannot be cut")
    if (k := _sample_at(course, time)) is not None:
        return course, k
    at = np.array([time])
    if course.model is not None:
        return _with_rows(course, at, *along(course, at, course.model))
    states = [np.interp(time, course.time, column) for column in course.reduced_state.T]
    return _with_rows(course, at, course.pose_at(time)[None], np.array(states).reshape(1, -1))


def _begin_of(maneuver: Maneuver, until: float) -> Maneuver:
    course, k = _cut_at(maneuver, until)
    part = replace(
        course,
        time=course.time[: k + 1],
        pose=course.pose[: k + 1],
        reduced_state=course.reduced_state[: k + 1],
        control=np.concatenate([course.control[:k], course.control[max(k - 1, 0) : max(k, 1)]]),
    )
    return _part(maneuver, part)


def _end_of(maneuver: Maneuver, after: float) -> Maneuver:
    course, k = _cut_at(maneuver, after)
    group = group_of(course.pose.shape[1])
    poses = np.array((group(course.pose[k]).inverse() @ group(course.pose[k:])).pose)
    poses[0] = 0.0
    part = replace(
        course,
        time=course.time[k:] - course.time[k],
        pose=poses,
        reduced_state=course.reduced_state[k:],
        control=course.control[k:],
    )
    return _part(maneuver, part)


def _part(maneuver: Maneuver, course: Trajectory) -> Maneuver:
    duration = float(course.time[-1])
    return replace(maneuver, displacement=course.pose[-1], duration=duration, course=course)


def _sample_at(course: Trajectory, time: float) -> int | None:
    k = int(np.abs(course.time - time).argmin())
    return k if abs(float(course.time[k]) - time) <= NOTHING else None


def _sampled(maneuver: Maneuver, since: Array, model: Model) -> Maneuver:
    """The maneuver with samples at times `since` its begin, as the model drives there."""
    course = maneuver.known_course("so it cannot be cut")
    new = [
        float(t)
        for t in since
        if NOTHING < t < maneuver.duration - NOTHING and _sample_at(course, float(t)) is None
    ]
    if not new:
        return maneuver
    times = np.unique(np.array(new))
    return replace(maneuver, course=_with_rows(course, times, *along(course, times, model))[0])


def _with_rows(
    course: Trajectory, times: Array, poses: Array, states: Array
) -> tuple[Trajectory, int]:
    """The course with samples put in, and where the first of them is."""
    at = np.searchsorted(course.time, times, side="right")
    finer = replace(
        course,
        time=np.insert(course.time, at, times),
        pose=np.insert(course.pose, at, poses, axis=0),
        reduced_state=np.insert(course.reduced_state, at, states, axis=0),
        control=np.insert(course.control, at, course.control[at - 1], axis=0),
    )
    return finer, int(at[0])


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
    """
    group = group_of(plan.start.size)
    frame = partial(_part_frame, model, part, group)

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


def _part_frame(model: Model, part: str, group: type[LieGroup], states: Array) -> LieGroup:
    """Where a part is in states (..., n_z), seen from the vehicle."""
    poses = np.asarray(model.part_poses(states), dtype=np.float64)
    return group(poses[..., model.part_names.index(part), :])


def _maneuvers(
    maneuvers: Sequence[Maneuver | None], frame: Callable[[Array], LieGroup]
) -> tuple[Maneuver | None, ...]:
    """The maneuvers of the part, their displacements seen from where the part begins."""
    why = "so nothing can be carried"
    courses = [one.known_course(why) for one in maneuvers if one is not None]
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
