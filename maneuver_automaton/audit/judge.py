"""The audit of a finished plan: its dynamics, its ends, its limits and its clearance."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.clearance import CONTACT, Least, least_clearance
from maneuver_automaton.audit.drive import Drive, driven
from maneuver_automaton.audit.frames import Frames
from maneuver_automaton.audit.outlines import body_outline
from maneuver_automaton.audit.pairs import spans_within
from maneuver_automaton.audit.passages import Body
from maneuver_automaton.audit.sentences import nearest_at, what_is_hit
from maneuver_automaton.audit.surroundings import Surroundings, origin_of, surroundings_of
from maneuver_automaton.audit.values import Audit, TerminalError, distance_to, seen_from
from maneuver_automaton.audit.zones import zones_broken
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision.shapes import AnyObstacle, Shape
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.models import Model
from maneuver_automaton.problem import Goal

DEFECT_TOLERANCE = 1e-8  # [m, rad] between plan and integration, per metre, radian, second driven
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance
LIMIT_TOLERANCE = 1e-9  # relative to the limit, at least to 1, by which a value may exceed it
STATE_TOLERANCE = 1e-9  # [model's units] of the first and the last reduced state
MOST_TURNED = 2e4  # [rad] of a plan that is driven again, in elements of less than a radian each
UNRESOLVED = 1e-3  # [m] by which a distance may not be known sharply enough to decide

Around: TypeAlias = Callable[[tuple[AnyObstacle, ...], tuple[float, float]], Surroundings]


def audit_plan(
    plan: Plan,
    goal: Goal,
    model: Model,
    *,
    footprint: tuple[Shape, ...] = (),
    parts: Mapping[str, tuple[Shape, ...]] | None = None,
    obstacles: tuple[AnyObstacle, ...] = (),
    body_height: tuple[float, float] = (0.0, 0.0),
    margin: float = 0.0,
    states: tuple[Array, Array] | None = None,
    zones: tuple[Zone, ...] = (),
    around: Around = surroundings_of,
    ask: Callable[[], None] = lambda: None,
) -> Audit:
    """Drive a finished plan again under its controls, and bound its distance to the obstacles.

    Parameters
    ----------
    plan : Plan
        What is about to be returned.
    goal : Goal
        Where it must end, to within its tolerance.
    model : Model
        The vehicle's equations; they alone are used.
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    parts : mapping of str to tuple of Shape, optional
        What the vehicle carries, by name, each in its own frame.
    obstacles : tuple of Obstacle or OccupancyMap
        Obstacles that it must not touch.
    body_height : (float, float)
        From where to where the body reaches about its altitude [m].
    margin : float
        Distance to keep [m].
    states : two (n_z,) arrays, optional
        Reduced states in which it must begin and end.
    zones : tuple of Zone
        Where not every motion is admitted.
    around : callable
        The surroundings of some obstacles, say from a store of those of the map.
    ask : callable
        Called before each part of the work; it may raise to give it up.

    Returns
    -------
    Audit
        ``passed`` if no sample is further than 1e-8 (relative to the path driven) from where the
        controls lead from the start, that ends within 1e-9 of the goal, reduced states and
        controls keep the model's limits, no obstacle is touched or closer than the margin, and no
        zone is entered with a motion that it does not admit.
        ``min_clearance_m`` is guaranteed: at no instant it is less; it is at most 1 mm or 1 % below
        the true one. None without obstacles.
    """
    near = seen_from(plan, goal)
    turned = sum(
        abs(float(t.body_velocity[2])) * d for t, d in zip(near.trims, near.durations, strict=True)
    )
    if turned > MOST_TURNED:
        return _not_driven(
            near, goal, f"it turns by {turned:.3g} rad, need at most {MOST_TURNED:g}"
        )
    drive = driven(near, model)
    missed = distance_to(drive.end, goal)
    reasons = []
    most = DEFECT_TOLERANCE * (1.0 + near.duration + np.abs(drive.frames.nodes).max(axis=(0, 1)))
    if not (drive.off <= most.max() and drive.turned <= most[2]):
        reasons.append(f"the plan is {drive.off:.3g} off the model's equations")
    reasons += _off_the_goal(missed, goal)
    reasons += _beyond_limits(drive)
    if states is not None:
        reasons += _wrong_ends(near, states)
    origin = origin_of(goal.pose)
    bodies = {"": _body(drive.frames, footprint, plan, goal, body_height)}
    for name, shapes in (parts or {}).items() if obstacles or zones else ():
        bodies[name] = _body(drive.part(name), shapes, plan, goal, body_height)
    scene = (obstacles, origin, margin, ask)
    distances = []
    for name, body in bodies.items() if obstacles else ():
        least, hit = _clearance(body, around(obstacles, origin), *scene)
        distances.append(least.distance)
        reasons += [f"the {name}: {hit}" if name else hit] if hit else []
    reasons += zones_broken(drive, list(bodies.values()), zones, origin)
    return Audit(
        passed=not reasons,
        max_dynamics_defect=drive.off,
        min_clearance_m=min(filter(math.isfinite, distances), default=None),
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
    )


def _not_driven(near: Plan, goal: Goal, reason: str) -> Audit:
    """The audit of a plan that nobody can drive again."""
    missed = distance_to(near.end, goal)
    return Audit(
        passed=False,
        max_dynamics_defect=math.inf,
        min_clearance_m=None,
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason=reason,
    )


def closest_to(
    plan: Plan,
    model: Model,
    obstacles: tuple[AnyObstacle, ...],
    *,
    footprint: tuple[Shape, ...],
    parts: Mapping[str, tuple[Shape, ...]] | None = None,
    body_height: tuple[float, float] = (0.0, 0.0),
    within: tuple[float, float] = (-math.inf, math.inf),
    enough: float = 0.0,
    ask: Callable[[], None] = lambda: None,
) -> Least:
    """The least clearance of a plan to obstacles, and when.

    Parameters
    ----------
    plan : Plan
    model : Model
        The vehicle's equations.
    obstacles : tuple of Obstacle or OccupancyMap
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    parts : mapping of str to tuple of Shape, optional
        What the vehicle carries, by name, each in its own frame.
    body_height : (float, float)
        From where to where the body of a plan in space reaches about its altitude [m].
    within : (float, float)
        First and last time that counts, on the plan's clock [s].
    enough : float
        Clearance [m] that decides: the bound is made sharp enough to tell on which side it is.
    ask : callable
        Called before each part of the work; it may raise to give it up.

    Returns
    -------
    Least
        Its time is on the plan's clock. Infinite distances if there is no obstacle, or the plan has
        no such time.

    Examples
    --------
    >>> from maneuver_automaton.collision import Disc, Obstacle
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[4.0])
    >>> post = (Obstacle(Disc(0.5, [3.0, 2.0])),)
    >>> least = closest_to(plan, Unicycle(), post, footprint=(Disc(0.5),), within=(0.0, 3.0))
    >>> least.time, round(least.distance, 9)
    (3.0, 1.0)
    """
    goal, clock = Goal(pose=plan.end), plan.start_time
    first, last = max(within[0] - clock, 0.0), min(within[1] - clock, plan.duration)
    if not obstacles or first > last:
        return Least(math.inf, math.inf, clock)
    drive = driven(seen_from(plan, goal), model)
    around = surroundings_of(obstacles, origin_of(goal.pose))
    found = []
    for name, shapes in {"": footprint, **(parts or {})}.items():
        ask()
        frames = drive.part(name) if name else drive.frames
        body = _body(frames, shapes, plan, goal, body_height)
        spans = spans_within(body, first, last)
        least = least_clearance(body, around, spans, enough=enough, ask=ask)
        hit = -1 if _keeps(least, enough) else nearest_at(body, around, least.time).obstacle
        found.append(least._replace(time=clock + least.time, obstacle=hit, part=name))
    return min(found, key=lambda one: (one.obstacle < 0, one.distance))


def _body(
    frames: Frames, shapes: tuple[Shape, ...], plan: Plan, goal: Goal, height: tuple[float, float]
) -> Body:
    """A body in the coordinates of obstacles counted from the goal's neighbourhood."""
    return Body(
        outline=body_outline(shapes),
        frames=frames,
        offset=complex(*(goal.pose[:2] - origin_of(goal.pose))),
        doubt=frames.doubt(),
        height=height,
        base=float(goal.pose[3:].sum()),
        clock=plan.start_time,
    )


