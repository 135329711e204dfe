"""Obstacles, goals and bodies as numbers that the browser draws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import AnyObstacle, Disc, Obstacle, OccupancyMap, Polygon, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import outlines, rings_of
from maneuver_automaton.collision.rectangles import blocked_rectangles
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.plotting.footprint import footprint_polygons
from maneuver_automaton.plotting.limits import bound_lines
from maneuver_automaton.plotting.player.local import PLACE_DIGITS, POSE_DIGITS, Local, rounded
from maneuver_automaton.problem import Bounds, Goal

TURN = 0.05  # [rad] of an obstacle that moves on an arc, between two of its poses


def obstacle_entries(obstacles: Iterable[AnyObstacle], local: Local, *, leave: bool) -> list[Any]:
    """Static and moving obstacles; with `leave`, a moving one is there for its motion only."""
    return [
        _map_entry(one, local)
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


def body_entries(footprint: Any, parts: Mapping[str, Sequence[Shape]]) -> list[Any]:
    """Outlines of the body, in frame 0, and of what it carries, in frames from 1 on."""
    outlines = [(0, ring) for ring in footprint_polygons(footprint)]
    for k, shapes in enumerate(parts.values()):
        outlines += [(k + 1, ring) for ring in footprint_polygons(list(shapes))]
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
        return footprint_polygons(shape)
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


def _map_entry(cells: OccupancyMap, local: Local) -> dict[str, Any]:
    """Blocked cells as rectangles [low column, low row, high column, high row]."""
    return {
        "name": cells.name,
        "origin": local.poses(cells.origin),
        "cell": cells.resolution,
        "cells": blocked_rectangles(cells.blocked).ravel().tolist(),
    }
