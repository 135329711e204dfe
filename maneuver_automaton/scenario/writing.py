"""A scenario as YAML, and the JSON Schema of scenario files."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import relative
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.formats.yaml_source import scalar
from maneuver_automaton.problem import Problem, Unstated, Via
from maneuver_automaton.scenario.fleet import FleetFile, FleetScenario
from maneuver_automaton.scenario.parts import stated
from maneuver_automaton.scenario.scenario import Scenario, state_keys
from maneuver_automaton.scenario.schema import (
    BoundsPart,
    CostPart,
    GoalPart,
    HorizonPart,
    ScenarioFile,
    SearchPart,
    ViaPart,
)
from maneuver_automaton.scenario.shapes import (
    stated_footprint,
    stated_obstacle,
    stated_places,
    stated_zone,
)
from maneuver_automaton.scenario.vehicles import described

EACH = ("start", "goal")  # keys that every vehicle has of its own
WIDTH = 110  # characters of a line with a vehicle, beyond which it is cut
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_ ()-]*[A-Za-z0-9_)]|[A-Za-z]")
_HARD = re.compile(r"[^\x20-\x7e\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")


def to_yaml(scenario: Scenario | FleetScenario, *, folder: Path | None = None) -> str:
    """The scenario as a file that reads back to the same problem, to the last bit.

    Of several vehicles, what most of them have stands at the top, and in an entry what differs.
    The trims of a kinematic vehicle are listed, whatever named them before; the automaton of any
    other is written as its file states it. Maps and libraries stay references to their files, as
    seen from `folder`, where the file will be; None: that of the scenario's own file. The names of
    obstacles are not written.

    Raises
    ------
    ValueError
        If a scenario file cannot state it: another model or cost, maneuvers that are from no file,
        a map without a file, a body that is a disc beside the pose.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    >>> problem = Problem(robot, [0, 0, 0], [1, 1, 0], cost=Cost(effort=1.0))
    >>> print(to_yaml(Scenario(name="A first plan", problem=problem)))
    schema: 1
    name: A first plan
    vehicle: {model: unicycle}
    automaton:
      trims:
        - {name: ahead, control: [1.0, 0.0]}
        - {name: spin, control: [0.0, 1.0]}
    start: {pose: [0.0, 0.0, 0.0]}
    goal: {pose: [1.0, 1.0, 0.0]}
    cost: {effort: 1.0}
    search: {method: auto, time_limit_s: 5.0}
    <BLANKLINE>
    """
    if folder is None:
        folder = scenario.path.parent if scenario.path else Path()
    alone = [
        _stated(replace(one, maps=scenario.maps), folder)
        for one in (scenario.vehicles if isinstance(scenario, FleetScenario) else (scenario,))
    ]
    top = alone[0] if isinstance(scenario, Scenario) else _of_most(alone)
    entries: dict[str, Any] = {"schema": 1, "name": scenario.name, **top}
    entries["margin_m"] = entries["margin_m"] or None
    if isinstance(scenario, FleetScenario):
        entries |= _several(scenario, alone, top)
    entries["receding_horizon"] = scenario.receding_horizon and (
        scenario.receding_horizon.model_dump(exclude_none=True)
    )
    return "".join(
        _block(key, value) for key, value in entries.items() if value not in ({}, [], None)
    )


def _stated(scenario: Scenario, folder: Path) -> dict[str, Any]:
    """What a file states of one vehicle, key by key; nothing of what is as if left out."""
    problem, horizon = scenario.problem, scenario.problem.horizon
    unstated = isinstance(horizon.min_coast, Unstated)
    goals = [
        stated(
            GoalPart,
            goal,
            heading="free" if goal.free_heading else None,
            state=_state(problem, goal.state),
        )
        for goal in problem.goals
    ]
    start = {
        "pose": problem.start.tolist(),
        "trim": problem.start_trim,
        "state": _state(problem, problem.start_state),
        "time_s": problem.start_time or None,
    }
    search = {"method": problem.search.method, "time_limit_s": scenario.time_limit_s}
    return {
        "vehicle": _vehicle(scenario),
        "automaton": _automaton(scenario, folder),
        "start": {key: value for key, value in start.items() if value is not None},
        "goal": _one_or_several(goals),
        "cost": _cost(problem.cost)
        | stated_places(problem.place_costs, scenario.ground_files, folder),
        "horizon": stated(
            HorizonPart, horizon, min_coast_s=None if unstated else horizon.min_coast
        ),
        "bounds_m": stated(BoundsPart, problem.bounds),
        "margin_m": problem.margin,
        "obstacles": [
            stated_obstacle(one, scenario.maps, folder)
            for one in problem.obstacles
            if all(one is not file.walls for file in scenario.ground_files)
        ],
        "zones": [stated_zone(one) for one in problem.zones],
        "via": [_via(one) for one in problem.via],
        "order": problem.order if problem.order != "given" else None,
        "search": search | stated(SearchPart, problem.search),
    }


def _state(problem: Problem, state: Array | None) -> dict[str, float] | None:
    keys = state_keys(problem.automaton.model.reduced_names).values()
    return None if state is None else dict(zip(keys, state.tolist(), strict=True))


def _via(via: Via) -> dict[str, Any]:
    """What is on the way; a gate whose heading is free needs no pose."""
    free = via.gate is not None and via.free_heading
    stop = via.stop and not via.stay_s
    return stated(
        ViaPart, via, stop=stop, **({"pose": None, "free_heading": False} if free else {})
    )


def _one_or_several(entries: list[Any]) -> Any:
    return entries if len(entries) > 1 else entries[0]


def _of_most(alone: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What stands at the top for several vehicles: of each key what most of them have."""
    top = {}
    for key in (key for key in alone[0] if key not in EACH):
        texts = [_flow(one[key]) for one in alone]  # equal is what is written alike: not 0.0, -0.0
        top[key] = alone[texts.index(Counter(texts).most_common(1)[0][0])][key]
    return top


