"""Tables of a fleet: of its plans, of its closed loop, and what holds of all vehicles together."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton.cli.loop_tables import shortened, times_of
from maneuver_automaton.cli.tables import console, kept_text, print_facts, proven, spoken, table
from maneuver_automaton.fleet import Closest, DrivenVerdict, FleetLog, FleetResult, FleetStep
from maneuver_automaton.planning.polishing import left_out

MOST_NAMES = 4  # of vehicles in a cell
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
    print_facts(_plan_facts(result, folder))


def _plan_facts(result: FleetResult, folder: str) -> dict[str, str]:
    n, of = len(result.plans), len(result.results)
    kept = kept_text(result.clearance_m, result.problem.margin)
    near = "; ".join(map(pair_text, result.closest[:MOST_PAIRS]))
    apart = f"{result.clearance_m:.3g} m at least{kept}"
    return {
        "plans": f"{n} of {of}",
        "cost": f"{result.cost:.9g}{_bound(result)}",
        "each alone": f"{result.alone_cost:.9g}" if result.alone_cost else "",
        "sum": f"{result.sum_s:.9g} s",
        "last arrival": f"{result.last_s:.9g} s",
        "apart": apart if math.isfinite(result.clearance_m) else "",
        "nearest": near,
        "order": ", ".join(result.order),
        "timing": ", ".join(f"{spoken(k)} {v:.3f} s" for k, v in result.timing_s.items()),
        "counts": ", ".join(f"{spoken(k)} {v}" for k, v in result.counts.items()),
        "left out": "; ".join(result.notes),
        "written to": folder,
    }


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


def print_fleet_loop(name: str, log: FleetLog, driven: DrivenVerdict, *, folder: str) -> None:
    """Every step, every vehicle, and how it ended."""
    out = console()
    spent = _spent(log)
    values = log.values.tolist()
    rows = [_step_row(*row) for row in zip(log.steps, values, spent, strict=True)]
    columns = ["", "time [s]", "value", "spent", "apart [m]", "swaps", "asked", "events",
               "solved [ms]"]  # fmt: skip
    if rows:
        out.print(table(name, columns, shortened(rows), numbers=(0, 1, 2, 3, 4, 6, 8)))
    vehicles = [_vehicle_row(log, driven, one) for one in log.problem.names]
    columns = ["vehicle", "status", "arrival [s]", "cost", "swaps", "off plan [m]", "clearance [m]"]
    out.print(table("" if rows else name, columns, vehicles, numbers=(2, 3, 4, 5, 6)))
    print_facts(_loop_facts(log, driven, folder))


def _spent(log: FleetLog) -> list[float]:
    """What all had spent before each step."""
    costs = np.zeros(len(log.steps))
    for name in log.problem.names:
        for step, cost in log.costs_of(name).items():
            costs[step] += cost
    return [float(cost) for cost in np.cumsum(costs) - costs]


def _step_row(step: FleetStep, value: float, spent: float) -> list[str]:
    return [
        str(step.number),
        f"{step.time:.6g}",
        "" if math.isinf(value) else f"{value:.6g}",
        f"{spent:.6g}",
        "" if math.isinf(step.distance_m) else f"{step.distance_m:.3g}",
        _several([" and ".join(swap.names) for swap in step.swaps]),
        str(len(step.asked)),
        "; ".join(
            f"{what}: {_several(names)}"
            for what, names in (
                ("plan void", step.void),
                ("not let in", step.refused),
                ("broken", [one.guarantee.value for one in step.violations]),
            )
            if names
        ),
        f"{1e3 * step.solve_s:.2f}",
    ]


def _several(names: list[str] | tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def _vehicle_row(log: FleetLog, driven: DrivenVerdict, name: str) -> list[str]:
    arrived = log.arrived_s.get(name)
    swaps = sum(name in swap.names for _, swap in log.swaps)
    off = max((step.off_plan[name] for step in log.steps if name in step.off_plan), default=0.0)
    status = "under way" if arrived is None else "arrived"
    status = "broken down" if name in log.broken_down else status
    clearance = driven.clearances_m[name]
    return [
        name,
        status if log.driven[name] or arrived is not None else "not there",
        "" if arrived is None else f"{arrived:.6g}",
        f"{math.fsum(log.costs_of(name).values()):.6g}",
        str(swaps),
        f"{off:.2g}",
        "" if math.isinf(clearance) else f"{clearance:.3g}",
    ]


def _loop_facts(log: FleetLog, driven: DrivenVerdict, folder: str) -> dict[str, str]:
    broken = len({number for number, _ in log.violations})
    kept = kept_text(driven.distance_m, log.problem.margin) if driven.closest else ""
    collisions = len(driven.collisions)
    return {
        "goals": "reached" if log.reached else log.reason,
        "cost": f"{log.cost:.9g}",
        "sum": f"{log.sum_s:.9g} s",
        "last arrival": f"{log.last_s:.9g} s",
        "steps": str(len(log.steps)),
        "guarantees": f"broken in {broken} steps" if broken else "hold in every step",
        "apart": f"{driven.distance_m:.3g} m at least{kept}" if driven.closest else "",
        "nearest": "; ".join(map(pair_text, driven.closest[:3])),
        "collisions": f"{collisions}" if collisions else "none",
        "left out": "; ".join(left_out(*log.problem.problems)),
        "written to": folder,
        "time per step": times_of(step.solve_s for step in log.steps),
    }
