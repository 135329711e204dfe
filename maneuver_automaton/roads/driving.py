"""One vehicle on a road: a plan, searched wider and wider, and a drive in closed loop.

The loop plans, drives one time step of the scene, and plans again.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.roads.planner import RoadPlanner, road_planner
from maneuver_automaton.roads.plans import AT_REST, ROUNDS, RoadDecision, RoadSettings
from maneuver_automaton.roads.rules import RoadVerdict, judged, nearest_miss
from maneuver_automaton.roads.scene import RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

SOONER = (4.0, 8.0, 12.0)  # [s] before a goal is over, by which it is to be reached but for a stop
WIDTHS = (100, 400, 1600, 4000, 0)  # 0: driven in closed loop instead, which takes longest


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadStep:
    """One step: the state before it, what was decided there, and the control applied."""

    number: int
    time: float  # [s]
    state: Array  # (5,) x, y, heading of the rear axle, speed, steering, in the planner's frame
    decision: RoadDecision
    value: float  # cost of the plan that was decided for
    applied_cost: float  # of its first step
    replanned: bool  # the plan is not the tail of the last one
    solve_s: float  # [s] to decide
    cpu_s: float  # [s] of it that the processor spent on this thread

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "state", last=5)

    @property
    def control(self) -> Array:
        """Acceleration [m/s^2] and steering rate [rad/s] (2,) until the next step."""
        return np.asarray(self.decision.controls[0])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadDrive(Played):
    """A drive from its start to where it ended, and what the audit says of it."""

    planner: RoadPlanner
    steps: tuple[RoadStep, ...]
    driven: Plan  # all that was driven, in the coordinates and on the clock of the scene
    reached: bool  # a goal, and the verdict is clean
    status: str  # reached | touched | off_road | undrivable | missed | steps_spent
    reason: str  # one line; empty if reached
    verdict: RoadVerdict

    __repr__ = brief

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file states and is not obeyed, or was read otherwise: a sentence each."""
        applied = np.array([step.control for step in self.steps]).reshape(-1, 2)
        return self.planner.notes(np.repeat(applied, self.planner.every, axis=0))

    @property
    def cost(self) -> float:
        """Cost of what was driven."""
        return math.fsum(step.applied_cost for step in self.steps)

    @property
    def solve_s(self) -> Array:
        """Time (n,) that every step took to decide [s]."""
        return np.array([step.solve_s for step in self.steps])


def drive_scene(
    planner: RoadPlanner,
    *,
    steps: int | None = None,
    first: RoadDecision | None = None,
    progress: Callable[[int], None] | None = None,
) -> RoadDrive:
    """Close the loop until a goal is reached, or its time is over.

    The planner knows the recorded motion of all moving obstacles before it happens.

    Parameters
    ----------
    planner : RoadPlanner
    steps : int, optional
        Steps at most.
    first : RoadDecision, optional
        What was decided before the start, such as the decision of `plan_road`.
    progress : callable, optional
        Called with the number of each step that is done.
    """
    driver = Driver(planner, first, steps)
    with patient():
        if not driver.is_done:
            planner.warm()
        while not (driver.is_done or stopped()):
            driver.step(driver.planner)
            if progress is not None:
                progress(len(driver.done))
    return driver.drive(planner.scene)


