"""The audit of a finished plan: its dynamics, its ends, its limits and its clearance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_with
from maneuver_automaton.audit.arrays import Spans
from maneuver_automaton.audit.clearance import CONTACT, NEVER, Least, least_clearance
from maneuver_automaton.audit.drive import DrivenPlan, driven
from maneuver_automaton.audit.frames import FrameMotion
from maneuver_automaton.audit.outlines import (
    Surroundings,
    body_outline,
    directions,
    point_apart,
    points_of,
    surroundings_around,
    surroundings_of,
)
from maneuver_automaton.audit.pairs import instant, overlapped, spans_within
from maneuver_automaton.audit.passages import AuditedBody, EdgePairs, bounds_of
from maneuver_automaton.audit.places import AGREED, price_again
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision.shapes import AnyObstacle, Obstacle, Shape, name_of, origin_near
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.models import Model
from maneuver_automaton.places import PlaceCost
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Via
from maneuver_automaton.via import passages

DEFECT_TOLERANCE = 1e-8  # [m, rad] between plan and integration, per metre, radian, second driven
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance
LIMIT_TOLERANCE = 1e-9  # relative to the limit, at least to 1, by which a value may exceed it
STATE_TOLERANCE = 1e-9  # [model's units] of the first and the last reduced state
MOST_TURNED = 2e4  # [rad] of a plan that is driven again, in elements of less than a radian each
EXCEEDED = 1e-9  # relative, by which a limit may be exceeded
WAY_SHARES = 33  # of an element, between which poses on the way are looked for
AT_REST = 1e-6  # [m/s, rad/s] of a vehicle that stops
UNRESOLVED = 1e-3  # [m] by which a distance may not be known sharply enough to decide

Around: TypeAlias = Callable[[tuple[AnyObstacle, ...], tuple[float, float]], Surroundings]


@dataclass(frozen=True, slots=True, kw_only=True)
class TerminalError:
    """Distance to the goal, and absolute heading difference modulo a full turn."""

    position_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """Findings of the audit of one plan."""

    passed: bool
    max_dynamics_defect: float  # [m, rad, model's units] to where the controls lead
    min_clearance_m: float | None  # guaranteed: never more than the true one
    terminal_position_m: float
    terminal_heading_rad: float
    reason: str = ""
    place_price: float | None = None  # of all place costs, integrated anew; None without any


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StatedPrices:
    """What a plan is said to cost because of where it goes, to be confirmed."""

    costs: tuple[PlaceCost, ...] = ()
    prices: tuple[float, ...] = ()  # of each
    whole: float = 0.0  # what the plan costs in all


def terminal_error(plan: Plan, goal: Goal) -> TerminalError:
    """How far a plan's last pose is from a goal, computed from the goal's place.

    Examples
    --------
    >>> terminal_error(Plan([1.0, 0.0, 0.0], (), durations=[]), Goal(pose=[1.0, 2.0, 0.0]))
    TerminalError(position_m=2.0, heading_rad=0.0)
    """
    return distance_to(seen_from(plan, goal).end, goal)


def seen_from(plan: Plan, goal: Goal) -> Plan:
    """The plan with the goal's place as origin and from time 0: no digit is lost."""
    start = plan.start - goal.pose
    start[2] = plan.start[2]
    return kept_with(plan, goal, lambda: plan.begun_at(start, start_time=0.0))


