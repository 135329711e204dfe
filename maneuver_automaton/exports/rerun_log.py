"""A recording for the viewer of rerun: scene, bodies, path, and what happens over time."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import PART
from maneuver_automaton.automaton.plan_arrays import PlanArrays
from maneuver_automaton.collision import Obstacle, OccupancyMap
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.exports.driven import driven_of
from maneuver_automaton.exports.surroundings import Shown, shown_of, solid, solid_map
from maneuver_automaton.plotting.colors import LANE, SEQUENCE, SWEPT, Color
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.obstacles import MOVING, SOLID
from maneuver_automaton.plotting.swept import merged, swept_region
from maneuver_automaton.roads.scene import presence_of

if TYPE_CHECKING:
    from maneuver_automaton.exports.driven import Exportable

APPLICATION = "maneuver_automaton"
TIMELINE = "plan"  # [s] on the clock of the plan
WORLD = "world"
EGO, GOAL = SEQUENCE[0], SEQUENCE[2]
STEP = 0.05  # [s]


def save_rerun(value: Exportable, path: Path | str, *, step: float = STEP) -> None:
    """Write a plan, a closed loop or a drive as a recording (.rrd) for the viewer of rerun.

    Below `world` are the vehicle and what it carries as moving outlines, the path, the swept
    region, goals and obstacles; below `curves` its speeds, reduced state and control over time.
    Times are those of the plan, on the timeline `plan`.

    Parameters
    ----------
    value : Plan, PlanResult, ClosedLoop, RoadPlanResult or RoadDrive
        A Plan alone knows neither body nor obstacles.
    path : Path or str
        The file.
    step : float
        Time between poses [s]; the last one is the end.

    Raises
    ------
    MissingExtra
        If rerun-sdk is not installed.
    ValueError
        If a result has no plan, or `step` is not positive.
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
    driven = driven_of(value)
    rows, shown, target = driven.rows(step=step), shown_of(driven), Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.parent / f"{PART}{uuid.uuid4().hex}"
    beside.touch()  # where that fails, the error names the folder; that of rerun does not
    try:
        recording = rerun.RecordingStream(APPLICATION)
        recording.save(beside, default_blueprint=_blueprint(rerun.blueprint))
        log = _Log(rerun, recording)
        recording.send_recording_name(driven.name or target.stem)
        log.fixed(WORLD, rerun.ViewCoordinates.RIGHT_HAND_Z_UP)
        _log_motion(log, shown, rows)
        _log_surroundings(log, shown)
        _log_curves(log, rows)
        recording.flush()
        recording.disconnect()
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


def _log_motion(log: _Log, shown: Shown, rows: PlanArrays) -> None:
    """Path and swept region as they are, bodies as they move, primitives as they begin."""
    track, colors = shown.track, track_colors(shown.track.twists)
    if track.pieces:
        log.fixed(
            f"{WORLD}/path",
            log.rerun.LineStrips3D(
                [_places(piece.pose) for piece in track.pieces],
                colors=[_bytes(colors[piece.name]) for piece in track.pieces],
                labels=[piece.name for piece in track.pieces],
                show_labels=False,
            ),
        )
    swept = merged([one for _, body, part in shown.parts for one in swept_region(part, body)])
    if rings := [ring for one in swept for ring in _rings(one, 0.0)]:
        log.fixed(f"{WORLD}/swept", log.outlines(rings, SWEPT))
    problem = shown.driven.problem
    low, high = (0.0, 0.0) if problem is None else problem.body_height
    for name, body, part in shown.parts:
        poses = rows.pose if name == "vehicle" else part.at(rows.time)
        frame = log.entity(WORLD, name)
        log.moves(frame, rows.time, poses)
        if body:
            rings = [_raised(ring, z) for ring in body for z in sorted({low, high})]
            log.fixed(f"{frame}/body", log.outlines(rings, EGO))
        else:
            log.fixed(f"{frame}/body", log.rerun.Points3D([[0.0, 0.0, 0.0]], radii=[0.05]))
    for piece in track.pieces:
        log.at_time("primitive", float(piece.time[0]), log.rerun.TextLog(piece.name))


def _log_surroundings(log: _Log, shown: Shown) -> None:
    """Start, goals, lanelets and obstacles."""
    driven = shown.driven
    for k, goal in enumerate(shown.scene.goals):
        heading = float(goal.pose[2])
        arrow = log.rerun.Arrows3D(
            origins=_places(goal.pose[None]),
            vectors=[[np.cos(heading), np.sin(heading), 0.0]],
            colors=[_bytes(GOAL)],
        )
        spot = log.rerun.Points3D(_places(goal.pose[None]), colors=[_bytes(GOAL)], radii=[0.1])
        log.fixed(f"{WORLD}/goals/{k}", spot if goal.free_heading else arrow)
    if driven.scene is not None:
        lanes = [_raised(lanelet.ring, 0.0) for lanelet in driven.scene.lanelets]
        log.fixed(f"{WORLD}/lanelets", log.outlines(lanes, LANE))
        places = [place for goal in driven.scene.goals for place in goal.places or ()]
        if rings := [ring for place in places for ring in _rings(solid(place), 0.0)]:
            log.fixed(f"{WORLD}/goals/regions", log.outlines(rings, GOAL))
    for k, one in enumerate(shown.scene.obstacles):
        at = log.entity(WORLD, "obstacles", f"{k} {one.name}".strip())
        if isinstance(one, OccupancyMap):
            if one.blocked.any():
                log.fixed(at, log.outlines(_rings(solid_map(one), 0.0), SOLID))
            continue
        rings = [ring for z in one.height or (0.0,) for ring in _rings(solid(one.shape), z)]
        if one.motion is None:
            log.fixed(at, log.outlines(rings, SOLID))
        else:
            _log_moving(log, shown, one, at, rings)


def _log_moving(log: _Log, shown: Shown, one: Obstacle, at: str, rings: list[Array]) -> None:
    """A moving obstacle as long as it is there; on roads, as long as it was recorded."""
    assert one.motion is not None
    begin, end = shown.driven.start_time, shown.driven.start_time + shown.driven.duration
    first, last = presence_of(one) if shown.leaves else (begin, end)
    low, high = max(first, begin), min(last, end)
    if low > high:
        return
    times = np.append(np.arange(low, high, STEP), high)
    log.moves(at, times, one.motion.at(times))
    log.at_time(f"{at}/body", low, log.outlines(rings, MOVING))
    if last < end:
        log.at_time(f"{at}/body", last, log.rerun.Clear(recursive=False))


def _log_curves(log: _Log, rows: PlanArrays) -> None:
    """Speeds, reduced state and control over time; a pose shows in space."""
    dof = rows.pose.shape[1]
    names = list(rows.columns())[1 + dof : -1]
    for name in names:
        log.curve(log.entity("curves", name), rows.time, rows.columns()[name], name)


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
    import shapely

    lines = shapely.get_parts(shapely.boundary(geometry)).tolist()
    return [_raised(shapely.get_coordinates(line)[:-1], z) for line in lines]


def _raised(ring: Array, z: float) -> Array:
    return np.column_stack([ring, np.full(len(ring), z)])


def _places(poses: Array) -> Array:
    """Places (n, 3) of poses (n, dof) [m]."""
    altitude = poses[:, 3] if poses.shape[1] > 3 else np.zeros(len(poses))
    return np.column_stack([poses[:, :2], altitude])


def _bytes(color: Color) -> list[int]:
    return [round(255 * part) for part in color]