class Driver:
    """A vehicle along its drive: where it is, and what it does next if nothing better is found."""

    def __init__(
        self,
        planner: RoadPlanner,
        first: RoadDecision | None,
        steps: int | None = None,
        others: Sequence[Obstacle] = (),
    ) -> None:
        """`others` are there at the start, besides the traffic that the planner knows."""
        last = planner.last_tick
        self.planner = planner
        self.hopeless = planner.hopeless(others)
        most = last if steps is None else min(steps * planner.every, last)
        self.limit = 0 if self.hopeless else most
        self.state = planner.start_state
        self.tail = first
        self.tick = 0
        self.done: list[RoadStep] = []

    @property
    def reached(self) -> bool:
        """Whether it is at a goal."""
        return not self.hopeless and self.planner.at_goal(self.state, tick=self.tick)

    @property
    def is_done(self) -> bool:
        """Whether it is at a goal, or there are no steps left."""
        return self.reached or self.tick >= self.limit

    def step(self, planner: RoadPlanner) -> None:
        """Decide as a planner says, which knows the traffic of now, and drive a step."""
        self.done.append(_step(planner, self.state, tick=self.tick, tail=self.tail))
        decision, lasting = self.done[-1].decision, [planner.scene.step]
        course = drive(  # by the model's own equations
            planner.vehicle.model, self.state[3:], control=decision.controls[:1], durations=lasting
        )
        pose = (SE2(self.state[:3]) @ SE2(course.pose[-1])).pose
        speed, steering = course.reduced_state[-1].tolist()
        self.state = np.array([*pose, 0.0 if abs(speed) <= AT_REST else speed, steering])
        self.tick, self.tail = self.tick + planner.every, decision.tail(planner.every)
        self.planner = self.planner.opened(self.state)

    @property
    def driven(self) -> Plan:
        """All that it drove, in the coordinates and on the clock of the scene."""
        return self.planner.plan_of(self.planner.start_state, self.applied)

    @property
    def applied(self) -> Array:
        """The controls (n, 2) of all ticks so far."""
        applied = np.array([step.control for step in self.done]).reshape(-1, 2)
        return np.repeat(applied, self.planner.every, axis=0)

    def drive(self, scene: RoadScene) -> RoadDrive:
        """The drive, judged among the traffic of a scene."""
        planner, at_goal, driven = self.planner, self.reached, self.driven
        states = np.array([*(step.state for step in self.done), self.state])
        stood = [step.time for step in self.done if step.decision.stands]
        status, reason = _ending(planner, states, stood=stood, reached=at_goal)
        reason += ", when the drive was interrupted" if stopped() and not at_goal else ""
        verdict = judged(scene, planner.vehicle, driven)
        if self.hopeless is not None:
            status, reason = self.hopeless
        elif verdict.faults:  # they decide how it ended, wherever it ended
            status = verdict.faults[0][0]
            ended = reason or f"a goal was reached at {planner.time_of(self.tick):.6g} s"
            reason = "; ".join([*(said for _, said in verdict.faults), ended])
        return RoadDrive(
            planner=planner,
            steps=tuple(self.done),
            driven=driven,
            reached=status == "reached",
            status=status,
            reason=reason,
            verdict=verdict,
        )


def _step(planner: RoadPlanner, state: Array, *, tick: int, tail: RoadDecision | None) -> RoadStep:
    """Decide once, and measure how long that takes."""
    wall, cpu = time.perf_counter(), time.thread_time()
    decision, replanned = planner.decide(state, tick=tick, tail=tail)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
    return RoadStep(
        number=tick // planner.every,
        time=planner.time_of(tick),
        state=state,
        decision=decision,
        value=planner.price(decision),
        applied_cost=planner.price(decision, ticks=planner.every),
        replanned=replanned,
        solve_s=wall,
        cpu_s=cpu,
    )


