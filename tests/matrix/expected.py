"""What of the matrix does not work today and why, and what of it is tried every time."""

from __future__ import annotations

from collections.abc import Iterator

from tests.matrix.cells import cells
from tests.matrix.vehicles import VEHICLES

# Reason, then features and the vehicles for which they do not work; a cell that begins to work
# fails until it is taken out.
FAULTS: dict[str, dict[str, str]] = {
    "Planner takes no parts, zones, start trim and height of the body": {
        "planner_with_all": "all",
        "planner": "single_track",
    },
    "a closed loop of fixed time asks for a trim that stands still": {
        "loop_fixed_time": "car dubins glider single_track",
    },
    "a closed loop of fixed time finds no plan": {
        "loop_fixed_time": "hovercraft helicopter",
    },
    "a closed loop with zones asks for a trim that stands still": {
        "loop_zones": "car dubins glider",
    },
    "a closed loop with zones finds no plan": {
        "loop_zones": "single_track",
    },
    "a closed loop with zones takes too long with 1,681 trims": {
        "loop_zones": "grid",
    },
    "a free heading is not handed to the search over maneuvers among obstacles": {
        "free_heading_among_obstacles": "helicopter",
    },
    "a log names maneuvers of stop-and-steer or polishing, which no library holds": {
        "resume_among_obstacles": "second_order_unicycle second_order_car helicopter user",
    },
    "a plan found otherwise is cheaper": {
        "fixed_time": "second_order_unicycle car_with_trailer user",
        "free_heading_among_obstacles": "second_order_car",
        "stage_cost": "second_order_car car_with_trailer single_track user",
        "effort": "car_with_trailer",
        "dear_switch_among_obstacles": "car_with_trailer",
        "norm": "user",
    },
    "a rest of one trim has no maneuvers to solve for": {
        "loop_noise": "car_with_trailer",
    },
    "a step off the plan takes far longer than its time limit": {
        "loop_noise": "glider",
    },
    "a closed loop of fixed time plans for what is left of it where no trim stands still": {
        "loop_fixed_time": "boat_in_current",
    },
    "a vehicle whose heading is a reduced state is not polished": {
        "polishing": "boat_in_current",
    },
    "alternatives repeat the best motion": {
        "alternatives": "car",
        "alternatives_among_obstacles": "car boat omni",
    },
    "closed loops with inertia know static obstacles only": {
        "loop_moving_obstacles": "second_order_unicycle second_order_car car_with_trailer "
        "hovercraft single_track helicopter user",
    },
    "conditions of the horizon only sort out finished plans of vehicles with inertia": {
        "max_time": "second_order_unicycle helicopter",
        "max_time_among_obstacles": "second_order_unicycle second_order_car car_with_trailer "
        "hovercraft helicopter user",
        "max_trims": "car_with_trailer hovercraft single_track helicopter user",
        "fixed_time": "single_track helicopter",
    },
    "insertion does not read the greatest time": {
        "max_time": "grid",
    },
    "kinematic vehicles in space know no obstacles": {
        "discs": "glider",
        "polygons": "glider",
        "occupancy_map": "glider",
        "moving_obstacles": "glider",
        "margin": "glider",
        "zones": "glider",
        "bounds": "glider",
        "several_parts": "glider",
        "free_heading_among_obstacles": "glider",
        "max_time_among_obstacles": "glider",
        "dear_switch_among_obstacles": "glider",
        "alternatives_among_obstacles": "glider",
        "same_plan_twice_among_obstacles": "glider",
        "planner": "glider",
        "moved_problem_among_obstacles": "glider",
        "loop_obstacles": "glider",
        "loop_moving_obstacles": "glider",
        "resume_among_obstacles": "glider",
        "heights": "glider",
    },
    "no alternative is found": {
        "alternatives": "grid",
    },
    "no certificate with maneuvers": {
        "certificate": "inertia",
    },
    "no lower bound above zero with maneuvers": {
        "lower_bound": "boat_in_current car_with_trailer hovercraft single_track helicopter user",
    },
    "no plan past a disc is found": {
        "discs": "single_track",
        "polygons": "single_track",
        "occupancy_map": "single_track",
        "bounds": "single_track",
        "free_heading_among_obstacles": "single_track",
        "max_time_among_obstacles": "single_track",
        "dear_switch_among_obstacles": "single_track",
        "alternatives_among_obstacles": "single_track",
        "same_plan_twice_among_obstacles": "single_track",
        "moved_problem_among_obstacles": "single_track",
        "loop_obstacles": "single_track",
        "resume_among_obstacles": "single_track",
        "polishing": "single_track",
    },
    "no plan with a least coasting time over 1,681 trims": {
        "min_coast": "grid",
    },
    "plans among obstacles with heights are not polished": {
        "heights": "helicopter",
    },
    "plans end exactly at the goal, whatever its tolerance is": {
        "goal_tolerance": "all",
    },
    "polishing goes by the clock": {
        "same_plan_twice_among_obstacles": "second_order_unicycle second_order_car",
        "same_plan_twice": "helicopter",
        "moved_problem_among_obstacles": "helicopter",
    },
    "the lattice refuses every connection where a switch is dear": {
        "dear_switch_among_obstacles": "unicycle car dubins grid boat omni",
    },
    "zones are entered for the whole way or not at all": {
        "zones_crossed": "car_with_trailer hovercraft single_track helicopter user",
        "zones": "single_track",
    },
    "zones do not see what a vehicle carries": {
        "loop_zones": "car_with_trailer",
    },
}
GROUPS = {
    "all": list(VEHICLES),
    "inertia": [name for name, vehicle in VEHICLES.items() if vehicle.inertia],
}
EXPECTED: dict[tuple[str, str], str] = {
    (feature, vehicle): reason
    for reason, rows in FAULTS.items()
    for feature, vehicles in rows.items()
    for vehicle in GROUPS.get(vehicles, vehicles.split())
}

