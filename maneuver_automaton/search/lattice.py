"""A* over lattice cells with exact poses: from both ends in turn, at several resolutions.

Run backwards in time a trim moves by the opposite twist and a maneuver leads from its target to its
source, along the same poses. So the search from the start also serves from the goal, and finds the
same words from their other end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import Shape
from maneuver_automaton.costs import StageCost
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search._kernels_distance import AT_RIM, corner_path, distances
from maneuver_automaton.search.arrays import CostTable, DistanceGrid
from maneuver_automaton.search.beginning import Begun
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.distance_grid import OCTILE, distance_grid
from maneuver_automaton.search.lattice_library import Carried, LatticeLibrary, library_of_trims
from maneuver_automaton.search.lattice_pass import Pass, give_back, pass_of, with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import (
    Resolution,
    Schedule,
    first_resolutions,
    schedule_of,
)
from maneuver_automaton.search.lattice_trims import priced_library, trims_of
from maneuver_automaton.search.part_motion import posed_parts
from maneuver_automaton.search.place_arrays import driven_back
from maneuver_automaton.search.scene import for_library
from maneuver_automaton.words.library import library_of
from maneuver_automaton.words.word import Word

PROOFS = 8_000, 32_000  # expansions until it is asked whether it is proven that there is no word
ASIDE = 50_000  # expansions until something else is tried, whose words are longer
ASIDE_SHARE = 0.5  # of the time left, for that

Grids = tuple[DistanceGrid, DistanceGrid]  # distances to the goals and to the start


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FirstPlan:
    """The result of the schedule of resolutions."""

    word: Word | None
    expansions: int
    queries: int  # collision queries
    exhausted: bool = False  # every resolution was tried to its end
    enclosed: str = ""  # why no plan can exist, if the plane alone proves it
    # [m, rad] of the pose that came nearest to a goal from it
    nearest: tuple[float, float] = (math.inf, math.inf)
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of the expanded nodes, if asked for


def first_plan(
    query: LatticeQuery,
    *,
    budget: Budget = UNLIMITED,
    table: CostTable = NO_TABLE,
    begun: Begun | None = None,
    aside: Callable[[Budget], FirstPlan] | None = None,
    is_proven: Callable[[Budget, int], bool] | None = None,
) -> FirstPlan:
    """The first connection from start to a goal, at the first resolution that has one.

    The library of the query says which resolutions are tried, and when; expansions of the `budget`
    are those of all searches together. `begun` is the first search of the schedule, if it is known.
    What finds words otherwise is asked `aside` where this takes long, for a share of the time, and
    again where it ends without one; if that is exhausted, so is all. Whether it `is_proven` that
    there is none is asked before that, the second time for so many times the work.
    """
    if begun is not None and begun.is_found:
        search = begun.search_of(query)
        return FirstPlan(
            word=search.run(0, math.inf, budget=budget),
            expansions=search.expansions,
            queries=search.queries,
            nodes=expanded(query, [search]),
        )
    schedule = schedule_of(query.library)
    guides = _Guides(query, table)
    room = 2**62 if budget.expansions is None else budget.expansions
    stages = list(schedule.stages[1:])
    turns = _turns(guides, schedule, first_resolutions(query.library, query.problem.search))
    if begun is not None:
        turns[0].begun = begun.search_of(query)
        guides.coarse_grids[turns[0].sign] = turns[0].begun.search.grid
        guides.expand = begun.call.expand
    word, proof, total, queries, left_out, other, none = None, "", 0, 0, False, None, False
    proofs = list(PROOFS if is_proven else ())
    while word is None:
        due = min(room, ASIDE) if aside and other is None else room
        for one in turns:
            if not one.may_expand or total >= due or budget.is_over:
                continue
            search = one.begun or one.begin()
            search.is_late = budget.left < search.first_takes  # nothing is begun that would be late
            before = search.expansions - search.begun_with
            word = search.run(min(one.chunk, due - total), math.inf, budget=budget)
            total += search.expansions - before
            one.chunk = min(2 * one.chunk, schedule.most_chunk)
            if word is not None:
                if search.resolution.backwards:
                    word = with_cost(forward_word(word), query)
                break
        alive = any(one.alive for one in turns)
        closed = not alive or any(one.is_closed for one in turns)
        proof = _enclosed(query, guides.fine) if word is None and closed else ""
        late = alive and not any(one.may_expand for one in turns)
        ends = not (alive or stages)
        if is_proven and proofs and total >= proofs[0] and word is None and not proof:
            none = is_proven(budget, proofs.pop(0) // PROOFS[0])
            if none:
                break
        if aside and (ends or total >= due) and word is None and not proof and total < room:
            until = budget.clock() + (1.0 if ends else ASIDE_SHARE) * budget.left
            other = aside(budget._replace(deadline=until, expansions=room - total))
            word, total = other.word, total + other.expansions
            queries += other.queries
            if other.exhausted:
                break
        if word is not None or total >= room or budget.is_over or proof or late:
            break
        if stages and (not alive or total >= stages[0][0]):
            _, resolutions = stages.pop(0)
            # To make the reversed library cannot be stopped: all maneuvers are sampled and priced.
            words = len(query.library.arrays.library.tried.words)
            takes = SECONDS_A_MANEUVER * len(query.automaton.maneuvers) + SECONDS_A_WORD * words
            if any(one.backwards for one in resolutions) and budget.left < takes:
                left_out = True
                continue
            turns += _turns(guides, schedule, resolutions)
        elif not alive:
            break
    passes = [one.begun for one in turns if one.begun is not None]
    ahead = [one.nearest for one in passes if word is None and not one.resolution.backwards]
    found = FirstPlan(
        word=word,
        expansions=total,
        queries=sum(one.queries for one in passes) + queries,
        exhausted=none or (word is None and not alive and not left_out),
        enclosed=proof,
        nearest=min(ahead, default=(math.inf, math.inf)),
        nodes=expanded(query, passes),
    )
    for search in passes:
        if begun is None or search is not turns[0].begun:  # its arrays are those of the first call
            give_back(query.prepared, search.query.library, search.arrays)
    return found


@dataclass(slots=True, eq=False)
class _Guides:
    """Estimates that lead the searches for one query, each made when it is asked for."""

    query: LatticeQuery
    table: CostTable
    expand: Callable[..., int] | None = None  # for searches of the query, if it is known
    fine_grids: Grids | None = None
    coarse_grids: dict[float, DistanceGrid] = field(default_factory=dict)

    @property
    def fine(self) -> Grids:
        """Distances to the goals and to the start along fine cells."""
        if self.fine_grids is None:
            self.fine_grids = distance_grids(self.query)
        return self.fine_grids

    def grid(self, resolution: Resolution, sign: float) -> DistanceGrid:
        """Distances to where a search leads."""
        if not resolution.coarse:
            return self.fine[0 if sign > 0.0 else 1]
        if sign not in self.coarse_grids:
            self.coarse_grids[sign] = _grid(self.query, sign, coarse=True)
        return self.coarse_grids[sign]


@dataclass(slots=True, eq=False)
class _Turn:
    """A search that begins when it is its turn."""

    guides: _Guides
    query: LatticeQuery  # that of the guides, or its reverse
    resolution: Resolution
    sign: float
    chunk: int
    begun: Pass | None = None

    @property
    def alive(self) -> bool:
        """Whether there is something left to expand."""
        return self.begun is None or self.begun.alive

    @property
    def may_expand(self) -> bool:
        """The same, and there is time to do so."""
        return self.begun is None or self.begun.may_expand

    @property
    def is_closed(self) -> bool:
        """Whether the plane alone, in fine cells, leads from none of its roots to an aim."""
        if self.begun is None or self.resolution.coarse:
            return False
        state = self.begun.arrays.state
        return bool(state[layout.BEGUN]) and not state[layout.N_NODES]

    def begin(self) -> Pass:
        """The search with its roots."""
        back = self.resolution.backwards
        self.begun = pass_of(
            self.query,
            self.resolution,
            grid=self.guides.grid(self.resolution, -1.0 if back else self.sign),
            sign=self.sign,
            table=self.guides.table if self.resolution.guided and not back else NO_TABLE,
        )
        if self.guides.expand and not back:
            self.begun.expand = self.guides.expand
        return self.begun


def _turns(guides: _Guides, schedule: Schedule, resolutions: tuple[Resolution, ...]) -> list[_Turn]:
    """Searches at some resolutions, in turn from each end; from the start where something moves."""
    turns: list[_Turn] = []
    query, chunk = guides.query, schedule.first_chunk
    ends = [sign for sign in schedule.ends if sign > 0.0 or not query.moves]
    for one in resolutions:
        if not one.backwards:
            turns += [_Turn(guides, query, one, sign, chunk) for sign in ends]
        elif (back := reversed_query(query)) is not None:
            turns.append(_Turn(guides, back, one, 1.0, chunk))
    return turns


def distance_grids(query: LatticeQuery) -> Grids:
    """Distances to the goals and to the start."""
    return _grid(query, 1.0, coarse=False), _grid(query, -1.0, coarse=False)


def _grid(query: LatticeQuery, sign: float, *, coarse: bool) -> DistanceGrid:
    """Distances to where searches along time lead, or those against it."""
    seeds, aim = (query.goals, query.start) if sign > 0.0 else (query.start[None], query.goals[0])
    return distance_grid(
        query.plane,
        query.box,
        query.window,
        seeds,
        aim,
        coarse=coarse,
        prices=query.least_prices,
        prepared=query.prepared,
    )


def _enclosed(query: LatticeQuery, grids: Grids) -> str:
    """Why no plan can exist: the plane around the goals, or the start, is closed."""
    asked = set(query.goal_index)
    goals = enumerate(query.problem.goals)
    if any(goal.free_heading and k not in asked for k, goal in goals):
        return ""
    for grid, name, far in (
        (grids[0], "goal", query.start[None]),
        (grids[1], "start", query.goals),
    ):
        if not grid.layout.columns:
            continue
        lengths = distances(grid, query.plane.arrays.field, np.ascontiguousarray(far[:, :2]))
        if np.isinf(lengths).all() and (query.bounded or not grid.state[AT_RIM]):
            return f"obstacles enclose the {name}"
    return ""


def expanded(query: LatticeQuery, passes: Iterable[Pass]) -> Array | None:
    """Poses of expanded nodes in the problem's frame, and their costs (n, 4), if asked for."""
    if not query.problem.search.show_nodes:
        return None
    rows = []
    for one in (search.arrays for search in passes):
        n = int(one.state[layout.N_NODES])
        closed = (one.links[:n, layout.CLOSED] == 1) & np.isfinite(one.nodes[:n, layout.COST])
        shown = [layout.X, layout.Y, layout.HEADING, layout.COST]
        rows.append(one.nodes[:n][closed][:, shown])
    return in_frame_of_problem(query, np.concatenate(rows))


