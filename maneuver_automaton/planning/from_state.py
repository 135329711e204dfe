"""Plans that start or end in a reduced state of no trim: a maneuver made on the spot, then others.

The maneuver leads to a trim of the library, and another problem starts where it ends. A few trims
are tried: those that are reached soonest, and rest. What was found is polished as a whole.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.groups import group_of
from maneuver_automaton.planning.blocked import blocked_anyway
from maneuver_automaton.planning.checking import TooLate, what_is_hit
from maneuver_automaton.planning.incumbents import Incumbents, PlanningStep
from maneuver_automaton.planning.polishing import Polish, why_not_polished
from maneuver_automaton.planning.result import Answer, PlanResult, PlanStatus, Workspace
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.on_the_spot import (
    all_maneuvers_between,
    maneuvers_between,
    prepare_maneuvers,
    seconds_between,
    trim_at,
)
from maneuver_automaton.problem import Goal, Problem, between_trims
from maneuver_automaton.search.limits import closed_bound, stays_inside

NEAREST = 3  # trims that are tried besides rest
MOST_QUESTIONS = 8  # starts and ends that are tried together
MAKING_SHARE = 0.2  # of the time, after which no more maneuvers are made
POLISHED_SHARE = 0.3  # of the time, that is kept back for polishing
HEADINGS = 8  # of a goal of any heading, before which a last maneuver is driven
CLOCK = 1e-9  # [s] that a horizon must leave


class Leg(NamedTuple):
    """A maneuver between a state of no trim, at an end of a plan, and a trim of the library."""

    maneuver: Maneuver
    state: Trim  # that stands for the state
    trim: Trim


class BetweenTrims(NamedTuple):
    """A problem between trims, and what its plans lack: a first maneuver, and one at each goal."""

    problem: Problem
    first: Leg | None
    last: tuple[Leg | None, ...]  # of each goal of the problem
    goals: tuple[int, ...]  # which of the goals that were asked for each of them serves
    least: float  # no answer is cheaper


@dataclass(frozen=True, slots=True, eq=False)
class FromState(PlanningStep):
    """Plans from or to a state, by `answer` to problems between trims, which `prepares` readies."""

    answer: Answer
    prepares: Callable[[Problem, Workspace], None]

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """The program of the maneuvers, and what a problem between trims needs."""
        prepare_maneuvers(problem.automaton.model)
        self.prepares(between_trims(problem), workspace)
        if not why_not_polished(problem):
            Polish().prepare(problem, workspace)

    def offer(self, found: Incumbents) -> None:
        """Offer the answers with their maneuvers, then all of it polished."""
        problem, budget, ended = found.problem, found.budget, found.ended
        ended.is_complete = True
        ended.verdict = blocked_anyway(problem)
        if ended.verdict is not None:
            return
        questions, refused = _questions(found)
        if not questions:
            ended.why = PlanStatus.NO_PLAN, refused
            return
        asked = {id(one.problem): one for one in questions}
        polishes = not why_not_polished(problem)
        kept_back = POLISHED_SHARE * budget.seconds if polishes else 0.0

        def offer(result: PlanResult) -> None:
            one = asked[id(result.problem)]
            for plan in (result.plan, *(other.plan for other in result.alternatives)):
                if plan is not None:
                    _offer_whole(found, one, plan)

        results: dict[int, PlanResult] = {}
        for k, result, _ in found.ask(
            [one.problem for one in questions],
            self.answer,
            offer,
            budget=budget.before(kept_back),
            alternatives=found.alternatives,
        ):
            results[k] = result
            offer(result)
        if polishes:
            Polish().offer(found)
        if not found.plans:
            why = found.why_none(results.values())
            if why is None and results:  # proven from one trim, and not from another
                why = PlanStatus.NO_PLAN, results[0].reason
            ended.why = why or (PlanStatus.OUT_OF_BUDGET, f"no plan within {budget.seconds:.4g} s")


def _offer_whole(found: Incumbents, one: BetweenTrims, plan: Plan) -> None:
    """Offer a plan between trims, with its first and last maneuver."""
    asked = found.problem
    place = int(np.argmin([sum(goal.off(plan.end)) for goal in one.problem.goals]))
    last = one.last[place]
    whole = plan
    if one.first is not None:
        begun = _driven(one.first, asked.start, asked.start_time, ends=False)
        whole = joined(begun, plan) if plan.trims else begun
    if last is not None:
        ended = _driven(last, whole.end, whole.start_time + whole.duration, ends=True)
        whole = joined(whole, ended) if whole.trims else replace(ended, start=asked.start)
    found.offer(whole, one.goals[place])


def _driven(leg: Leg, start: Array, time: float, *, ends: bool) -> Plan:
    """A maneuver as a plan, which `ends` in the state or starts in it."""
    word = (leg.trim, leg.state) if ends else (leg.state, leg.trim)
    return Plan(start, word, durations=[0.0, 0.0], maneuvers=(leg.maneuver,), start_time=time)


def _questions(found: Incumbents) -> tuple[list[BetweenTrims], str]:
    """Problems between trims, the most promising first; or why there are none."""
    problem, refused = found.problem, ""
    firsts: list[Leg | None] = [None]
    if problem.start_state is not None:
        firsts, refused = _free_legs(found, problem.first_trim)
    ends = list(_ends(found))
    if not firsts or not ends:
        what = "first" if not firsts else "last"
        none = f"no {what} maneuver to or from the state was found"
        return [], f"{none}{': ' + refused if refused else ''}"
    made = [
        one
        for first in firsts
        for goals, last, served in ends
        if (one := _question(problem, first, goals, last, served)) is not None
    ]
    made.sort(key=lambda one: one.least)
    if not made:
        return [], "the first and the last maneuver take longer than the horizon admits"
    most = problem.search.max_expansions
    if most is not None:
        share = replace(problem.search, max_expansions=max(1, most // len(made[:MOST_QUESTIONS])))
        made = [one._replace(problem=replace(one.problem, search=share)) for one in made]
    return made[:MOST_QUESTIONS], ""


def _question(
    problem: Problem,
    first: Leg | None,
    goals: tuple[Goal, ...],
    last: tuple[Leg | None, ...],
    served: tuple[int, ...],
) -> BetweenTrims | None:
    """The problem after a first maneuver and before the last ones; None if no time is left."""
    base, horizon = between_trims(problem), problem.horizon
    took = 0.0 if first is None else first.maneuver.duration
    least_after = min(0.0 if leg is None else leg.maneuver.duration for leg in last)
    most_after = max(0.0 if leg is None else leg.maneuver.duration for leg in last)
    if horizon.time is not None and len(goals) > 1 and most_after > least_after:
        return None  # each needs another time: they are asked for one by one
    if (limit := horizon.time or horizon.max_time) is not None:
        left = limit - took - (least_after if horizon.time is None else most_after)
        if left <= CLOCK:
            return None
        horizon = replace(horizon, time=horizon.time and left, max_time=horizon.max_time and left)
    pose = problem.start
    if first is not None:
        group = group_of(pose.size)
        pose = np.array((group(pose) @ group(first.maneuver.displacement)).pose)
    trim = problem.start_trim if first is None else first.trim.name
    asked = base.starting_at(
        pose,
        time=problem.start_time + took,
        goals=goals,
        trim=trim or problem.first_trim.name,
        horizon=None if horizon is problem.horizon else horizon,
    )
    least = min(
        closed_bound(asked, goal) + (0.0 if leg is None else problem.maneuver_cost(leg.maneuver))
        for goal, leg in zip(goals, last, strict=True)
    )
    least += 0.0 if first is None else problem.maneuver_cost(first.maneuver)
    return BetweenTrims(asked, first, last, served, least)


def _ends(
    found: Incumbents,
) -> Iterator[tuple[tuple[Goal, ...], tuple[Leg | None, ...], tuple[int, ...]]]:
    """Goals in trims, the maneuver after each, and the goals that were asked for."""
    problem = found.problem
    plain = [(goal, None, k) for k, goal in enumerate(problem.goals) if goal.state is None]
    if plain:
        goals, last, served = zip(*plain, strict=True)
        yield goals, last, served
    for k, goal in enumerate(problem.goals):
        if goal.state is None:
            continue
        for leg in _legs(problem, problem.last_trim(goal), ends=True):
            before = tuple(_before(goal, leg))
            yield before, (leg,) * len(before), (k,) * len(before)


def _before(goal: Goal, leg: Leg) -> Iterator[Goal]:
    """Where a last maneuver begins that leads to a goal; all around one of any heading."""
    group = group_of(goal.pose.size)
    for turn in np.arange(HEADINGS if goal.free_heading else 1) * (2.0 * math.pi / HEADINGS):
        end = goal.pose.copy()
        end[2] += turn
        yield replace(
            goal,
            pose=(group(end) @ group(leg.maneuver.displacement).inverse()).pose,
            trim=leg.trim.name,
            state=None,
            free_heading=False,
            tolerance_rad=0.0,  # a turn would shift the end
        )


def _free_legs(found: Incumbents, state: Trim) -> tuple[list[Leg | None], str]:
    """First maneuvers that stay inside the bounds and hit nothing, and why the others do not."""
    problem, legs, refused = found.problem, list[Leg | None](), ""
    for leg in _legs(problem, state, ends=False):
        plan = _driven(leg, problem.start, problem.start_time, ends=False)
        try:
            said = what_is_hit(problem, plan, problem.goals[0], found.workspace)
        except TooLate:
            break
        said = said or ("" if stays_inside(plan, problem.bounds) else "it leaves the bounds")
        refused = refused or said
        if not said:
            legs.append(leg)
        counted = found.budget.expansions is not None  # then no clock decides
        if legs and not counted and found.budget.elapsed > MAKING_SHARE * found.budget.seconds:
            break
    return legs, refused


def leg_from(problem: Problem, state: Array, trim: Trim) -> Leg | None:
    """A first maneuver from a state, free if one is: to a trim, or else to one that is near.

    A step of a loop begins with it where the vehicle is in another state than its plan says.
    """
    here = trim_at(problem.automaton.model, state, "measured state")
    there = maneuvers_between(problem.automaton.model, here, trim)
    wanted = [Leg(maneuver, here, trim) for maneuver in there]
    for leg in itertools.chain(wanted, _legs(problem, here, ends=False)):
        plan = _driven(leg, problem.start, problem.start_time, ends=False)
        if stays_inside(plan, problem.bounds) and not what_is_hit(problem, plan, problem.goals[0]):
            return leg
    return wanted[0] if wanted else None


def _legs(problem: Problem, state: Trim, *, ends: bool) -> Iterator[Leg]:
    """Maneuvers from a state to the trims that are reached soonest, and to rest; or from these."""
    automaton = problem.automaton
    every = _one_of_each_class(automaton)
    states = np.array([trim.reduced_state for trim in every])
    seconds = seconds_between(automaton.model, state.reduced_state, states)
    order = np.argsort(seconds, kind="stable").tolist()
    rest = [k for k in order if every[k].is_rest][:1]
    near = [every[k] for k in dict.fromkeys([*order[:NEAREST], *rest])]
    pairs = [(trim, state) if ends else (state, trim) for trim in near]
    for trim, maneuvers in zip(near, all_maneuvers_between(automaton.model, pairs), strict=True):
        for maneuver in maneuvers:
            yield Leg(maneuver, state, trim)


@kept_by_first
def _one_of_each_class(automaton: Automaton) -> Sequence[Trim]:
    """A trim of every reduced state: the one at rest, or else that with the least controls."""
    best: dict[int, Trim] = {}
    for trim, number in zip(automaton.trims, automaton.trim_classes.tolist(), strict=True):
        other = best.get(number)
        if other is None or _restless(trim) < _restless(other):
            best[number] = trim
    return tuple(best.values())


def _restless(trim: Trim) -> tuple[bool, float]:
    return not trim.is_rest, float(np.abs(trim.control).sum())