QUICK_VEHICLES = ("unicycle", "dubins")  # of which all is tried
QUICK_FEATURES = (  # that all kinematic vehicles are tried with
    "free_space",
    "free_heading",
    "several_goals",
    "max_trims",
    "plan_file",
    "goal_tolerance",
    "fixed_time",
    "effort",
    "length",
    "norm",
    "switch_price",
    "dear_switch",
    "dear_switch_among_obstacles",
    "direction_price",
    "stage_cost",
    "alternatives",
    "same_plan_twice",
    "lower_bound",
    "certificate",
    "planner_with_all",
    "moved_problem",
    "loop",
    "resume",
)
SLOW = {  # four coasting times at a climb take long
    (feature, "glider")
    for feature in ("fixed_time", "free_heading", "same_plan_twice", "loop", "resume")
}
WITH_INERTIA = ("plan_file", "fixed_time", "loop_moving_obstacles", "planner_with_all")
ONE_BY_ONE = {  # so that every feature is tried with a few vehicles
    *(("car", feature) for feature in ("discs", "polygons", "zones", "margin", "bounds")),
    *(("car", feature) for feature in ("max_time", "min_coast", "loop_noise", "moving_obstacles")),
    *(("car", feature) for feature in ("several_parts", "free_heading_among_obstacles")),
    ("boat", "occupancy_map"),
    ("boat", "loop_noise"),
    ("boat", "max_time_among_obstacles"),
    ("boat", "moved_problem_among_obstacles"),
    ("grid", "zones_crossed"),
    *(("stage", feature) for feature in ("discs", "moving_obstacles", "loop_obstacles")),
    ("stage", "moved_problem_among_obstacles"),
    ("boat_in_current", "loop"),
    ("glider", "heights"),
    ("boat", "pictures"),
    ("car_with_trailer", "carried_parts"),
    ("user", "moving_ends"),
    ("user", "discs"),
    ("user", "loop"),
    ("user", "max_trims"),
    ("hovercraft", "max_trims"),
    ("user", "resume"),
    ("user", "polishing"),
    ("user", "alternatives"),
    ("user", "same_plan_twice_among_obstacles"),
    ("second_order_unicycle", "loop_obstacles"),
    ("second_order_car", "resume"),
}


def _quick() -> Iterator[tuple[str, str]]:
    for feature, vehicle in cells():
        if (feature, vehicle) in SLOW:
            continue
        common = WITH_INERTIA if VEHICLES[vehicle].inertia else QUICK_FEATURES
        chosen = vehicle in QUICK_VEHICLES or feature in common
        if chosen or (vehicle, feature) in ONE_BY_ONE:
            yield feature, vehicle


QUICK = frozenset(_quick())
SLOW_MUTANTS = frozenset({"polishing", "heights", "carried_parts"})
