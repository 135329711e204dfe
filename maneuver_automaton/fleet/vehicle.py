"""One vehicle of a fleet: its way alone, and its way past what the others do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Disc, Motion, Obstacle
from maneuver_automaton.fleet.conflicts import Course
from maneuver_automaton.planning.blocked import goals_left
from maneuver_automaton.planning.needs import has_inertia
from maneuver_automaton.planning.plan import plan_in
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.improve import Patience, improve
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.search.word_plan import plan_of_word
from maneuver_automaton.words.word import Word, word_of_plan

WAYS = 6  # alone, that are tried with rests
QUICK = 1500  # expansions in space and time at first ...
LONG = 20_000  # ... and where nothing else helps
AT_ONCE = Patience(attempts=0, passes=0)
ALONE = Patience(attempts=400, passes=2)
NEARLY = 1.05  # times the way alone: what costs more is searched for in space and time as well
LEAST_S, INERTIA_S = 0.01, 2.0  # [s] that a whole query gets at least, and with inertia at most
POINT = (Disc(1e-6),)  # the body of a vehicle that is a point, as others see it


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A plan of a vehicle, its cost, and where that leaves its bodies."""

    plan: Plan
    cost: float
    goal_index: int
    course: Course

    @property
    def arrival(self) -> float:
        """When it arrives [s]."""
        return self.plan.start_time + self.plan.duration


@dataclass(slots=True, eq=False)
class Vehicle:
    """One vehicle: `problem` is its own, with the obstacles that it has without the others."""

    number: int
    name: str
    problem: Problem
    leaves: bool
    grown: float  # [m] by which others see it larger
    workspace: Workspace
    alone: PlanResult | None = None
    ways: list[Word] = field(default_factory=list)  # alone, the cheapest first
    standing: Course = field(init=False)  # at its start, for ever
    expansions: int = 0

    def __post_init__(self) -> None:
        problem = self.problem
        shapes, poses = [problem.footprint or POINT], [problem.start[:3]]
        if problem.parts:
            here = Plan(problem.start, (problem.first_trim,), durations=[0.0])
        for name, of_part in problem.parts.items():
            shapes.append(of_part)
            poses.append(carried(here, problem.automaton.model, name).start[:3])
        motions = tuple(Motion([problem.start_time], [pose]) for pose in poses)
        self.standing = Course(tuple(shapes), motions, grown=self.grown)

    @property
    def at_will(self) -> bool:
        """Whether it switches at will in a plane, so that its plans are words of the lattice."""
        return not has_inertia(self.problem) and self.problem.start.size == 3

    def course_of(self, plan: Plan) -> Course:
        """Its bodies in time if it drives a plan."""
        plans = [(self.problem.footprint or POINT, plan)]
        for name, shapes in self.problem.parts.items():
            plans.append((shapes, carried(plan, self.problem.automaton.model, name)))
        until = plan.start_time + plan.duration if self.leaves else math.inf
        return Course(
            tuple(shapes for shapes, _ in plans),
            tuple(Motion.of_plan(one) for _, one in plans),
            until,
            self.grown,
        )

    def plan_alone(self, budget: Budget) -> None:
        """Find its way past what stands still, by itself, and a few others beside it."""
        problem = self.problem
        known = plan_in(
            self.workspace, problem, time_limit=max(budget.left, LEAST_S), alternatives=0
        )
        self.alone = known
        self._count(known.counts.get("expansions", 0))
        if known.plan is None or not self.at_will:
            return
        query = self._query(problem)
        words = self._improved(query, budget) if problem.obstacles else []
        own = word_of_plan(query.automaton, known.plan)
        words += [replace(own, cost=known.cost or 0.0)] if own is not None else []
        words = sorted(words, key=lambda word: word.cost)
        distinct = {tuple(word.trims.tolist()): word for word in reversed(words)}
        self.ways = list(distinct.values())[::-1][:WAYS]

    def _improved(self, query: LatticeQuery, budget: Budget) -> list[Word]:
        """A way found by the lattice, improved, and those beside it."""
        first = first_plan(query, budget=replace(budget, expansions=LONG))
        self._count(first.expansions)
        if first.word is None:
            return []
        better = improve(query, first.word, budget=replace(budget, expansions=LONG), patience=ALONE)
        self._count(better.expansions)
        return [better.word, first.word, *better.others]

    def past(
        self,
        others: Sequence[Obstacle],
        budget: Budget,
        *,
        most: int = QUICK,
        known: float = math.inf,
    ) -> Found | None:
        """The cheapest way found past what the others do; None if there is none below a cost."""
        if not others:
            found = self.alone_found()
            return found if found is not None and found.cost < known else None
        problem = replace(
            self.problem,
            obstacles=(*self.problem.obstacles, *others),
            horizon=replace(self.problem.horizon, stay=not self.leaves),
        )
        if not self.at_will:
            return self._past_with_inertia(problem, budget, known)
        query = self._query(problem)
        best: Word | None = None
        for way in self.ways:
            if way.cost >= (best.cost if best else known) or budget.is_over:
                break
            timed = with_waits(query, way)
            if timed is not None and timed.cost < (best.cost if best else known):
                best = timed
        if best is None or best.cost > NEARLY * self.ways[0].cost:
            first = first_plan(query, budget=replace(budget, expansions=most))
            self._count(first.expansions)
            if first.word is not None and first.word.cost < (best.cost if best else math.inf):
                best = first.word
        if best is None:
            return None
        best = improve(query, best, budget=budget, patience=AT_ONCE).word
        if not best.cost < known:
            return None
        plan = plan_of_word(query, best)
        goal_index = query.goal_index[best.goal]
        return Found(plan, best.cost + query.padding, goal_index, self.course_of(plan))

    def alone_found(self) -> Found | None:
        """Its way alone, as it was found."""
        known = self.alone
        if known is None or known.plan is None or known.cost is None:
            return None
        return Found(known.plan, known.cost, known.goal_index or 0, self.course_of(known.plan))

    def _past_with_inertia(self, problem: Problem, budget: Budget, known: float) -> Found | None:
        workspace = Workspace(problem.obstacles, self.workspace.prepared)
        share = max(min(budget.left, INERTIA_S), LEAST_S)
        result = plan_in(workspace, problem, time_limit=share, alternatives=0)
        self._count(result.counts.get("expansions", 0))
        if result.plan is None or result.cost is None or not result.cost < known:
            return None
        goal_index = result.goal_index or 0
        return Found(result.plan, result.cost, goal_index, self.course_of(result.plan))

    def _query(self, problem: Problem) -> LatticeQuery:
        return lattice_query(problem, goals_left(problem), prepared=self.workspace.prepared)

    def _count(self, expansions: int) -> None:
        self.expansions += expansions
