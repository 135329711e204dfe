"""Plans of a step over trims and maneuvers, from the end of the maneuver under way on.

They serve every vehicle that does not switch at will, and conditions that the others do not know:
zones, heights of obstacles, a fixed time that no rest fills.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import head_of
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import plan as planned
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.checking import what_is_hit
from maneuver_automaton.planning.needs import climbs_among_obstacles
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed, bounded
from maneuver_automaton.receding_horizon.failsafe import last_event
from maneuver_automaton.receding_horizon.log import Deed, Origin
from maneuver_automaton.receding_horizon.mitigation import Mitigation
from maneuver_automaton.receding_horizon.settings import EXACT, switches_at_will
from maneuver_automaton.receding_horizon.shifting import followed_by, moves_on, rested
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.refinement.fitting import fitted_plans
from maneuver_automaton.refinement.incumbent_words import incumbent_words
from maneuver_automaton.search.alternatives import TIE
from maneuver_automaton.search.insertion import search_insertion
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_trims import priced_library
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.word_plan import plan_of_word

FIRST_SHARE = 0.5  # of a step's time limit, for the words of the first step
OTHERS = 3  # dearer words that are tried where the cheapest ones are not free
HALVINGS = 10  # of a plan's duration, to find out when it is hit


class OverManeuvers:
    """A `StepSearch`: words of trims and maneuvers, then their lattice, checked by FCL."""

    free_until = None
    knows_all = False
    improves = False

    def __init__(self, now: Situation) -> None:
        self.now = now
        self.here = now.here
        self.settings = now.settings
        self.anew = now.here.moves or now.changed  # obstacles are not where they were
        self.reason = ""
        self.tried: list[Plan] = []  # motions that are hit

    def is_safe(self, plan: Plan) -> bool:
        """Whether a plan stays inside the bounds, is collision-free, and may stand at its end.

        The rest of the last plan, from where it had said the vehicle would be, was checked before.
        """
        if plan is self.now.rest and self.now.off_plan == 0.0 and not self.anew:
            return True
        return allowed(self.here, plan) and not self._hit(plan)

    def _hit(self, plan: Plan, *, until: float = -math.inf) -> str:
        """The obstacle that a plan hits, or that comes to its end at rest; empty if there is none.

        It must be free to stand there for a while, and until a time [s] of the world's clock.
        """
        if self.here.moves and plan.trims and plan.trims[-1].is_rest:
            stand = max(self.settings.stand, self.settings.step)
            arrival = plan.start_time + plan.duration
            plan = rested(plan, plan.trims[-1], max(stand, until - arrival))
        return what_is_hit(self.here, plan, self.here.goals[0])

    def cheaper(self, kept: Candidate | None) -> list[Candidate]:
        """The cheapest safe word for each goal, if it costs less than the kept plan.

        At first a planner is asked instead among obstacles: it looks at words too.
        """
        now, here = self.now, self.here
        problem = self._onward()
        if problem is None or (now.last is None and (here.obstacles or here.zones)):
            return []
        upper = math.inf  # bound of the cost of a plan
        if kept is not None:
            upper = kept.cost - self.settings.margin - TIE * (1.0 + abs(kept.cost))
        committed = 0.0 if now.head is None else here.cost_of(now.head)
        guarded = bool(here.obstacles or here.zones) or bounded(here)
        found: list[Candidate] = []
        for index, goal in enumerate(problem.goals):
            if now.budget.is_over:
                break
            words = search_insertion(
                problem,
                goal,
                budget=now.budget.part(FIRST_SHARE if now.last is None else 1.0),
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

    def _onward(self) -> Problem | None:
        """The problem from the end of the committed part; None if the library lacks its trim."""
        onward = self.now.onward
        if onward is None:
            return None
        if self.now.last is None:
            return onward
        name = self.now.trim.name
        if name not in onward.automaton.trim_names:
            return None  # a plan with trims of its own is driven to its end
        return replace(onward, start_trim=name)

    def otherwise(self) -> Candidate | None:
        """The plan of the lattice, or of a planner, which is asked alone at first."""
        first = self.now.last is None
        found = self._on_lattice() if self.anew or not first else None
        return self._planned() if found is None else found

    def _on_lattice(self) -> Candidate | None:
        problem = self._onward()
        if problem is None or not problem.automaton.maneuvers:
            return None
        goals = open_goals(problem)
        if not goals:
            return None
        query = lattice_query(problem, goals)
        best: Candidate | None = None
        for incumbent in incumbent_words(
            query, budget=replace(self.now.budget, expansions=problem.search.max_expansions)
        ):
            if incumbent.word is None:
                continue
            owner = query.goal_index[incumbent.word.goal]
            for plan in fitted_plans(
                problem, plan_of_word(query, incumbent.word), problem.goals[owner]
            ):
                one = self.now.candidate(self.now.whole(plan), owner, Origin.SEARCHED)
                if (best is None or one.cost < best.cost) and self.is_safe(one.plan):
                    best = one
                    break
        return best

    def _planned(self) -> Candidate | None:
        """The plan that a planner finds from the end of the committed part."""
        now, limit, problem = self.now, self.now.longest, self._onward()
        if problem is None:
            return None
        result = planned(problem, time_limit=max(now.budget.left, 1e-3))
        if result.plan is None or result.goal_index is None:
            self.reason = f": {result.reason}"
            return None
        plan, index = now.whole(result.plan), result.goal_index
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            self.reason = ": it takes too long"
        elif self.here.moves and not self.is_safe(plan):
            self.reason = ": the goal does not stay free after arrival"
        else:
            return now.candidate(now.padded(plan), index, Origin.SEARCHED)
        return None

    def why_none(self) -> str:
        """Why there is no plan to the goal."""
        off = self.now.off_plan or 0.0
        return f"no word was found to the goal from {off:.3g} off the plan{self.reason}"

    def fail_safe(self) -> Iterator[tuple[Plan, Deed]]:
        """Fail-safe trajectories: to brake, or to drive the last plan to its end.

        The last plan comes first unless obstacles have changed. The committed part is driven in
        any case.
        """
        rest, here = self.now.rest, self.here
        motions = [self._braking(), rest] if self.anew else [rest, self._braking()]
        self.tried = [plan for plan in motions if plan is not None and plan.trims]
        ahead = min(here.start_time + self.settings.look_ahead, last_event(here))
        for until in (ahead, -math.inf):
            for plan in self.tried:
                if not self._hit(plan, until=until):
                    yield plan, Deed.APPROACHED if moves_on(plan) else Deed.STOPPED

    def _braking(self) -> Plan | None:
        """The committed part, then the quickest maneuvers to rest; None if there are none."""
        begin, automaton = self.now.trim, self.here.automaton
        if begin.is_rest or (self.now.last is None and not self.anew):
            return self._standing()
        if automaton.rest is None or begin.name not in automaton.trim_names:
            return None
        library = priced_library(automaton, Cost(time=1.0))
        source = automaton.index_of(begin.name)
        if not math.isfinite(library.transitions.cost[library.class_pair(source, automaton.rest)]):
            return None
        links = library.chain(source, automaton.rest)
        trims = (begin, *(automaton.trims[target] for _, target in links))
        maneuvers = tuple(automaton.maneuvers[k] if k >= 0 else None for k, _ in links)
        lasting = [0.0] * len(links) + [self.settings.step]
        return self._then(Plan(self.here.start, trims, durations=lasting, maneuvers=maneuvers))

    def _standing(self) -> Plan:
        """The committed part, then a step at rest; no time in a trim that moves."""
        lasting = self.settings.step if self.now.trim.is_rest else 0.0
        return self._then(Plan(self.here.start, (self.now.trim,), durations=[lasting]))

    def _then(self, plan: Plan) -> Plan:
        """The committed part, then `plan`, wherever that starts."""
        if self.now.head is not None:
            return followed_by(self.now.head, plan)
        return replace(plan, start_time=self.here.start_time)

    def mitigation(self) -> Mitigation:
        """Of braking and driving on, the motion that is hit later."""
        found = [self._contact(plan) for plan in self.tried or [self._standing()]]
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

    def lower_bound(self) -> float:
        """None is known of plans that need not be words of the library."""
        return 0.0


def needs_maneuvers(problem: Problem) -> bool:
    """Whether plans are words with maneuvers, or obey conditions unknown to the other searches."""
    unfilled = problem.horizon.time is not None and problem.automaton.rest is None
    if not switches_at_will(problem) or unfilled:
        return True
    return bool(problem.zones) or climbs_among_obstacles(problem)


def with_trims_at_ends(problem: Problem) -> Problem:
    """The problem with a trim at its start and goals, where a kinematic vehicle has no rest.

    Which one it is makes no difference: it lasts no time, and is left at will.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> with_trims_at_ends(Problem(robot, [0, 0, 0], [1, 0, 0])).start_trim
    'ahead'
    """
    automaton = problem.automaton
    if automaton.rest is not None or not automaton.is_kinematic:
        return problem
    name = automaton.trim_names[0]
    return replace(
        problem,
        start_trim=problem.start_trim or name,
        goals=tuple(replace(goal, trim=goal.trim or name) for goal in problem.goals),
    )