def in_frame_of_problem(query: LatticeQuery, nodes: Array) -> Array:
    """Poses and costs (n, 4) seen from the world's frame, with poses as the problem sees them."""
    turned = SE2(np.array([0.0, 0.0, query.world.frame[2]])) @ SE2(nodes[:, :3])
    poses = turned.pose.copy()
    poses[:, :2] += query.world.frame[:2]
    return np.column_stack([poses, nodes[:, 3]])


def plane_bound(query: LatticeQuery) -> float:
    """Lower bound [m] of the path in the plane from the start to a goal's tolerance; 0 if unknown.

    The shortest path round blocked cells leads over their corners, and among the corners of cells
    an octile path is at most 1.0824 times as long; start and goal are at most half a diagonal from
    a corner. Cells are blocked only where the pose cannot be at all, as `distance_grid` says: by
    obstacles at every altitude, and the body that the pose lies in.

    Source: Bailey, Tovey, Uras, Koenig, Nash (2015), *Path planning on grids: the effect of vertex
    placement on path length*.
    """
    grid = distance_grid(
        query.plane, query.box, query.window, query.goals, query.start, prepared=query.prepared
    )
    if not grid.layout.columns:
        return 0.0
    length: float = corner_path(
        grid,
        query.plane.arrays.field,
        np.ascontiguousarray(query.goals[:, :2]),
        float(query.start[0]),
        float(query.start[1]),
    )
    if not np.isfinite(length):
        return 0.0
    beside = max(query.problem.goals[k].tolerance_m for k in query.goal_index)
    return max(0.0, length / OCTILE - grid.layout.cell * float(np.sqrt(2.0)) - beside)


