"""One vehicle of a fleet: its way alone, its way past what the others do, and places aside."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import Prepared
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, carried
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.advancement import free_times
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.shapes import Disc, Obstacle
from maneuver_automaton.fleet.courses import (
    OFF,
    FleetCourse,
    followed,
    larger,
    levels_of,
    standing_still,
    where_it_stays,
)
from maneuver_automaton.fleet.meetings import PROOF
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.planning.blocked import blocked_ends, goals_left, why_goal_blocked
from maneuver_automaton.planning.bounds import formula_bound, lattice_bound
from maneuver_automaton.planning.plan import load, plan_in, prepare
from maneuver_automaton.planning.result import LowerBound, PlanResult, Workspace
from maneuver_automaton.planning.steps import uses_lattice
from maneuver_automaton.planning.within_tolerance import free_aims
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.rest_of_plan import followed_by
from maneuver_automaton.refinement.fitting import MET
from maneuver_automaton.refinement.improve import NO_WORD, Patience, WordSchedule, words_of
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import outside
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.words.library import SWITCH
from maneuver_automaton.words.word import Word, word_of_plan, word_of_steps

SAMPLES = 4000  # places that are looked at
MOST_TRIED = 40  # refuges that ways are searched to
AS_NOW = 0.5  # share of the places at which the vehicle keeps its heading
ALIKE, TURNED = 0.5, 0.8  # [lengths of the body], [rad]: of refuges so near only one is tried
SEED = 14  # of the places
FAR = 8.0  # [lengths of the body] from the way alone
EXPANSIONS = 4000  # of the way to a refuge, and of that from there
WAYS = 6  # alone, that are tried with rests
QUICK = 1500  # expansions in space and time at first ...
LONG = 20_000  # ... and where nothing else helps
AT_ONCE = WordSchedule(patience=Patience(attempts=0, passes=0))
WITH_TIME = WordSchedule(patience=Patience(attempts=400, passes=2))
NEARLY = 1.05  # times the way alone: what costs more is searched for in space and time as well
MOST_AIMS = 2  # poses within the tolerance of a goal where another one stands
LONGEST = 400_000  # expansions for a way alone
LEAST_S = 0.01  # [s] of a whole query
POINT = (Disc(1e-6),)  # the body of a vehicle that is a point, as others see it


def by_a_refuge(
    problem: Problem,
    query: LatticeQuery,
    query_of: Callable[[Problem], LatticeQuery],
    way: Plan,
    budget: Budget,
) -> Word | None:
    """The cheapest path past moving obstacles, with a stop where none ever passes; None if none.

    Places beside the `way` alone, the nearest first; the vehicle drives there, waits, and goes on,
    as soon as rests along that way allow.
    """
    best: Word | None = None
    counted = budget._replace(expansions=EXPANSIONS)
    for pose in refuges(problem, query, way):
        if budget.is_over:
            break
        aim = problem.starting_at(problem.start, time=problem.start_time, goals=Goal(pose))
        there = first_plan(query_of(aim), budget=counted).word
        if there is None or (best is not None and there.cost >= best.cost):
            continue
        leaving = problem.starting_at(pose, time=problem.start_time)
        back = first_plan(query_of(leaving), budget=counted).word
        if back is None:
            continue
        steps = [
            (SWITCH, int(k), float(t))
            for word in (there, back)
            for k, t in zip(word.trims, word.durations, strict=True)
        ]
        timed = with_waits(query, word_of_steps(steps, goal=back.goal))
        if timed is not None and (best is None or timed.cost < best.cost):
            best = timed
    return best


def refuges(problem: Problem, query: LatticeQuery, way: Plan, *, off: bool = False) -> list[Array]:
    """Poses (3,) beside a way at which the vehicle may stand from when it gets there, for ever.

    The nearest to the way first. `off` the way of another vehicle it stands from its start on: near
    that way, or near its start.
    """
    rng, world = np.random.default_rng(SEED), query.world
    size = max(world.body.reach, query.library.radius * 0.5)
    # Seen from the way, so that a moved problem has the moved refuges.
    since = way.duration * rng.uniform(0.0, 1.0, SAMPLES)
    bases = np.array(way.pose_at(way.start_time + since)[:, :3])
    if off:
        since[:], bases[::2] = 0.0, problem.start[:3]
    away = size * rng.uniform(0.0, FAR, SAMPLES)
    bearing, turned = rng.uniform(-math.pi, math.pi, (2, SAMPLES))
    turned[: int(AS_NOW * SAMPLES)] = 0.0
    heading, bearing = bases[:, 2] + turned, bases[:, 2] + bearing
    automaton = problem.automaton
    changes = [*automaton.body_velocities[:, 2], *(m.displacement[2] for m in automaton.maneuvers)]
    if automaton.translated is not None or not any(changes):
        heading[:] = problem.start[2]
    poses = np.column_stack(
        [bases[:, 0] + away * np.cos(bearing), bases[:, 1] + away * np.sin(bearing), heading]
    )
    begins = problem.start_time + since
    lasting = np.maximum(world.last_event - begins, 0.0) + 1.0
    stands = free_times(
        world,
        world.into(poses),
        twists=np.zeros((SAMPLES, 3)),
        durations=lasting,
        margin=query.margin,
        keep=problem.margin,
        times=begins,
    )
    kept = np.flatnonzero(stands >= lasting)
    found: list[Array] = []
    for k in kept[np.argsort(away[kept], kind="stable")]:
        pose, others = poses[k], np.array(found).reshape(-1, 3)
        near = np.hypot(*(others[:, :2] - pose[:2]).T) < ALIKE * size
        turn = np.abs(np.remainder(others[:, 2] - pose[2] + math.pi, 2.0 * math.pi) - math.pi)
        if not (near & (turn < TURNED)).any() and not outside(pose, problem.bounds):
            found.append(pose)
            if len(found) == MOST_TRIED:
                break
    return found


@dataclass(frozen=True, slots=True, eq=False)
class OwnPlan:
    """A plan of a vehicle, its cost, and where that leaves its bodies."""

    plan: Plan
    cost: float
    goal_index: int
    course: FleetCourse

    @property
    def arrival(self) -> float:
        """When it is over [s]."""
        return self.plan.start_time + self.plan.duration

    @property
    def leads(self) -> bool:
        """Whether it arrives."""
        return self.cost < math.inf

    @property
    def arrives(self) -> float:
        """When it arrives [s]; inf if it does not."""
        return self.arrival if self.leads else math.inf

    def is_over(self, time: float) -> bool:
        """Whether nothing of it is left but to stay."""
        return time >= self.arrival - NOTHING

    def given_up(self) -> OwnPlan:
        """It is driven to its end, but does not arrive there: the vehicle stays."""
        return replace(self, cost=math.inf, course=self.course.staying)


@dataclass(eq=False)
class FleetMember:
    """One vehicle: `problem` is its own, with the obstacles that it has without the others."""

    number: int
    name: str
    problem: Problem
    leaves: bool
    grown: float  # [m] by which others see it larger
    workspace: Workspace
    alone: OwnPlan | None = None  # its plan by itself
    why_none: str = ""  # why it has no plan by itself
    # Alone, the cheapest first; none where its plans are no words of the lattice in a plane.
    ways: list[Word] = field(default_factory=list)
    aside: Word | None = None  # a way that first makes room for others
    standing: FleetCourse = field(init=False)  # at its start, for ever
    expansions: int = 0

    def __post_init__(self) -> None:
        problem, poses = self.problem, [self.problem.start[:3]]
        if problem.parts:
            here = Plan(problem.start, (problem.first_trim,), durations=[0.0])
            model = problem.automaton.model
            poses += [carried(here, model, name).start[:3] for name in problem.parts]
        shapes = (problem.footprint or POINT, *problem.parts.values())
        motions = tuple(Motion([problem.start_time], [pose]) for pose in poses)
        self.standing = FleetCourse(shapes, motions, grown=self.grown, levels=levels_of(problem))

    def course_of(self, plan: Plan) -> FleetCourse:
        """Its bodies in time if it drives a plan."""
        bodies = {"": self.problem.footprint or POINT, **self.problem.parts}
        model, by = self.problem.automaton.model, OFF if any(plan.maneuvers) else 0.0
        driven = followed(plan, bodies)
        plans = [carried(driven, model, name) if name else driven for name in bodies]
        return FleetCourse(
            tuple(tuple(larger(one, by) for one in shapes) for shapes in bodies.values()),
            tuple(Motion.of_plan(one) for one in plans),
            plan.start_time + plan.duration if self.leaves else math.inf,
            self.grown,
            levels_of(self.problem, plan),
        )

    def beside(self, others: Sequence[Obstacle]) -> Sequence[Obstacle]:
        """Those that stand at its own heights: in the plane nothing else looks at these.

        What has no height of its own is beside all others; in space every search looks at heights.
        """
        low, high = self.problem.body_height
        if self.problem.start.size > 3 or not low < high:
            return others
        keep = self.problem.margin + PROOF
        return [
            one
            for one in others
            if one.height is None or (one.height[0] <= high + keep and one.height[1] >= low - keep)
        ]

    @functools.cached_property
    def bound(self) -> LowerBound | None:
        """No plan of it costs less; None for one that has none. No search asks for it."""
        if not self.ways or self.aimed is not self.problem:
            return formula_bound(self.problem) if self.ways else None
        return lattice_bound(self._query(self.aimed))

    def plan_alone(self, budget: Budget, *, hurried: bool = False) -> None:
        """Find its way, and a few others beside it, past static obstacles; `hurried`: as found."""
        blocked, searched = blocked_ends(self.aimed), replace(self.problem.search, method="lattice")
        steers = uses_lattice(replace(self.problem, search=searched))
        if blocked is not None:
            self.why_none = blocked.reason
        elif steers and not self.problem.has_inertia and self.problem.start.size == 3:
            self._plan_words(budget, hurried=hurried)
        else:
            result = self._planned(self.problem, budget, improve=False)
            self.alone, self.why_none, self.bound = self._found(result), result.reason, result.bound

    def _plan_words(self, budget: Budget, *, hurried: bool) -> None:
        """The same for one whose plans are words of the lattice."""
        query = self._query(self.aimed)
        first = self._first(query, budget, LONGEST)
        if first.word is None:
            self.why_none = first.enclosed or "no path was found"
            return
        word = first.word
        if not self._meets(query, word):  # an exact end beside it needs other words
            found = self._planned(self.problem, budget, improve=False)
            if found.plan is not None and found.goal_index in query.goal_index:
                goal = query.goal_index.index(found.goal_index)
                word = query.word_of(self._steps(found.plan), goal)
        if hurried:
            self._keep(query, [word])
        else:
            self._keep_ways(query, word, budget, AT_ONCE)

    def look_for_better_ways(self, budget: Budget) -> None:
        """Better ways past past obstacles, and others beside them."""
        if self.ways and (self.problem.obstacles or self.problem.place_costs):
            self._keep_ways(self._query(self.aimed), self.ways[0], budget, WITH_TIME)
        elif not self.ways and self.alone is not None:
            better = self._found(self._planned(self.problem, budget, improve=True))
            if better is not None and better.cost < self.alone.cost:
                self.alone = better

    def _keep_ways(
        self, query: LatticeQuery, word: Word, budget: Budget, schedule: WordSchedule
    ) -> None:
        better = words_of(query, budget=budget, schedule=schedule, known=word).to_the_end()
        self.expansions += better.expansions
        self._keep(query, [better.word, word, *better.others, *self.ways])

    def _keep(self, query: LatticeQuery, words: Sequence[Word]) -> None:
        """Keep the cheapest of some words as its ways, of those that meet their goals."""
        words = [one for one in words if self._meets(query, one)] or words
        words = sorted(words, key=lambda one: one.cost)
        distinct = {tuple(one.trims.tolist()): one for one in reversed(words)}
        self.ways = list(distinct.values())[::-1][:WAYS]
        self.alone = self._word_found(query, self.ways[0], self.aims)

    def _meets(self, query: LatticeQuery, word: Word) -> bool:
        """Whether the plan of a word ends at its goal as a check of it asks."""
        goal = query.problem.goals[query.goal_index[word.goal]]
        distance, turn = goal.off(plan_of_word(query, word).end)
        return distance <= goal.tolerance_m + MET and turn <= goal.tolerance_rad + MET

    def _steps(self, plan: Plan) -> list[tuple[int, int, float]]:
        """The moving trims of a plan that switches at will, with their times [s]."""
        word = word_of_plan(self.problem.automaton, plan)
        assert word is not None
        moving = [k for k, trim in enumerate(plan.trims) if not trim.is_rest]
        return [(SWITCH, int(word.trims[k]), float(word.durations[k])) for k in moving]

    def own(self, plan: Plan, goal_index: int | None = 0, *, cost: float | None = None) -> OwnPlan:
        """A plan as its own; it has its price if no cost is given."""
        cost = self.problem.cost_of(plan) if cost is None else cost
        return OwnPlan(plan, cost, goal_index or 0, self.course_of(plan))

    def _word_found(
        self, query: LatticeQuery, word: Word, aims: Sequence[tuple[int, Goal]]
    ) -> OwnPlan:
        goal_index = aims[query.goal_index[word.goal]][0]
        # in a search the prices of places are not exact
        cost = None if self.problem.place_costs else word.cost + query.padding
        return self.own(plan_of_word(query, word), goal_index, cost=cost)

    def _found(self, result: PlanResult) -> OwnPlan | None:
        if result.plan is None or result.cost is None:
            return None
        return self.own(result.plan, result.goal_index, cost=result.cost)

    def past(
        self,
        others: Sequence[Obstacle],
        budget: Budget,
        *,
        most: int = QUICK,
        known: float = math.inf,
        again: bool = False,
        schedule: WordSchedule | None = AT_ONCE,
    ) -> OwnPlan | None:
        """The cheapest way found past what the others do; None if there is none below a cost.

        A word is improved by the `schedule`, any other plan if searched for `again`; without a
        schedule the first word that is found is taken.
        """
        others = [standing_still(one) for one in self.beside(others)]
        if not others:
            return self.alone if self.alone is not None and self.alone.cost < known else None
        problem = replace(self.problem, obstacles=(*self.problem.obstacles, *others))
        if not self.ways:
            # No search among moving obstacles sees at once that one of them stays at the goal.
            if not self._aims(self._past_the_arrived(others)):
                return None
            most = max(most, LONG)
            found = self._found(self._planned(problem, budget, improve=again, most=most))
            return found if found is not None and found.cost < known else None
        own, aims = self.aimed, self.aims
        query = self._query(
            replace(problem, goals=own.goals) if own is not self.problem else problem
        )
        best: Word | None = None
        for way in (*self.ways, *filter(None, [self.aside])):
            if way.cost >= (best.cost if best else known) or budget.is_over:
                break
            timed = with_waits(query, way, hurried=schedule is None)
            if timed is not None and timed.cost < (best.cost if best else known):
                best = timed
        if best is None:
            past = self._past_the_arrived(others)
            aims = self._aims(past)
            if not aims:
                return None
            goals = tuple(goal for _, goal in aims)
            past = past if goals == past.goals else replace(past, goals=goals)
            if goals != own.goals:
                own, query = replace(own, goals=goals), self._query(replace(problem, goals=goals))
            # round those that stay at their goals, wherever they are now, with rests
            if blocked_ends(past) is None:
                word = self._first(self._query(past), budget, QUICK).word
                best = word and with_waits(query, word, hurried=schedule is None)
        if best is None or (schedule is not None and best.cost > NEARLY * self.ways[0].cost):
            word = self._first(query, budget, most).word
            if word is not None and word.cost < (best.cost if best else math.inf):
                best = word
        if best is None and most >= LONG and self.alone is not None:
            best = by_a_refuge(own, query, self._query, self.alone.plan, budget)
        if best is None:
            return None
        if schedule is not None:
            best = words_of(query, budget=budget, schedule=schedule, known=best).to_the_end().word
        return self._word_found(query, best, aims) if best.cost < known else None

    def leg(
        self,
        before: OwnPlan | None,
        others: Sequence[Obstacle],
        begin: float,
        budget: Budget,
        *,
        aim: Goal | None = None,
        most: int = QUICK,
    ) -> OwnPlan | None:
        """A plan from where it stands at a time [s], past others that all stand: home, or aside.

        It stands at its start, or where what it has driven `before` ends.
        """
        goals = self.aimed.goals if aim is None else (aim,)
        start, trim = self.problem.start, None
        if before is not None:
            start = before.plan.end
            trim = self.problem.last_trim(goals[0]).name
        past = self.problem.starting_at(start, time=begin, goals=goals, trim=trim)
        past = replace(past, obstacles=(*self.problem.obstacles, *self.beside(others)))
        aims = ((0, aim),) if aim is not None else self._aims(past)
        past = replace(past, goals=tuple(goal for _, goal in aims) or goals)
        if not aims or blocked_ends(past) is not None:
            return None
        if not self.ways:
            most = max(most, LONG)
            return self._found(self._planned(past, budget, improve=False, most=most))
        query = self._query(past)
        found = words_of(query, budget=budget, schedule=replace(AT_ONCE, most=most)).to_the_end()
        self.expansions += found.first.expansions if found.first else 0
        return None if found.word is NO_WORD else self._word_found(query, found.word, aims)

    def refuges(
        self, before: OwnPlan | None, way: OwnPlan, others: Sequence[Obstacle], begin: float
    ) -> list[Goal]:
        """Poses off the way of another vehicle, and off others, the nearest to it first."""
        start = self.problem.start if before is None else before.plan.end
        around = (*self.problem.obstacles, *self.beside([*others, *way.course.obstacles]))
        past = replace(self.problem.starting_at(start, time=begin), obstacles=around)
        poses = refuges(past, self._query(past), way.plan, off=True)
        return [Goal(pose=np.append(pose, start[3:])) for pose in poses]

    def then(self, before: OwnPlan | None, leg: OwnPlan, begin: float) -> OwnPlan:
        """What it has driven before, a rest until a time [s], and another leg."""
        automaton = self.problem.automaton
        at = self.problem.start_time if before is None else before.arrival
        plan = replace(leg.plan, start_time=begin)
        if begin > at and automaton.rest is not None:
            rest = plan.trims[0] if plan.trims else self.problem.first_trim
            rest = rest if rest.is_rest else automaton.trims[automaton.rest]
            plan = followed_by(
                Plan(plan.start, (rest,), durations=[begin - at], start_time=at), plan
            )
        if before is not None:
            plan = followed_by(before.plan, plan)
        return self.own(plan, leg.goal_index)

    def keep_aside(self, found: OwnPlan) -> None:
        """Keep a way on which it makes room for others, to drive it at other times."""
        plan, exact = found.plan, not (self.problem.goals[0].tolerance_m or len(self.aims) > 1)
        if self.ways and exact and not self.problem.goals[0].tolerance_rad:
            self.aside = self._query(self.aimed).word_of(self._steps(plan), goal=0)

    def _past_the_arrived(self, others: Sequence[Obstacle]) -> Problem:
        """Its problem where those that stay at their goals stand there already."""
        arrived = [
            one if one.motion is None else where_it_stays(one)
            for one in others
            if one.motion is None or one.presence[1] == math.inf
        ]
        return replace(self.problem, obstacles=(*self.problem.obstacles, *arrived))

    @functools.cached_property
    def aims(self) -> tuple[tuple[int, Goal], ...]:
        """Goals, or else free poses within their tolerances, each with its goal's number."""
        goals = tuple(enumerate(self.problem.goals))
        if not all(why_goal_blocked(self.problem, goal) for goal in self.problem.goals):
            return goals
        return self._within_tolerances(self.problem) or goals

    @functools.cached_property
    def aimed(self) -> Problem:
        """Its problem with poses that it may end at for goals."""
        goals = tuple(goal for _, goal in self.aims)
        return self.problem if goals == self.problem.goals else replace(self.problem, goals=goals)

    def _aims(self, past: Problem) -> tuple[tuple[int, Goal], ...]:
        """Where it may end among those that stay, as `aims`; empty if nowhere."""
        if self.leaves or not all(why_goal_blocked(past, goal) for goal in self.aimed.goals):
            return self.aims
        return self._within_tolerances(past)

    def _within_tolerances(self, among: Problem) -> tuple[tuple[int, Goal], ...]:
        """A few free poses within the tolerance of each goal, with its number."""
        return tuple(
            (k, aim)
            for k, goal in enumerate(among.goals)
            if goal.tolerance_m or goal.tolerance_rad
            for aim in itertools.islice(free_aims(among, goal), MOST_AIMS)
        )

    def _planned(
        self, problem: Problem, budget: Budget, *, improve: bool, most: int = LONG
    ) -> PlanResult:
        """What the planner answers for one that does not switch at will, by counted work."""
        counted = [most] if improve or problem is not self.problem else []
        counted += filter(None, [problem.search.max_expansions])
        search = replace(problem.search, improve=improve, max_expansions=min(counted, default=None))
        if problem.obstacles == self.workspace.obstacles:
            workspace = self.workspace
        else:
            workspace = Workspace(problem.obstacles, self.workspace.prepared)
        wanted = replace(problem, search=search)
        result = plan_in(workspace, wanted, time_limit=max(budget.left, LEAST_S), alternatives=0)
        self.expansions += result.counts.get("expansions", 0)
        return result

    def _query(self, problem: Problem) -> LatticeQuery:
        return lattice_query(problem, goals_left(problem), prepared=self.workspace.prepared)

    def _first(self, query: LatticeQuery, budget: Budget, most: int) -> FirstPlan:
        """The first word that a search finds with so many expansions, which are counted."""
        first = first_plan(query, budget=budget._replace(expansions=most))
        self.expansions += first.expansions
        return first


