"""Plans of vehicles with inertia: a plan that stops and steers at once, then better ones."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.among_obstacles import library_table
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.bounds import lattice_bound, speed_bound, word_bound
from maneuver_automaton.planning.checking import check_plan, load_checking, load_checks, what_is_hit
from maneuver_automaton.planning.polishing import (
    Aimed,
    guess_along,
    guess_of_plan,
    guesses_along_paths,
    load_polishing,
    polish_plans,
    why_not_polished,
)
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.planning.tracking import Tracked, track
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.fitting import (
    fitted_plans,
    padded,
    why_not_fitted,
    with_best_times,
)
from maneuver_automaton.refinement.improve import Patience
from maneuver_automaton.refinement.kinematic_paths import follows_paths, kinematic_problem
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.refinement.stop_and_steer import stop_and_steer
from maneuver_automaton.search import SearchStatus
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.maneuver_lattice import maneuver_words, plan_of, quick_word
from maneuver_automaton.search.maneuver_problem import maneuver_problem_query
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.search.maneuver_ready import load_maneuver_kernels
from maneuver_automaton.search.maneuver_search import maneuver_word_stages
from maneuver_automaton.search.maneuver_words import load_maneuver_words
from maneuver_automaton.search.result import plan_of as plan_of_word
from maneuver_automaton.words.word import Word, word_of_plan

FIRST_SHARE = 0.8  # of the time limit, for a first path
IMPROVED_SHARE = 0.2  # of what is left, for a path that is faster to follow
WORDS_SHARE = 0.4  # of what is left, for words in free space where there is no plan yet
MANEUVER_SHARE = 0.2  # of what is left, for words of maneuvers where there is a plan already
AT_ONCE = Patience(attempts=0, passes=0)
EXPANSIONS_AN_ITERATION = 4  # of the lattice, in place of one iteration of polishing
WAITS = 9  # at rest, before a path is followed among obstacles that move
OTHERS = 6  # dearer words that are looked at where bounds or obstacles may refuse the cheapest
SAME_MOTION = 0.01  # share of their size, and of a turn, by which like motions differ at most
INSTANTS = 33  # at which two motions are compared


def plan_with_inertia(
    problem: Problem, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest plan found for a vehicle with inertia; every one that is kept was audited.

    The time limit [s] counts from `began`, as `time.monotonic` does. Where the problem limits its
    expansions, all stages count their work: the plan is then the same at every call, unless the
    time is over before.
    """
    found = _Incumbents(problem, began, began + time_limit, alternatives)
    for plan, goal_index in _candidates(found):
        found.offer(plan, goal_index)
        if time.monotonic() >= found.deadline:
            break
    _polish(found)
    found.searched = found.searched or time.monotonic()
    timing = {
        "search": found.searched - began,
        "first_plan": found.improvements[0][0] if found.improvements else math.nan,
        "refine": max(time.monotonic() - found.searched, 0.0),
        "audit": found.checking,
    }
    if not found.accepted:
        status, reason = found.why_none(time_limit)
        timing.pop("first_plan")
        return PlanResult(
            problem=problem, status=status, reason=reason, timing_s=timing, counts=found.counts
        )
    return found_plans(
        problem,
        found.accepted[: alternatives + 1],
        bound=_lower_bound(problem),
        certificate=_certificate(problem, found.accepted[0]),
        timing_s=timing,
        counts=found.counts,
        improvements=tuple(found.improvements),
    )


