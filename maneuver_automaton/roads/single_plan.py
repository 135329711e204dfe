"""One plan from the start of a scene to a goal, searched wider and wider; a drive that has one."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton.primitives import Trajectory
from maneuver_automaton.roads.driving import RoadDrive, drive_scene, driven_from
from maneuver_automaton.roads.horizon import RoadPlan, RoadPlanner, RoadSettings, road_planner
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.library import tick_of
from maneuver_automaton.roads.missed import nearest_miss
from maneuver_automaton.roads.scene import RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

WIDTHS = (100, 400, 1600, 4000)
LONGEST = 30.0  # [s] that a plan may last


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPlanResult:
    """A plan to a goal and the verdict on it, or why there is none."""

    planner: RoadPlanner
    plan: RoadPlan | None
    driven: Trajectory | None  # to the goal, in the coordinates of the scene
    verdict: RoadVerdict | None
    reason: str  # empty if there is a plan
    search_s: float  # [s]


def plan_road(
    scene: RoadScene,
    vehicle: RoadVehicle | None = None,
    settings: RoadSettings | None = None,
    *,
    time_limit: float = 10.0,
) -> RoadPlanResult:
    """The first plan that reaches a goal and passes the judge, of searches wider and wider.

    No search begins after `time_limit` [s].
    """
    settings = settings or RoadSettings()
    last = scene.last_time - scene.start.time
    tick = tick_of(scene.step)
    horizon = min(max(math.ceil(last / tick - 1e-6) * tick, tick), LONGEST)
    begin, n = time.perf_counter(), 0
    planner = road_planner(scene, vehicle, replace(settings, width=WIDTHS[0], horizon_s=horizon))
    reason = ""
    for width in WIDTHS:
        if n and time.perf_counter() - begin > time_limit:
            break
        planner, n = planner.wider(width), n + 1
        plan = planner.search(planner.start_state, tick=0)
        if plan is None or not plan.reaches:
            reason = (
                f"no goal is reached until {min(scene.last_time, scene.start.time + horizon):.6g} s"
                f" by any of the words searched, {width} at a time{_how_near(planner, plan)}"
            )
            continue
        local = driven_from(planner, planner.start_state, plan.controls[: plan.lasting], tick=0)
        driven = replace(local, pose=planner.world(local.pose))
        verdict = judged(scene, planner.vehicle, driven)
        if not verdict.clean:
            reason = "the plan that was found fails the judge"
            continue
        return RoadPlanResult(
            planner=planner,
            plan=plan,
            driven=driven,
            verdict=verdict,
            reason="",
            search_s=time.perf_counter() - begin,
        )
    return RoadPlanResult(
        planner=planner,
        plan=None,
        driven=None,
        verdict=None,
        reason=reason,
        search_s=time.perf_counter() - begin,
    )


def _how_near(planner: RoadPlanner, plan: RoadPlan | None) -> str:
    """How near the plan that leads furthest comes to a goal."""
    if plan is None or not plan.lasting:
        return "; there is no way on from the start"
    ticks = np.arange(0, plan.lasting + 1, planner.horizon.goals.every)
    times = np.array([planner.time_of(k) for k in ticks.tolist()])
    why = nearest_miss(planner.local.goals, planner.vehicle, times, plan.states[ticks])
    lasts = planner.time_of(plan.lasting)
    return f"; the one that leads furthest, until {lasts:.6g} s, was {why}"


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
    return drive_scene(planner, steps=steps, first=None if before is None else before.plan)