def _clearance(
    body: Body,
    around: Surroundings,
    obstacles: tuple[AnyObstacle, ...],
    origin: tuple[float, float],
    margin: float,
    ask: Callable[[], None],
) -> tuple[Least, str]:
    """The least clearance of a body, and what it hits; empty if it keeps the margin [m]."""
    enough = max(CONTACT, margin - CONTACT)  # touching never is
    ask()
    spans = spans_within(body, 0.0, math.inf)
    least = least_clearance(body, around, spans, enough=enough, ask=ask)
    if _keeps(least, enough):
        return least, ""
    at = least.time
    return least, what_is_hit(body, around, obstacles, time=at, margin=margin, origin=origin)


def _keeps(least: Least, enough: float) -> bool:
    """Whether a clearance is enough [m], as far as it can be told."""
    return least.measured > enough and least.distance > enough - UNRESOLVED


def _off_the_goal(missed: TerminalError, goal: Goal) -> list[str]:
    """How far the end is beyond the goal's tolerance."""
    reasons = []
    if not missed.position_m <= goal.tolerance_m + TERMINAL_TOLERANCE:
        reasons.append(f"it ends {missed.position_m:.3g} m from the goal")
    if not (goal.free_heading or missed.heading_rad <= goal.tolerance_rad + TERMINAL_TOLERANCE):
        reasons.append(f"its last heading is {missed.heading_rad:.3g} rad off")
    return reasons