@dataclass(slots=True, eq=False)
class _Incumbents:
    """Plans that were found and passed every check, cheapest first."""

    problem: Problem
    began: float
    deadline: float
    alternatives: int
    searched: float = 0.0
    accepted: list[Accepted] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: {"expansions": 0, "collision_queries": 0, "rejected": 0}
    )
    checking: float = 0.0
    refused: str = ""
    reason: str = ""
    enclosed: str = ""  # why no plan can exist
    paths: list[Aimed] = field(default_factory=list)  # guesses along kinematic plans
    late: list[tuple[Plan, int]] = field(default_factory=list)  # refused by the horizon alone

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.deadline - time.monotonic()

    @property
    def most_work(self) -> int | None:
        """Expansions that every stage may take; None if only the time counts."""
        return self.problem.search.max_expansions

    @property
    def cost(self) -> float:
        """Cost of the cheapest plan, an upper bound; inf if there is none."""
        return self.accepted[0].cost if self.accepted else math.inf

    def share(self, share: float) -> float:
        """Time [s] for a stage: a share of what is left; all of it where work is counted."""
        return max(self.left if self.most_work is not None else share * self.left, 0.0)

    def count(self, found: Tracked) -> Tracked:
        """Add up what a search for a path took."""
        self.counts["expansions"] += found.expansions
        self.counts["collision_queries"] += found.queries
        return found

    def offer(self, plan: Plan, goal_index: int) -> bool:
        """Keep a plan, or one of the same word that meets the horizon, if it passes the checks."""
        goal = self.problem.goals[goal_index]
        against = why_not_fitted(self.problem, padded(self.problem, plan))
        kept = False
        for fitted in fitted_plans(self.problem, plan, goal):
            against = ""
            kept = self._offer(fitted, goal_index)
            if kept:
                break
        if against:
            self.refused = self.refused or against
            self.late.append((plan, goal_index))
        return kept

    def _offer(self, plan: Plan, goal_index: int) -> bool:
        begin = time.monotonic()
        checked = check_plan(self.problem, plan, self.problem.goals[goal_index])
        now = time.monotonic()
        self.checking += now - begin
        if checked.audit is None or not checked.passed:
            self.counts["rejected"] += 1
            self.refused = self.refused or checked.reason
            return False
        one = Accepted(
            plan=plan,
            goal_index=goal_index,
            cost=self.problem.cost_of(plan),
            audit=checked.audit,
        )
        if one.cost < self.cost:
            self.improvements.append((now - self.began, one.cost))
        self._insert(one)
        self.searched = self.searched or now
        return True

    def _insert(self, one: Accepted) -> None:
        """Keep a plan by its cost; of plans of the same motion only the cheapest."""
        same = [other for other in self.accepted if _same_motion(one.plan, other.plan)]
        if any(other.cost <= one.cost for other in same):
            return
        self.accepted = [other for other in self.accepted if other not in same]
        self.accepted.append(one)
        self.accepted.sort(key=lambda other: other.cost)

    def why_none(self, time_limit: float) -> tuple[PlanStatus, str]:
        """How a search ended that found no plan, and why."""
        if self.enclosed:
            return PlanStatus.UNREACHABLE, self.enclosed
        if self.refused:
            return PlanStatus.NO_PLAN, f"every plan found was refused: {self.refused}"
        reason = f"no plan within {time_limit:g} s and the expansions allowed{self.reason}"
        return PlanStatus.OUT_OF_BUDGET, reason


def _same_motion(one: Plan, other: Plan) -> bool:
    """Whether two plans from one start are the same motion but for trifles, of whatever pieces."""
    longer = max(one.duration, other.duration)
    if abs(one.duration - other.duration) > SAME_MOTION * longer:
        return False
    shares = np.linspace(0.0, 1.0, INSTANTS)
    mine, theirs = (plan.pose_at(plan.start_time + shares * plan.duration) for plan in (one, other))
    off = np.abs(mine - theirs)
    off[:, 2] = np.abs(np.remainder(mine[:, 2] - theirs[:, 2] + np.pi, 2.0 * np.pi) - np.pi)
    size = np.abs(mine - mine[0]).max(axis=0)
    size[:2], size[2] = size[:2].max(), 2.0 * np.pi
    return bool((off <= SAME_MOTION * size).all())


def _candidates(found: _Incumbents) -> Iterator[tuple[Plan, int]]:
    """Plans as they are found, and the goals they reach.

    Where nothing is in the way, words come before the lattice: they are found sooner, and keep to
    every condition of the horizon. Among obstacles the lattice alone finds its way round.
    """
    problem, method = found.problem, found.problem.search.method
    load_checks(problem)
    if method in ("auto", "lattice") and follows_paths(problem.automaton.model) and _rests(problem):
        yield from _along_paths(found)
    if not problem.automaton.maneuvers:
        return
    if method in ("words", "insertion") or (method == "auto" and _suits_words(problem)):
        yield from _by_words(found)
    if method in ("auto", "lattice"):
        yield from _over_maneuvers(found)


