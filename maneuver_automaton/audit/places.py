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
from maneuver_automaton.places import Clearance, Ground, PlaceCost, rates_along

AGREED = 1e-3  # of the plan's whole cost, by which two integrations may differ
CLOSE = 2e-4  # of that cost: stretches are halved until what is still open is less
LONGEST = 0.75  # [s], [m] of a stretch, before any is halved
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
    # Without a piece it stands for the time of the plan, which may be none.
    lasting = np.diff(drive.frames.times) if drive.pieces.size else np.full(1, drive.plan.duration)

    def rates(spans: Spans) -> Array:
        shares = (spans.begin[:, None] + (spans.end - spans.begin)[:, None] * SHARES).ravel()
        element = np.repeat(spans.element, SHARES.size)
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
        else:
            found, paid = np.empty(shares.size), np.arange(shares.size)
        twists = drive.twists_at(element[paid], shares[paid])
        if not isinstance(cost, Clearance):
            found = rates_along(cost, drive.frames.at(element, shares) + offset, twists)
        if cost.per == "metre":
            found[paid] *= np.sqrt((np.delete(twists, 2, axis=1) ** 2).sum(axis=1))
        return found.reshape(-1, SHARES.size)

    spans = evenly(np.maximum(lasting, lasting * drive.frames.speed) / LONGEST)
    done = 0.0
    for _ in range(MOST_ROUNDS):
        values = rates(spans)
        seconds = lasting[spans.element] * (spans.end - spans.begin)
        fine = values @ KRONROD * seconds
        off = np.abs(fine - values @ LOBATTO * seconds)
        hides = np.zeros(len(off), dtype=bool)
        if isinstance(cost, Ground):
            middles = drive.frames.at(spans.element, 0.5 * (spans.begin + spans.end)) + offset
            ways = seconds * drive.frames.speed[spans.element]
            hides = cost.unseen(middles[:, :2], ways, seconds) > CLOSE * whole
        if off.sum() <= CLOSE * whole and not hides.any():
            return done + float(fine.sum())
        again = hides | (off > 0.25 * CLOSE * whole / len(off))
        done += float(fine[~again].sum())
        rest, fine = spans.of(again), fine[again]
        middle = 0.5 * (rest.begin + rest.end)
        spans = Spans(
            np.repeat(rest.element, 2),
            np.stack([rest.begin, middle], axis=1).ravel(),
            np.stack([middle, rest.end], axis=1).ravel(),
        )
    return done + float(fine.sum())
