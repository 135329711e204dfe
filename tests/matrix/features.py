"""The features of the matrix: one function each, with a planner that ignores it beside it.

A check plans with and without its feature and measures the effect outside of the package. It is
given the planner, so that it can be shown to fail: with one to which the feature means nothing.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import (
    AnyObstacle,
    Box,
    Disc,
    Motion,
    Obstacle,
    OccupancyMap,
    Polygon,
    Shape,
    Zone,
)
from maneuver_automaton.costs import Cost, StageCost
from maneuver_automaton.formats.closed_loop_json import load_steps, save_closed_loop
from maneuver_automaton.formats.plan_json import load_plan, save_plan
from maneuver_automaton.groups import group_of
from maneuver_automaton.planning import Planner, PlanResult, PlanStatus, plan
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance, simulate
from tests.matrix import outside
from tests.matrix.outside import Bodies, Course
from tests.matrix.vehicles import Vehicle

TIME_LIMIT = 20.0  # [s] the work is limited by expansions; this is for what does not count any
LOOP_LIMIT = 3.0  # [s] of one step of a closed loop
STEPS = 60  # of a closed loop, at most
EXACT = 1e-9  # [m, rad] of a last pose, and relative of sums of durations
SAME = 1e-6  # relative, between costs that should be equal
SAMPLED = 1e-3  # relative, between a cost and what samples say it is
SLOW = 1e-3  # [m/s] slower is no direction of travel


class Nothing(AssertionError):
    """No plan, or no other answer, was found."""


class Dearer(AssertionError):
    """It works, but costs more than a plan that is known."""


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What is asked for plans and loops: the package, or one that ignores something."""

    plan: Callable[..., PlanResult] = plan
    simulate: Callable[..., ClosedLoop] = simulate
    planner: Callable[..., Planner] = Planner
    save_plan: Callable[[PlanResult, Path], None] = save_plan
    save_figure: Callable[[PlanResult, Path], None] | None = None
    load_last: Callable[..., Any] = load_steps


PACKAGE = Engine()
Check = Callable[[Vehicle, Engine], None]


@dataclass(frozen=True, kw_only=True)
class Feature:
    """One row of the matrix."""

    name: str
    check: Check
    mutant: Engine  # the feature means nothing to it
    mutant_vehicle: str  # on which the check fails with the mutant
    says: str  # how it then complains
    applies: Callable[[Vehicle], bool]

    def __call__(self, vehicle: Vehicle, engine: Engine = PACKAGE) -> None:
        """Fail unless the feature works for the vehicle."""
        self.check(vehicle, engine)


FEATURES: dict[str, Feature] = {}


def feature(
    mutant: Engine,
    *,
    says: str,
    on: str = "dubins",
    applies: Callable[[Vehicle], bool] = lambda _: True,
) -> Callable[[Check], Check]:
    """Enter a check as a row of the matrix, under its name."""

    def entered(check: Check) -> Check:
        name = check.__name__
        FEATURES[name] = Feature(
            name=name, check=check, mutant=mutant, mutant_vehicle=on, says=says, applies=applies
        )
        return check

    return entered


def without(*names: str, **changes: object) -> Engine:
    """A planner to which some fields of a problem mean nothing; `changes` are what it takes."""
    defaults: dict[str, object] = {
        "obstacles": (),
        "zones": (),
        "bounds": Bounds(),
        "horizon": Horizon(),
        "margin": 0.0,
        "cost": Cost(time=1.0),
        "start_trim": None,
    }
    values = {name: defaults[name] for name in names} | changes

    def stripped(problem: Problem) -> Problem:
        return replace(problem, **values)  # type: ignore[arg-type]

    return changed(stripped)


def changed(change: Callable[[Problem], Problem]) -> Engine:
    """A planner that takes every problem for another one."""

    def planned(problem: Problem, **options: Any) -> PlanResult:
        return plan(change(problem), **options)

    def driven(problem: Problem, **options: Any) -> ClosedLoop:
        return simulate(change(problem), **options)

    def ready(automaton: Any, **options: Any) -> Planner:
        start = np.zeros(automaton.model.group.dof)
        there = change(Problem(automaton, start, start + 1.0, **options))
        return Planner(automaton, **{name: getattr(there, name) for name in options})

    return Engine(plan=planned, simulate=driven, planner=ready)


def with_goals(change: Callable[[Goal], Goal]) -> Engine:
    """A planner that takes every goal for another one."""

    def aimed(problem: Problem) -> Problem:
        return replace(problem, goals=tuple(change(goal) for goal in problem.goals))

    return changed(aimed)


# --- what holds for every plan --------------------------------------------------------------------


def found(result: PlanResult) -> Plan:
    """The plan of an answer; raises Nothing if there is none."""
    if result.status is not PlanStatus.FOUND or result.plan is None:
        raise Nothing(f"{result.status.value}: {result.reason}")
    return result.plan


def asked(
    vehicle: Vehicle, engine: Engine, *, cost_is: bool = True, **changes: object
) -> PlanResult:
    """The answer to the vehicle's problem with changes, once it is seen to keep what it says."""
    problem = vehicle.problem(**changes)
    result = engine.plan(problem, time_limit=TIME_LIMIT)
    obeys(vehicle, problem, found(result), result.goal_index or 0)
    if cost_is and isinstance(problem.cost, Cost):
        close(cost_of(problem.cost, result.plan), result.cost, "cost", share=SAMPLED)
    return result


def close(measured: float, stated: float | None, what: str, *, share: float = SAME) -> None:
    """Fail unless a number is what it should be."""
    assert stated is not None, f"no {what} is stated"
    off = abs(measured - stated)
    assert off <= share * max(1.0, abs(stated)), f"{what}: {stated:.9g} stated, {measured:.9g} seen"


def no_dearer(result: PlanResult, than: float, what: str, *, share: float = SAME) -> None:
    """Fail if a plan costs more than a known one."""
    assert result.cost is not None
    if result.cost > than * (1.0 + share):
        raise Dearer(f"costs {result.cost:.6g}, but {what} costs {than:.6g}")


