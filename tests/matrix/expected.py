"""What of the matrix does not work today and why, and what of it is tried every time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.matrix.cells import cells
from tests.matrix.vehicles import VEHICLES

# Why a feature does not work for a vehicle; a cell that begins to work fails until it is taken out.
EXPECTED: dict[tuple[str, str], str] = {}

QUICK_VEHICLE = "unicycle"  # of which all is tried
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
    "moved_problem",
    "loop",
    "resume",
)
SLOW = {
    *(  # four coasting times at a climb take long
        (feature, "glider")
        for feature in (
            "dear_switch_among_obstacles",
            "fixed_time",
            "free_heading",
            "goal_tolerance",
            "loop",
            "resume",
            "same_plan_twice",
        )
    ),
    *(
        ("dear_switch_among_obstacles", vehicle)
        for vehicle in (
            "boat",
            "car",
            "four_wheel_steering_car",
            "grid",
            "omni",
            "rear_steered_car",
        )
    ),
    ("switch_price", "grid"),
    *((row, QUICK_VEHICLE) for row in ("clearance", "ground_round")),
    *((row, QUICK_VEHICLE) for row in ("loop_clearance", "via_free_heading")),
}
ONE_BY_ONE = {  # so that every feature is tried with a few vehicles
    *(("car", feature) for feature in ("polygons", "max_time", "moving_obstacles")),
    ("car", "loop_noise"),
    ("boat", "occupancy_map"),
    ("boat", "loop_noise"),
    *(("stage", feature) for feature in ("discs", "moving_obstacles", "loop_obstacles")),
    ("stage", "moved_problem_among_obstacles"),
    ("user", "polishing"),
}
LONG_ONE_BY_ONE = {  # with -m slow
    *(("car", feature) for feature in ("discs", "zones", "margin", "bounds", "min_coast")),
    ("car", "free_heading_among_obstacles"),
    ("car_with_trailer", "planner_with_all"),
    ("articulated_vehicle", "dear_switch_among_obstacles"),
    ("glider", "heights"),
    ("car", "several_parts"),
    ("grid", "zones_crossed"),
    *(("boat_in_current", feature) for feature in ("loop", "plan_file")),
    ("boat", "max_time_among_obstacles"),
    ("boat", "moved_problem_among_obstacles"),
    ("boat", "pictures"),
    *(("user", feature) for feature in ("max_trims", "resume", "moving_ends")),
    ("user", "same_plan_twice_among_obstacles"),
    ("hovercraft", "max_trims"),
    ("second_order_unicycle", "loop_obstacles"),
    ("second_order_car", "resume"),
    *((QUICK_VEHICLE, row) for row in ("ground_round", "loop_clearance", "via_free_heading")),
    ("user", "off_library_start"),
}


def _quick() -> Iterator[tuple[str, str]]:
    for feature, vehicle in cells():
        if (feature, vehicle) in SLOW:
            continue
        common = feature in QUICK_FEATURES and not VEHICLES[vehicle].inertia
        chosen = vehicle == QUICK_VEHICLE or common
        if chosen or (vehicle, feature) in ONE_BY_ONE:
            yield feature, vehicle


def _long() -> Iterator[tuple[str, str]]:
    for feature, vehicle in cells():
        chosen = vehicle == "dubins" or (vehicle, feature) in LONG_ONE_BY_ONE
        if chosen and (feature, vehicle) not in QUICK:
            yield feature, vehicle


QUICK = frozenset(_quick())
LONG = frozenset(_long())  # with -m slow; all that is in neither takes longest, -m exhaustive
_MUTANTS = (
    "alternatives_among_obstacles",
    "clearance",
    "heights",
    "max_time_among_obstacles",
    "loop_clearance",
    "moved_problem_among_obstacles",
    "moving_ends",
    "no_steering_at_rest",
    "off_library_start",
    "planner_with_all",
    "polishing",
    "polishing_past_movers",
    "same_plan_twice_among_obstacles",
)
SLOW_MUTANTS = {name: [pytest.mark.slow] for name in _MUTANTS}
SLOW_MUTANTS["carried_parts"] = [pytest.mark.slow, pytest.mark.exhaustive]
