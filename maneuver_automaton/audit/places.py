"""What places cost along a plan that was driven again: another integration, of other distances."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit._kernels_edges import distances
from maneuver_automaton.audit.arrays import Spans
from maneuver_automaton.audit.drive import DrivenPlan
from maneuver_automaton.audit.outlines import Surroundings
from maneuver_automaton.audit.passages import AuditedBody
from maneuver_automaton.places import Clearance, PlaceCost

AGREED = 1e-3  # of the plan's whole cost, by which two integrations may differ
CLOSE = 1e-4  # of that cost: stretches are halved until what is still open is less
LONGEST = 0.5  # [s], [m] of a stretch, before any is halved
MOST_ROUNDS = 22
# Lobatto's rule with four points, and Kronrod's seven that contain them: ends count, so that no
# jump of a rate hides beyond the last one. Source: Gander and Gautschi (2000), Adaptive quadrature.
SHARES = 0.5 + 0.5 * np.array(
    [-1.0, -math.sqrt(2.0 / 3.0), -math.sqrt(0.2), 0.0, math.sqrt(0.2), math.sqrt(2.0 / 3.0), 1.0]
)
LOBATTO = np.array([1.0, 0.0, 5.0, 0.0, 5.0, 0.0, 1.0]) / 12.0
KRONROD = np.array([77.0, 432.0, 625.0, 672.0, 625.0, 432.0, 77.0]) / 2940.0


def price_again(
    cost: PlaceCost,
    drive: DrivenPlan,
    offset: Array,
    bodies: Sequence[AuditedBody],
    around: Surroundings,
    *,
    whole: float,
) -> float:
    """The integral of a cost along a drive whose poses are counted from a place (dof,).

    By two rules on each stretch, which is halved where they differ.
    """
    lasting = np.diff(drive.frames.times)

    def rates(spans: Spans) -> Array:
        shares = spans.begin[:, None] + (spans.end - spans.begin)[:, None] * SHARES
        at, shape = (np.repeat(spans.element, SHARES.size), shares.ravel()), shares.shape
        twists = drive.twists_at(*at).reshape(*shape, offset.size)
        if isinstance(cost, Clearance):
            apart = [_distances(one, around, *at, cost.within) for one in bodies]
            near = 1.0 - np.minimum.reduce(apart).reshape(shape) / cost.within
            found = np.asarray(cost.weight * near * near)
        else:
            poses = (drive.frames.at(*at) + offset).reshape(twists.shape)
            found = np.array(cost.rates(poses, twists), dtype=np.float64)
        if cost.per == "metre":
            found *= np.sqrt((np.delete(twists, 2, axis=2) ** 2).sum(axis=2))
        return found

    spans, _ = drive.between_samples()
    if not len(spans.element):
        return 0.0
    spans = _no_longer(spans, lasting, drive.frames.speed)
    done = 0.0
    for _ in range(MOST_ROUNDS):
        values = rates(spans)
        seconds = lasting[spans.element] * (spans.end - spans.begin)
        fine = values @ KRONROD * seconds
        off = np.abs(fine - values @ LOBATTO * seconds)
        if off.sum() <= CLOSE * whole:
            return done + float(fine.sum())
        again = off > 0.25 * CLOSE * whole / len(off)
        done += float(fine[~again].sum())
        rest, fine = spans.of(again), fine[again]
        middle = 0.5 * (rest.begin + rest.end)
        spans = Spans(
            np.repeat(rest.element, 2),
            np.stack([rest.begin, middle], axis=1).ravel(),
            np.stack([middle, rest.end], axis=1).ravel(),
        )
    return done + float(fine.sum())


def _no_longer(spans: Spans, lasting: Array, speeds: Array) -> Spans:
    """The stretches cut to half a second, and to half a metre."""
    seconds = (spans.end - spans.begin) * lasting[spans.element]
    most = np.maximum(seconds, seconds * speeds[spans.element]) / LONGEST
    parts = np.maximum(np.ceil(most), 1.0).astype(np.int64)
    of = np.repeat(np.arange(parts.size), parts)
    number = np.arange(of.size) - (np.cumsum(parts) - parts)[of]
    step = ((spans.end - spans.begin) / parts)[of]
    begin = spans.begin[of] + number * step
    return Spans(spans.element[of], begin, begin + step)


def _distances(
    body: AuditedBody, around: Surroundings, elements: IntArray, shares: Array, within: float
) -> Array:
    """Distances (n,) [m] of a body at shares of elements to what stands still, or `within`."""
    poses = body.frames.at(elements, shares)
    low, high = body.height
    reach = np.add.outer([low, high], poses[:, 3:].sum(axis=1) + body.base)
    if not body.in_space and low == high == 0.0:
        reach[0], reach[1] = -math.inf, math.inf
    seen = poses[:, :3] + [body.offset.real, body.offset.imag, 0.0]
    return distances(
        body.outline, seen, reach, around.outline, around.heights, around.index, within
    )
