"""What pictures need of a plan: its track as samples, bodies along it, and what they sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Polygon, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.plotting.colors import motion
from maneuver_automaton.plotting.style import POLISHED
from maneuver_automaton.primitives import Maneuver

TURNING_M = 1e-4  # [m] between samples: less is no direction of travel
CHORD_RAD = 0.03  # [rad] between drawn points of an arc
LEAST_TURN_RAD = 0.05  # [rad] that a part of a maneuver turns, if it is told apart
STRAIGHT = 0.1  # of the fastest turn of a maneuver: slower is straight on
LEAST_STRAIGHT = 0.05  # of its duration that a straight part takes
TINIEST_S = 1e-12
END_TOLERANCE = 1e-9  # [m, rad, s] between the end of a piece and the start of the next
SEEN = 5e-3  # of the duration: what takes less can hardly be seen in a picture


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackPiece:
    """One trim or maneuver of a plan that takes time, as samples."""

    name: str
    # (dof,) of a trim, or the mean of a part of a maneuver [m/s, m/s, rad/s(, m/s)]
    twist: Array
    time: Array  # (n,) [s]
    pose: Array  # (n, dof), headings continuous
    control: Array  # (n, n_u), row i holds from time i on
    state: Array  # (n, n_z) reduced state; no column for a kinematic vehicle

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def drives(self) -> bool:
        """Whether it leaves its place in the plane."""
        return bool(np.ptp(self.pose[:, :2], axis=0).max() > 1e-9)

    @property
    def climb(self) -> float:
        """Altitude gained [m]; zero in the plane."""
        return float(self.pose[-1, 3:].sum() - self.pose[0, 3:].sum())

    @property
    def turn(self) -> float:
        """Heading gained [rad]."""
        return float(self.pose[-1, 2] - self.pose[0, 2])


@dataclass(frozen=True, eq=False)
class Track:
    """A start and the pieces driven from there; no piece if the vehicle is there already."""

    start: Array  # (dof,)
    pieces: tuple[TrackPiece, ...]

    @property
    def end(self) -> Array:
        """Pose (dof,) at the end."""
        return np.asarray(self.pieces[-1].pose[-1]) if self.pieces else self.start

    @cached_property
    def pose(self) -> Array:
        """Poses (n, dof) of all pieces, one after the other."""
        return np.concatenate([self.start[None], *(piece.pose for piece in self.pieces)])

    @cached_property
    def switching_times(self) -> Array:
        """Times (n + 1,) at which pieces begin, and the end [s]; empty without pieces."""
        if not self.pieces:
            return np.zeros(0)
        return np.array([*(piece.time[0] for piece in self.pieces), self.pieces[-1].time[-1]])

    @cached_property
    def switching_poses(self) -> Array:
        """Poses (n + 1, dof) where pieces begin, and the end."""
        return np.array([*(piece.pose[0] for piece in self.pieces), self.end])

    @property
    def twists(self) -> dict[str, Array]:
        """Twist of every trim by name, in the order in which they appear."""
        twists: dict[str, Array] = {}
        for piece in self.pieces:
            twists.setdefault(piece.name, piece.twist)
        return twists

    @property
    def seen(self) -> set[str]:
        """Names of the trims that take enough of the time to be seen."""
        lasted: dict[str, float] = {}
        for piece in self.pieces:
            lasted[piece.name] = lasted.get(piece.name, 0.0) + piece.duration
        least = SEEN * sum(lasted.values())
        return {name for name, duration in lasted.items() if duration >= least}

    @property
    def climbs(self) -> bool:
        """Whether the altitude varies."""
        return bool(self.start.size > 3 and np.ptp(self.pose[:, 3]) > 1e-9)

    def at(self, times: Array) -> Array:
        """Poses (m, dof) at `times` (m,) [s], between samples on their chord."""
        if not self.pieces:
            return np.repeat(self.start[None], len(times), axis=0)
        time = np.concatenate([piece.time for piece in self.pieces])
        pose = np.concatenate([piece.pose for piece in self.pieces])
        return np.stack([np.interp(times, time, column) for column in pose.T], axis=-1)

    def between(self, begin: float, end: float) -> list[tuple[str, Array]]:
        """Names and places (n, 2) of the pieces from one time to another [s]."""
        parts = []
        for piece in self.pieces:
            low, high = max(begin, float(piece.time[0])), min(end, float(piece.time[-1]))
            if low < high:
                at = np.array([low, *piece.time[(piece.time > low) & (piece.time < high)], high])
                places = [np.interp(at, piece.time, column) for column in piece.pose.T[:2]]
                parts.append((piece.name, np.stack(places, axis=-1)))
        return parts

    def spread(self, count: int, *, reach: float) -> Array:
        """Poses (m, dof), about `count`, evenly along the path; `reach` [m] weighs the heading."""
        steps = np.abs(np.diff(self.pose, axis=0))
        each = np.hypot(steps[:, 0], steps[:, 1]) + reach * steps[:, 2]
        driven = np.concatenate([[0.0], np.cumsum(each)])
        if not driven[-1] > 0.0:
            return self.pose[:0]
        at = np.linspace(0.0, driven[-1], count + 2)[1:-1]
        return np.stack([np.interp(at, driven, column) for column in self.pose.T], axis=-1)


def track_of_plan(plan: Plan) -> Track:
    """The track of a `plan`; a maneuver that turns back, or both ways, is a piece for each."""
    return Track(
        plan.start,
        tuple(
            piece
            for k, duration in enumerate(plan.primitive_durations.tolist())
            if duration > 0.0
            for piece in _pieces(plan, k, duration)
        ),
    )


def joined_track(start: Array, plans: Sequence[Plan]) -> Track:
    """Track of one plan after the other; a trim that goes on in the next plan is one piece."""
    pieces: list[TrackPiece] = []
    for plan in plans:
        for k, piece in enumerate(track_of_plan(plan).pieces):
            one = pieces[-1] if k == 0 and pieces else piece
            late = abs(one.time[-1] - piece.time[0]) > END_TOLERANCE * (1.0 + abs(one.time[-1]))
            scale = 1.0 + float(np.abs(one.pose[-1]).max())
            off = np.abs(one.pose[-1] - piece.pose[0]).max() > END_TOLERANCE * scale
            if one is not piece and one.name == piece.name and not (late or off):
                pieces[-1] = replace(
                    one,
                    time=np.concatenate([one.time, piece.time[1:]]),
                    pose=np.concatenate([one.pose, piece.pose[1:]]),
                    control=np.concatenate([one.control, piece.control[1:]]),
                    state=np.concatenate([one.state, piece.state[1:]]),
                )
            else:
                pieces.append(piece)
    return Track(start, tuple(pieces))


class _Samples(NamedTuple):
    time: Array
    pose: Array
    control: Array
    state: Array


def _pieces(plan: Plan, k: int, duration: float) -> list[TrackPiece]:
    primitive, begin = plan.primitives[k], float(plan.switching_times[k])
    if isinstance(primitive, Maneuver):
        if (course := primitive.course) is None:
            time = np.array([begin, begin + duration])
            empty = np.zeros((2, 0))
            return _parts(primitive.name, _Samples(time, plan.pose_at(time), empty, empty))
        group = group_of(plan.start.size)
        pose = (group(plan.switching_poses[k]) @ group(course.pose)).pose
        samples = _Samples(begin + course.time, pose, course.control, course.reduced_state)
        return _parts(primitive.name, samples)
    steps = math.ceil(abs(primitive.body_velocity[2]) * duration / CHORD_RAD)
    time = np.linspace(begin, float(plan.switching_times[k + 1]), max(1, steps) + 1)
    return [
        TrackPiece(
            name=primitive.name,
            twist=primitive.body_velocity,
            time=time,
            pose=plan.pose_at(time),
            control=np.broadcast_to(primitive.control, (time.size, primitive.control.size)),
            state=np.broadcast_to(
                primitive.reduced_state, (time.size, primitive.reduced_state.size)
            ),
        )
    ]


def _parts(name: str, samples: _Samples) -> list[TrackPiece]:
    """Pieces of a maneuver, which is cut where it turns back, or turns the other way."""
    runs = _runs(samples)
    whole = len(runs) < 2
    pieces = []
    for run in [_Run(0, len(samples.time) - 1, 0)] if whole else runs:
        part = _Samples(*(column[run.first : run.last + 1] for column in samples))
        # The mean: what it gains from sample to sample, over its duration.
        gained = (SE2(part.pose[:-1, :3]).inverse() @ SE2(part.pose[1:, :3])).log().sum(axis=0)
        climbed = part.pose[-1, 3:] - part.pose[0, 3:]
        twist = np.concatenate([gained, climbed]) / (part.time[-1] - part.time[0])
        if not whole and run.turn == 0:
            twist[2] = 0.0  # what it still turns can hardly be seen
        pieces.append(
            TrackPiece(
                name=name if whole and name != POLISHED else f"{name}, {motion(twist)}",
                twist=twist,
                time=part.time,
                pose=part.pose,
                # the last row is that of the next piece: the one before holds to the end
                control=np.concatenate([part.control[:-1], part.control[-2:-1]]),
                state=part.state,
            )
        )
    return pieces


class _Run(NamedTuple):
    """Rows of samples between which a maneuver keeps its gear and the way it turns."""

    first: int
    last: int
    turn: int  # 1 to the left, -1 to the right, 0 for straight on


def _runs(samples: _Samples) -> list[_Run]:
    """Runs of one gear and one turn; a single one unless the gear or the side changes."""
    # Where the direction of travel changes, among the samples.
    steps = np.diff(samples.pose[:, :2], axis=0)
    heading = samples.pose[:-1, 2]
    ahead = np.cos(heading) * steps[:, 0] + np.sin(heading) * steps[:, 1]
    driven = np.flatnonzero(np.abs(ahead) > TURNING_M)
    cuts = [int(driven[k + 1]) for k in np.flatnonzero(np.diff(np.sign(ahead[driven])))]
    bounds = [0, *cuts, len(samples.time) - 1]
    runs = [run for first, last in pairwise(bounds) for run in _turns(samples, first, last)]
    return runs if cuts or {-1, 1} <= {run.turn for run in runs} else runs[:1]


def _turns(samples: _Samples, first: int, last: int) -> list[_Run]:
    """Runs of one turn among rows of one gear; what is too short to be seen joins its neighbour."""
    spans = np.diff(samples.time)
    gained = np.diff(samples.pose[:, 2])
    rates = np.abs(gained) / np.maximum(spans, TINIEST_S)
    sides = np.where(rates > STRAIGHT * rates.max(), np.sign(gained), 0.0)[first:last]
    starts = np.flatnonzero(np.diff(sides, prepend=np.nan) != 0.0)
    runs = [
        _Run(first + int(a), first + int(b), int(sides[a]))
        for a, b in pairwise([*starts.tolist(), last - first])
    ]

    def weight(run: _Run) -> float:
        """From one on it is worth a run of its own."""
        turned = abs(float(gained[run.first : run.last].sum())) / LEAST_TURN_RAD
        lasted = float(spans[run.first : run.last].sum()) / (LEAST_STRAIGHT * float(spans.sum()))
        return turned if run.turn else lasted

    while len(runs) > 1 and min(map(weight, runs)) < 1.0:
        k = min(range(len(runs)), key=lambda n: weight(runs[n]))
        beside = [n for n in (k - 1, k + 1) if 0 <= n < len(runs)]
        runs[k] = runs[k]._replace(turn=runs[max(beside, key=lambda n: weight(runs[n]))].turn)
        alike = [(turn, list(some)) for turn, some in groupby(runs, lambda run: run.turn)]
        runs = [_Run(some[0].first, some[-1].last, turn) for turn, some in alike]
    return [runs[0]._replace(turn=0)] if len(runs) == 1 and weight(runs[0]) < 1.0 else runs


DISC_CORNERS = 48


def footprint_polygons(shapes: Sequence[Shape]) -> list[Array]:
    """Outlines (n, 2) of shapes in their own frame [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, DISC_CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return [
        one.radius * circle + one.center if isinstance(one, Disc) else one.corners for one in shapes
    ]


def placed(outlines: Sequence[Array], poses: Array) -> list[Array]:
    """Outlines (n, 2) at `poses` (m, dof) in the plane: m times len(outlines) arrays (n, 2)."""
    frames = SE2(poses[:, None, :3])
    return [corners for outline in outlines for corners in frames.act(outline)]


def solids_at(outline: Array, poses: Array) -> Any:
    """Shapely geometries (n,) of an outline, or of a point, at `poses` (n, dof) in the plane."""
    corners = SE2(poses[:, None, :3]).act(outline)
    return shapely.points(corners[:, 0]) if len(outline) == 1 else shapely.polygons(corners)


STRAIGHT_RAD, DETOUR = 1e-9, 1e-12  # turn, and way over chord, of a piece drawn by its two ends


def swept_region(track: Track, outlines: Sequence[Array]) -> list[Any]:
    """Shapely polygons that a body of `outlines` (n, 2) covers along a `track`.

    Between two samples, which are a few hundredths of a radian apart, each convex piece of the
    body is taken to fill the hull of its two places: on a circle of radius r that is off by
    ``r * angle**2 / 8``, a millimetre for a car.
    """
    pieces = [corners for outline in outlines for corners, _ in convex_pieces(Polygon(outline))]
    parts: list[Any] = []
    for corners in pieces:
        for poses in [track.start[None], *(_samples(piece) for piece in track.pieces)]:
            places = np.array(placed([corners], poses))
            pairs = np.concatenate([places[:-1], places[1:]], axis=1) if len(places) > 1 else places
            parts += shapely.convex_hull(shapely.multipoints(pairs)).tolist()
    return merged(parts)


def merged(parts: Sequence[Any]) -> list[Any]:
    """Shapely polygons that cover what the `parts` cover, each place once."""
    whole = shapely.union_all(np.array(parts))
    return [part for part in shapely.get_parts(whole).tolist() if part.geom_type == "Polygon"]


def _samples(piece: TrackPiece) -> Array:
    """Poses (n, dof) of a piece, no more than it takes."""
    pose = piece.pose
    chord = pose[-1, :2] - pose[0, :2]
    steps = np.diff(pose[:, :2], axis=0)
    length = float(np.linalg.norm(chord))
    detour = float(np.linalg.norm(steps, axis=1).sum()) - length
    straight = np.ptp(pose[:, 2]) <= STRAIGHT_RAD and detour <= DETOUR * (1.0 + length)
    return pose[[0, -1]] if straight else pose


def step_curves(track: Track, k: int) -> list[Array]:
    """Control `k` over time, held from sample to sample: corners (n, 2) of its steps by piece."""
    curves = []
    for piece in track.pieces:
        changes = np.flatnonzero(np.diff(piece.control[:-1, k])) + 1
        starts = np.concatenate([[0], changes])
        times = np.stack([piece.time[starts], piece.time[np.append(changes, -1)]], axis=-1)
        curves.append(np.stack([times.ravel(), np.repeat(piece.control[starts, k], 2)], axis=-1))
    return curves