def _ending(
    planner: RoadPlanner, states: Array, *, stood: Sequence[float], reached: bool
) -> tuple[str, str]:
    """Status and reason after the `states` (n, 5) at all steps, some of them `stood` at [s]."""
    if reached:
        return "reached", ""
    steps = len(states) - 1
    tick = steps * planner.every
    now, over = planner.time_of(tick), tick >= planner.last_tick
    times = np.array([planner.time_of(k * planner.every) for k in range(len(states))])
    why = nearest_miss(planner.local.goals, planner.vehicle, times, states)
    if stood:
        first, last = stood[0], stood[-1]
        since = f"at {first:.6g} s" if first == last else f"from {first:.6g} s to {last:.6g} s"
        why += f"; no continuation was found {since}"
    why += planner.waits(states[-1], tick=tick)
    if over:
        why += planner.hindrance
        return "missed", f"no goal was reached until {now:.6g} s, when the last one is over; {why}"
    return "steps_spent", f"no goal was reached in {steps} steps, until {now:.6g} s; {why}"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPlanResult(Played):
    """A plan to a goal and the verdict on it, or why there is none."""

    planner: RoadPlanner
    # For `drive_scene` to begin with: it leads to the goal, or free until the last one is over.
    decision: RoadDecision | None = None
    plan: Plan | None = None  # to the goal, in the coordinates and on the clock of the scene
    verdict: RoadVerdict | None = None
    reason: str = ""  # empty if there is a plan
    search_s: float = 0.0  # [s]

    __repr__ = brief

    @property
    def cost(self) -> float | None:
        """Cost of the plan, its stop left out."""
        decision = self.decision if self.plan is not None else None
        return None if decision is None else self.planner.price(decision)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file states and is not obeyed, or was read otherwise: a sentence each."""
        if self.decision is None or self.plan is None:
            return self.planner.scene.notes
        return self.planner.notes(self.decision.controls[: self.decision.lasting])

    @property
    def stop(self) -> Plan | None:
        """The fail-safe stop after the plan, of no duration where none was found."""
        if self.decision is None or self.plan is None:
            return None
        n, decision = self.decision.lasting, self.decision
        return self.planner.plan_of(decision.states[n], decision.controls[n:], tick=n)


def plan_road(
    scene: RoadScene,
    vehicle: RoadVehicle | None = None,
    settings: RoadSettings | None = None,
    *,
    time_limit: float = 10.0,
) -> RoadPlanResult:
    """A plan to a goal of searches wider and wider: of the first that finds one, or of the next.

    It is polished, and passes the judge. No search begins after `time_limit` [s], but for the one
    that says who is in the way where there is no plan.
    """
    return _widened(road_planner(scene, vehicle, settings), time_limit)


def _widened(planner: RoadPlanner, limit: float, *, loop: bool = True) -> RoadPlanResult:
    """A plan within limits of speed, looked for in half of the time [s]; else one beyond them."""
    begin = time.perf_counter()
    if (why := planner.hopeless()) is not None:
        return RoadPlanResult(planner=planner, reason=why[1])
    limited = bool(np.isfinite(planner.route.limit).any())
    with patient():
        widths = WIDTHS if planner.limits_leave_time else WIDTHS[:2]
        give_up = begin + (0.5 if limited else 1.0) * limit
        best = _wider(planner, give_up, begin + limit, widths, loop=loop)
        if limited and best.plan is None and not stopped():
            hurried = _wider(planner.hurried(), begin + limit, begin + limit, WIDTHS, loop=True)
            best = best if hurried.plan is None else hurried
    if best.plan is None:
        best = replace(best, reason=best.reason + (planner.hindrance or _who_hits(planner)))
    return replace(best, search_s=time.perf_counter() - begin)


def _wider(
    planner: RoadPlanner, give_up: float, deadline: float, widths: Sequence[int], *, loop: bool
) -> RoadPlanResult:
    """The better one of the first search that finds a plan, and of the next wider one."""
    best, driven = RoadPlanResult(planner=planner), ""
    for width in widths:
        over = give_up if best.plan is None else deadline
        if width != widths[0] and (stopped() or time.perf_counter() > over):
            break
        cost = best.cost
        if width:
            found = _searched(planner.wider(width, horizon_s=planner.last_tick * planner.tick))
        elif cost is None and loop:
            found, driven = _driven(planner, give_up)
        else:
            continue
        if found.plan is not None and (cost is None or (found.cost or 0.0) < cost):
            best = found
        elif cost is None and width:
            best = found  # for its reason
        if cost is not None:
            break
    return best if best.plan is not None else replace(best, reason=best.reason + driven)


def _who_hits(planner: RoadPlanner) -> str:
    """Whose recorded motion meets the way that is there without it, as the end of a sentence."""
    names = {one.name for one in planner.scene.traffic if one.motion is not None}
    if not names or stopped():
        return ""
    wider = planner.wider(WIDTHS[2], horizon_s=planner.last_tick * planner.tick)
    found = _past_stops(wider.without(names), planner.start_state, 0)
    if found is None or not found.reaches:
        return ""
    way = planner.plan_of(planner.start_state, found.controls[: found.lasting])
    hit = judged(planner.scene, planner.vehicle, way).hit
    who = f"{' and '.join(hit)} hit{'s' if len(hit) == 1 else ''} it"
    arrival = f"a goal is reached at {planner.time_of(found.lasting):.6g} s"
    return f"; without those who move {arrival}, on a way where {who}" if hit else ""


def _driven(planner: RoadPlanner, deadline: float) -> tuple[RoadPlanResult, str]:
    """What the closed loop drives, as a plan; else how it ends, in words that follow others."""
    driver = Driver(planner, None)
    while not (driver.is_done or stopped() or time.perf_counter() > deadline):
        driver.step(driver.planner)
    drive = driver.drive(planner.scene)
    if not drive.reached:
        said = f"; driven step by step until {planner.time_of(driver.tick):.6g} s: {drive.status}"
        return RoadPlanResult(planner=planner), f"{said}, {drive.reason}"
    controls = driver.applied
    plan = planner.of_controls(planner.start_state, 0, controls, len(controls), reaches=True)
    return _judged(planner, plan), ""


def _searched(planner: RoadPlanner) -> RoadPlanResult:
    """Result of one search from the start, polished and judged."""
    found = _past_stops(planner, planner.start_state, 0)
    if found is not None and not found.reaches:
        found = planner.standing_on(found)
    if found is None or not found.reaches:
        reason = (
            f"no goal is reached until {planner.time_of(planner.last_tick):.6g} s by any of the"
            f" words searched, {planner.settings.width} at a time{_how_near(planner, found)}"
        )
        lasts = found is not None and found.lasting >= planner.last_tick
        return RoadPlanResult(planner=planner, decision=found if lasts else None, reason=reason)
    return _judged(planner, found)


def _judged(planner: RoadPlanner, found: RoadDecision) -> RoadPlanResult:
    """A plan to a goal, polished, if it passes the judge."""
    found = planner.polished(found, rounds=ROUNDS)
    plan = planner.plan_of(planner.start_state, found.controls[: found.lasting])
    verdict = judged(planner.scene, planner.vehicle, plan)
    if not verdict.clean:
        said = "; ".join(words for _, words in verdict.faults)
        reason = f"the plan that was found fails the judge: {said}"
        return RoadPlanResult(planner=planner, reason=reason)
    return RoadPlanResult(planner=planner, decision=found, plan=plan, verdict=verdict)


def _past_stops(planner: RoadPlanner, state: Array, tick: int) -> RoadDecision | None:
    """A plan from a state (5,) at a tick: to each stop sign on the way, and on from there."""
    best = found = planner.search(state, tick=tick)
    for sooner in SOONER:
        if found is None or found.reaches:
            break
        for k in range(0, len(found.states), planner.every):
            there = found.states[k]
            if (opened := planner.opened(there)) is not planner:
                onward = _past_stops(opened, there, tick + k)
                best = found if onward is None else found.then(onward, after=k)
                if best.reaches:
                    return best
                break
        if all(one.stop_line.phases for one in planner.barriers):
            break
        # The search knows nothing of the way after the stop, so it is told to hurry.
        before = planner.every * round(sooner / planner.scene.step)
        found = planner.until(planner.last_tick - before).search(state, tick=tick)
    return best


def _how_near(planner: RoadPlanner, found: RoadDecision | None) -> str:
    """How near the plan that leads furthest comes to a goal."""
    if found is None or not found.lasting:
        return "; no motion leads on from the start"
    ticks = np.arange(0, found.lasting + 1, planner.every)
    times = np.array([planner.time_of(k) for k in ticks.tolist()])
    why = nearest_miss(planner.local.goals, planner.vehicle, times, found.states[ticks])
    lasts = planner.time_of(found.lasting)
    waits = planner.waits(found.states[found.lasting], tick=found.lasting)
    return f"; the one that leads furthest ends at {lasts:.6g} s; {why}{waits}"


def plan_before(planner: RoadPlanner, *, time_limit: float = 10.0) -> RoadPlanResult | None:
    """A search before the start; None if that of one step finds all that there is to find.

    It is wider where the search of a step reaches no goal. Where that does, and a goal lasts
    beyond what a step looks ahead, it is one for a cheaper plan that ends later.

    Parameters
    ----------
    planner : RoadPlanner
        The planner that is to drive.
    time_limit : float
        No search begins after it [s].
    """
    first = None if planner.hopeless() else planner.search(planner.start_state, tick=0)
    if first is None or not first.reaches:
        return _widened(planner, time_limit, loop=False)
    begin, horizon = time.perf_counter(), planner.last_tick * planner.tick
    if horizon <= planner.settings.horizon_s or not first.stops:
        return None
    below = planner.price(planner.polished(first))
    later = planner.wider(WIDTHS[0], horizon_s=horizon)
    found = later.search(planner.start_state, tick=0, below=below)
    result = None if found is None else _judged(later, found)
    if result is None or result.plan is None:
        return None
    return replace(result, search_s=time.perf_counter() - begin)


def drive_road(
    scene: RoadScene,
    vehicle: RoadVehicle | None = None,
    settings: RoadSettings | None = None,
    *,
    steps: int | None = None,
    time_limit: float = 10.0,
) -> RoadDrive:
    """A scene driven in closed loop, from one plan made before the start where that is needed.

    Examples
    --------
    >>> from maneuver_automaton.roads import GoalRegion, Lanelet, RoadStart
    >>> lane = Lanelet(1, [[0, 2], [90, 2]], [[0, -2], [90, -2]])
    >>> scene = RoadScene(name="lane", lanelets=(lane,), goals=(GoalRegion(time=(0.3, 0.5)),),
    ...                   start=RoadStart(middle=[5.0, 0.0, 0.0], speed=10.0))
    >>> drive_road(scene).status
    'reached'
    """
    planner = road_planner(scene, vehicle, settings)
    before = plan_before(planner, time_limit=time_limit)
    return drive_scene(planner, steps=steps, first=None if before is None else before.decision)