SECONDS_A_MANEUVER, SECONDS_A_WORD = 1e-3, 2e-6  # measured, generous


def reversed_query(query: LatticeQuery) -> LatticeQuery | None:
    """The query from goal to start; None where obstacles move, or with several goals."""
    if query.moves or len(query.goals) > 1:
        return None
    problem = query.problem
    library = query.prepared.once(
        _reversed_library,
        query.automaton,
        problem.cost,
        problem.footprint,
        tuple(problem.parts.items()),
    )
    around = for_library(query.around, problem, library)
    return replace(
        query,
        library=library,
        around=around._replace(place=driven_back(around.place)),
        start=query.goals[0],
        goals=query.start[None],
        goal_poses=problem.start[None],
        start_trim=int(query.goal_trims[0]),
        goal_trims=np.array([query.start_trim], dtype=np.int64),
    )


def forward_word(word: Word) -> Word:
    """A word of the reversed query as a word of the query."""
    return replace(
        word,
        trims=word.trims[::-1],
        durations=word.durations[::-1].copy(),
        transitions=word.transitions[::-1],
        goal=0,
    )


def _reversed_library(
    automaton: Automaton, cost: StageCost, footprint: tuple[Shape, ...], carried: Carried
) -> LatticeLibrary:
    """The library of an automaton in reverse, at the same prices, for static obstacles."""
    priced = priced_library(automaton, cost)
    trims = tuple(replace(trim, body_velocity=-trim.body_velocity) for trim in automaton.trims)
    maneuvers = tuple(_reversed(one) for one in automaton.maneuvers)
    back = library_of(
        replace(automaton, trims=trims, maneuvers=maneuvers),
        rates=priced.arrays.rates[: priced.arrays.n_trims],
        maneuver_costs=priced.maneuver_costs,
    )
    parts = tuple(
        replace(part, course_poses=tuple(poses[::-1].copy() for poses in part.course_poses))
        for part in posed_parts(automaton, footprint, dict(carried), priced.trims)
    )
    return library_of_trims(trims_of(back, cost), parts, waits=False)


def _reversed(maneuver: Maneuver) -> Maneuver:
    group = group_of(maneuver.displacement.size)
    back = np.array(group(maneuver.displacement).inverse().pose)
    course = maneuver.course
    if course is not None:
        last = course.pose[-1]
        poses = np.array((group(last).inverse() @ group(course.pose[::-1])).pose)
        poses[0] = 0.0
        back = poses[-1]
        course = Trajectory(
            time=course.time[-1] - course.time[::-1],
            pose=poses,
            reduced_state=course.reduced_state[::-1].copy(),
            control=np.concatenate([course.control[-2::-1], course.control[:1]]),
        )
    return replace(
        maneuver, source=maneuver.target, target=maneuver.source, displacement=back, course=course
    )
