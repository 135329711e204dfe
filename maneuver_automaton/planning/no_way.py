"""Where a search ends without a plan: the proof that there is none, or words along a free path.

Boxes of poses say whether start and goal are connected at all. If they are, the path that keeps
farthest from everything is followed: the search leads from a pose on it to one further along, as
far as it gets at once, and half as far where it gets nowhere. A vehicle that can turn and shift on
the spot by changes of direction gets along any path that has room on every side.

Source: Laumond, Jacobs, Taïx, Murray (1994), *A motion planner for nonholonomic mobile robots*.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.arrays import CostTable
from maneuver_automaton.search.distance_grid import distance_grid
from maneuver_automaton.search.lattice import FirstPlan
from maneuver_automaton.search.lattice_pass import give_back, pass_of
from maneuver_automaton.search.lattice_query import LEAST_MARGIN, LatticeQuery
from maneuver_automaton.search.lattice_task import Resolution, back_off_of
from maneuver_automaton.words.library import SWITCH

RESERVED = 0.1  # share of the time that is left for a proof where there is no plan by then
MOST_BOXES = 300_000  # of poses that are tested
SOON_BOXES = 40_000  # ... at first while a search goes on: as a few thousand expansions take
MOST_WORK = 40_000_000  # steps times cells of a proof that plans take too long
ROUNDING = 1e-6  # relative
BEYOND = 1.25  # times the longest time: plans that take longer are not looked at
FIRST_BOXES = 0.04  # [s] that the first boxes take among many obstacles, in one piece
FIRST_LOOK = 0.5  # [s] that the first look at the cells takes, the same
SWEEPS = 250  # steps over all cells that polishing takes as long as, the same
UNPROVEN = (PlanStatus.NO_PLAN, PlanStatus.OUT_OF_BUDGET)


def before_proof(budget: Budget) -> Budget:
    """The budget of a search for a first plan: the last share of the time is for the proof."""
    return budget._replace(deadline=budget.deadline - RESERVED * budget.seconds)


def with_proof(result: PlanResult, budget: Budget) -> PlanResult:
    """The result, or that no plan exists if the time that is left proves it.

    The proof does a stated amount of work: what is proven depends on no clock unless the time gets
    short. Work that nobody can stop is begun only if the time that is left is enough for it.
    """
    unproven = result.status in UNPROVEN and result.problem.obstacles
    if not unproven or budget.left < FIRST_BOXES:
        return result
    from maneuver_automaton.bounds import separation

    left = budget.left
    load_kernels("separation")  # the compiler's time is not the budget's
    proof = separation(
        result.problem, most_boxes=MOST_BOXES, deadline=Budget.from_now(left).deadline
    )
    if proof is None:
        reason = too_long(result.problem, Budget.from_now(max(budget.left, 0.0)))
        return replace(result, status=PlanStatus.UNREACHABLE, reason=reason) if reason else result
    return replace(
        result,
        status=PlanStatus.UNREACHABLE,
        reason=proof.reason,
        narrowest=proof.narrowest,
        reached=proof.reached,
    )


def free_ends(problem: Problem, budget: Budget) -> list[Array | None]:
    """For each goal a pose (3,) within its tolerance, as boxes find it in half the time left.

    None where all of them are proven to collide; NaN where neither was found.
    """
    from maneuver_automaton.bounds import free_end

    left = SHARE * budget.left
    load_kernels("separation")  # the compiler's time is not the budget's
    deadline = Budget.from_now(left).deadline
    if left < FIRST_BOXES:
        return [np.full(3, math.nan) for _ in problem.goals]
    return [
        free_end(problem, goal, most_boxes=MOST_BOXES, deadline=deadline) for goal in problem.goals
    ]


def too_long(problem: Problem, budget: Budget) -> str:
    """Why every plan takes longer than the horizon admits; empty if that is not proven."""
    horizon = problem.horizon
    longest = horizon.time or horizon.max_time
    if longest is None or budget.left < FIRST_LOOK:
        return ""
    from maneuver_automaton.planning.proving import known_bound, proofs_of

    left = budget.left
    load_kernels("cells")
    budget = Budget.from_now(left)
    timed = replace(problem, cost=Cost(time=1.0), horizon=Horizon())
    least, polishing = known_bound(timed).value, 0.0

    def ends(work: int) -> bool:
        return work >= MOST_WORK or budget.left < 2.0 * polishing

    if least <= longest:
        for proof in proofs_of(timed, incumbent=lambda: BEYOND * longest, ends=ends):
            least = max(least, proof.value)
            polishing = SWEEPS * proof.cells * budget.elapsed / max(proof.work, 1)
            if least > longest * (1.0 + ROUNDING) or budget.left < polishing:
                break
    if least <= longest * (1.0 + ROUNDING):
        return ""
    return (
        f"every plan takes at least {least:.4g} s, and the horizon admits {longest:g} s: no path "
        "that leads to the goal is short enough"
    )


WIDE = 25.0  # times the lattice's distance before contact, that the path keeps if there is room
KEPT = 0.6  # share of what the path keeps that its chords keep
PROVEN = 0.05  # share of that which words keep for certain
SHARE = 0.5  # of the time left, for a proof while a search goes on
STEP = Resolution(scale=0.24, durations=0.25, truncated=True)
EXPANSIONS = 16  # from a pose to the next, at most
AROUND = 2.0  # length scales that such a search looks around
SHORTEST = 1e-7  # share of the path below which no step is tried
FIRST_SAMPLES, MOST_SAMPLES = 16, 1 << 16  # of a chord


def along_free_path(query: LatticeQuery, table: CostTable) -> Callable[[Budget], FirstPlan] | None:
    """What follows a free path within a budget; None where the vehicle cannot follow any path.

    The answer is `exhausted` if it is proven that there is no path. Asked once more it goes on from
    where the time was over.
    """
    able = query.library.at_will and query.most_trims == 0
    if not able or query.moves or query.world.arrays.field.distance.size == 0:
        return None
    return _Following(query, table)


def proven_apart(problem: Problem, budget: Budget, times: int = 1) -> bool:
    """Whether some work proves that no path leads to a goal, for any vehicle with this body.

    It is `times` that of a short look.
    """
    if not problem.obstacles:
        return False
    from maneuver_automaton.bounds import are_apart

    left = SHARE * budget.left
    load_kernels("separation")  # the compiler's time is not the budget's
    return left > 0.0 and are_apart(
        problem, most_boxes=min(times * SOON_BOXES, MOST_BOXES), deadline=budget.clock() + left
    )


@dataclass(slots=True, eq=False)
class _Following:
    """The word along the widest path of boxes, as far as it is known."""

    query: LatticeQuery
    table: CostTable
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    goal: int = 0  # that it leads to
    apart: float = 0.0  # [m] that its chords keep
    steps: list[tuple[int, int, float]] = field(default_factory=list)
    here: float = 0.0  # [m] along the path that they lead
    at: Array = field(init=False)  # (4,) the pose there
    step: float = math.inf  # [m] to the next that is tried

    def __call__(self, budget: Budget) -> FirstPlan:
        """The whole word, or none."""
        from maneuver_automaton.bounds import Reachability, widest_path

        left, query, answer = budget.left, self.query, Reachability.CONNECTED
        load_kernels("separation")  # the compiler's time is not the budget's
        budget = budget._replace(deadline=budget.clock() + left)
        if not len(self.path):
            answer, poses, apart = widest_path(
                query.problem,
                first=WIDE * back_off_of(query.library),
                most_boxes=MOST_BOXES,
                deadline=budget.deadline,
            )
            if answer is Reachability.CONNECTED and not budget.is_over:
                self.apart, self.at = KEPT * apart, query.start
                self.path, self.goal = _path_of(query, poses, self.apart)
        word, expansions, queries = None, 0, 0
        if len(self.path):
            is_whole, expansions, queries = self._go_on(budget)
            word = query.word_of(self.steps, self.goal) if is_whole else None
        return FirstPlan(
            word=None if word is not None and word.duration > query.most_time else word,
            expansions=expansions,
            queries=queries,
            exhausted=answer is Reachability.SEPARATED,
        )

    def _go_on(self, budget: Budget) -> tuple[bool, int, int]:
        """Whether steps lead to the end of the path now; expansions, and collision queries."""
        query = self.query
        places = np.append(0.0, np.cumsum(_lengths(query, self.path)))
        scene = query.scene(max(min(query.margin, PROVEN * self.apart), LEAST_MARGIN))
        length, expansions, queries = float(places[-1]), 0, 0
        while self.here < length:
            most = EXPANSIONS if budget.expansions is None else budget.expansions - expansions
            if budget.is_over or most <= 0 or self.step < SHORTEST * length:
                return False, expansions, queries
            there = min(self.here + self.step, length)
            to = np.append([np.interp(there, places, one) for one in self.path.T], query.start[3])
            ends = np.array([self.at, to])[:, :2]
            around = AROUND * query.library.radius
            leg = replace(
                query,
                around=scene,
                start=self.at,
                goals=to[None],
                goal_trims=query.goal_trims[:1],
                free_heading=np.zeros(1, dtype=np.bool_),
                box=np.append(ends.min(axis=0) - around, ends.max(axis=0) + around),
            )
            grid = distance_grid(
                leg.plane,
                leg.box,
                leg.window,
                leg.goals,
                leg.start,
                coarse=True,
                prepared=leg.prepared,
            )
            search = pass_of(leg, STEP, grid=grid, table=self.table)
            word = search.run(min(EXPANSIONS, most), math.inf, budget=budget)
            expansions, queries = expansions + search.expansions, queries + search.queries
            give_back(leg.prepared, leg.library, search.arrays)
            if word is None:
                self.step = 0.5 * min(self.step, length - self.here)
                continue
            pairs = zip(word.trims.tolist(), word.durations.tolist(), strict=True)
            self.steps += [(SWITCH, trim, duration) for trim, duration in pairs]
            self.here, self.at, self.step = there, to, 2.0 * self.step
        return True, expansions, queries


def _path_of(query: LatticeQuery, poses: Array, apart: float) -> tuple[Array, int]:
    """Corners (n, 3) of a path with as long chords as stay `apart`, and the goal it leads to."""
    poses = query.world.into(poses)
    goal = int(np.hypot(*(query.goals[:, :2] - poses[-1, :2]).T).argmin())
    end = query.goals[goal, :3].copy()
    end[2] = poses[-1, 2] if query.free_heading[goal] else end[2]
    path = np.concatenate([query.start[None, :3], poses, end[None]])
    path[:, 2] = np.unwrap(path[:, 2])
    kept, last = [0], len(path) - 1
    while (here := kept[-1]) < last:
        step, ahead = last - here, here + 1
        while step:
            there = min(ahead + step, last)
            if there > ahead and _stays_apart(query, path[[here, there]], apart):
                ahead = there
            else:
                step //= 2
        kept.append(ahead)
    return path[kept], goal


def _stays_apart(query: LatticeQuery, chord: Array, apart: float) -> bool:
    """Whether a chord (2, 3) keeps half of `apart` [m], as samples that are dense enough show."""
    length, n = float(_lengths(query, chord)[0]), FIRST_SAMPLES
    while n <= MOST_SAMPLES:
        poses = chord[0] + np.linspace(0.0, 1.0, n)[:, None] * (chord[1] - chord[0])
        clear = clearances(query.world, poses) - query.problem.margin
        if clear.min() < apart:
            return False
        if clear.min() - 0.5 * apart >= 0.5 * length / (n - 1):
            return True
        n *= 4
    return False


def _lengths(query: LatticeQuery, path: Array) -> Array:
    """How far the body moves at most between the poses (n, 3) of a path, (n - 1,) [m]."""
    body, steps = query.world.body, np.diff(path, axis=0)
    arm = math.hypot(body.middle_x, body.middle_y) + body.reach
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]) + arm * np.abs(steps[:, 2]))
