"""One plan from the start of a scene to a goal, searched wider and wider; a drive that has one."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Player, picture, player_frame, player_page
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.roads.decision import RoadDecision, RoadSettings
from maneuver_automaton.roads.driving import RoadDrive, drive_scene
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.library import tick_of
from maneuver_automaton.roads.missed import nearest_miss
from maneuver_automaton.roads.planner import RoadPlanner, road_planner
from maneuver_automaton.roads.polishing import ROUNDS
from maneuver_automaton.roads.scene import RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

SOONER = (4.0, 8.0, 12.0)  # [s] before a goal is over, by which it is to be reached but for a stop
WIDTHS = (100, 400, 1600, 4000)
LONGEST = 30.0  # [s] that a plan may last


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
    settings = settings or RoadSettings()
    last = scene.last_time - scene.start.time
    tick = tick_of(scene.step)
    horizon = min(max(math.ceil(last / tick - 1e-6) * tick, tick), LONGEST)
    begin = time.perf_counter()
    with patient():
        best = _widened(scene, vehicle, settings, horizon, begin + time_limit)
    return replace(best, search_s=time.perf_counter() - begin)


def _widened(
    scene: RoadScene,
    vehicle: RoadVehicle | None,
    settings: RoadSettings,
    horizon: float,
    deadline: float,
) -> RoadPlanResult:
    """The better one of the first search that finds a plan, and of the next wider one."""
    planner = road_planner(scene, vehicle, replace(settings, width=WIDTHS[0], horizon_s=horizon))
    best = RoadPlanResult(
        planner=planner, decision=None, plan=None, verdict=None, reason="", search_s=0.0
    )
    for width in WIDTHS:
        if width > WIDTHS[0] and (stopped() or time.perf_counter() > deadline):
            break
        found, cost = _searched(planner.wider(width)), best.cost
        if cost is None or (found.cost is not None and found.cost < cost):
            best = found
        if cost is not None:
            break
    return best


def _searched(planner: RoadPlanner) -> RoadPlanResult:
    """Result of one search from the start, polished and judged."""
    found = _past_stops(planner, planner.start_state, 0)
    plan, verdict, reason = None, None, ""
    if found is None or not found.reaches:
        until = planner.time_of(round(planner.settings.horizon_s / planner.tick))
        reason = (
            f"no goal is reached until {min(planner.scene.last_time, until):.6g} s by any of the"
            f" words searched, {planner.settings.width} at a time{_how_near(planner, found)}"
        )
    else:
        found = planner.polished(found, rounds=ROUNDS)
        plan = planner.plan_of(planner.start_state, found.controls[: found.lasting])
        verdict = judged(planner.scene, planner.vehicle, plan)
        if not verdict.clean:
            said = "; ".join(words for _, words in verdict.faults)
            reason = f"the plan that was found fails the judge: {said}"
    none = bool(reason)
    return RoadPlanResult(
        planner=planner,
        decision=None if none else found,
        plan=None if none else plan,
        verdict=None if none else verdict,
        reason=reason,
        search_s=0.0,
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
    first = planner.search(planner.start_state, tick=0)
    if first is not None and first.reaches:
        return None
    return plan_road(planner.scene, planner.vehicle, planner.settings, time_limit=time_limit)


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
