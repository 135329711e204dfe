"""A sentence on what a vehicle touches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from maneuver_automaton.audit.apart import directions, point_apart, points_of
from maneuver_automaton.audit.clearance import CONTACT
from maneuver_automaton.audit.pairs import instant, overlapped
from maneuver_automaton.audit.passages import Body, Pairs, bounds_of
from maneuver_automaton.audit.surroundings import Surroundings
from maneuver_automaton.collision.shapes import AnyObstacle, name_of


class Nearest(NamedTuple):
    """The edge that is nearest to a body at a time."""

    pairs: Pairs
    row: int
    obstacle: int
    distance: float  # [m]


def nearest_at(body: Body, around: Surroundings, time: float) -> Nearest:
    """The edge that is nearest at a time since the start [s]."""
    pairs = instant(body, around, time)
    known = bounds_of(body, around, pairs, overlaps=True)
    row, distance = int(np.argmin(known.measured)), float(known.measured.min())
    held = overlapped(body, around, pairs.places)
    if held >= 0:
        row, distance = int(np.flatnonzero(pairs.edge == held)[0]), 0.0
    return Nearest(pairs, row, int(around.owners[pairs.edge[row]]), distance)


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
    pairs, row, index, distance = nearest_at(body, around, time)
    point = _nearest_point(body, around, pairs, row) + complex(*origin)
    name = name_of(obstacles[index], index, f"({point.real:.10g}, {point.imag:.10g})")
    if distance <= CONTACT:
        return f"at {body.clock + time:.6g} s the vehicle touches {name}"
    near = f"the vehicle is {distance:.6g} m from {name}, closer than {margin:.6g} m"
    return f"at {body.clock + time:.6g} s {near}"


def _nearest_point(body: Body, around: Surroundings, pairs: Pairs, row: int) -> complex:
    """The point of the edge of a pair that is nearest to the body."""
    assert pairs.frames is not None
    edge, frame, places = pairs.edge[row], pairs.frames[row, 0], pairs.places
    a, b = around.outline.begins[edge], around.outline.ends[edge]
    there, turned = points_of(frame), directions(frame[2])
    along = b - a
    seen = (places.corners[0, :, 0] - there) * turned.conj()
    shares = ((seen - a) * along.conj()).real / max(float(np.abs(along)) ** 2, 1e-300)
    shares = np.concatenate([[0.0, 1.0], np.clip(shares, 0.0, 1.0)])
    world = there + turned * (a + shares * along)
    from_body = (world - places.place[0, 0]) * places.turn[0, 0].conj()
    own = body.outline.edges
    apart = np.sqrt(point_apart(from_body[:, None], own.begins, own.ends)) - own.radius
    best = world[int(np.argmin(apart.min(axis=1)))]
    return complex(np.round(best, 3)) + 0.0