def _polish(found: _Incumbents) -> None:
    """Polish kinematic plans of different gears, and what has been found; keep what is cheaper."""
    problem = found.problem
    known = [(one.plan, one.goal_index) for one in found.accepted[:1]]
    horizon = problem.horizon
    if not known and (horizon.max_time is not None or horizon.max_trims is not None):
        # what is late may be made quicker, and of too many trims one maneuver
        known = sorted(found.late, key=lambda one: one[0].duration)[:1]
    if not known or found.left <= 0.0 or why_not_polished(problem):
        return
    if not known[0][0].duration > 0.0:
        return  # it is there already
    aimed = [Aimed(guess_of_plan(plan), goal_index) for plan, goal_index in known]
    if _rests(problem):
        along = list(guesses_along_paths(problem, time_limit=found.left))
        aimed = along or [*found.paths, *aimed]
    work = None if found.most_work is None else 1 + found.most_work // EXPANSIONS_AN_ITERATION
    for goal_index in dict.fromkeys(one.goal_index for one in aimed):
        if found.left <= 0.0 or (work is not None and work <= 0):
            return
        try:
            polished = polish_plans(
                problem,
                [one.guess for one in aimed if one.goal_index == goal_index],
                goal_index,
                time_limit=found.left,
                most_iterations=work,
                accepts=functools.partial(found.offer, goal_index=goal_index),
            )
        except RuntimeError:  # the solver gave up on a number; the plan in hand stays
            found.counts["solver_errors"] = found.counts.get("solver_errors", 0) + 1
            continue
        found.counts["polished"] = found.counts.get("polished", 0) + len(polished.attempts)
        if work is not None:
            work -= sum(attempt.iterations for attempt in polished.attempts)


def _over_maneuvers(found: _Incumbents) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers from the lattice, each cheaper than the one before.

    All the time that is left may go by until there is a plan; a share of it is for better ones
    where polishing comes after.
    """
    problem = found.problem
    goals = tuple(k for k, goal in enumerate(problem.goals) if not why_goal_blocked(problem, goal))
    query = maneuver_problem_query(problem, goals)
    before = found.counts["expansions"]
    counted = found.most_work is not None
    share = 1.0 if counted or why_not_polished(problem) else MANEUVER_SHARE
    until = time.monotonic() + (share if found.accepted else 1.0) * found.left
    known: Word | None = None
    if _needs_quick_word(problem, query):
        quick = maneuver_problem_query(replace(problem, cost=Cost(time=1.0)), goals)
        known, more = quick_word(query, quick, deadline=until, max_expansions=found.most_work)
        before += more
        if known is not None:
            yield plan_of(query, known), query.owner(known)
    for heard in maneuver_words(
        query,
        deadline=until,
        max_expansions=found.most_work,
        better_share=share,
        known=known,
    ):
        found.counts["expansions"] = before + heard.expansions
        if heard.word is not None:
            owner = query.owner(heard.word)
            plan = plan_of(query, heard.word)
            yield plan, owner
            if problem.goals[owner].free_heading:
                better = with_best_times(problem, plan, problem.goals[owner])
                if better is not None:
                    yield better, owner
        elif not found.accepted:
            if heard.status is SearchStatus.EXHAUSTED:
                found.reason = "; none over trims and maneuvers at any resolution tried"
            if math.isfinite(heard.nearest):
                found.reason += (
                    f"; the nearest place that was reached is {heard.nearest:.3g} m from the goal"
                )


def _needs_quick_word(problem: Problem, query: ManeuverQuery) -> bool:
    """Whether a search by cost alone would look everywhere, or for too long motions."""
    horizon = problem.horizon
    timed = horizon.time is not None or horizon.max_time is not None
    return not query.costs_are_times and (timed or query.library.per_metre == 0.0)


def _suits_words(problem: Problem) -> bool:
    """Whether words may be searched first: nothing is in the way, or the time is to be met exactly.

    Where no rest fills a fixed time, words alone have times that add up to it.
    """
    rests = problem.first_trim.is_rest or problem.last_trim(problem.goals[0]).is_rest
    return not problem.obstacles or (problem.horizon.time is not None and not rests)


def _by_words(found: _Incumbents) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers that look at no obstacle: short ones, then insertion."""
    problem = found.problem
    guarded = bool(problem.obstacles) or _is_bounded(problem)
    others = max(found.alternatives, OTHERS if guarded else 0)
    seen: list[Word] = []
    for index, goal in enumerate(problem.goals):
        share = MANEUVER_SHARE if found.accepted else WORDS_SHARE
        best = found.cost if others == 0 else math.inf
        for stage in maneuver_word_stages(
            problem, goal, time_limit=found.share(share), alternatives=others, ceiling=best
        ):
            for word in stage.solutions:
                if not any(word is one for one in seen):
                    seen.append(word)
                    yield plan_of_word(problem, word), index


