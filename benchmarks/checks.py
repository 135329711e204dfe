"""How long the checks of a finished plan take, FCL and the audit apart, and what they say.

``python -m benchmarks.checks [--out FILE] [--against FILE] [--repeats N] [--moved]``: random
words among polygons as near as 0.15 m, plans of rooms that a search made, which pass as near as its
margin, words with maneuvers between the trims, and plans among moving obstacles. Median and 99th
percentile of processor time [ms], the map prepared; of the first check also, for which solids of
new motions are built. Run it with ``PYTHONPATH`` at another checkout and ``--out`` first, and here
with ``--against`` that file: every verdict and every clearance is compared. With ``--moved`` every
plan is checked in eight other places too, from 1 um to 1 m away, where many of them touch.
"""

from __future__ import annotations

import argparse
import collections
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

import maneuver_automaton as ma
from benchmarks.tables import show
from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Obstacle, Polygon
from maneuver_automaton.models import Car
from maneuver_automaton.planning.checking import load_checks, what_is_hit
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from tests.inertia import car_automaton
from tests.scenes import moving_scene, room_queries

CAR = Automaton.of_controls(
    Car(wheelbase=2.8, max_steering=0.6),
    {
        f"{way} {side}": (speed, steering)
        for way, speed in (("ahead", 1.0), ("back", -1.0))
        for side, steering in (("left", 0.6), ("straight", 0.0), ("right", -0.6))
    },
)
BODY = Polygon([[-0.95, -0.9], [3.75, -0.9], [3.75, 0.9], [-0.95, 0.9]])
KEPT = 0.15  # [m] at least from every polygon
SEEDS = 12  # of each kind
EXPANSIONS = 2000  # of the searches, so that another checkout finds the same plans
AWAY = (1e-6, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)  # [m]
SAME = 1e-9  # [m] by which the clearance of one plan may differ


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A plan and its problem."""

    kind: str
    name: str
    problem: Problem
    plan: Plan

    def moved(self) -> Iterator[Case]:
        """The same plan in other places, towards which its goal goes along."""
        rng = np.random.default_rng(len(self.name))
        for away in AWAY:
            angle = rng.uniform(0.0, 2.0 * np.pi)
            start = np.array(self.plan.start)
            start[:2] += away * np.array([np.cos(angle), np.sin(angle)])
            plan = replace(self.plan, start=start)
            problem = replace(self.problem, start=start, goals=(Goal(pose=plan.end),))
            yield Case(self.kind, f"{self.name}, {away:g} m away", problem, plan)


def scene(seed: int, trims: int, polygons: int) -> tuple[Plan, list[Obstacle]]:
    """A random word, and polygons beside where it leads, as near as 0.15 m."""
    rng = np.random.default_rng([7, seed, trims, polygons])
    word = [CAR.trims[k] for k in rng.integers(len(CAR.trims), size=trims)]
    plan = Plan(np.zeros(3), word, durations=rng.uniform(0.3, 3.0, trims))
    return plan, beside(plan, polygons, rng)


def beside(plan: Plan, polygons: int, rng: np.random.Generator) -> list[Obstacle]:
    """Polygons beside where a plan leads the body."""
    poses = plan.sample(max_step_m=0.1, max_step_rad=0.02).pose
    corners = np.vstack([BODY.corners, BODY.corners[:1]])
    cosine, sine = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + cosine * corners[:, 0] - sine * corners[:, 1]
    y = poses[:, 1, None] + sine * corners[:, 0] + cosine * corners[:, 1]
    swept = shapely.union_all(shapely.polygons(np.stack([x, y], axis=-1)))
    low, high = np.array(swept.bounds[:2]) - 8.0, np.array(swept.bounds[2:]) + 8.0
    obstacles: list[Obstacle] = []
    while len(obstacles) < polygons:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(3, 8)))
        shape = rng.uniform(0.3, 1.5) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        shape = shape + rng.uniform(low, high)
        if shapely.Polygon(shape).area > 0.02 and swept.distance(shapely.Polygon(shape)) > KEPT:
            obstacles.append(Obstacle(Polygon(shape)))
    return obstacles


def words() -> Iterator[Case]:
    """Random words of the car."""
    for trims in (5, 20):
        for polygons in (25, 150):
            for seed in range(SEEDS):
                plan, obstacles = scene(seed, trims, polygons)
                problem = Problem(CAR, plan.start, plan.end, obstacles=obstacles, footprint=BODY)
                yield Case(f"{trims} trims, {polygons} polygons", str(seed), problem, plan)


def searched() -> Iterator[Case]:
    """What a search finds in rooms, and among moving obstacles."""
    rooms = {f"room of {n} boxes": room_queries(SEEDS, boxes=n, side=s, seed=n)
             for n, s in ((25, 25.0), (150, 60.0))}  # fmt: skip
    crossing = [moving_scene(seed) for seed in range(SEEDS)]
    for kind, problems in {**rooms, "moving obstacles": crossing}.items():
        for k, problem in enumerate(problems):
            problem = replace(problem, search=SearchSettings(max_expansions=EXPANSIONS))
            plan = ma.plan(problem, time_limit=60.0).plan
            if plan is not None:
                yield Case(kind, str(k), problem, plan)


def with_inertia() -> Iterator[Case]:
    """Words of a car with inertia: a maneuver between every two trims."""
    automaton = car_automaton()
    for seed in range(SEEDS):
        rng = np.random.default_rng([8, seed])
        trims, maneuvers = [automaton["rest"]], []
        for _ in range(9):
            leaving = [one for one in automaton.maneuvers if one.source == trims[-1].name]
            maneuvers.append(leaving[rng.integers(len(leaving))])
            trims.append(automaton[maneuvers[-1].target])
        lasting = rng.uniform(0.3, 1.5, len(trims))
        plan = Plan(np.zeros(3), trims, durations=lasting, maneuvers=tuple(maneuvers))
        problem = Problem(
            automaton,
            plan.start,
            Goal(pose=plan.end, trim=trims[-1].name),
            obstacles=[Polygon(one.shape.corners) for one in beside(plan, 150, rng)],
            footprint=BODY,
        )
        yield Case("10 trims with maneuvers, 150 polygons", str(seed), problem, plan)


def checked(case: Case, workspace: Workspace, repeats: int) -> dict[str, Any]:
    """Times [ms] of both checks, the first apart, and what they say."""
    problem, plan, goal = case.problem, case.plan, case.problem.goals[0]
    fcl, audits = [], []
    for _ in range(1 + repeats):
        began = time.process_time()
        hit = what_is_hit(problem, plan, goal, workspace)
        fcl.append(1e3 * (time.process_time() - began))
        began = time.process_time()
        audit = audit_plan(
            plan,
            goal,
            problem.automaton.model,
            footprint=problem.footprint,
            obstacles=problem.obstacles,
            margin=problem.margin,
            around=workspace.surroundings,
        )
        audits.append(1e3 * (time.process_time() - began))
    return {
        "kind": case.kind,
        "fcl": fcl,
        "audit": audits,
        "hit": hit,
        "passed": audit.passed,
        "clearance": audit.min_clearance_m,
    }


def all_checked(repeats: int, *, moved: bool) -> dict[str, dict[str, Any]]:
    """What is found of every plan, by its kind and name."""
    found = {}
    for cases in (words(), searched(), with_inertia()):
        for case in cases:
            workspace = Workspace(case.problem.obstacles)
            load_checks(case.problem, workspace)
            found[f"{case.kind} {case.name}"] = checked(case, workspace, repeats)
            for other in case.moved() if moved else ():
                found[f"{other.kind} {other.name}"] = checked(other, workspace, 0)
    return found


def compare(before: dict[str, dict[str, Any]], now: dict[str, dict[str, Any]]) -> None:
    """Say how many plans are judged otherwise than before."""
    both = [(before[name], one) for name, one in now.items() if name in before]
    verdicts = sum((bool(a["hit"]), a["passed"]) != (bool(b["hit"]), b["passed"]) for a, b in both)
    off = [
        abs(a["clearance"] - b["clearance"])
        for a, b in both
        if None not in (a["clearance"], b["clearance"])
    ]
    hits = sum(bool(b["hit"]) for _, b in both)
    print(
        f"{len(both)} plans, {hits} of them hit something: {verdicts} verdicts differ; clearances "
        f"differ in {sum(one > SAME for one in off)} by more than {SAME:g} m, the most "
        f"{max(off, default=0.0):.3g} m"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--moved", action="store_true")
    options = parser.parse_args()
    found = all_checked(options.repeats, moved=options.moved)
    if options.out:
        options.out.write_text(json.dumps(found))
    kinds: dict[str, list[dict[str, Any]]] = collections.defaultdict(list)
    for one in found.values():
        if len(one["fcl"]) > 1:
            kinds[one["kind"]].append(one)
    rows = []
    for kind, several in kinds.items():
        row: list[object] = [kind, len(several)]
        for what in ("fcl", "audit"):
            later = np.concatenate([one[what][1:] for one in several])
            row += [np.median([one[what][0] for one in several]), *np.percentile(later, [50, 99])]
        rows.append(row)
    columns = ("first", "median", "p99")
    show(["plans", "n", *(f"{w} {c}" for w in ("FCL", "audit") for c in columns)], rows)
    if options.against:
        compare(json.loads(options.against.read_text()), found)


if __name__ == "__main__":
    main()