def cost_of(cost: Cost, motion: Plan | None) -> float:
    """What a plan costs, by its samples: time, length, effort, norm, switches, directions."""
    assert motion is not None
    course = Course.of(motion, step_m=0.02)
    changes = course.changes_of_direction(slow=SLOW) if cost.direction_change else 0
    return (
        cost.time * course.duration
        + cost.length * course.length
        + cost.effort * course.effort
        + cost.norm * course.norm
        + cost.switch * switches(motion)
        + cost.direction_change * changes
    )


def switches(motion: Plan) -> int:
    """How often one primitive follows another; each direction within a maneuver is one."""
    count = 0
    for primitive in motion.primitives:
        count += 1
        if isinstance(primitive, Maneuver) and primitive.course is not None:
            trims = [
                Trim(name=name, body_velocity=np.zeros_like(motion.start), control=[0.0])
                for name in (primitive.source, primitive.target)
            ]
            alone = Plan(
                np.zeros_like(motion.start), trims, durations=[0.0, 0.0], maneuvers=[primitive]
            )
            count += Course.of(alone).changes_of_direction(slow=SLOW)
    return max(count - 1, 0)


def trims_lasting(motion: Plan) -> list[tuple[Trim, float]]:
    """Trims of a plan that take time."""
    return [
        (one, time)
        for one, time in zip(motion.primitives, motion.primitive_durations, strict=True)
        if isinstance(one, Trim) and time > 0.0
    ]


def hitch_length(vehicle: Vehicle) -> float:
    return float(getattr(vehicle.automaton.model, "hitch_length", 0.0))


def around(vehicle: Vehicle, course: Course, footprint: Sequence[Shape]) -> Bodies:
    """Geometries of the vehicle and what it carries along a course."""
    return outside.bodies(course, footprint, vehicle.parts, hitch_length=hitch_length(vehicle))


def fine(vehicle: Vehicle, motion: Plan) -> Course:
    """Samples a small share of the body apart."""
    step = min(0.1 * vehicle.size, 0.1)
    return Course.driven(motion, vehicle.automaton.model, step_m=step)


def obeys(
    vehicle: Vehicle, problem: Problem, motion: Plan, goal_index: int = 0, *, ends: bool = True
) -> None:
    """Fail unless a plan keeps every condition of a problem, by what its samples do."""
    course = fine(vehicle, motion)
    if ends:
        assert np.abs(motion.pose_at(motion.start_time) - problem.start).max() <= EXACT
        _ends(problem, course, motion, problem.goals[goal_index])
        _lasts(problem, motion)
    jumps = float(np.nanmax(np.append(course.speed, 0.0)))
    assert jumps <= 1.5 * vehicle.fastest + 1.0, f"it moves at {jumps:.3g} m/s"
    bodies = around(vehicle, course, problem.footprint)
    if problem.obstacles:
        least = outside.clearances(
            course, bodies, problem.obstacles, body_height=problem.body_height
        )
        at = int(np.argmin(least))
        enough = least[at] > 0.0 and least[at] >= problem.margin - 1e-6
        assert enough, f"clearance {least[at]:.6g} m at {course.time[at]:.4g} s"
    assert outside.outside_bounds(course, problem.bounds) <= EXACT, "it leaves the bounds"
    for zone in problem.zones:
        _keeps_to(zone, vehicle, course, bodies)


def _ends(problem: Problem, course: Course, motion: Plan, goal: Goal) -> None:
    way, turn = outside.off_goal(course.pose[-1], goal)
    assert way <= goal.tolerance_m + EXACT, f"it ends {way:.3g} m from the goal"
    assert goal.free_heading or turn <= goal.tolerance_rad + EXACT, f"its heading is {turn:.3g} off"
    if problem.automaton.is_kinematic or not motion.primitives:
        return
    for state, trim in ((0, problem.first_trim), (-1, problem.last_trim(goal))):
        off = float(np.abs(course.state[state] - trim.reduced_state).max())
        assert off <= 1e-8, f"reduced state {course.state[state]} is not that of {trim.name!r}"


def _lasts(problem: Problem, motion: Plan) -> None:
    horizon, duration = problem.horizon, Course.of(motion).duration
    if horizon.time is not None:
        assert abs(duration - horizon.time) <= EXACT * horizon.time, f"it takes {duration:.9g} s"
    if horizon.max_time is not None:
        assert duration <= horizon.max_time * (1.0 + EXACT), f"it takes {duration:.9g} s"
    lasting = trims_lasting(motion)
    if horizon.max_trims is not None:
        assert len(lasting) <= horizon.max_trims, f"it has {len(lasting)} trims"
    for trim, time in lasting:
        if trim.body_velocity.any():
            assert time >= horizon.min_coast - EXACT, f"{trim.name!r} lasts {time:.6g} s"


def _keeps_to(zone: Zone, vehicle: Vehicle, course: Course, bodies: Bodies) -> None:
    """Speeds between two samples in a zone, by a little, are those it admits."""
    there = outside.inside(bodies, zone.shape, depth=0.01 * vehicle.size)
    both = there[1:] & there[:-1] & (course.lasting > 1e-12)
    if zone.max_speed is not None and both.any():
        fastest = float(course.speed[both].max())
        assert fastest <= zone.max_speed * (1.0 + SAMPLED), f"{fastest:.6g} m/s in a zone"
    if not zone.reverse and both.any():
        assert float(course.forward[both].min()) >= -SLOW, "it drives backwards in a zone"


# --- scenes: made of what the vehicle does where there is nothing in its way ----------------------


@functools.cache
def _base(vehicle_name: str) -> PlanResult:
    from tests.matrix.vehicles import VEHICLES

    vehicle = VEHICLES[vehicle_name]
    return plan(vehicle.problem(), time_limit=TIME_LIMIT)


def base(vehicle: Vehicle) -> PlanResult:
    """The plan in free space."""
    result = _base(vehicle.name)
    found(result)
    return result


def midway(vehicle: Vehicle, share: float = 0.5) -> np.ndarray:
    """Pose in the middle of the plan in free space."""
    motion = found(base(vehicle))
    return np.asarray(motion.pose_at(share * motion.duration))


def heading_midway(vehicle: Vehicle) -> float:
    """Its heading there; where it never turns, the direction in which it drives."""
    if vehicle.has_heading:
        return float(outside.flat(midway(vehicle))[2])
    way = midway(vehicle, 0.501) - midway(vehicle)
    return math.atan2(way[1], way[0])


