"""Plans that were found and passed every check, and the answer that is made of them."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit import Audit, terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import CONVERGED, Likeness, is_new, same_motion
from maneuver_automaton.budget import FIRST_LATE, Budget
from maneuver_automaton.planning.checking import Condition, TooLate, check_plan, what_is_hit
from maneuver_automaton.planning.on_the_way import passed_on_the_way
from maneuver_automaton.planning.result import (
    Alternative,
    Answer,
    LowerBound,
    PlanResult,
    PlanStatus,
    Workspace,
)
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.fitting import (
    COSTLIER,
    broken_condition,
    fitted_plans,
    has_short_coasts,
    nearly_met,
    padded,
    with_lasting_coasts,
)
from maneuver_automaton.search import beginning
from maneuver_automaton.search import lattice as lattice_search
from maneuver_automaton.search.limits import stays_inside

ROUNDING = 1e-12  # relative, of sums of costs
CHEAPER = 1e-7  # share of a cost that closing the end of a plan may change it by
LATE = 8  # plans that may be refused once the time is over, before no other is checked
OTHERS_SHARE = 0.1  # of the time, that is kept back for the checks of alternatives
CHECK_S = 0.01  # [s] a check takes that nothing is known of yet
LEAST_TIME = 1e-3  # [s] for each question, also where the time is over
SOON_SHARE, SOON = 0.08, 0.02  # of the time for a first turn of all questions; [s] of one at least
SOON_TURNS = 2  # that questions try before others do, the second twice as long
LONGER = 1.3  # times the longest check so far, that the next one may take


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Accepted:
    """A plan that passed every check."""

    plan: Plan
    goal_index: int
    cost: float
    audit: Audit
    offered: float  # its cost before short trims were left out
    short: bool = False  # whether it has trims so short that one without them may cost a bit more

    @property
    def price(self) -> float:
        """What others are compared with: its cost, or what it may cost without short trims."""
        return self.cost * (1.0 + COSTLIER) if self.short else self.cost

    @property
    def rank(self) -> tuple[float, int]:
        """Its place among others: by price but for rounding, then by the number of its trims."""
        return float(f"{self.price:.10g}"), len(self.plan.trims)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A plan that has still to be checked; it is made when it is its turn."""

    cost: float
    goal_index: int
    plan: Callable[[], Plan]
    proven: bool = True  # the search took it to be free


@dataclass(slots=True, eq=False)
class Ending:
    """What the steps of planning have come to know beside plans: the answer is made of both."""

    is_complete: bool = False  # no step follows: all that is to be said is here
    verdict: PlanResult | None = None  # the whole answer, where no plan is looked for
    why: tuple[PlanStatus, str] | None = None  # there is no plan, where it is not as of all steps
    bound: LowerBound | None = None  # no plan is cheaper
    searched: float | None = None  # [s] when improving began; None: with the first plan
    nodes: Array | None = None  # expanded ones, if asked for
    proof: str = ""  # why no plan can exist
    remark: str = ""  # what came of the paths of a simpler vehicle
    begun: beginning.Begun | None = None  # a search of the lattice that is under way
    lattice: lattice_search.FirstPlan | None = None  # how its search for a first plan ended
    finds_plans: bool = False  # words of the lattice are plans, which the checks only confirm


