"""Where piecewise constant controls lead a vehicle: its motion, to rounding, by collocation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_array, check_range
from maneuver_automaton.models import Model
from maneuver_automaton.primitives.primitive import Trajectory

N_NODES = 16


def integrals_to(shares: Array) -> Array:
    """Matrix (k, N_NODES): coefficients of a series to its integrals from 0 to k shares of [0, 1].

    Source: (2 k + 1) P_k = P'_{k+1} - P'_{k-1}, for k = 0 with the constant P_{-1} = -1.
    """
    x = 2.0 * shares - 1.0
    values = legendre.legvander(x, N_NODES)
    before = np.concatenate([-np.ones((*x.shape, 1)), values[..., :-2]], axis=-1)
    return np.asarray(0.5 * (values[..., 1:] - before) / (2.0 * np.arange(N_NODES) + 1.0))


def _tables() -> tuple[Array, Array, Array, Array]:
    x, weights = legendre.leggauss(N_NODES)
    orders = 2.0 * np.arange(N_NODES) + 1.0
    series = 0.5 * orders[:, None] * (legendre.legvander(x, N_NODES - 1) * weights[:, None]).T
    nodes = 0.5 * (x + 1.0)
    return nodes, 0.5 * weights, series, integrals_to(nodes) @ series


NODES, WEIGHTS, SERIES, INTEGRALS = _tables()
"""Gauss points (n,) and weights (n,) of [0, 1]; matrices (n, n) from values at the points to the
coefficients of the series, and to its integrals from 0 to each point."""


RESOLVED = 1e-13  # last terms of a series, over the greatest value or 1 [m, rad, units of z]
SETTLED = 1e-14  # change of the reduced state in an iteration, over the greatest value or 1
NOISE = 1e-12  # the same, where it goes on for ever because rates are differences of great numbers
FINEST = 2**16  # parts of an interval of constant control, at most
MOST_ELEMENTS = 2**17  # of all rides together, or 16 for each control: some 0.5 GB
ITERATIONS = 40  # before a stretch counts as too long to be solved at once
HOPEFUL = 9  # iterations after which every one has to halve the change, or the stretch is too long

BoolArray = NDArray[np.bool_]


class Elements(NamedTuple):
    """Stretches of constant control on which all rates are short series, m rides of k each."""

    step: Array  # (m, k) [s]
    control: Array  # (m, k, n_u)
    begin: Array  # (m, k + 1, n_z) reduced states
    rates: Array  # (m, k, n, n_z) of the reduced state at the points
    twists: Array  # (m, k, n, dof) at the points
    flow: Array  # (m, k, n, dof) rates of the pose, in the frame where the element begins
    ends: Array  # (m, k, 2, dof) twists at begin and end


class Ride(NamedTuple):
    """Controls, and the equal parts each is divided into: as many columns as any ride needs."""

    durations: Array  # (m, n) [s] of the controls
    parts: IntArray  # (m, n)
    first: IntArray  # (n,) column of each control's first part


def resolved(model: Model, z: Array, control: Array, durations: Array) -> tuple[Ride, Elements]:
    """Elements that are fine enough for their series to be exact, for each ride by itself."""
    parts = np.ones(durations.shape, dtype=np.int64)
    most_elements = max(MOST_ELEMENTS, 16 * parts.size)
    while True:
        most = parts.max(axis=0)
        first = np.cumsum(most) - most
        owner = np.repeat(np.arange(most.size), most)
        mine = np.arange(owner.size) - first[owner] < parts[:, owner]
        step = np.where(mine, durations[:, owner] / parts[:, owner], 0.0)
        elements, rough = _integrated(model, z, control[:, owner], step)
        if elements is not None:
            rough = _is_rough(elements)
            if not rough.any():
                return Ride(durations, parts, first), elements
        ride, place = np.nonzero(rough)
        finer = np.zeros(parts.shape, dtype=bool)
        finer[ride, owner[place]] = True
        parts[finer] *= 2
        if parts.max() > FINEST or parts.max(axis=0).sum() * len(parts) > most_elements:
            r, k = np.unravel_index(np.argmax(parts), parts.shape)
            raise ValueError(
                f"{model.name}: the motion under control {control[r, k].tolist()} cannot be "
                f"followed for {durations[r, k]:.6g} s: it explodes, or a reduced state leaves "
                "what the model can bear"
            )


def _integrated(
    model: Model, z: Array, control: Array, step: Array
) -> tuple[Elements | None, BoolArray]:
    """The elements; or none, and which (m, k) cannot be solved for."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        begin, at_nodes, rates, lost = _reduced_states(model, z, control, step)
    if lost.any():
        return None, lost
    at_ends = np.stack([begin[:, :-1], begin[:, 1:]], axis=2)
    twists = model.body_velocity(at_nodes, control[:, :, None])
    heading = step[..., None] * (twists[..., 2] @ INTEGRALS.T)
    flow = twists.copy()
    cosine, sine = np.cos(heading), np.sin(heading)
    flow[..., 0] = cosine * twists[..., 0] - sine * twists[..., 1]
    flow[..., 1] = sine * twists[..., 0] + cosine * twists[..., 1]
    ends = model.body_velocity(at_ends, control[:, :, None])
    return Elements(step, control, begin, rates, twists, flow, ends), lost