def pillar(vehicle: Vehicle) -> Disc:
    """A disc that stands in the way."""
    return Disc(0.8 * vehicle.size, midway(vehicle)[:2])


@functools.cache
def _passing(vehicle_name: str) -> PlanResult:
    from tests.matrix.vehicles import VEHICLES

    vehicle = VEHICLES[vehicle_name]
    return plan(vehicle.problem(obstacles=[pillar(vehicle)]), time_limit=TIME_LIMIT)


def passing(vehicle: Vehicle) -> PlanResult:
    """The plan past the pillar."""
    return _passing(vehicle.name)


def beside(vehicle: Vehicle, offset: float) -> np.ndarray:
    """A place to the left of the middle of the plan in free space, so far off [m]."""
    return midway(vehicle)[:2] + offset * _left(heading_midway(vehicle))


def _left(heading: float) -> np.ndarray:
    """Unit vector to the left of a heading."""
    return np.array([-math.sin(heading), math.cos(heading)])


# --- free space -----------------------------------------------------------------------------------


@feature(with_goals(lambda goal: replace(goal, free_heading=True)), says="its heading is")
def free_space(vehicle: Vehicle, engine: Engine) -> None:
    result = asked(vehicle, engine)
    assert result.plan.word


@feature(
    with_goals(lambda goal: replace(goal, free_heading=False)),
    says="the heading is not used",
    applies=lambda vehicle: vehicle.has_heading,
)
def free_heading(vehicle: Vehicle, engine: Engine) -> None:
    result = asked(vehicle, engine, goals=vehicle.target(free_heading=True))
    known = base(vehicle).cost
    no_dearer(result, known, "the plan with the heading")
    _, turn = outside.off_goal(result.plan.end, vehicle.target())
    assert turn > SAME or result.cost < known * (1.0 - SAME), "the heading is not used"


@feature(
    changed(lambda problem: replace(problem, goals=problem.goals[:1])),
    says="the plan to the nearer goal costs",
)
def several_goals(vehicle: Vehicle, engine: Engine) -> None:
    """The nearer one is taken, at the cost of the plan to it alone."""
    far = np.array(vehicle.goal)
    far[:2] *= 1.6
    goals = (vehicle.target(pose=far), vehicle.target())
    result = asked(vehicle, engine, goals=goals)
    no_dearer(result, base(vehicle).cost, "the plan to the nearer goal", share=1e-2)
    assert result.goal_index == 1


@feature(without("horizon"), says="it has 3 trims")
def max_trims(vehicle: Vehicle, engine: Engine) -> None:
    count = len(trims_lasting(found(base(vehicle))))
    result = asked(vehicle, engine, horizon=Horizon(max_trims=max(count, 1)))
    no_dearer(result, base(vehicle).cost, "the plan with as many trims", share=1e-3)
    if count > 1:
        problem = vehicle.problem(horizon=Horizon(max_trims=count - 1))
        fewer = engine.plan(problem, time_limit=TIME_LIMIT)
        if fewer.plan is not None:
            obeys(vehicle, problem, fewer.plan, fewer.goal_index or 0)


def _draw(result: PlanResult, path: Path) -> None:
    from maneuver_automaton import plotting

    plotting.save_plan_figure(result, path)


def _blank(_: PlanResult, path: Path) -> None:
    from matplotlib.figure import Figure

    Figure().savefig(path)


@feature(Engine(save_figure=_blank), says="nothing is drawn")
def pictures(vehicle: Vehicle, engine: Engine) -> None:
    import matplotlib.image

    draw = engine.save_figure or _draw
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.png"
        draw(base(vehicle), path)
        pixels = matplotlib.image.imread(path)
    assert len(np.unique(pixels.reshape(-1, pixels.shape[-1]), axis=0)) > 10, "nothing is drawn"


def _moved_file(result: PlanResult, path: Path) -> None:
    assert result.plan is not None
    save_plan(replace(result, plan=replace(result.plan, start=result.plan.start + 0.01)), path)


@feature(Engine(save_plan=_moved_file), says="another motion")
def plan_file(vehicle: Vehicle, engine: Engine) -> None:
    """plan.json holds the plan: read back it is the same motion, and its numbers agree."""
    result = base(vehicle)
    motion = found(result)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        engine.save_plan(result, path)
        again, document = load_plan(path), json.loads(path.read_text())
    assert outside.apart(motion, again) <= 1e-6, "the file holds another motion"
    lasting = sum(one["duration_s"] for one in document["primitives"])
    close(lasting, document["duration_s"], "duration")
    close(motion.duration, document["duration_s"], "duration")
    close(document["trajectory"]["time_s"][-1], document["duration_s"], "last time")
    last = np.array(document["trajectory"]["pose"][-1])
    way, turn = outside.off_goal(last, vehicle.target())
    assert max(way, turn) <= 1e-8, "the trajectory misses the goal"


# --- obstacles ------------------------------------------------------------------------------------


def _around_them(vehicle: Vehicle, engine: Engine, *obstacles: AnyObstacle | Shape) -> PlanResult:
    result = asked(vehicle, engine, obstacles=list(obstacles))
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)
    return result


@feature(without("obstacles"), says="clearance")
def discs(vehicle: Vehicle, engine: Engine) -> None:
    _around_them(vehicle, engine, pillar(vehicle))


@feature(without("obstacles"), says="clearance")
def polygons(vehicle: Vehicle, engine: Engine) -> None:
    """A concave polygon: an L whose corner stands in the way."""
    corner = np.array([[-1, -1], [1, -1], [1, -0.2], [-0.2, -0.2], [-0.2, 1], [-1, 1]], float)
    _around_them(vehicle, engine, Polygon(0.7 * vehicle.size * corner + midway(vehicle)[:2]))


@feature(without("obstacles"), says="clearance")
def occupancy_map(vehicle: Vehicle, engine: Engine) -> None:
    cells = np.zeros((9, 9), dtype=bool)
    cells[3:6, 3:6] = True
    cells[0, 8] = True
    size = 0.4 * vehicle.size
    origin = np.append(midway(vehicle)[:2] - 4.5 * size, 0.0)
    _around_them(vehicle, engine, OccupancyMap(cells, resolution=size, origin=origin))


