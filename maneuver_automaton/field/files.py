"""Fields from files, YAML or GeoJSON, and covered ones as GeoJSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import shapely
from pydantic import Field

from maneuver_automaton._brief import brief
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.exports.earth import metres_of
from maneuver_automaton.exports.geojson import feature_of, geometry_of, save_features
from maneuver_automaton.field.covering import FieldProblem, FieldResult
from maneuver_automaton.formats.statement import simple_polygon
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.models import Model
from maneuver_automaton.planning import Planner
from maneuver_automaton.scenario import parts
from maneuver_automaton.scenario.scenario import scenario_of_document

TIME_LIMIT_S = 1.0  # for each turn, where nothing is stated
NOWHERE = {"pose": [0.0, 0.0, 0.0]}  # start and goal of a scenario whose vehicle alone is asked for


class FieldPart(parts.FilePart):
    """What is to be covered: `field` of a file, which has neither start nor goal."""

    polygon_m: parts.Polygon | None = parts.optional("corners; left out where GeoJSON has them")
    holes_m: parts.Polygons = Field((), description="polygons inside polygon_m, not entered")
    width_m: parts.Positive | None = parts.optional("working width")
    headland_m: parts.Positive | None = parts.optional("strip to turn in; left out: chosen")
    direction_rad: parts.Number | None = parts.optional("of swaths; left out: the best edge's")


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
    is_geojson, at = path.suffix.lower() in (".geojson", ".json"), ("field",)
    if is_geojson == (beside is None):
        wrong = "GeoJSON states no vehicle, need" if is_geojson else "states its vehicle; leave out"
        raise InvalidScenario(f"{path}: {wrong} --with")
    document = parse(read_text(beside or path), name=str(beside or path))
    if not isinstance(document.value, dict):
        raise document.error((), "is no mapping, need a scenario with the key 'field'")
    rest, part = dict(document.value), FieldPart()
    if "field" in rest:
        if others := {"start", "goal", "via", "order"} & set(rest):
            raise document.error((min(others),), "is for plan; a field has none, leave it out")
        own = replace(document, value=rest.pop("field"), homes={(): at})
        part = parts.checked(own, FieldPart)
    found = part.model_dump(exclude_none=True)
    if is_geojson:
        ground, origin = _polygon_of(path, origin)
        found |= ground
    found |= {key: value for key, value in stated.items() if value is not None}
    if "polygon_m" not in found:
        raise document.error(("field",), "polygon_m is missing, need the corners of the field")
    if "width_m" not in found:
        raise InvalidScenario(f"{path}: width_m: missing, need the working width, or --width")
    driver = replace(document, value={"start": NOWHERE, "goal": NOWHERE} | rest)
    scenario = scenario_of_document(driver, path=beside or path, begin=0.0, own=model)
    keys = {one.name for one in fields(Planner) if one.init} - {"start_trim"}
    with parts.at(document, at if "field" in document.value else ()):
        problem = FieldProblem(
            Planner(**{key: getattr(scenario.problem, key) for key in keys}),
            simple_polygon(found["polygon_m"], found["holes_m"]),
            width=found["width_m"],
            headland=found.get("headland_m", 0.0),
            direction=found.get("direction_rad"),
        )
        _ = problem.inner
    limited = "time_limit_s" in (rest.get("search") or {})
    return FieldScenario(
        name=path.stem if is_geojson else scenario.name,
        problem=problem,
        time_limit_s=scenario.time_limit_s if limited else TIME_LIMIT_S,
        origin=origin,
    )


def _polygon_of(
    path: Path, origin: tuple[float, float] | None
) -> tuple[dict[str, Any], tuple[float, float] | None]:
    """The one polygon of a GeoJSON file with its properties, in metres, and their origin."""
    try:
        document = json.loads(read_text(path))
        listed = document["features"] if document["type"] == "FeatureCollection" else [document]
        areas = [one for one in listed if one.get("geometry", one)["type"] == "Polygon"]
        if len(areas) != 1:
            raise ValueError(f"it has {len(areas)} polygons, need one, the field")
        area = shapely.force_2d(shapely.geometry.shape(areas[0].get("geometry", areas[0])))
        if not ("crs" in document or document.get("units") == "m"):
            middle = shapely.box(*area.bounds).centroid
            place = origin = origin or (round(middle.y, 6), round(middle.x, 6))
            area = shapely.transform(area, lambda degrees: metres_of(degrees, origin=place))
        known = areas[0].get("properties") or {}
        keys = {"width_m", "headland_m", "direction_rad"} & set(known)
        found: dict[str, Any] = {key: float(known[key]) for key in keys}
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InvalidScenario(f"{path}: is no GeoJSON with a polygon: {error}") from error
    rings = [shapely.get_coordinates(ring) for ring in (area.exterior, *area.interiors)]
    return found | {"polygon_m": rings[0], "holes_m": rings[1:]}, origin


def save_field_geojson(
    covered: FieldResult, path: Path, *, name: str, origin: tuple[float, float] | None = None
) -> None:
    """Write field, inner part, swaths and turns as GeoJSON: `kind` tells them apart."""
    problem = covered.problem
    found: list[tuple[Any, dict[str, Any]]] = [(problem.whole, {"kind": "field"})]
    found += [(problem.inner, {"kind": "inner", "headland_m": problem.headland})]
    for k, line in enumerate(shapely.linestrings(covered.swaths[:, :, :2])):
        found += [(line, {"kind": "swath", "number": k + 1, "width_m": problem.width})]
    for k, turn in enumerate(covered.turns):
        line = shapely.LineString(turn.sample().pose[:, :2])
        found += [(line, {"kind": "turn", "number": k + 1, "duration_s": turn.duration})]
    features = (feature_of(geometry_of(one), **facts) for one, facts in found)
    save_features(features, path, name=name, origin=origin)
