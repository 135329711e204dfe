"""What a player shows of several vehicles on one road: all at once, of which one may be picked."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.cast import cast_of
from maneuver_automaton.plotting.footprint import footprint_polygons
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.player.clearances import (
    clearance_entry,
    distance_curve,
    sample_times,
)
from maneuver_automaton.plotting.player.composing import Fact, around, names_of, trim_entries
from maneuver_automaton.plotting.player.local import Local, hex_color
from maneuver_automaton.plotting.player.motions import curve_entries, motion_entry
from maneuver_automaton.plotting.player.surroundings import body_entries, obstacle_entries
from maneuver_automaton.plotting.scene import Scene
from maneuver_automaton.plotting.track import track_of_plan
from maneuver_automaton.recording import recording_of
from maneuver_automaton.roads import RoadFleetDrive, RoadFleetResult, RoadPlanner, RoadVehicle

LOOK_S = 0.02  # [s] between looks at distances


def road_plans_content(result: RoadFleetResult) -> dict[str, Any]:
    """Plans of several vehicles on one road."""
    found, count = len(result.plans), len(result.results)
    facts = [("vehicles", str(count) if found == count else f"{found} of {count} with a plan")]
    reasons = {name: one.reason for name, one in result.results.items()}
    return _content(result, facts, reasons, ending="")


def road_loop_content(drive: RoadFleetDrive) -> dict[str, Any]:
    """What several vehicles drove on one road in closed loop."""
    steps = [step for one in drive.results.values() for step in one.steps]
    reached = sum(one.reached for one in drive.results.values())
    facts = [
        ("vehicles", f"{reached} of {len(drive.results)} reached a goal"),
        ("steps", f"{len(steps)}, {sum(step.replanned for step in steps)} replanned"),
    ]
    reasons = {name: one.reason for name, one in drive.results.items()}
    ending = "all have reached a goal" if drive.reached else drive.reason
    return _content(drive, facts, reasons, ending=ending)


def _content(
    what: RoadFleetResult | RoadFleetDrive,
    facts: list[Fact],
    reasons: Mapping[str, str],
    *,
    ending: str,
) -> dict[str, Any]:
    planners = {name: one.planner for name, one in what.results.items()}
    first = next(iter(planners.values()))
    vehicle, local = first.vehicle, Local(first.scene.start.middle[:2])
    plans = {name: what.plans.get(name) or _standing(planner) for name, planner in planners.items()}
    cast = cast_of(recording_of(what))
    colors = {one.mover.name: one.color for one in cast.actors}
    tracks = {name: track_of_plan(plan) for name, plan in plans.items()}
    every = {name: twist for track in tracks.values() for name, twist in track.twists.items()}
    trims = track_colors(every)
    begin = min(plan.start_time for plan in plans.values())
    end = max(plan.start_time + plan.duration for plan in plans.values())
    times = np.linspace(begin, end, max(int((end - begin) / LOOK_S), 1) + 1)
    nearest = _nearest_others(vehicle, what.plans, times)
    motions = []
    for name, plan in plans.items():
        scene, track = planners[name].scene, tracks[name]
        at = sample_times(track.switching_times)
        bodies = [(ring, track.at(at)) for ring in footprint_polygons(vehicle.footprint)]
        others = tuple(one for one in scene.traffic if one.name not in planners)
        motions.append(
            {
                **motion_entry(track, local, names_of(trims)),
                "curves": curve_entries(track, vehicle.model),
                "clearance": clearance_entry(at, bodies, others, leave=True),
                "parts": [],
                "name": f"problem {name}",
                "label": f"problem {name}",
                "color": hex_color(colors[name]),
                "bodies": body_entries(vehicle.footprint, {}),
                "goals": [],
                "leaves": name in what.plans,
                "joins": plan.start_time > begin,
                "reason": reasons[name],
                "others": distance_curve(times, nearest[name]) if name in nearest else None,
            }
        )
    if what.pairs:
        facts.append(("nearest", f"{what.distance_m:.3g} m"))
    traffic = tuple(one for one in first.scene.traffic if one.name not in planners)
    there = Scene(goals=(), obstacles=traffic, body=(), times=np.zeros(1))
    least = np.min([*nearest.values(), np.full(len(times), np.inf)], axis=0)
    return {
        "title": what.name,
        "facts": facts,
        "trims": trim_entries(trims),
        "motions": motions,
        "bodies": [],
        **around(
            there,
            local,
            cast.box,
            size=vehicle.length,
            leave=True,
        ),
        "lanes": [local.places(lanelet.ring) for lanelet in first.scene.lanelets],
        "regions": _regions(planners, local),
        "fleet": {
            "begin": begin,
            "end": end,
            "margin": 0.0,
            "distance": distance_curve(times, least),
        },
        "ending": ending,
    }


def _standing(planner: RoadPlanner) -> Plan:
    """Where a vehicle without a plan begins."""
    start = planner.scene.start
    return Plan(planner.vehicle.rear_of(start.middle), (), durations=[], start_time=start.time)


def _regions(planners: Mapping[str, RoadPlanner], local: Local) -> list[dict[str, Any]]:
    """The goals of all; one that several share once."""
    places = {
        str(place): Obstacle(place)
        for planner in planners.values()
        for goal in planner.scene.goals
        for place in goal.places or ()
    }
    return obstacle_entries(list(places.values()), local, leave=False)


def _nearest_others(
    vehicle: RoadVehicle, plans: Mapping[str, Plan], times: Array
) -> dict[str, Array]:
    """How far each is from the nearest of the others at times (n,) [m]; inf where there is none."""
    import shapely

    corners = vehicle.footprint.corners
    bodies = {
        name: shapely.polygons(SE2(plan.pose_at(times)[:, None, :3]).act(corners))
        for name, plan in plans.items()
    }
    there = {
        name: (times >= plan.start_time) & (times <= plan.start_time + plan.duration)
        for name, plan in plans.items()
    }
    nearest = {name: np.full(len(times), np.inf) for name in plans}
    for one, other in itertools.combinations(plans, 2):
        both = there[one] & there[other]
        apart = np.where(both, shapely.distance(bodies[one], bodies[other]), np.inf)
        for name in (one, other):
            nearest[name] = np.minimum(nearest[name], apart)
    return nearest
