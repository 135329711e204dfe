"""A recording for the viewer of rerun: scene, bodies, path, and what happens over time."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import PART
from maneuver_automaton._lazy import shapely
from maneuver_automaton.automaton.plan_arrays import PlanArrays
from maneuver_automaton.collision import Obstacle, OccupancyMap
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.exports.surroundings import parts_of, solid, solid_map, swept_by
from maneuver_automaton.plotting.colors import LANE, SEQUENCE, SWEPT, Color, track_colors
from maneuver_automaton.plotting.obstacles import MOVING, SOLID
from maneuver_automaton.recording import Mover, Recording, recording_to_write
from maneuver_automaton.words.library import four_columns

APPLICATION = "maneuver_automaton"
TIMELINE = "plan"  # [s] on the clock of the plan
WORLD = "world"
STEP = 0.05  # [s]
BODY, GOAL = SEQUENCE[0], SEQUENCE[2]


def save_rerun(value: Any, path: Path | str, *, step: float = STEP) -> None:
    """Write a plan, a closed loop, a fleet or a drive as a recording (.rrd) for rerun's viewer.

    Below `world` are the vehicle and what it carries as moving outlines, the path, the swept
    region, goals and obstacles; below `curves` its speeds, reduced state and control over time. Of
    several vehicles each has its own part of both, by its name. Times are those of the plan, on the
    timeline `plan`.

    Parameters
    ----------
    value : any result, or a Recording
        A Plan alone knows neither body nor obstacles.
    path : Path or str
        The file.
    step : float
        Time between poses [s]; the last one is the end.

    Raises
    ------
    MissingExtra
        If rerun-sdk is not installed.
    TypeError
        If nobody moves in the value.
    ValueError
        If nobody has a plan, or `step` is not positive.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> plan = Plan([0, 0, 0], (ahead,), durations=[2.0])
    >>> save_rerun(plan, getfixture("tmp_path") / "plan.rrd")  # doctest: +SKIP
    """
    try:
        import rerun
    except ImportError as error:
        raise MissingExtra(
            "rerun: rerun-sdk is not installed; need pip install 'maneuver-automaton[rerun]'"
        ) from error
    recording, target = recording_to_write(value), Path(path)
    rows = [one.rows(step=step) for one in recording.movers]
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.parent / f"{PART}{uuid.uuid4().hex}"
    beside.touch()  # where that fails, the error names the folder; that of rerun does not
    try:
        stream = rerun.RecordingStream(APPLICATION)
        stream.save(beside, default_blueprint=_blueprint(rerun.blueprint))
        log = _Log(rerun, stream)
        stream.send_recording_name(recording.name_in(target))
        log.fixed(WORLD, rerun.ViewCoordinates.RIGHT_HAND_Z_UP)
        several = len(recording.movers) > 1
        for mover, table in zip(recording.movers, rows, strict=True):
            names = (mover.name,) if several else ()
            _log_motion(log, mover, table, names)
            _log_goals(log, mover, names)
            columns = table.columns()  # a pose shows in space, the rest over time
            for name in list(columns)[1 + table.pose.shape[1] : -1]:
                at = log.entity("curves", *names, name)
                log.curve(at, table.time, columns[name], name)
        _log_surroundings(log, recording)
        stream.flush()
        stream.disconnect()
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)


class _Log:
    """Where to log: the module of rerun and one recording."""

    def __init__(self, rerun: Any, recording: Any) -> None:
        self.rerun, self.recording = rerun, recording

    def fixed(self, at: str, what: Any) -> None:
        """Log what is always there."""
        self.recording.log(at, what, static=True)

    def outlines(self, rings: list[Array], color: Color) -> Any:
        """Closed lines along rings (n, 3)."""
        closed = [np.concatenate([ring, ring[:1]]) for ring in rings]
        return self.rerun.LineStrips3D(closed, colors=[_bytes(color)])

    def moves(self, at: str, times: Array, poses: Array) -> None:
        """Log where a frame is over time."""
        half = 0.5 * poses[:, 2]
        none = np.zeros_like(half)
        turns = np.stack([none, none, np.sin(half), np.cos(half)], axis=-1)
        columns = self.rerun.Transform3D.columns(translation=_places(poses), quaternion=turns)
        self.recording.send_columns(at, indexes=[self._times(times)], columns=columns)

    def curve(self, at: str, times: Array, values: Array, name: str) -> None:
        """Log a number over time."""
        self.fixed(at, self.rerun.SeriesLines(names=[name]))
        columns = self.rerun.Scalars.columns(scalars=values)
        self.recording.send_columns(at, indexes=[self._times(times)], columns=columns)

    def at_time(self, at: str, time: float, what: Any) -> None:
        """Log what is there from a time on."""
        self.recording.set_time(TIMELINE, duration=time)
        self.recording.log(at, what)

    def entity(self, *parts: object) -> str:
        """The path of an entity, whatever its name."""
        return str(self.rerun.new_entity_path(list(parts)))

    def _times(self, times: Array) -> Any:
        return self.rerun.TimeColumn(TIMELINE, duration=times)


def _log_motion(log: _Log, mover: Mover, rows: PlanArrays, names: tuple[str, ...]) -> None:
    """Path and swept region as they are, bodies as they move, primitives as they begin."""
    parts = parts_of(mover)
    track, colors = parts[0][2], track_colors(parts[0][2].twists)
    if track.pieces:
        log.fixed(
            log.entity(WORLD, *names, "path"),
            log.rerun.LineStrips3D(
                [_places(piece.pose) for piece in track.pieces],
                colors=[_bytes(colors[piece.name]) for piece in track.pieces],
                labels=[piece.name for piece in track.pieces],
                show_labels=False,
            ),
        )
    if rings := [ring for one in swept_by(parts) for ring in _rings(one, 0.0)]:
        log.fixed(log.entity(WORLD, *names, "swept"), log.outlines(rings, SWEPT))
    low, high = (0.0, 0.0) if mover.problem is None else mover.problem.body_height
    for name, body, part in parts:
        frame = log.entity(WORLD, *names, name)
        log.moves(frame, rows.time, rows.pose if part is track else part.at(rows.time))
        if body:
            rings = [_raised(ring, z) for ring in body for z in sorted({low, high})]
            log.fixed(f"{frame}/body", log.outlines(rings, BODY))
        else:
            log.fixed(f"{frame}/body", log.rerun.Points3D([[0.0, 0.0, 0.0]], radii=[0.05]))
    for piece in track.pieces:
        at = log.entity("primitive", *names)
        log.at_time(at, float(piece.time[0]), log.rerun.TextLog(piece.name))


def _log_goals(log: _Log, mover: Mover, names: tuple[str, ...]) -> None:
    for k, goal in enumerate(mover.goals):
        at, heading = _places(goal.pose[None]), float(goal.pose[2])
        along = [[np.cos(heading), np.sin(heading), 0.0]]
        arrow = log.rerun.Arrows3D(origins=at, vectors=along, colors=[_bytes(GOAL)])
        spot = log.rerun.Points3D(at, colors=[_bytes(GOAL)], radii=[0.1])
        log.fixed(log.entity(WORLD, *names, "goals", k), spot if goal.free_heading else arrow)
    if rings := [ring for place in mover.regions for ring in _rings(solid(place), 0.0)]:
        log.fixed(log.entity(WORLD, *names, "goals", "regions"), log.outlines(rings, GOAL))


def _log_surroundings(log: _Log, recording: Recording) -> None:
    world = recording.world
    if world.lanes:
        lanes = [_raised(ring, 0.0) for ring in world.lanes]
        log.fixed(f"{WORLD}/lanelets", log.outlines(lanes, LANE))
    for k, one in enumerate(world.obstacles):
        at = log.entity(WORLD, "obstacles", f"{k} {one.name}".strip())
        if isinstance(one, OccupancyMap):
            if one.blocked.any():
                log.fixed(at, log.outlines(_rings(solid_map(one), 0.0), SOLID))
            continue
        rings = [ring for z in one.height or (0.0,) for ring in _rings(solid(one.shape), z)]
        if one.motion is None:
            log.fixed(at, log.outlines(rings, SOLID))
        else:
            _log_moving(log, recording, one, at, rings)


def _log_moving(
    log: _Log, recording: Recording, one: Obstacle, at: str, rings: list[Array]
) -> None:
    """A moving obstacle as long as it is there."""
    assert one.motion is not None
    begin, end = recording.begin, recording.end
    first, last = one.lasts(fleeting=recording.world.fleeting)
    low, high = max(first, begin), min(last, end)
    if low > high:
        return
    times = np.append(np.arange(low, high, STEP), high)
    log.moves(at, times, one.motion.at(times))
    log.at_time(f"{at}/body", low, log.outlines(rings, MOVING))
    if last < end:
        log.at_time(f"{at}/body", last, log.rerun.Clear(recursive=False))


def _blueprint(views: Any) -> Any:
    """Space on the left, curves and the words of the plan on the right."""
    return views.Blueprint(
        views.Horizontal(
            views.Spatial3DView(origin=WORLD, name="Space"),
            views.Vertical(
                views.TimeSeriesView(origin="curves", name="Over time"),
                views.TextLogView(origin="primitive", name="Primitives"),
                row_shares=[3, 1],
            ),
            column_shares=[2, 1],
        ),
        collapse_panels=True,
    )


def _rings(geometry: Any, z: float) -> list[Array]:
    """Rings (n, 3) of a geometry of shapely at a height [m]."""
    lines = shapely.get_parts(shapely.boundary(geometry)).tolist()
    return [_raised(shapely.get_coordinates(line)[:-1], z) for line in lines]


def _raised(ring: Array, z: float) -> Array:
    return np.column_stack([ring, np.full(len(ring), z)])


def _places(poses: Array) -> Array:
    return four_columns(poses)[:, [0, 1, 3]]


def _bytes(color: Color) -> list[int]:
    return [round(255 * part) for part in color]
