"""Random fleets in closed loop: does anybody ever collide, or lose its plan, and what does it cost?

``python benchmarks/fleet_loops.py [--fleets N] [--cases NAME ...] [--time-limit S] [--jobs N]
[--out FILE]``: fleets of two to thirty vehicles of mixed kinds (`mixed_fleets.py`), driven
undisturbed, with noise of 3 mm and 3 mrad a step (a tenth of it for those with inertia), with a
tenth of all messages lost besides, with a fifth of the workers killed or with a breakdown besides,
or with answers a step late. What was driven is judged by shapely (`fleet_judge.py`). A loop is a
line of FILE; lines that are there are not driven again, so it may be stopped at any time. Seconds
are those of the steps by the wall clock, with all their checks; no clock decides what is driven,
unless a time limit is given.

*lost plans*: a vehicle that is there holds none. *defects*: who did not drive as its model says, or
whose speed or hitch jumps. *not flagged*: a plan that leads through where
another one broke down, whose step does not say that it is void. *left behind*: a vehicle that did
not arrive, though `plan_fleet` finds a way for it from where it stands in the end.
"""

from __future__ import annotations

import argparse
import collections
import functools
import json
import math
import sys
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.fleet_judge import distance_to, judged
from benchmarks.mixed_fleets import mixed_fleet
from maneuver_automaton._parallel import in_parallel
from maneuver_automaton.fleet import (
    FleetGuarantee,
    FleetLog,
    FleetProblem,
    FleetStatus,
    Message,
    plan_fleet,
    simulate_fleet,
    verify_driven,
)
from maneuver_automaton.fleet.held import fleet_with_room, tube_of
from maneuver_automaton.problem import Goal
from maneuver_automaton.receding_horizon import Disturbance
from tests.fleet.mortal import Mortal
from tests.fleet.robots import at_rest

STEP = 0.5  # [s]
STEPS = 400  # at least; a quarter more than the first plans take, if that is more
NOISE = Disturbance(position_m=0.003, heading_rad=0.003)
LITTLE = Disturbance(position_m=0.0003, heading_rad=0.0003)  # of those with inertia
DIES = 0.2  # share of the workers
LOST = 0.1  # of all messages
CASES = ("undisturbed", "noise", "lost", "killed", "breakdown", "late")
LONG_S = 600.0  # no clock decides

Row = dict[str, Any]


def losing(seed: int) -> Callable[[Message], bool]:
    """Loses a tenth of all messages."""
    rng = np.random.default_rng([seed, 4])
    return lambda _: bool(rng.random() < LOST)


def settings_of(case: str, fleet: FleetProblem, seed: int) -> dict[str, Any]:
    """What happens to a fleet."""
    rng = np.random.default_rng([seed, 1])
    broken = {str(rng.choice(fleet.names)): float(rng.uniform(1.0, 8.0))}
    dies = {k: float(rng.uniform(0.0, 8.0)) for k in range(len(fleet)) if rng.random() < DIES}
    rows = zip(fleet.names, fleet.problems, strict=True)
    noise = {name: LITTLE if problem.has_inertia else NOISE for name, problem in rows}
    upset: dict[str, Any] = {"disturbance": noise}
    lost = upset | {"lost": losing(seed)}
    return {
        "undisturbed": {},
        "noise": upset,
        "lost": lost,
        "killed": lost | {"workers": Mortal(fleet, dies)},
        "breakdown": lost | {"breaks_s": broken},
        "late": upset | {"delay_steps": 1},
    }[case]


def tried(piece: tuple[int, str], least: int, most: int, time_limit: float) -> Row:
    """One loop, or what was raised."""
    try:
        return driven(*piece, least, most, time_limit)
    except Exception as error:  # noqa: BLE001, it is shown
        traceback.print_exc()
        return {"seed": piece[0], "case": piece[1], "raised": repr(error)}


