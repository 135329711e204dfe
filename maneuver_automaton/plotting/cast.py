"""What is drawn of a recording: who drives, among what, and how much of it a picture shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc, Obstacle, OccupancyMap, Shape
from maneuver_automaton.collision.outline import outlines, rings_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import SEQUENCE, Color, fleet_colors, track_colors
from maneuver_automaton.plotting.obstacles import (
    limit_boxes,
    moving_shapes,
    round_times,
    shape_path,
    static_shapes,
)
from maneuver_automaton.plotting.style import count_from_near, tidy, word_text
from maneuver_automaton.plotting.track import (
    Track,
    footprint_polygons,
    joined_track,
    placed,
    track_of_plan,
)
from maneuver_automaton.problem import Goal
from maneuver_automaton.recording import Environment, Mover, Recording

STILL_SIZE_M = 1.0  # size of a path that goes nowhere
ROOM = 0.16  # around start and goals where the body is not known, of the size
MARGIN = 0.04  # around all, of the axes
MUCH_LARGER = 2.5  # surroundings so much larger than what happens in them are cropped
KEPT = 0.5  # of them around what happens, of its size
BODIES, LEAST_MARK = 8.0, 0.35  # marks suit a path of so many bodies, or this share of the path
IN_VIEW = 0.5  # or, among obstacles, one that takes this share of the picture


def view_box(world: Environment, times: Array, points: Array, *, size: float) -> Array:
    """Corners (2, 2) of what a picture shows around `points` (n, 2), where something happens.

    All obstacles and limits, unless they are much larger than that: then those that are near.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    paths = [shape_path(one.shape) for one in static_shapes(world.obstacles)]
    paths += [one.at(t) for one in moving_shapes(world.obstacles) for t in times.tolist()]
    maps = [one for one in world.obstacles if isinstance(one, OccupancyMap) and one.blocked.any()]
    around = [np.asarray(path.get_extents().get_points()) for path in paths]
    around += [*map(_map_box, maps), *limit_boxes(world.zones, world.bounds)]
    boxes = np.concatenate([np.zeros((0, 2)), *around])
    if not boxes.size:
        return np.array([low, high])
    all_low, all_high = np.minimum(low, boxes.min(axis=0)), np.maximum(high, boxes.max(axis=0))
    here = max(float((high - low).max()), size)
    if float((all_high - all_low).max()) > MUCH_LARGER * here:
        all_low = np.maximum(all_low, low - KEPT * here)
        all_high = np.minimum(all_high, high + KEPT * here)
    return np.array([all_low, all_high])


def mark_size(one: Actor, world: Environment, box: Array, *, size: float) -> float:
    """Size of a path [m] that the marks of a picture suit.

    The path's own, but smaller for a small body on a long path, and larger where obstacles take
    most of the picture.
    """
    if one.body:
        size = min(size, max(BODIES * one.reach, LEAST_MARK * size))
    if world.obstacles:
        size = max(size, IN_VIEW * float((box[1] - box[0]).max()))
    return size


def set_view(ax: Axes, box: Array, place: Array) -> None:
    """Show a `box` (2, 2) in equal scales; numbers far away are counted from near a `place`."""
    both_shared = all(
        len(group.get_siblings(ax)) > 1
        for group in (ax.get_shared_x_axes(), ax.get_shared_y_axes())
    )
    ax.set_aspect("equal", adjustable="box" if both_shared else "datalim")
    ax.update_datalim(box)
    ax.margins(MARGIN)
    ax.autoscale_view()
    tidy(ax, x="x [m]", y="y [m]")
    count_from_near(ax, place)


def _map_box(cells: OccupancyMap) -> Array:
    rows, columns = (np.flatnonzero(cells.blocked.any(axis=axis)) for axis in (1, 0))
    x = cells.resolution * np.array([columns[0], columns[-1] + 1.0])
    y = cells.resolution * np.array([rows[0], rows[-1] + 1.0])
    corners = SE2(cells.origin).act(np.array([[a, b] for a in x for b in y]))
    return np.array([corners.min(axis=0), corners.max(axis=0)])


