"""Plans of a step over trims and maneuvers, from the end of the maneuver under way on.

They serve every vehicle that does not switch at will, and conditions that the others do not know:
zones, heights of obstacles, a fixed time that no rest fills. Among moving obstacles every step
holds a motion that stays free: a plan to the goal after which it may stand there, or leave in time,
or the begin of one and then a fail-safe trajectory, or that alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from maneuver_automaton.audit import closest_to
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import head_of
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.checking import what_is_hit
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.on_the_spot import maneuvers_between
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.candidates import StepPlan, allowed, bounded
from maneuver_automaton.receding_horizon.failsafe import FailSafe, Mitigation, settled
from maneuver_automaton.receding_horizon.log import Decision, Origin
from maneuver_automaton.receding_horizon.rest_of_plan import followed_by, moves_on, rested
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.receding_horizon.step_search import NEARLY, StepSearch
from maneuver_automaton.refinement.fitting import fitted_plans
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_trims import priced_library
from maneuver_automaton.search.result import TIE, plan_of

FIRST_SHARE = 0.5  # of a step's time limit, for the words of the first step
WORDS_SHARE = 0.2  # of it for words where something is in the way and no plan is kept
PLANNER_SHARE = 0.7  # of the time for plans where something moves, before the lattice has its turn
HEEDLESS_SHARE = 0.5  # of the time they leave, for a path past what stands still
OTHERS = 3  # costlier words that are tried where the cheapest ones are not free
NEARER = (NEARLY, 0.8, 0.6, 0.4)  # of a lost plan as far as it is free, where one may stand
NEARER_SHARE = 0.4  # of the time left for the way there, which takes at most ...
ROUNDABOUT = 2.0  # times as long as the plan did
HALVINGS = 10  # of a plan's duration, to find out when it is hit


class OverManeuvers(StepSearch):
    """Words of trims and maneuvers, then their lattice, checked by FCL."""

    finds_words = False

    def __init__(self, now: Situation) -> None:
        super().__init__(now)
        self.anew = now.here.moves or now.changed  # obstacles are not where they were

    def is_safe(self, plan: Plan) -> bool:
        """As of every step; the rest of the last plan, driven as it said, was checked before."""
        if plan is self.now.rest and self.now.off_plan == 0.0 and not self.anew:
            return True
        return super().is_safe(plan)

    def is_free(self, plan: Plan) -> bool:
        """Whether all of a plan is free."""
        return not what_is_hit(self.here, plan, self.here.goals[0])

    def _hit(self, plan: Plan, *, until: float = -math.inf) -> str:
        """The obstacle that a plan hits, or that comes to its rest; empty if there is none."""
        last = self._last_trim(plan)
        if self.here.moves and last.is_rest:
            plan = rested(plan, last, max(self.stand, until - (plan.start_time + plan.duration)))
        return what_is_hit(self.here, plan, self.here.goals[0])

    def _last_trim(self, plan: Plan) -> Trim:
        """The trim in which a plan ends; one without trims stays in that of the vehicle."""
        return plan.trims[-1] if plan.trims else self.now.trim

    def may_end(self, plan: Plan) -> bool:
        """Whether a plan is free, and a vehicle that stands at its end can stay, or go in time."""
        if self._hit(plan):
            return False
        last = self._last_trim(plan)
        if not self.here.moves or not last.is_rest:
            return True  # without rest the end of the plan is the end
        found = self.leaving(rested(plan, last, self.stand))
        return not self._hit(plan, until=self.until) if found is None else found.complete

    def leaving(self, piece: Plan) -> FailSafe | None:
        """A fail-safe trajectory from the end of a piece; None if its trim is no trim of here."""
        if not piece.trims or piece.trims[-1].name not in self.here.automaton:
            return None
        at = piece.start_time + piece.duration
        return self.fail_safe_from(piece.end, at, piece.trims[-1].name)

    def continued(self, plan: Plan, after: float) -> Plan | None:
        """The first seconds of a plan, then a fail-safe trajectory, if FCL finds nothing either."""
        whole = super().continued(plan, after)
        return None if whole is None or not allowed(self.here, whole) or self._hit(whole) else whole

    def cheaper(self, kept: StepPlan | None) -> list[StepPlan]:
        """The cheapest safe word for each goal, if it costs less than the kept plan.

        At first a planner is asked instead among obstacles: it looks at words too.
        """
        now, here = self.now, self.here
        problem = self.onward()
        if problem is None or problem.has_states:
            return []  # a planner alone knows of states that no trim has
        if now.last is None and (here.obstacles or here.zones):
            return []
        upper = math.inf  # bound of the cost of a plan
        if kept is not None:
            upper = kept.cost - self.settings.margin - TIE * (1.0 + abs(kept.cost))
        committed = 0.0 if now.head is None else here.cost_of(now.head)
        share = FIRST_SHARE if now.last is None else 1.0
        guarded = bool(here.obstacles or here.zones) or bounded(here)
        if guarded and kept is None and now.last is not None:
            share = WORDS_SHARE
        found: list[StepPlan] = []
        for index in open_goals(problem):
            if self.for_plans.is_over:
                break
            words = search_insertion(
                problem,
                problem.goals[index],
                budget=self.for_plans.part(share),
                alternatives=OTHERS if guarded else 0,
                upper_bound=upper - committed,
            )
            for word in words.solutions:
                whole = now.whole(plan_of(problem, word))
                cost = here.cost_of(whole)
                if cost < upper and self.is_safe(whole):
                    found.append(now.candidate(whole, index, Origin.SEARCHED))
                    upper = cost
        return found

    def onward(self) -> Problem | None:
        """The problem from the end of the committed part; None if the library lacks its trim."""
        onward = self.now.onward
        if onward is None:
            return None
        if self.now.last is None:
            return settled(onward)
        name = self.now.trim.name
        if name not in onward.automaton:
            return None  # a plan with trims of its own is driven to its end
        return settled(replace(onward, start_trim=name, start_state=None))

    def otherwise(self) -> StepPlan | None:
        """The plan of the lattice, or of a planner, which is asked alone at first.

        Where something moves the planner comes first: it knows how to stop and steer as well.
        """
        if self.here.moves:
            return self.planned_anew(PLANNER_SHARE) or self._on_lattice()
        first = self.now.last is None
        found = self._on_lattice() if self.anew or not first else None
        return self.planned_anew() if found is None else found

    def _on_lattice(self) -> StepPlan | None:
        problem = self.onward()
        return None if problem is None else self._best_on_lattice(problem, self.is_safe)

    def _best_on_lattice(
        self, problem: Problem, is_good: Callable[[Plan], bool], *, first: bool = False
    ) -> StepPlan | None:
        """The cheapest good plan of the lattice, or its first, after the committed part."""
        if problem.has_states or not problem.automaton.maneuvers:
            return None
        goals = open_goals(problem)
        if not goals:
            return None
        query = lattice_query(problem, goals)
        best: StepPlan | None = None
        budget = self.now.budget.part(HEEDLESS_SHARE) if first else self.for_plans
        budget = budget._replace(expansions=problem.search.max_expansions)
        for word in words_of(query, budget=budget, schedule=WordSchedule()):
            owner = query.goal_index[word.goal]
            for plan in fitted_plans(problem, plan_of_word(query, word), problem.goals[owner]):
                one = self.now.candidate(self.now.whole(plan), owner, Origin.SEARCHED)
                if (best is None or one.cost < best.cost) and is_good(one.plan):
                    best = one
                    break
            if first and best is not None:
                break
        return best

    def why_none(self) -> str:
        """Why there is no plan to the goal."""
        off = self.now.off_plan or 0.0
        return f"no word was found to the goal from {off:.3g} off the plan{self.reason}"

    def fail_safe(self) -> Iterator[tuple[Plan, Decision]]:
        """Fail-safe trajectories: to go on for a while, to brake, to evade, or the last plan.

        The last plan comes first unless something moves. The committed part is driven in any case.
        """
        rest, here = self.now.rest, self.here
        yield from self.approaches() if here.moves else self._nearer()
        motions = [self._braking(), rest] if here.moves else [rest, self._braking()]
        kept = [plan for plan in motions if plan is not None and plan.trims]
        self.tried = [*kept]
        for until in (self.until, -math.inf):
            for plan in kept:
                if not self._hit(plan, until=until):
                    yield plan, Decision.APPROACHED if moves_on(plan) else Decision.STOPPED
            if here.moves and until == self.until:
                yield from self._evasions()

    def _nearer(self) -> Iterator[tuple[Plan, Decision]]:
        """Ways to places on a plan that has just been lost, the furthest first, to stand there."""
        now, rest, automaton = self.now, self.now.rest, self.here.automaton
        lost = now.last is not None and now.last.decision.leads
        if rest is None or automaton.rest is None or not lost:
            return
        reach = self._contact(rest).contact - rest.start_time
        for after in (share * reach for share in NEARER if share * reach > now.busy):
            place, stands = rest.pose_at(rest.start_time + after), automaton.trims[automaton.rest]
            still = Plan(place, (stands,), durations=[0.0])
            found = self.planned_anew(NEARER_SHARE, improve=False, then=still)
            direct = found is not None and found.plan.duration <= ROUNDABOUT * reach
            if found is not None and direct and not self._hit(found.plan):
                yield found.plan, Decision.APPROACHED

    def heedless(self, static: Problem) -> Plan | None:
        """A plan to the goal of the problem without what moves in it: the lattice's first."""
        found = self._best_on_lattice(static, lambda plan: allowed(self.here, plan), first=True)
        return None if found is None else found.plan

    def _evasions(self) -> Iterator[tuple[Plan, Decision]]:
        """Free motions from the end of the committed part, or from that of the last plan."""
        for begun in (self._standing(0.0), self.now.rest):
            if begun is None or not begun.trims:
                continue
            found = self.leaving(begun)
            if found is None:
                continue
            plan = followed_by(begun, found.plan)
            if found.complete and not self._hit(plan, until=self.until):
                yield plan, Decision.EVADED if moves_on(found.plan) else Decision.STOPPED
            self.tried.append(plan)

    def _braking(self) -> Plan | None:
        """The committed part, then the quickest maneuvers to rest; None if there are none."""
        begin, automaton = self.now.trim, self.here.automaton
        if begin.is_rest or (self.now.last is None and not self.anew):
            return self._standing(self.settings.step)
        if automaton.rest is None:
            return None
        trims, driven = [begin, automaton.trims[automaton.rest]], list[Maneuver | None]()
        if begin.name not in automaton:  # a plan may drive at any speed
            driven += maneuvers_between(automaton.model, *trims)[:1]
            if not driven:
                return None
        else:
            library = priced_library(automaton, Cost(time=1.0))
            source = automaton.index_of(begin.name)
            pair = library.class_pair(source, automaton.rest)
            if not math.isfinite(library.transitions.cost[pair]):
                return None
            links = library.chain(source, automaton.rest)
            trims = [begin, *(automaton.trims[target] for _, target in links)]
            driven += (automaton.maneuvers[k] if k >= 0 else None for k, _ in links)
        lasting = [0.0] * len(driven) + [self.settings.step]
        plan = Plan(self.here.start, tuple(trims), durations=lasting, maneuvers=tuple(driven))
        return self._then(plan)

    def _standing(self, lasting: float) -> Plan:
        """The committed part, then so long [s] at rest; no time in a trim that moves."""
        lasting = lasting if self.now.trim.is_rest else 0.0
        return self._then(Plan(self.here.start, (self.now.trim,), durations=[lasting]))

    def _then(self, plan: Plan) -> Plan:
        """The committed part, then `plan`, wherever that starts."""
        if self.now.head is not None:
            return followed_by(self.now.head, plan)
        return replace(plan, start_time=self.here.start_time)

    def mitigation(self) -> Mitigation:
        """Of braking and driving on, the motion that is hit later."""
        found = [self._contact(plan) for plan in self.tried or [self._standing(self.settings.step)]]
        return max(found, key=lambda one: one.contact)

    def _contact(self, plan: Plan) -> Mitigation:
        """When a plan is hit first, by halving, and the obstacle."""
        free, hit = 0.0, plan.duration
        for _ in range(HALVINGS):
            middle = 0.5 * (free + hit)
            if what_is_hit(self.here, head_of(plan, middle), self.here.goals[0]):
                hit = middle
            else:
                free = middle
        reason = self._hit(plan) or "nothing stops the vehicle, and nothing leads on"
        return Mitigation(
            plan=plan, contact=plan.start_time + free, clearance=math.inf, reason=reason
        )


def needs_maneuvers(problem: Problem) -> bool:
    """Whether plans are words with maneuvers, or obey conditions unknown to the other searches."""
    unfilled = problem.horizon.time is not None and problem.automaton.rest is None
    if problem.has_inertia or unfilled:
        return True
    return bool(problem.zones) or problem.climbs_among_obstacles


def within_its_margin(here: Problem) -> tuple[Problem, str]:
    """The problem with a margin that the vehicle's own body keeps, and the one that it breaks.

    One that is closer to an obstacle than the margin keeps half of its clearance.
    """
    body = replace(here, parts={}, zones=())
    nowhere = Plan(here.start, (), durations=[], start_time=here.start_time)
    if not what_is_hit(body, nowhere, here.goals[0]):
        return here, ""
    found = closest_to(
        nowhere,
        here.automaton.model,
        here.obstacles,
        footprint=here.footprint,
        body_height=here.body_height,
    )
    clearance = max(found.distance, 0.0)
    broken = f"the clearance is {clearance:.3g} m, need {here.margin:g} m"
    return replace(here, margin=0.5 * min(clearance, here.margin)), broken
