"""One step of the closed loop: shift the last plan, look for a better one, apply the beginning."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Shape, as_obstacles
from maneuver_automaton.planning.among_obstacles import library_table
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.among_obstacles import decide_among_obstacles
from maneuver_automaton.receding_horizon.candidates import cost_until, is_rest_of
from maneuver_automaton.receding_horizon.decision import Decision
from maneuver_automaton.receding_horizon.escape import load_escape
from maneuver_automaton.receding_horizon.guarantees import broken, promises, too_cheap
from maneuver_automaton.receding_horizon.log import Deed, Origin, Step
from maneuver_automaton.receding_horizon.pace import is_uniform
from maneuver_automaton.receding_horizon.settings import Settings, cheapest_rest
from maneuver_automaton.receding_horizon.situation import Chosen, Situation
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.search.choose import load_search
from maneuver_automaton.search.limits import closed_bound
from maneuver_automaton.search.ready import load_times_kernels


class RecedingHorizon:
    """Model predictive control with trims: plan to the goal, apply the beginning, plan again.

    Every step shifts the last plan, which always leads to the goal, looks for a cheaper one, and
    checks what the paper proves of the loop; what is broken stands in the log with the reason.

    Among obstacles the last plan is checked against where they are predicted now. Nothing is driven
    that is not free, and followed by a free motion: a plan to the goal and time to stand there, or
    a way out, which waits or evades. Where there is none, what does the least harm is driven, and
    flagged.

    Source: the paper, Algorithm 14, Theorem 17, Sec. 4.2 and 4.3.

    Parameters
    ----------
    problem : Problem
        Its start is the first state, its horizon fixed (then a rest must be in the library) or
        free.
    step : float
        delta [s]: the loop closes every so often.
    margin : float
        A new word must be cheaper than the rest of the last one by more than this. At 0 the
        cheapest plan is applied; of plans that cost the same, the one that costs most at first.
    time_limit : float
        [s] per step for the search; what is best by then is applied.
    last : Step, optional
        To go on from: the last step of a log.
    first : Plan, optional
        What the first step applies, instead of searching: a plan from there to the goal.
    retimed : bool
        Drive every plan at the pace that makes its effort uniform: the controls are then
        continuous, multiples of those of the library. Needs a fixed horizon, a cost with effort,
        and a vehicle whose body velocity scales with its control.
    hold : bool
        Within the goal's tolerance, correct what is left within a few steps, along plans that stay
        within it if there are such; otherwise rest.
    look_ahead : float
        [s] that a way out, or standing still, must be free; less where nothing moves any more.
    stand : float
        [s] that the goal must stay free after arrival, and a step at least.

    Raises
    ------
    ValueError
        If a number is out of range, or a fixed horizon has no rest to be prolonged by.

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
        look_ahead: float = 60.0,
        stand: float = 2.0,
    ) -> None:
        if problem.zones:
            raise ValueError(
                "receding horizon: this controller knows no zones; ManeuverHorizon does"
            )
        settings = Settings(
            step=step,
            margin=margin,
            time_limit=time_limit,
            first=first,
            hold=hold,
            retimed=retimed,
            pad=cheapest_rest(problem),
            look_ahead=look_ahead,
            stand=stand,
        )
        settings.check_horizon(problem)
        if last is not None and not 0 <= last.goal_index < len(problem.goals):
            raise ValueError(
                f"receding horizon: the last step leads to goal {last.goal_index}, need one of "
                f"the {len(problem.goals)}, counted from 0"
            )
        self.problem = problem
        self.settings = settings
        self.last = last
        self.promises = promises(problem, step=step)
        self.most_steps: int | None = None
        if last is not None and not retimed:  # the bound counts from the first step
            bound = self.promises.most_steps(last.value)
            self.most_steps = None if bound is None else bound + last.number
        load_times_kernels()
        self._see(problem.obstacles)

    def _see(self, obstacles: tuple[AnyObstacle, ...]) -> None:
        """Take these obstacles for the ones there are, and have ready what decides among them."""
        if self.settings.retimed and any(getattr(one, "motion", None) for one in obstacles):
            raise ValueError(
                "receding horizon: retimed plans meet what moves at other times; need obstacles "
                "that stand still"
            )
        self.problem = replace(self.problem, obstacles=obstacles)
        if not obstacles:
            load_search(self.problem)
            return
        load_lattice()
        load_escape()
        library_table(self.problem)

    def step(
        self,
        measured_state: ArrayLike,
        *,
        elapsed: float | None = None,
        obstacles: Sequence[AnyObstacle | Shape] | None = None,
    ) -> tuple[Array | None, Step]:
        """Decide what to do from `measured_state`.

        Parameters
        ----------
        measured_state : (dof,) array_like
            Pose [m, m, rad(, m)].
        elapsed : float, optional
            [s] since the last step; if omitted, what was to be applied of its plan.
        obstacles : sequence of Obstacle or OccupancyMap, optional
            What is seen from now on, with its predicted motions in the time of the world; if
            omitted, what was seen last, at first that of the problem.

        Returns
        -------
        control : (n_u,) array or None
            What holds from now on; None if the goal is reached and the library has no rest.
        log : Step
            The whole plan, its value, how it came about, and the guarantees that were broken.

        Raises
        ------
        ValueError
            If the state is no pose, or the time negative.

        Notes
        -----
        Where no plan leads to the goal, in whatever time, the log says so: its value is infinite,
        and the vehicle rests. Among obstacles its value is then a lower bound, and ``deed`` says
        what it does instead.
        """
        dof = self.problem.automaton.model.group.dof
        pose = np.array(as_array("measured_state", measured_state, last=dof))
        if pose.shape != (dof,):
            raise ValueError(f"measured_state: got shape {pose.shape}, need ({dof},)")
        changed = obstacles is not None and as_obstacles(obstacles) != self.problem.obstacles
        if obstacles is not None and changed:
            self._see(as_obstacles(obstacles))
        began = time.monotonic()
        last = self.last
        passed = 0.0 if last is None else (last.applied if elapsed is None else elapsed)
        if not 0.0 <= passed < math.inf:
            raise ValueError(f"elapsed must be at least 0, got {passed} s")
        if last is not None and passed != last.applied:
            last = self._cut(last, passed)
        at = self.problem.start_time if last is None else last.time + passed
        here = replace(self.problem, start=pose, start_time=at)
        if here.obstacles:
            chosen = decide_among_obstacles(self.settings, here, last, passed, began)
        else:
            chosen = Decision(Situation(self.settings, here, last, passed, began)).chosen()
        now = self._logged(chosen, here, last, began, changed=changed)
        self.last = now
        control = now.control
        if control is None and self.settings.pad is not None:
            control = self.settings.pad.control
        return control, now

    def _cut(self, last: Step, passed: float) -> Step:
        """The last step as it was driven, for `passed` seconds; one cut short is not counted."""
        if passed < last.applied and self.most_steps is not None:
            self.most_steps += 1
        return replace(
            last, applied=passed, applied_cost=cost_until(self.problem, last.plan, passed)
        )

    def _logged(
        self, chosen: Chosen, here: Problem, last: Step | None, began: float, *, changed: bool
    ) -> Step:
        plan, goal = chosen.plan, here.goals[chosen.goal_index]
        retimed = self.settings.retimed
        deed = _deed(chosen, last)
        bound = self._bound(chosen, here)
        nowhere = not deed.leads and bool(here.obstacles)
        value = bound if nowhere else chosen.value
        applied = min(self.settings.step, plan.duration) if plan.trims else self.settings.step
        now = Step(
            time=here.start_time,
            pose=here.start,
            plan=plan,
            goal_index=chosen.goal_index,
            value=value,
            applied=applied,
            applied_cost=cost_until(here, plan, applied),
            accumulated_cost=0.0 if last is None else last.accumulated_cost + last.applied_cost,
            origin=chosen.origin,
            replanned=last is not None and not is_rest_of(plan, chosen.rest),
            shifted_value=chosen.shifted_value,
            off_plan=chosen.off_plan,
            lower_bound=min(value, bound),
            exhaustive=chosen.exhaustive,
            solve_s=time.monotonic() - began,
            number=0 if last is None else last.number + 1,
            arrived=chosen.arrived,
            deed=deed,
            free_until=chosen.free_until,
        )
        if (last is None or now.off_plan) and not retimed:  # from here on, undisturbed
            most = None if here.moves or nowhere else self.promises.most_steps(now.value)
            self.most_steps = None if most is None else most + now.number
        if here.moves:
            self.most_steps = None  # to wait may cost nothing
        found = list(chosen.violations)
        if last is not None and deed.leads and last.deed.leads:
            found += broken(
                self.promises,
                goal,
                last,
                now,
                most_steps=None if retimed else self.most_steps,
                uniform=retimed and is_uniform(now.plan, here.cost),
                moved=here.moves or changed,
            )
        if deed.leads and not (now.arrived or retimed or here.moves):
            found += too_cheap(self.promises, now)
        return replace(now, violations=tuple(found))

    def _bound(self, chosen: Chosen, here: Problem) -> float:
        """No plan to any goal costs less."""
        if chosen.exhaustive:
            return chosen.value
        if self.settings.retimed:  # trims at another pace may cost less than those of the library
            return min(self.promises.effort_bound(here.start, goal) for goal in here.goals)
        return min(closed_bound(here, goal) for goal in here.goals)


def _deed(chosen: Chosen, last: Step | None) -> Deed:
    """What a step does, where the decision does not say it."""
    if chosen.deed is not None:
        return chosen.deed
    if math.isinf(chosen.value):
        return Deed.STOPPED
    if last is None:
        return Deed.PLANNED
    if chosen.origin is not Origin.SEARCHED:
        return Deed.KEPT
    same = last.deed.leads and is_rest_of(chosen.plan, chosen.rest)
    return Deed.IMPROVED if same else Deed.REPLANNED
