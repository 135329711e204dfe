"""Solution files of CommonRoad, written by commonroad-io.

The states are those of the kinematic single-track model (KS): the middle of the vehicle, steering
angle, speed, heading, at the time step of the scenario. A drive's equations are the same, so what
is written is what was driven, to the last digit; `commonroad-drivability-checker` finds the inputs
between two states again.

Source: Althoff, Koschi, Manzinger (2017), *CommonRoad: Composable Benchmarks for Motion Planning on
Roads*; Althoff, Würsching (2020), *CommonRoad: Vehicle Models*, section 5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.recording import Mover, recording_to_write

COST_FUNCTION = "SA1"
SAME_M = 1e-3  # [m] between our vehicle and one of CommonRoad's
ON_STEP = 1e-6  # of a time step, between a time and the next step


def save_commonroad_solution(
    value: Any, path: Path | str, *, cost_function: str = COST_FUNCTION
) -> None:
    """Write a plan or a drive on a CommonRoad scenario as a solution file (XML).

    Of several vehicles it holds a solution of each planning problem.

    The vehicle must be one of CommonRoad's: the default one is its BMW 320i, number 2.

    Parameters
    ----------
    value : RoadPlanResult, RoadDrive, RoadFleetResult, RoadFleetDrive, or a Recording of one
        On scenes that were read from a file of CommonRoad.
    path : Path or str
        The file.
    cost_function : str
        What CommonRoad prices the solution by: JB1, SA1, WX1, SM1, SM2, SM3, MW1, TR1 or TR2.

    Raises
    ------
    MissingExtra
        If commonroad-io is not installed.
    ValueError
        If it is no drive on a CommonRoad scenario, a result has no plan, the vehicle is none of
        CommonRoad's, or the cost function is unknown.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> try:
    ...     save_commonroad_solution(Plan([0, 0, 0], (), durations=[]), "solution.xml")
    ... except ValueError as error:
    ...     print(str(error).split(",")[0])
    CommonRoad solution: got no drive on a CommonRoad scenario
    """
    movers = recording_to_write(value).drivers
    if any(one.road is None or one.road.scene.benchmark is None for one in movers):
        raise ValueError(
            "CommonRoad solution: got no drive on a CommonRoad scenario, need a plan or drive of "
            "its XML file"
        )
    write_text_atomically(Path(path), _text(movers, cost_function))


def _text(movers: Sequence[Mover], cost_function: str) -> str:
    try:
        from commonroad.common import solution
        from commonroad.scenario.scenario import ScenarioID
    except ImportError as error:
        raise MissingExtra(
            "CommonRoad solution: commonroad-io is not installed; need pip install "
            "'maneuver-automaton[commonroad]'"
        ) from error
    known = [one.name for one in solution.CostFunction]
    if cost_function not in known:
        raise ValueError(f"cost_function: got {cost_function!r}, need one of {', '.join(known)}")
    answers = [_answer(one, solution, cost_function) for one in movers]
    benchmark = movers[0].road.scene.benchmark
    try:
        name = ScenarioID.from_benchmark_id(benchmark.scenario, benchmark.version)
    except ValueError as error:
        raise ValueError(
            f"CommonRoad solution: the scenario is named {benchmark.scenario!r}, need a benchmark's"
            f" name such as DEU_Ffb-1_6_T-1: {error}"
        ) from error
    whole = solution.Solution(scenario_id=name, planning_problem_solutions=answers, date=None)
    return str(solution.CommonRoadSolutionWriter(whole).dump())


def _answer(mover: Mover, solution: Any, cost_function: str) -> Any:
    from commonroad.scenario.state import KSState
    from commonroad.scenario.trajectory import Trajectory

    first, states = _states(mover)
    trajectory = Trajectory(
        initial_time_step=first,
        state_list=[
            KSState(
                time_step=first + k,
                position=np.array([x, y]),
                orientation=heading,
                velocity=speed,
                steering_angle=steering,
            )
            for k, (x, y, heading, speed, steering) in enumerate(states.tolist())
        ],
    )
    return solution.PlanningProblemSolution(
        planning_problem_id=mover.road.scene.benchmark.problem,
        vehicle_model=solution.VehicleModel.KS,
        vehicle_type=_vehicle_type(mover.road.vehicle, solution.vehicle_parameters),
        cost_function=solution.CostFunction[cost_function],
        trajectory=trajectory,
    )


def _states(mover: Mover) -> tuple[int, Array]:
    """Number of the first time step, and from there x, y, heading, speed, steering (n, 5)."""
    scene, vehicle, step = mover.road.scene, mover.road.vehicle, mover.road.scene.step
    first = mover.start_time / step
    if abs(first - round(first)) > ON_STEP:
        raise ValueError(
            f"CommonRoad solution: the drive starts at {mover.start_time:g} s, need a multiple of "
            f"the scenario's time step of {step:g} s"
        )
    whole = math.floor(mover.duration / step + ON_STEP)
    rows = mover.rows(step=step)
    states = np.column_stack([vehicle.middle_of(rows.pose), rows.reduced_state])
    states, time = states[: whole + 1], mover.start_time + step * whole
    # Goals are met but for rounding, and the checker compares exactly: a stop is at a speed of 0.
    for goal in scene.goals:
        if goal.speed is not None and goal.contains(states[-1, :3], speed=states[-1, 3], time=time):
            states[-1, 3] = np.clip(states[-1, 3], *goal.speed)
    return round(first), states


def _vehicle_type(vehicle: Any, known: Any) -> Any:
    """The one of CommonRoad's vehicles that has our wheelbase and body."""
    ours = np.array([vehicle.model.wheelbase, vehicle.ahead, vehicle.length, vehicle.width])
    for kind, theirs in known.items():
        stated = np.array([theirs.a + theirs.b, theirs.b, theirs.l, theirs.w])
        if np.abs(stated - ours).max() <= SAME_M:
            return kind
    raise ValueError(
        f"CommonRoad solution: the vehicle has a wheelbase of {ours[0]:g} m and a body of "
        f"{ours[2]:g} m x {ours[3]:g} m, its middle {ours[1]:g} m before the rear axle; need that "
        f"of {', '.join(kind.name for kind in known)}"
    )
