"""Reduced states from the start of a plan on, integrated on all elements side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.legendre import INTEGRAL, SERIES, TO_END, TO_NODES, N
from maneuver_automaton.models import Model

ITERATIONS = 40  # of Picard; an element that needs more is cut
SWEEPS = 8  # until each element begins where the one before it ends
SAME = 1e-14  # relative, two states that are the same but for rounding
FOLLOWED = 1e-9  # relative: a vehicle whose deviations grow is followed to that far from the plan
NUDGE = 1e-6  # [model's units] for a derivative


class Reduced(NamedTuple):
    """Reduced states over elements; `nodes` is (e, 1, 0) for a vehicle without."""

    nodes: Array  # (e, N, n_z)
    series: Array  # (e, N + 1, n_z) Legendre series over the share of an element
    error: Array  # (e,) what the last terms of a series are; inf where there is none
    jumps: float  # what is left between elements, added up


def reduced_states(
    model: Model, controls: Array, lengths: Array, guess: Array, stated: NDArray[np.bool_]
) -> Reduced:
    """Reduced states from the first of `guess` (e, n_z) on, under controls (e, n_u).

    Every element is driven from a guess of where it begins. The differences that remain between
    elements are then carried forward by the linearised flow, and all are driven again, until each
    begins where the one before ends: that is the integration from the start, by Newton's method.
    A vehicle that amplifies deviations (a trailer pushed backwards) cannot be followed so for
    long, by nobody: where it is 1e-9 from what the plan states, it goes on there, and the jump
    counts. `stated` (e,) is where the guesses are what the plan states.
    """
    n = len(lengths)
    if not guess.shape[1]:
        return Reduced(np.zeros((n, 1, 0)), np.zeros((n, N + 1, 0)), np.zeros(n), 0.0)
    begins, h = guess.copy(), lengths[:, None, None]
    restarted = np.zeros(n - 1, dtype=np.bool_)
    for sweep in range(SWEEPS):
        nodes, rates, failed = _driven(model, begins, controls, lengths)
        if failed.any():
            return Reduced(nodes, nodes, np.where(failed, np.inf, 0.0), np.inf)
        jumps = begins[:-1] + lengths[:-1, None] * (TO_END @ rates[:-1]) - begins[1:]
        scale = 1.0 + np.abs(begins).max(axis=1)
        open_ = np.abs(jumps).max(axis=1, initial=0.0) > SAME * scale[1:]
        if not (open_ & ~restarted).any() or sweep == SWEEPS - 1:
            break
        flow = _flow(model, nodes[:, N // 2], controls, lengths)
        begins, restarted = _carried_on(begins, jumps, flow, guess, FOLLOWED * scale * stated)
    series = h * (INTEGRAL @ rates)
    series[:, 0] += begins
    error = np.abs(SERIES[-2:] @ rates).max(axis=(1, 2)) * lengths
    return Reduced(nodes, series, error, float(np.abs(jumps).max(axis=1, initial=0.0).sum()))


def _driven(
    model: Model, begins: Array, controls: Array, lengths: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """States and rates (e, N, n_z) at the nodes, and which elements are too long to be solved."""
    nodes = np.repeat(begins[:, None], N, axis=1)
    rates = np.empty_like(nodes)
    size = 1.0 + np.abs(begins).max(axis=1)
    failed = np.zeros(len(begins), dtype=np.bool_)
    open_: IntArray = np.arange(len(begins))
    for _ in range(ITERATIONS):
        rates[open_] = model.reduced_dynamics(nodes[open_], controls[open_, None])
        new = begins[open_, None] + lengths[open_, None, None] * (TO_NODES @ rates[open_])
        change = np.abs(new - nodes[open_]).max(axis=(1, 2))
        wild = ~(change < 1e3 * size[open_])
        failed[open_[wild]] = True
        nodes[open_[~wild]] = new[~wild]
        open_ = open_[(change > 0.1 * SAME * size[open_]) & ~wild]
        if not open_.size:
            return nodes, rates, failed
    failed[open_] = True
    return nodes, rates, failed


def _flow(model: Model, middles: Array, controls: Array, lengths: Array) -> Array:
    """How the end of each element depends on its begin: (e, n_z, n_z), to first order."""
    n_z = middles.shape[1]
    off = middles[:, None] + NUDGE * np.eye(n_z)
    slopes = model.reduced_dynamics(off, controls[:, None])
    slopes = (slopes - model.reduced_dynamics(middles, controls)[:, None]) / NUDGE
    generator = lengths[:, None, None] * np.swapaxes(slopes, 1, 2)
    flow = np.broadcast_to(np.eye(n_z), generator.shape)
    for k in range(8, 0, -1):  # the exponential, by Horner
        flow = np.eye(n_z) + generator @ flow / k
    return np.asarray(flow)


def _carried_on(
    begins: Array, jumps: Array, flow: Array, guess: Array, followed: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Where elements begin once the jumps are carried forward, and where that starts anew."""
    new = begins.copy()
    restarted = np.zeros(len(jumps), dtype=np.bool_)
    for k, jump in enumerate(jumps):
        new[k + 1] += jump + flow[k] @ (new[k] - begins[k])
        if 0.0 < followed[k + 1] < np.abs(new[k + 1] - guess[k + 1]).max():
            new[k + 1], restarted[k] = guess[k + 1], True
    return new, restarted
