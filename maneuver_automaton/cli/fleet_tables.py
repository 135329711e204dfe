"""The table of a fleet: a row for each vehicle, and what holds of all together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton.cli.tables import console, kept_text, print_facts, proven, spoken, table

if TYPE_CHECKING:
    from maneuver_automaton.fleet import Closest, FleetResult

MOST_PAIRS = 3  # that are named, the nearest first


def print_fleet(name: str, result: FleetResult, *, folder: str) -> None:
    """Cost, arrival, clearance and length of every plan; sums, bound, and who is nearest."""
    out = console()
    rows = [
        [
            vehicle,
            one.status.value,
            _shown(one.cost, 6),
            "" if one.plan is None else f"{one.plan.start_time + one.plan.duration:.6g}",
            _shown(one.clearance_m, 3),
            "" if one.plan is None else str(len(one.plan.primitives)),
        ]
        for vehicle, one in result.results.items()
    ]
    columns = ["vehicle", "status", "cost", "arrival [s]", "clearance [m]", "primitives"]
    out.print(table(name, columns, rows, numbers=(2, 3, 4, 5)))
    print_facts(_facts(result, folder))


def _facts(result: FleetResult, folder: str) -> dict[str, str]:
    n, of = len(result.plans), len(result.results)
    kept = kept_text(result.clearance_m, result.problem.margin)
    near = "; ".join(map(pair_text, result.closest[:MOST_PAIRS]))
    return {
        "plans": f"{n} of {of}",
        "cost": f"{result.cost:.9g}{_bound(result)}",
        "each alone": f"{result.alone_cost:.9g}" if result.alone_cost else "",
        "sum": f"{result.sum_s:.9g} s",
        "last arrival": f"{result.last_s:.9g} s",
        "apart": f"{result.clearance_m:.3g} m at least{kept}"
        if math.isfinite(result.clearance_m)
        else "",
        "nearest": near,
        "order": ", ".join(result.order),
        "timing": ", ".join(f"{spoken(k)} {v:.3f} s" for k, v in result.timing_s.items()),
        "counts": ", ".join(f"{spoken(k)} {v}" for k, v in result.counts.items()),
        "left out": "; ".join(result.notes),
        "written to": folder,
    }


def least_clearance(result: FleetResult) -> float | None:
    """The least distance [m] of any vehicle to an obstacle or another one; None if there is none.

    Examples
    --------
    >>> from maneuver_automaton.fleet import FleetProblem, FleetResult, FleetStatus
    >>> from maneuver_automaton import Automaton, Problem, Unicycle
    >>> alone = Problem(Automaton.of_controls(Unicycle(), {"on": (1, 0)}), [0, 0, 0], [1, 0, 0])
    >>> fleet = FleetProblem([alone])
    >>> least_clearance(FleetResult(problem=fleet, status=FleetStatus.NO_PLAN, results={}))
    """
    to_obstacles = [
        one.clearance_m for one in result.results.values() if one.clearance_m is not None
    ]
    least = min([result.clearance_m, *to_obstacles])
    return least if math.isfinite(least) else None


def _bound(result: FleetResult) -> str:
    if result.gap is None:
        return ""
    unit = " s of the last arrival" if result.objective == "last" else ""
    return f" ({proven(result.lower_bound or 0.0, optimal=result.gap <= 0.0)}{unit})"


def pair_text(one: Closest) -> str:
    """Who come nearest to each other, how near, and when."""
    return f"{' and '.join(one.pair)} {one.distance_m:.3g} m at {one.time_s:.4g} s"


def _shown(value: float | None, digits: int) -> str:
    return "" if value is None or math.isinf(value) else f"{value:.{digits}g}"
