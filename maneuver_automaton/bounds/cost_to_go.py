"""A function that was proven for one start, used again for others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.bounds.cells import Cells
from maneuver_automaton.collision.world import World
from maneuver_automaton.problem import Goal


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CostToGo:
    """What plans cost at least from poses of some cells to the goals: costs are lower bounds.

    A plan that stays in the cells costs at least what the
    value falls by; one that leaves them has to leave them somewhere, at a cost of its own.
    """

    world: World  # in whose frame the cells are counted
    cells: Cells
    value: Array  # (gears, nodes), falls along no motion faster than the cost rises
    at_goal: float  # greatest value at a goal
    start: Array  # (3,) the pose it was proven for, in that frame
    least: float  # cost of any plan from there
    limit: float  # cost of any plan from there that leaves the cells
    goals: tuple[Goal, ...]  # in that frame
    speed: float  # greatest distance for a unit of cost [m]
    priced: bool  # whether changes between forward and reverse cost something
    whole: bool  # whether the cells are all that may be free in a rectangle

    def after(self, pose: Array, driven: float) -> float:
        """Bound from a pose (3,) that was reached from the one it was proven for at a cost.

        The way to there and a plan from there make one plan together, unless changes of direction
        are priced: there may be one between them.
        """
        inside = self._inside(self.world.into(pose))
        return max(self.least - driven, min(inside, self.limit - driven))

    def anywhere(self, pose: Array) -> float:
        """Bound from any pose (3,), 0 if nothing is known of it."""
        seen = self.world.into(pose)
        if np.array_equal(seen, self.start):
            return self.after(pose, 0.0)
        return min(self._inside(seen), self._outside(seen)) if self.whole else 0.0

    def _inside(self, pose: Array) -> float:
        """Cost of plans that stay in the cells, at least; 0 outside of them."""
        at = self.cells.coordinates(pose)
        shape = np.array(self.cells.active.shape)
        cell = np.floor(at).astype(np.int64)
        if (cell < 0).any() or (cell >= shape).any() or not self.cells.active[tuple(cell)]:
            return 0.0
        return max(self.cells.value_at(self.value, at) - self.at_goal, 0.0)

    def _outside(self, pose: Array) -> float:
        """Cost of plans that leave the rectangle and come back, at least."""
        low = self.cells.low[:2] * self.cells.size
        high = low + np.array(self.cells.active.shape[:2]) * self.cells.size
        least = math.inf
        for goal in self.goals:
            for axis in (0, 1):
                across = abs(pose[1 - axis] - goal.pose[1 - axis])
                for side in (low[axis], high[axis]):
                    along = abs(pose[axis] - side) + abs(goal.pose[axis] - side)
                    least = min(least, math.hypot(along, across) - goal.tolerance_m)
        return max(least, 0.0) / self.speed