def driven(seed: int, case: str, least: int, most: int, time_limit: float = LONG_S) -> Row:
    """One loop, and what became of it."""
    fleet = mixed_fleet(seed, least=least, most=most)
    roomy = fleet_with_room(fleet, tube_of(fleet, None))
    first = plan_fleet(roomy, time_limit=LONG_S, max_rounds=0, seed=seed)
    latest = max((plan.start_time + plan.duration for plan in first.plans.values()), default=0.0)
    log = simulate_fleet(
        fleet,
        step=STEP,
        steps=max(STEPS, math.ceil(1.25 * latest / STEP)),
        first=first if first.plans else at_rest(fleet),
        seed=seed,
        time_limit=time_limit,
        **settings_of(case, fleet, seed),
    )
    return {
        "seed": seed,
        "case": case,
        "n": len(fleet),
        "planned": len(first.plans),
        "planned_s": first.sum_s if first.status is FleetStatus.FOUND else math.nan,
        "times": [round(step.solve_s, 4) for step in log.steps],
        **outcome(log),
    }


def outcome(log: FleetLog) -> Row:
    """What a loop is judged by."""
    least, names = judged(log), set(log.problem.names)
    gone = {
        name for name, leaves in zip(log.problem.names, log.problem.leaves, strict=True) if leaves
    }
    said = collections.Counter(one.guarantee.value for _, one in log.violations)
    return {
        "steps": len(log.steps),
        "arrived": len(log.arrived_s),
        "broken": len(log.broken_down),
        "least_m": least.pair_m,
        "pair": [*least.names, least.time_s],
        "still_m": least.still_m,
        "own_m": log.distance_m,
        "defects": len(verify_driven(log).defects),
        "lost_plans": sum(len(names - gone - set(step.plans)) for step in log.steps),
        "void": sum(len(step.void) for step in log.steps),
        "unavoidable": said.get(FleetGuarantee.SAFETY.value, 0),
        "violations": dict(said),
        "not_flagged": len(not_flagged(log)),
        "left_behind": left_behind(log),
        "swaps": log.counts["swaps"],
        "messages": log.counts["messages"],
        "driven_s": log.sum_s,
    }


def not_flagged(log: FleetLog) -> set[str]:
    """Vehicles whose plans lead through one that broke down, and are not said to be void."""
    found = set()
    for before, now in zip(log.steps[:-1], log.steps[1:], strict=True):
        for name in set(log.broken_down) & set(before.plans):
            if now.plans[name] is before.plans[name] or now.values[name] < math.inf:
                continue
            for other, plan in before.plans.items():
                if other == name or other in now.void or now.plans[other] is not plan:
                    continue
                if distance_to(log.problem, other, plan, name, now, now.time) <= 0.0:
                    found.add(other)
    return found


def left_behind(log: FleetLog) -> int:
    """How many did not arrive, though a plan is found for them from where all stand in the end."""
    late = set(log.problem.names) - set(log.arrived_s) - set(log.broken_down)
    if not late:
        return 0
    end = log.steps[-1]
    names = [name for name in log.problem.names if name in end.poses]
    rows = dict(zip(log.problem.names, log.problem.problems, strict=True))
    problems = []
    for name in names:
        here = rows[name].starting_at(end.poses[name], time=rows[name].start_time)
        problems.append(here if name in late else replace(here, goals=Goal(pose=here.start)))
    fleet = FleetProblem(problems, names=names, margin=log.problem.margin)
    found = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    return len(late & set(found.plans))


