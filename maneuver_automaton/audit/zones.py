"""Zones that a drive is in while it moves as they do not admit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.clearance import CONTACT, NEVER, least_clearance
from maneuver_automaton.audit.drive import Drive
from maneuver_automaton.audit.frames import Spans
from maneuver_automaton.audit.passages import Body
from maneuver_automaton.audit.surroundings import surroundings_around
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.primitives import Trim

EXCEEDED = 1e-9  # relative, by which a limit may be exceeded


def zones_broken(
    drive: Drive, bodies: Sequence[Body], zones: tuple[Zone, ...], origin: tuple[float, float]
) -> list[str]:
    """Which zones a vehicle is in, with any part, while it moves as they do not admit."""
    if not (zones and drive.ends.size):
        return []
    reasons = []
    spans, pieces = drive.between_samples()
    ends = np.concatenate([spans.begin, spans.end])
    twists = drive.twists_at(np.tile(spans.element, 2), ends)
    for zone in zones:
        admitted = _admitted(zone, twists).reshape(2, -1).all(axis=0) & _named(drive, zone)[pieces]
        around = surroundings_around((Obstacle(zone.shape),), origin)
        found = [
            least_clearance(body, around, run) for run in _runs(spans, ~admitted) for body in bodies
        ]
        least = min(found, key=lambda one: one.distance, default=NEVER)
        if not least.distance > CONTACT:
            reasons.append(
                f"at {least.time:.6g} s the vehicle moves as {zone.words} does not admit"
            )
    return reasons


def _runs(spans: Spans, kept: NDArray[np.bool_]) -> Iterator[Spans]:
    """Runs of stretches that are kept, each without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        yield spans.of(slice(first, last))


def _admitted(zone: Zone, twists: Array) -> NDArray[np.bool_]:
    """Whether a zone's limits admit twists (m, dof)."""
    speed = np.hypot(twists[:, 0], twists[:, 1])
    good = np.ones(speed.size, dtype=np.bool_)
    if zone.max_speed is not None:
        good &= speed <= zone.max_speed * (1.0 + EXCEEDED) + EXCEEDED
    if zone.max_lateral_acceleration is not None:
        most = zone.max_lateral_acceleration * (1.0 + EXCEEDED) + EXCEEDED
        good &= speed * np.abs(twists[:, 2]) <= most
    if not zone.reverse:
        good &= twists[:, 0] >= -EXCEEDED
    return good


def _named(drive: Drive, zone: Zone) -> NDArray[np.bool_]:
    """Whether a zone admits each primitive by its names."""
    names = [
        {one.name} if isinstance(one, Trim) else {one.source, one.target}
        for one in drive.plan.primitives
    ]
    return np.array([zone.trims is None or one <= set(zone.trims) for one in names])
