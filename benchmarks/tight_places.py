"""Slots, bays and corridors hardly larger than the car, and 40 queries in a crowded room.

``python benchmarks/tight_places.py [--time-limit S] [--only slot|bay|corridor|room]``: time
to the first plan, costs, changes of direction, clearance, and shapely's opinion of each plan.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.ours import Run, failures, rejected, solve, warm_up
from benchmarks.tables import median, show, spread, verdict
from maneuver_automaton.problem import Problem
from tests import scenes

FIRST_MS, FIRST_MS_TIGHTEST, ROOM_P90_MS = 100.0, 300.0, 25.0
TIGHTEST = "bay 2.1 m, aisle 4.3 m"


def places() -> dict[str, Problem]:
    """Tight places by name."""
    return {
        **{f"slot {length} m": scenes.parallel_slot(length) for length in scenes.SLOTS},
        **{f"bay {width} m, aisle {aisle} m": scenes.bay(width, aisle)
           for width, aisle in scenes.BAYS},
        **{f"corridor {width} m": scenes.corridor(width) for width in scenes.CORRIDORS},
    }  # fmt: skip


def row(name: str, run: Run, limit_ms: float | None) -> list[object]:
    opinion = run.second_opinion()
    words: list[object] = [
        name, run.status, 1e3 * run.first_s, *(run.cost_at(at) for at in (0.1, 1.0)), run.cost,
        run.direction_changes, 1e3 * run.check_s,
        "-" if opinion is None else f"{opinion.terminal_m:.0e}",
        "-" if opinion is None else opinion.clearance_m,
        run.audited, opinion is not None and opinion.passes(run.problem, run.goal_index),
    ]  # fmt: skip
    return words if limit_ms is None else [*words, verdict(1e3 * run.first_s <= limit_ms)]


HEADER = ["case", "status", "first [ms]", "at 0.1 s", "at 1 s", "final", "changes", "check [ms]",
          "end off [m]", "clear [m]", "audit", "sound"]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=1.0)
    parser.add_argument("--only", default="", help="cases whose name begins so")
    parser.add_argument("--queries", type=int, default=40, help="in the room")
    options = parser.parse_args()
    chosen = {name: p for name, p in places().items() if name.startswith(options.only)}
    warm_up(scenes.parallel_slot(6.5))
    if chosen:
        runs = {name: solve(p, time_limit=options.time_limit) for name, p in chosen.items()}
        limits = {name: FIRST_MS_TIGHTEST if name == TIGHTEST else FIRST_MS for name in runs}
        show([*HEADER, "aim"], [row(name, run, limits[name]) for name, run in runs.items()])
        print(f"first plan in at most {FIRST_MS:g} ms, {TIGHTEST}: {FIRST_MS_TIGHTEST:g} ms; "
              f"{rejected(list(runs.values()))}")  # fmt: skip
        print(*failures(runs), sep="\n")
    if "room".startswith(options.only):
        queries = scenes.room_queries(options.queries)
        named = {
            f"room {k}": solve(problem, time_limit=options.time_limit)
            for k, problem in enumerate(queries)
        }
        in_room = list(named.values())
        show(HEADER, [row(name, run, None) for name, run in named.items()])
        print(*failures(named), sep="\n")
        firsts = [1e3 * run.first_s for run in in_room]
        p90 = sorted(firsts)[max(0, round(0.9 * len(firsts)) - 1)]
        print(f"solved {sum(run.found for run in in_room)} of {len(in_room)}; first plan [ms]: "
              f"{spread(firsts)}; p90 at most {ROOM_P90_MS:g}: {verdict(p90 <= ROOM_P90_MS)}; "
              f"median length {median(run.cost for run in in_room):.2f} m; "
              f"{rejected(in_room)}")  # fmt: skip


if __name__ == "__main__":
    main()
