"""Plans on a state lattice: a shortest path of a graph, found and proven by one search."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeAlias

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton.same_motion import POLISHED
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.blocked import blocked_anyway, goals_off_lattice, why_off_lattice
from maneuver_automaton.planning.incumbents import ROUNDING, Incumbents, PlanningStep
from maneuver_automaton.planning.result import LowerBound, PlanStatus, Workspace
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.search.lattice import in_frame_of_problem
from maneuver_automaton.search.lattice_task import WEIGHT
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.state_lattice import Graph, GraphSearch, graph_of
from maneuver_automaton.search.timed_lattice import FREELY, TimedSearch, by_time, costs_to_go

FIRST_CHUNK = 1024  # expansions of the exact search until one from the goals begins beside it
BACK = 16  # times fewer expansions than the exact search that one has in its turn
ALONE = 32768  # expansions of the exact search until one that is greedy begins beside it
GREEDY = 4  # times fewer expansions than the exact search that one has in its turn
MOST_CHUNK = 1 << 20
RELAXED_SHARE = 0.5  # of the time, where others search on if the cheapest path is refused
MOST_WIDER = 2  # times that a window is widened where there is no plan
MORE = 1.25, 1.6, 2.5, math.inf  # times the cost among what stands, up to which plans are sought
LONGER = 1e-9  # share of the longest time by which plans may be longer
_Why: TypeAlias = tuple[PlanStatus, str]  # there is no plan, if there is none
_NO_PATH = "the lattice has no path to a goal: every node that can be reached was looked at"


class OnStateLattice(PlanningStep):
    """The graph of a library on a lattice: its cheapest plan, and the proof.

    Every node within the tolerance of a goal is an aim. Obstacles are met where the body comes
    nearer than `MARGIN` to them, as in the checks of a plan. Of a library that has no such graph
    nothing is offered. What moves, and limits of time, are left out of the graph: where its
    cheapest plan meets them too, no other is cheaper; where it does not, others are searched for.
    """

    def prepare(self, problem: Problem, workspace: Workspace) -> bool:
        """Load the kernels, and make the graph."""
        load_kernels("lattice", "state lattice", "timed lattice")
        if goals_off_lattice(problem) is not None:
            return True  # which is told without a search
        lasting, goals = _lasting(problem), range(len(problem.goals))
        graph = graph_of(lasting, goals, workspace.on(lasting.obstacles).prepared)
        return graph is not None and lasting is problem

    def offer(self, found: Incumbents) -> None:
        """Offer the cheapest path of the graph."""
        problem, budget, ended = found.problem, found.budget, found.ended
        ended.verdict = blocked_anyway(problem)
        ended.is_complete = ended.verdict is not None
        if ended.is_complete:
            return
        goals = [k for k, goal in enumerate(problem.goals) if not why_off_lattice(problem, goal)]
        if not goals:
            ended.verdict, ended.is_complete = goals_off_lattice(problem), True
            return
        lasting = _lasting(problem)
        graph = graph_of(lasting, goals, found.workspace.on(lasting.obstacles).prepared)
        if graph is None:
            return
        found.likeness = POLISHED
        found.offer_nearly_met()
        found.counts.update(expansions=0, collision_queries=0)
        relaxed = lasting is not problem
        part = budget.stage(RELAXED_SHARE) if relaxed else budget
        graph, least, why = _search(found, graph, part, relaxed)
        if relaxed and why[0] is not PlanStatus.UNREACHABLE and not part.is_over:
            least, why = _in_time(found, graph, least, part)
        ended.is_complete = not relaxed or why[0] is not PlanStatus.OUT_OF_BUDGET
        ended.why = why if ended.is_complete else None
        if not problem.search.improve:  # A* with a weight is off by that factor at most
            least /= problem.search.weight or WEIGHT
        if found.plans and budget.watch is not None and budget.watch.problem is problem:
            budget.watch.bound = max(budget.watch.bound, min(least, found.cost))
        complete = ended.is_complete and why[0] is not PlanStatus.OUT_OF_BUDGET
        complete = complete and least >= found.cost * (1.0 - ROUNDING)
        ended.bound = LowerBound(value=least, kind="exhaustive" if complete else "open")


def _lasting(problem: Problem) -> Problem:
    """The problem without what moves and without limits of time; itself if it has neither."""
    horizon = replace(problem.horizon, max_time=None, stay=False)
    timed = problem.horizon.max_time is not None or problem.horizon.stay
    if not (problem.moves or timed):
        return problem
    still = tuple(one for one in problem.obstacles if not moves(one))
    return replace(problem, obstacles=still, horizon=horizon)


def _search(
    found: Incumbents, graph: Graph, budget: Budget, relaxed: bool
) -> tuple[Graph, float, _Why]:
    """Search a lattice to the end: its last window, least cost of a plan, why there is none."""
    # A `relaxed` graph leaves out conditions that its cheapest path may not meet.
    least, wider, why = math.inf, 0, (PlanStatus.UNREACHABLE, _NO_PATH)
    while True:
        exact = _best(found, graph, budget, relaxed)
        if found.problem.search.show_nodes:
            found.ended.nodes = in_frame_of_problem(graph.query, exact.nodes)
        if exact.alive:  # the time, or the number of expansions, is over
            spent = f"{found.budget.seconds:.4g} s and {found.counts['expansions']} expansions"
            late = found.why_unchecked or f"no plan within {spent}"
            return graph, min(least, exact.least_open), (PlanStatus.OUT_OF_BUDGET, late)
        least = min(least, exact.cost, found.cost)
        refused = exact.cost < found.cost * (1.0 - ROUNDING)
        beyond = exact.cut < exact.cost and wider < MOST_WIDER  # a cheaper one may leave the window
        if refused and (not beyond if relaxed else graph.fine is not graph.coarse):
            if relaxed or budget.is_over:
                least = min(least, exact.cut)
                return graph, least, (PlanStatus.OUT_OF_BUDGET, found.why_unchecked)
            graph = replace(graph, fine=graph.coarse)  # it was refused: keep away from obstacles
        elif exact.cut < min(found.cost, least) * (1.0 - ROUNDING):
            if not found.plans and wider == MOST_WIDER:
                why = PlanStatus.NO_PLAN, "none in a window around all that stands, and no proof"
                least = min(least, exact.cut)
                break
            graph, wider = graph.widened(), wider + 1
        else:
            break
    if found.why_refused:
        why = PlanStatus.NO_PLAN, f"every plan found was refused: {found.why_refused}"
    return graph, least, why


def _in_time(found: Incumbents, graph: Graph, least: float, budget: Budget) -> tuple[float, _Why]:
    """Search in time, where the cheapest path among all that stands was refused."""
    # Least cost of a plan, and why there is none, as in `_search`.
    problem, prepared = found.problem, found.workspace.prepared
    longest, late = problem.horizon.max_time, (PlanStatus.OUT_OF_BUDGET, found.why_unchecked)
    soon, proven = FREELY, least
    if longest is not None:
        hurried = by_time(graph)
        quickest = GraphSearch.of(hurried, weight=1.0, budget=budget)
        while quickest.alive and not (budget.is_over or quickest.is_late):
            quickest.run(MOST_CHUNK, math.inf)
        if quickest.alive:
            return least, late
        takes = min(quickest.cost, quickest.cut)
        if takes > longest * (1.0 + LONGER):
            why = f"the quickest way takes {takes:.6g} s, at most {longest:g} s are admitted"
            return least, (PlanStatus.UNREACHABLE, why)
        known = costs_to_go(hurried, longest * (1.0 + LONGER), budget)
        if known is None:
            return least, late
        soon = known[0]
    for times in MORE:
        most = min(times * least, found.cost)
        for _ in range(MOST_WIDER + 1):
            known = costs_to_go(graph, most, budget)
            if known is None:
                return least, late
            free, beyond = known
            if not beyond < most < math.inf:
                break
            graph = graph.widened()
        search = TimedSearch.of(graph, problem, free, soon, prepared)
        search.run(most, budget)
        found.counts.update(collision_queries=search.queries)
        if search.alive:
            return least, late
        if search.cost < found.cost:
            word, goal = search.word()
            if not found.offer(plan_of(problem, word), goal, proven=False):
                return least, late
            found.note(search.cost)
        bounding = search
        if search.least_missed < min(most, found.cost):
            bounding = TimedSearch.of(graph, problem, free, soon, prepared, bounds=True)
            bounding.run(min(most, found.cost), budget)
            found.counts.update(collision_queries=bounding.queries)
        proven = least if bounding.alive else min(bounding.cost, most, beyond, found.cost)
        least = max(least, proven)
        if found.cost <= most:
            return least, (PlanStatus.NO_PLAN, "")
    if proven == math.inf:
        return least, (PlanStatus.UNREACHABLE, "what moves is in every way, however long it waits")
    return least, (PlanStatus.NO_PLAN, "none, however long it waits for what moves, and no proof")


def _best(found: Incumbents, graph: Graph, budget: Budget, relaxed: bool) -> GraphSearch:
    """A search for the cheapest path that has come to its end, or as far as the budget admits."""
    # One from the goals runs beside it, which ends soon where few nodes lead to them, and a greedy
    # one if there is no plan for long.
    settings = found.problem.search
    weight = settings.weight or WEIGHT
    if settings.backwards:
        graph = graph.backwards() or graph
    exact = GraphSearch.of(graph, weight=1.0 if settings.improve else weight, budget=budget)
    closing, chunk, turns = None, FIRST_CHUNK, [(exact, 1)]
    while exact.alive and not (budget.is_over or exact.is_late):
        for one, times in turns:
            if not _run(found, one, chunk // times, relaxed):
                return exact
            if one is closing and _is_decided(one):
                return one
        chunk = min(2 * chunk, MOST_CHUNK)
        if len(turns) == 1 and (back := graph.backwards()):
            closing = GraphSearch.of(back, weight=1.0, budget=budget)
            turns.insert(0, (closing, BACK))
        greedy = settings.improve and not found.plans and exact.expansions >= ALONE
        if greedy and turns[-1][1] != GREEDY:
            turns.append((GraphSearch.of(graph, weight=weight, budget=budget), GREEDY))
    if closing and not (exact.alive or found.plans) and exact.cut < exact.cost:
        while closing.alive and not (budget.is_over or closing.is_late):
            if not _run(found, closing, MOST_CHUNK, relaxed):
                break
        if _is_decided(closing):
            return closing
    return exact


def _is_decided(search: GraphSearch) -> bool:
    """Whether a search from the goals has found the cheapest path, or no way into its window."""
    return not search.alive and (search.cost < math.inf or search.cut == math.inf)


def _run(found: Incumbents, search: GraphSearch, n: int, relaxed: bool) -> bool:
    """Expand up to `n` nodes, and offer the path that is found; False if none may be expanded."""
    left = found.budget.expansions
    room = n if left is None else min(n, left - found.counts["expansions"])
    if not (room and search.alive):
        return room > 0
    before, asked = search.expansions, search.queries
    search.run(room, found.cost)
    found.counts.update(
        expansions=search.expansions - before, collision_queries=search.queries - asked
    )
    if search.cost < found.cost and not search.alive:
        word, goal = search.word()
        if not relaxed:
            found.note(search.cost)
        if found.offer(plan_of(found.problem, word), goal, proven=not relaxed):
            found.note(search.cost)
    return True