def _several(
    scenario: FleetScenario, alone: Sequence[Mapping[str, Any]], top: Mapping[str, Any]
) -> dict[str, Any]:
    """The entries of several vehicles, what differs from the top in each, and the fleet's."""
    fleet, written = scenario.fleet, {key: _flow(value) for key, value in top.items()}
    rows = [
        {
            "name": name,
            **({"priority": priority} if priority else {}),
            **({"leaves": True} if leaves else {}),
            **{key: value for key, value in one.items() if written.get(key) != _flow(value)},
            **(
                {"receding_horizon": scenario.loops[name].model_dump(exclude_none=True)}
                if name in scenario.loops
                else {}
            ),
        }
        for name, priority, leaves, one in zip(
            fleet.names, fleet.priority, fleet.leaves, alone, strict=True
        )
    ]
    settings = scenario.settings.model_dump() | {"between_m": fleet.margin}
    return {"vehicles": rows, "fleet": settings}


def _vehicle(scenario: Scenario) -> dict[str, Any]:
    problem = scenario.problem
    vehicle = described(problem.automaton.model)
    if scenario.footprint:
        vehicle["footprint"] = _one_or_several(list(scenario.footprint))
    if any(problem.body_height):
        vehicle["footprint_height_m"] = list(problem.body_height)
    for name, body in problem.parts.items():
        vehicle[name] = _one_or_several(list(stated_footprint(body)))
    return vehicle


def json_schema() -> dict[str, Any]:
    """JSON Schema of scenario files, for editors: of one vehicle, or of several."""
    one = _plain(ScenarioFile.model_json_schema(by_alias=True))
    several = _plain(FleetFile.model_json_schema(by_alias=True))
    kinds = [kind["required"] for kind in (one, several)]
    loops = [kind["properties"]["receding_horizon"] for kind in (one, several)]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **one,
        "$defs": several["$defs"] | one["$defs"],
        "properties": one["properties"]
        | {key: several["properties"][key] for key in ("vehicles", "fleet")}
        | {"receding_horizon": {"anyOf": loops, "description": "only for mpc"}},
        "required": [key for key in kinds[0] if key in kinds[1]],
        "oneOf": [
            {"required": keys, "properties": {"receding_horizon": loop}}
            for keys, loop in zip(kinds, loops, strict=True)
        ],
        "dependentRequired": {"fleet": ["vehicles"]},
    }


