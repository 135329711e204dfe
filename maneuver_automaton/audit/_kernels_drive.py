"""Where controls lead: stretches cut to elements, the frame's motion over each, what is stated."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.audit._kernels_edges import place_along
from maneuver_automaton.audit.arrays import Ended, Spans, Stated, TimeElements
from maneuver_automaton.audit.frames import Collocation, FrameMotion


@kernel
def evenly(parts: Array) -> Spans:
    """Each element (n,) in as many equal stretches at least, and in one."""
    most = int(np.ceil(np.maximum(parts, 1.0)).sum())
    element, begin, end = np.empty(most, np.int64), np.empty(most), np.empty(most)
    s = 0
    for e in range(parts.size):
        count = max(math.ceil(parts[e]), 1)
        for k in range(count):
            element[s], begin[s], end[s] = e, k / count, (k + 1) / count
            s += 1
    return Spans(element, begin, end)


@kernel
def cut(
    stated: Stated, begin_twists: Array, rough: IntArray, most: float, n_nodes: int
) -> tuple[TimeElements, Array]:
    """Runs of one control within a primitive that turn by no more than `most` [rad], or parts.

    A stretch that turns more, or was found to be `rough` so many times, stands alone: it is a run,
    in equal parts. Twists (e, n_nodes, dof) are those with which the stretches begin.
    """
    n, dof = begin_twists.shape
    turns = np.abs(begin_twists[:, 2]) * stated.lengths
    parts = np.maximum(np.ceil(turns / most), 1.0).astype(np.int64)
    alone = (parts > 1) | (rough > 0)
    parts <<= np.maximum(rough - (parts == 1), 0)  # found rough among others, it is whole at first
    total = parts.sum()
    first, run, runs = np.empty(total, np.int64), np.empty(n, np.int64), np.empty(total, np.int64)
    share, lengths = np.empty(total), np.empty(total)
    count, e, turned, step = 0, 0, 0.0, -1.0
    for k in range(n):
        turned += turns[k]
        before, step = step, math.floor((turned - turns[k]) / most)
        goes_on = k > 0 and not (alone[k] or alone[k - 1]) and step == before
        goes_on = goes_on and stated.pieces[k] == stated.pieces[k - 1]
        if goes_on and (stated.controls[k] == stated.controls[k - 1]).all():
            lengths[e - 1] += stated.lengths[k]
        else:
            for number in range(parts[k]):
                first[e], runs[e], share[e] = k, count, number / parts[k]
                lengths[e] = stated.lengths[k] / parts[k]
                e += 1
            count += 1
        run[k] = count - 1
    twists = np.empty((e, n_nodes, dof))
    for k in range(e):
        twists[k] = begin_twists[first[k]]
    return TimeElements(first[:e], share[:e], lengths[:e], runs[:e], run), twists


@inner_kernel
def _term(weights: Array, values: Array, d: int) -> float:
    """A sum over the nodes of an element."""
    total = 0.0
    for j in range(weights.size):
        total += weights[j] * values[j, d]
    return total


@inner_kernel
def _most(known: float, value: float) -> float:
    """The greater of two numbers; inf for what is not a number, which would pass every test."""
    return value if value > known else known if value == value else math.inf


@inner_kernel
def _bounded(
    series: Array, nodes: Array, error: Array, twists: Array, lengths: Array, rules: Collocation
) -> FrameMotion:
    """A motion whose series (e, n, dof) and `nodes` (e, N, dof) are known, with its bounds."""
    n, dof = lengths.size, twists.shape[2]
    times, most, change = np.zeros(n + 1), np.empty((n, dof)), np.empty((n, dof))
    speed, bend, swerve, rise, length = np.empty(n), np.empty(n), np.empty(n), np.empty(n), 0.0
    for e in range(n):
        for d in range(dof):
            total, slope = 0.0, 0.0
            for k in range(rules.slopes.size):
                term = abs(_term(rules.series[k], twists[e], d))
                total += term
                slope += rules.slopes[k] * term
            most[e, d], change[e, d] = total, slope / lengths[e]
        speed[e] = math.hypot(most[e, 0], most[e, 1])
        bend[e] = math.hypot(change[e, 0], change[e, 1]) + most[e, 2] * speed[e]
        swerve[e] = change[e, 2] + most[e, 2] * most[e, 2]
        rise[e] = change[e, 3:].sum()
        length += speed[e] * lengths[e]
        times[e + 1] = times[e] + lengths[e]
    turn = most[:, 2].copy()
    return FrameMotion(times, series, nodes, speed, turn, bend, swerve, rise, error, length)


@inner_kernel
def _motion_along(
    start: Array, twists: Array, lengths: Array, rules: Collocation
) -> tuple[Array, Array, Array]:
    """Series, nodes and error from a pose (dof,), under twists (e, N, dof) over lengths (e,) [s].

    The heading is the integral of the turn rate, the place that of the velocity seen with it.
    """
    n, n_nodes, dof = twists.shape
    series, nodes = np.empty((n, n_nodes + 1, dof)), np.empty((n, n_nodes, dof))
    rates, error = np.empty((n_nodes, dof)), np.zeros(n)
    pose = start.copy()
    for e in range(n):
        h = lengths[e]
        rates[:] = twists[e]
        for i in range(n_nodes):
            heading = pose[2] + h * _term(rules.to_nodes[i], twists[e], 2)
            c, s = math.cos(heading), math.sin(heading)
            rates[i, 0] = c * twists[e, i, 0] - s * twists[e, i, 1]
            rates[i, 1] = s * twists[e, i, 0] + c * twists[e, i, 1]
        for d in range(dof):
            gained = 0.0
            for k in range(n_nodes + 1):
                series[e, k, d] = h * _term(rules.integral[k], rates, d)
                gained += series[e, k, d]
            series[e, 0, d] += pose[d]
            for i in range(n_nodes):
                nodes[e, i, d] = pose[d] + h * _term(rules.to_nodes[i], rates, d)
            for k in range(n_nodes - 2, n_nodes):
                error[e] = _most(error[e], abs(_term(rules.series[k], rates, d)) * h)
            pose[d] += gained
    return series, nodes, error


@inner_kernel
def _compared(stated: Stated, elements: TimeElements, motion: FrameMotion, twists: Array) -> Ended:
    """Where stretches end, and the greatest difference to what is stated of poses and twists."""
    n, dof = stated.ends.shape
    ends, share, at = np.empty(n), np.empty(n), np.empty(n, np.int64)
    poses, off, turned, time, e = np.empty((n, dof)), 0.0, 0.0, 0.0, 0
    for k in range(n):
        time += stated.lengths[k]
        while e + 1 < elements.first.size and elements.first[e + 1] <= k:
            e += 1
        ends[k], at[k] = time, e
        share[k] = max((time - motion.times[e]) / elements.lengths[e], 0.0)
        place, heading, z = place_along(motion.series, e, min(share[k], 1.0))
        poses[k, 0], poses[k, 1], poses[k, 2] = place.real, place.imag, heading
        if dof > 3:
            poses[k, 3] = z
        for d in range(dof):
            off = _most(off, abs(poses[k, d] - stated.ends[k, d]))
        turned = _most(turned, abs(heading - stated.ends[k, 2]))
    for e in range(elements.first.size):
        for d in range(dof):
            known = stated.twists[elements.first[e], d]
            # Of the twists of maneuvers nothing is stated: those are not numbers, and do not count.
            for i in range(twists.shape[1] if known == known else 0):
                off = _most(off, abs(twists[e, i, d] - known) * elements.lengths[e])
    return Ended(ends, at, share, poses, off, turned)


@kernel
def bounded(
    series: Array, nodes: Array, error: Array, twists: Array, lengths: Array, rules: Collocation
) -> FrameMotion:
    """What `_bounded` returns."""
    return _bounded(series, nodes, error, twists, lengths, rules)


@kernel
def followed(
    start: Array, twists: Array, stated: Stated, elements: TimeElements, rules: Collocation
) -> tuple[FrameMotion, Ended]:
    """The motion from a pose (dof,) under twists (e, N, dof), and how what is stated differs."""
    lengths = elements.lengths
    series, nodes, error = _motion_along(start, twists, lengths, rules)
    frames = _bounded(series, nodes, error, twists, lengths, rules)
    return frames, _compared(stated, elements, frames, twists)
