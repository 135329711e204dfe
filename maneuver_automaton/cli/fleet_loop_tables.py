"""The tables of a fleet's closed loop: the steps, what each vehicle did, and what holds of all."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton.cli.fleet_tables import pair_text
from maneuver_automaton.cli.loop_tables import shortened
from maneuver_automaton.cli.tables import console, kept_text, print_facts, table
from maneuver_automaton.fleet import DrivenVerdict, FleetLog, FleetStep
from maneuver_automaton.planning.polishing import left_out

MOST_NAMES = 4  # of vehicles in a cell


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
    print_facts(_facts(log, driven, folder))


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


def _facts(log: FleetLog, driven: DrivenVerdict, folder: str) -> dict[str, str]:
    broken = len({number for number, _ in log.violations})
    kept = kept_text(driven.distance_m, log.problem.margin) if driven.closest else ""
    milliseconds = 1e3 * np.array([step.solve_s for step in log.steps])
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
        "time per step": (
            f"{np.median(milliseconds):.2f} ms median, {milliseconds.max():.2f} ms at most"
            if milliseconds.size
            else ""
        ),
    }
