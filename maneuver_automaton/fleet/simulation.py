"""A fleet's closed loop in simulation: noise, pushes, breakdowns, joining, leaving, lost words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from maneuver_automaton._arrays import Array, as_number, as_whole, check_range
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet.agreement import Lost
from maneuver_automaton.fleet.held import fleet_with_room, tube_of
from maneuver_automaton.fleet.horizon import FleetHorizon
from maneuver_automaton.fleet.planning import plan_fleet
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import (
    Closest,
    FleetGuarantee,
    FleetLog,
    FleetResult,
    FleetStep,
    FleetViolation,
)
from maneuver_automaton.fleet.vehicle import FleetMember
from maneuver_automaton.fleet.verdict import measured
from maneuver_automaton.fleet.workers import Workers
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.rest_of_plan import moves_on
from maneuver_automaton.receding_horizon.simulation import (
    Disturbance,
    Draw,
    as_driven,
    checked,
    draws,
    pushed,
)

TOUCHES = 1e-9  # [m] what is closer touches
NEVER: Mapping[str, float] = MappingProxyType({})


def simulate_fleet(
    fleet: FleetProblem,
    *,
    step: float,
    steps: int = 200,
    disturbance: Disturbance | Mapping[str, Disturbance] | None = None,
    seed: int = 0,
    first: FleetResult | None = None,
    first_time_limit: float = 5.0,
    margin: float = 0.0,
    tube_m: float | None = None,
    time_limit: float = 1.0,
    swaps_per_step: int | None = 2,
    at_once: int = 1,
    group_size: int = 1,
    delay_steps: int = 0,
    lost: Lost | None = None,
    workers: Workers | None = None,
    joins_s: Mapping[str, float] = NEVER,
    breaks_s: Mapping[str, float] = NEVER,
    log: FleetLog | None = None,
    progress: Callable[[FleetStep], None] | None = None,
) -> FleetLog:
    """Close the loop of a fleet until all that can have arrived, or `steps` steps are spent.

    Parameters
    ----------
    fleet : FleetProblem
    step : float
        delta [s].
    steps : int
        At most so many.
    disturbance : Disturbance, or a mapping of str to Disturbance, optional
        Of all vehicles, or of each that is named; every one has numbers of its own. Only who drives
        is disturbed, but anybody may be pushed. Its delay is no matter: see `delay_steps`.
    seed : int
        Of the disturbances and the first plans.
    first : FleetResult, optional
        Plans to begin with; those of `plan_fleet` if omitted, within `first_time_limit` [s].
    margin, tube_m, time_limit, swaps_per_step, at_once, group_size, delay_steps, lost, workers
        As in `FleetHorizon`.
    joins_s : mapping of str to float
        When vehicles appear at their starts [s]; each joins as soon as there is room.
    breaks_s : mapping of str to float
        When vehicles break down [s]: they stop as soon as they can, and stay there.
    log : FleetLog, optional
        To go on after the last step of a loop that was broken off, with disturbances of the same
        seed: `steps` more at most. What comes back is the log of both.
    progress : callable, optional
        Called with every step.

    Returns
    -------
    FleetLog
        Its distances are measured along what was driven, disturbances included.

    Raises
    ------
    ValueError
        If a number is out of its range, a name is none of the fleet's, or the log is one of other
        vehicles or steps.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> robot = Automaton.of_controls(
    ...     Unicycle(), {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    ... )
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> across = Problem(robot, [2, -2, 0], [2, 2, 0], footprint=Disc(0.3))
    >>> fleet = FleetProblem([there, across], names=["a", "b"], margin=0.1)
    >>> log = simulate_fleet(fleet, step=0.5, first_time_limit=1.0)
    >>> log.reached, sorted(log.arrived_s), log.distance_m > 0.1, [*log.violations]
    (True, ['a', 'b'], True, [])
    """
    steps, seed = as_whole("steps", steps), as_whole("seed", seed)
    step = as_number("step", step)
    first_time_limit = as_number("first_time_limit", first_time_limit)
    check_range("steps", steps, least=1)
    for what, times in (("joins_s", joins_s), ("breaks_s", breaks_s)):
        for name in times:
            if name not in fleet.names:
                raise ValueError(f"{what}: no vehicle is named {name!r}")
    if log is not None and log.step != step:
        raise ValueError(f"step is {step:g} s, need that of the log to go on from, {log.step:g} s")
    if first is None and not (log and log.steps):
        there = set(fleet.names) - set(joins_s)
        if there:  # with room for noise where they end
            roomy = fleet_with_room(fleet.only(there), tube_of(fleet, tube_m))
            first = plan_fleet(roomy, time_limit=first_time_limit, seed=seed)
    loop = FleetHorizon(
        fleet,
        step=step,
        first=first,
        margin=margin,
        tube_m=tube_m,
        time_limit=time_limit,
        swaps_per_step=swaps_per_step,
        at_once=at_once,
        group_size=group_size,
        delay_steps=delay_steps,
        lost=lost,
        workers=workers,
        log=log,
    )
    drives = [
        _VehicleDrive(one, upset) for one, upset in _upsets(loop.state.vehicles, disturbance, seed)
    ]
    world = _FleetWorld(loop, drives, step, dict(joins_s), dict(breaks_s))
    if log is not None:
        world.go_on_from(log)
    begin = world.steps[-1].number + 1 if world.steps else 0
    with patient():
        for number in range(begin, begin + steps):
            if stopped() or world.is_over:
                break
            now = world.advance(number)
            if progress is not None:
                progress(now)
    return world.log()


def _upsets(
    vehicles: list[FleetMember],
    disturbance: Disturbance | Mapping[str, Disturbance] | None,
    seed: int,
) -> Iterator[tuple[FleetMember, Disturbance]]:
    """Every vehicle with its disturbance, whose numbers are its own."""
    undisturbed = Disturbance()
    seeds = np.random.SeedSequence(seed).generate_state(len(vehicles)).tolist()
    for one, own in zip(vehicles, seeds, strict=True):
        if isinstance(disturbance, Mapping):
            upset = disturbance.get(one.name, undisturbed)
        else:
            upset = undisturbed if disturbance is None else disturbance
        dof = one.problem.start.size
        if upset.twist_scale is not None and one.problem.has_inertia:
            raise ValueError(
                "fleet: disturbance: twist_scale is for vehicles without inertia: "
                "a maneuver is driven as its model says"
            )
        yield one, checked(replace(upset, seed=int(own) + upset.seed), dof)


@dataclass(slots=True, eq=False)
class _VehicleDrive:
    """A vehicle along the loop."""

    vehicle: FleetMember
    upset: Disturbance
    pose: Array = field(init=False)
    random: Iterator[Draw] = field(init=False)
    pieces: list[Plan] = field(default_factory=list)
    cost: float = 0.0

    def __post_init__(self) -> None:
        self.pose = np.array(self.vehicle.problem.start)
        self.random = draws(self.upset, self.pose.size)

    def drive(self, now: FleetStep, step: float, number: int, noise: Array) -> Plan:
        """Drive what a step says from where the vehicle is, until the next one; what was driven."""
        problem = self.vehicle.problem
        piece = now.piece_of(self.vehicle.name, self.pose, now.time + step, problem.automaton.model)
        if piece.trims:
            self.cost += problem.cost_of(piece)
        piece = as_driven(piece, self.upset)
        self.pieces.append(piece)
        self.end(number, noise)
        return piece

    def end(self, number: int, noise: Array) -> None:
        """Be where the last piece led, and where that step's disturbance led from there."""
        piece = self.pieces[-1]
        self.pose = np.array(piece.end)
        if moves_on(piece):
            self.pose = self.pose + noise
        self.pose = pushed(self.pose, self.upset, after=number)

    def leaves_at(self, plan: Plan) -> float:
        """When [s] it leaves at the end of the plan that it holds; inf if it does not."""
        goals = self.vehicle.problem.goals
        leaves = self.vehicle.leaves and any(within(plan.end, goal) for goal in goals)
        return plan.start_time + plan.duration if leaves else math.inf


@dataclass(slots=True, eq=False)
class _FleetWorld:
    """All vehicles, the loop that drives them, and what happens to them."""

    loop: FleetHorizon
    drives: list[_VehicleDrive]
    step: float
    joins_s: dict[str, float]
    breaks_s: dict[str, float]
    steps: list[FleetStep] = field(default_factory=list)
    arrived_s: dict[str, float] = field(default_factory=dict)
    gone: set[str] = field(default_factory=set)
    broken: set[str] = field(default_factory=set)
    closest: Closest | None = None

    def go_on_from(self, log: FleetLog) -> None:
        """All of a log's steps are over, with the random numbers that they used."""
        if not log.steps:
            return
        self.steps, self.arrived_s = list(log.steps), dict(log.arrived_s)
        self.broken, self.closest = set(log.broken_down), log.closest
        self.loop.state.agreement.sent += log.counts.get("messages", 0)
        number = log.steps[-1].number
        for one in self.drives:
            name = one.vehicle.name
            one.pieces, one.cost = [*log.driven[name]], math.fsum(log.costs_of(name).values())
            *_, draw = itertools.islice(one.random, number + 1)
            if one.pieces:
                one.end(number, draw.noise)
            if one.vehicle.leaves and name in self.arrived_s:
                self.gone.add(name)

    @property
    def time(self) -> float:
        """The time of the next step [s]."""
        if self.steps:
            return self.steps[-1].time + self.step
        return min(one.vehicle.problem.start_time for one in self.drives)

    @property
    def is_over(self) -> bool:
        """Whether all that can have arrived."""
        names = {one.vehicle.name for one in self.drives}
        return not names - set(self.arrived_s) - self.broken - self._stuck

    @property
    def _stuck(self) -> set[str]:
        """Whose workers are gone, whose plans do not arrive, and who has none to go on along."""
        if not self.steps:
            return set()
        values = self.steps[-1].values
        waiting = {self.loop.fleet.names[k] for k in self.loop.state.stopped}
        return {name for name in self.steps[-1].silent if values[name] == math.inf} - waiting

    def advance(self, number: int) -> FleetStep:
        """One step: measure, decide, drive."""
        time, states, noises = self.time, dict[str, Array](), dict[str, Array]()
        for one in self.drives:
            draw, name = next(one.random), one.vehicle.name
            noises[name] = draw.noise
            if name not in self.gone and self.joins_s.get(name, -math.inf) <= time:
                states[name] = one.pose + draw.measurement
        due = {name for name, at in self.breaks_s.items() if at <= time and name in states}
        now = self.loop.step(states, time=time, broken_down=due - set(self.arrived_s))
        self.broken |= due & set(now.plans) - set(now.arrived)
        driven, leaves_s = {}, {}
        for k, one in enumerate(self.drives):
            name = one.vehicle.name
            if name not in now.plans:
                continue
            if name in now.arrived and name not in self.arrived_s:
                plan = now.plans[name]
                self.arrived_s[name] = min(time, plan.start_time + plan.duration)
            if name in now.arrived and one.vehicle.leaves:
                self.gone.add(name)
                continue
            # a void plan may undo an arrival
            if name not in now.arrived:
                self.arrived_s.pop(name, None)
            driven[k] = one.drive(now, self.step, number, noises[name])
            leaves_s[k] = one.leaves_at(now.plans[name])
        self.steps.append(self._judged(now, driven, leaves_s))
        return self.steps[-1]

    def _judged(
        self, now: FleetStep, driven: Mapping[int, Plan], leaves_s: Mapping[int, float]
    ) -> FleetStep:
        """The step with the collisions that were measured along what it drove, until each left."""
        names = [one.vehicle.name for one in self.drives]
        courses = {
            k: replace(self.drives[k].vehicle.course_of(piece), until=leaves_s[k])
            for k, piece in driven.items()
        }
        rows = measured(courses, names, keep=self.loop.fleet.margin)
        hits = []
        for row in rows:
            if self.closest is None or row.distance_m < self.closest.distance_m:
                self.closest = row
            if row.distance_m <= TOUCHES:
                reason = f"they touch at {row.time_s:.6g} s"
                hits.append(FleetViolation(FleetGuarantee.NO_COLLISION, row.pair, reason))
        least = min((row.distance_m for row in rows), default=math.inf)
        return replace(now, distance_m=least, violations=(*now.violations, *hits))

    def log(self) -> FleetLog:
        """The log of all steps."""
        left = {one.vehicle.name for one in self.drives} - set(self.arrived_s) - self.broken
        status, reason = "reached", ""
        of_loop = self.loop.state.settings.workers
        workers = {} if of_loop is None else of_loop.counts
        if left:
            status = "steps_spent"
            reason = f"{', '.join(sorted(left))} did not arrive in {len(self.steps)} steps"
        return FleetLog(
            problem=self.loop.fleet,
            step=self.step,
            steps=tuple(self.steps),
            driven={one.vehicle.name: tuple(one.pieces) for one in self.drives},
            arrived_s=dict(self.arrived_s),
            broken_down=tuple(sorted(self.broken)),
            closest=self.closest,
            status=status,
            reason=reason,
            cost=math.fsum(one.cost for one in self.drives),
            counts={
                "swaps": sum(len(one.swaps) for one in self.steps),
                "asked": sum(len(one.asked) for one in self.steps),
                "messages": self.loop.state.agreement.sent,
                **workers,
            },
        )
