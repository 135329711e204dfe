"""What the pictures of a fleet's closed loop show: what each vehicle drove, and what it held."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.fleet import FleetLog
from maneuver_automaton.fleet.driven import whole_pieces
from maneuver_automaton.plotting.closed_loop_track import END_TOLERANCE, joined_track
from maneuver_automaton.plotting.colors import Color
from maneuver_automaton.plotting.fleet_cast import Cast, Member, Part, cast_of_members, looks_of
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.primitives import Trim

STANDS = "stands"  # the name of what a vehicle does while it has nothing to do


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """Pieces that were driven one after the other, each from where the vehicle was then."""

    pieces: tuple[Plan, ...]  # each until the next one begins
    duration: float  # [s] until it arrived, or the loop ended
    begins: Array = field(init=False)  # (n,) [s]

    def __post_init__(self) -> None:
        object.__setattr__(self, "begins", np.array([one.start_time for one in self.pieces]))

    @property
    def start_time(self) -> float:
        """When the first piece begins [s]."""
        return self.pieces[0].start_time

    def pose_at(self, time: ArrayLike, /) -> Array:
        """Poses (..., dof) at times (...,) [s], held before the begin and after the end."""
        times = np.asarray(time, dtype=np.float64)
        flat = times.ravel()
        which = np.maximum(np.searchsorted(self.begins, flat, side="right") - 1, 0)
        found = np.empty((flat.size, self.pieces[0].start.size))
        for k in np.unique(which).tolist():
            rows = which == k
            found[rows] = self.pieces[k].pose_at(flat[rows])
        return found.reshape(*times.shape, -1)


def loop_cast_of(log: FleetLog) -> Cast:
    """The vehicles of a closed loop, with what they drove, and what is around them.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, simulate_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [2, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> log = simulate_fleet(FleetProblem(rows, names=["a", "b"]), step=0.5, first_time_limit=1.0)
    >>> cast = loop_cast_of(log)
    >>> [(one.name, one.arrival, one.arrives) for one in cast.members]
    [('a', 2.0, True), ('b', 2.0, True)]
    """
    labels, colors = looks_of(log.problem.names)
    members = tuple(
        _member(log, k, label=label, color=color)
        for k, (label, color) in enumerate(zip(labels, colors, strict=True))
    )
    return cast_of_members(members, margin=log.problem.margin)


def _member(log: FleetLog, k: int, *, label: str, color: Color) -> Member:
    fleet = log.problem
    name, problem = fleet.names[k], fleet.problems[k]
    pieces, model = _filled(log, name), problem.automaton.model
    if not pieces:
        stands = Plan(problem.start, (problem.first_trim,), durations=[0.0])
        body = Part(shapes=tuple(problem.footprint), motion=stands)
        return Member(
            name=name, label=label, color=color, problem=problem, course=None, parts=(body,),
            track=Track(problem.start, ()), leaves=fleet.leaves[k], arrives=False,
            reason="it was never let in", there_from=math.inf,
        )  # fmt: skip
    begin, arrived = float(log.times[0]), log.arrived_s.get(name)
    end = float(log.times[-1]) if arrived is None else arrived
    course = Driven(pieces, max(end - pieces[0].start_time, 0.0))
    parts = [Part(shapes=tuple(problem.footprint), motion=course)]
    for part, shapes in problem.parts.items():
        moved = tuple(carried(piece, model, part) for piece in pieces)
        parts.append(Part(shapes=tuple(shapes), motion=Driven(moved, course.duration)))
    first = pieces[0].start_time
    return Member(
        name=name,
        label=label,
        color=color,
        problem=problem,
        course=course,
        parts=tuple(parts),
        track=joined_track(pieces[0].start, pieces),
        leaves=fleet.leaves[k],
        reason="" if arrived is not None else _why_not(log, name),
        arrives=arrived is not None,
        there_from=first if first > begin and next(iter(log.pieces_of(name))) > 0 else -math.inf,
    )


def _why_not(log: FleetLog, name: str) -> str:
    return "it broke down" if name in log.broken_down else "it is under way still"


def _filled(log: FleetLog, name: str) -> tuple[Plan, ...]:
    """The pieces of a vehicle until it arrived, each with a rest until the next step begins."""
    filled: list[Plan] = []
    arrived = log.arrived_s.get(name, math.inf)
    for step, piece in whole_pieces(log, name).items():
        if filled and piece.start_time >= arrived:
            break
        until = min(float(log.times[step + 1]), max(arrived, piece.start_time + piece.duration))
        left = until - piece.start_time - piece.duration
        filled.append(piece if left <= END_TOLERANCE else _standing_after(piece, left))
    return tuple(filled)


def _standing_after(piece: Plan, lasting: float) -> Plan:
    last = piece.trims[-1]
    still = Trim(
        name=STANDS,
        body_velocity=np.zeros(piece.start.size),
        control=np.zeros_like(last.control),
        reduced_state=last.reduced_state,
    )
    between = (*piece.maneuvers, None) if piece.maneuvers else ()
    return Plan(
        piece.start,
        (*piece.trims, still),
        durations=[*piece.durations.tolist(), lasting],
        maneuvers=between,
        start_time=piece.start_time,
    )


def held_tracks(log: FleetLog, name: str) -> list[tuple[float, Track]]:
    """When a vehicle held another plan than before [s], and the way of that plan from there on."""
    rows: list[tuple[float, Track]] = []
    held: Plan | None = None
    for step in log.steps:
        if name in step.plans and step.plans[name] is not held:
            held = step.plans[name]
            rows.append((float(step.time), track_of_plan(step.driven[name])))
    return rows


def jumps_of(log: FleetLog, name: str) -> list[tuple[float, Array]]:
    """When and from where to where (2, 2) a vehicle was put beside what it drove [s, m]."""
    pieces, rows = log.pieces_of(name), []
    for step, piece in pieces.items():
        after = pieces.get(step + 1)
        if after is None:
            continue
        line = np.array([piece.end[:2], after.start[:2]])
        if np.abs(line[1] - line[0]).max() > END_TOLERANCE:
            rows.append((float(log.times[step + 1]), line))
    return rows


def vehicle_values(log: FleetLog, name: str) -> Array:
    """What a vehicle has left to pay at the times of the log (n + 1,); nan where it is not known.

    Nothing once it has arrived.
    """
    values = np.array([step.values.get(name, math.nan) for step in log.steps] or [math.nan])
    last = 0.0 if name in log.arrived_s else math.nan
    values = np.append(values, last) if log.steps else values
    values[~np.isfinite(values)] = math.nan
    values[log.times >= log.arrived_s.get(name, math.inf)] = 0.0
    return values


def fleet_values(log: FleetLog) -> Array:
    """What all have left to pay at the times of the log (n + 1,); nan where it is not known.

    Nothing at the end if all have arrived who can.
    """
    values = np.where(np.isfinite(log.values), log.values, math.nan)
    return np.append(values, 0.0 if log.reached else math.nan)[: log.times.size]


def fleet_costs(log: FleetLog) -> Array:
    """What all had spent at the times of the log (n + 1,)."""
    costs = np.zeros(log.times.size)
    for name in log.problem.names:
        for step, cost in log.costs_of(name).items():
            costs[step + 1] += cost
    return np.cumsum(costs)
