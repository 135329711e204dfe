"""plan.json of several vehicles: what each has, and what holds of them together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import FleetProblem, FleetResult
from maneuver_automaton.formats.documents import (
    FLEET,
    ClearanceEntry,
    ClosestEntry,
    DocumentHead,
    document_of,
    errors_at,
    read_document,
    write_document,
)
from maneuver_automaton.formats.entries import (
    Known,
    Number,
    Pairs,
    Whole,
    made,
    number,
    or_inf,
    says,
)
from maneuver_automaton.formats.plan_json import PlanDocument, plan_to_dict, result_of

TIMINGS = ("load", "automaton", "alone", "first_plan", "search", "audit")
COUNTS = ("expansions", "queries", "rounds")
MOST_SAID = 3  # vehicles whose reasons stand in the reason of the fleet


class FleetDocument(DocumentHead):
    """The plans of several vehicles, and what holds of them together."""

    kind: Literal["fleet"]
    status: Annotated[str, says("found: all have plans; partial: some; no_plan")]
    objective: NotRequired[Annotated[str, says("what was improved: sum or last")]]
    cost: NotRequired[Annotated[Known, says("sum of the costs")]]
    alone_cost: Annotated[Number, says("of the paths of all by themselves, as found")]
    sum_s: NotRequired[Annotated[Number, says("sum of the times until each arrives")]]
    last_s: NotRequired[Annotated[Number, says("when the last one arrives, on the clock of all")]]
    lower_bound: Annotated[Number, says("no plans have less of the objective")]
    gap: NotRequired[Annotated[Known, says("null if someone has no plan")]]
    clearance_m: ClearanceEntry
    closest: Annotated[list[ClosestEntry], says("pairs that come near, the nearest first")]
    order: Annotated[list[str], says("in which the vehicles that meet were planned")]
    improvements: Annotated[Pairs, says("[[s, objective]]")]
    timing_s: NotRequired[dict[str, Known]]
    counts: NotRequired[dict[str, Whole]]
    vehicles: Annotated[dict[str, PlanDocument], says("by name, as one vehicle's plan.json")]


def fleet_to_dict(result: FleetResult, *, name: str = "") -> FleetDocument:
    """The content of plan.json for several vehicles, as plain values.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import plan_fleet
    >>> controls = {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> ways = [Problem(robot, [0, y, 0], [4, y, 0], footprint=Disc(0.3)) for y in (0, 2)]
    >>> fleet = FleetProblem(ways, names=["low", "high"])
    >>> document = fleet_to_dict(plan_fleet(fleet, time_limit=60.0, max_rounds=0))
    >>> document["kind"], document["status"], list(document["vehicles"]), document["sum_s"]
    ('fleet', 'found', ['low', 'high'], 8.0)
    """
    to_obstacles = (one.clearance_m for one in result.results.values())
    return document_of(
        FleetDocument,
        result,
        kind=FLEET,
        name=name,
        reason=reason_of(result),
        clearance_m={
            "between": number(result.clearance_m),
            "to_obstacles": number(min(map(or_inf, to_obstacles), default=None)),
        },
        timing_s=dict.fromkeys(TIMINGS) | result.timing_s,
        counts=dict.fromkeys(COUNTS, 0) | result.counts,
        vehicles={
            vehicle: plan_to_dict(one, name=vehicle)
            | {"reason": result.reasons.get(vehicle, one.reason)}
            for vehicle, one in result.results.items()
        },
    )


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
    write_document(fleet_to_dict(result, name=name), path, source=source, interrupted=interrupted)


def load_fleet(path: Path | str, fleet: FleetProblem) -> FleetResult:
    """The result of a plan.json of several vehicles; `verify_fleet` proves what it claims again."""
    document = read_of_fleet(path, "fleet", fleet)
    stated = document["vehicles"]
    results = {
        name: result_of(stated[name], problem, place=f"{path}: vehicles.{name}")
        for name, problem in zip(fleet.names, fleet.problems, strict=True)
    }
    with errors_at(path):
        return made(
            FleetResult,
            document,
            FleetDocument,
            problem=fleet,
            results=results,
            clearance_m=or_inf(document["clearance_m"]["between"]),
            reasons={name: one.reason for name, one in results.items() if one.plan is None},
            timing_s={},
            counts={},
        )


def read_of_fleet(path: Path | str, kind: str, fleet: FleetProblem) -> dict[str, Any]:
    """What a file of this kind holds of a fleet; it has to be that of these vehicles."""
    document = read_document(path, kind)
    if set(stated := document["vehicles"]) != set(fleet.names):
        raise InvalidScenario(
            f"{path}: vehicles: got {', '.join(stated)}, need {', '.join(fleet.names)}"
        )
    return document
