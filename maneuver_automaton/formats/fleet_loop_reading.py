"""The loop of several vehicles from its closed_loop.json."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import (
    FleetGuarantee,
    FleetLog,
    FleetProblem,
    FleetStep,
    FleetViolation,
    Swap,
)
from maneuver_automaton.formats.driven_json import read_closed_loop_document
from maneuver_automaton.formats.fleet_json import closest_of
from maneuver_automaton.formats.plan_json import FLEET
from maneuver_automaton.formats.word_json import plan_of_entries
from maneuver_automaton.formats.yaml_source import shown

Row: TypeAlias = Mapping[str, Any]  # an object of the file


def read_fleet_loop_document(path: Path | str) -> dict[str, Any] | None:
    """The content of a closed_loop.json of several vehicles; None if the file is none."""
    document = read_closed_loop_document(path)
    return document if document is not None and document.get("kind") == FLEET else None


def load_fleet_loop(path: Path | str, fleet: FleetProblem) -> FleetLog:
    """The loop of a closed_loop.json, in the world that it was driven in.

    What the file claims is not proven again; `verify_driven` does that.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, has other vehicles, or was driven with other libraries.
    """
    document = read_fleet_loop_document(path)
    if document is None:
        raise InvalidScenario(f"{path}: is no closed_loop.json of several vehicles")
    stated = document.get("vehicles")
    if not isinstance(stated, dict) or set(stated) != set(fleet.names):
        got = ", ".join(stated) if isinstance(stated, dict) else shown(stated)
        raise InvalidScenario(f"{path}: vehicles: got {got}, need {', '.join(fleet.names)}")
    problems = dict(zip(fleet.names, fleet.problems, strict=True))
    for name, problem in problems.items():
        if _hash_of(stated[name]) != automaton_hash(problem.automaton):
            raise InvalidScenario(
                f"{path}: vehicles.{name}.automaton_hash: this loop was driven with another library"
            )
    place = ""
    try:
        step_s = float(document["step_s"])
        did = {}
        for name, problem in problems.items():
            place = f"vehicles.{name}: "
            did[name] = _did(_applied(stated[name]["steps"]), problem.automaton)
        place = ""
        steps = [_step(k, row, did) for k, row in enumerate(_applied(document["steps"]))]
        _check_times(steps)
        pieces = {}
        for name, problem in problems.items():
            place = f"vehicles.{name}: "
            pieces[name] = tuple(
                _piece(steps[number], name, row, step_s, problem.automaton)
                for number, (row, _, _) in did[name].items()
            )
        place = ""
        closest = [closest_of(one) for one in document["closest"]]
        return FleetLog(
            problem=fleet,
            step=step_s,
            steps=tuple(steps),
            driven=pieces,
            arrived_s={
                name: float(one["arrived_s"]) for name, one in stated.items() if one["reached"]
            },
            broken_down=tuple(
                sorted(name for name, one in stated.items() if one["status"] == "broken_down")
            ),
            closest=min(closest, key=lambda row: row.distance_m, default=None),
            status=str(document["status"]),
            reason=str(document["reason"]),
            cost=float(document["cost"]),
            counts={key: int(value) for key, value in document["counts"].items()},
        )
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {place}{said}") from error


def _hash_of(entry: Any) -> Any:
    return entry.get("automaton_hash") if isinstance(entry, dict) else None


def _applied(rows: Any) -> Sequence[Row]:
    """The steps but the last entry, which says where it ended."""
    if not isinstance(rows, list) or not rows:
        raise ValueError(f"steps: got {shown(rows)}, need a list of steps")
    return rows[:-1]


def _did(rows: Sequence[Row], automaton: Automaton) -> dict[int, tuple[Row, Plan, Plan]]:
    """By step what a vehicle did, the plan that it held, and what it drove of it."""
    found: dict[int, tuple[Row, Plan, Plan]] = {}
    held: Plan | None = None
    for row in rows:
        if (it := row["held"]) is not None:
            held = plan_of_entries(
                _pose(it["pose"], automaton), it["plan"], float(it["time_s"]), automaton
            )
        if held is None:
            raise ValueError(f"steps: holds no plan at {row['time_s']:g} s")
        start, time = _pose(row["pose"], automaton), float(row["plan_time_s"])
        plan = plan_of_entries(start, row["plan"], time, automaton)
        found[int(row["number"])] = (row, held, plan)
    return found


def _pose(numbers: Any, automaton: Automaton) -> Array:
    return as_array("steps: pose", numbers, last=automaton.model.group.dof)


def _piece(step: FleetStep, name: str, row: Row, step_s: float, automaton: Automaton) -> Plan:
    """What a vehicle drove in a step."""
    pose = _pose(row["vehicle_pose"], automaton)
    undisturbed = step.piece_of(name, pose, step.time + step_s, automaton.model)
    if row["driven"] is None:
        return undisturbed
    return plan_of_entries(pose, row["driven"], undisturbed.start_time, automaton)


def _step(
    number: int, row: Row, did: Mapping[str, Mapping[int, tuple[Row, Plan, Plan]]]
) -> FleetStep:
    """A step of all."""
    if row["number"] != number:
        raise ValueError(f"steps: number: got {shown(row['number'])}, need {number}")
    here = {name: its[number] for name, its in did.items() if number in its}
    own = {name: its for name, (its, _, _) in here.items()}
    late = [name for name, its in own.items() if its["time_s"] != row["time_s"]]
    if late:
        raise ValueError(
            f"vehicles.{late[0]}: step {number} is at {own[late[0]]['time_s']:g} s, "
            f"need {row['time_s']:g} s"
        )
    return FleetStep(
        number=number,
        time=float(row["time_s"]),
        poses={name: np.array(its["measured_pose"], dtype=float) for name, its in own.items()},
        plans={name: held for name, (_, held, _) in here.items()},
        driven={name: plan for name, (_, _, plan) in here.items()},
        values={name: _or_inf(its["value"]) for name, its in own.items()},
        arrivals={name: _or_inf(its["arrival_s"]) for name, its in own.items()},
        off_plan={name: float(its["off_plan_m"]) for name, its in own.items()},
        arrived=tuple(row["arrived"]),
        swaps=tuple(_swap(k, one) for k, one in enumerate(row["swaps"])),
        asked=tuple(row["asked"]),
        void=tuple(row["void"]),
        refused=tuple(row["refused"]),
        gap_m=_or_inf(row["gap_m"]),
        violations=tuple(map(_violation, row["broken_guarantees"])),
        solve_s=float(row["solve_s"]),
        distance_m=_or_inf(row["distance_m"]),
    )


def _swap(order: int, entry: Row) -> Swap:
    return Swap(
        names=tuple(entry["vehicles"]),
        before=_or_inf(entry["before"]),
        after=float(entry["after"]),
        past=tuple((name, int(version)) for name, version in entry["past"].items()),
        holds=tuple((name, int(version)) for name, version in entry["holds"].items()),
        order=order,
    )


def _violation(entry: Row) -> FleetViolation:
    guarantee = FleetGuarantee(entry["guarantee"])
    return FleetViolation(guarantee, tuple(entry["vehicles"]), str(entry["reason"]))


def _or_inf(value: float | None) -> float:
    return math.inf if value is None else float(value)


def _check_times(steps: Sequence[FleetStep]) -> None:
    for before, after in pairwise(steps):
        if not after.time > before.time:
            raise ValueError(
                f"steps: step {after.number} is at {after.time:g} s, need more than "
                f"{before.time:g} s"
            )