TINY = 0.008  # of the picture: smaller bodies are marks at starts and goals
MOST_NAMES = 12  # of vehicles in a legend; more have numbers at their starts
MOST_LABEL = 4  # characters of a name that stands at a start itself
STEPS, STEPS_OF_MANY = 10, 5  # between the times at which bodies are shown
REST = 1e-9  # [m/s, rad/s]: what is slower rests
JUMP_M = 1e-9  # [m] between the end of a piece and the start of the next
BESIDE_M = 25.0  # [m] on roads, others are in view so near to those who drive
ROADSIDE_M = 12.0  # [m] around all that drives on roads


@dataclass(frozen=True, eq=False, kw_only=True)
class Actor:
    """A vehicle: what it drove as a track, its body, and how it is told from others."""

    mover: Mover
    name: str
    label: str  # where there is little room
    color: Color
    track: Track
    held: tuple[tuple[float, Track], ...]  # the plan held from a time on [s]

    @cached_property
    def parts(self) -> tuple[Mover, ...]:
        """The vehicle, then what it carries."""
        return self.mover.parts if self.mover.has_plan else (self.mover,)

    @cached_property
    def carried(self) -> list[tuple[list[Array], Track]]:
        """Outlines (n, 2) [m] and track of each part that it carries."""
        return [
            (footprint_polygons(part.bodies[""]), joined_track(part.start, part.pieces))
            for part in self.parts[1:]
        ]

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Where it was to go; where it ended if that is not known."""
        return (Goal(self.track.end),) if self.mover.problem is None else self.mover.goals

    @property
    def reached(self) -> int | None:
        """Which of the goals it ends at; None if at none."""
        return 0 if self.mover.problem is None else self.mover.goal_index

    @cached_property
    def body(self) -> list[Array]:
        """Outlines (n, 2) of its body in its own frame [m]; none if it is not known."""
        return footprint_polygons(self.mover.bodies.get("", ()))

    @property
    def reach(self) -> float:
        """No point of its body is further from its pose [m]."""
        return max((float(np.linalg.norm(one, axis=1).max()) for one in self.body), default=0.0)

    @property
    def goal_outlines(self) -> list[Array]:
        """Outlines (n, 2) of its body at its goals, those of any heading left out [m]."""
        poses = [goal.pose for goal in self.mover.goals if not goal.free_heading]
        return placed(self.body, np.array(poses)) if poses else []

    @property
    def spans(self) -> list[tuple[float, float, bool]]:
        """Begin, end [s] and whether it rests, of all that it does in a row."""
        rows: list[tuple[float, float, bool]] = []
        for piece in self.track.pieces:
            first, last = float(piece.time[0]), min(float(piece.time[-1]), self.mover.arrival)
            if first >= last:
                break
            rests = float(np.abs(np.diff(piece.pose, axis=0)).max(initial=0.0)) <= REST
            if rows and rows[-1][2] == rests:
                rows[-1] = (rows[-1][0], last, rests)
            else:
                rows.append((first, last, rests))
        return rows

    @property
    def jumps(self) -> list[tuple[float, Array]]:
        """When and from where to where (2, 2) it was put beside what it drove [s, m]."""
        pieces = self.mover.pieces
        rows = [
            (after.start_time, np.array([one.end[:2], after.start[:2]]))
            for one, after in pairwise(pieces)
        ]
        last = np.array([pieces[-1].end[:2], np.asarray(self.mover.end)[:2]])
        rows.append((self.mover.arrival, last))
        return [(time, line) for time, line in rows if np.abs(line[1] - line[0]).max() > JUMP_M]

    @property
    def decisions(self) -> Array:
        """Poses (n, dof) at which its pieces begin, and its end; none between if it has a plan."""
        return np.array([*(piece.start for piece in self.mover.pieces), self.mover.end])

    def bodies_at(self, time: float) -> list[Array]:
        """Outlines (n, 2) of all its parts at a time [s]; none where it is a point, or gone."""
        return self.bodies_along(np.array([time])) if self.mover.is_there(time) else []

    def bodies_along(self, times: Array) -> list[Array]:
        """Outlines (n, 2) of all its parts at times (n,) [s], first one shape, then the next."""
        return [
            ring
            for part in (self.parts if self.body else ())
            for ring in placed(footprint_polygons(part.bodies[""]), part.pose_at(times))
        ]

    def points(self, size: float) -> Array:
        """Places (n, 2) where something happens: tracks, bodies along them, start and goals."""
        goals = [goal.pose for goal in self.mover.goals]
        on_the_way = [one.pose for one in self.mover.via]
        ends = np.array([self.track.start, np.asarray(self.mover.end), *goals, *on_the_way])
        room = 0.0 if self.body else ROOM * size
        held = [track.pose[:, :2] for _, track in self.held]
        times = np.append(self.mover.start_time, self.track.switching_times)
        bodies = self.bodies_along(times) + placed(
            self.body, np.concatenate([ends, self.decisions])
        )
        return np.concatenate(
            [self.track.pose[:, :2], ends[:, :2] - room, ends[:, :2] + room, *held, *bodies]
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cast:
    """All vehicles of a recording, what is around them, and the box (2, 2) around all that."""

    recording: Recording
    actors: tuple[Actor, ...]
    times: Array  # (n,) at which bodies and what moves are shown [s]
    colors: Mapping[str, Color]  # of trims, by name
    box: Array
    size: float  # [m] of the marks in the picture

    @property
    def end(self) -> float:
        """When the last arrives [s]."""
        return max(one.mover.arrival for one in self.actors)

    @property
    def is_alone(self) -> bool:
        """Whether there is one vehicle, so that colours are free to tell its trims apart."""
        return len(self.actors) == 1 and not self.on_roads

    @property
    def on_roads(self) -> bool:
        """Whether there are lanes."""
        return bool(self.recording.world.lanes)

    @property
    def obstacles_move(self) -> bool:
        """Whether an obstacle moves."""
        obstacles = self.recording.world.obstacles
        return any(isinstance(one, Obstacle) and one.motion is not None for one in obstacles)

    @property
    def small(self) -> list[Actor]:
        """Vehicles so small in the picture that marks show where they start and end."""
        least = TINY * float(np.ptp(self.box, axis=0).max())
        return [one for one in self.actors if one.reach < least]

    @property
    def is_many(self) -> bool:
        """Whether they are too many for a legend."""
        return len(self.actors) > MOST_NAMES


def cast_of(recording: Recording) -> Cast:
    """The vehicles of a recording, and what is around them."""
    movers = recording.movers
    names = [one.name for one in movers]
    short = max(map(len, names)) <= MOST_LABEL
    colors = fleet_colors(len(movers))
    what = "problem " if recording.world.lanes and names[0] else ""
    actors = tuple(
        _actor(one, f"{what}{one.name}", one.name if short else str(k + 1), color)
        for k, (one, color) in enumerate(zip(movers, colors, strict=True))
    )
    return _cast(recording, actors)


def cast_of_alternatives(recording: Recording, *, width: int) -> Cast:
    """The plans of one vehicle as if each had one of its own; names of about `width` characters."""
    plans = (recording.movers[0], *recording.alternatives)
    actors = []
    for rank, one in enumerate(plans):
        price = "" if one.cost is None else f"cost {one.cost:.5g}   "
        word = word_text(one.pieces[0].word, width=width - len(price), lines=1)
        actors.append(_actor(one, price + word, str(rank + 1), SEQUENCE[rank % len(SEQUENCE)]))
    return _cast(replace(recording, movers=plans), tuple(actors))


def _actor(mover: Mover, name: str, label: str, color: Color) -> Actor:
    return Actor(
        mover=mover,
        name=name,
        label=label,
        color=color,
        track=joined_track(mover.start, mover.pieces) if mover.has_plan else Track(mover.start, ()),
        held=tuple((time, track_of_plan(plan)) for time, plan in mover.held),
    )


def _cast(recording: Recording, actors: tuple[Actor, ...]) -> Cast:
    first, world = actors[0], recording.world
    alone = len(actors) == 1 and not world.lanes
    times = _times(recording, alone=alone)
    size = max(_size(one) for one in actors)
    points = np.concatenate([one.points(size) for one in actors])
    if not alone:
        points = np.concatenate([points, *(ring for one in actors for ring in one.goal_outlines)])
        size = float(np.ptp(points, axis=0).max()) or STILL_SIZE_M
    box = _road_box(recording, points) if world.lanes else view_box(world, times, points, size=size)
    twists: dict[str, Array] = {}  # of all trims that are planned or driven
    for one in actors:
        for track in (*(track for _, track in one.held), one.track):
            twists |= {name: twist for name, twist in track.twists.items() if name not in twists}
    return Cast(
        recording=recording, actors=actors, times=times, colors=track_colors(twists), box=box,
        size=mark_size(first, world, box, size=size) if alone else size,
    )  # fmt: skip


def _times(recording: Recording, *, alone: bool) -> Array:
    """Times (n,) at which bodies and what moves are shown [s]."""
    begin, end = recording.begin, max(one.arrival for one in recording.movers)
    motions = [
        one.motion for one in recording.world.obstacles if isinstance(one, Obstacle) and one.motion
    ]
    if alone and not recording.movers[0].has_plan:
        end = max((float(one.time[-1]) for one in motions), default=begin)
    few = alone or motions or len(recording.movers) > MOST_NAMES
    return round_times(begin, end, most=STEPS_OF_MANY if few else STEPS)


def _size(one: Actor) -> float:
    """Size of what a vehicle does [m]: the symmetry leaves it alone."""
    places = [one.track.pose[:, :2], *(track.pose[:, :2] for _, track in one.held)]
    goals = [goal.pose[None, :2] for goal in one.mover.goals]
    apart = np.linalg.norm(np.concatenate([*places, *goals]) - one.track.start[:2], axis=1)
    size = max(float(apart.max()), 2.0 * one.reach)
    return size if size > 1e-9 else STILL_SIZE_M


def _road_box(recording: Recording, points: Array) -> Array:
    """Corners (2, 2) around those who drive, the goals ahead of them, and who is beside them."""
    low, high = points.min(axis=0), points.max(axis=0)
    here = float((high - low).max())
    every = [points]
    for shape in (shape for one in recording.movers for shape in one.regions):
        corners = np.asarray(shape_path(shape).vertices)
        if float(np.ptp(corners, axis=0).max()) <= here:
            every.append(corners)
    low, high = low - BESIDE_M, high + BESIDE_M
    for one in (one for one in recording.world.obstacles if isinstance(one, Obstacle)):
        for time in np.linspace(recording.begin, recording.end, STEPS_OF_MANY):
            if recording.world.is_there(one, float(time)):
                corners = np.asarray(shape_path(one.shape).vertices)
                if one.motion is not None:
                    corners = np.asarray(SE2(one.motion.at(float(time))).act(corners))
                if (corners > low).all() and (corners < high).all():
                    every.append(corners)
    whole = np.concatenate(every)
    return np.array([whole.min(axis=0) - ROADSIDE_M, whole.max(axis=0) + ROADSIDE_M])


def rings_with_radius(shapes: Sequence[Shape]) -> list[tuple[Array, float]]:
    """Corners (n, 2) of each shape and by how much it is larger [m]; a disc has one corner."""
    rows: list[tuple[Array, float]] = []
    for shape in shapes:
        if isinstance(shape, Disc):
            rows.append((np.asarray(shape.center)[None], shape.radius))
        else:
            rows += [(next(iter(rings_of(one))), 0.0) for one in outlines(shape)]
    return rows or [(np.zeros((1, 2)), 0.0)]
