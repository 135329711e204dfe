"""Bodies and obstacles of a scenario file as shapes, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._files import relative
from maneuver_automaton.collision import (
    AnyObstacle,
    Box,
    Disc,
    Motion,
    Obstacle,
    OccupancyMap,
    Polygon,
    Shape,
    Zone,
)
from maneuver_automaton.collision.motion import STANDS
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.nav2_map import load_nav2_map, load_nav2_mask
from maneuver_automaton.formats.polygons import simple_polygon
from maneuver_automaton.formats.statement import MapFile
from maneuver_automaton.formats.yaml_source import Document, Where
from maneuver_automaton.scenario import schema, vehicle_parts
from maneuver_automaton.scenario.vehicle_parts import Footprint

MOST_REGIONS = 64  # of one value in a mask: each is a zone with a distance field of its own


def footprint_of(document: Document, part: Footprint | None, *, key: str) -> tuple[Shape, ...]:
    """The body of a vehicle, or of what it carries, that stands at this key.

    Raises
    ------
    InvalidScenario
        If a polygon is not simple.
    """
    if part is None:
        return ()
    where: Where = ("vehicle", key)
    if isinstance(part, vehicle_parts.Shape):
        return (_body_part(document, part, where),)
    return tuple(_body_part(document, one, (*where, k)) for k, one in enumerate(part))


def obstacles_of(
    document: Document, parts: Sequence[schema.Obstacle], folder: Path
) -> tuple[tuple[AnyObstacle, ...], tuple[MapFile, ...]]:
    """Obstacles, and the files of the maps among them; paths are relative to `folder`.

    Raises
    ------
    InvalidScenario
        If a polygon is not simple, or a map is missing or malformed.
    """
    obstacles: list[AnyObstacle] = []
    maps = []
    for k, part in enumerate(parts):
        if part.map is not None:
            maps.append(_map_file(document, part, k, folder))
            obstacles.append(maps[-1].map)
        else:
            obstacles.append(_obstacle(document, part, k))
    return tuple(obstacles), tuple(maps)


def zones_of(
    document: Document, parts: Sequence[schema.ZonePart], folder: Path, *, fastest: float
) -> tuple[Zone, ...]:
    """Zones of a file; paths are relative to `folder`, and the `fastest` trim is 100 % [m/s].

    Raises
    ------
    InvalidScenario
        If a polygon crosses itself, a zone forbids nothing, or a mask is missing or malformed.
    """
    zones: list[Zone] = []
    for k, part in enumerate(parts):
        if part.map is not None:
            zones += _zones_of_mask(document, part, k, folder / part.map, fastest)
            continue
        assert part.polygon_m is not None
        shape = _polygon(document, part.polygon_m, part.holes_m, ("zones", k, "polygon_m"))
        try:
            zones.append(
                Zone(
                    shape=shape,
                    max_speed=part.max_speed_m_s,
                    reverse=part.reverse,
                    max_lateral_acceleration=part.max_lateral_acceleration_m_s2,
                    trims=part.trims,
                    name=f"zone {k + 1}",
                )
            )
        except ValueError as error:
            raise document.error(("zones", k), str(error).removeprefix("zone: ")) from error
    return tuple(zones)


def _zones_of_mask(
    document: Document, part: schema.ZonePart, k: int, path: Path, fastest: float
) -> Iterator[Zone]:
    """A zone for each region of one value of a speed mask, read as Nav2's speed filter does.

    Source: nav2_costmap_2d, `SpeedFilter`: 0 is no limit, nor is a speed that is not above 0, or of
    more than 100 %.
    """
    limit = part.speed_limit
    if limit is None:
        raise document.error(("zones", k), "map: needs speed_limit: {base, multiplier, unit}")
    try:
        mask = load_nav2_mask(path)
    except InvalidScenario as error:
        raise document.error(("zones", k, "map"), str(error)) from error
    if unknown := int((mask.values < 0).sum()):
        raise document.error(
            ("zones", k, "map"), f"{path}: {unknown} cells are unknown, need a value in every cell"
        )
    found = mask.regions()
    if len(found) > MOST_REGIONS:
        raise document.error(
            ("zones", k, "map"),
            f"{path}: has {len(found)} regions of one value, need at most {MOST_REGIONS}",
        )
    percent = limit.unit == "percent"
    for value, polygon in found:
        speed = limit.base + limit.multiplier * value
        if speed > 0.0 and not (percent and speed > 100.0):
            speed *= fastest / 100.0 if percent else 1.0
            yield Zone(shape=polygon, max_speed=speed, name=f"zone {k + 1}, value {value}")


def stated_zone(zone: Zone) -> dict[str, Any]:
    """A zone in the words of a scenario file.

    Raises
    ------
    ValueError
        If its shape has no corners.

    Examples
    --------
    >>> stated_zone(Zone(shape=Polygon([[0, 0], [1, 0], [1, 1]]), max_speed=0.5))
    {'polygon_m': [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 'max_speed_m_s': 0.5}
    """
    shape = zone.shape
    if isinstance(shape, Disc):
        raise ValueError("zones: a scenario file states a zone by a polygon, not by a disc")
    entry: dict[str, Any] = {"polygon_m": shape.corners.tolist()}
    if isinstance(shape, Polygon) and shape.holes:
        entry["holes_m"] = [ring.tolist() for ring in shape.holes]
    if zone.max_speed is not None:
        entry["max_speed_m_s"] = float(zone.max_speed)
    if not zone.reverse:
        entry["reverse"] = False
    if zone.max_lateral_acceleration is not None:
        entry["max_lateral_acceleration_m_s2"] = float(zone.max_lateral_acceleration)
    if zone.trims is not None:
        entry["trims"] = list(zone.trims)
    return entry


def stated_footprint(footprint: Sequence[Shape]) -> tuple[dict[str, Any], ...]:
    """A body in the words of a scenario file, and of `plotting`.

    Raises
    ------
    ValueError
        If a file cannot state it: a disc beside the pose, or a hole.

    Examples
    --------
    >>> stated_footprint([Box([4.0, 2.0], [1.0, 0.0])])
    ({'rectangle_m': (4.0, 2.0), 'reference_m': (-1.0, 0.0)},)
    """
    return tuple(_stated_part(shape) for shape in footprint)


def stated_obstacle(obstacle: AnyObstacle, maps: Sequence[MapFile], folder: Path) -> dict[str, Any]:
    """An obstacle in the words of a scenario file in `folder`; a map by its file.

    Raises
    ------
    ValueError
        If a map has no file.
    """
    if isinstance(obstacle, OccupancyMap):
        for file in maps:
            if file.map is obstacle:
                path = relative(file.path, folder)
                return {"map": path} | ({"unknown": "free"} if file.unknown == "free" else {})
        raise ValueError(
            f"obstacles: a scenario file states a map by its file, and {obstacle.name!r} has none; "
            "write one with save_nav2_map"
        )
    entry = _stated_shape(obstacle.shape)
    if obstacle.height is not None:
        entry["height_m"] = [float(z) for z in obstacle.height]
    if obstacle.motion is not None and obstacle.motion is not STANDS:
        motion = obstacle.motion
        entry["motion"] = np.column_stack([motion.time, motion.pose]).tolist()
        if motion.twist is not None:
            entry["twists"] = motion.twist.tolist()
    if obstacle.present_s is not None:
        entry["present_s"] = [float(time) for time in obstacle.present_s]
    return entry


def _body_part(document: Document, part: vehicle_parts.Shape, where: Where) -> Shape:
    if part.rectangle_m is not None:
        reference = np.array(part.reference_m or (0.0, 0.0))
        return Box(part.rectangle_m, 0.0 - reference)
    if part.disc_m is not None:
        return Disc(part.disc_m)
    assert part.polygon_m is not None
    return _polygon(document, part.polygon_m, (), (*where, "polygon_m"))


def _obstacle(document: Document, part: schema.Obstacle, k: int) -> Obstacle:
    motion = None
    if part.motion is not None:
        rows = np.array(part.motion)
        try:
            motion = Motion(rows[:, 0], rows[:, 1:], part.twists)
        except ValueError as error:
            where = ("obstacles", k, "motion" if part.twists is None else "twists")
            raise document.error(where, str(error).removeprefix("motion: ")) from error
    return Obstacle(
        _shape(document, part, ("obstacles", k)),
        height=part.height_m,
        motion=motion,
        present_s=part.present_s,
        name=f"obstacle {k + 1}",
    )


def _shape(document: Document, part: schema.Obstacle, where: Where) -> Shape:
    if part.disc_m is not None:
        return Disc(part.disc_m.radius, part.disc_m.center)
    if part.box_m is not None:
        return Box(part.box_m.size, part.box_m.center, part.box_m.heading_rad)
    assert part.polygon_m is not None
    return _polygon(document, part.polygon_m, part.holes_m, (*where, "polygon_m"))


def _polygon(document: Document, corners: Any, holes: Any, where: Where) -> Polygon:
    try:
        return simple_polygon(corners, holes)
    except ValueError as error:
        raise document.error(where, str(error)) from error


def _map_file(document: Document, part: schema.Obstacle, k: int, folder: Path) -> MapFile:
    assert part.map is not None
    path = folder / part.map
    try:
        cells = load_nav2_map(path, unknown=part.unknown)
    except InvalidScenario as error:
        raise document.error(("obstacles", k, "map"), str(error)) from error
    return MapFile(map=cells, path=path, unknown=part.unknown)


def _stated_part(shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Box) and shape.heading == 0.0:
        entry: dict[str, Any] = {"rectangle_m": tuple(shape.size.tolist())}
        if shape.center.any():
            entry["reference_m"] = tuple((0.0 - shape.center).tolist())
        return entry
    if isinstance(shape, Disc):
        if shape.center.any():
            raise ValueError("footprint: a scenario file can state a disc around the pose only")
        return {"disc_m": float(shape.radius)}
    if isinstance(shape, Polygon) and shape.holes:
        raise ValueError("footprint: a scenario file cannot state the holes of a body")
    return {"polygon_m": tuple((x, y) for x, y in shape.corners.tolist())}


def _stated_shape(shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Disc):
        return {"disc_m": {"center": shape.center.tolist(), "radius": float(shape.radius)}}
    if isinstance(shape, Box):
        plain = str(shape.heading) == "0.0"  # -0.0 is not
        heading = {} if plain else {"heading_rad": float(shape.heading)}
        return {"box_m": {"center": shape.center.tolist(), "size": shape.size.tolist(), **heading}}
    holes = {"holes_m": [ring.tolist() for ring in shape.holes]} if shape.holes else {}
    return {"polygon_m": shape.corners.tolist(), **holes}