def courses_of(
    vehicles: Sequence[FleetMember], plans: Mapping[int, OwnPlan]
) -> dict[int, FleetCourse]:
    """The courses of all, by number: who has no plan stands at its start."""
    return {
        one.number: plans[one.number].course if one.number in plans else one.standing
        for one in vehicles
    }


def prepare_vehicles(vehicles: Sequence[FleetMember]) -> None:
    """Have ready what every search of a fleet needs, once for each kind and map."""
    load_vehicles(vehicles)
    for one in _kinds(vehicles):
        prepare(one.problem, one.workspace)


def load_vehicles(vehicles: Sequence[FleetMember]) -> None:
    """Compile or load what every search of a fleet needs, before its clock runs."""
    for one in _kinds(vehicles):
        load(one.problem, one.workspace)
    load_kernels("lattice", "improvement", "meetings")


def _kinds(vehicles: Sequence[FleetMember]) -> list[FleetMember]:
    """One vehicle for each automaton on each map."""
    return list({(id(one.problem.automaton), id(one.workspace)): one for one in vehicles}.values())


def vehicles_of(fleet: FleetProblem, prepared: Prepared | None = None) -> list[FleetMember]:
    """The vehicles of a fleet, which share what is prepared: anew, or with others."""
    prepared = Prepared() if prepared is None else prepared
    workspaces: dict[tuple[int, ...], Workspace] = {}
    # Every search keeps its own margin from what it must not touch: what that lacks of the fleet's,
    # the others are larger by.
    grown = max(fleet.margin - min(problem.margin for problem in fleet.problems), 0.0)
    vehicles = []
    for k, problem in enumerate(fleet.problems):
        key = tuple(map(id, problem.obstacles))
        workspace = workspaces.setdefault(key, Workspace(problem.obstacles, prepared))
        settings = replace(problem.search, improve=False)
        # Obstacles of its own may move too, and pass where it stays.
        horizon = replace(problem.horizon, stay=not fleet.leaves[k])
        own = replace(problem, search=settings, obstacles=workspace.obstacles, horizon=horizon)
        vehicles.append(FleetMember(k, fleet.names[k], own, fleet.leaves[k], grown, workspace))
    return vehicles