def _crossing(vehicle: Vehicle) -> Obstacle:
    """A disc that crosses the way where the vehicle would be."""
    duration = found(base(vehicle)).duration
    reach = 0.3 * vehicle.reach
    here, there = beside(vehicle, reach), beside(vehicle, -reach)
    motion = Motion([0.0, duration], [[*here, 0.0], [*there, 0.0]])
    return Obstacle(Disc(0.6 * vehicle.size), motion=motion)


@feature(without("obstacles"), says="clearance")
def moving_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _around_them(vehicle, engine, _crossing(vehicle))


@feature(without("margin"), says="clearance")
def margin(vehicle: Vehicle, engine: Engine) -> None:
    """A disc beside the way is passed at the distance asked for."""
    disc = Disc(0.5 * vehicle.size, beside(vehicle, 2.0 * vehicle.size))
    course = fine(vehicle, found(base(vehicle)))
    bodies = around(vehicle, course, vehicle.footprint)
    clear = float(outside.clearances(course, bodies, (Obstacle(disc),)).min())
    assert clear > 0.0
    _ = asked(vehicle, engine, obstacles=[disc], margin=clear + 0.3 * vehicle.size)


@feature(without("zones"), says="m/s in a zone")
def zones(vehicle: Vehicle, engine: Engine) -> None:
    """A small zone in the way is entered slowly or not at all."""
    zone = Zone(shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=_slow(vehicle))
    result = asked(vehicle, engine, zones=[zone])
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)


def _slow(vehicle: Vehicle) -> float:
    """A speed [m/s] that only the slower trims keep."""
    return (vehicle.slow or 0.5 * vehicle.fastest) * 1.02


@feature(
    without("zones"),
    on="grid",
    applies=lambda vehicle: vehicle.slow is not None,
    says="m/s in a zone",
)
def zones_crossed(vehicle: Vehicle, engine: Engine) -> None:
    """A zone without a way around is crossed: slowly in it, and only there."""
    width = 1.5 * vehicle.size
    strip = Box([width, 20.0 * vehicle.reach], midway(vehicle)[:2], heading_midway(vehicle))
    slow = _slow(vehicle)
    result = asked(vehicle, engine, zones=[Zone(shape=strip, max_speed=slow)])
    free, inside = found(base(vehicle)).duration, width + 2.0 * vehicle.size
    ideal = free + inside * (1.0 / slow - 1.0 / vehicle.fastest)
    throughout = free * vehicle.fastest / slow
    share = 0.6 if _goes_on_slowly(vehicle, slow) else 1.0
    if throughout > ideal:
        known = ideal + share * (throughout - ideal)
        no_dearer(result, known, "to be slow in the zone, or all the way,", share=SAMPLED)


def _goes_on_slowly(vehicle: Vehicle, slow: float) -> bool:
    """Whether a trim drives ahead so slowly: a zone is then crossed in it, and left at full speed.

    A vehicle whose slow trims only drive back would have to turn round twice.
    """
    velocities = vehicle.automaton.body_velocities
    slowly = np.linalg.norm(velocities[:, :2], axis=1) <= slow
    return bool((slowly & (velocities[:, 0] > SLOW)).any())


@feature(without("bounds"), says="it leaves the bounds")
def bounds(vehicle: Vehicle, engine: Engine) -> None:
    """The side on which it would pass a pillar is closed by a bound."""
    pose = np.array(vehicle.goal)
    pose[1:3] = 0.0
    goal = vehicle.target(pose=pose)
    disc = Disc(0.8 * vehicle.size, 0.5 * pose[:2])
    open_to_all = asked(vehicle, PACKAGE, goals=goal, obstacles=[disc])
    y = fine(vehicle, open_to_all.plan).pose[:, 1]
    limit = 0.5 * float(y[np.argmax(np.abs(y))])
    closed = Bounds(y=(-10.0 * vehicle.reach, limit) if limit > 0 else (limit, 10 * vehicle.reach))
    result = asked(vehicle, engine, goals=goal, obstacles=[disc], bounds=closed)
    no_dearer(result, 1.5 * open_to_all.cost, "half as much again as the other side")


def _arm(vehicle: Vehicle) -> Disc:
    """Something that sticks out to the left, beyond the footprint."""
    return Disc(0.25 * vehicle.size, [0.0, 1.6 * vehicle.size])


@feature(
    changed(lambda problem: replace(problem, footprint=problem.footprint[:1])), says="clearance"
)
def several_parts(vehicle: Vehicle, engine: Engine) -> None:
    """Only what sticks out of the body would touch the disc."""
    disc = Disc(0.2 * vehicle.size, beside(vehicle, 1.6 * vehicle.size))
    whole = (*vehicle.footprint, _arm(vehicle))
    result = asked(vehicle, engine, obstacles=[disc], footprint=whole)
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)


