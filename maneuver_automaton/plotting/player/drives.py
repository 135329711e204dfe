"""What a player shows of a plan or a drive on roads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.plotting.footprint import footprint_polygons
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.player.clearances import clearance_entry, sample_times
from maneuver_automaton.plotting.player.composing import (
    Fact,
    around,
    names_of,
    trim_entries,
)
from maneuver_automaton.plotting.player.local import Local
from maneuver_automaton.plotting.player.motions import curve_entries, motion_entry
from maneuver_automaton.plotting.player.surroundings import body_entries, obstacle_entries
from maneuver_automaton.plotting.scene import Scene
from maneuver_automaton.plotting.track import track_of_plan
from maneuver_automaton.roads import RoadPlanner


def drive_content(
    planner: RoadPlanner, plan: Plan | None, facts: Sequence[Fact], box: Array, *, ending: str
) -> dict[str, Any]:
    """A motion of the rear axle on lanelets, among traffic; without a plan, the start alone."""
    road, vehicle = planner.scene, planner.vehicle
    start = vehicle.rear_of(road.start.middle)
    plan = plan or Plan(start, (), durations=[], start_time=road.start.time)
    track, local = track_of_plan(plan), Local(start[:2])
    body = tuple(footprint_polygons(vehicle.footprint))
    scene = Scene(goals=(), obstacles=tuple(road.traffic), body=body, times=np.zeros(1))
    colors, times = track_colors(track.twists), sample_times(track.switching_times)
    bodies = [(ring, track.at(times)) for ring in body]
    places = [Obstacle(place) for goal in road.goals for place in goal.places or ()]
    return {
        "title": road.name,
        "facts": list(facts),
        "trims": trim_entries(colors),
        "motions": [
            {
                **motion_entry(track, local, names_of(colors)),
                "curves": curve_entries(track, vehicle.model),
                "clearance": clearance_entry(times, bodies, scene.obstacles, leave=True),
                "parts": [],
            }
        ],
        "bodies": body_entries(vehicle.footprint, {}),
        **around(scene, local, box, size=vehicle.length, leave=True),
        "lanes": [local.places(lanelet.ring) for lanelet in road.lanelets],
        "regions": obstacle_entries(places, local, leave=False),
        "ending": ending,
    }
