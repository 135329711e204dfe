"""Tracks, bodies, goals and obstacles as numbers from which the browser computes what it draws.

Places are counted from near the start, and all is rounded to what can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import AnyObstacle, Disc, Obstacle, OccupancyMap, Polygon, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, rings_of
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.plotting.obstacles import bound_lines, map_paths
from maneuver_automaton.plotting.over_time import labels_of, thinned
from maneuver_automaton.plotting.track import (
    Track,
    TrackPiece,
    footprint_polygons,
    solids_at,
    step_curves,
)
from maneuver_automaton.problem import Bounds, Goal
from maneuver_automaton.recording import Mover

POSE_DIGITS, PLACE_DIGITS, VALUE_DIGITS = 9, 4, 5  # decimals
ONE_TWIST = 1e-9  # [m, rad] a piece is one arc where its twist meets all samples so closely
TURN = 0.05  # [rad] of an obstacle that moves on an arc, between two of its poses


@dataclass(frozen=True, slots=True, eq=False)
class Local:
    """Coordinates from an `origin` (2,) [m]: browsers draw with single precision."""

    origin: Array

    def poses(self, poses: Array) -> list[Any]:
        """Poses (..., dof) as lists, exact enough to compute with."""
        near = np.array(poses, dtype=np.float64)
        near[..., :2] -= self.origin
        return rounded(near, POSE_DIGITS)

    def places(self, places: Array) -> list[Any]:
        """Places (..., 2) as lists, exact enough to draw."""
        return rounded(np.asarray(places) - self.origin, PLACE_DIGITS)


def rounded(values: Array | Sequence[float], digits: int = VALUE_DIGITS) -> list[Any]:
    """Numbers (...,) as lists with so many decimals; no negative zero."""
    numbers: list[Any] = (np.round(np.asarray(values, dtype=np.float64), digits) + 0.0).tolist()
    return numbers


def hex_color(color: Sequence[float]) -> str:
    """A colour as the browser reads it."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)


def motion_entry(track: Track, local: Local, names: Mapping[str, int]) -> dict[str, Any]:
    """Arcs of a `track`: begin time, first pose, twist, and which of the `names` it belongs to.

    A trim is one arc; a maneuver is one for each step between its samples, as `Plan.pose_at` has
    it. `times` and `poses` have one entry more than `twists`: where the last arc ends.
    """
    times: list[float] = []
    poses: list[Array] = []
    twists: list[Array] = []
    trims: list[int] = []
    for piece in track.pieces:
        for begin, pose, twist in _arcs(piece):
            times.append(begin)
            poses.append(pose)
            twists.append(twist)
            trims.append(names[piece.name])
    times.append(float(track.pieces[-1].time[-1]) if track.pieces else 0.0)
    poses.append(track.end)
    return {
        "times": rounded(times, POSE_DIGITS),
        "poses": local.poses(np.array(poses)),
        "twists": rounded(np.array(twists), POSE_DIGITS) if twists else [],
        "trims": trims,
    }


def curve_entries(track: Track, mover: Mover) -> list[dict[str, Any]]:
    """Reduced state and controls of a `track` over time, each with its label."""
    if not track.pieces:
        return []
    states, controls = labels_of(mover, track.pieces[0])
    curves = [
        np.concatenate([np.stack([one.time, one.state[:, k]], axis=-1) for one in track.pieces])
        for k in range(len(states))
    ]
    curves += [np.concatenate(step_curves(track, k)) for k in range(len(controls))]
    rows = zip([*states, *controls], curves, strict=True)
    return [{"label": label, **_curve(curve)} for label, curve in rows]


def part_entries(track: Track, model: Model, names: Sequence[str]) -> list[dict[str, Any]]:
    """Poses in time of the parts that a vehicle carries, seen from its body."""
    time = np.concatenate([piece.time for piece in track.pieces])
    poses = np.asarray(model.part_poses(np.concatenate([piece.state for piece in track.pieces])))
    return [
        {"t": rounded(time, POSE_DIGITS), "pose": rounded(poses[:, k])} for k in range(len(names))
    ]


