"""What the pictures of a fleet show: its vehicles, each in its colour, and what is around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import AnyObstacle, Disc, Obstacle, Shape
from maneuver_automaton.collision.outline import outlines, rings_of
from maneuver_automaton.fleet import FleetResult
from maneuver_automaton.plotting.colors import Color, fleet_colors
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.obstacles import round_times
from maneuver_automaton.plotting.scene import ROOM, STILL_SIZE_M, Scene, view_box
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.problem import Bounds, Problem

MOST_NAMES = 12  # of vehicles in a legend; more have numbers at their starts
MOST_LABEL = 4  # characters of a name that stands at a start itself
STEPS, STEPS_OF_MANY = 10, 5  # between the times at which bodies are shown
REST = 1e-9  # [m/s, rad/s]: what is slower rests


class Course(Protocol):
    """What a vehicle drives: a plan, or piece after piece of a closed loop."""

    @property
    def start_time(self) -> float:
        """When it may leave its start [s]."""

    @property
    def duration(self) -> float:
        """How long it takes to arrive [s]."""

    def pose_at(self, time: ArrayLike, /) -> Array:
        """Poses (..., dof) at times (...,) [s], before and after it too."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Part:
    """One part of a vehicle, the vehicle itself or what it carries: its shapes and its motion."""

    shapes: tuple[Shape, ...]  # none: a point
    motion: Course

    def outlines_at(self, times: Array) -> list[Array]:
        """Outlines (n, 2) at times (m,) [s], first one shape at all times, then the next."""
        return placed(footprint_polygons(list(self.shapes)), self.motion.pose_at(times))

    @property
    def rings(self) -> list[tuple[Array, float]]:
        """Corners (n, 2) of each shape and by how much it is larger [m]; a disc has one corner."""
        rows: list[tuple[Array, float]] = []
        for shape in self.shapes:
            if isinstance(shape, Disc):
                rows.append((np.asarray(shape.center)[None], shape.radius))
            else:
                rows += [(next(iter(rings_of(one))), 0.0) for one in outlines(shape)]
        return rows or [(np.zeros((1, 2)), 0.0)]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Member:
    """A vehicle of a fleet: where it goes and when; without a plan it stands at its start."""

    name: str
    label: str  # where there is little room
    color: Color
    problem: Problem
    course: Course | None  # what it drives; None: it has no plan
    parts: tuple[Part, ...]
    track: Track
    leaves: bool
    reason: str  # why it has no plan
    arrives: bool = True  # its course ends at a goal
    there_from: float = -np.inf  # [s] when it appears

    @property
    def begin(self) -> float:
        """When it may leave its start [s]."""
        return self.problem.start_time if self.course is None else self.course.start_time

    @property
    def arrival(self) -> float:
        """When its course ends [s]; its begin if it has none."""
        return self.begin + (0.0 if self.course is None else self.course.duration)

    @property
    def gone_after(self) -> float:
        """When it is gone [s]; inf if it stays."""
        there = self.leaves and self.course is not None and self.arrives
        return self.arrival if there else np.inf

    @property
    def spans(self) -> list[tuple[float, float, bool]]:
        """Begin, end [s] and whether it rests, of all that it does in a row."""
        rows: list[tuple[float, float, bool]] = []
        for piece in self.track.pieces:
            first, last = float(piece.time[0]), min(float(piece.time[-1]), self.arrival)
            if first >= self.arrival:
                break
            rests = float(np.abs(np.diff(piece.pose, axis=0)).max(initial=0.0)) <= REST
            if rows and rows[-1][2] == rests:
                rows[-1] = (rows[-1][0], last, rests)
            else:
                rows.append((first, last, rests))
        return rows

    @property
    def outlines(self) -> list[Array]:
        """Outlines (n, 2) of its body in its own frame [m]; none if it is a point."""
        return footprint_polygons(list(self.parts[0].shapes))

    @property
    def reach(self) -> float:
        """No point of its body is further from its pose [m]."""
        return max((float(np.linalg.norm(one, axis=1).max()) for one in self.outlines), default=0.0)

    @property
    def goal_outlines(self) -> list[Array]:
        """Outlines (n, 2) of its body at its goals, those of any heading left out [m]."""
        poses = [goal.pose for goal in self.problem.goals if not goal.free_heading]
        return placed(self.outlines, np.array(poses)) if poses else []

    def is_there(self, time: float) -> bool:
        """Whether it has appeared by a time [s], and not left."""
        return self.there_from <= time <= self.gone_after

    def bodies_at(self, time: float) -> list[Array]:
        """Outlines (n, 2) of all its parts at a time [s]; none where it is a point, or gone."""
        if not self.is_there(time):
            return []
        return [ring for part in self.parts for ring in part.outlines_at(np.array([time]))]

    def ends(self) -> Array:
        """Start, end of its course, and its goals (n, 2) [m]."""
        goals = [goal.pose[:2] for goal in self.problem.goals]
        return np.array([self.track.start[:2], self.track.end[:2], *goals])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cast:
    """All vehicles of a fleet, what is around them, and the box (2, 2) that holds all that."""

    members: tuple[Member, ...]
    scene: Scene
    margin: float  # [m] that any two bodies keep
    box: Array

    @property
    def begin(self) -> float:
        """When the first may leave its start [s]."""
        return min(one.begin for one in self.members)

    @property
    def end(self) -> float:
        """When the last arrives [s]."""
        return max(one.arrival for one in self.members)

    @property
    def many(self) -> bool:
        """Whether they are too many for a legend."""
        return len(self.members) > MOST_NAMES


