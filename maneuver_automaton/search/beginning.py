"""The first call of the compiled search for a query: all its arguments are made once, for many.

A first plan in a room takes a few dozen expansions. To work out anew for each query what all of
them share, and of which types a hundred arrays are, takes longer than that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from maneuver_automaton._compile import bound
from maneuver_automaton._kept import kept_with
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_begin as kernels
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search.arrays import Desk, DistanceGrid, SearchArrays, Task
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.distance_grid import laid_grid, with_cells
from maneuver_automaton.search.lattice_memory import search_arrays, with_room
from maneuver_automaton.search.lattice_pass import Pass, first_steps, first_takes
from maneuver_automaton.search.lattice_query import (
    LEAST_MARGIN,
    LatticeQuery,
    lattice_query,
    usual_margin,
)
from maneuver_automaton.search.lattice_task import (
    Resolution,
    back_off_of,
    first_resolutions,
    numbers_of_cells,
    task_of,
)
from maneuver_automaton.search.lattice_worlds import CLEARLY, pad_around
from maneuver_automaton.search.prepared import Prepared
from maneuver_automaton.search.scene import Scene

SPARE = 1.5  # times the cells of the first query, of which there is memory
MOST_CELLS = 1 << 18  # of which there is memory: on larger maps nobody waits for the begin


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bench:
    """The arguments of the first call, for queries of one setting and of the same kinds of ends."""

    desk: Desk
    call: Callable[[], int]
    search: SearchArrays
    task: Task
    scene: Scene
    grid: DistanceGrid
    resolution: Resolution
    steps: int  # expansions of a first call
    takes: float  # [s] about, the first of them


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Begun:
    """A query whose first expansions are done; its ends are clearly free."""

    bench: Bench
    may_go_on: bool

    @property
    def is_found(self) -> bool:
        """Whether a connection was found."""
        return bool(self.bench.search.state[layout.FOUND])

    def search_of(self, query: LatticeQuery) -> Pass:
        """The search that was begun, ready to go on."""
        bench, task, scene, grid = self.bench, self.bench.task, self.bench.scene, self.bench.grid
        if not self.is_found:
            task, scene = task_of(query, bench.resolution), query.scene()
            coarse = bench.resolution.coarse
            grid = laid_grid(query.plane, query.box, query.start, coarse=coarse, like=grid)
        return Pass(
            query=query,
            resolution=bench.resolution,
            task=task,
            scene=scene,
            grid=grid,
            table=NO_TABLE,
            arrays=bench.search,
            library=query.library.arrays,
            pace=Pace(UNLIMITED, steps=bench.steps),
            alive=self.may_go_on,
            untold=int(bench.search.state[layout.EXPANSIONS]),
        )


@dataclass(slots=True, eq=False)
class _Benches:
    """Those that nobody uses now."""

    free: list[Bench] = field(default_factory=list)
    is_made: bool = False  # whether one was made, or found to be impossible


def _benches(problem: Problem, prepared: Prepared) -> _Benches:
    """Those for queries of the same setting and kinds of ends."""
    return kept_with(problem.setting, (problem.ends, prepared), _Benches)


def prepare_bench(problem: Problem, prepared: Prepared) -> None:
    """Have a bench ready for queries like this one, where they can begin so."""
    benches = _benches(problem, prepared)
    if not benches.is_made:
        benches.is_made = True
        bench = _bench(problem, prepared)
        if bench is not None:
            benches.free.append(bench)


def begin(problem: Problem, prepared: Prepared, budget: Budget) -> Begun | None:
    """See the ends of a query and begin its search, in one call; None where it has no bench.

    Nor is it begun where its ends are not clearly free, or where it would be late.
    """
    free = _benches(problem, prepared).free
    try:
        bench = free.pop()
    except IndexError:  # asked for before, another thread might take the last one
        return None
    if budget.left < bench.takes:
        free.append(bench)
        return None
    desk = bench.desk
    desk.poses[0] = problem.start
    for k, goal in enumerate(problem.goals):
        desk.poses[1 + k] = goal.pose
    most = problem.search.max_expansions
    desk.asked[0] = bench.steps if most is None else min(bench.steps, most)
    said = bench.call()
    if said == kernels.NOT_BEGUN:
        free.append(bench)
        return None
    return Begun(bench=bench, may_go_on=bool(said))


def end(problem: Problem, begun: Begun, prepared: Prepared) -> None:
    """Leave the bench to the next query."""
    _benches(problem, prepared).free.append(begun.bench)


def _bench(problem: Problem, prepared: Prepared) -> Bench | None:
    """A bench for queries like this one; None where its kernel does not look at all of them."""
    bounds, automaton = problem.bounds, problem.automaton
    if not automaton.is_kinematic or automaton.lattice is not None or problem.start.size != 3:
        return None
    if problem.parts or problem.moves or problem.zones or (bounds.x is None) != (bounds.y is None):
        return None
    query = lattice_query(problem, tuple(range(len(problem.goals))), prepared=prepared)
    library = query.library
    first = first_resolutions(library, query.settings)[0]
    plain = first.durations == 1.0 and query.least_coast == 0.0 and first.margin == 1.0
    if not (library.at_will and plain and query.plane.arrays.field.distance.size):
        return None
    task, scene = task_of(query, first), query.scene()
    grid = laid_grid(query.plane, query.box, query.start, coarse=first.coarse)
    cells = int(SPARE * grid.columns * grid.rows)
    if cells > MOST_CELLS:
        return None
    grid = with_cells(grid, cells)
    steps = first_steps(library.arrays, task)
    arrays = search_arrays(library.arrays.library)
    arrays = with_room(arrays, library.arrays.most_children * (steps + 1) + 2 + len(task.roots))
    desk = _desk(query, task, first)
    args = (desk, arrays, task, library.arrays, scene, grid, NO_TABLE)
    return Bench(
        desk=desk,
        call=bound(kernels.begin_search, *args),
        search=arrays,
        task=task,
        scene=scene,
        grid=grid,
        resolution=first,
        steps=steps,
        takes=first_takes(library.arrays, task),
    )


def _desk(query: LatticeQuery, task: Task, first: Resolution) -> Desk:
    """The desk of queries like this one."""
    problem, world = query.problem, query.world
    n = 1 + len(query.goals)
    to_x, to_y, turn = world.frame.tolist()
    low_x, low_y, high_x, high_y = world.box.tolist()
    (least_x, most_x), (least_y, most_y) = (
        pair or (-math.inf, math.inf) for pair in (problem.bounds.x, problem.bounds.y)
    )
    return Desk(
        poses=np.zeros((n, 3)),
        seen=np.zeros((n, 4)),
        clear=np.zeros(n),
        margin=np.zeros(1),
        window_box=query.box.copy(),
        asked=np.zeros(1, dtype=np.int64),
        frame=(to_x, to_y, turn, float(np.cos(-turn)), float(np.sin(-turn))),
        box=(low_x, low_y, high_x, high_y),
        pad=float(pad_around(world, query.library.radius)),
        bounded=problem.bounds.x is not None,
        low_x=float(least_x),
        low_y=float(least_y),
        high_x=float(most_x),
        high_y=float(most_y),
        clearly=CLEARLY,
        usual=float(usual_margin(query.library, world)),
        least=LEAST_MARGIN,
        back_off=float(back_off_of(query.library)),
        others=numbers_of_cells(query, task, first),
    )
