"""Our planner and OMPL on the same queries, in one run and on one clock."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from benchmarks import peers
from benchmarks.ours import Run, failures, rejected, solve, warm_up
from benchmarks.peers import PeerRun
from benchmarks.tables import median, show
from maneuver_automaton.problem import Problem

AT = (0.025, 0.1, 1.0, 5.0)  # [s] when costs are read


@dataclass(frozen=True, slots=True)
class Pairing:
    """One query: our run, and those of each planner of OMPL."""

    ours: Run
    theirs: dict[str, list[PeerRun]]

    def peer(self, planner: str, seconds: float) -> float:
        """Median length of a planner's paths after `seconds`, inf if half of the runs had none."""
        costs = sorted(run.cost_at(seconds) for run in self.theirs.get(planner, []))
        return costs[len(costs) // 2] if costs else math.inf


def run(
    queries: Mapping[str, Problem], *, planners: Sequence[str], time_limit: float, repeats: int
) -> dict[str, Pairing]:
    """Every query by every planner, `repeats` times by those of OMPL."""
    if not queries:
        return {}
    warm_up(next(iter(queries.values())))
    return {
        name: Pairing(
            solve(problem, time_limit=time_limit),
            {
                planner: [
                    peers.solve(problem, planner, time_limit=time_limit) for _ in range(repeats)
                ]
                for planner in planners
            },
        )
        for name, problem in queries.items()
    }


def show_ours(pairs: Mapping[str, Pairing]) -> None:
    """Our side, query by query."""
    rows = []
    for name, pair in pairs.items():
        one = pair.ours
        opinion = one.second_opinion()
        rows.append([
            name, one.status, 1e3 * one.first_s, *(one.cost_at(at) for at in AT),
            one.direction_changes, 1e3 * one.check_s,
            "-" if opinion is None else f"{opinion.terminal_m:.0e}",
            math.nan if opinion is None else opinion.clearance_m,
            one.audited, opinion is not None and opinion.passes(one.problem, one.goal_index),
        ])  # fmt: skip
    print("ours (cost = length [m]; 'sound': shapely agrees, every centimetre)")
    show(["query", "status", "first [ms]", *(f"at {at:g} s" for at in AT), "changes", "check [ms]",
          "end off [m]", "clear [m]", "audit", "sound"], rows)  # fmt: skip
    print(rejected([pair.ours for pair in pairs.values()]))
    print(*failures({name: pair.ours for name, pair in pairs.items()}), sep="\n")


def show_theirs(pairs: Mapping[str, Pairing], planner: str) -> None:
    """The side of one planner of OMPL, query by query; medians over its runs."""
    rows = []
    for name, pair in pairs.items():
        runs = pair.theirs[planner]
        solved = [one for one in runs if one.improvements]
        rows.append([
            name, f"{len(solved)}/{len(runs)}", 1e3 * median(one.first_s for one in runs),
            *(pair.peer(planner, at) for at in AT),
            median(one.direction_changes for one in solved),
            f"{max(one.terminal_m for one in solved):.0e}" if solved else "-",
            sum(not one.valid for one in solved),
        ])  # fmt: skip
    print(f"\nOMPL {planner} (true lengths [m]; 'invalid': paths that overlap, seen every 5 cm)")
    show(["query", "solved", "first [ms]", *(f"at {at:g} s" for at in AT), "changes", "end off [m]",
          "invalid"], rows)  # fmt: skip


def show_groups(pairs: Mapping[str, Pairing], planners: Sequence[str]) -> None:
    """Medians over the queries of a group: the word before the dash."""
    rows = []
    for group in sorted({name.split("-")[0] for name in pairs}):
        inside = [pair for name, pair in pairs.items() if name.split("-")[0] == group]
        firsts = [pair.ours.first_s for pair in inside]
        rows.append([f"{group}: ours", len(inside), 1e3 * median(firsts),
                     *(median(pair.ours.cost_at(at) for pair in inside) for at in AT),
                     median(pair.ours.direction_changes for pair in inside), "-"])  # fmt: skip
        for planner in planners:
            runs = [one for pair in inside for one in pair.theirs[planner]]
            solved = [one for one in runs if one.improvements]
            rows.append([
                f"{group}: {planner}", len(inside), 1e3 * median(one.first_s for one in runs),
                *(median(pair.peer(planner, at) for pair in inside) for at in AT),
                median(one.direction_changes for one in solved),
                f"{sum(not one.valid for one in solved)}/{len(solved)}",
            ])  # fmt: skip
    print("\nmedians over the queries of each group")
    show(["group", "queries", "first [ms]", *(f"at {at:g} s" for at in AT), "changes", "invalid"],
         rows)  # fmt: skip
