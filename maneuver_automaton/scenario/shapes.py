"""Bodies, obstacles, zones and what places cost, of a scenario file as values, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
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
from maneuver_automaton.formats import nav2_map
from maneuver_automaton.formats.statement import MapFile, simple_polygon
from maneuver_automaton.formats.yaml_source import Document, Where
from maneuver_automaton.places import Clearance, Ground, PlaceCost
from maneuver_automaton.scenario.parts import at, made, stated
from maneuver_automaton.scenario.schema import (
    ClearancePart,
    GroundPart,
    ObstaclePart,
    PricedCostPart,
    ZonePart,
)
from maneuver_automaton.scenario.vehicles import BodyShape

MOST_REGIONS = 64  # of one value in a mask: each is a zone with a distance field of its own


def footprint_of(document: Document, part: Any, *, key: str) -> tuple[Shape, ...]:
    """The body of a vehicle, or of what it carries, that stands at this key."""
    if part is None:
        return ()
    where: Where = ("vehicle", key)
    if isinstance(part, BodyShape):
        return (_shape(document, part, where),)
    return tuple(_shape(document, one, (*where, k)) for k, one in enumerate(part))


def obstacles_of(
    document: Document, parts: Sequence[ObstaclePart], folder: Path
) -> tuple[tuple[AnyObstacle, ...], tuple[MapFile, ...]]:
    """Obstacles, and the files of the maps among them; paths are relative to `folder`."""
    obstacles: list[AnyObstacle] = []
    maps = []
    for k, part in enumerate(parts):
        where: Where = ("obstacles", k)
        if part.map is not None:
            path = folder / part.map
            with at(document, (*where, "map"), files=True):
                cells = nav2_map.load_nav2_map(path, unknown=part.unknown)
            maps.append(MapFile(map=cells, path=path, unknown=part.unknown))
            obstacles.append(cells)
            continue
        motion = None
        if part.motion is not None:
            rows, key = np.array(part.motion), "motion" if part.twists is None else "twists"
            with at(document, (*where, key), about="motion"):
                motion = Motion(rows[:, 0], rows[:, 1:], part.twists)
        obstacles.append(
            Obstacle(
                _shape(document, part, where),
                height=part.height_m,
                motion=motion,
                present_s=part.present_s,
                name=f"obstacle {k + 1}",
            )
        )
    return tuple(obstacles), tuple(maps)


def _shape(document: Document, part: BodyShape | ObstaclePart | ZonePart, where: Where) -> Shape:
    """The shape of a body in the vehicle's frame, of an obstacle or of a zone."""
    if isinstance(part, BodyShape):
        if part.rectangle_m is not None:
            return Box(part.rectangle_m, 0.0 - np.array(part.reference_m or (0.0, 0.0)))
        if part.disc_m is not None:
            return Disc(part.disc_m)
    elif isinstance(part, ObstaclePart):
        if part.disc_m is not None:
            return Disc(part.disc_m.radius, part.disc_m.center)
        if part.box_m is not None:
            return Box(part.box_m.size, part.box_m.center, part.box_m.heading_rad)
    holes = () if isinstance(part, BodyShape) else part.holes_m
    assert part.polygon_m is not None
    with at(document, (*where, "polygon_m")):
        return simple_polygon(part.polygon_m, holes)


def zones_of(
    document: Document, parts: Sequence[ZonePart], folder: Path, *, fastest: float
) -> tuple[Zone, ...]:
    """Zones of a file; paths are relative to `folder`, and the `fastest` trim is 100 % [m/s]."""
    zones: list[Zone] = []
    for k, part in enumerate(parts):
        if part.map is not None:
            zones += _zones_of_mask(document, part, k, folder / part.map, fastest)
            continue
        shape = _shape(document, part, ("zones", k))
        with at(document, ("zones", k), about="zone"):
            zones.append(made(Zone, part, shape=shape, name=f"zone {k + 1}"))
    return tuple(zones)


def _zones_of_mask(
    document: Document, part: ZonePart, k: int, path: Path, fastest: float
) -> Iterator[Zone]:
    """A zone for each region of one value of a speed mask, read as Nav2's speed filter does."""
    # Source: nav2_costmap_2d, `SpeedFilter`: 0 is no limit, nor is a speed that is not above 0, or
    # of more than 100 %.
    limit = part.speed_limit
    if limit is None:
        raise document.error(("zones", k), "map: needs speed_limit: {base, multiplier, unit}")
    with at(document, ("zones", k, "map"), files=True):
        mask = nav2_map.load_nav2_mask(path)
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
    """A zone in the words of a scenario file."""
    shape = zone.shape
    if isinstance(shape, Disc):
        raise ValueError("zones: a scenario file states a zone by a polygon, not by a disc")
    corners = {"polygon_m": shape.corners.tolist(), **holes_entry(shape)}
    return stated(ZonePart, zone, **corners)


def holes_entry(shape: Box | Polygon) -> dict[str, Any]:
    """The holes of a shape, if it has any, as a key of a file."""
    rings = shape.holes if isinstance(shape, Polygon) else ()
    return {"holes_m": [ring.tolist() for ring in rings]} if rings else {}


def stated_footprint(footprint: Sequence[Shape]) -> tuple[dict[str, Any], ...]:
    """A body in the words of a scenario file, and of `plotting`."""
    entries: list[dict[str, Any]] = []
    for shape in footprint:
        if isinstance(shape, Box) and shape.heading == 0.0:
            entries.append({"rectangle_m": tuple(shape.size.tolist())})
            if shape.center.any():
                entries[-1]["reference_m"] = tuple((0.0 - shape.center).tolist())
        elif isinstance(shape, Disc):
            if shape.center.any():
                raise ValueError("footprint: a scenario file can state a disc around the pose only")
            entries.append({"disc_m": float(shape.radius)})
        elif holes_entry(shape):
            raise ValueError("footprint: a scenario file cannot state the holes of a body")
        else:
            entries.append({"polygon_m": tuple((x, y) for x, y in shape.corners.tolist())})
    return tuple(entries)


