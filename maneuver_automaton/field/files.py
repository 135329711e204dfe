"""Fields from files, YAML or GeoJSON, and covered ones as GeoJSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field

from maneuver_automaton._brief import brief
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.exports.earth import metres_of
from maneuver_automaton.exports.geojson import save_features
from maneuver_automaton.field.covering import FieldProblem, FieldResult
from maneuver_automaton.formats.statement import simple_polygon
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import Document, parse
from maneuver_automaton.models import Model
from maneuver_automaton.planning import Planner
from maneuver_automaton.scenario.parts import (
    FilePart,
    Number,
    Polygon,
    Polygons,
    Positive,
    at,
    checked,
    optional,
)
from maneuver_automaton.scenario.scenario import scenario_of_document

GEOJSON = (".geojson", ".json")
TIME_LIMIT_S = 1.0  # for each turn, where nothing is stated


class FieldPart(FilePart):
    """What is to be covered: `field` of a file, which has neither start nor goal."""

    polygon_m: Polygon | None = optional("corners [x, y]; left out where GeoJSON has them")
    holes_m: Polygons = Field((), description="polygons inside polygon_m that are not entered")
    width_m: Positive | None = optional("working width")
    headland_m: Positive | None = optional("width of the strip to turn in; left out: chosen")
    direction_rad: Number | None = optional("of the swaths; left out: the best of the edges'")


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldScenario:
    """A field that files state, who covers it, and where on the Earth it is."""

    name: str
    problem: FieldProblem
    time_limit_s: float  # for each turn
    origin: tuple[float, float] | None = None  # latitude and longitude [deg]

    __repr__ = brief


def load_field(
    path: Path,
    *,
    beside: Path | None = None,
    origin: tuple[float, float] | None = None,
    model: Model | None = None,
    **stated: float | None,
) -> FieldScenario:
    """The field of a file: a scenario with `field` in place of start and goal, or GeoJSON.

    Of GeoJSON the scenario `beside` it states the vehicle. Its polygon is in degrees, unless it has
    a `crs` or `units` that say metres; the `origin` is in the middle of it if none is given.
    `stated` are width_m, headland_m and direction_rad that go before those of the file.

    Raises
    ------
    InvalidScenario
        If a file cannot be read or used.
    """
    in_degrees = path.suffix.lower() in GEOJSON
    if in_degrees == (beside is None):
        what = (
            "GeoJSON states no vehicle, need --with" if in_degrees else "states its vehicle itself"
        )
        raise InvalidScenario(f"{path}: {what}{'' if in_degrees else '; leave --with out'}")
    document = parse(read_text(beside or path), name=str(beside or path))
    part, rest = _parted(document)
    found = {**part.model_dump(exclude_none=True)}
    if in_degrees:
        ground, origin = _polygon_of(path, origin)
        found |= ground
    found |= {key: value for key, value in stated.items() if value is not None}
    if "polygon_m" not in found:
        raise document.error(("field",), "polygon_m is missing, need the corners of the field")
    if "width_m" not in found:
        raise InvalidScenario(f"{path}: width_m: missing, need the working width, or --width")
    scenario = scenario_of_document(rest, path=beside or path, begin=0.0, own=model)
    planner = Planner(
        **{
            one.name: getattr(scenario.problem, one.name)
            for one in fields(Planner)
            if one.init and one.name != "start_trim"
        }
    )
    with at(document, ("field",) if "field" in document.value else ()):
        problem = FieldProblem(
            planner,
            simple_polygon(found["polygon_m"], found["holes_m"]),
            width=found["width_m"],
            headland=found.get("headland_m", 0.0),
            direction=found.get("direction_rad"),
        )
        _ = problem.inner
    limited = "time_limit_s" in (document.value.get("search") or {})
    return FieldScenario(
        name=scenario.name if not in_degrees else path.stem,
        problem=problem,
        time_limit_s=scenario.time_limit_s if limited else TIME_LIMIT_S,
        origin=origin,
    )


def _parted(document: Document) -> tuple[FieldPart, Document]:
    """The field of a file, and the rest as a scenario, whose start and goal nobody asks for."""
    whole = document.value
    if not isinstance(whole, dict):
        raise document.error((), "is no mapping, need a scenario with the key 'field'")
    if "field" in whole and (ends := {"start", "goal"} & set(whole)):
        raise document.error((min(ends),), "is for plan; a field has none, leave it out")
    part = FieldPart()
    if "field" in whole:
        part = checked(replace(document, value=whole["field"], homes={(): ("field",)}), FieldPart)
    nowhere = {"pose": [0.0, 0.0, 0.0]}
    rest = {"start": nowhere, "goal": nowhere} | {k: v for k, v in whole.items() if k != "field"}
    return part, replace(document, value=rest)


def _polygon_of(
    path: Path, origin: tuple[float, float] | None
) -> tuple[dict[str, Any], tuple[float, float] | None]:
    """The one polygon of a GeoJSON file with its properties, in metres, and their origin."""
    try:
        document = json.loads(read_text(path))
        listed = document["features"] if document["type"] == "FeatureCollection" else [document]
        areas = [
            (one.get("geometry", one)["coordinates"], one.get("properties") or {})
            for one in listed
            if one.get("geometry", one)["type"] == "Polygon"
        ]
        if len(areas) != 1:
            raise InvalidScenario(f"{path}: has {len(areas)} polygons, need one, the field")
        ((coordinates, properties),) = areas
        rings = [np.array(ring, dtype=np.float64)[:, :2] for ring in coordinates]
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InvalidScenario(f"{path}: is no GeoJSON with a polygon: {error}") from error
    if not ("crs" in document or document.get("units") == "m"):
        low, high = rings[0].min(axis=0), rings[0].max(axis=0)
        middle = np.round(0.5 * (low + high), 6)
        origin = origin or (float(middle[1]), float(middle[0]))
        try:
            rings = [metres_of(ring, origin=origin) for ring in rings]
        except ValueError as error:
            raise InvalidScenario(f"{path}: {error}") from error
    keys = ("width_m", "headland_m", "direction_rad")
    known = {key: float(properties[key]) for key in keys if key in properties}
    return {"polygon_m": rings[0], "holes_m": rings[1:], **known}, origin


def save_field_geojson(
    covered: FieldResult, path: Path, *, name: str, origin: tuple[float, float] | None = None
) -> None:
    """Write field, inner part, swaths and turns as GeoJSON: `kind` tells them apart."""
    save_features(_features(covered), path, name=name, origin=origin)


def _features(covered: FieldResult) -> Iterator[dict[str, Any]]:
    problem = covered.problem

    def feature(geometry: Any, **facts: Any) -> dict[str, Any]:
        drawn = json.loads(shapely.to_geojson(geometry))
        return {"type": "Feature", "properties": facts, "geometry": drawn}

    yield feature(shapely.orient_polygons(problem.whole), kind="field")
    yield feature(shapely.orient_polygons(problem.inner), kind="inner", headland_m=problem.headland)
    for k, poses in enumerate(covered.swaths):
        line = shapely.LineString(poses[:, :2])
        yield feature(line, kind="swath", number=k + 1, width_m=problem.width)
    for k, turn in enumerate(covered.turns):
        line = shapely.LineString(turn.sample().pose[:, :2])
        yield feature(line, kind="turn", number=k + 1, duration_s=turn.duration)