def _along_paths(found: _Incumbents) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a first path, then along one that is fast to follow so."""
    problem = found.problem
    free = kinematic_problem(problem, switch=0.0)
    first = found.count(track(free, time_limit=found.share(FIRST_SHARE), patience=AT_ONCE))
    if first.plan is None or first.goal_index is None:
        found.enclosed = first.reason if first.enclosed else ""
        found.reason = f" ({first.reason})" if first.reason else ""
        return
    yield from _stopping(problem, first.plan, first.goal_index)
    if first.plan.duration > 0.0:
        found.paths.append(guess_along(problem, first.plan))
    left = found.share(IMPROVED_SHARE)
    better = found.count(track(kinematic_problem(problem), time_limit=left, known=first.plan))
    if better.plan is not None and better.goal_index is not None:
        yield from _stopping(problem, better.plan, better.goal_index)


def _stopping(problem: Problem, path: Plan, goal_index: int) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a path, once obstacles that move let it.

    The path was free at the pace of the kinematic vehicle. This one is slower, so that it meets
    what moves elsewhere: it waits before it starts, as long as it takes, or it does not go.
    """
    goal = problem.goals[goal_index]
    plan = stop_and_steer(
        problem.automaton.model,  # type: ignore[arg-type]
        path,
        first=problem.first_trim,
        last=problem.last_trim(goal),
    )
    if not problem.moves:
        yield plan, goal_index
        return
    settled = max(
        float(one.motion.time[-1])
        for one in problem.obstacles
        if isinstance(one, Obstacle) and one.motion is not None
    )
    for wait in np.linspace(0.0, max(settled - problem.start_time, 0.0), WAITS):
        durations = plan.durations.copy()
        durations[0] += wait
        later = replace(plan, durations=durations)
        if not what_is_hit(problem, later, goal):
            yield later, goal_index
            return


def _is_bounded(problem: Problem) -> bool:
    return any(getattr(problem.bounds, name) is not None for name in ("x", "y", "z"))


def load_inertia(problem: Problem) -> None:
    """Compile or load what `plan_with_inertia` needs, before the clock runs."""
    load_lattice()
    load_checking()
    if follows_paths(problem.automaton.model) and _rests(problem):
        library_table(kinematic_problem(problem, switch=0.0))
        if not why_not_polished(problem):
            load_polishing(problem)
    if problem.automaton.maneuvers:
        load_maneuver_kernels()
        if _suits_words(problem) or problem.search.method in ("words", "insertion"):
            load_maneuver_words()


def _rests(problem: Problem) -> bool:
    """Whether the vehicle starts and ends at rest."""
    return problem.first_trim.is_rest and all(
        problem.last_trim(goal).is_rest for goal in problem.goals
    )


def _certificate(problem: Problem, best: Accepted) -> float | None:
    """The certificate of a plan that is a word of the library; None for one that is not."""
    word = word_of_plan(problem.automaton, best.plan)
    return None if word is None else certificate(problem, problem.goals[best.goal_index], word)


def _lower_bound(problem: Problem) -> float:
    """No plan is cheaper: the shortest way, driven from rest to rest at the limits.

    A way that the kinematic vehicle needs B seconds for at full speed v takes ``B + v / a`` with
    the acceleration a, or ``2 sqrt(B v / a)`` where v is not reached.
    """
    model, cost = problem.automaton.model, problem.cost
    known = speed_bound(problem)
    if why_not_polished(problem) and not follows_paths(model):  # all plans are words
        known = max(known, word_bound(problem))
    if not (follows_paths(model) and _rests(problem) and isinstance(cost, Cost)):
        return known
    simpler = kinematic_problem(problem, switch=0.0)
    least = lattice_bound(lattice_query(simpler, tuple(range(len(problem.goals)))))
    fastest = float(np.abs(model.reduced_limits[0]).max())
    ramp = fastest / float(model.control_limits[0, 1])
    duration = least + ramp if least >= ramp else 2.0 * math.sqrt(least * ramp)
    return max(known, cost.time * duration + cost.length * least * fastest)
