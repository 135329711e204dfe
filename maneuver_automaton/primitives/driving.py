"""Where piecewise constant controls lead a vehicle: its motion, to rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.models import Model
from maneuver_automaton.primitives._collocation import Elements, Ride, resolved
from maneuver_automaton.primitives._legendre import SERIES, WEIGHTS, integrals_to
from maneuver_automaton.primitives.trajectory import Trajectory

MOST_SAMPLES = 500_000  # of one motion


def drive(
    model: Model,
    reduced_state: ArrayLike,
    *,
    control: ArrayLike,
    durations: ArrayLike,
    max_step_m: float = 0.05,
    max_step_rad: float = 0.05,
) -> Trajectory:
    """Motion from the identity pose under controls (n, n_u), each for its duration (n,) [s].

    There is a sample at the begin of every control, and samples are closer than both steps, equal
    times apart while one control holds. Controls of no duration are left out. What is computed,
    and how exactly, see `drive_all`.

    Raises
    ------
    ValueError
        If a shape is wrong, a duration negative, or the motion is no smooth one: it explodes, or
        a reduced state leaves what the model can bear.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderUnicycle
    >>> robot = SecondOrderUnicycle(max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0,
    ...                             max_angular_acceleration=1.0)
    >>> stroke = drive(robot, [0.0, 0.0], control=[[1.0, 0.0], [-1.0, 0.0]], durations=[1.0, 1.0])
    >>> stroke.pose[-1].round(12).tolist(), stroke.reduced_state[-1].tolist()
    ([1.0, 0.0, 0.0], [0.0, 0.0])
    """
    (course,) = drive_all(
        model,
        as_array("reduced state", reduced_state)[None],
        control=as_array("control", control)[None],
        durations=as_array("durations", durations)[None],
        max_step_m=max_step_m,
        max_step_rad=max_step_rad,
    )
    return course


def drive_all(
    model: Model,
    reduced_states: ArrayLike,
    *,
    control: ArrayLike,
    durations: ArrayLike,
    max_step_m: float = 0.05,
    max_step_rad: float = 0.05,
) -> tuple[Trajectory, ...]:
    """Motions of m rides at once; see `drive`.

    Gauss-Legendre collocation with 16 points, on elements that are halved until the last terms of
    the series of all rates are rounding; so what lies between the points is as exact as the ends.
    The equations of the points are solved by Picard iteration, over all elements at once where
    the rates do not depend on the reduced state, and over as many as converge where they do. The
    group makes the rest a sum: poses are integrated in the frame of each element, then chained.

    Source: Hairer, Lubich, Wanner (2006), *Geometric Numerical Integration*, Sec. II.1.3, for the
    collocation; Bai, Junkins (2011), *Modified Chebyshev-Picard iteration methods for solution of
    initial value problems*, for the iteration.

    Parameters
    ----------
    model : Model
        The vehicle; on SE(2) or SE(2) x R.
    reduced_states : (m, n_z) array
        Reduced state at the begin of each ride.
    control : (m, n, n_u) array
        Controls in order; not held against the limits of the model.
    durations : (m, n) array
        How long each control holds [s]; 0 fills up rides of fewer controls.
    max_step_m, max_step_rad : float
        Greatest distance [m] and change of heading [rad] between samples.

    Returns
    -------
    tuple of m Trajectory

    Raises
    ------
    ValueError
        As `drive`.
    """
    z = as_array("reduced state", reduced_states, last=len(model.reduced_names))
    u = as_array("control", control, last=len(model.control_names))
    h = as_array("durations", durations)
    if z.ndim != 2 or u.ndim != 3 or h.shape != u.shape[:2] or h.shape[0] != z.shape[0]:
        raise ValueError(
            f"drive: got reduced states {z.shape}, control {u.shape} and durations {h.shape}, "
            "need (m, n_z), (m, n, n_u) and (m, n)"
        )
    if h.size == 0 or not (h >= 0.0).all():
        what = f"{h.min():.6g} s" if h.size else "no control"
        raise ValueError(f"drive: got {what}, need durations of at least 0 s")
    for name, step in (("max_step_m", max_step_m), ("max_step_rad", max_step_rad)):
        if not step > 0.0:
            raise ValueError(f"drive: {name} must be positive, got {step}")
    ride, elements = resolved(model, z, u, h)
    return _sampled(model, ride, elements, max_step_m, max_step_rad)


def along(course: Trajectory, times: Array, model: Model) -> tuple[Array, Array]:
    """Poses (n, dof) and reduced states (n, n_z) of a course at times (n,), as the model drives.

    Each is driven from the sample before it, under the control that holds there.
    """
    k = np.clip(np.searchsorted(course.time, times, side="right") - 1, 0, course.time.size - 1)
    since = np.maximum(times - course.time[k], 0.0)
    poses, states, between = course.pose[k], course.reduced_state[k], np.flatnonzero(since)
    if between.size:
        rows = k[between]
        rides = drive_all(
            model,
            course.reduced_state[rows],
            control=course.control[rows][:, None],
            durations=since[between, None],
            max_step_m=np.inf,
            max_step_rad=np.inf,
        )
        poses[between] = _moved(poses[between], np.array([ride.pose[-1] for ride in rides]))
        states[between] = [ride.reduced_state[-1] for ride in rides]
    return poses, states


def _sampled(
    model: Model, ride: Ride, elements: Elements, max_step_m: float, max_step_rad: float
) -> tuple[Trajectory, ...]:
    """Samples of every ride, equal times apart while one control holds, all in one go."""
    counts = _n_samples(ride, elements, max_step_m, max_step_rad)
    poses = _chained(elements)
    spans = np.cumsum(ride.durations, axis=1)
    rows, place = np.nonzero(ride.durations)
    count = counts[rows, place]
    of = np.repeat(np.arange(count.size), count)
    number = np.arange(of.size) - (np.cumsum(count) - count)[of]
    parts = ride.parts[rows, place][of]
    part = number * parts // count[of]  # in whole numbers: ends of parts are begins
    share = number * parts / count[of] - part
    at = (rows[of], ride.first[place][of] + part)
    gained = _gained(elements, at, share)
    dof = poses.shape[-1]
    begin = spans[rows, place] - ride.durations[rows, place]
    samples = Trajectory(
        time=begin[of] + number * (ride.durations[rows, place] / count)[of],
        pose=_moved(poses[at], gained[:, :dof]),
        reduced_state=elements.begin[at] + gained[:, dof:],
        control=elements.control[at],
        model=model,
    )
    last = elements.control[np.arange(len(spans)), _last_place(elements.step)]
    stops = np.searchsorted(rows[of], np.arange(len(spans)), side="right")
    return tuple(
        Trajectory(
            time=np.append(samples.time[start:stop], spans[r, -1]),
            pose=np.concatenate([samples.pose[start:stop], poses[r, -1:]]),
            reduced_state=np.concatenate(
                [samples.reduced_state[start:stop], elements.begin[r, -1:]]
            ),
            control=np.concatenate([samples.control[start:stop], last[r][None]]),
            model=model,
        )
        for r, (start, stop) in enumerate(zip([0, *stops[:-1]], stops, strict=True))
    )


def _gained(elements: Elements, at: tuple[IntArray, IntArray], share: Array) -> Array:
    """Pose from the begin of the element, then reduced state gained, at shares of elements."""
    rates = np.concatenate([elements.flow, elements.rates], axis=-1)
    series = SERIES @ rates * elements.step[..., None, None]
    shares, which, counts = np.unique(share, return_inverse=True, return_counts=True)
    gained = np.empty((share.size, rates.shape[-1]))
    order, ends = np.argsort(which, kind="stable"), np.cumsum(counts)
    for row, begin, end in zip(integrals_to(shares), ends - counts, ends, strict=True):
        same = order[begin:end]
        gained[same] = row @ series[at[0][same], at[1][same]]
    return gained


def _last_place(step: Array) -> IntArray:
    """Last element (m,) of each ride that lasts; any if none does."""
    return np.asarray(step.shape[1] - 1 - np.argmax(step[:, ::-1] > 0.0, axis=1))


def _n_samples(ride: Ride, elements: Elements, max_step_m: float, max_step_rad: float) -> IntArray:
    """How many equal intervals (m, n) keep the samples under a control close enough."""
    twists = np.concatenate([elements.twists, elements.ends], axis=2)
    places = [0, 1, *range(3, twists.shape[-1])]
    speed = np.linalg.norm(twists[..., places], axis=-1).max(axis=2)
    turn = np.abs(twists[..., 2]).max(axis=2)
    rate = np.where(elements.step > 0.0, np.maximum(speed / max_step_m, turn / max_step_rad), 0.0)
    need = ride.durations * np.maximum.reduceat(rate, ride.first, axis=1)
    most = need.sum(axis=1).max(initial=0.0)
    if not most <= MOST_SAMPLES:
        raise ValueError(
            f"drive: a motion has {most:.3g} samples {max_step_m:g} m or {max_step_rad:g} rad "
            f"apart, need a shorter one: at most {MOST_SAMPLES}"
        )
    count: IntArray = np.maximum(np.ceil(1.001 * need), 1.0).astype(np.int64)
    return count


def _chained(elements: Elements) -> Array:
    """Poses (m, k + 1, dof) at the ends of the elements, from the identity."""
    h = elements.step[..., None]
    steps = h * (WEIGHTS @ elements.flow)
    poses = np.zeros((steps.shape[0], steps.shape[1] + 1, steps.shape[2]))
    np.cumsum(steps, axis=1, out=poses[:, 1:])
    turned = _moved(np.where(np.arange(steps.shape[2]) == 2, poses[:, :-1], 0.0), steps)
    np.cumsum(turned[..., :2], axis=1, out=poses[:, 1:, :2])
    return poses


def _moved(begin: Array, steps: Array) -> Array:
    """Poses (..., dof) of `steps` from the poses `begin`."""
    cosine, sine = np.cos(begin[..., 2]), np.sin(begin[..., 2])
    moved: Array = begin + steps
    moved[..., 0] = begin[..., 0] + cosine * steps[..., 0] - sine * steps[..., 1]
    moved[..., 1] = begin[..., 1] + sine * steps[..., 0] + cosine * steps[..., 1]
    return moved
