"""CommonRoad scenarios in closed loop at 10 Hz, judged by shapely against the recorded traffic.

``python benchmarks/commonroad_loops.py [--scenarios FOLDER] [--width N] [--wide N]``: whether
a goal can be reached at all is asked of one open-loop plan with the same automaton, `--wide` nodes
of a level at a time. Where it can and the loop alone does not reach it, a second row drives the
loop with that plan made before the start. Where it cannot, the question is asked again without
traffic, without the condition on headings, and with tyres of 11.5 m/s^2. Clearance is the least
distance to anybody, edge that to the edge of the lanelets, both by the audit; defect is the
difference from an ODE solver; cpu is the processor's time of a step, which a busy machine does not
stretch. A search proves nothing where it finds nothing.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.cases import DATA, present
from benchmarks.tables import show
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.commonroad import read_commonroad
from maneuver_automaton.roads import (
    RoadDecision,
    RoadDrive,
    RoadScene,
    RoadSettings,
    RoadVehicle,
    drive_scene,
    road_planner,
)

SCENARIOS = DATA / "commonroad/scenarios"
HEAD = (
    "scenario",
    "reachable",
    "reached",
    "at [s]",
    "steps",
    "collisions",
    "off road",
    "clearance [m]",
    "edge [m]",
    "defect",
    "median [ms]",
    "p99 [ms]",
    "cpu p99 [ms]",
)
TYRES = 11.5  # [m/s^2]
LONGEST = 30.0  # [s] of a plan made before the start


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenarios", type=Path, default=SCENARIOS)
    parser.add_argument("--width", type=int, default=RoadSettings().width)
    parser.add_argument("--wide", type=int, default=8000)
    arguments = parser.parse_args()
    if arguments.scenarios == SCENARIOS and not present("commonroad/scenarios"):
        return
    rows, wall, cpu, said = [], [], [], []
    for file in sorted(arguments.scenarios.glob("*.xml")):
        try:
            statements = read_commonroad(file)
        except InvalidScenario as error:
            said.append(str(error))
            continue
        for statement in statements:
            assert statement.road is not None
            scene = statement.road
            planner = road_planner(scene, settings=RoadSettings(width=arguments.width))
            drive = drive_scene(planner)
            plan = _plan(scene, RoadVehicle(), arguments.wide)
            rows.append(_row(scene.name, drive, reachable=plan is not None))
            if not drive.reached:
                said.append(f"{scene.name}: {drive.reason}")
            wall += [step.solve_s for step in drive.steps]
            cpu += [step.cpu_s for step in drive.steps]
            if plan is None:
                said.append(_why(scene, arguments.wide))
            elif not drive.reached:
                again = drive_scene(planner, first=plan)
                rows.append(_row("  planned before", again, reachable=True))
    show(HEAD, rows)
    for name, times in (("wall", wall), ("cpu", cpu)):
        spread = np.percentile(1e3 * np.array(times), [50, 99, 100])
        print(f"{name}: {len(times)} steps, median {spread[0]:.1f} ms, ", end="")
        print(f"p99 {spread[1]:.1f} ms, most {spread[2]:.1f} ms")
    for line in said:
        print(line)


def _row(name: str, drive: RoadDrive, *, reachable: bool) -> list[object]:
    verdict = drive.verdict
    wall, cpu = (
        1e3 * np.array(times) for times in (drive.solve_s, [step.cpu_s for step in drive.steps])
    )
    return [
        name,
        reachable,
        drive.reached,
        float(drive.driven.switching_times[-1]),
        len(drive.steps),
        verdict.collisions,
        verdict.off_road,
        verdict.clearance_m,
        verdict.edge_m,
        f"{verdict.audit.max_dynamics_defect:.0e}",
        float(np.median(wall)),
        float(np.percentile(wall, 99)),
        float(np.percentile(cpu, 99)),
    ]


def _plan(scene: RoadScene, vehicle: RoadVehicle, wide: int) -> RoadDecision | None:
    """A plan to a goal, or None if the search finds none."""
    lasting = scene.last_time - scene.start.time
    planner = road_planner(
        scene, vehicle, RoadSettings(width=wide, horizon_s=min(lasting, LONGEST))
    )
    plan = planner.search(planner.start_state, tick=0)
    return plan if plan is not None and plan.reaches else None


def _why(scene: RoadScene, wide: int) -> str:
    """Which of the conditions keep the goal out of reach, even alone on the road."""
    plain = RoadVehicle()
    model = replace(plain.model, max_acceleration=TYRES)
    wild = replace(plain, model=model, engine=TYRES, lateral=TYRES, friction=TYRES)
    alone = replace(scene, traffic=())
    free = replace(alone, goals=tuple(replace(goal, heading=None) for goal in scene.goals))
    later = tuple(replace(goal, time=(goal.time[0], goal.time[1] + 4.0)) for goal in scene.goals)
    asked = {
        "alone": (alone, plain),
        f"alone with {TYRES} m/s^2 along and across": (alone, wild),
        "alone, any heading": (free, plain),
        "with traffic, any heading": (replace(free, traffic=scene.traffic), plain),
        "alone, 4 s later": (replace(alone, goals=later), plain),
    }
    found = {what: _plan(one, vehicle, wide) is not None for what, (one, vehicle) in asked.items()}
    words = ", ".join(f"{what}: {'yes' if yes else 'no'}" for what, yes in found.items())
    return f"{scene.name} is not reached by any search; {words}"


if __name__ == "__main__":
    main()
