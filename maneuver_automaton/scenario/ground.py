"""What places cost in a scenario file: clearance, priced areas, rasters; and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import relative
from maneuver_automaton.collision import Disc, OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.cells import read_grey_image
from maneuver_automaton.formats.polygons import simple_polygon
from maneuver_automaton.formats.yaml_source import Document, Where
from maneuver_automaton.places import Clearance, Ground, PlaceCost
from maneuver_automaton.scenario.parts import at, made, stated
from maneuver_automaton.scenario.schema import ClearancePart, GroundPart, PricedCostPart
from maneuver_automaton.scenario.shapes import holes_entry


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GroundFile:
    """Ground that a scenario file names by another file."""

    ground: Ground
    part: GroundPart
    path: Path
    walls: OccupancyMap | None = None  # of a costmap


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StatedPlaces:
    """Costs of places of a file, the files among them, and the obstacles of its costmaps."""

    costs: tuple[PlaceCost, ...] = ()
    files: tuple[GroundFile, ...] = ()

    @property
    def walls(self) -> tuple[OccupancyMap, ...]:
        """What the costmaps block."""
        return tuple(one.walls for one in self.files if one.walls is not None)


def places_of(document: Document, part: PricedCostPart, folder: Path) -> StatedPlaces:
    """What the places of a file cost; paths are relative to `folder`."""
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
    return StatedPlaces(costs=tuple(costs), files=tuple(files))


def _of_file(document: Document, part: GroundPart, where: Where, folder: Path) -> GroundFile:
    key = next(key for key in ("raster", "costmap", "elevation") if getattr(part, key) is not None)
    path = folder / getattr(part, key)
    if part.resolution_m is None:
        raise document.error(where, f"{key}: needs resolution_m, the size of a cell")
    if part.max_cross_slope is not None and key != "elevation":
        raise document.error((*where, "max_cross_slope"), "goes with elevation only")
    with at(document, (*where, key), files=True):
        values = _values(path, shades=255.0 if key == "costmap" else 1.0)
    more: dict[str, Any] = {"price": part.price}
    if key == "elevation":
        more["max_cross_slope"] = part.max_cross_slope
    else:
        more["per"] = part.per
    make: dict[str, Any] = {
        "raster": Ground.of_raster,
        "costmap": Ground.of_costmap,
        "elevation": Ground.of_elevation,
    }
    with at(document, (*where, key)):
        found = make[key](values, resolution=part.resolution_m, origin=part.origin, **more)
    ground, walls = found if key == "costmap" else (found, None)
    return GroundFile(ground=ground, part=part, path=path, walls=walls)


def _values(path: Path, *, shades: float) -> Array:
    """Numbers of an array of NumPy as it is, or an image's shades from 0 to `shades`, turned up."""
    if path.suffix != ".npy":
        return np.asarray(read_grey_image(path).shade[::-1] * shades)
    try:
        values = np.load(path, allow_pickle=False)
        return np.asarray(values, dtype=np.float64)
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
