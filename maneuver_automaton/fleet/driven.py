"""What a fleet drove, looked at again: every pair by shapely, and each vehicle by the audit.

Nothing of how the plans were found or proven is used. Bodies are placed every 5 ms; between two
times no point of a body goes farther than its speed allows, which bounds the distance there, and
where that does not decide the times are halved. Where a disturbance puts a vehicle elsewhere at
once, both places are looked at.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, vector_text
from maneuver_automaton._brief import brief
from maneuver_automaton._lazy import shapely
from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.cutting import begin_state, carried, end_state
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.outline import solid_parts
from maneuver_automaton.collision.shapes import Disc, Shape
from maneuver_automaton.fleet.courses import OFF, Levels, followed
from maneuver_automaton.fleet.result import Closest, FleetLog
from maneuver_automaton.fleet.verdict import CONTACT, NEAR, least_of, plan_of_motion
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem

Heights = tuple[float, float]  # [m]

STEP_S = 0.005  # between the times at which bodies are placed
FINE = 5e-5  # [m] to which the least distance of two bodies is known
MOST_HALVINGS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenVerdict:
    """What was driven, as another library sees it."""

    passed: bool  # nobody touched anybody or anything, and all drove as their models say
    closest: tuple[Closest, ...]  # pairs that came near each other, the nearest first
    clearances_m: Mapping[str, float]  # of each to obstacles; inf where there are none
    jumps_m: Mapping[str, float]  # how far disturbances moved each at most
    defects: Mapping[str, str]  # who did not drive as its model says, and how
    collisions: tuple[str, ...]  # each in a line

    __repr__ = brief

    @property
    def distance_m(self) -> float:
        """Least distance of any two bodies [m]; inf if nobody came near anybody."""
        return min((row.distance_m for row in self.closest), default=math.inf)

    @property
    def clearance_m(self) -> float:
        """Least distance of anybody to an obstacle [m]; inf where there are none."""
        return min(self.clearances_m.values(), default=math.inf)


def verify_driven(log: FleetLog) -> DrivenVerdict:
    """Check what was driven in a fleet's closed loop, say from a file.

    Distances are lower bounds, at most 0.1 mm below the true ones for pairs. Pairs that keep a
    metre more than the fleet's margin are left out.

    Parameters
    ----------
    log : FleetLog

    Returns
    -------
    DrivenVerdict

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, simulate_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [2, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> log = simulate_fleet(FleetProblem(rows, names=["a", "b"]), step=0.5, first_time_limit=1.0)
    >>> verdict = verify_driven(log)
    >>> verdict.passed, round(verdict.distance_m, 3), verdict.closest[0].pair
    (True, 0.4, ('a', 'b'))
    """
    fleet, edges = log.problem, log.times
    clearances, jumps, defects = dict[str, float](), dict[str, float](), dict[str, str]()
    collisions: list[str] = []
    bodies: list[_DrivenBody] = []
    for name, problem, leaves in zip(fleet.names, fleet.problems, fleet.leaves, strict=True):
        shapes_of = {"": problem.footprint, **problem.parts}
        pieces = whole_pieces(log, name).items()
        way = {step: followed(piece, shapes_of) for step, piece in pieces}
        off = OFF if any(piece.maneuvers for piece in way.values()) else 0.0
        gone = log.arrived_s.get(name, math.inf) if leaves else math.inf
        for shapes, parts in _parts(problem, way):
            motions = {step: Motion.of_plan(piece) for step, piece in parts.items()}
            bodies += [
                _DrivenBody(name=name, ring=ring, grown=grown + off, motions=motions, gone=gone)
                for ring, grown in _rings(shapes)
            ]
        gaps = [np.delete(b.start - a.end, 2) for a, b in pairwise(way.values())]
        jumps[name] = max((float(np.linalg.norm(gap)) for gap in gaps), default=0.0)
        clearances[name], when = _clearance(problem, way, edges, gone)
        if clearances[name] <= CONTACT:
            collisions.append(f"{name} touches an obstacle at {when:.6g} s")
        if said := _defect(problem, log.driven[name]):
            defects[name] = said
    rows = _closest(bodies, edges, fleet.margin + NEAR)
    collisions += [
        f"{' and '.join(row.pair)} touch at {row.time_s:.6g} s"
        for row in rows
        if row.distance_m <= CONTACT
    ]
    return DrivenVerdict(
        passed=not (collisions or defects),
        closest=rows,
        clearances_m=clearances,
        jumps_m=jumps,
        defects=defects,
        collisions=tuple(collisions),
    )


def whole_pieces(log: FleetLog, name: str) -> dict[int, Plan]:
    """The pieces that a vehicle drove by step; in those in which it did nothing, it stands."""
    problem = log.problem.problems[log.problem.names.index(name)]
    automaton, pieces = problem.automaton, dict[int, Plan]()
    if problem.start_trim is not None or automaton.rest is not None:
        stands = problem.first_trim
    else:  # what switches at will may just stand
        still = np.zeros(len(automaton.model.control_names))
        stands = Trim(name="stands", body_velocity=np.zeros(problem.start.size), control=still)
    for step, piece in log.pieces_of(name).items():
        if piece.trims:
            stands = piece.trims[-1]
            pieces[step] = piece
        else:
            begin = piece.start_time
            pieces[step] = Plan(piece.start, (stands,), durations=[0.0], start_time=begin)
    return pieces


# -- one vehicle


def _stretches(
    way: Mapping[int, Plan], edges: Array, gone: float, body_height: Heights
) -> Iterator[tuple[Plan, Heights]]:
    """What was driven without a jump, as plans of something that moves at will."""
    run: list[Plan] = []
    low, high = body_height
    for step, piece in way.items():
        motion, until = Motion.of_plan(piece), min(float(edges[step + 1]), gone)
        levels = Levels.of_plan(piece, body_height) if piece.start.size > 3 else None
        if levels is not None:
            low, high = min(low, levels.reach[0]), max(high, levels.reach[1])
        whole = plan_of_motion(motion, until, since=float(edges[step]), levels=levels)
        run.append(whole)
        after = way.get(step + 1)
        if after is None or float(np.abs(after.start - whole.end).max()) > CONTACT:
            driven = replace(
                run[0],
                trims=tuple(trim for one in run for trim in one.trims),
                durations=np.concatenate([one.durations for one in run]),
            )
            yield driven, (low, high)
            run, (low, high) = [], body_height


def _parts(
    problem: Problem, way: Mapping[int, Plan]
) -> Iterator[tuple[tuple[Shape, ...], Mapping[int, Plan]]]:
    """The shapes of a vehicle and of each part that it carries, and what they drove by step."""
    yield problem.footprint, way
    model = problem.automaton.model
    for part, shapes in problem.parts.items():
        yield shapes, {step: carried(piece, model, part) for step, piece in way.items()}


def _clearance(
    problem: Problem, way: Mapping[int, Plan], edges: Array, gone: float
) -> tuple[float, float]:
    """Least distance to obstacles by the audit's bounds [m], and when [s]."""
    best = (math.inf, math.inf)
    if not problem.obstacles:
        return best
    for shapes, pieces in _parts(problem, way):
        for stretch, reach in _stretches(pieces, edges, gone, problem.body_height):
            least = least_of(stretch, shapes, problem.obstacles, reach=reach, enough=CONTACT)
            best = min(best, (least.distance, least.time))
    return best


def _defect(problem: Problem, pieces: Sequence[Plan]) -> str:
    """Why what was driven is none of the model's motions; trims of others are not looked at."""
    before: Plan | None = None
    for piece in pieces:
        if piece.trims and all(
            trim.name not in problem.automaton
            or np.array_equal(trim.body_velocity, problem.automaton[trim.name].body_velocity)
            for trim in piece.trims
        ):
            goal = Goal(pose=piece.end)
            audit = audit_plan(piece, goal, problem.automaton.model, footprint=(), obstacles=())
            if not audit.passed:
                return f"at {piece.start_time:.6g} s: {audit.reason}"
        if piece.trims:
            was = problem.first_trim.reduced_state if before is None else end_state(before)
            now, before = begin_state(piece), piece
            if not same_state(now, was):
                at, states = piece.start_time, (vector_text(was), vector_text(now))
                return f"at {at:.6g} s: its reduced state jumps from {states[0]} to {states[1]}"
    return ""


# -- pairs


@dataclass(slots=True, eq=False, kw_only=True)
class _DrivenBody:
    """One shape of a vehicle: a ring and by how much it is larger, and its motion in each step."""

    name: str
    ring: Array  # (n, 2) in its own frame [m]; one corner of a disc
    grown: float  # [m]
    motions: Mapping[int, Motion]  # by step
    gone: float  # [s] after which it is not there

    @property
    def reach(self) -> float:
        """No point of it is farther from its pose [m]."""
        return float(np.linalg.norm(self.ring, axis=1).max()) + self.grown

    def poses_at(self, times: Array, steps: Array) -> Array:
        """Poses (n, 3) at times (n,) [s] of steps (n,)."""
        found = np.empty((times.size, 3))
        for step in np.unique(steps).tolist():
            rows = steps == step
            found[rows] = self.motions[step].at(np.minimum(times[rows], self.gone))
        return found

    def solids(self, poses: Array) -> Any:
        """It at poses (n, 3), for shapely."""
        corners = SE2(poses[:, None]).act(self.ring)
        return shapely.points(corners[:, 0]) if len(self.ring) == 1 else shapely.polygons(corners)


def _rings(shapes: Sequence[Shape]) -> Iterator[tuple[Array, float]]:
    """Outer corners (n, 2) of each shape, and by how much it is larger [m]; holes are filled."""
    if not shapes:
        yield np.zeros((1, 2)), 0.0
    for shape in shapes:
        if isinstance(shape, Disc):
            yield np.asarray(shape.center)[None], shape.radius
        else:
            for solid in solid_parts(shape):
                yield shapely.get_coordinates(shapely.get_exterior_ring(solid))[:-1], 0.0


def _closest(bodies: Sequence[_DrivenBody], edges: Array, most: float) -> tuple[Closest, ...]:
    """Pairs of vehicles that come nearer than `most` [m], the nearest first."""
    found: dict[tuple[str, str], Closest] = {}
    for one, other in combinations(bodies, 2):
        if one.name == other.name:
            continue
        pair = (one.name, other.name)
        row = _least(one, other, edges, found[pair].distance_m if pair in found else most)
        if row is not None:
            found[pair] = row
    return tuple(sorted(found.values(), key=lambda row: row.distance_m))


def _least(one: _DrivenBody, other: _DrivenBody, edges: Array, most: float) -> Closest | None:
    """Least distance of two bodies and when; None if it is not below `most` [m]."""
    steps = np.array(sorted(one.motions.keys() & other.motions.keys()), dtype=np.int64)
    steps = steps[edges[steps] <= min(one.gone, other.gone)]
    if not steps.size:
        return None
    counts = np.ceil((edges[steps + 1] - edges[steps]) / STEP_S).astype(np.int64)
    which = np.repeat(steps, counts)
    shares = np.concatenate([np.arange(n) / n for n in counts.tolist()])
    width = np.repeat((edges[steps + 1] - edges[steps]) / counts, counts)
    begins = edges[which] + shares * np.repeat(edges[steps + 1] - edges[steps], counts)
    fastest = {
        step: one.motions[step].fastest(one.reach) + other.motions[step].fastest(other.reach)
        for step in steps.tolist()
    }
    best, at = most, math.inf
    for _ in range(MOST_HALVINGS):
        there = begins <= min(one.gone, other.gone)
        begins, width, which = begins[there], width[there], which[there]
        ends = begins + width
        first = _apart(one, other, begins, which, best)
        last = _apart(one, other, ends, which, best)
        for times, values in ((begins, first), (ends, last)):
            if values.size and values.min() < best:
                best, at = float(values.min()), float(times[values.argmin()])
        bound = 0.5 * (first + last - np.array([fastest[k] for k in which.tolist()]) * width)
        open_ = bound < best - FINE
        if best <= 0.0 or not open_.any():
            break
        width = np.repeat(0.5 * width[open_], 2)
        begins = np.repeat(begins[open_], 2)
        begins[1::2] += width[1::2]
        which = np.repeat(which[open_], 2)
    return None if at == math.inf else Closest((one.name, other.name), at, max(best - FINE, 0.0))


def _apart(
    one: _DrivenBody, other: _DrivenBody, times: Array, steps: Array, enough: float
) -> Array:
    """Distance (n,) of two bodies at times (n,) [s]; a lower bound where it is enough."""
    first, second = one.poses_at(times, steps), other.poses_at(times, steps)
    apart = np.hypot(*(first - second)[:, :2].T) - one.reach - other.reach
    near = apart < enough
    if near.any():
        solid = shapely.distance(one.solids(first[near]), other.solids(second[near]))
        apart[near] = solid - one.grown - other.grown
    return np.asarray(apart)
