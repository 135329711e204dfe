"""One plan from the start of a scene to a goal, searched wider and wider; a drive that has one."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Player, picture, player_frame, player_page
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.roads.decision import RoadDecision, RoadSettings
from maneuver_automaton.roads.driving import Driver, RoadDrive, drive_scene
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.missed import nearest_miss
from maneuver_automaton.roads.planner import RoadPlanner, road_planner
from maneuver_automaton.roads.polishing import ROUNDS
from maneuver_automaton.roads.scene import RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

SOONER = (4.0, 8.0, 12.0)  # [s] before a goal is over, by which it is to be reached but for a stop
WIDTHS = (100, 400, 0, 1600, 4000)  # 0: driven in closed loop instead


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPlanResult:
    """A plan to a goal and the verdict on it, or why there is none."""

    planner: RoadPlanner
    decision: RoadDecision | None  # for `drive_scene` to begin with
    plan: Plan | None  # to the goal, in the coordinates and on the clock of the scene
    verdict: RoadVerdict | None
    reason: str  # empty if there is a plan
    search_s: float  # [s]

    __repr__ = brief

    @property
    def cost(self) -> float | None:
        """Cost of the plan, its stop left out."""
        return None if self.decision is None else self.planner.price(self.decision)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file states and is not obeyed, or was read otherwise: a sentence each."""
        if self.decision is None:
            return self.planner.scene.notes
        return self.planner.notes(self.decision.states[: self.decision.lasting + 1])

    @property
    def stop(self) -> Plan | None:
        """The fail-safe stop after the plan, of no duration where none was found."""
        if self.decision is None:
            return None
        n, decision = self.decision.lasting, self.decision
        return self.planner.plan_of(decision.states[n], decision.controls[n:], tick=n)

    def player(self, *, title: str = "") -> Player:
        """A page that plays it: `.html`, or `.save(path)`; `title` heads it."""
        return player_page(self, title=title)

    def _repr_html_(self) -> str:
        return player_frame(self)

    def _repr_png_(self) -> bytes | None:
        return picture(self)


def plan_road(
    scene: RoadScene,
    vehicle: RoadVehicle | None = None,
    settings: RoadSettings | None = None,
    *,
    time_limit: float = 10.0,
) -> RoadPlanResult:
    """A plan to a goal of searches wider and wider: of the first that finds one, or of the next.

    It is polished, and passes the judge. No search begins after `time_limit` [s].
    """
    begin = time.perf_counter()
    with patient():
        best = _widened(road_planner(scene, vehicle, settings), begin + time_limit)
    return replace(best, search_s=time.perf_counter() - begin)


def _widened(planner: RoadPlanner, deadline: float, *, loop: bool = True) -> RoadPlanResult:
    """The better one of the first search that finds a plan, and of the next wider one.

    Without `loop` nothing is driven in closed loop, which is what comes next anyway.
    """
    if (why := planner.hopeless()) is not None:
        return _without(planner, why[1])
    best, driven = _without(planner, ""), ""
    for width in WIDTHS:
        if width != WIDTHS[0] and (stopped() or time.perf_counter() > deadline):
            break
        cost = best.cost
        if width:
            horizon = planner.last_tick * planner.tick
            found = _searched(planner.wider(width, horizon_s=horizon))
        elif cost is None and loop:
            found, driven = _driven(planner, deadline)
        else:
            continue
        if found.plan is not None and (cost is None or (found.cost or 0.0) < cost):
            best = found
        elif cost is None and width:
            best = found  # for its reason
        if cost is not None:
            break
    return best if best.plan is not None else replace(best, reason=best.reason + driven)


def _driven(planner: RoadPlanner, deadline: float) -> tuple[RoadPlanResult, str]:
    """What the closed loop drives, as a plan; else how it ends, in words that follow others."""
    driver = Driver(planner, None)
    while not (driver.is_done or stopped() or time.perf_counter() > deadline):
        driver.step(driver.planner)
    drive = driver.drive(planner.scene)
    if not drive.reached:
        said = f"; driven step by step until {planner.time_of(driver.tick):.6g} s: {drive.status}"
        return _without(planner, ""), f"{said}, {drive.reason}"
    controls = np.array([step.control for step in driver.done]).reshape(-1, 2)
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
        return _without(planner, reason)
    return _judged(planner, found)


def _judged(planner: RoadPlanner, found: RoadDecision) -> RoadPlanResult:
    """A plan to a goal, polished, if it passes the judge."""
    found = planner.polished(found, rounds=ROUNDS)
    plan = planner.plan_of(planner.start_state, found.controls[: found.lasting])
    verdict = judged(planner.scene, planner.vehicle, plan)
    if not verdict.clean:
        said = "; ".join(words for _, words in verdict.faults)
        return _without(planner, f"the plan that was found fails the judge: {said}")
    return RoadPlanResult(
        planner=planner, decision=found, plan=plan, verdict=verdict, reason="", search_s=0.0
    )


def _without(planner: RoadPlanner, reason: str) -> RoadPlanResult:
    return RoadPlanResult(
        planner=planner, decision=None, plan=None, verdict=None, reason=reason, search_s=0.0
    )


def _past_stops(planner: RoadPlanner, state: Array, tick: int) -> RoadDecision | None:
    """A plan from a state (5,) at a tick: to each stop sign on the way, and on from there."""
    best = found = planner.search(state, tick=tick)
    for sooner in SOONER:
        if found is None or found.reaches:
            break
        for k, there in enumerate(found.states):
            if (opened := planner.opened(there)) is not planner:
                onward = _past_stops(opened, there, tick + k)
                best = found if onward is None else found.then(onward, after=k)
                if best.reaches:
                    return best
                break
        if all(one.stop_line.phases for one in planner.barriers):
            break
        # The search knows nothing of the way after the stop, so it is told to hurry.
        found = planner.until(planner.last_tick - round(sooner / planner.tick)).search(
            state, tick=tick
        )
    return best


def _how_near(planner: RoadPlanner, found: RoadDecision | None) -> str:
    """How near the plan that leads furthest comes to a goal."""
    if found is None or not found.lasting:
        return "; no motion leads on from the start"
    ticks = np.arange(0, found.lasting + 1, planner.horizon.goals.every)
    times = np.array([planner.time_of(k) for k in ticks.tolist()])
    why = nearest_miss(planner.local.goals, planner.vehicle, times, found.states[ticks])
    lasts = planner.time_of(found.lasting)
    waits = planner.waits(found.states[found.lasting], tick=found.lasting)
    return f"; the one that leads furthest, until {lasts:.6g} s, was {why}{waits}"


def plan_before(planner: RoadPlanner, *, time_limit: float = 10.0) -> RoadPlanResult | None:
    """A wider search before the start; None if that of one step reaches a goal from there.

    Parameters
    ----------
    planner : RoadPlanner
        The planner that is to drive.
    time_limit : float
        No search begins after it [s].
    """
    first = None if planner.hopeless() else planner.search(planner.start_state, tick=0)
    if first is not None and first.reaches:
        return None
    begin = time.perf_counter()
    with patient():
        best = _widened(planner, begin + time_limit, loop=False)
    return replace(best, search_s=time.perf_counter() - begin)


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
