"""One step of the closed loop: shift the last plan, look for a better one, apply the beginning."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number
from maneuver_automaton._kernel_list import expect_many_calls, load_kernels
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, with_samples_at
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import AnyObstacle, AnyShape, as_obstacles
from maneuver_automaton.planning.on_the_way import Passed, going_on, still_ahead
from maneuver_automaton.primitives.on_the_spot import state_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.at_will import AmongObstacles, InFreeSpace, as_it_stands
from maneuver_automaton.receding_horizon.candidates import (
    StepPlan,
    cost_until,
    is_rest_of,
    is_uniform,
)
from maneuver_automaton.receding_horizon.guarantees import LoopBounds, broken, promises, too_cheap
from maneuver_automaton.receding_horizon.log import (
    Decision,
    Guarantee,
    Origin,
    Step,
    Violation,
    first_part,
)
from maneuver_automaton.receding_horizon.over_maneuvers import (
    OverManeuvers,
    needs_maneuvers,
    within_its_margin,
)
from maneuver_automaton.receding_horizon.settings import Settings, filling_rest
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.receding_horizon.step_search import StepSearch
from maneuver_automaton.search.choose import load_search as load_words
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.limits import closed_bound

MOST_AHEAD = 10_000  # steps ahead for which a plan gets samples; later steps see to theirs


class RecedingHorizon:
    """Model predictive control with trims: plan to the goal, apply the beginning, plan again.

    Every step shifts the last plan, which always leads to the goal, looks for a cheaper one, and
    checks the paper's guarantees for the loop; the log has each that is broken, with the reason.

    The committed part is driven in any case: none where trims are switched at will, otherwise the
    maneuver under way to its end. A step decides the motion after it. Off the plan, the last word
    gets new times from where the vehicle was measured.

    Among obstacles the last plan is checked against where they are predicted now. Nothing is driven
    that is not free, and followed by a free motion: a plan to the goal and time to stand there, or
    a fail-safe trajectory, which waits, evades or brakes. Where there is none, the motion that
    collides last is driven, and flagged.

    What was passed on the way stays passed, and of a stay that something interrupts the rest is
    made up for. Plans lead through what is left: the rest of the last one, and where that is not
    to be driven as it is, one of the planner.

    Source: the paper, Algorithm 14, Theorem 17, Sec. 4.2 and 4.3.

    Parameters
    ----------
    problem : Problem
        From a trim to a trim, rest if none is named; its horizon is fixed or free. A fixed time is
        prolonged by rest at every step; where no plan may end in a rest, it runs down.
    step : float
        delta [s]: the loop closes every so often.
    margin : float
        A new word must be cheaper than the rest of the last one by more than this. At 0 the
        cheapest plan is applied; of plans that cost the same, the one that costs most at first.
    time_limit : float
        [s] per step for the search; the best plan by then is applied.
    last : Step, optional
        To go on from: the last step of a log.
    first : Plan, optional
        The plan that the first step applies, instead of searching: from there to the goal.
    retimed : bool
        Drive every plan at the pace that makes its effort uniform: the controls are then
        continuous, multiples of those of the library. Needs a fixed horizon, a cost with effort, a
        vehicle without inertia whose body velocity scales with its control, and no zones.
    pieces : int
        Seek controls between those of the library too, constant on so many equal parts of a plan
        (`least_effort`), and within the range of the library's. Needs what retimed plans need, a
        body velocity that is linear in the control, a cost of effort and time alone, and no
        `max_trims`.
    hold : bool
        Within the goal's tolerance, correct the error within a few steps, along plans that stay
        within it if there are such; otherwise, and with inertia, rest.
    gap : float, optional
        Share of the cost: a plan that is proven to be so near the optimum is kept without a search,
        and what time a step has left goes into a proof. Not for retimed plans.
    look_ahead : float
        [s] that a fail-safe trajectory, or standing still, must be free; less where nothing moves
        any more. With inertia one that is free for `stand` will do where none is for so long.
    stand : float
        [s] that the goal must stay free after arrival, and a step at least.

    Raises
    ------
    ValueError
        If a number is out of range, or plans cannot be retimed.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(
    ...     robot,
    ...     [-1, 0, 0],
    ...     [0, 0, 0],
    ...     cost=Cost(effort=1.0),
    ...     horizon=Horizon(time=2.0, max_trims=4),
    ... )
    >>> controller = RecedingHorizon(problem, step=0.5)
    >>> control, log = controller.step([-1, 0, 0])
    >>> control.tolist(), log.value, log.plan.word
    ([1.0, 0.0], 1.0, ('ahead', 'rest'))
    >>> control, log = controller.step([-0.5, 0, 0])
    >>> control.tolist(), log.value, log.replanned, log.violations
    ([1.0, 0.0], 0.5, False, ())
    """

    def __init__(
        self,
        problem: Problem,
        *,
        step: float,
        margin: float = 0.0,
        time_limit: float = 5.0,
        last: Step | None = None,
        first: Plan | None = None,
        hold: bool = False,
        retimed: bool = False,
        pieces: int = 0,
        gap: float | None = None,
        look_ahead: float = 60.0,
        stand: float = 2.0,
    ) -> None:
        settings = Settings(
            step=step,
            margin=margin,
            time_limit=time_limit,
            first=first,
            hold=hold,
            retimed=retimed,
            pieces=pieces,
            gap=None if retimed or pieces else gap,
            pad=filling_rest(problem),
            look_ahead=look_ahead,
            stand=stand,
        )
        settings.check(problem)
        if last is not None and not 0 <= last.goal_index < len(problem.goals):
            raise ValueError(
                f"receding horizon: the last step leads to goal {last.goal_index}, need one of "
                f"the {len(problem.goals)}, counted from 0"
            )
        self.problem = problem
        self.settings = settings
        self.last = last
        total = problem.horizon.time
        # a fixed time that no rest fills cannot be prolonged: it ends then [s]
        self.arrival = None if total is None or settings.pad else problem.start_time + total
        self.ahead = problem  # with what is still to be passed on the way
        self.promises = promises(problem, step=settings.step)
        self.most_steps: int | None = None
        if last is not None and not settings.continuous:  # the bound counts from the first step
            bound = self.promises.most_steps(last.value)
            self.most_steps = None if bound is None else bound + last.number
        expect_many_calls()
        self.kind = load_search(problem)
        self.proven = None if settings.gap is None else LoopBounds.ready(settings.gap)

    def step(
        self,
        measured_state: ArrayLike,
        state: ArrayLike | Mapping[str, float] | None = None,
        *,
        elapsed: float | None = None,
        obstacles: AnyObstacle | AnyShape | Sequence[AnyObstacle | AnyShape] | None = None,
        passed: Sequence[Passed] | None = None,
    ) -> tuple[Array | None, Step]:
        """The control to apply from `measured_state`, and the log of the decision.

        Parameters
        ----------
        measured_state : (dof,) array_like
            Pose [m, m, rad(, m)].
        state : (n_z,) array or mapping of str to float, optional
            Reduced state, such as the speed and the steering angle; if omitted, what the plan says.
            From one that is in no trim, a maneuver made on the spot leads back to the plan.
        elapsed : float, optional
            [s] since the last step; if omitted, the time for which its plan was to be applied.
        obstacles : as the obstacles of a `Problem`, optional
            The obstacles from now on, with their predicted motions in the time of the world; if
            omitted, those seen last, at first those of the problem.
        passed : sequence of Passed, optional
            What was passed on the way by now; if omitted, what the last plan passed, as it was
            driven steadily away from it to where the vehicle was measured.

        Returns
        -------
        control : (n_u,) array or None
            The control from now on; None if the goal is reached and the library has no rest.
        log : Step
            The whole plan, its value, how it came about, and the guarantees that were broken.

        Raises
        ------
        ValueError
            If the state is no pose, or the time negative.

        Notes
        -----
        Where no plan leads to the goal, in whatever time, the log says so: its value is infinite,
        and the vehicle rests. Among obstacles its value is then a lower bound, and ``decision``
        names the motion that it drives instead.
        """
        dof = self.problem.automaton.model.group.dof
        pose = as_array("measured_state", measured_state, last=dof)
        if pose.shape != (dof,):
            raise ValueError(f"measured_state: got shape {pose.shape}, need ({dof},)")
        seen = self.problem.obstacles if obstacles is None else as_obstacles(obstacles)
        changed = seen != self.problem.obstacles
        if changed:
            self.problem = replace(self.problem, obstacles=seen)
            self.settings.check(self.problem)
            self.kind = load_search(self.problem)
        budget = Budget.from_now(self.settings.time_limit)
        last = self.last
        elapsed = None if elapsed is None else as_number("elapsed", elapsed)
        driven = 0.0 if last is None else (last.applied if elapsed is None else elapsed)
        if not 0.0 <= driven < math.inf:
            raise ValueError(f"elapsed must be at least 0, got {driven} s")
        if last is not None:
            last = self._cut(last, driven)
        at = self.problem.start_time if last is None else last.time + driven
        if passed is None and last is not None and self.problem.via:
            passed = going_on(self.problem, last.passed, first_part(last.plan, driven), ended=pose)
        # Have the problem ahead be the one without what was passed on the way.
        via = still_ahead(self.problem, passed or ()) if self.problem.via else ()
        if via != self.ahead.via or self.ahead.obstacles is not self.problem.obstacles:
            self.ahead = replace(self.problem, via=via)
            if not via:
                load_search(self.ahead)
        automaton = self.problem.automaton
        known = None if state is None else state_of(automaton.model, state, "measured")
        trim = automaton.trim_names[automaton.rest or 0]  # where a plan is held, it says which
        horizon = None  # that of the problem
        if self.arrival is not None:
            horizon = replace(self.problem.horizon, time=max(self.arrival - at, NOTHING))
        here = self.ahead.starting_at(
            pose,
            time=at,
            horizon=horizon,
            trim=None if last is None or self.problem.start_state is None else trim,
            state=known if last is None else None,
        )
        # Limits that the vehicle breaks already are replaced by those that it keeps.
        said = ""
        if self.kind is AmongObstacles:
            here, said = as_it_stands(here)
        elif here.margin and here.obstacles and here.start.size == 3:
            here, said = within_its_margin(here)
        now = Situation(
            self.settings, here, last, passed=driven, budget=budget, changed=changed, state=known
        )
        if said:
            now.flag(Guarantee.SAFETY, said)
        if self.proven is not None:
            now.bound = self._known(now)
        search = self.kind(now)
        step = self._logged(search.decide(), now)
        self.last = replace(step, passed=tuple(passed)) if passed else step
        control = self.last.control
        if control is None and self.settings.pad is not None:
            control = self.settings.pad.control
        return control, self.last

    def _known(self, now: Situation) -> float:
        """What steps before have proven of this one."""
        assert self.proven is not None
        if now.changed:
            self.proven.forget()
        elif now.last is None or now.off_plan or not now.last.decision.leads:
            self.proven.leave()
        here = now.as_it_moves
        return 0.0 if here is None else self.proven.known(here, now.accumulated)

    def _cut(self, last: Step, passed: float) -> Step:
        """The last step as it was driven, for `passed` seconds; one cut short is not counted."""
        if passed < last.applied and self.most_steps is not None:
            self.most_steps += 1
        plan = with_samples_at(last.plan, [last.time + passed], self.problem.automaton.model)
        if passed == last.applied:
            return last if plan is last.plan else replace(last, plan=plan)
        spent = cost_until(self.problem, plan, passed)
        return replace(last, plan=plan, applied=passed, applied_cost=spent)

    def _logged(self, chosen: StepPlan, now: Situation) -> Step:
        here, last, delta, plan = now.here, now.last, self.settings.step, chosen.plan
        if plan.maneuvers:
            most = min(plan.duration / delta, MOST_AHEAD)
            instants = here.start_time + delta * np.arange(1, 2 + most)
            plan = with_samples_at(plan, instants, here.automaton.model)
        same = is_rest_of(plan, now.rest)
        decision = _decision(chosen, now, same=same)
        bound = self._bound(chosen, now)
        leads = decision.leads
        applied = min(delta, plan.duration) if plan.duration > NOTHING else delta
        whole = chosen.cost if plan is chosen.plan and leads else None
        step = Step(
            time=here.start_time,
            plan=plan,
            goal_index=chosen.goal_index,
            value=chosen.cost if leads else bound(),
            applied=applied,
            applied_cost=cost_until(here, plan, applied, whole=whole),
            accumulated_cost=now.accumulated,
            origin=chosen.origin,
            replanned=last is not None and not same,
            shifted_value=chosen.shifted_value,
            off_plan=now.off_plan,
            bound=bound,
            exhaustive=now.exhaustive,
            solve_s=now.budget.elapsed,
            number=0 if last is None else last.number + 1,
            arrived=chosen.arrived,
            decision=decision,
            free_until=chosen.free_until,
            is_sole=now.is_sole,
        )
        self._count(step, now)
        broken = (*now.violations, *self._broken(step, now))
        if not broken:
            return step
        taken = tuple(one for one in broken if _is_taken(one, now))
        kept = tuple(one for one in broken if one not in taken)
        return replace(step, violations=kept, disturbed=taken)

    def _count(self, step: Step, now: Situation) -> None:
        """Bound the number of steps, from here on if something disturbed."""
        if (now.last is None or step.off_plan or now.changed) and not self.settings.continuous:
            most = self.promises.most_steps(step.value) if step.decision.leads else None
            self.most_steps = None if most is None else most + step.number
        if now.here.moves:
            self.most_steps = None  # to wait may cost nothing

    def _broken(self, step: Step, now: Situation) -> Iterator[Violation]:
        """The guarantees that a step breaks."""
        here, last, retimed = now.here, now.last, self.settings.continuous
        if last is not None and step.decision.leads and last.decision.leads:
            yield from broken(
                self.promises,
                here.goals[step.goal_index],
                last,
                step,
                most_steps=None if retimed else self.most_steps,
                uniform=self.settings.retimed
                and not here.place_costs
                and is_uniform(step.plan, here.cost),
                moved=here.moves or now.changed,
            )
        steady = self.promises.steady and not (here.moves or retimed)
        if steady and step.decision.leads and not step.arrived:
            yield from too_cheap(self.promises, step)

    def _bound(self, chosen: StepPlan, now: Situation) -> Callable[[], float]:
        """No plan to any goal costs less."""
        here, bound = now.here, self.promises.effort_bound
        if now.exhaustive:
            return partial(float, chosen.cost)
        if self.settings.continuous:  # at another pace trims may cost less than the library's
            return partial(float, min(bound(here.start, goal) for goal in here.goals))
        least = partial(closed_bound, here, *here.goals) if self.kind.finds_words else float
        moving = now.as_it_moves
        if self.proven is None or moving is None:
            return least
        proven = self.proven.prove(moving, chosen.cost, now.accumulated, now.budget)
        return partial(max, least(), proven)


def _is_taken(violation: Violation, now: Situation) -> bool:
    """Whether a disturbance took a guarantee away, as it may any but that of the time budget."""
    if now.last is None or violation.guarantee is Guarantee.BUDGET:
        return False
    before = {one.guarantee for one in now.last.disturbed}
    return bool(now.off_plan or now.changed or violation.guarantee in before)


def _decision(chosen: StepPlan, now: Situation, *, same: bool) -> Decision:
    """What a step decides, where the plan tells; `same`: its word is the last one."""
    if chosen.decision is not None:
        return chosen.decision
    if now.last is None:
        return Decision.PLANNED
    if chosen.origin is not Origin.SEARCHED:
        return Decision.KEPT
    return Decision.IMPROVED if same and now.last.decision.leads else Decision.REPLANNED


def load_search(problem: Problem) -> type[StepSearch]:
    """The search of a step for a problem, prepared before the step's clock runs."""
    load_kernels("times")
    if needs_maneuvers(problem):
        load_kernels("words", "linked words")
        if problem.obstacles or problem.zones:
            load_kernels("lattice", "improvement")
        if problem.moves:
            load_kernels("lattice", "fail-safe")
        return OverManeuvers
    if problem.obstacles:
        load_kernels("lattice", "improvement", "fail-safe")
        cost_to_go_table(problem)
        return AmongObstacles
    load_words(problem)
    return InFreeSpace


ManeuverHorizon = RecedingHorizon  # the name it has had for vehicles with inertia
