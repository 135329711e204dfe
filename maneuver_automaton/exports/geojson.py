"""GeoJSON: path, swept region, bodies, goals and obstacles, for maps and for shapely.

Source: Butler et al. (2016), *The GeoJSON Format*, RFC 7946. That document wants longitude and
latitude; plans have metres in a frame of their own. The member `crs` of the format's first version
(2008) says so in well-known text, which GDAL reads, and with it QGIS and geopandas; others ignore
it. A `crs` of null is no way to say it: GDAL takes that for longitude and latitude. About an origin
on the Earth it is as RFC 7946 wants it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import Obstacle, Polygon
from maneuver_automaton.exports.earth import degrees_of
from maneuver_automaton.exports.surroundings import Part, parts_of, solid, solids_of, swept_by
from maneuver_automaton.plotting.track import placed
from maneuver_automaton.recording import Mover, Recording, recording_to_write

PLACES = (0, 1, 3)  # x, y and altitude of a pose
LONGEST_M = 50.0  # between two points of a line that is written in degrees
METRES = 'LOCAL_CS["plan",LOCAL_DATUM["plan",32767],UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'


def save_geojson(value: Any, path: Path | str, *, origin: ArrayLike | None = None) -> None:
    """Write a plan, a closed loop, a fleet or a drive as a FeatureCollection of GeoJSON.

    Coordinates are metres in the plan's own frame, x and y, and the altitude of a vehicle that
    flies; about an origin they are longitudes and latitudes. The property `kind` tells the
    features apart: path, primitive (a trim or maneuver), swept, body, start, goal, obstacle, zone,
    lanelet; of several vehicles, `vehicle` tells whose it is.

    Parameters
    ----------
    value : any result, or a Recording
        A Plan alone knows neither body nor obstacles.
    path : Path or str
        The file.
    origin : (float, float), optional
        Latitude and longitude [deg] of the point x = y = 0; x is east, y north, see `degrees_of`.
        Lines have a point every 50 m then, between which they are straight in degrees.

    Raises
    ------
    TypeError
        If nobody moves in the value.
    ValueError
        If nobody has a plan, or the origin is no place of the Earth.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> file = getfixture("tmp_path") / "plan.geojson"
    >>> save_geojson(Plan([0, 0, 0], (ahead,), durations=[2.0]), file)
    >>> first = json.loads(file.read_text())["features"][0]
    >>> first["properties"]["kind"], first["geometry"]["coordinates"]
    ('path', [[0.0, 0.0], [2.0, 0.0]])
    """
    recording = recording_to_write(value)
    save_features(_features(recording), path, name=recording.name_in(path), origin=origin)


def save_features(
    features: Iterable[dict[str, Any]], path: Path | str, *, name: str, origin: ArrayLike | None
) -> None:
    """Write features in metres as a FeatureCollection: as they are, or about an origin."""
    frame: dict[str, Any] = {
        "crs": {"type": "name", "properties": {"name": METRES}},
        "units": "m",
        "frame": "x and y in metres in the plan's own frame, not longitude and latitude",
    }
    if origin is not None:
        latitude, longitude = as_array("origin", origin, last=2).tolist()
        frame = {
            "units": "degree",
            "frame": "longitude and latitude on WGS 84",
            "origin": {"longitude": longitude, "latitude": latitude},
        }
        features = ({**one, "geometry": _located(one["geometry"], origin)} for one in features)
    head = {"type": "FeatureCollection", "name": name, **frame}
    rows = ",\n".join(json.dumps(one, allow_nan=False) for one in features)
    text = f'{json.dumps(head, ensure_ascii=False)[:-1]}, "features": [\n{rows}\n]}}\n'
    write_text_atomically(Path(path), text)


def _features(recording: Recording) -> Iterator[dict[str, Any]]:
    several = len(recording.movers) > 1
    for mover in recording.movers:
        parts = parts_of(mover)
        features = [*_path(mover, parts), *_bodies(mover, parts)] if mover.has_plan else []
        for one in (*features, *_ends(mover)):
            if several:
                one["properties"]["vehicle"] = mover.name
            yield one
    yield from _around(recording)


def _path(mover: Mover, parts: Sequence[Part]) -> Iterator[dict[str, Any]]:
    track = parts[0][2]
    places = _places(np.concatenate([track.pose, np.array([mover.end])]))  # pushed, it ends there
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    facts = {"duration_s": mover.duration, "length_m": length, "cost": mover.cost}
    yield feature_of(_line(places), kind="path", **facts)
    for piece in track.pieces:
        begin, end = piece.time[[0, -1]].tolist()
        line = _line(_places(piece.pose))
        yield feature_of(line, kind="primitive", name=piece.name, begin_s=begin, end_s=end)


def _bodies(mover: Mover, parts: Sequence[Part]) -> Iterator[dict[str, Any]]:
    """The region that all bodies sweep, and where they are when primitives begin and end."""
    _, known, way = parts[0]
    if swept := swept_by(parts):
        yield feature_of(geometry_of(shapely.union_all(swept)), kind="swept")
    times = way.switching_times
    times = times if len(times) else np.array([mover.start_time])
    for name, body, track in parts if known else ():
        for time, pose in zip(times.tolist(), track.at(times), strict=True):
            outlines = [solid(Polygon(ring)) for ring in placed(body, pose[None])]
            facts = {"part": name, "time_s": time, "heading_rad": float(pose[2])}
            yield feature_of(geometry_of(shapely.union_all(outlines)), kind="body", **facts)


def _ends(mover: Mover) -> Iterator[dict[str, Any]]:
    yield feature_of(_point(mover.start), kind="start", heading_rad=float(mover.start[2]))
    for goal in mover.goals:
        heading = None if goal.free_heading else float(goal.pose[2])
        facts = {"heading_rad": heading, "tolerance_m": goal.tolerance_m}
        yield feature_of(_point(goal.pose), kind="goal", **facts)
    for region in mover.road.scene.goals if mover.road else ():
        when = [time if math.isfinite(time) else None for time in region.time]
        for place in region.places or ():
            yield feature_of(geometry_of(solid(place)), kind="goal", time_s=when)


def _around(recording: Recording) -> Iterator[dict[str, Any]]:
    for one, geometry, time in solids_of(recording):
        facts: dict[str, Any] = {"name": one.name}
        if isinstance(one, Obstacle) and one.height is not None:
            facts["height_m"] = list(one.height)
        if isinstance(one, Obstacle) and one.motion is not None:
            facts["time_s"] = time
        yield feature_of(geometry_of(geometry), kind="obstacle", **facts)
    for zone in recording.world.zones:
        yield feature_of(geometry_of(solid(zone.shape)), kind="zone", name=zone.name)
    road = recording.movers[0].road
    for lanelet in road.scene.lanelets if road else ():
        area = shapely.make_valid(shapely.Polygon(lanelet.ring), method="structure")
        yield feature_of(geometry_of(area), kind="lanelet", id=lanelet.number)


def feature_of(geometry: Mapping[str, Any], *, kind: str, **facts: Any) -> dict[str, Any]:
    """A feature of a kind, with facts about it."""
    return {"type": "Feature", "properties": {"kind": kind, **facts}, "geometry": geometry}


def _located(geometry: Mapping[str, Any], origin: ArrayLike) -> dict[str, Any]:
    """A geometry in metres, in degrees about an origin; altitudes stay."""
    dense = shapely.geometry.shape(geometry)
    if dense.length > LONGEST_M:
        dense = shapely.segmentize(dense, LONGEST_M)
    there = shapely.transform(
        dense,
        lambda places: np.hstack([degrees_of(places[:, :2], origin=origin), places[:, 2:]]),
        include_z=dense.has_z,
    )
    said: dict[str, Any] = json.loads(shapely.to_geojson(there))
    return said


def _places(poses: Array) -> Array:
    return poses[:, [k for k in PLACES if k < poses.shape[1]]]


def _line(places: Array) -> dict[str, Any]:
    """A line along places (n, 2) or (n, 3); a point where they are all the same."""
    kept = places[np.append(True, (np.diff(places, axis=0) != 0.0).any(axis=1))]
    if len(kept) == 1:
        return {"type": "Point", "coordinates": kept[0].tolist()}
    return {"type": "LineString", "coordinates": kept.tolist()}


def _point(pose: Array) -> dict[str, Any]:
    return {"type": "Point", "coordinates": _places(pose[None])[0].tolist()}


def geometry_of(geometry: Any) -> Any:
    """A geometry of shapely, outer rings to the left as RFC 7946 wants them."""
    return json.loads(shapely.to_geojson(shapely.orient_polygons(geometry)))