def distance_to(end: Array, goal: Goal) -> TerminalError:
    """How far a pose (dof,), counted from the goal's place, is from the goal."""
    x, y, heading, *higher = end.tolist()
    turned = 0.0
    if not goal.free_heading:
        turned = abs(math.remainder(heading - float(goal.pose[2]), 2.0 * math.pi))
    return TerminalError(position_m=math.hypot(x, y, *higher), heading_rad=turned)


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
    places: StatedPrices | None = None,
    via: tuple[Via, ...] = (),
    order: str = "given",
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
    places : StatedPrices, optional
        What it costs because of where it goes: integrated anew, to within 1e-3 of the whole cost.
    via : tuple of Via
        What must be passed on the way, in the order given or, if that is ``free``, in any.
    order : str
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
    turned = float(np.abs(near.twists[:, 2]) @ near.primitive_durations)
    if turned > MOST_TURNED:
        missed = distance_to(near.end, goal)
        return Audit(
            passed=False,
            max_dynamics_defect=math.inf,
            min_clearance_m=None,
            terminal_position_m=missed.position_m,
            terminal_heading_rad=missed.heading_rad,
            reason=f"it turns by {turned:.3g} rad, need at most {MOST_TURNED:g}",
        )
    drive = driven(near, model)
    missed, reasons = distance_to(drive.end, goal), list[str]()
    if not max(drive.off, drive.turned) <= DEFECT_TOLERANCE * (1.0 + near.duration):
        ways = np.abs(drive.frames.nodes).max(axis=(0, 1))
        most = DEFECT_TOLERANCE * (1.0 + near.duration + ways)
        if not (drive.off <= most.max() and drive.turned <= most[2]):
            reasons.append(f"the plan is {drive.off:.3g} off the model's equations")
    if not missed.position_m <= goal.tolerance_m + TERMINAL_TOLERANCE:
        reasons.append(f"it ends {missed.position_m:.3g} m from the goal")
    if not (goal.free_heading or missed.heading_rad <= goal.tolerance_rad + TERMINAL_TOLERANCE):
        reasons.append(f"its last heading is {missed.heading_rad:.3g} rad off")
    reasons += _beyond_limits(drive)
    ends = ("begins", near.trims[:1]), ("ends", near.trims[-1:])
    for (what, trims), state in zip(ends, states or (), strict=states is not None):
        for trim in trims if state.size else ():
            off = np.abs(trim.reduced_state - state).max(initial=0.0)
            if off > STATE_TOLERANCE:
                reasons.append(f"it {what} in trim {trim.name!r}, {off:.3g} off the reduced state")
    origin = origin_near(goal.pose)
    bodies = {"": _body(drive.frames, footprint, plan, goal, body_height)}
    for name, shapes in (parts or {}).items() if obstacles or zones else ():
        bodies[name] = _body(drive.part(name), shapes, plan, goal, body_height)
    distances, enough = [], max(CONTACT, margin - CONTACT)  # touching never is
    for name, body in bodies.items() if obstacles else ():
        beside = around(obstacles, origin)
        ask()
        spans = spans_within(body, 0.0, math.inf)
        least = least_clearance(body, beside, spans, enough=enough, ask=ask)
        distances.append(least.distance)
        if not _keeps(least, enough):
            at = least.time
            hit = what_is_hit(body, beside, obstacles, time=at, margin=margin, origin=origin)
            reasons.append(f"the {name}: {hit}" if name else hit)
    reasons += zones_broken(drive, list(bodies.values()), zones, origin)
    prices: list[float] = []
    if places is not None and places.costs:
        ask()
        offset = np.array([*goal.pose[:2], 0.0, *goal.pose[3:]])
        known = list(bodies.values()), around(obstacles, origin)
        for cost, stated in zip(places.costs, places.prices, strict=True):
            prices.append(price_again(cost, drive, offset, *known, whole=places.whole))
            if not abs(prices[-1] - stated) <= AGREED * places.whole:
                what = type(cost).__name__
                reasons.append(f"{what} costs {prices[-1]:.6g}, not {stated:.6g} as stated")
    reasons += _missed_on_the_way(drive, goal, via, in_order=order == "given")
    return Audit(
        passed=not reasons,
        max_dynamics_defect=drive.off,
        min_clearance_m=min(filter(math.isfinite, distances), default=None),
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
        place_price=sum(prices) if prices else None,
    )


