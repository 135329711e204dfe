"""Shapes, proofs that motions are free, and FCL, the authority."""

from __future__ import annotations

from maneuver_automaton.collision.motion import Motion as Motion
from maneuver_automaton.collision.shapes import AnyObstacle as AnyObstacle
from maneuver_automaton.collision.shapes import AnyShape as AnyShape
from maneuver_automaton.collision.shapes import Box as Box
from maneuver_automaton.collision.shapes import Disc as Disc
from maneuver_automaton.collision.shapes import Obstacle as Obstacle
from maneuver_automaton.collision.shapes import OccupancyMap as OccupancyMap
from maneuver_automaton.collision.shapes import Polygon as Polygon
from maneuver_automaton.collision.shapes import Shape as Shape
from maneuver_automaton.collision.shapes import as_footprint as as_footprint
from maneuver_automaton.collision.shapes import as_obstacles as as_obstacles
from maneuver_automaton.collision.shapes import as_shapes as as_shapes
from maneuver_automaton.collision.zones import Zone as Zone