def _plain(schema: Any) -> Any:
    """The schema without the nulls that stand for a key that is left out; parts by their titles."""
    titles = {f"#/$defs/{name}": part["title"] for name, part in schema["$defs"].items()}

    def plain(value: Any) -> Any:
        if isinstance(value, list):
            return [plain(item) for item in value]
        if not isinstance(value, dict):
            return value
        kept = {key: plain(item) for key, item in value.items()}
        if kept.get("$ref") in titles:
            kept["$ref"] = f"#/$defs/{titles[kept['$ref']]}"
        if "default" in kept and kept["default"] is None:
            del kept["default"]
        if isinstance(kept.get("anyOf"), list):
            options = [option for option in kept["anyOf"] if option != {"type": "null"}]
            if len(options) == 1:
                del kept["anyOf"]
                return options[0] | kept
            kept["anyOf"] = options
        return kept

    parts = sorted(schema["$defs"].values(), key=lambda part: str(part["title"]))
    named = {part["title"]: part for part in parts}
    plain_schema: dict[str, Any] = plain(schema | {"$defs": named})
    return plain_schema


def _automaton(scenario: Scenario, folder: Path) -> dict[str, Any]:
    """Trims of a kinematic vehicle one by one; else what the scenario's own file states."""
    automaton = scenario.problem.automaton
    if not automaton.maneuvers and not automaton.model.reduced_names:
        for trim in automaton.trims:
            if math.isfinite(trim.max_duration):
                said = "a scenario file cannot state its max_duration"
                raise ValueError(f"trim {trim.name!r}: {said}")
        trims = [{"name": one.name, "control": one.control.tolist()} for one in automaton.trims]
        return {"trims": trims}
    if scenario.stated is None:
        raise ValueError("automaton: a scenario file cannot list maneuvers, save a library instead")
    entry = scenario.stated.model_dump(exclude_none=True, exclude_defaults=True)
    if scenario.stated.file is not None and scenario.path is not None:
        entry["file"] = relative(scenario.path.parent / scenario.stated.file, folder)
    return entry


def _cost(cost: StageCost) -> dict[str, Any]:
    terms = terms_of(cost)
    if terms is None:
        raise ValueError(
            "cost: a scenario file can state the terms of the class Cost only, need its method "
            "terms(), which returns them"
        )
    return stated(CostPart, terms, norm_order={1.0: 1, 2.0: 2}.get(terms.norm_order, "inf"))


def _block(key: str, value: Any) -> str:
    if key == "automaton" and "trims" in value:
        rows = "".join(f"    - {_flow(row)}\n" for row in value["trims"])
        rest = "".join(f"  {k}: {_flow(v)}\n" for k, v in value.items() if k != "trims")
        return f"automaton:\n  trims:\n{rows}{rest}"
    if key == "vehicles":
        return f"{key}:\n" + "".join(map(_row, value))
    if isinstance(value, list):
        return f"{key}:\n" + "".join(f"  - {_flow(row)}\n" for row in value)
    return f"{key}: {_flow(value)}\n"


def _row(entry: Mapping[str, Any]) -> str:
    """An entry of a list in one line, or in one a key if that is long."""
    line = f"  - {_flow(entry)}\n"
    if len(line) <= WIDTH:
        return line
    rows = [f"    {key}: {_flow(value)}\n" for key, value in entry.items()]
    return "".join(rows).replace("    ", "  - ", 1)


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    if isinstance(value, str):
        if _PLAIN.fullmatch(value) and isinstance(scalar(value), str):
            return value
        quoted = json.dumps(value, ensure_ascii=False)
        return _HARD.sub(lambda bad: f"\\u{ord(bad.group()):04x}", quoted)
    return repr(value)
