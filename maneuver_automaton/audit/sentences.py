"""A sentence on what a vehicle touches."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.apart import point_apart
from maneuver_automaton.audit.clearance import CONTACT
from maneuver_automaton.audit.pairs import instant, overlapped, spans_within
from maneuver_automaton.audit.passages import (
    Body,
    bounds_of,
    corners_of,
    placed_at,
    poses_of,
    seen_from,
)
from maneuver_automaton.audit.surroundings import Surroundings
from maneuver_automaton.collision.shapes import AnyObstacle, name_of


def what_is_hit(
    body: Body,
    around: Surroundings,
    obstacles: tuple[AnyObstacle, ...],
    *,
    time: float,
    margin: float,
    origin: tuple[float, float],
) -> str:
    """A sentence on the obstacle that is nearest at a time since the start [s]."""
    pairs = instant(body, around, time)
    known = bounds_of(body, around, pairs, overlaps=True)
    row, distance = int(np.argmin(known.measured)), float(known.measured.min())
    held = overlapped(body, around, spans_within(body, time, time))
    if held >= 0 and body.frames.series.shape[2] == 3:
        row, distance = int(np.flatnonzero(pairs.edge == held)[0]), 0.0
    index = int(around.owners[pairs.edge[row]])
    assert pairs.frames is not None
    x, y = _nearest_point(body, around, pairs.edge[row], pairs.frames[row, :1], time) + origin
    name = name_of(obstacles[index], index, f"({x:.10g}, {y:.10g})")
    if distance <= CONTACT:
        return f"at {body.clock + time:.6g} s the vehicle touches {name}"
    near = f"the vehicle is {distance:.6g} m from {name}, closer than {margin:.6g} m"
    return f"at {body.clock + time:.6g} s {near}"


def _nearest_point(body: Body, around: Surroundings, edge: int, frame: Array, time: float) -> Array:
    """The point (2,) of an edge, its frame at a pose (1, 3), that is nearest to the body."""
    a, b = around.outline.begins[edge], around.outline.ends[edge]
    pose = poses_of(body, spans_within(body, time, time))[0]
    x, y = seen_from(frame, corners_of(body, pose))
    along = b - a
    shares = ((x[0] - a[0]) * along[0] + (y[0] - a[1]) * along[1]) / max(along @ along, 1e-300)
    shares = np.concatenate([[0.0, 1.0], np.clip(shares, 0.0, 1.0)])
    world = placed_at(frame, (a[0] + shares * along[0], a[1] + shares * along[1]))
    seen_x, seen_y = seen_from(pose, world)
    sides = (tuple(body.outline.begins.T), tuple(body.outline.ends.T))
    apart = point_apart((seen_x.T, seen_y.T), *sides)
    best = int(np.argmin((np.sqrt(apart) - body.outline.radius).min(axis=1)))
    return np.round([world[0][0, best], world[1][0, best]], 3) + 0.0
