"""Files that cannot be used: one line names file, line, field, value, and what would be right."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.costs import WEIGHTS
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.scenario import load_scenario, scenario_of_text
from tests.scenario.files import SCENARIO, TRIMS, automaton, but, grid

UNIT = "{min: -1, max: 1, step: 1}"
TOP = (
    "schema, name, vehicle, automaton, start, goal, cost, horizon, bounds_m, margin_m, obstacles, "
    "zones, via, order, search, receding_horizon"
)
MODELS = (
    "unicycle, car, second_order_unicycle, second_order_car, accelerating_car, "
    "car_with_trailer, single_track, "
    "hovercraft, helicopter, lattice_body, omnidirectional, rear_steered_car, "
    "four_wheel_steering_car, articulated_vehicle, tractor_with_trailers"
)
OWN = "; a vehicle of your own needs --model MODULE:OBJECT"
SECOND_ORDER = (
    "{model: second_order_car, wheelbase_m: 2.8, max_steering_rad: 0.75, max_speed_m_s: 2.5, "
    "max_acceleration_m_s2: 1.0, max_steering_rate_rad_s: 0.5}"
)
AXES = "speed_m_s, lateral_speed_m_s, turn_rate_rad_s, climb_m_s, steering_rad"
LAUGHS = "".join(
    f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9) if i else 'lol'}]\n" for i in range(9)
)


def goal(text: str) -> str:
    """The scenario with another goal."""
    return but("goal: {pose: [1.0, 1.0, 0.0]}", f"goal:{text}")


def pose(text: str) -> str:
    """The scenario with another pose of the goal."""
    return goal(f" {{pose: {text}}}")


def horizon(text: str) -> str:
    """The scenario with another horizon."""
    return but("time_s: free, max_trims: 4", text)


def search(text: str) -> str:
    """The scenario with other settings of the search."""
    return but("time_limit_s: 5.0", text)


def two_axes(text: str) -> str:
    """The scenario over a grid with one odd axis."""
    return grid(f"[{text}, {UNIT}]")


def car(scenario: str) -> str:
    """A scenario with a car in place of the unicycle."""
    return scenario.replace("{model: unicycle}", "{model: car, wheelbase_m: 2.5}")


def inertia(scenario: str) -> str:
    """A scenario with a second-order car in place of the unicycle."""
    return scenario.replace("{model: unicycle}", SECOND_ORDER)


def vehicle(text: str) -> str:
    """The scenario with another vehicle."""
    return but("{model: unicycle}", text)


def cost(text: str) -> str:
    """The scenario with another cost."""
    return but("effort: 1.0", text)


def footprint(text: str) -> str:
    """The scenario with a footprint."""
    return vehicle(f"{{model: unicycle, footprint: {text}}}")


def obstacle(text: str) -> str:
    """The scenario with one obstacle."""
    return f"{SCENARIO}obstacles:\n  - {text}\n"


# What the file says, and the message, without the name of the file.
MALFORMED: dict[str, tuple[str | bytes, str]] = {
    "unknown key at the top": (
        but("name: A case", "nam: A case"),
        f":2: nam: unknown key; did you mean 'name'? Known keys: {TOP}",
    ),
    "unknown key inside": (
        horizon("time_s: free, max_trim: 4"),
        ":12: horizon.max_trim: unknown key; did you mean 'max_trims'? Known keys: "
        "time_s, max_trims, min_coast_s, max_time_s, stay",
    ),
    "unknown key of a trim": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin, contrl: [0.0, 1.0]}"),
        ":8: automaton.trims[2].contrl: unknown key; did you mean 'control'? Known "
        "keys: name, control, state",
    ),
    "missing schema": (
        but("schema: 1\nname: A case", "name: A case"),
        ":1: the key 'schema' is missing: no scenario, need schema: 1",
    ),
    "wrong schema": (
        but("schema: 1", "schema: 2"),
        ":1: schema: got 2, need 1, the schema that this version reads",
    ),
    "schema true": (
        but("schema: 1", "schema: true"),
        ":1: schema: got true, need 1, the schema that this version reads",
    ),
    "missing goal": (
        but("goal: {pose: [1.0, 1.0, 0.0]}\ncost: {effort: 1.0}", "cost: {effort: 1.0}"),
        ":1: the key 'goal' is missing, need goal: a mapping {pose, ...}, or a list of these",
    ),
    "missing pose": (
        goal(" {tolerance_m: 0.1}"),
        ":10: goal: the key 'pose' is missing, need pose: [x, y, heading]",
    ),
    "wrong type": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin, control: abc}"),
        ":8: automaton.trims[2].control: got 'abc', need a list of 2 numbers (speed, turn_rate)",
    ),
    "list with a word": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin, control: [0.0, abc]}"),
        ":8: automaton.trims[2].control[1]: got 'abc', need a finite number",
    ),
    "control too long": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin, control: [0.0, 1.0, 2.0]}"),
        ":8: automaton.trims[2].control: got [0.0, 1.0, 2.0], need a list of 2 "
        "numbers (speed, turn_rate)",
    ),
    "string as number": (
        cost("effort: '1.0'"),
        ":11: cost.effort: got '1.0', need a finite number of at least 0",
    ),
    "bool as number": (
        cost("effort: true"),
        ":11: cost.effort: got true, need a finite number of at least 0",
    ),
    "word as truth": (
        goal(" {pose: [1.0, 1.0, 0.0]}\nvia: [{pose: [0.5, 0.5, 0.0], stop: 'yes'}]"),
        ":11: via[0].stop: got 'yes', need true or false",
    ),
    "number as truth": (
        search("improve: 1"),
        ":13: search.improve: got 1, need true or false",
    ),
    "yes is a word": (
        cost("effort: yes"),
        ":11: cost.effort: got 'yes', need a finite number of at least 0",
    ),
    "bool as pose": (pose("[1.0, true, 0.0]"), ":10: goal.pose[1]: got true, need a finite number"),
    "nan": (pose("[.nan, 1.0, 0.0]"), ":10: goal.pose[0]: got nan, need a finite number"),
    "infinite": (pose("[1.0, -.inf, 0.0]"), ":10: goal.pose[1]: got -inf, need a finite number"),
    "overflow": (pose("[1.0, 1e999, 0.0]"), ":10: goal.pose[1]: got inf, need a finite number"),
    "pose too short": (
        pose("[1.0, 1.0]"),
        ":10: goal.pose: got [1.0, 1.0], need a pose [x, y, heading], a list of 3 numbers",
    ),
    "pose with height": (
        pose("[1.0, 1.0, 0.0, 2.0]"),
        ":10: goal.pose: got 4 numbers, need 3: [x, y, heading]",
    ),
    "pose is a number": (
        pose("1.0"),
        ":10: goal.pose: got 1.0, need a pose [x, y, heading], a list of 3 numbers",
    ),
    "goal nothing": (
        goal(""),
        ":10: goal: got nothing, need a mapping {pose, ...}, or a list of these",
    ),
    "goal empty list": (
        goal(" []"),
        ":10: goal: got [], need a goal or a list of at least one goal",
    ),
    "goal is a word": (
        goal(" home"),
        ":10: goal: got 'home', need a mapping with the keys pose, trim, state, heading, "
        "tolerance_m, tolerance_rad",
    ),
    "second goal bad": (
        goal("\n  - {pose: [1.0, 1.0, 0.0]}\n  - {pose: [1.0, x, 0.0]}"),
        ":12: goal[1].pose[1]: got 'x', need a finite number",
    ),
    "heading": (
        goal(" {pose: [1.0, 1.0, 0.0], heading: any}"),
        ":10: goal.heading: got 'any', need free, or no such key",
    ),
    "tolerance negative": (
        goal(" {pose: [1.0, 1.0, 0.0], tolerance_m: -0.1}"),
        ":10: goal.tolerance_m: got -0.1, need a finite number of at least 0",
    ),
    "unknown goal trim": (
        goal(" {pose: [1.0, 1.0, 0.0], trim: spinn}"),
        ":10: goal.trim: no trim 'spinn' among rest, ahead, spin; did you mean 'spin'?",
    ),
    "unknown start trim": (
        but("start: {pose: [0.0, 0.0, 0.0]}", "start: {pose: [0.0, 0.0, 0.0], trim: cruise}"),
        ":9: start.trim: no trim 'cruise' among rest, ahead, spin",
    ),
    "duplicate names": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: ahead, control: [0.0, 1.0]}"),
        ":8: automaton.trims[2].name: got 'ahead', the name of another trim in line "
        "7; need a new name",
    ),
    "empty name": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: '', control: [0.0, 1.0]}"),
        ":8: automaton.trims[2].name: got '', need a name, a text that is not empty",
    ),
    "number as name": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: 5, control: [0.0, 1.0]}"),
        ":8: automaton.trims[2].name: got 5, need a name, a text that is not empty",
    ),
    "two kinds of automaton": (
        but("  trims:", "  preset: dubins\n  trims:"),
        ":4: automaton: got trims and preset, need exactly one of trims, grid, file, preset",
    ),
    "no kind of automaton": (
        but("automaton:\n" + TRIMS, "automaton: {}\n"),
        ":4: automaton: got none, need exactly one of trims, grid, file, preset",
    ),
    "unknown preset": (
        automaton("preset: dubbins"),
        ":5: automaton.preset: got 'dubbins', need one of table2, reeds_shepp, dubins, parking, "
        "road, lattice_ackermann, lattice_diff, crab, articulated_vehicle, car_with_trailer, "
        "helicopter, hovercraft, second_order_car, second_order_unicycle, single_track, "
        "tractor_with_three_trailers, tractor_with_trailers",
    ),
    "stock library of another vehicle": (
        inertia(automaton("preset: second_order_car")).replace("2.8", "3.0"),
        ":5: automaton.preset: got a library for {wheelbase_m: 2.8}, but the vehicle has "
        "{wheelbase_m: 3.0}",
    ),
    "preset of another vehicle": (
        car(automaton("preset: table2")),
        ":5: automaton.preset: got 'table2', which is for the unicycle, not the car",
    ),
    "preset without limit": (
        car(automaton("preset: dubins")),
        ":5: automaton.preset: needs the tightest circle of the car, state "
        "vehicle.max_steering_rad",
    ),
    "missing library": (
        automaton("file: nowhere.json"),
        ":5: automaton.file: nowhere.json: no such file",
    ),
    "unknown model": (
        vehicle("{model: tank}"),
        ":3: vehicle.model: got 'tank', need one of " + MODELS + OWN,
    ),
    "no model": (
        vehicle("{}"),
        ":3: vehicle: the key 'model' is missing, need model: one of " + MODELS,
    ),
    "model nothing": (
        vehicle("{model: }"),
        ":3: vehicle.model: got nothing, need one of " + MODELS,
    ),
    "model list": (
        vehicle("{model: [unicycle]}"),
        ":3: vehicle.model: got ['unicycle'], need one of " + MODELS,
    ),
    "car without wheelbase": (
        vehicle("{model: car}"),
        ":3: vehicle: the key 'wheelbase_m' is missing, need wheelbase_m: distance "
        "of the axles, a positive number",
    ),
    "car steering too sharp": (
        vehicle("{model: car, wheelbase_m: 2.5, max_steering_rad: 1.6}"),
        ":3: vehicle.max_steering_rad: got 1.6, need an angle between 0 and pi / 2, 1.5708",
    ),
    "key of another model": (
        vehicle("{model: unicycle, wheelbase_m: 2.5}"),
        ":3: vehicle.wheelbase_m: unknown key; did you mean 'max_speed_m_s'? Known "
        "keys: model, max_speed_m_s, max_turn_rate_rad_s, footprint, footprint_height_m",
    ),
    "negative wheelbase": (
        vehicle("{model: car, wheelbase_m: -2.5}"),
        ":3: vehicle.wheelbase_m: got -2.5, need a positive number",
    ),
    "beyond the limits": (
        vehicle("{model: unicycle, max_speed_m_s: 0.5}"),
        ":7: automaton.trims[1].control: trim 'ahead': speed = 1 is outside the "
        "limits [-0.5, 0.5] of the unicycle",
    ),
    "footprint empty": (
        footprint("[]"),
        ":3: vehicle.footprint: got [], need a shape or a list of at least one shape",
    ),
    "footprint two kinds": (
        footprint("{disc_m: 1, rectangle_m: [1, 1]}"),
        ":3: vehicle.footprint: got rectangle_m and disc_m, need exactly one of "
        "rectangle_m, polygon_m, disc_m",
    ),
    "footprint flat": (
        footprint("{rectangle_m: [1, 0]}"),
        ":3: vehicle.footprint.rectangle_m[1]: got 0, need a positive number",
    ),
    "footprint reference": (
        footprint("[{disc_m: 1, reference_m: [0, 0]}]"),
        ":3: vehicle.footprint[0].reference_m: goes with rectangle_m only",
    ),
    "polygon of two": (
        footprint("{polygon_m: [[0, 0], [1, 1]]}"),
        ":3: vehicle.footprint.polygon_m: got [[0, 0], [1, 1]], need a list of at "
        "least 3 points [x, y]",
    ),
    "negative weight": (
        cost("effort: -1.0"),
        ":11: cost.effort: got -1.0, need a finite number of at least 0",
    ),
    "all weights zero": (
        cost("effort: 0.0"),
        f":11: cost: {', '.join(WEIGHTS)} are all zero, need at least one positive",
    ),
    "cost empty": (
        cost(""),
        f":11: cost: {', '.join(WEIGHTS)} are all zero, need at least one positive",
    ),
    "cost nothing": (
        but("cost: {effort: 1.0}", "cost:"),
        ":11: cost: got nothing, need a value, or no such key",
    ),
    "matrix not square": (
        cost("effort: 1.0, effort_matrix: [[1, 0], [0]]"),
        ":11: cost.effort_matrix: got 2 rows of 2, 1 numbers, need a square matrix",
    ),
    "matrix of another size": (
        cost("effort: 1.0, effort_matrix: [[1]]"),
        ":11: cost.effort_matrix: has shape (1, 1), need (2, 2) for 2 controls",
    ),
    "matrix indefinite": (
        cost("effort: 1.0, effort_matrix: [[1, 0], [0, -1]]"),
        ":11: cost.effort_matrix: must be positive definite, its smallest eigenvalue is -1",
    ),
    "matrix not symmetric": (
        cost("effort: 1.0, effort_matrix: [[1, 1], [0, 1]]"),
        ":11: cost.effort_matrix: is not symmetric",
    ),
    "norm order": (
        cost("effort: 1.0, norm_order: 3"),
        ":11: cost.norm_order: got 3, need 1, 2 or inf",
    ),
    "time zero": (
        horizon("time_s: 0, max_trims: 4"),
        ":12: horizon.time_s: got 0, need a positive number of seconds, or free",
    ),
    "time word": (
        horizon("time_s: fre, max_trims: 4"),
        ":12: horizon.time_s: got 'fre', need a positive number of seconds, or free",
    ),
    "time negative": (
        horizon("time_s: -8.0, max_trims: 4"),
        ":12: horizon.time_s: got -8.0, need a positive number of seconds, or free",
    ),
    "max_time with time": (
        horizon("time_s: 8.0, max_time_s: 9.0, max_trims: 4"),
        ":12: horizon.max_time_s: max_time is for a free final time, but time is fixed",
    ),
    "max_trims zero": (
        horizon("time_s: free, max_trims: 0"),
        ":12: horizon.max_trims: got 0, need a whole number of at least 1",
    ),
    "max_trims fraction": (
        horizon("time_s: free, max_trims: 2.5"),
        ":12: horizon.max_trims: got 2.5, need a whole number of at least 1",
    ),
    "min_coast negative": (
        horizon("time_s: free, min_coast_s: -1"),
        ":12: horizon.min_coast_s: got -1, need a finite number of at least 0",
    ),
    "time limit zero": (
        search("time_limit_s: 0"),
        ":13: search.time_limit_s: got 0, need a positive number",
    ),
    "method": (
        search("method: astar"),
        ":13: search.method: got 'astar', need auto, words, insertion or lattice",
    ),
    "lattice cell": (
        search("method: lattice, cell_m: 0"),
        ":13: search.cell_m: got 0, need a positive number",
    ),
    "lattice weight": (
        search("method: lattice, weight: 0.5"),
        ":13: search.weight: got 0.5, need a finite number of at least 1",
    ),
    "long words": (
        search("method: words").replace("max_trims: 4", "max_trims: 6"),
        ":12: horizon.max_trims: got 6 for the method words, need at most 4; "
        "the method insertion has no limit",
    ),
    "long words, heading free": (
        search("method: words").replace("0.0]}\ncost", "0.0], heading: free}\ncost"),
        ":12: horizon.max_trims: got 4 for the method words, need at most 3 where a heading is "
        "free; the method insertion has no limit",
    ),
    "bounds reversed": (
        SCENARIO + "bounds_m: {x: [5, -5]}\n",
        ":14: bounds_m.x: got [5, -5], need an interval [low, high] with low < high",
    ),
    "bounds z": (
        SCENARIO + "bounds_m: {z: [0, 5]}\n",
        ":14: bounds_m.z: the unicycle has no height",
    ),
    "bounds key": (
        SCENARIO + "bounds_m: {w: [0, 5]}\n",
        ":14: bounds_m.w: unknown key; did you mean 'z'? Known keys: x, y, z",
    ),
    "margin": (
        SCENARIO + "margin_m: -1\n",
        ":14: margin_m: got -1, need a finite number of at least 0",
    ),
    "obstacle without area": (
        obstacle("{polygon_m: [[0, 0], [0.1, 0.1], [0.3, 0.3]]}"),
        ":15: obstacles[0].polygon_m: the ring encloses no area, need corners that are not on "
        "one line",
    ),
    "obstacle with two corners": (
        obstacle("{polygon_m: [[0, 0], [1, 1], [0, 0], [0, 0]]}"),
        ":15: obstacles[0].polygon_m: the ring has 2 different corners, need at least 3",
    ),
    "obstacle crosses itself": (
        obstacle("{polygon_m: [[0, 0], [2, 2], [2, 0], [0, 3]]}"),
        ":15: obstacles[0].polygon_m: the ring crosses or touches itself at (1.2, 1.2), "
        "need a simple polygon",
    ),
    "obstacle touches itself": (
        obstacle("{polygon_m: [[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]}"),
        ":15: obstacles[0].polygon_m: the ring crosses or touches itself at (2, 0), "
        "need a simple polygon",
    ),
    "hole outside": (
        obstacle("{polygon_m: [[0, 0], [1, 0], [0, 1]], holes_m: [[[5, 5], [6, 5], [5, 6]]]}"),
        ":15: obstacles[0].polygon_m: a hole lies outside the polygon at (5, 5), "
        "need holes inside it",
    ),
    "hole in a hole": (
        obstacle(
            "{polygon_m: [[0, 0], [9, 0], [0, 9]],\n     holes_m: [[[1, 1], [4, 1], [1, 4]], "
            "[[1.5, 1.5], [2, 1.5], [1.5, 2]]]}"
        ),
        ":15: obstacles[0].polygon_m: a hole lies inside another one at (1.5, 1.5), "
        "need holes apart from each other",
    ),
    "hole without polygon": (
        obstacle("{disc_m: {center: [3, 0], radius: 1}, holes_m: [[[5, 5], [6, 5], [5, 6]]]}"),
        ":15: obstacles[0].holes_m: goes with polygon_m only",
    ),
    "second obstacle": (
        obstacle("{disc_m: {center: [3, 0], radius: 1}}\n  - {polygon_m: [[0, 0], [1, 1]]}"),
        ":16: obstacles[1].polygon_m: got [[0, 0], [1, 1]], need a list of at least 3 points "
        "[x, y]",
    ),
    "obstacle nan": (
        obstacle("{box_m: {center: [0, .nan], size: [1, 1]}}"),
        ":15: obstacles[0].box_m.center[1]: got nan, need a finite number",
    ),
    "box flat": (
        obstacle("{box_m: {center: [0, 0], size: [1, 0]}}"),
        ":15: obstacles[0].box_m.size[1]: got 0, need a positive number",
    ),
    "height reversed": (
        obstacle("{disc_m: {center: [3, 0], radius: 1}, height_m: [3, 0]}"),
        ":15: obstacles[0].height_m: got [3, 0], need an interval [low, high] with low < high",
    ),
    "map missing": (
        obstacle("{map: nowhere.yaml}"),
        ":15: obstacles[0].map: nowhere.yaml: no such file",
    ),
    "map is this file": (
        obstacle("{map: x.yaml}"),
        ":15: obstacles[0].map: x.yaml: is no map, need YAML with the keys image, "
        "resolution, origin, negate, occupied_thresh, free_thresh",
    ),
    "map unknown": (
        obstacle("{map: a.yaml, unknown: maybe}"),
        ":15: obstacles[0].unknown: got 'maybe', need blocked or free",
    ),
    "map that moves": (
        obstacle("{map: a.yaml, motion: [[0, 0, 0, 0]]}"),
        ":15: obstacles[0].motion: goes with polygon_m or disc_m or box_m only",
    ),
    "unknown without a map": (
        obstacle("{disc_m: {center: [3, 0], radius: 1}, unknown: free}"),
        ":15: obstacles[0].unknown: goes with map only",
    ),
    "footprint crosses itself": (
        footprint("[{disc_m: 1}, {polygon_m: [[0, 0], [2, 2], [2, 0], [0, 2]]}]"),
        ":3: vehicle.footprint[1].polygon_m: the ring crosses or touches itself at (1, 1), "
        "need a simple polygon",
    ),
    "obstacle bad": (
        obstacle("{disc_m: {center: [3, 0], radius: 0}}"),
        ":15: obstacles[0].disc_m.radius: got 0, need a positive number",
    ),
    "obstacle two kinds": (
        obstacle("{disc_m: {center: [3, 0], radius: 1}, map: a.yaml}"),
        ":15: obstacles[0]: got disc_m and map, need exactly one of polygon_m, disc_m, box_m, map",
    ),
    "obstacle twists beside the way": (
        obstacle(
            "{disc_m: {center: [0, 0], radius: 1}, motion: [[0, 0, 0, 0], [1, 2, 0, 0]], "
            "twists: [[1, 0, 0]]}"
        ),
        ":15: obstacles[0].twists: twist 1 leads 1 m and 0 rad beside pose 2",
    ),
    "obstacle twists without a motion": (
        obstacle("{disc_m: {center: [0, 0], radius: 1}, twists: [[1, 0, 0]]}"),
        ":15: obstacles[0].twists: goes with motion only",
    ),
    "obstacle present backwards": (
        obstacle("{disc_m: {center: [0, 0], radius: 1}, present_s: [2, 1]}"),
        ":15: obstacles[0].present_s: got [2, 1], need an interval [low, high] with low < high",
    ),
    "obstacle motion backwards": (
        obstacle("{polygon_m: [[1, 1], [2, 1], [2, 2]], motion: [[0, 0, 0, 0], [0, 1, 0, 0]]}"),
        ":15: obstacles[0].motion: got [[0, 0, 0, 0], [0, 1, 0, 0]], need poses "
        "[time, x, y, heading] whose times rise",
    ),
    "obstacles no list": (
        SCENARIO + "obstacles: none\n",
        ":14: obstacles: got 'none', need a list of obstacles",
    ),
    "receding horizon": (
        SCENARIO + "receding_horizon: {steps: 12}\n",
        ":14: receding_horizon: the key 'step_s' is missing, need step_s: time between two plans",
    ),
    "duplicate key": (
        SCENARIO + "name: again\n",
        ":14: name: the key stands twice, first in line 2",
    ),
    "tab": (but("  trims:", "\ttrims:"), ":5: not valid YAML: a tab stands where only spaces may"),
    "tag": (
        but("name: A case", "name: !!python/object/apply:os.system [ls]"),
        ":2: the tag 'tag:yaml.org,2002:python/object/apply:os.system' is not "
        "admitted, need plain values",
    ),
    "own tag": (
        pose("!mine [1.0, 1.0, 0.0]"),
        ":10: the tag '!mine' is not admitted, need plain values",
    ),
    "standard tag": (
        cost("effort: !!float '1.0'"),
        ":11: the tag 'tag:yaml.org,2002:float' is not admitted, need plain values",
    ),
    "two documents": (
        SCENARIO + "---\nschema: 1\n",
        ":14: a second document begins here, need one",
    ),
    "list at the top": ("- 1\n- 2\n", f":1: got [1, 2], need a mapping with the keys {TOP}"),
    "word at the top": ("hello\n", f":1: got 'hello', need a mapping with the keys {TOP}"),
    "complex key": (
        SCENARIO + "? [a, b]\n: 1\n",
        ":14: a list or mapping is used as a key, need a word",
    ),
    "recursive alias": (
        but("name: A case", "name: &a [*a]"),
        ":2: the alias *a stands for nothing that ends before it",
    ),
    "unknown alias": (
        but("name: A case", "name: *a"),
        ":2: the alias *a stands for nothing that ends before it",
    ),
    "merge key": (
        cost("<<: {effort: 1.0}"),
        ":11: cost.<<: unknown key; did you mean 'time'? Known keys: effort, norm, "
        "time, effort_matrix, norm_order, length, switch, direction_change, "
        "clearance, ground",
    ),
    "empty": ("", ": is empty, need a scenario"),
    "comments only": ("# nothing\n", ": is empty, need a scenario"),
    "null": ("null\n", ": is empty, need a scenario"),
    "grid nan": (
        two_axes("{min: .nan, max: 1, step: 1}"),
        ":5: automaton.grid.control[0].min: got nan, need a finite number",
    ),
    "grid step zero": (
        two_axes("{min: 0, max: 1, step: 0}"),
        ":5: automaton.grid.control[0].step: got 0, need a positive number",
    ),
    "grid step negative": (
        two_axes("{min: 0, max: 1, step: -0.1}"),
        ":5: automaton.grid.control[0].step: got -0.1, need a positive number",
    ),
    "grid min above max": (
        two_axes("{min: 1, max: 0, step: 0.1}"),
        ":5: automaton.grid.control[0]: got min 1 above max 0, need min <= max",
    ),
    "grid huge": (
        grid("[{min: -1, max: 1, count: 100000}, {min: -1, max: 1, step: 0.0002}]"),
        ":5: automaton.grid.control: got 1.0001e+09 trims, need at most 100000",
    ),
    "grid beyond huge": (
        two_axes("{min: -1e9, max: 1e9, step: 1e-300}"),
        ":5: automaton.grid.control: got 3e+12 trims, need at most 100000",
    ),
    "grid step and count": (
        two_axes("{min: 0, max: 1, step: 1, count: 2}"),
        ":5: automaton.grid.control[0]: got step and count, need exactly one of step, count",
    ),
    "grid one axis": (
        grid(f"[{UNIT}]"),
        ":5: automaton.grid.control: got 1 axes, need 2 (speed, turn_rate)",
    ),
    "grid count one": (
        two_axes("{min: 0, max: 1, count: 1}"),
        ":5: automaton.grid.control[0].count: got 1 for two different ends, need at least 2",
    ),
    "grid no list": (
        grid("{min: -1, max: 1, step: 1}"),
        ":5: automaton.grid.control: got {min: -1, max: 1, step: 1}, need a list "
        "with one axis per control",
    ),
    "grid missing max": (
        two_axes("{min: 0, step: 1}"),
        ":5: automaton.grid.control[0]: the key 'max' is missing, need max: largest value",
    ),
    "state of a kinematic vehicle": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin, state: [0.0, 1.0]}"),
        ":8: automaton.trims[2].state: the unicycle has no reduced state, need no such key",
    ),
    "trim of no control": (
        but("{name: spin, control: [0.0, 1.0]}", "{name: spin}"),
        ":8: automaton.trims[2]: the key 'control' is missing, need control: [speed, turn_rate]",
    ),
    "trim of no state": (
        inertia(automaton("trims: [{name: rest}]")),
        ":5: automaton.trims[0]: needs state: [speed, steering] or "
        "control: [acceleration, steering_rate]",
    ),
    "state too short": (
        inertia(automaton("trims: [{name: rest, state: [0]}]")),
        ":5: automaton.trims[0].state: got [0], need a list of 2 numbers (speed, steering)",
    ),
    "state beyond its limit": (
        inertia(automaton("trims: [{name: fast, state: [3.0, 0.0]}]")),
        ":5: automaton.trims[0].state: is no trim of the second_order_car: speed would be 3.0000, "
        "0.5 beyond its limit 2.5000",
    ),
    "control that is no trim": (
        inertia(automaton("trims: [{name: up, control: [1.0, 0.0]}]")),
        ":5: automaton.trims[0].control: is no trim of the second_order_car: no steady motion: the "
        "rate of speed stays off by 1",
    ),
    "state twice": (
        inertia(automaton("trims: [{name: a, state: [0, 0]}, {name: a, state: [1, 0]}]")),
        ":5: automaton.trims[1].name: got 'a', the name of another trim in line 5; need a new name",
    ),
    "grid of controls with inertia": (
        inertia(grid(f"[{UNIT}, {UNIT}]")),
        ":5: automaton.grid.control: is for vehicles without a reduced state; the "
        f"second_order_car needs axes such as {AXES}",
    ),
    "grid of speeds without inertia": (
        automaton(f"grid: {{control: [{UNIT}, {UNIT}], speed_m_s: {UNIT}}}"),
        ":5: automaton.grid.speed_m_s: is for vehicles with a reduced state; the unicycle needs "
        "control, a list with one axis per control",
    ),
    "grid of no control": (
        automaton("grid: {}"),
        ":5: automaton.grid: the key 'control' is missing, need one axis per control",
    ),
    "grid of no axis": (
        inertia(automaton("grid: {leave_out: true}")),
        f":5: automaton.grid: got no axis, need some of {AXES}",
    ),
    "grid of what the vehicle has not": (
        inertia(automaton(f"grid: {{climb_m_s: {UNIT}}}")),
        ":5: automaton.grid: the second_order_car has no 'climb', need speed, steering, "
        "acceleration, steering_rate, lateral_speed, turn_rate",
    ),
    "grid with a point out of reach": (
        inertia(
            automaton(
                "grid: {speed_m_s: {min: 0, max: 3, count: 2}, "
                "steering_rad: {min: 0, max: 0, count: 1}}"
            )
        ),
        ":5: automaton.grid: 1 of 2 points have no trim, such as 'speed 3, steering 0': speed "
        "would be 3.0000, 0.5 beyond its limit 2.5000",
    ),
    "grid of states too large": (
        inertia(
            automaton(
                "grid: {speed_m_s: {min: 0, max: 1, step: 0.001}, "
                "steering_rad: {min: 0, max: 0.5, step: 0.1}}"
            )
        ),
        ":5: automaton.grid: got 6006 trims, need at most 2000",
    ),
    "grid with an axis upside down": (
        inertia(automaton("grid: {speed_m_s: {min: 1, max: 0, count: 2}}")),
        ":5: automaton.grid.speed_m_s: got min 1 above max 0, need min <= max",
    ),
    "maneuvers without inertia": (
        automaton("preset: table2").replace(
            "  preset", f"  grid: {{control: [{UNIT}, {UNIT}]}}\n  maneuvers: {{}}\n#"
        ),
        ":6: automaton.maneuvers: is for vehicles whose control is the rate of the reduced state, "
        "not for the unicycle; maneuvers of others come from a library file, or there are none",
    ),
    "maneuvers of a preset": (
        inertia(automaton("preset: parking\n  maneuvers: {late: true}")),
        ":6: automaton.maneuvers: goes with trims or grid only",
    ),
    "unknown pairs": (
        inertia(automaton("trims: [{name: rest, state: [0, 0]}]\n  maneuvers: {pairs: some}")),
        ":6: automaton.maneuvers.pairs: got 'some', need all or neighbours",
    ),
    "strokes of a length that is none": (
        inertia(automaton("trims: [{name: rest, state: [0, 0]}]\n  maneuvers: {strokes_m: [0]}")),
        ":6: automaton.maneuvers: stroke: got 0.0, but the speed of the second_order_car is within "
        "[-2.5, 2.5]; need a way that is not 0 and leads there",
    ),
    "jerk": (
        vehicle("{model: car, wheelbase_m: 2.5, max_jerk_m_s3: 2.0}"),
        ":3: vehicle.max_jerk_m_s3: got 2.0, need no such key: no vehicle has its acceleration as "
        "a state; state max_acceleration_m_s2",
    ),
    "rate of the curvature": (
        vehicle("{model: car, wheelbase_m: 2.5, max_curvature_rate_per_m_s: 0.1}"),
        ":3: vehicle.max_curvature_rate_per_m_s: got 0.1, need no such key: the curvature changes "
        "as the wheels turn; state max_steering_rate_rad_s of second_order_car or single_track",
    ),
    "lateral acceleration of a robot": (
        vehicle("{model: unicycle, max_lateral_acceleration_m_s2: 1.0}"),
        ":3: vehicle.max_lateral_acceleration_m_s2: got 1.0, need no such key, which car, "
        "second_order_car, accelerating_car, car_with_trailer and single_track have; a zone limits "
        "it for any vehicle",
    ),
    "preset for inertia": (
        automaton("preset: parking"),
        ":5: automaton.preset: got 'parking', which is for second_order_unicycle and "
        "second_order_car, not the unicycle",
    ),
    "preset against inertia": (
        inertia(automaton("preset: dubins")),
        ":5: automaton.preset: got 'dubins', which is for vehicles without inertia, not the "
        "second_order_car",
    ),
    "speeds upside down": (
        inertia(SCENARIO).replace("max_speed_m_s: 2.5", "max_speed_m_s: 2.5, min_speed_m_s: 3"),
        ":3: vehicle: second_order_car: min_speed must be less than max_speed 2.5 m/s, got 3.0 m/s",
    ),
    "no acceleration": (
        inertia(SCENARIO).replace("max_acceleration_m_s2: 1.0, ", ""),
        ":3: vehicle: the key 'max_acceleration_m_s2' is missing, need max_acceleration_m_s2: a "
        "positive number",
    ),
    "trailer of a car without one": (
        vehicle("{model: car, wheelbase_m: 2.5, trailer: {rectangle_m: [1, 1]}}"),
        ":3: vehicle.trailer: unknown key; did you mean 'footprint'? Known keys: model, "
        "wheelbase_m, max_steering_rad, max_speed_m_s, max_lateral_acceleration_m_s2, footprint, "
        "footprint_height_m",
    ),
    "trailer that is no shape": (
        vehicle(
            "{model: car_with_trailer, wheelbase_m: 0.25, hitch_length_m: 0.5, "
            "max_steering_rad: 1.0, max_speed_m_s: 0.5, trailer: {disc_m: -1}}"
        ),
        ":3: vehicle.trailer.disc_m: got -1, need a positive number",
    ),
    "unknown start trim with inertia": (
        inertia(automaton("preset: parking")).replace(
            "start: {pose: [0.0, 0.0, 0.0]}", "start: {pose: [0.0, 0.0, 0.0], trim: rest}"
        ),
        ":6: start.trim: no trim 'rest' among speed -2.5, steering -0.75, "
        "speed -2.5, steering -0.375, speed -2.5, steering 0, speed -2.5, steering 0.375, "
        "speed -2.5, steering 0.75, speed -1.25, steering -0.75, speed -1.25, steering -0.375, "
        "speed -1.25, steering 0, speed -1.25, steering 0.375, speed -1.25, steering 0.75, "
        "speed -0.5, steering -0.75, speed -0.5, steering -0.375, ...",
    ),
    "empty trims": (
        automaton("trims: []"),
        ":5: automaton.trims: got [], need a list of at least one trim",
    ),
    "billion laughs": (
        SCENARIO + LAUGHS,
        ":18: aliases multiply to more than 10000 values",
    ),
    "deep nesting": (
        SCENARIO + f"deep: {'[' * 5000}{']' * 5000}\n",
        ":14: lists and mappings are nested more than 40 deep",
    ),
    "nesting": (
        SCENARIO + f"deep: {'[' * 50}{']' * 50}\n",
        ":14: lists and mappings are nested more than 40 deep",
    ),
    "binary": (bytes(range(256)), ":2: is not a text file in UTF-8"),
    "another encoding": (
        but("A case", "caf\xe9").encode("latin-1"),
        ":2: is not a text file in UTF-8",
    ),
    "control character": (
        but("A case", "A\x07case"),
        ":2: is not a text file: it has the character '\\x07'",
    ),
    "ten megabytes": (
        "schema: 1\n" + "# nonsense\n" * 1_000_000,
        ": is longer than 5 MB, too long for a scenario",
    ),
}


@pytest.mark.parametrize("what", MALFORMED)
def test_one_line_names_file_line_field_value_and_what_would_be_right(what, folder, capsys):
    content, message = MALFORMED[what]
    (folder / "x.yaml").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InvalidScenario) as error:
        load_scenario("x.yaml")
    assert str(error.value) == f"x.yaml{message}"
    assert run(["plan", "x.yaml", "--out", "out"]) == 2
    printed = capsys.readouterr()
    assert printed.err == f"x.yaml{message}\n"
    assert printed.out == ""
    assert not (folder / "out").exists()


def test_a_file_that_is_not_closed_names_its_line():
    text = pose("[1.0, 1.0, 0.0")
    with pytest.raises(InvalidScenario, match=r"^x\.yaml:1\d: not valid YAML: "):
        scenario_of_text(text, name="x.yaml")


def test_missing_file(capsys):
    assert run(["plan", "nowhere.yaml"]) == 2
    assert capsys.readouterr().err == "nowhere.yaml: no such file\n"


@pytest.mark.parametrize("kind", ["raster", "costmap", "elevation"])
@pytest.mark.parametrize("values", [[[1.0 + 2.0j]], [["a", "b"]], [[np.nan]]])
def test_a_raster_needs_finite_numbers(values, kind, tmp_path):
    np.save(tmp_path / "cells.npy", values)
    path = tmp_path / "case.yaml"
    ground = f"cost: {{effort: 1.0, ground: [{{{kind}: cells.npy, resolution_m: 0.5}}]}}"
    path.write_text(but("cost: {effort: 1.0}", ground))
    with pytest.raises(InvalidScenario, match=rf"\[0\]\.{kind}: .*, need (finite )?numbers$"):
        load_scenario(path)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(InvalidScenario) as error:
        load_scenario(tmp_path)
    assert str(error.value) == f"{tmp_path}: is a folder, need a file"


def test_the_parser_in_python_reads_the_same(monkeypatch):
    import yaml

    from maneuver_automaton.formats import yaml_source

    fast = yaml_source.parse(SCENARIO, name="x")
    monkeypatch.setattr(yaml_source, "_PARSER", yaml.SafeLoader)
    slow = yaml_source.parse(SCENARIO, name="x")
    assert (slow.value, slow.lines) == (fast.value, fast.lines)
    for what in ("tab", "tag", "duplicate key", "billion laughs", "deep nesting"):
        content, message = MALFORMED[what]
        with pytest.raises(InvalidScenario) as error:
            yaml_source.parse(str(content), name="x.yaml")
        assert str(error.value) == f"x.yaml{message}"