def _missed_on_the_way(
    drive: DrivenPlan, goal: Goal, via: tuple[Via, ...], *, in_order: bool
) -> list[str]:
    """Which poses on the way are not met where the plan is driven, counted from the goal."""
    if not via:
        return []
    frames, places = drive.frames, [0, 1, *range(3, drive.end.size)]
    shares = np.linspace(0.0, 1.0, WAY_SHARES)
    begins, lengths = frames.times[:-1, None], np.diff(frames.times)[:, None]
    # no step turns or moves by more than a share of an element
    times = np.append((begins + shares[:-1] * lengths).ravel(), frames.times[-1])

    def located(times: Array) -> tuple[IntArray, Array]:
        element = np.searchsorted(frames.times, times, side="right") - 1
        element = np.clip(element, 0, lengths.size - 1)
        share = (times - frames.times[element]) / lengths[element, 0]
        return element, np.clip(share, 0.0, 1.0)

    def rests(time: float) -> bool:
        at = located(np.array([time]))
        stands = float(np.abs(drive.twists_at(*at)).max()) <= AT_REST
        return not drive.model.reduced_names or stands or bool(drive.may_stand(*at).all())

    seen = [one.shifted(goal.pose[places]) for one in via]
    met = passages(seen, times, lambda at: frames.at(*located(at)), rests, in_order=in_order)
    return [
        f"pose {k} on the way is not passed" + (", or not in its order" if in_order else "")
        for k, at in enumerate(met, 1)
        if at is None
    ]


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
    around = surroundings_of(obstacles, origin_near(goal.pose))
    found = []
    for name, shapes in {"": footprint, **(parts or {})}.items():
        ask()
        frames = drive.part(name) if name else drive.frames
        body = _body(frames, shapes, plan, goal, body_height)
        spans = spans_within(body, first, last)
        least = least_clearance(body, around, spans, enough=enough, ask=ask)
        hit = -1 if _keeps(least, enough) else nearest_at(body, around, least.time)[2]
        found.append(least._replace(time=clock + least.time, obstacle=hit, part=name))
    return min(found, key=lambda one: (one.obstacle < 0, one.distance))


def _body(
    frames: FrameMotion,
    shapes: tuple[Shape, ...],
    plan: Plan,
    goal: Goal,
    height: tuple[float, float],
) -> AuditedBody:
    """A body in the coordinates of obstacles counted from the goal's neighbourhood."""
    origin, (x, y, _, *higher) = origin_near(goal.pose), goal.pose.tolist()
    return AuditedBody(
        outline=body_outline(shapes),
        frames=frames,
        offset=complex(x - origin[0], y - origin[1]),
        doubt=frames.doubt(),
        height=height,
        base=sum(higher, 0.0),
        clock=plan.start_time,
    )


def _keeps(least: Least, enough: float) -> bool:
    """Whether a clearance is enough [m], as far as it can be told."""
    return least.measured > enough and least.distance > enough - UNRESOLVED


def _beyond_limits(drive: DrivenPlan) -> list[str]:
    """What exceeds a limit of the model, and by how much."""
    reasons, model = list[str](), drive.model
    if not drive.ends.size:
        return reasons
    for names, limits, values in (
        (model.reduced_names, model.reduced_limits, drive.sampled_states),
        (model.control_names, model.control_limits, drive.controls),
    ):
        if not names or ((limits[:, 0] <= values) & (values <= limits[:, 1])).all():
            continue
        excess = np.maximum(values.max(axis=0) - limits[:, 1], limits[:, 0] - values.min(axis=0))
        for name, over, (low, high) in zip(names, excess.tolist(), limits.tolist(), strict=True):
            size = max([1.0, *(abs(limit) for limit in (low, high) if math.isfinite(limit))])
            if over > LIMIT_TOLERANCE * size:
                reasons.append(f"{name} is {over:.3g} beyond its limits [{low:.6g}, {high:.6g}]")
    limit = getattr(model, "max_lateral_acceleration", None)
    if limit is not None:
        spans, _ = drive.between_samples()
        shares = np.concatenate([spans.begin, 0.5 * (spans.begin + spans.end), spans.end])
        twists = drive.twists_at(np.tile(spans.element, 3), shares)
        across = float((np.hypot(twists[:, 0], twists[:, 1]) * np.abs(twists[:, 2])).max())
        if across - limit > LIMIT_TOLERANCE * max(1.0, limit):
            reasons.append(
                f"the lateral acceleration is {across:.6g} m/s^2, beyond {limit:g} m/s^2"
            )
    return reasons


def nearest_at(
    body: AuditedBody, around: Surroundings, time: float
) -> tuple[EdgePairs, int, int, float]:
    """All edges at a time since the start [s]; row, obstacle and distance [m] of the nearest."""
    pairs = instant(body, around, time)
    known = bounds_of(body, around, pairs, overlaps=True)
    row, distance = int(np.argmin(known.measured)), float(known.measured.min())
    held = overlapped(body, around, pairs.places)
    if held >= 0:
        row, distance = int(np.flatnonzero(pairs.edge == held)[0]), 0.0
    return pairs, row, int(around.owners[pairs.edge[row]]), distance


