"""The closed loop of a fleet: everybody holds a plan, and may exchange it for a better one.

*Feasible*: every plan held is free of what is not of the fleet, and any two bodies keep the margin
for ever, rest included. If all drive the begin of their plans, the rests are feasible. A vehicle
may exchange its plan for another one that is proven past the plans the others hold now: pairs
without it are unchanged, so the plans are feasible again, whatever is exchanged in whatever order.
A vehicle that finds nothing better, or not in time, holds on. So nobody ever has to agree with
anybody on more than the order of swaps, and no plan is ever lost.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_fields
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import AnyObstacle
from maneuver_automaton.fleet.agreement import Lost, knowledge_of
from maneuver_automaton.fleet.exchanges import exchange, exchange_what_is_due, go_on
from maneuver_automaton.fleet.guarantees import logged
from maneuver_automaton.fleet.held import tube_of
from maneuver_automaton.fleet.moment import Effort, LoopSettings, LoopState, Moment
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import FleetLog, FleetResult, FleetStep
from maneuver_automaton.fleet.upkeep import let_in, note_arrivals, plan_anew, rejoin, stop
from maneuver_automaton.fleet.vehicle import FleetMember, prepare_vehicles, vehicles_of
from maneuver_automaton.fleet.workers import Workers
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.candidates import within


class FleetHorizon:
    """Model predictive control of a fleet: every vehicle holds a plan, and exchanges it for better.

    In every step the vehicles look for better plans, one after another, past the plans that all
    others hold at that moment. One is driven only if it is proven apart from all of these for ever
    and free of what is not of the fleet, costs less, and arrives no later. Whoever finds nothing
    holds on. Guarantees are asserted in every step; its log has each that is broken, and why.

    Off its plan by no more than its tube, a vehicle rejoins it if that is proven, and otherwise
    drives back towards it. Beyond, its plan is void: it is planned anew at once.

    Source: the paper, Theorem 17, for the value that falls. Prioritized distributed MPC (Scheffe et
    al., p-dmpc) plans one after another too, past predictions of the same step; here it is past the
    plans that are held, so that one that holds on touches nobody.

    Parameters
    ----------
    fleet : FleetProblem
    step : float
        delta [s]: the loop closes every so often.
    first : FleetResult, optional
        Plans from `plan_fleet` to begin with; who has none rests at its start.
    margin : float
        Another plan must cost less by more than this.
    tube_m : float, optional
        How far any point of a body may be from where its plan has it [m]; half of the fleet's
        margin if omitted, and never more.
    time_limit : float
        [s] per step, for all searches.
    swaps_per_step : int, optional
        So many vehicles look for a better plan in a step, by turns, those first that may gain most;
        all if None, as long as there is time.
    at_once : int
        So many look at the same time, past the plans that are held then; each swap is proven past
        those that were made before it.
    group_size : int
        Up to so many exchange their plans at once where the sum falls: some of them may then arrive
        later. Not where messages may be lost, over which several cannot agree to change at once.
    delay_steps : int
        An answer comes so many steps late; meanwhile the plan that is held is driven.
    lost : callable, optional
        Whether a message is lost; none is if omitted.
    workers : Workers, optional
        Who looks for the vehicles' plans, such as `DaskWorkers`; this process if omitted. Whose
        worker does not answer any more drives the plan that it holds.
    log : FleetLog, optional
        To go on after the last step of another loop: with the plans that were held then, and
        without the vehicles that have broken down; what was looked for in vain is looked for again.

    Raises
    ------
    ValueError
        If a number is out of its range, or the log is one of other vehicles.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> robot = Automaton.of_controls(
    ...     Unicycle(), {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    ... )
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> across = Problem(robot, [2, -2, 0], [2, 2, 0], footprint=Disc(0.3))
    >>> fleet = FleetProblem([there, across], names=["a", "b"])
    >>> loop = FleetHorizon(fleet, step=0.5)
    >>> log = loop.step({"a": [0, 0, 0], "b": [2, -2, 0]})
    >>> [swap.names for swap in log.swaps], log.control_of("a").tolist(), log.violations
    ([('a',), ('b',)], [1.0, 0.0], ())
    """

    def __init__(
        self,
        fleet: FleetProblem,
        *,
        step: float,
        first: FleetResult | None = None,
        margin: float = 0.0,
        tube_m: float | None = None,
        time_limit: float = 1.0,
        swaps_per_step: int | None = 2,
        at_once: int = 1,
        group_size: int = 1,
        delay_steps: int = 0,
        lost: Lost | None = None,
        workers: Workers | None = None,
        log: FleetLog | None = None,
    ) -> None:
        settings = LoopSettings(
            step=step,
            margin=margin,
            keep=fleet.margin,
            tube_m=tube_of(fleet, tube_m),
            time_limit=time_limit,
            swaps_per_step=swaps_per_step,
            at_once=at_once,
            group_size=group_size if lost is None else 1,
            delay_steps=delay_steps,
            workers=workers,
        )
        about, counts = "fleet horizon", ("group_size", "swaps_per_step", "at_once")
        check_fields(about, settings, "step", "time_limit", unit="s", infinite=True)
        check_fields(about, settings, "margin", "delay_steps", least=0, infinite=True)
        check_fields(about, settings, *counts, least=1)
        if not 0.0 <= settings.tube_m <= 0.5 * fleet.margin:
            raise ValueError(
                f"fleet horizon: tube_m is {settings.tube_m:g} m, need at most half of the margin "
                f"of the fleet, {fleet.margin:g} m: two bodies may both be off their plans"
            )
        vehicles = vehicles_of(fleet)
        self.fleet = fleet
        knowledge = knowledge_of(fleet.names, lost, lambda k, one: len(self._now.near_to(k, one)))
        answers = {} if first is None else first.results
        plans = {
            one.number: one.own(answer.plan, answer.goal_index)
            for one in vehicles
            if (answer := answers.get(one.name)) is not None and answer.plan is not None
        }
        self.state = LoopState(settings, vehicles, knowledge, plans)
        self._numbers = {name: k for k, name in enumerate(fleet.names)}
        if log is not None:
            self._go_on_from(log)
        # What is prepared for obstacles that vehicles have got since, which are kept alive.
        self._workspaces: dict[tuple[int, ...], tuple[tuple[AnyObstacle, ...], Workspace]] = {}
        prepare_vehicles(vehicles)

    def _go_on_from(self, log: FleetLog) -> None:
        """Hold what was held in the last step of a log, which everybody knows."""
        if log.problem.names != self.fleet.names:
            raise ValueError(
                f"fleet horizon: log is one of {', '.join(log.problem.names)}, need one of "
                f"{', '.join(self.fleet.names)}"
            )
        if not log.steps:
            return
        state, last = self.state, log.steps[-1]
        for name, plan in last.plans.items():
            one = state.vehicles[self._numbers[name]]
            goals = enumerate(one.problem.goals)
            goal_index = next((n for n, goal in goals if within(plan.end, goal)), 0)
            found = one.own(plan, goal_index, cost=None if plan.trims else 0.0)
            leads = last.values[name] < math.inf
            state.held[one.number] = found if leads else found.given_up()
            state.efforts[one.number].version = 0
        state.last = last
        state.arrived = {self._numbers[name] for name in last.arrived}
        state.broken = {self._numbers[name] for name in log.broken_down if name in last.plans}
        state.agreement.start(state.held)

    def step(
        self,
        states: Mapping[str, ArrayLike],
        *,
        time: float | None = None,
        broken_down: Collection[str] = (),
    ) -> FleetStep:
        """The plans that all hold from now on, and how they came about.

        Parameters
        ----------
        states : mapping of str to (dof,) array_like
            Measured poses [m, m, rad(, m)] of those that are there. Who is new joins as soon as
            there is room; who is left out is gone.
        time : float, optional
            [s] on the clock of all; a step after the last one if omitted.
        broken_down : collection of str
            Who cannot but stop.

        Returns
        -------
        FleetStep

        Raises
        ------
        ValueError
            If a name is none of the fleet's, a state is no pose, or time goes backwards.
        """
        state, poses = self.state, self._poses_of(states)
        at = min(one.problem.start_time for one in state.vehicles)
        if state.last is not None:
            at = state.last.time + state.settings.step
        at = at if time is None else time
        if state.last is not None and not at >= state.last.time:
            raise ValueError(
                f"fleet horizon: time is {at:g} s, before the last step, {state.last.time:g} s"
            )
        stopped = {self._number_of(name) for name in broken_down}
        budget = Budget.from_now(state.settings.time_limit)
        now = self._now = Moment(state, at, poses, budget)
        for k in [k for k in now.held if k not in now.poses]:
            del now.held[k]
        let_in(now)
        state.agreement.begin(now.number, now.held)
        rejoin(now)
        stop(now, stopped & set(now.held))
        plan_anew(now)
        note_arrivals(now)
        now.before = {k: (now.left_to_pay(k), one.arrives) for k, one in now.held.items()}
        exchange_what_is_due(now)
        go_on(now)
        exchange(now)
        searched = budget.elapsed
        state.last = logged(now)
        state.note_end(budget.elapsed - min(searched, now.searches.seconds))
        return state.last

    def assign(self, name: str, problem: Problem) -> None:
        """Give a vehicle another problem from the next step on: another goal, other obstacles.

        It drives the plan that it holds, to its end, until it has one that leads to the new goal.
        Among the obstacles must be all that this plan passes: it is not proven again.

        Parameters
        ----------
        name : str
        problem : Problem
            Its start is no matter; automaton and body are those of before.

        Raises
        ------
        ValueError
            If no vehicle has that name, the margin is less than that of all before, or the time
            is fixed.
        """
        k, state = self._number_of(name), self.state
        old = state.vehicles[k]
        if problem.margin < min(one.margin for one in self.fleet.problems):
            raise ValueError(
                f"vehicle {name!r}: its margin is {problem.margin:g} m, need at least the least "
                "of the fleet: the others are seen larger by what that lacks"
            )
        (new,) = vehicles_of(FleetProblem([problem], leaves=[old.leaves]), old.workspace.prepared)
        if len(self._workspaces) > 2 * len(state.vehicles):
            used = {id(one.workspace) for one in state.vehicles}
            rows = self._workspaces.items()
            self._workspaces = {key: row for key, row in rows if id(row[1]) in used}
        key = tuple(map(id, problem.obstacles))
        kept = self._workspaces.setdefault(key, (problem.obstacles, new.workspace))[1]
        own = replace(new.problem, obstacles=kept.obstacles)
        state.vehicles[k] = FleetMember(k, name, own, old.leaves, old.grown, kept)
        state.arrived.discard(k)
        state.due.pop(k, None)
        state.stopped.pop(k, None)
        known = state.efforts[k]
        state.efforts[k] = Effort(known.version, known.lineage)
        if k in state.held:
            state.held[k] = state.held[k].given_up()
            state.efforts[k].lineage += 1
            state.assigned.add(k)

    def _number_of(self, name: str) -> int:
        if name not in self._numbers:
            names = ", ".join(self._numbers)
            raise ValueError(f"fleet horizon: no vehicle is named {name!r}, there are {names}")
        return self._numbers[name]

    def _poses_of(self, states: Mapping[str, ArrayLike]) -> dict[int, Array]:
        """Measured poses by number, in its order."""
        poses = {}
        for name, measured in states.items():
            k = self._number_of(name)
            dof = self.state.vehicles[k].problem.automaton.model.group.dof
            pose = np.array(as_array(f"state of {name!r}", measured, last=dof))
            if pose.shape != (dof,):
                raise ValueError(f"state of {name!r}: got shape {pose.shape}, need ({dof},)")
            poses[k] = pose
        return dict(sorted(poses.items()))