def _arcs(piece: TrackPiece) -> list[tuple[float, Array, Array]]:
    """Begin, first pose and twist of the arcs of a piece."""
    group = group_of(piece.pose.shape[1])
    since = (piece.time - piece.time[0])[:, None]
    along = (group(piece.pose[0]) @ group.exp(since * piece.twist)).pose
    if np.abs(along - piece.pose).max() <= ONE_TWIST:
        return [(float(piece.time[0]), piece.pose[0], piece.twist)]
    steps = (group(piece.pose[:-1]).inverse() @ group(piece.pose[1:])).log()
    spans = np.diff(piece.time)
    return [
        (float(piece.time[k]), piece.pose[k], steps[k] / spans[k])
        for k in np.flatnonzero(spans > 0.0).tolist()
    ]


def _curve(curve: Array) -> dict[str, list[float]]:
    """Corners of a curve (n, 2) over time, without those on a line of constant value."""
    flat = np.zeros(len(curve), dtype=np.bool_)
    flat[1:-1] = (curve[1:-1, 1] == curve[:-2, 1]) & (curve[1:-1, 1] == curve[2:, 1])
    kept = curve[~flat]
    return {"t": rounded(kept[:, 0]), "v": rounded(kept[:, 1])}


def obstacle_entries(obstacles: Iterable[AnyObstacle], local: Local, *, leave: bool) -> list[Any]:
    """Static and moving obstacles; with `leave`, a moving one is there for its motion only."""
    return [
        {
            "name": one.name,
            "origin": local.poses(one.origin),
            "cell": one.resolution,
            "cells": blocked_rectangles(one.blocked).ravel().tolist(),
        }
        if isinstance(one, OccupancyMap)
        else _obstacle_entry(one, local, leave=leave)
        for one in obstacles
    ]


def limit_entries(zones: Sequence[Zone], bounds: Bounds, local: Local) -> dict[str, Any]:
    """Zones, each with what it asks for, and lines along the bounds of the pose."""
    return {
        "zones": [
            {
                "name": f"zone: {zone.asks}",
                "rings": [local.places(ring) for ring in shape_rings(zone.shape)],
            }
            for zone in zones
        ],
        "bounds": [local.places(line) for line in bound_lines(bounds)],
    }


def goal_entries(goals: Sequence[Goal], local: Local, reached: int | None) -> list[Any]:
    """Goals, and which of them is reached."""
    return [
        {
            "pose": local.poses(goal.pose),
            "free": goal.free_heading,
            "tolerance": goal.tolerance_m,
            "reached": reached is None or k == reached,
        }
        for k, goal in enumerate(goals)
    ]


def body_entries(bodies: Mapping[str, Sequence[Shape]]) -> list[Any]:
    """Outlines of the body, in frame 0, and of what it carries, in frames from 1 on."""
    outlines = [
        (k, ring) for k, shapes in enumerate(bodies.values()) for ring in footprint_polygons(shapes)
    ]
    return [
        {
            "frame": frame,
            "ring": rounded(ring, PLACE_DIGITS),
            "convex": [
                rounded(corners, PLACE_DIGITS) for corners, _ in convex_pieces(Polygon(ring))
            ],
        }
        for frame, ring in outlines
    ]


def shape_rings(shape: Shape) -> list[Array]:
    """Rings (n, 2) around a shape and its holes; a disc has many corners."""
    if isinstance(shape, Disc):
        return footprint_polygons([shape])
    return [ring for part in outlines(shape) for ring in rings_of(part)]


