"""What is to be exported: a plan, a loop or a drive, in one form for every format."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.automaton.plan_arrays import PlanArrays, arrays_at, joined, step_times
from maneuver_automaton.models import Model
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.problem import Problem

if TYPE_CHECKING:
    from maneuver_automaton.receding_horizon import ClosedLoop
    from maneuver_automaton.roads import RoadDrive, RoadPlanResult, RoadScene, RoadVehicle

    Exportable: TypeAlias = (
        "Plan | PlanResult | ClosedLoop | RoadPlanResult | RoadDrive | Driven"  # what is exported
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Driven:
    """What a vehicle drives, piece after piece, and, where they are known, among what.

    Between two pieces of a closed loop a disturbance may have moved the vehicle.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> driven = driven_of(Plan([0.0, 0.0, 0.0], (ahead,), durations=[3.0]))
    >>> driven.duration, driven.end.tolist(), driven.problem
    (3.0, [3.0, 0.0, 0.0], None)
    """

    pieces: tuple[Plan, ...]  # at least one; each begins at the time at which the last one ends
    end: Array  # (dof,) pose in the end [m, m, rad(, m)]
    model: Model | None = None
    problem: Problem | None = None  # its obstacles, goals and bodies
    scene: RoadScene | None = None  # of a drive on roads
    vehicle: RoadVehicle | None = None  # that drives there
    name: str = ""
    cost: float | None = None
    reached: bool = True  # whether a goal is
    reduced_names: tuple[str, ...] = ()  # where no model says them, those of the file
    control_names: tuple[str, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "end", last=(3, 4))

    @property
    def start(self) -> Array:
        """Pose (dof,) at the beginning."""
        return self.pieces[0].start

    @property
    def start_time(self) -> float:
        """Time at the beginning [s]."""
        return self.pieces[0].start_time

    @property
    def duration(self) -> float:
        """From the beginning to the end [s]."""
        return float(_end_time(self.pieces[-1]) - self.start_time)

    def rows(self, *, step: float | None = None) -> PlanArrays:
        """One row an instant, as `Plan.as_arrays` has them; the last row is the end.

        Parameters
        ----------
        step : float, optional
            Time between rows [s]; rows are at most 0.05 m and 0.05 rad apart if left out.

        Raises
        ------
        ValueError
            If `step` is not positive, or a maneuver has no course.
        """
        times = None if step is None else step_times(self.start_time, self.duration, step)
        parts = [
            one.as_arrays(model=self.model) if times is None else self._at(one, times)
            for one in self.pieces
        ]
        moved = [one for one in parts if one.word and one.time.size]
        whole = joined(moved or parts[:1])
        pose = whole.pose.copy()
        pose[-1] = self.end
        return self._named(replace(whole, pose=pose))

    def _named(self, rows: PlanArrays) -> PlanArrays:
        """The rows with the names of a file, where no model has named what they hold."""
        if self.model is not None:
            return rows
        states, controls = rows.reduced_names, rows.control_names
        return replace(
            rows,
            reduced_names=self.reduced_names if len(self.reduced_names) == len(states) else states,
            control_names=(
                self.control_names if len(self.control_names) == len(controls) else controls
            ),
        )

    def carried(self, part: str) -> tuple[Plan, ...]:
        """The motion of a part that the vehicle carries, say its trailer, piece after piece."""
        assert self.model is not None
        return tuple(carried(one, self.model, part) for one in self.pieces)

    def _at(self, piece: Plan, times: Array) -> PlanArrays:
        """Rows of a piece at those of the times that lie within it, its end included."""
        end = _end_time(piece)
        inside = times[(times >= piece.start_time) & (times < end)]
        return arrays_at(piece, np.append(inside, end), model=self.model)


def driven_of(value: Exportable, *, model: Model | None = None) -> Driven:
    """What is to be exported of a plan, a result, a closed loop, or a plan or drive on roads.

    The vehicle's `model` is for a Plan, which does not know it; all others bring it along.

    Raises
    ------
    ValueError
        If there is no plan in it.
    TypeError
        If it is none of these.
    """
    if isinstance(value, Driven):
        return value
    if isinstance(value, Plan):
        return Driven(pieces=(value,), end=value.end, model=model)
    if isinstance(value, PlanResult):
        plan, problem = _plan_in(value), value.problem
        return Driven(
            pieces=(plan,),
            end=plan.end,
            model=problem.automaton.model,
            problem=problem,
            cost=value.cost,
        )
    return _of_loop_or_drive(value)


def _of_loop_or_drive(value: Any) -> Driven:
    from maneuver_automaton.receding_horizon import ClosedLoop
    from maneuver_automaton.roads import RoadDrive, RoadPlanResult

    if isinstance(value, ClosedLoop):
        problem, start = value.problem, value.poses[0]
        still = Plan(start, (), durations=[], start_time=float(value.times[0]))
        return Driven(
            pieces=value.driven or (still,),
            end=value.poses[-1],
            model=problem.automaton.model,
            problem=problem,
            cost=value.cost,
            reached=value.reached,
        )
    if isinstance(value, RoadPlanResult | RoadDrive):
        if isinstance(value, RoadDrive):
            plan, cost, reached = value.driven, None, value.reached
        else:
            plan, cost, reached = _plan_in(value), value.cost, True
        return driven_on_road(
            value.planner.scene, value.planner.vehicle, plan, cost=cost, reached=reached
        )
    raise TypeError(
        f"export: got {type(value).__name__}, need a Plan, PlanResult, ClosedLoop, RoadPlanResult "
        "or RoadDrive"
    )


def driven_on_road(
    scene: RoadScene,
    vehicle: RoadVehicle,
    plan: Plan,
    *,
    cost: float | None = None,
    reached: bool = True,
) -> Driven:
    """A plan of the rear axle, in the coordinates and on the clock of a scene."""
    return Driven(
        pieces=(plan,),
        end=plan.end,
        model=vehicle.model,
        scene=scene,
        vehicle=vehicle,
        name=scene.name,
        cost=cost,
        reached=reached,
    )


def _plan_in(value: PlanResult | RoadPlanResult) -> Plan:
    if value.plan is None:
        raise ValueError(f"the result has no plan to write: {value.reason}")
    return value.plan


def _end_time(plan: Plan) -> float:
    return float(plan.start_time + plan.duration)
