"""What places cost along a plan that was driven again: another integration, of other distances."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit._kernels_drive import evenly
from maneuver_automaton.audit._kernels_edges import distances
from maneuver_automaton.audit.arrays import Spans
from maneuver_automaton.audit.drive import DrivenPlan
from maneuver_automaton.audit.outlines import Surroundings
from maneuver_automaton.audit.passages import AuditedBody
from maneuver_automaton.places import Clearance, PlaceCost, jumps_along, rates_along

AGREED = 1e-3  # of the plan's whole cost, by which two integrations may differ
CLOSE = 2e-4  # of that cost: stretches are halved until what is still open is less
LONGEST = 0.75  # [s], [m] of a stretch, before any is halved
MOST_ROUNDS, MOST_SPANS = 22, 1 << 16
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

    By two rules on each stretch, which is halved where they differ, or an edge may be between.
    """
    # Without a piece it stands for the time of the plan, which may be none.
    lasting = np.diff(drive.frames.times) if drive.pieces.size else np.full(1, drive.plan.duration)

    def rates(spans: Spans) -> tuple[Array, Array]:
        shares = (spans.begin[:, None] + (spans.end - spans.begin)[:, None] * SHARES).ravel()
        element, paid = np.repeat(spans.element, SHARES.size), np.arange(shares.size)
        if isinstance(cost, Clearance):
            scene = around.outline, around.heights, around.index, cost.within
            apart = []
            for body in bodies:
                low, high = body.height
                levels = low + body.base, high + body.base
                if not body.in_space and low == high == 0.0:
                    levels = -math.inf, math.inf
                moves = body.frames.series, element, shares, body.offset
                apart.append(distances(body.outline, *moves, levels, *scene))
            near = 1.0 - np.minimum.reduce(apart) / cost.within
            found, paid = np.asarray(cost.weight * near * near), np.flatnonzero(near)
        twists, jumps = drive.twists_at(element[paid], shares[paid]), np.zeros(len(spans.begin))
        ways = np.delete(twists, 2, axis=1)
        paces = np.linalg.norm(ways, axis=1) if cost.per == "metre" else np.ones(paid.size)
        if not isinstance(cost, Clearance):
            poses = drive.frames.at(element, shares) + offset
            found = rates_along(cost, poses, twists)
            lines = poses[:, :2].reshape(-1, SHARES.size, 2)
            bent = lines - lines[:, :1] - SHARES[:, None] * (lines[:, -1:] - lines[:, :1])
            jumps = jumps_along(cost, lines, np.linalg.norm(bent, axis=2).max(axis=1))
            jumps *= paces.reshape(-1, SHARES.size).max(axis=1)
        found[paid] *= paces
        return found.reshape(-1, SHARES.size), jumps

    spans = evenly(np.maximum(lasting, lasting * drive.frames.speed) / LONGEST)
    done = 0.0
    for _ in range(MOST_ROUNDS):
        values, jumps = rates(spans)
        seconds = lasting[spans.element] * (spans.end - spans.begin)
        fine = values @ KRONROD * seconds
        off = np.abs(fine - values @ LOBATTO * seconds)
        hidden = 0.25 * seconds * jumps > CLOSE * whole  # no points are further apart
        if len(off) > MOST_SPANS or (off.sum() <= CLOSE * whole and not hidden.any()):
            break
        again = hidden | (off > 0.25 * CLOSE * whole / len(off))
        done += float(fine[~again].sum())
        fine, (element, begin, end) = fine[again], spans.of(again)
        begin, end = np.stack([begin, m := 0.5 * (begin + end), m, end], axis=1).reshape(-1, 2).T
        spans = Spans(np.repeat(element, 2), begin, end)
    return done + float(fine.sum())
