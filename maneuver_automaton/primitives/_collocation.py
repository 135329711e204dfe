"""Motions under piecewise constant controls as short series: Gauss-Legendre collocation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.models import Model
from maneuver_automaton.primitives._legendre import INTEGRALS, NODES, SERIES, WEIGHTS

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
    """Reduced states at the begins (m, k + 1, n_z) and points (m, k, n, n_z), rates there.

    The last value tells the elements (m, k) that no iteration solves.
    """
    m, k = step.shape
    begin = np.empty((m, k + 1, z.shape[1]))
    at_nodes = np.empty((m, k, NODES.size, z.shape[1]))
    rates = np.empty_like(at_nodes)
    lost = np.zeros((m, k), dtype=bool)
    begin[:, 0] = z
    done, window = 0, k
    while done < k and not lost.any():
        stretch = slice(done, min(done + window, k))
        solved = _picard(model, begin[:, done], control[:, stretch, None], step[:, stretch])
        if solved.lost.any():
            if stretch.stop == done + 1:
                lost[:, done] = solved.lost
            window = (stretch.stop - done) // 2
            continue
        at_nodes[:, stretch], rates[:, stretch] = solved.nodes, solved.rates
        begin[:, done + 1 : stretch.stop + 1] = solved.ends
        done = stretch.stop
        window *= 2 if solved.iterations < ITERATIONS // 3 else 1
    return begin, at_nodes, rates, lost


class _Stretch(NamedTuple):
    """Reduced states of m rides on k elements."""

    nodes: Array  # (m, k, n, n_z) at the points
    rates: Array  # (m, k, n, n_z) there
    ends: Array  # (m, k, n_z) at the ends of the elements
    iterations: int
    lost: BoolArray  # (m,) rides for which the iteration came to nothing


def _picard(model: Model, z: Array, control: Array, step: Array) -> _Stretch:
    """Reduced states from those at the begin (m, n_z), by iteration over all elements at once."""
    m, k = step.shape
    h = step[..., None]
    nodes = np.broadcast_to(z[:, None, None], (m, k, NODES.size, z.shape[1])).copy()
    before = np.inf
    for iteration in range(ITERATIONS):
        rates = np.broadcast_to(model.reduced_dynamics(nodes, control), nodes.shape)
        ends = z[:, None] + np.cumsum(h * (WEIGHTS @ rates), axis=1)
        begins = np.concatenate([z[:, None], ends[:, :-1]], axis=1)[:, :, None]
        new = begins + h[..., None] * (INTEGRALS @ rates)
        changes = np.abs(new - nodes) / np.maximum(1.0, np.abs(new))
        nodes = new
        if not np.isfinite(new).all():
            break
        change = float(changes.max(initial=0.0))
        hopeless = k > 1 and iteration >= HOPEFUL and change > before / 2.0
        if change <= SETTLED or hopeless or (change <= NOISE and change > before / 2.0):
            break
        before = change
    off = changes.reshape(m, -1).max(axis=1, initial=0.0)
    return _Stretch(nodes, rates, ends, iteration, np.asarray(~(off <= NOISE)))


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