def cast_of(result: FleetResult) -> Cast:
    """The vehicles of a `result` and what is around them.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, plan_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [3, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> cast = cast_of(plan_fleet(FleetProblem(rows, names=["a", "b"]), max_rounds=0))
    >>> [(one.name, one.arrival) for one in cast.members], cast.end
    ([('a', 3.0), ('b', 3.0)], 3.0)
    """
    labels, colors = looks_of(result.problem.names)
    members = tuple(
        _member(result, k, label=labels[k], color=colors[k]) for k in range(len(labels))
    )
    return cast_of_members(members, margin=result.problem.margin)


def looks_of(names: Sequence[str]) -> tuple[list[str], list[Color]]:
    """What vehicles are called where there is little room, and their colours."""
    short = max(map(len, names)) <= MOST_LABEL
    labels = [name if short else str(k + 1) for k, name in enumerate(names)]
    return labels, list(fleet_colors(len(names)))


def cast_of_members(members: tuple[Member, ...], *, margin: float) -> Cast:
    """Vehicles, what is around them, and the box around all that; `margin` [m] is the fleet's."""
    begin, end = min(one.begin for one in members), max(one.arrival for one in members)
    problems = [one.problem for one in members]
    obstacles = _distinct_obstacles(problems)
    moves = any(isinstance(one, Obstacle) and one.motion is not None for one in obstacles)
    few = moves or len(members) > MOST_NAMES
    scene = Scene(
        goals=(),
        obstacles=obstacles,
        zones=tuple({id(zone): zone for one in problems for zone in one.zones}.values()),
        bounds=_loosest([one.bounds for one in problems]),
        times=round_times(begin, end, most=STEPS_OF_MANY if few else STEPS),
    )
    return Cast(members=members, scene=scene, margin=margin, box=_box(members, scene))


def _member(result: FleetResult, k: int, *, label: str, color: Color) -> Member:
    fleet = result.problem
    name, problem = fleet.names[k], fleet.problems[k]
    answer = result.results[name]
    plan = answer.plan
    stands = Plan(problem.start, (problem.first_trim,), durations=[0.0])
    motion, model = plan or stands, problem.automaton.model
    parts = [Part(shapes=tuple(problem.footprint), motion=motion)]
    for part, shapes in problem.parts.items():
        parts.append(Part(shapes=tuple(shapes), motion=carried(motion, model, part)))
    return Member(
        name=name,
        label=label,
        color=color,
        problem=problem,
        course=plan,
        parts=tuple(parts),
        track=Track(problem.start, ()) if plan is None else track_of_plan(plan),
        leaves=fleet.leaves[k],
        reason="" if plan is not None else result.reasons.get(name) or answer.reason,
    )


def _distinct_obstacles(problems: Sequence[Problem]) -> tuple[AnyObstacle, ...]:
    """What is around any of them, once: problems made alike hold the same shapes and maps."""
    found: dict[tuple[int, ...], AnyObstacle] = {}
    for problem in problems:
        for one in problem.obstacles:
            same = (id(one.shape), id(one.motion)) if isinstance(one, Obstacle) else (id(one),)
            found.setdefault(same, one)
    return tuple(found.values())


def _loosest(bounds: Sequence[Bounds]) -> Bounds:
    """Bounds that hold all of the bounds."""

    def hull(sides: Sequence[tuple[float, float] | None]) -> tuple[float, float] | None:
        known = [side for side in sides if side is not None]
        if len(known) < len(sides):
            return None
        return min(low for low, _ in known), max(high for _, high in known)

    return Bounds(x=hull([one.x for one in bounds]), y=hull([one.y for one in bounds]))


def _box(members: Sequence[Member], scene: Scene) -> Array:
    points = [row for one in members for row in (one.track.pose[:, :2], one.ends())]
    for one in members:
        times = np.append(one.begin, one.track.switching_times)
        points += [corners for part in one.parts for corners in part.outlines_at(times)]
        points += one.goal_outlines
    every = np.concatenate(points)
    size = float(np.ptp(every, axis=0).max())
    size = size if size > 0.0 else STILL_SIZE_M
    if not any(part.shapes for one in members for part in one.parts):
        every = np.concatenate([every - 0.5 * ROOM * size, every + 0.5 * ROOM * size])
    return view_box(scene, every, size=size)
