"""The first call of the compiled search for a query: all its arguments are made once, for many.

A first plan in a room takes a few dozen expansions. To work out anew for each query what all of
them share, and of which types a hundred arrays are, takes longer than that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._compile import bound, called_again
from maneuver_automaton._kept import Prepared, kept_with
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.collision.world import frame_at_first
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_begin as kernels
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search._kernels_lattice import expand
from maneuver_automaton.search.arrays import FirstCallArrays, LatticeSearch, Margins
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.distance_grid import laid_grid, with_cells
from maneuver_automaton.search.lattice_pass import (
    Pass,
    first_steps,
    first_takes,
    search_arrays,
    with_room,
)
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
from maneuver_automaton.search.lattice_trims import switched_in_plane
from maneuver_automaton.search.scene import CLEARLY, pad_around

SPARE = 1.5  # times the cells of the first query, of which there is memory
MOST_CELLS = 1 << 18  # of which there is memory: on larger maps nobody waits for the begin


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FirstCall:
    """The arguments of the first call, for queries of one setting and of the same kinds of ends."""

    arrays: FirstCallArrays
    search: LatticeSearch
    query: LatticeQuery  # of which ends, window and margin are the query's own
    run: Callable[[], int]
    expand: Callable[..., int]  # that goes on: no types are looked at, which are those of `search`
    resolution: Resolution
    steps: int  # expansions
    takes: float  # [s] about, the first of them


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Begun:
    """A query whose first expansions are done; its ends are clearly free."""

    call: FirstCall
    free: list[FirstCall]  # where it is left for the next query
    may_go_on: bool

    @property
    def is_found(self) -> bool:
        """Whether a connection was found."""
        return bool(self.call.search.arrays.state[layout.FOUND])

    def query_of(self, problem: Problem) -> LatticeQuery:
        """What `lattice_query` makes of it, with all of its goals."""
        call, known, seen = self.call.arrays, self.call.query, self.call.arrays.seen.copy()
        edges, margin = known.around.edge_window.copy(), float(call.margin[0])
        return replace(
            known,
            problem=problem,
            around=known.around._replace(
                margin=margin, window=known.window.copy(), edge_window=edges
            ),
            start=seen[0],
            goals=seen[1:],
            goal_poses=call.poses[1:].copy(),
            box=call.window_box.copy(),
        )

    def search_of(self, query: LatticeQuery) -> Pass:
        """The search that was begun, ready to go on."""
        call, search = self.call, self.call.search
        if not self.is_found:
            laid = query.plane, query.box, query.window, query.start
            grid = laid_grid(*laid, coarse=call.resolution.coarse, like=search.grid)
            task = task_of(query, call.resolution)
            search = search._replace(task=task, scene=query.scene(), grid=grid)
        return Pass(
            query=query,
            resolution=call.resolution,
            search=search._replace(library=query.library.arrays),
            pace=Pace(UNLIMITED, steps=call.steps),
            alive=self.may_go_on,
            begun_with=int(search.arrays.state[layout.EXPANSIONS]),
            expand=call.expand,
        )


@dataclass(slots=True, eq=False)
class _FirstCalls:
    """Those that nobody uses now."""

    free: list[FirstCall] = field(default_factory=list)
    is_made: bool = False  # whether one was made, or found to be impossible


def _first_calls(problem: Problem, prepared: Prepared) -> _FirstCalls:
    """Those for queries of the same setting and kinds of ends."""
    return kept_with(problem.setting, (problem.ends, prepared), _FirstCalls)


def prepare_first_call(problem: Problem, prepared: Prepared) -> None:
    """Have the first call ready for queries like this one, where they can begin so."""
    calls = _first_calls(problem, prepared)
    if not calls.is_made:
        calls.is_made = True
        call = _first_call(problem, prepared)
        if call is not None:
            calls.free.append(call)


def begin(problem: Problem, prepared: Prepared, budget: Budget) -> Begun | None:
    """See the ends of a query and begin its search, in one call; None where none is ready.

    Nor is it begun where its ends are not clearly free, or where it would be late.
    """
    free = _first_calls(problem, prepared).free
    try:
        call = free.pop()
    except IndexError:  # asked for before, another thread might take the last one
        return None
    if budget.left < call.takes:
        free.append(call)
        return None
    arrays, most = call.arrays, problem.search.max_expansions
    arrays.poses[0] = problem.start
    for k, goal in enumerate(problem.goals):
        arrays.poses[1 + k] = goal.pose
    arrays.asked[0] = call.steps if most is None else min(call.steps, most)
    said = call.run()
    if said == kernels.NOT_BEGUN:
        free.append(call)
        return None
    return Begun(call=call, free=free, may_go_on=bool(said))


def _first_call(problem: Problem, prepared: Prepared) -> FirstCall | None:
    """The call of queries like this one; None where its kernel does not look at all of them."""
    bounds, automaton = problem.bounds, problem.automaton
    if not switched_in_plane(automaton) or automaton.lattice is not None:
        return None
    if problem.parts or problem.moves or problem.zones or (bounds.x is None) != (bounds.y is None):
        return None
    if not frame_at_first(problem.obstacles):
        return None  # the world is seen from the goal, and from another one in the next query
    query = lattice_query(problem, tuple(range(len(problem.goals))), prepared=prepared)
    library, world = query.library, query.world
    first = first_resolutions(library, query.problem.search)[0]
    if query.around.place.value.size and bounds.x is None:
        return None  # what places cost is known in the window of one query alone
    plain = first.durations == 1.0 and query.least_coast == 0.0 and first.margin == 1.0
    if not (plain and query.plane.arrays.field.distance.size):
        return None
    task = task_of(query, first)
    grid = laid_grid(query.plane, query.box, query.window, query.start, coarse=first.coarse)
    cells = int(SPARE * grid.layout.columns * grid.layout.rows)
    if cells > MOST_CELLS:
        return None
    steps = first_steps(library.arrays, task)
    most = library.arrays.most_children * (steps + 1) + 2 + len(task.roots.poses)
    search = LatticeSearch(
        arrays=with_room(search_arrays(library.arrays.library), most),
        task=task,
        library=library.arrays,
        scene=query.scene(),
        grid=with_cells(grid, cells)._replace(prices=query.least_prices(grid)),
        table=NO_TABLE,
    )
    bound(expand, search, 0, math.inf)  # compiled for these types
    n = 1 + len(query.goals)
    turn = float(world.frame[2])
    x, y = (pair or (-math.inf, math.inf) for pair in (bounds.x, bounds.y))
    arrays = FirstCallArrays(
        poses=np.zeros((n, 3)),
        seen=np.zeros((n, 4)),
        clear=np.zeros(n),
        margin=np.zeros(1),
        window_box=query.box.copy(),
        asked=np.zeros(1, dtype=np.int64),
        frame=(*world.frame.tolist(), float(np.cos(-turn)), float(np.sin(-turn))),
        box=tuple(world.box.tolist()),
        pad=float(pad_around(world, library.radius)),
        bounded=bounds.x is not None,
        bounds=(float(x[0]), float(y[0]), float(x[1]), float(y[1])),
        margins=Margins(
            clearly=CLEARLY,
            usual=float(usual_margin(library, world)),
            least=LEAST_MARGIN,
            back_off=float(back_off_of(library)),
        ),
        others=numbers_of_cells(query, task, first),
    )
    return FirstCall(
        arrays=arrays,
        search=search,
        query=query,
        run=bound(kernels.begin_search, arrays, search),
        expand=called_again(expand),
        resolution=first,
        steps=steps,
        takes=first_takes(library.arrays, task),
    )