def stated_obstacle(obstacle: AnyObstacle, maps: Sequence[MapFile], folder: Path) -> dict[str, Any]:
    """An obstacle in the words of a scenario file in `folder`; a map by its file."""
    if isinstance(obstacle, OccupancyMap):
        for file in maps:
            if file.map is obstacle:
                path = relative(file.path, folder)
                return {"map": path} | ({"unknown": "free"} if file.unknown == "free" else {})
        raise ValueError(
            f"obstacles: a scenario file states a map by its file, and {obstacle.name!r} has none; "
            "write one with save_nav2_map"
        )
    entry: dict[str, Any] = {}
    shape = obstacle.shape
    if isinstance(shape, Disc):
        entry["disc_m"] = {"center": shape.center.tolist(), "radius": float(shape.radius)}
    elif isinstance(shape, Box):
        plain = str(shape.heading) == "0.0"  # -0.0 is not
        heading = {} if plain else {"heading_rad": float(shape.heading)}
        entry["box_m"] = {"center": shape.center.tolist(), "size": shape.size.tolist(), **heading}
    else:
        entry |= {"polygon_m": shape.corners.tolist(), **holes_entry(shape)}
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GroundFile:
    """Ground that a scenario file names by another file."""

    ground: Ground
    part: GroundPart
    path: Path
    walls: OccupancyMap | None = None  # of a costmap


def places_of(
    document: Document, part: PricedCostPart, folder: Path
) -> tuple[tuple[PlaceCost, ...], tuple[GroundFile, ...]]:
    """What the places of a file cost, and the files of it; paths are relative to `folder`."""
    costs: list[PlaceCost] = []
    files: list[GroundFile] = []
    if part.clearance is not None:
        with at(document, ("cost", "clearance")):
            costs.append(made(Clearance, part.clearance))
    for k, one in enumerate(part.ground):
        where: Where = ("cost", "ground", k)
        if one.polygon_m is not None:
            with at(document, (*where, "polygon_m")):
                area = simple_polygon(one.polygon_m, one.holes_m)
            costs.append(Ground(area, one.price, per=one.per))
            continue
        files.append(_of_file(document, one, where, folder))
        costs.append(files[-1].ground)
    return tuple(costs), tuple(files)


def _of_file(document: Document, part: GroundPart, where: Where, folder: Path) -> GroundFile:
    key = next(key for key in ("raster", "costmap", "elevation") if getattr(part, key) is not None)
    path = folder / getattr(part, key)
    if part.resolution_m is None:
        raise document.error(where, f"{key}: needs resolution_m, the size of a cell")
    if part.max_cross_slope is not None and key != "elevation":
        raise document.error((*where, "max_cross_slope"), "goes with elevation only")
    with at(document, (*where, key), files=True):
        values = _values(path, shades=255.0 if key == "costmap" else 1.0)
    more = {"max_cross_slope": part.max_cross_slope} if key == "elevation" else {"per": part.per}
    make: dict[str, Any] = {
        "raster": Ground.of_raster,
        "costmap": Ground.of_costmap,
        "elevation": Ground.of_elevation,
    }
    with at(document, (*where, key)):
        size = {"resolution": part.resolution_m, "origin": part.origin}
        found = make[key](values, price=part.price, **size, **more)
    ground, walls = found if key == "costmap" else (found, None)
    return GroundFile(ground=ground, part=part, path=path, walls=walls)


def _values(path: Path, *, shades: float) -> Array:
    """Numbers of an array of NumPy as it is, or an image's shades from 0 to `shades`, turned up."""
    if path.suffix != ".npy":
        return np.asarray(nav2_map.read_grey_image(path).shade[::-1] * shades)
    try:
        return np.asarray(np.load(path, allow_pickle=False))  # whose numbers the ground checks
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise InvalidScenario(f"{path}: cannot be read as an array of NumPy: {error}") from error


def stated_places(
    costs: Sequence[PlaceCost], files: Sequence[GroundFile], folder: Path
) -> dict[str, Any]:
    """Costs of places in the words of a scenario file in `folder`, beside the keys of the cost."""
    said: dict[str, Any] = {}
    ground: list[dict[str, Any]] = []
    for cost in costs:
        if isinstance(cost, Clearance) and "clearance" not in said:
            said["clearance"] = stated(ClearancePart, cost)
            continue
        if not isinstance(cost, Ground):
            what = type(cost).__name__
            raise ValueError(f"cost: a scenario file states one Clearance and Ground, not {what}")
        if cost.raster is None:
            for shape in cost.areas:
                if isinstance(shape, Disc):
                    raise ValueError(
                        "cost: a scenario file states ground by polygons, not by a disc"
                    )
                per = {} if cost.per == "metre" else {"per": cost.per}
                corners = {"polygon_m": shape.corners.tolist(), **holes_entry(shape)}
                ground.append({**corners, "price": cost.price, **per})
            continue
        known = next((one for one in files if one.ground is cost), None)
        if known is None:
            raise ValueError("cost: a scenario file states a raster by its file, this has none")
        entry = known.part.model_dump(exclude_none=True, exclude_defaults=True)
        key = next(key for key in ("raster", "costmap", "elevation") if key in entry)
        ground.append(entry | {key: relative(known.path, folder)})
    return said | ({"ground": ground} if ground else {})