def what_is_hit(
    body: AuditedBody,
    around: Surroundings,
    obstacles: tuple[AnyObstacle, ...],
    *,
    time: float,
    margin: float,
    origin: tuple[float, float],
) -> str:
    """A sentence on the obstacle that is nearest at a time since the start [s]."""
    pairs, row, index, distance = nearest_at(body, around, time)
    assert pairs.frames is not None
    edge, frame, places = pairs.edge[row], pairs.frames[row, 0], pairs.places
    a, b = around.outline.begins[edge], around.outline.ends[edge]
    there, turned, along = points_of(frame), directions(frame[2]), b - a
    # Of the edge: its ends, and where corners of the body are beside it.
    seen = (places.corners[0, :, 0] - there) * turned.conj()
    shares = ((seen - a) * along.conj()).real / max(float(np.abs(along)) ** 2, 1e-300)
    shares = np.concatenate([[0.0, 1.0], np.clip(shares, 0.0, 1.0)])
    world = there + turned * (a + shares * along)
    from_body = (world - places.place[0, 0]) * places.turn[0, 0].conj()
    own = body.outline.edges
    apart = np.sqrt(point_apart(from_body[:, None], own.begins, own.ends)) - own.radius
    point = complex(np.round(world[int(np.argmin(apart.min(axis=1)))], 3)) + 0.0 + complex(*origin)
    name = name_of(obstacles[index], index, f"({point.real:.10g}, {point.imag:.10g})")
    if distance <= CONTACT:
        return f"at {body.clock + time:.6g} s the vehicle touches {name}"
    near = f"the vehicle is {distance:.6g} m from {name}, closer than {margin:.6g} m"
    return f"at {body.clock + time:.6g} s {near}"


def zones_broken(
    drive: DrivenPlan,
    bodies: Sequence[AuditedBody],
    zones: tuple[Zone, ...],
    origin: tuple[float, float],
) -> list[str]:
    """Which zones a vehicle is in, with any part, while it moves as they do not admit."""
    if not (zones and drive.ends.size):
        return []
    reasons = []
    spans, pieces = drive.between_samples()
    ends = np.concatenate([spans.begin, spans.end])
    twists = drive.twists_at(np.tile(spans.element, 2), ends)
    names = [
        {one.name} if isinstance(one, Trim) else {one.source, one.target}
        for one in drive.plan.primitives
    ]
    for zone in zones:
        admitted = _admitted(zone, twists).reshape(2, -1).all(axis=0)
        named = [zone.trims is None or one <= set(zone.trims) for one in names]
        admitted &= np.array(named)[pieces]
        around = surroundings_around((Obstacle(zone.shape),), origin)
        found = [
            least_clearance(body, around, run) for run in _runs(spans, ~admitted) for body in bodies
        ]
        least = min(found, key=lambda one: one.distance, default=NEVER)
        if not least.distance > CONTACT:
            reasons.append(
                f"at {least.time:.6g} s the vehicle moves as {zone.words} does not admit"
            )
    return reasons


def _runs(spans: Spans, kept: NDArray[np.bool_]) -> Iterator[Spans]:
    """Runs of stretches that are kept, each without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        yield spans.of(slice(first, last))


def _admitted(zone: Zone, twists: Array) -> NDArray[np.bool_]:
    """Whether a zone's limits admit twists (m, dof)."""
    speed = np.hypot(twists[:, 0], twists[:, 1])
    good = np.ones(speed.size, dtype=np.bool_)
    if zone.max_speed is not None:
        good &= speed <= zone.max_speed * (1.0 + EXCEEDED) + EXCEEDED
    if zone.max_lateral_acceleration is not None:
        most = zone.max_lateral_acceleration * (1.0 + EXCEEDED) + EXCEEDED
        good &= speed * np.abs(twists[:, 2]) <= most
    if not zone.reverse:
        good &= twists[:, 0] >= -EXCEEDED
    return good
