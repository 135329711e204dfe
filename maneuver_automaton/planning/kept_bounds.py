"""What was proven of one start, kept for others: one map, many queries."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.costs import StageCost
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.prepared import RECENT

if TYPE_CHECKING:
    from maneuver_automaton.bounds import CostToGo

MOST = 4  # functions of the same goals

_Aim: TypeAlias = tuple[tuple[float, ...], float, float, bool]
_Limits: TypeAlias = tuple[tuple[float, float] | None, ...]


@dataclass(slots=True, eq=False)
class KeptBounds:
    """The last functions that were proven for the same goals, costs and body on one map."""

    functions: deque[CostToGo] = field(default_factory=lambda: deque(maxlen=MOST))

    def bound(self, problem: Problem) -> float:
        """The best bound from the start of a problem, 0 if nothing is known of it."""
        found = (one.anywhere(problem.start[:3]) for one in self.functions)
        return max(found, default=0.0)


def kept_bounds(problem: Problem, workspace: Workspace) -> KeptBounds | None:
    """Those of a planner, for the goals of a problem; None for callers that hold no planner.

    A call on its own does the same work at every call.
    """
    if workspace.prepared is RECENT:
        return None
    from maneuver_automaton.bounds.pose_scene import lasting_obstacles

    aims = tuple(
        (tuple(goal.pose[:3].tolist()), goal.tolerance_m, goal.tolerance_rad, goal.free_heading)
        for goal in problem.goals
    )
    limits = (problem.bounds.x, problem.bounds.y)
    return workspace.prepared.once(
        _kept_for,
        problem.automaton,
        problem.cost,
        aims,
        lasting_obstacles(problem),
        problem.footprint,
        problem.margin,
        limits,
        problem.horizon.time is not None,
    )


def _kept_for(
    _automaton: Automaton,
    _cost: StageCost,
    _aims: tuple[_Aim, ...],
    _obstacles: tuple[AnyObstacle, ...],
    _footprint: tuple[Shape, ...],
    _margin: float,
    _limits: _Limits,
    _timed: bool,
) -> KeptBounds:
    """A place for functions, one for all that they depend on."""
    return KeptBounds()