def line(rows: list[Row]) -> str:
    """A row of the table."""
    times = np.concatenate([row["times"] for row in rows])
    median, most = np.percentile(times, [50, 99])
    said: collections.Counter[str] = collections.Counter()
    for row in rows:
        said.update(row["violations"])
    flags = ", ".join(f"{name} {count}" for name, count in sorted(said.items())) or "none"

    def total(key: str) -> int:
        return sum(row[key] for row in rows)

    hits = sum(row["least_m"] <= 0.0 for row in rows)
    avoidable = sum(row["least_m"] <= 0.0 and not row["unavoidable"] for row in rows)
    still = sum(row["still_m"] <= 0.0 for row in rows)
    able = total("n") - total("broken")
    least = min(row["least_m"] for row in rows)
    whole = [row for row in rows if row["planned"] == row["n"]]
    came = sum(row["arrived"] == row["n"] - row["broken"] for row in whole)
    return (
        f"{len(rows):5d} {total('n'):8d} {total('steps'):6d} {hits:4d} {avoidable:5d} {still:5d} "
        f"{total('lost_plans'):5d} {total('defects'):7d} {total('arrived'):5d}/{able:<5d} "
        f"{came:4d}/{len(whole):<4d} {total('left_behind'):6d} {total('void'):5d} "
        f"{total('not_flagged'):6d} {1e3 * least:8.1f} {total('swaps'):6d} "
        f"{median:7.3f} {most:6.3f} {times.max():6.2f}  {flags}"
    )


def table(rows: Iterable[Row]) -> None:
    """Print what became of all loops, case by case, and of those that went wrong."""
    by_case: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda one: (CASES.index(one["case"]), one["seed"])):
        by_case.setdefault(row["case"], []).append(row)
    print(
        f"{'case':12s} {'loops':>5s} {'vehicles':>8s} {'steps':>6s} {'hits':>4s} {'avoid':>5s} "
        f"{'still':>5s} {'lost':>5s} {'defects':>7s} {'arrived':>11s} "
        f"{'all came':>9s} {'behind':>6s} {'void':>5s} "
        f"{'unsaid':>6s} {'least mm':>8s} {'swaps':>6s} {'median':>7s} {'p99':>6s} {'most':>6s}  "
        "violations"
    )
    for case, some in by_case.items():
        print(f"{case:12s} {line(some)}")
    for case, some in by_case.items():
        for row in some:
            wrong = row["least_m"] <= 0.0 or row["still_m"] <= 0.0 or row["left_behind"]
            came = row["arrived"] == row["n"] - row["broken"] or row["planned"] < row["n"]
            if wrong or not came or row["lost_plans"] or row["defects"] or row["not_flagged"]:
                print(
                    f"  {case} {row['seed']}: {row['arrived']} of {row['n']} arrived, "
                    f"{row['broken']} broke down, {row['planned']} planned, "
                    f"least {1e3 * row['least_m']:.1f} mm {row['pair']}, "
                    f"obstacles {1e3 * row['still_m']:.1f} mm, behind {row['left_behind']}, "
                    f"unsaid {row['not_flagged']}, {row['violations']}"
                )


def main() -> None:
    """Drive what is not in the file yet, and print a table of all that is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=int, default=2)
    parser.add_argument("--most", type=int, default=30)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=["undisturbed", "killed"])
    parser.add_argument("--time-limit", type=float, default=LONG_S)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/fleet_loops.jsonl"))
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    if arguments.out.exists():
        rows = [json.loads(one) for one in arguments.out.read_text().splitlines()]
    done = {(row["seed"], row["case"]) for row in rows}
    seeds = range(arguments.seed, arguments.seed + arguments.fleets)
    wanted = [(seed, case) for seed in seeds for case in arguments.cases]
    sizes = {"least": arguments.least, "most": arguments.most}
    work = functools.partial(tried, **sizes, time_limit=arguments.time_limit)
    missing = [one for one in wanted if one not in done]
    with arguments.out.open("a") as file:
        for row in in_parallel(work, missing, jobs=arguments.jobs, order="as done"):
            if "raised" in row:
                print(row, file=sys.stderr)
                continue
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(
                f"{len(rows):4d} {row['case']} {row['seed']}: {row['arrived']} of {row['n']}, "
                f"least {1e3 * row['least_m']:.1f} mm, {sum(row['times']):.1f} s",
                file=sys.stderr,
            )
    table(rows)


if __name__ == "__main__":
    main()