@dataclass(slots=True, eq=False)
class Incumbents:
    """Plans found for a problem, cheapest first: checked, each motion once, with its cost.

    This is the one place where a plan is refused, and a plan that breaks any condition of the
    problem is: horizon, limits of its trims, bounds, obstacles, zones, goal and dynamics.
    """

    problem: Problem
    budget: Budget
    workspace: Workspace
    alternatives: int = 0  # that are asked for beside the cheapest plan
    likeness: Likeness = CONVERGED  # of plans that count as one motion
    plans: list[Accepted] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)  # seconds, cost
    counts: Counter[str] = field(default_factory=Counter)
    refusals: list[tuple[Condition, str]] = field(default_factory=list)  # what was broken, how
    unchecked: int = 0  # plans whose checks were given up, as the time was over
    misfits: list[tuple[Plan, int]] = field(default_factory=list)  # of no times that would do
    least_cost: float = math.inf  # cost of the cheapest plan that a search took to be free
    checking: float = 0.0  # [s] that the checks took
    longest_check: float = CHECK_S  # [s] of all so far
    ended: Ending = field(default_factory=Ending)

    @property
    def cost(self) -> float:
        """Cost of the cheapest plan, an upper bound; inf if there is none."""
        return self.plans[0].cost if self.plans else math.inf

    @property
    def for_better(self) -> Budget:
        """The budget for better plans: the time to check what is found is kept back."""
        others = OTHERS_SHARE * self.budget.seconds if self.alternatives else 0.0
        return self.budget.before(LONGER * self.longest_check + others)

    @property
    def for_first(self) -> Budget:
        """The budget for a first plan, before which there is nothing to return."""
        return self.budget.before(LONGER * (self.longest_check - CHECK_S))

    @property
    def for_checks(self) -> Budget:
        """The budget of a check: that of a first plan comes after the time, if need be."""
        return self.budget if self.plans else self.budget._replace(late=FIRST_LATE)

    @property
    def may_check(self) -> bool:
        """Whether there is time to check one more plan; always where there is none yet."""
        return not self.plans or self.budget.left_to_check >= self.longest_check

    @property
    def is_enough(self) -> bool:
        """Whether no better plan is asked for than those there are."""
        return not self.problem.search.improve and len(self.plans) > self.alternatives

    @property
    def wants_more(self) -> bool:
        """Whether a better plan is asked for, and there is time to look for one."""
        return not (self.budget.is_over or self.is_enough)

    @property
    def why_refused(self) -> str:
        """Why the first plan was refused; empty if none was."""
        return self.refusals[0][1] if self.refusals else ""

    @property
    def why_unchecked(self) -> str:
        """That plans were found too late; empty if none was."""
        late = f"a plan was found too late to be checked within {self.budget.seconds:.4g} s"
        return late if self.unchecked else ""

    def why_none(self, answers: Iterable[PlanResult] = ()) -> tuple[PlanStatus, str] | None:
        """Why there is no plan: all were refused, or one of the `answers` to questions is open."""
        if self.why_unchecked:
            return PlanStatus.OUT_OF_BUDGET, self.why_unchecked
        if self.why_refused:
            return PlanStatus.NO_PLAN, f"every plan found was refused: {self.why_refused}"
        left = (one for one in answers if one.status is PlanStatus.OUT_OF_BUDGET)
        return next(((one.status, one.reason) for one in left), None)

    @property
    def rejected(self) -> int:
        """How many plans were refused for more than their times."""
        return len(self.refusals) - self.refused(Condition.WORD)

    def refused(self, condition: Condition) -> int:
        """How many plans were refused for a condition."""
        return sum(broken is condition for broken, _ in self.refusals)

    def note(self, cost: float, *, at: float | None = None) -> None:
        """Note what a search has found `at` a time [s], now if omitted; it is checked later."""
        if cost < self.least_cost:
            self.least_cost = cost
            if not self.problem.place_costs:  # whose prices are not exact within a search
                self._tell(cost)
            self.improvements.append((self.budget.elapsed if at is None else at, cost))

    def offer(self, plan: Plan, goal_index: int, *, proven: bool = True) -> bool:
        """Keep a plan, or one of the same word that meets the horizon, if it passes the checks.

        Whether one passed them; what was not `proven` free may hit something without a word.
        """
        if any(one.plan is plan for one in self.plans):
            return True
        none_fits, goal, budget = True, self.problem.goals[goal_index], self.for_checks
        for fitted in fitted_plans(self.problem, plan, goal, budget=budget):
            none_fits = False
            lasting = self._with_lasting_coasts(fitted, goal)
            if lasting is not fitted and self._keep(lasting, goal_index, fitted, proven=False):
                return True
            if self._keep(fitted, goal_index, fitted, proven=proven):
                return True
        if none_fits and budget.left_to_check == 0.0:
            self.unchecked += 1
        elif none_fits and proven:
            reason = broken_condition(self.problem, padded(self.problem, plan))
            self.refusals.append((Condition.WORD, reason))
            self.misfits.append((plan, goal_index))
        return False

    def offer_nearly_met(self) -> None:
        """Offer what meets a goal for the checks, however far an exact end is from it."""
        for plan, goal_index in nearly_met(self.problem):
            if self.offer(plan, goal_index, proven=False):
                return

    def ask(
        self,
        questions: Sequence[Problem],
        search: Answer,
        offer: Callable[[PlanResult], None],
        *,
        budget: Budget,
        alternatives: int,
        shares: Sequence[float] = (),
    ) -> Iterator[tuple[int, PlanResult, bool]]:
        """Answers to simpler questions, and whether each has ended; their plans are offered.

        A first plan is offered as it is found, but may be refused: until there is one, each
        question lets the others try after a moment, twice; then each has its share of the time.
        """
        waiting, turns = deque(enumerate(questions)), 0
        moment = SOON_SHARE / len(questions) * budget.seconds

        def better(made: Callable[..., PlanResult]) -> None:
            if self.budget.shows is not None or not self.plans:
                offer(made(bound=LowerBound(value=0.0, kind="distance")))

        while waiting and (turns == 0 or not (budget.is_over or self.is_enough)):
            k, question = waiting.popleft()
            share = 1.0 if not waiting else shares[k] if shares else 1.0 / (1 + len(waiting))
            part = budget.part(share, at_least=LEAST_TIME)._replace(shows=better)
            part = part._replace(expansions=question.search.max_expansions)
            shift, turn = budget.elapsed, turns // len(questions)

            def quits(until: float = shift + moment * 2.0**turn) -> bool:
                over = not self.plans and budget.elapsed > until
                return over or (budget.quits is not None and budget.quits())

            soon = moment > SOON and turn < SOON_TURNS and part.expansions is None
            if soon and waiting:
                part = part._replace(quits=quits)
            result = search(question, part, self.workspace, alternatives=alternatives)
            at = tuple((shift + at, cost) for at, cost in result.improvements)
            result = replace(result, improvements=at)
            turns += 1
            self.counts.update(result.counts)
            again = part.quits is quits and quits()
            if again:
                waiting.append((k, question))
            yield k, result, not again

    def offer_as_they_come(self, plans: Iterable[tuple[Plan, int]], *, proven: bool = True) -> None:
        """Offer plans to goals as they are found, until the time is over; `proven` as there."""
        for plan, goal_index in plans:
            if not self.may_check:
                return
            self.offer(plan, goal_index, proven=proven)
            if not self.wants_more:
                return

    def offer_in_turn(self, candidates: Iterable[Candidate]) -> None:
        """Check candidates, the cheapest first, until as many plans as asked for are no costlier.

        Once the time is over they are checked only until there is a plan at all: at least one of
        them, and a few more if they take no more than a moment.
        """
        late = 0
        for one in candidates:
            most = one.cost + CHEAPER * abs(one.cost)
            known = [
                other.plan
                for other in self.plans
                if (other.price if other.short else other.offered) <= most
            ]
            if len(known) > self.alternatives or not self.may_check:
                return
            over = late >= LATE or self.for_checks.left_to_check == 0.0
            if late and (self.plans or over):
                return
            plan = one.plan()
            known += [other.plan for other in self.plans if other.plan.word == plan.word]
            if is_new(plan, known, self.likeness):
                self.offer(plan, one.goal_index, proven=one.proven)
            late += self.budget.is_over

    def _with_lasting_coasts(self, plan: Plan, goal: Goal) -> Plan:
        """The plan without very short trims, if there is time to check it."""
        if self.budget.left_to_check < LONGER * self.longest_check:
            return plan

        def is_free(one: Plan) -> bool:
            return stays_inside(one, self.problem.bounds) and not what_is_hit(
                self.problem, one, goal, self.workspace, budget=self.budget
            )

        def passes(one: Plan) -> list[tuple[float, Goal]]:
            found = list[tuple[float, Goal]]()
            for at in passed_on_the_way(self.problem, one) if self.problem.via else ():
                via = self.problem.via[at.number - 1]
                pose = at.pose if via.radius > 0.0 else via.pose
                found.append((at.time - one.start_time, Goal(pose, free_heading=via.free_heading)))
            return found

        try:
            return with_lasting_coasts(self.problem, plan, goal, is_free=is_free, passes=passes)
        except TooLate:
            return plan

    def _keep(self, plan: Plan, goal_index: int, offered: Plan, *, proven: bool) -> bool:
        """Keep a plan, `offered` as another, if it passes; of one motion the cheapest stays."""
        begin = self.budget.elapsed
        goal = self.problem.goals[goal_index]
        checked = check_plan(self.problem, plan, goal, self.workspace, budget=self.for_checks)
        took = self.budget.elapsed - begin
        self.checking += took
        self.longest_check = max(self.longest_check, took)
        if checked.broken is Condition.TIME:
            self.unchecked += 1
            return False
        if checked.broken is not None or checked.audit is None:
            if proven:
                self.refusals.append((checked.broken or Condition.AUDIT, checked.reason))
            if self.problem.zones:  # it may keep to them once it is polished
                self.misfits.append((plan, goal_index))
            return False
        cost = self.problem.cost_of(plan)
        # What is shown is final but for cheaper plans: of those with short trims only the first is,
        # and takes no other's place to be.
        shown = self.budget.shows is not None and not self.plans
        one = Accepted(
            plan=plan,
            goal_index=goal_index,
            cost=cost,
            audit=checked.audit,
            offered=cost if offered is plan else self.problem.cost_of(offered),
            short=not shown and has_short_coasts(self.problem, plan),
        )
        same = [other for other in self.plans if same_motion(plan, other.plan, self.likeness)]
        if not any(other.rank <= one.rank for other in same):
            others = [other for other in self.plans if other not in same]
            self.plans = sorted([*others, one], key=lambda other: other.rank) if others else [one]
            if self.plans[0] is one and cost < self.least_cost * (1.0 - CHEAPER):
                self.least_cost = cost
                self.improvements.append((self.budget.elapsed, cost))
                self._tell(cost)
            if self.plans[0] is one and not one.short and self.budget.shows is not None:
                self.budget.shows(self.found)
        return True

    def _tell(self, cost: float) -> None:
        """Tell a proof beside the search what a plan of this very problem costs."""
        watch = self.budget.watch
        if watch is not None and watch.problem is self.problem:
            watch.note(cost)

    def found(
        self,
        *,
        bound: LowerBound,
        searched: float | None = None,
        certificate: float | None = None,
        nodes: Array | None = None,
    ) -> PlanResult:
        """The answer where there are plans; no plan at all costs less than `bound`.

        The search lasted until `searched` [s], or until the first plan.
        """
        best, *others = self.plans
        others = [one for one in others if one.cost >= best.cost][: self.alternatives]
        # the search adds the same terms up in another order
        value = bound.value if bound.value < best.cost * (1.0 - ROUNDING) else best.cost
        known = bound.optimal and not self.problem.place_costs  # which searches leave out
        bound = replace(bound, value=value, optimal=known or value == best.cost)
        first = self.improvements[0][0]
        return PlanResult(
            problem=self.problem,
            status=PlanStatus.FOUND,
            reason="",
            plan=best.plan,
            goal_index=best.goal_index,
            cost=best.cost,
            lower_bound=value,
            gap=bound.gap(best.cost),
            bound=bound,
            certificate=certificate,
            terminal_error=terminal_error(best.plan, self.problem.goals[best.goal_index]),
            clearance_m=best.audit.min_clearance_m,
            audit=best.audit,
            alternatives=tuple(
                Alternative(
                    plan=other.plan,
                    cost=other.cost,
                    terminal_error=terminal_error(other.plan, self.problem.goals[other.goal_index]),
                )
                for other in sorted(others, key=lambda one: one.cost)
            ),
            timing_s=self._timing(first if searched is None else searched) | {"first_plan": first},
            counts=dict(self.counts),
            improvements=tuple((at, max(cost, best.cost)) for at, cost in self.improvements),
            nodes=nodes,
        )

    def none(self, status: PlanStatus, reason: str, *, nodes: Array | None = None) -> PlanResult:
        """The answer where there is no plan."""
        return PlanResult(
            problem=self.problem,
            status=status,
            reason=reason,
            timing_s=self._timing(max(self.budget.elapsed - self.checking, 0.0)),
            counts=dict(self.counts),
            nodes=nodes,
        )

    def _timing(self, searched: float) -> dict[str, float]:
        refined = max(self.budget.elapsed - searched - self.checking, 0.0)
        return {"search": searched, "refine": refined, "audit": self.checking}


class PlanningStep(Protocol):
    """One way to plans of a problem."""

    __slots__ = ()

    def prepare(self, problem: Problem, workspace: Workspace) -> bool | None:
        """Have ready what it needs before the clock runs; True if later steps need nothing."""
        return None

    def offer(self, found: Incumbents) -> None:
        """Offer plans as they are found, if more of them are due, within the budget."""
        raise NotImplementedError
