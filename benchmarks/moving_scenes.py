"""Closed loops among twelve moving obstacles, judged by an exhaustive search in space and time.

``python benchmarks/moving_scenes.py [--scenes N] [--step S] [--time-limit S] [--cell M]``:
the judge asks whether, from the start, waiting or evading was possible at all: a robot on a grid
(places, eight headings, time) that rests, spins or drives, kept 1 cm clear, until the goal is
reached or the time is up. Where it was, the loop must not collide; the rest is named.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks.tables import show, spread
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import ClosedLoop
from tests.scenes import moving_scene
from tests.solids import World, driven

HORIZON = 60.0  # [s]
KEPT = 0.01  # [m] the judge's robot keeps from everything
CHECK_M = 0.01  # between poses at which a driven loop is checked


class MovingObstacles(NamedTuple):
    """Shapes with a motion each: discs have a radius and no size."""

    half: np.ndarray  # (n, 2) [m] half the size of a box
    radius: np.ndarray  # (n,) [m]
    knots: np.ndarray  # (n,) number of poses
    time: np.ndarray  # (n, k) [s]
    pose: np.ndarray  # (n, k, 3) of the middle [m, m, rad]


def moving_obstacles(problem: Problem) -> MovingObstacles:
    """All obstacles of a problem, those that stand still as motions of one pose."""
    obstacles = [o for o in problem.obstacles if isinstance(o, Obstacle)]
    knots = [1 if o.motion is None else o.motion.time.size for o in obstacles]
    n, k = len(obstacles), max(knots)
    found = MovingObstacles(np.zeros((n, 2)), np.zeros(n), np.array(knots), np.zeros((n, k)),
                   np.zeros((n, k, 3)))  # fmt: skip
    for row, obstacle in enumerate(obstacles):
        shape = obstacle.shape
        if isinstance(shape, Disc):
            found.radius[row] = shape.radius
        else:
            found.half[row] = 0.5 * shape.size
        if obstacle.motion is None:
            heading = 0.0 if isinstance(shape, Disc) else shape.heading
            found.pose[row, 0] = [*shape.center, heading]
        else:
            found.time[row, : knots[row]] = obstacle.motion.time
            found.pose[row, : knots[row]] = obstacle.motion.pose
    return found


def escape_possible(problem: Problem, *, cell: float, horizon: float = HORIZON) -> bool:
    """Whether a robot on the grid stays clear until it is at the goal, or the time is up."""
    speed, turn = (float(np.abs(problem.automaton.body_velocities[:, k]).max()) for k in (0, 2))
    sides = [problem.bounds.x, problem.bounds.y]
    low = np.array([side[0] for side in sides])
    counts = [round((side[1] - side[0]) / cell) + 1 for side in sides]
    tick = cell / speed
    eighth = math.pi / 4
    spin_ticks = math.ceil(eighth / turn / tick)
    column, row = np.round((problem.start[:2] - low) / cell).astype(int).tolist()
    goal = np.round((problem.goals[0].pose[:2] - low) / cell).astype(np.int64)
    heading = round(problem.start[2] / eighth)
    turning = math.ceil(abs(problem.start[2] - heading * eighth) / turn / tick)
    begin = (heading % 8, column, row, turning)
    robot = problem.footprint[0].radius + KEPT
    return bool(
        _survives(
            moving_obstacles(problem), low, cell, counts[0], counts[1], begin, goal, robot, tick,
            spin_ticks, math.ceil(horizon / tick),
        )
    )  # fmt: skip


@kernel
def _survives(moving, low, cell, columns, rows, begin, goal, robot, tick, spin_ticks, ticks):
    """Layer by layer in time: which (heading, column, row) can be occupied without contact.

    `begin` is heading, column, row, and the ticks it takes to turn to that heading. A spin by an
    eighth takes `spin_ticks`; a diagonal step is given two ticks, more than it needs. Layers are
    reused, one more than the longest move.
    """
    layers = max(2, spin_ticks) + 1
    alive = np.zeros((layers, 8, columns, rows), dtype=np.bool_)
    free = np.zeros((layers, columns, rows), dtype=np.bool_)
    wide = np.zeros((layers, columns, rows), dtype=np.bool_)  # so clear that no step can touch
    # robot and obstacle come closer by this in two ticks, the obstacle 1.5 times as fast
    slack = 5.0 * cell
    for layer in range(layers):
        _mark_clear(free[layer], moving, low, cell, robot, layer * tick)
        _mark_clear(wide[layer], moving, low, cell, robot + slack, layer * tick)
    heading, column, row, turning = begin
    for layer in range(turning + 1):
        if not free[layer, column, row]:
            return False
    alive[turning, heading, column, row] = True
    count = len(moving.radius)
    at = np.empty(
        (2, 3, count, 3)
    )  # poses of the obstacles at the quarters of one and of two ticks
    for now in range(ticks):
        here = now % layers
        for took in range(1, 3):
            for quarter in range(3):
                for m in range(count):
                    later = (now + 0.25 * (quarter + 1) * took) * tick
                    _pose_at(moving, m, later, at[took - 1, quarter, m])
        for h in range(8):
            dx, dy = round(math.cos(h * math.pi / 4)), round(math.sin(h * math.pi / 4))
            took = 2 if dx != 0 and dy != 0 else 1
            after, arrive = (now + 1) % layers, (now + took) % layers
            turned = (now + spin_ticks) % layers
            for i in range(columns):
                for j in range(rows):
                    if not alive[here, h, i, j]:
                        continue
                    if i == goal[0] and j == goal[1]:
                        return True
                    alive[after, h, i, j] |= free[after, i, j]
                    stays = True
                    for k in range(1, spin_ticks + 1):
                        stays = stays and free[(now + k) % layers, i, j]
                    if stays:
                        alive[turned, (h + 1) % 8, i, j] = True
                        alive[turned, (h + 7) % 8, i, j] = True
                    for sign in (1, -1):
                        p, q = i + sign * dx, j + sign * dy
                        if not (0 <= p < columns and 0 <= q < rows and free[arrive, p, q]):
                            continue
                        if alive[arrive, h, p, q]:
                            continue
                        alive[arrive, h, p, q] = wide[here, i, j] or _step_free(
                            moving, low, cell, robot, i, j, p, q, at[took - 1]
                        )
        alive[here] = False
        if not alive.any():
            return False
        again = (now + layers) * tick
        _mark_clear(free[here], moving, low, cell, robot, again)
        _mark_clear(wide[here], moving, low, cell, robot + slack, again)
    return True


@inner_kernel
def _mark_clear(clear, moving, low, cell, kept, time):
    """Mark the cells further than `kept` from all moving obstacles at a time."""
    columns, rows = clear.shape
    clear[:] = True
    at = np.empty(3)
    for m in range(len(moving.radius)):
        _pose_at(moving, m, time, at)
        reach = kept + moving.radius[m] + math.hypot(moving.half[m, 0], moving.half[m, 1])
        first_i = max(0, math.floor((at[0] - reach - low[0]) / cell))
        last_i = min(columns - 1, math.ceil((at[0] + reach - low[0]) / cell))
        first_j = max(0, math.floor((at[1] - reach - low[1]) / cell))
        last_j = min(rows - 1, math.ceil((at[1] + reach - low[1]) / cell))
        for i in range(first_i, last_i + 1):
            for j in range(first_j, last_j + 1):
                if _distance(moving, m, at, low[0] + i * cell, low[1] + j * cell) <= kept:
                    clear[i, j] = False


@inner_kernel
def _step_free(moving, low, cell, robot, i, j, p, q, at):
    """Whether a step from (i, j) to (p, q) is clear at its quarters; the ends are known."""
    for quarter in range(3):
        share = 0.25 * (quarter + 1)
        x = low[0] + (i + share * (p - i)) * cell
        y = low[1] + (j + share * (q - j)) * cell
        for m in range(len(moving.radius)):
            if _distance(moving, m, at[quarter, m], x, y) <= robot:
                return False
    return True


@inner_kernel
def _pose_at(moving, m, time, at):
    """Pose of moving obstacle `m` at a time, linear between its knots, still before and after."""
    last = moving.knots[m] - 1
    k = 0
    while k < last and moving.time[m, k + 1] < time:
        k += 1
    share = 0.0
    if k < last:
        share = (time - moving.time[m, k]) / (moving.time[m, k + 1] - moving.time[m, k])
        share = min(max(share, 0.0), 1.0)
    for axis in range(3):
        after = moving.pose[m, min(k + 1, last), axis]
        at[axis] = moving.pose[m, k, axis] + share * (after - moving.pose[m, k, axis])


@inner_kernel
def _distance(moving, m, at, x, y):
    """Distance from a point to moving obstacle `m` at a pose, 0 inside a box."""
    dx, dy = x - at[0], y - at[1]
    cos, sin = math.cos(at[2]), math.sin(at[2])
    along = max(abs(cos * dx + sin * dy) - moving.half[m, 0], 0.0)
    across = max(abs(cos * dy - sin * dx) - moving.half[m, 1], 0.0)
    return math.hypot(along, across) - moving.radius[m]


def close_loop(problem: Problem, *, step: float, time_limit: float) -> ClosedLoop:
    """The loop until the goal, or until the horizon is spent."""
    steps = math.ceil(HORIZON / step)
    return ma.simulate(problem, step=step, steps=steps, time_limit=time_limit)


def least_clearance(problem: Problem, loop: ClosedLoop) -> tuple[float, float]:
    """Least distance [m] of the robot from everything, and when [s].

    As it drove; and as it stands until the horizon, where the loop ended away from the goal.
    """
    world = World(problem)
    pieces = [driven(piece, world.origin, step_m=CHECK_M, step_rad=CHECK_M)
              for piece in loop.driven]  # fmt: skip
    if not loop.reached:
        times = np.arange(loop.times[-1], HORIZON, CHECK_M)
        stands = loop.poses[-1] - np.append(world.origin, 0.0)
        pieces.append((times, np.repeat(stands[None], len(times), axis=0)))
    least, when = math.inf, 0.0
    for times, poses in pieces:
        clearances = world.clearance(poses, times)
        if clearances.min(initial=math.inf) < least:
            least, when = float(clearances.min()), float(times[clearances.argmin()])
    return least, when


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--step", type=float, default=0.5, help="[s] between decisions")
    parser.add_argument("--time-limit", type=float, default=0.1, help="[s] of one step")
    parser.add_argument("--cell", type=float, default=0.1, help="[m] of the judge's grid")
    options = parser.parse_args()
    counts = {(escape, hit): 0 for escape in (True, False) for hit in (True, False)}
    reached, solves, clearances, notes, judging = 0, [], [], [], 0.0
    decisions: Counter[str] = Counter()
    for seed in range(options.first, options.first + options.scenes):
        problem = moving_scene(seed)
        began = time.perf_counter()
        escape = escape_possible(problem, cell=options.cell)
        judging += time.perf_counter() - began
        loop = close_loop(problem, step=options.step, time_limit=options.time_limit)
        clearance, when = least_clearance(problem, loop)
        hit = clearance <= 0.0
        counts[escape, hit] += 1
        reached += loop.reached
        decisions.update(step.decision.value for step in loop.steps)
        clearances.append(clearance)
        solves += (1e3 * loop.solve_s).tolist()
        if hit or not escape or not loop.reached:
            notes.append(f"scene {seed}: clearance {clearance:.3f} m at {when:.2f} s, "
                         f"{loop.status} {loop.reason}"
                         f"{'' if escape else '; the judge sees no escape'}")  # fmt: skip
    show(["escape was possible", "without collision", "with collision"],
         [["yes", counts[True, False], counts[True, True]],
          ["not seen", counts[False, False], counts[False, True]]])  # fmt: skip
    print(f"goal reached: {reached} of {options.scenes}; steps [ms]: {spread(solves)}")
    print(
        "what the steps did: "
        + ", ".join(f"{n} {decision}" for decision, n in decisions.most_common())
    )
    print(f"least clearance [m]: {min(clearances):.3f}; judging a scene: "
          f"{judging / options.scenes:.2f} s")  # fmt: skip
    for note in notes:
        print(note)


if __name__ == "__main__":
    main()
