"""A proven lower bound over levels of cells, from coarse to fine, in the tube of cheaper plans.

A plan that costs less than the incumbent visits only cells through which such a plan could lead:
what it costs at least to get there and to go on from there is known from coarser levels. All other
cells are left out, and what is proven on the rest holds for plans cheaper than the incumbent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.bounds import _kernels_certificate
from maneuver_automaton.bounds._kernels_dual import LANES
from maneuver_automaton.bounds.cells import (
    CostToGo,
    Index,
    PoseCells,
    PoseScene,
    connected,
    finer,
    first_cells,
    on_finer,
    pose_scene,
)
from maneuver_automaton.bounds.families import Motions, motions_of
from maneuver_automaton.bounds.program import BoundProgram, program_of, raised, slope
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.distance_grid import OCTILE

HEADINGS = 32  # of the coarsest level
MOST_FIRST = 300_000  # cells of the coarsest level
MOST_CELLS = 3_000_000  # of any level
BLOCK = 100  # steps between two looks at what is proven
CHUNK = 1 << 25  # dual values that steps change between two looks at the clock: some 25 ms
STEPS = (2500, 3000, 5000)  # on each level at most; the last holds for all that follow
STALLED = 2e-3  # relative gain in PATIENCE blocks below which a level has given what it can
PATIENCE = 10
POLISHING = 250  # sweeps that raise what is proven
SWEEPS = 100  # that raise the bounds of cells from the start and to the goal
WEIGHT = 8.0  # of the first level: values against dual values, in lengths of a plan in cells


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """What is proven by now."""

    value: float  # no plan is cheaper
    optimal: bool  # whether the incumbent is: no cheaper plan is left
    cells: int  # of the level
    size: float  # [m] of its cells
    work: int  # steps times cells, of all levels
    function: CostToGo | None = None  # that proves it, at the end of a level


@dataclass(slots=True, eq=False, kw_only=True)
class _Level:
    """One level, and bounds of its cells that are known by then."""

    cells: PoseCells
    from_start: Array  # (gears, nodes), admissible, backward
    to_goal: Array  # (gears, nodes), admissible
    guess: Array  # (gears, nodes), whatever it is
    dual: NDArray[np.float32] | None
    weight: float


def proofs(
    scene: PoseScene,
    motions: Motions,
    *,
    start: Array,
    goals: tuple[Goal, ...],
    incumbent: Callable[[], float],
    cap: float,
    ends: Callable[[int], bool],
    over: Callable[[], bool],
) -> Iterator[Proof]:
    """Better and better bounds; `incumbent` is asked for the cost of the best plan at each level.

    Where `ends` says so of the work done, a level is left, and what it has is polished until it is
    `over`. Poses are seen from the scene's frame, in which the first goal is the origin. Plans that
    cost more than `cap` are left out, so no bound exceeds it; `cap` and what the incumbent costs
    are without what every plan costs besides.
    """
    limit = min(cap, incumbent())
    gears = 2 if motions.price > 0.0 else 1
    cells: PoseCells | None = _coarsest(scene, motions, start, goals, limit, over)
    level: _Level | None = None
    best, work, depth, reach = 0.0, 0, 0, limit
    function: CostToGo | None = None
    while cells is not None:
        limit = min(limit, incumbent())
        at = cells.coordinates(start)
        seeds = cells.around(at, (0.0, 0.0))
        last = _goal_cells(cells, goals)
        seen = connected(cells, seeds)
        cells.active[~seen] = 0
        total = int(seen.sum())
        if not any(seen[index] for index in last):
            function = None if function is None else replace(function, least=limit)
            yield replace(_proof(cells, limit, total, work), optimal=True, function=function)
            return
        if total > MOST_CELLS or over():
            return
        fixed = _nodes_of(cells, last, exact=_exact_node(cells, goals))
        if level is None:
            zero = np.zeros((gears, *cells.nodes))
            guess = _in_the_plane(cells, fixed, gears) / motions.speed
            weight = WEIGHT * limit * motions.speed / cells.size
            level = _Level(
                cells=cells, from_start=zero, to_goal=zero, guess=guess, dual=None, weight=weight
            )
        else:
            known = "from_start", "to_goal", "guess"
            bounds = {name: on_finer(level.cells, cells, getattr(level, name)) for name in known}
            dual = _spread(level, cells)
            level = _Level(cells=cells, dual=dual, weight=2.0 * level.weight, **bounds)
        program = program_of(cells, motions, start=start, goal_nodes=fixed, value=level.guess)
        program.weight = level.weight
        if level.dual is not None:
            program.dual[:] = level.dual
        found = level.to_goal
        most = STEPS[min(depth, len(STEPS) - 1)]
        for value, proven, steps in _solved(program, at, fixed, limit, most):
            work += steps * total
            best, found = max(best, value), proven
            yield _proof(cells, min(best, limit), total, work)
            if ends(work):
                break
        columns = program.columns
        found = raised(program, found, fixed=fixed, sweeps=POLISHING, over=over)
        found = found / max(slope(cells, columns, motions, found), 1.0)
        best = max(best, _fall(cells, found, at, fixed))
        function = CostToGo(
            world=scene.world,
            cells=cells,
            value=found,
            at_goal=float(found[:, fixed].max()),
            start=start,
            least=min(best, limit),
            limit=reach,
            goals=goals,
            speed=motions.speed,
            priced=motions.price > 0.0,
            whole=depth == 0,
        )
        yield replace(_proof(cells, min(best, limit), total, work), function=function)
        if best >= limit * (1.0 - 1e-12) or ends(work):
            return
        level.guess, level.dual = program.value.astype(float), program.dual
        level.weight = program.weight
        kept = _tube(level, program, found, at, seeds, fixed, limit, over)
        for index in (*seeds, *last):
            kept[index] = cells.active[index] > 0
        cells, reach = finer(cells, kept, scene, over), limit
        depth += 1


def _proof(cells: PoseCells, value: float, total: int, work: int) -> Proof:
    return Proof(value=value, optimal=False, cells=total, size=cells.size, work=work)


def _fall(cells: PoseCells, value: Array, at: Array, fixed: NDArray[np.bool_]) -> float:
    """How far a function falls from the start to any pose of the goal, at least."""
    return cells.value_at(value, at) - float(value[:, fixed].max())


def _solved(
    program: BoundProgram, at: Array, fixed: NDArray[np.bool_], limit: float, most: int
) -> Iterator[tuple[float, Array, int]]:
    """Values proven on a level, each with the best function by then, and the steps it took."""
    cells, motions = program.cells, program.motions
    best, found, history = 0.0, np.zeros(program.value.shape), [0.0]
    part = max(1, CHUNK // max(program.dual.size, 1))
    for done in range(BLOCK, most + 1, BLOCK):
        left = BLOCK
        while left > part:
            program.run(part)
            left -= part
            yield best, found, part
        program.run(left)
        function = program.value.astype(np.float64)
        raw = _fall(cells, function, at, fixed)
        steep = slope(cells, program.columns, motions, function)
        proven = raw / max(steep, 1e-12)
        if proven > best:
            best, found = proven, function / steep
        history.append(best)
        yield best, found, left
        if best >= limit:
            return
        if done % 300 == 0:
            program.weight *= _steered(raw, steep, limit)
        stalled = len(history) > PATIENCE and best < history[-1 - PATIENCE] * (1.0 + STALLED)
        if stalled and best > 0.97 * raw:
            return


def _steered(raw: float, steep: float, limit: float) -> float:
    """Factor of the weight of the values: the optimum is at most the incumbent."""
    if raw > 1.05 * limit:
        return 0.5
    if raw > 0.88 * limit and steep > 1.2:
        return 0.7
    if raw < 0.8 * limit and steep < 1.25:
        return 2.0
    return 1.0


def _tube(
    level: _Level,
    program: BoundProgram,
    found: Array,
    at: Array,
    seeds: list[Index],
    fixed: NDArray[np.bool_],
    limit: float,
    over: Callable[[], bool],
) -> NDArray[np.bool_]:
    """Cells that a plan cheaper than a limit may visit."""
    cells, columns = level.cells, program.columns
    level.to_goal = _lifted(program, level.to_goal, fixed, over, backward=False)
    sources = _nodes_of(cells, seeds, exact=None)
    level.from_start = _lifted(program, level.from_start, sources, over, backward=True)
    whole = cells.value_at(found, at)
    onward = np.maximum(_least(cells, columns, level.to_goal), _least(cells, columns, found))
    before = _least(cells, columns, level.from_start)
    before = np.maximum(before, _least(cells, columns, whole - found))
    return (cells.active > 0) & (np.maximum(onward, 0.0) + np.maximum(before, 0.0) < limit)


def _lifted(
    program: BoundProgram,
    value: Array,
    fixed: NDArray[np.bool_],
    over: Callable[[], bool],
    *,
    backward: bool,
) -> Array:
    """An admissible function that is zero at fixed nodes, raised."""
    cells, columns, motions = program.cells, program.columns, program.motions
    value = value.copy()
    value[:, fixed] = 0.0
    sign = -1.0 if backward else 1.0
    value /= max(slope(cells, columns, motions, sign * value), 1.0)
    value = raised(program, value, fixed=fixed, sweeps=SWEEPS, over=over, backward=backward)
    return value / max(slope(cells, columns, motions, sign * value), 1.0)


def _least(cells: PoseCells, columns: NDArray[np.int64], value: Array) -> Array:
    least = np.full(cells.active.shape, math.inf)
    _kernels_certificate.least_in_cells(np.ascontiguousarray(value), columns, least)
    return least


def _coarsest(
    scene: PoseScene,
    motions: Motions,
    start: Array,
    goals: tuple[Goal, ...],
    limit: float,
    over: Callable[[], bool],
) -> PoseCells:
    """All cells that a plan of a cost may visit."""
    length = limit * motions.speed
    low, high = np.full(2, math.inf), np.full(2, -math.inf)
    for goal in goals:
        middle = 0.5 * (start[:2] + goal.pose[:2])
        apart = float(np.linalg.norm(start[:2] - goal.pose[:2]))
        total = length + goal.tolerance_m
        beside = 0.5 * math.sqrt(max(total * total - apart * apart, 0.0))
        along = (start[:2] - goal.pose[:2]) / max(apart, 1e-12)
        half = np.hypot(0.5 * total * along, beside * along[::-1])
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
    # bounds of the place, where they lie along an axis
    for n_x, n_y, offset in scene.arrays.limits:
        for axis, n in enumerate((n_x, n_y)):
            if abs(n) > 1.0 - 1e-12:
                if n > 0.0:
                    high[axis] = min(high[axis], offset / n)
                else:
                    low[axis] = max(low[axis], offset / n)
    high = np.maximum(high, low)
    radius = motions.speed / max(motions.turn_rate, 1e-12)
    size = min(2.0 * math.pi / HEADINGS * radius, length / 8.0)
    while float(np.prod((high - low) / size + 1.0)) * HEADINGS > MOST_FIRST:
        size *= 1.25
    box = np.concatenate([low, high])
    return first_cells(scene, size=size, headings=HEADINGS, box=box, over=over)


def _goal_cells(cells: PoseCells, goals: tuple[Goal, ...]) -> list[Index]:
    """Cells that hold a pose where a plan may end."""
    found: list[Index] = []
    for goal in goals:
        at = cells.coordinates(goal.pose)
        turn = cells.headings if goal.free_heading else goal.tolerance_rad / cells.turn
        found += cells.around(at, (goal.tolerance_m / cells.size, turn))
    return sorted(set(found))


def _exact_node(cells: PoseCells, goals: tuple[Goal, ...]) -> Index | None:
    """The node that is the only goal; None if the goal is more than a node."""
    goal = goals[0]
    if len(goals) > 1 or goal.free_heading or goal.tolerance_m or goal.tolerance_rad:
        return None
    i, j, k = np.rint(cells.coordinates(goal.pose)).astype(int).tolist()
    return i, j, k


def _nodes_of(cells: PoseCells, inside: list[Index], *, exact: Index | None) -> NDArray[np.bool_]:
    """Nodes where the value is fixed: those of cells, or the one that is the goal."""
    fixed = np.zeros(cells.nodes, dtype=np.bool_)
    if exact is not None:
        fixed[exact] = True
    else:
        for i, j, k in inside:
            if cells.active[i, j, k]:
                fixed[i : i + 2, j : j + 2, k : k + 2] = True
    if cells.round_trip:
        both = fixed[..., 0] | fixed[..., -1]
        fixed[..., 0], fixed[..., -1] = both, both
    return fixed


def _in_the_plane(cells: PoseCells, fixed: NDArray[np.bool_], gears: int) -> Array:
    """Distances in the plane to the goal (gears, nodes) [m], as a first guess."""
    from scipy.sparse import coo_matrix  # not where kernels are compiled
    from scipy.sparse.csgraph import dijkstra

    passable = cells.active.any(axis=2)
    n_i, n_j, _ = cells.nodes
    number = np.arange(n_i * n_j).reshape(n_i, n_j)
    i, j = np.nonzero(passable)
    a, b, c, d = number[i, j], number[i + 1, j], number[i, j + 1], number[i + 1, j + 1]
    pairs = (a, b), (a, c), (b, d), (c, d), (a, d), (b, c)
    ends = np.concatenate([np.stack(pair) for pair in pairs], axis=1)
    ends = np.unique(np.sort(ends, axis=0), axis=1)
    across = (ends[1] - ends[0] != 1) & (ends[1] - ends[0] != n_j)
    lengths = np.where(across, math.sqrt(2.0), 1.0) * cells.size
    graph = coo_matrix((lengths, (ends[0], ends[1])), shape=(n_i * n_j, n_i * n_j)).tocsr()
    sources = number[fixed.any(axis=2)]
    found = dijkstra(graph, directed=False, indices=sources, min_only=True) / OCTILE
    found[~np.isfinite(found)] = 0.0
    return np.broadcast_to(found.reshape(1, n_i, n_j, 1), (gears, *cells.nodes)).copy()


def _spread(level: _Level, cells: PoseCells) -> NDArray[np.float32]:
    """Dual values of a level for the next one: an eighth of the parent's for every cell."""
    assert level.dual is not None
    index = np.argwhere(cells.active)
    parents = np.full(level.cells.active.shape, -1, dtype=np.int64)
    order = np.flatnonzero(level.cells.active.reshape(-1))
    parents.reshape(-1)[order] = np.arange(order.size)
    of = (index + cells.low) // 2 - level.cells.low
    if level.cells.round_trip:
        of[:, 2] %= level.cells.headings
    owner = parents[tuple(of.T)]
    blocks = -(-len(index) // LANES)
    coarse = level.dual.reshape(-(-order.size // LANES), -1, LANES)
    dual = np.zeros((blocks, coarse.shape[1], LANES), dtype=np.float32)
    number = np.arange(len(index))
    parent = coarse[owner // LANES, :, owner % LANES]
    dual[number // LANES, :, number % LANES] = parent * np.float32(0.125)
    return dual.reshape(-1)


TURNS = 1.25  # whole turns beyond the straight way, and round the obstacles, are looked at


def cell_proofs(
    problem: Problem,
    *,
    incumbent: Callable[[], float] = lambda: math.inf,
    ends: Callable[[int], bool] = lambda _work: False,
    over: Callable[[], bool] = lambda: False,
) -> Iterator[Proof]:
    """Better and better lower bounds of the cost of a problem's plans; none if it has no motions.

    Parameters
    ----------
    problem : Problem
    incumbent : callable
        Cost of the best plan known, inf if there is none. No bound exceeds it: what is proven
        concerns plans that are cheaper. Of a vehicle with inertia, costs are those of the
        kinematic one at its limits.
    ends : callable
        Asked with the work done, in steps times cells: whether to polish what there is and end.
    over : callable
        Asked now and then, while polishing too: whether to end at once.

    Yields
    ------
    Proof
        After every block of work; all but the time it takes is the same at every call.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Car, Cost, Problem
    >>> car = Car(wheelbase=2.8, max_steering=0.6)
    >>> controls = {"ahead": (1, 0), "left": (1, 0.6), "right": (1, -0.6), "back": (-1, 0)}
    >>> robot = Automaton.of_controls(car, controls)
    >>> problem = Problem(robot, [0, 0, 0], [6, 3, 0.9], cost=Cost(length=1.0))
    >>> *_, last = cell_proofs(problem, incumbent=lambda: 6.84, ends=lambda work: work > 2e6)
    >>> 6.6 < last.value < 6.84
    True
    """
    motions = motions_of(problem)
    if motions is None:
        return
    scene = pose_scene(problem, frame=problem.goals[0].pose[:3])
    start = scene.world.into(problem.start[:3])
    goals = tuple(
        replace(goal, pose=scene.world.into(goal.pose[:3]), trim=None, state=None)
        for goal in problem.goals
    )
    besides = motions.besides
    apart = min(float(np.linalg.norm(start[:2] - goal.pose[:2])) for goal in goals)
    low, high = scene.box[:2], scene.box[2:]
    size = float(np.linalg.norm(high - low)) if np.isfinite(scene.box).all() else 0.0
    round_once = TURNS * 2.0 * math.pi / max(motions.turn_rate, motions.speed / (1.0 + apart))
    for proof in proofs(
        scene,
        motions,
        start=start,
        goals=goals,
        incumbent=lambda: incumbent() - besides,
        cap=(apart + size) / motions.speed + round_once,  # of what is looked at without a plan
        ends=ends,
        over=over,
    ):
        yield replace(proof, value=proof.value + besides)