def _obstacle_entry(one: Obstacle, local: Local, *, leave: bool) -> dict[str, Any]:
    rings = shape_rings(one.shape)
    entry: dict[str, Any] = {"name": one.name}
    if one.height is not None:
        entry["height"] = list(one.height)
    if one.motion is None:
        return entry | {"rings": [local.places(ring) for ring in rings]}
    if one.present_s is not None:
        entry["present"] = [time if math.isfinite(time) else None for time in one.present_s]
    times = one.motion.times_for_lines(TURN)
    return entry | {
        "rings": [rounded(ring, PLACE_DIGITS) for ring in rings],
        "t": rounded(times, POSE_DIGITS),
        "pose": local.poses(one.motion.at(times)),
        "leaves": leave,
    }


MOST_SAMPLES = 400
DISC_SEGMENTS = 32  # of a quarter: a disc of 1 m is off by 0.3 mm


def sample_times(switching_times: Array) -> Array:
    """Times (n,) at which a clearance is measured: evenly, and at every switch."""
    if not switching_times.size:
        return np.zeros(1)
    return np.union1d(
        np.linspace(switching_times[0], switching_times[-1], MOST_SAMPLES), switching_times
    )


def clearance_entry(
    times: Array,
    bodies: Sequence[tuple[Array, Array]],
    obstacles: Sequence[AnyObstacle],
    *,
    heights: Array | None = None,
    leave: bool = False,
) -> dict[str, Any] | None:
    """Least distance at each of the `times` (n,) [s]; None if there is never an obstacle."""
    if not obstacles:
        return None
    placed = [solids_at(ring, poses) for ring, poses in bodies]
    least = np.full(len(times), np.inf)
    flat: list[Any] = []
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            flat += [shapely.Polygon(p) for path in map_paths(one) for p in path.to_polygons()]
        elif one.motion is None and (heights is None or one.height is None):
            flat += list(_solid(one.shape))
        else:
            first, last = one.lasts(fleeting=leave)
            apart = _apart(placed, _solid(one.shape) if one.motion is None else _moved(one, times))
            if heights is not None and one.height is not None:
                below, above = one.height[0] - heights[:, 1], heights[:, 0] - one.height[1]
                apart = np.hypot(apart, np.maximum(np.maximum(below, above), 0.0))
            there = (times >= first) & (times <= last)
            least = np.minimum(least, np.where(there, apart, np.inf))
    if flat:
        tree = shapely.STRtree(flat)
        for body in placed:
            (asked, _), found = tree.query_nearest(body, return_distance=True, all_matches=False)
            least[asked] = np.minimum(least[asked], found)
    known = np.isfinite(least)
    if not known.any():
        return None
    return {"t": rounded(times[known], POSE_DIGITS), "v": rounded(least[known], 4)}


def _apart(placed: Sequence[Any], geometries: Sequence[Any]) -> Array:
    """Least distance (n,) between any of the bodies and any of the geometries, each one or (n,)."""
    each = [shapely.distance(body, one) for body in placed for one in geometries]
    return np.asarray(np.min(each, axis=0))


def _solid(shape: Shape) -> list[Any]:
    if isinstance(shape, Disc):
        return [shapely.Point(shape.center).buffer(shape.radius, quad_segs=DISC_SEGMENTS)]
    return outlines(shape)


def _moved(one: Obstacle, times: Array) -> list[Any]:
    """Parts of a moving obstacle, each as a geometry (n,) at the times."""
    assert one.motion is not None
    frames = SE2(one.motion.at(times)[:, None])
    return [
        shapely.polygons(frames.act(shapely.get_coordinates(part.exterior)))
        for part in _solid(one.shape)
    ]


def distance_curve(times: Array, distances: Array) -> dict[str, Any] | None:
    """Least distances over time; None if there never is another."""
    known = np.isfinite(distances)
    if not known.any():
        return None
    at, least = thinned(times[known], distances[known], most=MOST_SAMPLES)
    return {"t": rounded(at, POSE_DIGITS), "v": rounded(least, 4)}
