"""Solutions of CommonRoad scenarios, judged by the official `commonroad-drivability-checker`.

``python benchmarks/commonroad_solutions.py [--scenarios FOLDER] [--out FOLDER]``: every
scenario is driven in closed loop and planned once, both are written as solution files, read back by
commonroad-io, and checked as the site that takes submissions does: goal, start, collisions, road
boundary, feasibility of the kinematic single-track model. Needs the extra `commonroad`, and
``pip install 'commonroad-drivability-checker[triangle]'``.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks.cases import DATA, present
from benchmarks.tables import show
from maneuver_automaton.errors import InvalidScenario

SCENARIOS = DATA / "commonroad/scenarios"
CHECKS = ("goal", "start", "traffic", "boundary", "feasible", "valid")
HEAD = ("scenario", "kind", "ours", "step [s]", "states", *CHECKS)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenarios", type=Path, default=SCENARIOS)
    parser.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "solutions")
    arguments = parser.parse_args()
    if arguments.scenarios == SCENARIOS and not present("commonroad/scenarios"):
        return
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    rows, said = [], []
    for file in sorted(arguments.scenarios.glob("*.xml")):
        try:
            road = ma.load_scenario(file)
        except InvalidScenario as error:
            said.append(str(error))
            continue
        assert isinstance(road, ma.RoadScenario)
        drive = ma.drive_road(road.scene, road.vehicle)
        plan = ma.plan_road(road.scene, road.vehicle)
        found: list[tuple[str, Any, str]] = [("drive", drive, drive.status)]
        if plan.plan is not None:
            found.append(("plan", plan, "found"))
        for kind, value, ours in found:
            solution = arguments.out / f"{file.stem}_{kind}.xml"
            ma.save_commonroad_solution(value, solution)
            verdict, states, step = checked(file, solution)
            rows.append([road.name, kind, ours, step, states, *(verdict[k] for k in CHECKS)])
    show(HEAD, rows)
    passed = Counter(kind for _, kind, *_, valid in rows if valid == "passes")
    print(
        ", ".join(f"{n} of {sum(r[1] == k for r in rows)} {k}s" for k, n in passed.items()), "pass"
    )
    for line in said:
        print(line)


def checked(scenario: Path, solution: Path) -> tuple[dict[str, str], int, float]:
    """What the official checks say of a solution file, its states, and the time step [s]."""
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.solution import CommonRoadSolutionReader
    from commonroad_dc.feasibility import solution_checker

    world, problems = CommonRoadFileReader(str(scenario)).open()
    answer = CommonRoadSolutionReader.open(str(solution))
    judges = solution_checker
    checks = {
        "goal": lambda: judges.goal_reached(world, problems, answer),
        "start": lambda: judges.starts_at_correct_state(answer, problems),
        "traffic": lambda: not judges.obstacle_collision(world, problems, answer),
        "boundary": lambda: not judges.boundary_collision(world, problems, answer),
        "feasible": lambda: all(
            one[0] for one in judges.solution_feasible(answer, world.dt, problems).values()
        ),
        "valid": lambda: judges.valid_solution(world, problems, answer)[0],
    }
    verdict = {}
    for name, check in checks.items():
        try:
            verdict[name] = "passes" if check() else "fails"
        except judges.SolutionCheckerException:
            verdict[name] = "fails"
    (one,) = answer.planning_problem_solutions
    return verdict, len(one.trajectory.state_list), world.dt


if __name__ == "__main__":
    main()