@feature(
    without(parts={}),
    on="car_with_trailer",
    applies=lambda vehicle: bool(vehicle.parts),
    says="clearance",
)
def carried_parts(vehicle: Vehicle, engine: Engine) -> None:
    """What is carried cuts the corner: a disc where only the trailer would touch it."""
    pose = np.array(vehicle.goal)
    pose[:3] = 0.5 * vehicle.reach, 0.5 * vehicle.reach, 0.5 * math.pi
    goal = vehicle.target(pose=pose)
    motion = asked(vehicle, PACKAGE, goals=goal).plan
    assert motion is not None
    course = fine(vehicle, motion)
    own = outside.bodies(course, vehicle.footprint)
    everything = around(vehicle, course, vehicle.footprint)
    spots = [
        spot
        for share in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
        for side in (1.0, -1.0)
        for spot in _just_beside(vehicle, motion.pose_at(share * motion.duration), own, side)
        if outside.clearances(course, everything, (Obstacle(spot),)).min() == 0.0
    ]
    assert spots, "no part that is carried leaves the track of the body"
    _ = asked(vehicle, engine, goals=goal, obstacles=[spots[len(spots) // 2]])


def _just_beside(vehicle: Vehicle, pose: np.ndarray, bodies: Bodies, side: float) -> Iterator[Disc]:
    """A small disc beside a pose which all bodies of a course just miss, if there is one."""
    for offset in np.linspace(0.1, 2.0, 96) * vehicle.size:
        disc = Disc(0.05 * vehicle.size, pose[:2] + side * offset * _left(float(pose[2])))
        if float(bodies.clearance(*outside.solid(disc)).min()) > 0.005 * vehicle.size:
            yield disc
            return


@feature(
    with_goals(lambda goal: replace(goal, free_heading=False)),
    says="a heading that does not matter",
    applies=lambda vehicle: vehicle.has_heading,
)
def free_heading_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    """With any heading it is no dearer than with the one that suits, and ends with another."""
    pose = np.array(vehicle.goal)
    pose[2] += 2.5  # a heading to which to turn would be dear
    goal = vehicle.target(pose=pose, free_heading=True)
    result = asked(vehicle, engine, goals=goal, obstacles=[pillar(vehicle)])
    _, turn = outside.off_goal(result.plan.end, goal)
    assert turn > 1e-6, "it turns to a heading that does not matter"
    no_dearer(result, found_cost(passing(vehicle)), "the plan with a heading", share=1e-2)


def found_cost(result: PlanResult) -> float:
    found(result)
    assert result.cost is not None
    return result.cost


# --- ends and horizon -----------------------------------------------------------------------------


@feature(
    with_goals(lambda goal: replace(goal, tolerance_m=0.0, tolerance_rad=0.0)),
    says="the tolerance is not used",
)
def goal_tolerance(vehicle: Vehicle, engine: Engine) -> None:
    """Above zero the plan may end anywhere within, so it is cheaper; at zero it ends exactly."""
    goal = vehicle.target(tolerance_m=0.05 * vehicle.reach, tolerance_rad=0.1)
    result = asked(vehicle, engine, goals=goal)
    no_dearer(result, base(vehicle).cost, "the exact plan")
    assert result.cost < base(vehicle).cost * (1.0 - 1e-3), "the tolerance is not used"
    way, turn = outside.off_goal(found(base(vehicle)).end, vehicle.target())
    assert max(way, turn) <= EXACT


def _at_rest(problem: Problem) -> Problem:
    goals = tuple(replace(goal, trim=None) for goal in problem.goals)
    return replace(problem, start_trim=None, goals=goals)


@feature(
    changed(_at_rest),
    on="user",
    applies=lambda vehicle: vehicle.inertia and vehicle.moving_trim is not None,
    says="reduced state",
)
def moving_ends(vehicle: Vehicle, engine: Engine) -> None:
    """It starts and ends in a moving trim, sooner than from rest to rest."""
    trim = vehicle.moving_trim
    result = asked(vehicle, engine, start_trim=trim, goals=vehicle.target(trim=trim))
    speed = fine(vehicle, result.plan).speed
    wanted = float(np.linalg.norm(vehicle.automaton[str(trim)].body_velocity[:2]))
    close(float(speed[0]), wanted, "speed at the start", share=0.1)
    close(float(speed[-1]), wanted, "speed at the end", share=0.1)
    if vehicle.rests:
        no_dearer(result, base(vehicle).cost, "the plan from rest to rest")


def _fixed(vehicle: Vehicle) -> float:
    return 1.5 * found(base(vehicle)).duration


@feature(without("horizon"), on="unicycle", says="it takes")
def fixed_time(vehicle: Vehicle, engine: Engine) -> None:
    """The plan lasts exactly as long as asked, with no more effort than the quick one needs."""
    time = _fixed(vehicle)
    result = asked(vehicle, engine, cost=Cost(effort=1.0), horizon=Horizon(time=time))
    if vehicle.rests:  # the quick plan and then rest would do
        quick = Course.of(found(base(vehicle))).effort + _idle(vehicle) * time / 3.0
        no_dearer(result, quick, "the quick plan and rest")


def _idle(vehicle: Vehicle) -> float:
    """Effort per second at rest."""
    index = vehicle.automaton.rest
    assert index is not None
    return float((vehicle.automaton.trims[index].control ** 2).sum())


@feature(without("horizon"), on="grid", says="it takes")
def max_time(vehicle: Vehicle, engine: Engine) -> None:
    """What is cheap but slow is cut short, and too little time is not enough."""
    quick, cost = found(base(vehicle)).duration, Cost(effort=1.0, time=0.1)
    slow = engine.plan(vehicle.problem(cost=cost), time_limit=TIME_LIMIT)
    longest = quick if slow.plan is None else max(quick, slow.plan.duration)
    limit = 0.5 * (1.05 * quick + longest)
    _ = asked(vehicle, engine, cost=cost, horizon=Horizon(max_time=limit))
    short = vehicle.problem(horizon=Horizon(max_time=0.6 * quick))
    result = engine.plan(short, time_limit=TIME_LIMIT)
    if result.plan is not None:
        obeys(vehicle, short, result.plan)


@feature(without("horizon"), on="dubins", says="it takes")
def max_time_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    """A limit just above the quickest known plan is met; too little is not exceeded."""
    known = found(passing(vehicle)).duration
    block = [pillar(vehicle)]
    _ = asked(vehicle, engine, obstacles=block, horizon=Horizon(max_time=1.05 * known))
    short = vehicle.problem(obstacles=block, horizon=Horizon(max_time=0.6 * known))
    result = engine.plan(short, time_limit=TIME_LIMIT)
    if result.plan is not None:
        obeys(vehicle, short, result.plan)


@feature(without("horizon"), says="lasts")
def min_coast(vehicle: Vehicle, engine: Engine) -> None:
    """No trim lasts less than asked: longer than the shortest one of the plan without it."""
    motion = found(base(vehicle))
    times = [time for trim, time in trims_lasting(motion) if trim.body_velocity.any()]
    least = 1.5 * min(times, default=0.1 * motion.duration)
    result = asked(vehicle, engine, horizon=Horizon(min_coast=least))
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)


# --- costs ----------------------------------------------------------------------------------------


def _cheapest(vehicle: Vehicle, engine: Engine, cost: Cost, **changes: object) -> PlanResult:
    """A plan at a cost is no dearer than the quickest one, priced so."""
    result = asked(vehicle, engine, cost=cost, **changes)
    quick = cost_of(cost, found(base(vehicle)))
    no_dearer(result, quick, "the quickest plan", share=SAMPLED)
    return result


@feature(without("cost"), says="cost: ")
def effort(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(effort=1.0, time=0.1))


@feature(without("cost"), says="cost: ")
def length(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(length=1.0, time=0.01))


@feature(without("cost"), says="cost: ")
def norm(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(norm=1.0, time=0.1))


@feature(without("cost"), says="cost: ")
def switch_price(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(time=1.0, switch=0.05 * base(vehicle).cost))


@feature(without("cost"), says="cost: ")
def dear_switch(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(time=1.0, switch=3.0 * base(vehicle).cost))


@feature(without("cost"), says="cost: ")
def dear_switch_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    cost = Cost(time=1.0, switch=3.0 * base(vehicle).cost)
    result = asked(vehicle, engine, cost=cost, obstacles=[pillar(vehicle)])
    no_dearer(result, cost_of(cost, found(passing(vehicle))), "the quickest plan", share=SAMPLED)


@feature(without("cost"), on="car", applies=lambda vehicle: vehicle.reverses, says="cost: ")
def direction_price(vehicle: Vehicle, engine: Engine) -> None:
    """To the side, where a vehicle that drives back and forth changes its direction."""
    pose = np.zeros(len(vehicle.goal))
    pose[:2] = 0.1 * vehicle.reach, 0.3 * vehicle.reach
    goal = vehicle.target(pose=pose)
    quick = asked(vehicle, PACKAGE, goals=goal)
    cost = Cost(time=1.0, direction_change=0.3 * quick.cost)
    result = asked(vehicle, engine, goals=goal, cost=cost)
    no_dearer(result, cost_of(cost, quick.plan), "the quickest plan", share=SAMPLED)


@dataclass(frozen=True)
class Calm:
    """A user's cost: time, and what is turned [1/rad]; it knows nothing of controls."""

    turning: float

    def rates(self, controls: np.ndarray, body_velocities: np.ndarray) -> np.ndarray:
        del controls
        return 1.0 + self.turning * np.abs(outside.flat(body_velocities)[..., 2])

    def switching(self, body_velocities: np.ndarray) -> float:
        del body_velocities
        return 0.0

    def of(self, motion: Plan) -> float:
        course = fine_turns(motion)
        return course.duration + self.turning * float(np.abs(np.diff(course.flat[:, 2])).sum())


def fine_turns(motion: Plan) -> Course:
    return Course.of(motion, step_rad=0.002)


@feature(without("cost"), says="cost: ")
def stage_cost(vehicle: Vehicle, engine: Engine) -> None:
    """A user's own cost is what the plan costs, and it is no dearer than the quickest plan."""
    cost: StageCost = Calm(0.3 * base(vehicle).cost)
    assert isinstance(cost, Calm)
    result = asked(vehicle, engine, cost=cost)
    close(cost.of(found(result)), result.cost, "cost", share=5e-3)
    no_dearer(result, cost.of(found(base(vehicle))), "the quickest plan", share=5e-3)


# --- answers --------------------------------------------------------------------------------------


def _one_motion(problem: Problem, *, alternatives: int = 0, **options: Any) -> PlanResult:
    """A planner whose alternatives are all the best plan, with a trim split in two."""
    result = plan(problem, alternatives=alternatives, **options)
    if result.plan is None or not result.alternatives:
        return result
    again = tuple(replace(one, plan=result.plan, cost=result.cost) for one in result.alternatives)
    return replace(result, alternatives=again)


def _different(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    problem = vehicle.problem(**changes)
    result = engine.plan(problem, time_limit=TIME_LIMIT, alternatives=3)
    best = found(result)
    if not result.alternatives:
        raise Nothing("no alternative")
    plans = [best, *(one.plan for one in result.alternatives)]
    costs = [result.cost, *(one.cost for one in result.alternatives)]
    for one in plans:
        obeys(vehicle, problem, one)
    assert costs == sorted(costs), "costs fall"
    same = list(outside.repeated(plans, tolerance=1e-4 * vehicle.reach))
    assert not same, f"plans {same[0][0]} and {same[0][1]} are the same motion"


@feature(Engine(plan=_one_motion), says="are the same motion")
def alternatives(vehicle: Vehicle, engine: Engine) -> None:
    _different(vehicle, engine)


@feature(Engine(plan=_one_motion), says="are the same motion")
def alternatives_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _different(vehicle, engine, obstacles=[pillar(vehicle)])


class _Fickle:
    """A planner that minds something else at every call."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, problem: Problem, **options: Any) -> PlanResult:
        self.calls += 1
        price = Cost(time=1.0, length=0.01 * self.calls)
        return plan(replace(problem, cost=price), **options)


def _twice(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    one = asked(vehicle, engine, cost_is=False, **changes)
    other = asked(vehicle, engine, cost_is=False, **changes)
    assert one.plan.word == other.plan.word, f"{one.plan.word} and then {other.plan.word}"
    assert one.cost == other.cost, f"cost {one.cost!r} and then {other.cost!r}"
    assert np.array_equal(one.plan.primitive_durations, other.plan.primitive_durations)


@feature(Engine(plan=_Fickle()), says="and then")
def same_plan_twice(vehicle: Vehicle, engine: Engine) -> None:
    _twice(vehicle, engine)


@feature(Engine(plan=_Fickle()), says="and then")
def same_plan_twice_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _twice(vehicle, engine, obstacles=[pillar(vehicle)])


def _answering(**values: object) -> Engine:
    """A planner with some numbers of its answers set."""

    def planned(problem: Problem, **options: Any) -> PlanResult:
        return replace(plan(problem, **options), **values)  # type: ignore[arg-type]

    return Engine(plan=planned)


@feature(_answering(lower_bound=0.0), says="lower bound 0.0")
def lower_bound(vehicle: Vehicle, engine: Engine) -> None:
    """It is above zero, and below what every known plan costs."""
    result = asked(vehicle, engine)
    if not result.lower_bound or not result.lower_bound > 0.0:
        raise Nothing(f"lower bound {result.lower_bound}")
    assert result.lower_bound <= result.cost * (1.0 + SAME)
    assert result.lower_bound <= base(vehicle).cost * (1.0 + SAME)


@feature(_answering(certificate=None), says="no certificate")
def certificate(vehicle: Vehicle, engine: Engine) -> None:
    """The smallest reduced cost is given; a quickest plan has none below zero."""
    # a polished plan is no word of the library; where time costs nothing, words are not polished
    cost = Cost(time=1.0) if vehicle.automaton.is_kinematic else Cost(effort=1.0)
    result = asked(vehicle, engine, cost=cost)
    if result.certificate is None:
        raise Nothing("no certificate")
    assert -1e-3 * result.cost <= result.certificate <= 1e-6, f"certificate {result.certificate}"


@feature(without("obstacles"), says="clearance")
def planner(vehicle: Vehicle, engine: Engine) -> None:
    """Used again, for other ends and another map, it gives the plans of `plan`."""
    common: dict[str, Any] = {"footprint": vehicle.footprint, "search": vehicle.problem().search}
    if vehicle.end_trim:
        common["start_trim"] = vehicle.end_trim
    ready = engine.planner(vehicle.automaton, obstacles=[pillar(vehicle)], **common)
    start = np.zeros(len(vehicle.goal))
    blocked = vehicle.problem(parts={}, obstacles=[pillar(vehicle)])
    first = ready.plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    obeys(replace(vehicle, parts={}), blocked, found(first))
    clear = ready.with_obstacles([]).plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    no_dearer(clear, base(vehicle).cost, "the same plan without a planner", share=1e-2)
    again = ready.plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    no_dearer(again, found_cost(first), "the first answer", share=1e-2)


def _short_of_words(
    automaton: Any, *, obstacles: Any, footprint: Any, search: Any, **_: Any
) -> Any:
    """A planner to which zones, parts, start trims and heights mean nothing."""
    return Planner(automaton, obstacles=obstacles, footprint=footprint, search=search)


@feature(Engine(planner=_short_of_words), on="car", says="m/s in a zone")
def planner_with_all(vehicle: Vehicle, engine: Engine) -> None:
    """It takes parts, zones, a start trim and the height of the body."""
    zone = Zone(shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=_slow(vehicle))
    bridge = Obstacle(pillar(vehicle), height=(1e3, 1e3 + 1.0))
    changes: dict[str, Any] = {"zones": [zone], "obstacles": [bridge], "body_height": (0.0, 1.0)}
    ready = engine.planner(
        vehicle.automaton,
        footprint=vehicle.footprint,
        search=vehicle.problem().search,
        parts=vehicle.parts,
        start_trim=vehicle.end_trim,
        **changes,
    )
    result = ready.plan(np.zeros(len(vehicle.goal)), vehicle.target(), time_limit=TIME_LIMIT)
    obeys(vehicle, vehicle.problem(**changes), found(result))


# --- symmetry -------------------------------------------------------------------------------------


def _still(problem: Problem, **options: Any) -> PlanResult:
    """A planner that rounds what it is given: no two places are alike to it."""
    place = np.round(problem.start[:2]) - problem.start[:2]
    bent = 1.0 + 0.05 * float(np.abs(place).sum())
    return plan(replace(problem, cost=Cost(time=1.0, length=bent - 1.0)), **options)


def _moves(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    """The moved problem has the moved plan, at the same cost."""
    by = np.array([31.4, -12.3, 2.1 if vehicle.rotates else 0.0, 5.0][: len(vehicle.goal)])
    problem = vehicle.problem(**changes)
    here = engine.plan(problem, time_limit=TIME_LIMIT)
    there = engine.plan(problem.moved(group_of(len(by))(by)), time_limit=TIME_LIMIT)
    one, other = found(here), found(there)
    close(there.cost, here.cost, "cost of the moved plan")
    assert one.word == other.word, f"{one.word} and {other.word}"
    close(other.duration, one.duration, "duration of the moved plan")
    times = np.linspace(0.0, min(one.duration, other.duration), 300)
    off = float(np.abs(outside.moved(one.pose_at(times), by) - other.pose_at(times)).max())
    assert off <= 1e-4 * vehicle.reach, f"the moved plan is {off:.3g} off"
    obeys(vehicle, problem.moved(group_of(len(by))(by)), other)


@feature(Engine(plan=_still), says="cost of the moved plan")
def moved_problem(vehicle: Vehicle, engine: Engine) -> None:
    _moves(vehicle, engine)


@feature(Engine(plan=_still), says="cost of the moved plan")
def moved_problem_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _moves(vehicle, engine, obstacles=[pillar(vehicle)])


# --- closed loops ---------------------------------------------------------------------------------


def driven(
    vehicle: Vehicle, engine: Engine, *, options: Mapping[str, Any] | None = None, **changes: object
) -> ClosedLoop:
    """A loop that reaches the goal, its pieces joined, and all it drove within the problem."""
    problem = vehicle.problem(**changes)
    loop = engine.simulate(
        problem,
        step=_step(vehicle),
        **({"steps": STEPS, "time_limit": LOOP_LIMIT} | (options or {})),
    )
    _driven_well(vehicle, problem, loop, noisy="disturbance" in (options or {}))
    return loop


def _step(vehicle: Vehicle) -> float:
    """A step that some ten of make up the plan."""
    return found(base(vehicle)).duration / 8.0


def _driven_well(vehicle: Vehicle, problem: Problem, loop: ClosedLoop, *, noisy: bool) -> None:
    if not loop.reached:
        raise Nothing(f"{loop.status}: {loop.reason}")
    nearest = min(
        max(way - goal.tolerance_m, 0.0 if goal.free_heading else turn - goal.tolerance_rad)
        for goal in problem.goals
        for way, turn in [outside.off_goal(loop.poses[-1], goal)]
    )
    assert nearest <= EXACT * 10.0, f"it stops {nearest:.3g} from the goal"
    assert loop.driven, "nothing was driven"
    for piece, pose, after in zip(loop.driven, loop.poses, loop.poses[1:], strict=False):
        assert np.abs(piece.pose_at(piece.start_time) - pose).max() <= EXACT
        if not noisy:
            assert np.abs(piece.end - after).max() <= EXACT, "it jumps between two steps"
        if piece.primitives:
            obeys(vehicle, problem, piece, ends=False)


def _lazy(problem: Problem, **options: Any) -> ClosedLoop:
    return simulate(problem, **(options | {"steps": 1}))


@feature(Engine(simulate=_lazy), says="the goal is not reached")
def loop(vehicle: Vehicle, engine: Engine) -> None:
    ended = driven(vehicle, engine)
    promised = ended.steps[0].value
    if ended.cost > promised * (1.0 + SAME):
        raise Dearer(f"it spends {ended.cost:.6g}, its first plan cost {promised:.6g}")


@feature(without("obstacles"), says="clearance")
def loop_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _ = driven(vehicle, engine, obstacles=[pillar(vehicle)])


@feature(without("obstacles"), says="clearance")
def loop_moving_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _ = driven(vehicle, engine, obstacles=[_crossing(vehicle)])


@feature(without("zones"), says="m/s in a zone")
def loop_zones(vehicle: Vehicle, engine: Engine) -> None:
    zone = Zone(shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=_slow(vehicle))
    _ = driven(vehicle, engine, zones=[zone])


def _undisturbed(problem: Problem, **options: Any) -> ClosedLoop:
    return simulate(problem, **{k: v for k, v in options.items() if k != "disturbance"})


@feature(Engine(simulate=_undisturbed), says="nothing was disturbed")
def loop_noise(vehicle: Vehicle, engine: Engine) -> None:
    """Pushed a little after every step, it still gets there, to within the goal's tolerance."""
    goal = vehicle.target(tolerance_m=0.02 * vehicle.reach, tolerance_rad=0.1)
    turned = 0.003 if vehicle.rotates else 0.0
    upset = Disturbance(position_m=0.001 * vehicle.reach, heading_rad=turned, seed=1)
    ended = driven(vehicle, engine, goals=goal, options={"disturbance": upset})
    pushed = [
        float(np.abs(piece.end - after).max())
        for piece, after in zip(ended.driven, ended.poses[1:], strict=True)
    ]
    assert max(pushed) > 1e-6, "nothing was disturbed"


@feature(without("horizon"), on="unicycle", says="duration of a step's plan")
def loop_fixed_time(vehicle: Vehicle, engine: Engine) -> None:
    """As in the paper: every step plans for the same time again, and the value falls to zero.

    Where no trim stands still nothing can fill the time: every step plans for what is left of it.
    """
    horizon = Horizon(time=_fixed(vehicle))
    ended = driven(vehicle, engine, cost=Cost(effort=1.0), horizon=horizon)
    values = [step.value for step in ended.steps]
    assert all(b <= a * (1.0 + SAME) for a, b in itertools.pairwise(values))
    for step in ended.steps:
        lasts, passed = Course.of(step.plan).duration, step.time - ended.problem.start_time
        asked_for = _fixed(vehicle) - (passed if vehicle.automaton.rest is None else 0.0)
        close(lasts, asked_for, "duration of a step's plan")


def _forgetful(*arguments: Any) -> Any:
    steps, poses = load_steps(*arguments)
    return (replace(steps[-1], number=0, accumulated_cost=0.0),), poses


def _resumed(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    """Stopped after three steps and taken up from its file, a loop goes on as if it never was."""
    problem = vehicle.problem(**changes)
    options = {"step": _step(vehicle), "time_limit": LOOP_LIMIT}
    begun = engine.simulate(problem, steps=3, **options)
    if len(begun.steps) < 3:
        raise Nothing(begun.reason)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "closed_loop.json"
        save_closed_loop(begun, path)
        steps, poses = engine.load_last(path, vehicle.automaton)
    pose = poses[-1]
    assert np.abs(pose - begun.poses[-1]).max() <= EXACT
    rest = engine.simulate(replace(problem, start=pose), steps=STEPS, last=steps[-1], **options)
    _driven_well(vehicle, replace(problem, start=pose), rest, noisy=False)
    assert rest.steps[0].number == 3, "the steps are not counted on"
    spent = sum(Course.of(one).duration for one in (*begun.driven, *rest.driven))
    close(spent, rest.cost, "cost of the whole loop", share=SAMPLED)
    close(rest.times[0], begun.times[-1], "time")


@feature(Engine(load_last=_forgetful), says="the steps are not counted on")
def resume(vehicle: Vehicle, engine: Engine) -> None:
    _resumed(vehicle, engine)


@feature(Engine(load_last=_forgetful), says="the steps are not counted on")
def resume_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _resumed(vehicle, engine, obstacles=[pillar(vehicle)])


# --- refinement, heights --------------------------------------------------------------------------


def _unpolished(problem: Problem, **options: Any) -> PlanResult:
    """A planner that leaves what it finds as it is."""
    with patch("maneuver_automaton.planning.in_steps.polish_found", lambda *_: None):
        return plan(problem, **options)


@feature(
    Engine(plan=_unpolished),
    on="second_order_unicycle",
    applies=lambda vehicle: vehicle.inertia,
    says="nothing was polished",
)
def polishing(vehicle: Vehicle, engine: Engine) -> None:
    """A motion that the library does not have, cheaper than what it has."""
    result = asked(vehicle, engine, obstacles=[pillar(vehicle)])
    known = {maneuver.name for maneuver in vehicle.automaton.maneuvers}
    own = [one for one in result.plan.maneuvers if one is not None and one.name not in known]
    if not own:
        raise Nothing("nothing was polished")
    plain = _unpolished(vehicle.problem(obstacles=[pillar(vehicle)]), time_limit=TIME_LIMIT)
    no_dearer(result, found_cost(plain) * 0.999, "the plan before it was polished")


def _tall(problem: Problem) -> Problem:
    solid = [replace(one, height=None) for one in problem.obstacles]  # type: ignore[type-var]
    return replace(problem, obstacles=solid)


@feature(
    changed(_tall),
    says="the plan without the bridge costs",
    on="helicopter",
    applies=lambda vehicle: vehicle.flies,
)
def heights(vehicle: Vehicle, engine: Engine) -> None:
    """It flies on under a bridge; what hangs lower it avoids."""
    height, disc = float(midway(vehicle)[3]), pillar(vehicle)
    body = (-0.5, 0.5)
    over = Obstacle(disc, height=(height + 2.0, height + 3.0))
    under = asked(vehicle, engine, obstacles=[over], body_height=body)
    no_dearer(under, base(vehicle).cost, "the plan without the bridge", share=1e-3)
    low = Obstacle(disc, height=(height + 0.2, height + 3.0))
    _ = asked(vehicle, engine, obstacles=[low], body_height=body)