def _reduced_states(
    model: Model, z: Array, control: Array, step: Array
) -> tuple[Array, Array, Array, BoolArray]:
    """Reduced states at the begins (m, k + 1, n_z) and points (m, k, n, n_z), rates there."""
    m, k = step.shape
    begin = np.empty((m, k + 1, z.shape[1]))
    at_nodes = np.empty((m, k, NODES.size, z.shape[1]))
    rates = np.empty_like(at_nodes)
    lost = np.zeros((m, k), dtype=bool)
    begin[:, 0] = z
    done, window = 0, k
    while done < k and not lost.any():
        stretch = slice(done, min(done + window, k))
        nodes, at_them, ends, iterations, not_solved = _picard(
            model, begin[:, done], control[:, stretch, None], step[:, stretch]
        )
        if not_solved.any():
            if stretch.stop == done + 1:
                lost[:, done] = not_solved
            window = (stretch.stop - done) // 2
            continue
        at_nodes[:, stretch], rates[:, stretch] = nodes, at_them
        begin[:, done + 1 : stretch.stop + 1] = ends
        done = stretch.stop
        window *= 2 if iterations < ITERATIONS // 3 else 1
    return begin, at_nodes, rates, lost


def _picard(
    model: Model, z: Array, control: Array, step: Array
) -> tuple[Array, Array, Array, int, BoolArray]:
    """Reduced states from those at the begin (m, n_z), by iteration over all elements at once.

    They and their rates at the points (m, k, n, n_z), at the ends of the elements (m, k, n_z); how
    many iterations it took, and the rides (m,) for which these came to nothing.
    """
    m, k = step.shape
    h, first = step[..., None], z[:, None]
    nodes = np.broadcast_to(first[:, None], (m, k, NODES.size, z.shape[1]))
    before = np.inf
    for iteration in range(ITERATIONS):
        rates = model.reduced_dynamics(nodes, control)
        if rates.shape != nodes.shape:
            rates = np.broadcast_to(rates, nodes.shape)
        ends = first + (h * (WEIGHTS @ rates)).cumsum(axis=1)
        begins = np.concatenate([first, ends[:, :-1]], axis=1)[:, :, None]
        new = begins + h[..., None] * (INTEGRALS @ rates)
        changes = np.abs(new - nodes) / np.maximum(1.0, np.abs(new))
        nodes = new
        change = float(changes.max(initial=0.0))
        if not math.isfinite(change):
            break
        hopeless = k > 1 and iteration >= HOPEFUL and change > before / 2.0
        if change <= SETTLED or hopeless or (change <= NOISE and change > before / 2.0):
            break
        before = change
    off = changes.reshape(m, -1).max(axis=1, initial=0.0)
    return nodes, rates, ends, iteration, np.asarray(~(off <= NOISE))


def _is_rough(elements: Elements) -> BoolArray:
    """Elements (m, k) whose series have last terms that are more than rounding."""
    rough = np.zeros(elements.step.shape, dtype=bool)
    h = elements.step[..., None]
    for values in (elements.rates, elements.twists, elements.flow):
        last = np.abs(SERIES[-2:] @ values)
        size = np.maximum(np.abs(values[..., 0, :]), np.abs(values[..., -1, :]))
        worst = np.maximum(last[..., 0, :], last[..., 1, :])
        rough |= (h * worst > RESOLVED * np.maximum(1.0, h * size)).any(axis=-1)
    return rough


MOST_SAMPLES = 500_000  # of one motion
TOGETHER = 4096  # samples that are placed at once


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
    check_range("drive: max_step_m", max_step_m, infinite=True)
    check_range("drive: max_step_rad", max_step_rad, infinite=True)
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
    last_place = elements.step.shape[1] - 1 - np.argmax(elements.step[:, ::-1] > 0.0, axis=1)
    last = elements.control[np.arange(len(spans)), last_place]  # of each ride, that lasts
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
    gained = np.empty((share.size, rates.shape[-1]))
    for k in range(0, share.size, TOGETHER):
        few = slice(k, k + TOGETHER)
        integrals = integrals_to(share[few])[:, None]
        gained[few] = (integrals @ series[at[0][few], at[1][few]])[:, 0]
    return gained


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
