"""One plan from the start of a scene to a goal, searched wider and wider."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

from maneuver_automaton.primitives import Trajectory
from maneuver_automaton.roads.driving import driven_from
from maneuver_automaton.roads.horizon import RoadPlan, RoadPlanner, RoadSettings, road_planner
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.library import TICK
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
    horizon = min(max(math.ceil(last / TICK) * TICK, TICK), LONGEST)
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
                f" by any of the words searched, {width} at a time"
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