def _beyond_limits(drive: Drive) -> list[str]:
    """What exceeds a limit of the model, and by how much."""
    reasons: list[str] = []
    model = drive.model
    if not drive.ends.size:
        return reasons
    for names, limits, values in (
        (model.reduced_names, model.reduced_limits, drive.sampled_states),
        (model.control_names, model.control_limits, drive.controls),
    ):
        most, least = values.max(axis=0).tolist(), values.min(axis=0).tolist()
        rows = zip(names, limits.tolist(), most, least, strict=True)
        for name, (low, high), greatest, smallest in rows:
            excess = max(greatest - high, low - smallest)
            size = max([1.0, *(abs(limit) for limit in (low, high) if math.isfinite(limit))])
            if excess > LIMIT_TOLERANCE * size:
                reasons.append(f"{name} is {excess:.3g} beyond its limits [{low:.6g}, {high:.6g}]")
    limit = getattr(model, "max_lateral_acceleration", None)
    if limit is not None:
        spans, _ = drive.between_samples()
        twists = drive.twists_at(
            np.tile(spans.element, 3),
            np.concatenate([spans.begin, 0.5 * (spans.begin + spans.end), spans.end]),
        )
        across = float((np.hypot(twists[:, 0], twists[:, 1]) * np.abs(twists[:, 2])).max())
        if across - limit > LIMIT_TOLERANCE * max(1.0, limit):
            reasons.append(
                f"the lateral acceleration is {across:.6g} m/s^2, beyond {limit:g} m/s^2"
            )
    return reasons


def _wrong_ends(plan: Plan, states: tuple[Array, Array]) -> list[str]:
    """How far the first and last reduced states are from what they must be."""
    if not plan.trims:
        return []
    reasons = []
    ends = (("begins", plan.trims[0], states[0]), ("ends", plan.trims[-1], states[1]))
    for what, trim, expected in ends:
        off = float(np.abs(trim.reduced_state - expected).max(initial=0.0))
        if off > STATE_TOLERANCE:
            reasons.append(f"it {what} in trim {trim.name!r}, {off:.3g} off the reduced state")
    return reasons
