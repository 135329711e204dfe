"""plan.json of several vehicles: what each has, and what holds of them together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maneuver_automaton._files import relative
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import Closest, FleetProblem, FleetResult, FleetStatus
from maneuver_automaton.formats.plan_json import (
    FLEET,
    SCHEMA,
    package_version,
    plan_to_dict,
    read_fleet_document,
    write_document,
)
from maneuver_automaton.formats.result_json import result_of_document

TIMINGS = ("load", "automaton", "alone", "first_plan", "search", "audit")
COUNTS = ("expansions", "queries", "rounds")
MOST_SAID = 3  # vehicles whose reasons stand in the reason of the fleet


def fleet_to_dict(result: FleetResult, *, name: str = "") -> dict[str, Any]:
    """The content of plan.json for several vehicles, as plain values.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import plan_fleet
    >>> controls = {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> ways = [Problem(robot, [0, y, 0], [4, y, 0], footprint=Disc(0.3)) for y in (0, 2)]
    >>> fleet = FleetProblem(ways, names=["low", "high"])
    >>> document = fleet_to_dict(plan_fleet(fleet, time_limit=1.0))
    >>> document["kind"], document["status"], list(document["vehicles"]), document["sum_s"]
    ('fleet', 'found', ['low', 'high'], 8.0)
    """
    to_obstacles = [
        one.clearance_m for one in result.results.values() if one.clearance_m is not None
    ]
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "kind": FLEET,
        "name": name,
        "status": result.status.value,
        "reason": reason_of(result),
        "notes": list(result.notes),
        "objective": result.objective,
        "cost": float(result.cost),
        "alone_cost": float(result.alone_cost),
        "sum_s": float(result.sum_s),
        "last_s": float(result.last_s),
        "lower_bound": float(result.lower_bound),
        "gap": None if result.gap is None else float(result.gap),
        "clearance_m": {
            "between": finite_number(result.clearance_m),
            "to_obstacles": finite_number(min(to_obstacles, default=math.inf)),
        },
        "closest": [closest_entry(one) for one in result.closest],
        "order": list(result.order),
        "improvements": [[float(at), float(value)] for at, value in result.improvements],
        "timing_s": {**dict.fromkeys(TIMINGS), **{k: float(v) for k, v in result.timing_s.items()}},
        "counts": {**dict.fromkeys(COUNTS, 0), **{k: int(v) for k, v in result.counts.items()}},
        "vehicles": {
            vehicle: plan_to_dict(one, name=vehicle)
            | ({"reason": result.reasons[vehicle]} if vehicle in result.reasons else {})
            for vehicle, one in result.results.items()
        },
    }


def reason_of(result: FleetResult) -> str:
    """Who has no plan, and why, in one line; empty if all have one."""
    said = [f"{name}: {why}" for name, why in result.reasons.items()]
    more = f"; and {len(said) - MOST_SAID} more" if len(said) > MOST_SAID else ""
    return "; ".join(said[:MOST_SAID]) + more


def save_fleet(
    result: FleetResult,
    path: Path | str,
    *,
    name: str = "",
    source: Mapping[str, Any] | None = None,
    interrupted: bool = False,
) -> None:
    """Write plan.json of several vehicles in one step.

    Parameters
    ----------
    result : FleetResult
    path : Path or str
    name : str
        Of the scenario, which heads pictures.
    source : mapping, optional
        The files that it was planned from, for `check`: `file`, `with`, `case`. Paths are written
        as seen from the plan.
    interrupted : bool
        Whether a signal came before the work was done, which the file says then.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    document = fleet_to_dict(result, name=name)
    if source is not None:
        document["source"] = source_entry(source, Path(path))
    write_document(document, path, interrupted=interrupted)


def load_fleet(path: Path | str, fleet: FleetProblem) -> FleetResult:
    """The result of a plan.json of several vehicles, in the world that it was planned in.

    What the file claims is not proven again; `verify_fleet` does that.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, has other vehicles, or was planned with other libraries.
    """
    document = read_fleet_document(path)
    if document is None:
        raise InvalidScenario(f"{path}: holds the plan of one vehicle, need those of several")
    stated = document["vehicles"]
    if set(stated) != set(fleet.names):
        raise InvalidScenario(
            f"{path}: vehicles: got {', '.join(stated)}, need {', '.join(fleet.names)}"
        )
    results = {
        name: result_of_document(stated[name], problem, path=f"{path}: vehicles.{name}")
        for name, problem in zip(fleet.names, fleet.problems, strict=True)
    }
    try:
        between = document["clearance_m"]["between"]
        return FleetResult(
            problem=fleet,
            status=FleetStatus(document["status"]),
            results=results,
            objective=document.get("objective", "sum"),
            lower_bound=float(document["lower_bound"]),
            alone_cost=float(document["alone_cost"]),
            clearance_m=math.inf if between is None else float(between),
            closest=tuple(map(closest_of, document["closest"])),
            reasons={name: one.reason for name, one in results.items() if one.plan is None},
            order=tuple(document["order"]),
            improvements=tuple((float(s), float(v)) for s, v in document["improvements"]),
        )
    except (ValueError, KeyError, TypeError, IndexError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {said}") from error


def closest_entry(one: Closest) -> dict[str, Any]:
    """A pair of vehicles, and where they are nearest to each other."""
    return {
        "pair": list(one.pair),
        "time_s": float(one.time_s),
        "distance_m": float(one.distance_m),
    }


def closest_of(entry: Mapping[str, Any]) -> Closest:
    """A pair of vehicles from its entry."""
    first, second = entry["pair"]
    return Closest((first, second), float(entry["time_s"]), float(entry["distance_m"]))


def source_entry(source: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """The files that plans in the file `path` were made from, as seen from it."""
    return {
        key: relative(value, path.parent) if isinstance(value, Path) else value
        for key, value in source.items()
    }


def finite_number(value: float) -> float | None:
    """A number for strict JSON; None where there is none."""
    return None if math.isinf(value) else float(value)
