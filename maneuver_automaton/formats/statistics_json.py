"""statistics.json: many closed loops, one object each."""

from __future__ import annotations

import json
from pathlib import Path

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.formats.closed_loop_json import entries_of
from maneuver_automaton.formats.plan_json import package_version
from maneuver_automaton.receding_horizon import Statistics


def save_statistics(statistics: Statistics, path: Path | str, *, interrupted: bool = False) -> None:
    """Write statistics.json in one step; `interrupted` by a signal it says so.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    head = {
        "schema": 1,
        "version": package_version(),
        "loops_run": len(statistics.outcomes),
        "reached": statistics.reached,
        "stayed": statistics.stayed,
        "steps_with_a_broken_guarantee": statistics.broken,
        **({"interrupted": True} if interrupted else {}),
    }
    rows = [
        {
            "seed": one.seed,
            "start": one.start.tolist(),
            "reached": one.reached,
            "arrived_after_steps": one.arrived_after,
            "stayed": one.stayed,
            "share_inside": one.share_inside,
            "steps": one.steps,
            "cost": one.cost,
            "first_value": one.first_value,
            "reason": one.reason,
            "broken_guarantees": entries_of(one.violations),
            "disturbed": entries_of(one.disturbed),
            "solve_s": one.solve_s.tolist(),
        }
        for one in statistics.outcomes
    ]
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    loops = ",\n".join(f"    {json.dumps(row, allow_nan=False)}" for row in rows)
    lines.append(f'  "loops": [\n{loops}\n  ]')
    write_text_atomically(Path(path), "{\n" + ",\n".join(lines) + "\n}\n")
