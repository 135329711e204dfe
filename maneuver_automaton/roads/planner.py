"""One step of driving: the tail of the last plan, a search for a better one, the choice."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import _kernels_beam, _kernels_costs, _kernels_motion
from maneuver_automaton.roads.arrays import (
    BeamArrays,
    Clearing,
    GoalArrays,
    HorizonTask,
    RoadArrays,
)
from maneuver_automaton.roads.hopeless import hopeless, kept_at_start
from maneuver_automaton.roads.plans import (
    AT_REST,
    ROUND,
    RoadDecision,
    RoadSettings,
    plan_of_controls,
    polished_controls,
)
from maneuver_automaton.roads.route import Route, hindrance, route_of
from maneuver_automaton.roads.rules import DEEP, Barrier, barriers, broken_rules, nearest_to
from maneuver_automaton.roads.scene import RoadScene, moved_obstacle
from maneuver_automaton.roads.search_arrays import (
    beam_arrays,
    clearing_of,
    closed_lines,
    goal_arrays,
    route_arrays,
    static_obstacles,
    weights_of,
)
from maneuver_automaton.roads.vehicle import RoadLibrary, RoadVehicle, road_library, tick_of

CELL, TURN_CELL, SPEED_CELL = 0.5, 0.06, 2.0  # [m], [rad], [m/s] of equal nodes
SHARES = (math.nan, 0.0, 0.2, -0.2, 0.5, -0.5, 1.0, -1.0)  # of steering while it stops; nan: held
SHARE = 0.25  # of the nodes of a level that one strip along the route may hold
LONGEST_STOP = 12.0  # [s]
SLACK = 1.2  # of the last plan's cost: a new plan is polished, too, before it is compared
LOOK = 0.005  # [s] between two looks at a drive, for rules that it breaks
PASSES = 2  # of polishing a plan that is kept, in each step
DIGITS = 9  # of the numbers of a scene [m, rad]
SEEN_OTHERWISE = 0.05  # [m] by which distances differ of two that both see the other one larger


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPlanner:
    """All that planning needs on one scene, made once.

    States and plans are seen from `frame`, the start of the rear axle, so that a moved scene has
    the moved plans.
    """

    scene: RoadScene  # as it was given
    frame: Array  # (3,) [m, m, rad]
    local: RoadScene  # the scene seen from the frame
    vehicle: RoadVehicle
    settings: RoadSettings
    route: Route
    library: RoadLibrary
    horizon: RoadArrays
    room: BeamArrays = field(repr=False)
    kind: tuple[Obstacle, ...] = ()  # of the scene's traffic what drives by plans like its own
    barriers: tuple[Barrier, ...] = ()  # closed stop lines that it can keep, in the frame

    __repr__ = brief

    @property
    def tick(self) -> float:
        """Time that is proven at once [s]: a part of the scene's step if that is long."""
        return self.library.limits.tick

    @property
    def every(self) -> int:
        """Ticks of a step of the scene, from which on controls are held until the next one."""
        return self.horizon.goals.every

    @property
    def last_tick(self) -> int:
        """Tick at which the last goal is over."""
        return int(self.horizon.goals.tick[:, 1].max())

    @property
    def start_state(self) -> Array:
        """State (5,) at the beginning: x, y, heading of the rear axle, speed, steering."""
        start = self.local.start
        steering = self.vehicle.steering_of(start.speed, start.turn_rate)
        return np.array([*self.vehicle.rear_of(start.middle), start.speed, steering])

    def world(self, poses: ArrayLike) -> Array:
        """Poses (..., 3) in the coordinates of the scene as it was given."""
        return (SE2(self.frame) @ SE2(np.asarray(poses))).pose

    def time_of(self, tick: int) -> float:
        """Time of a tick [s]."""
        return self.scene.start.time + self.tick * tick

    def at_goal(self, state: Array, *, tick: int) -> bool:
        """Whether a state (5,) at a tick is within a goal, as `GoalRegion` says.

        Goals are looked at only when the scene's own clock ticks.
        """
        if tick % self.horizon.goals.every:
            return False
        middle = self.vehicle.middle_of(state[:3])
        return any(
            goal.contains(middle, speed=float(state[3]), time=self.time_of(tick))
            for goal in self.local.goals
        )

    def hopeless(self, others: Sequence[Obstacle] = ()) -> tuple[str, str] | None:
        """Status and words of what lets every drive from the start fail, if anything does.

        `others` are there at the start besides the traffic of the scene.
        """
        there = self.plan_of(self.start_state, np.zeros((0, 2)))
        scene = replace(self.scene, traffic=(*self.scene.traffic, *others))
        return hopeless(scene, self.vehicle, there)

    def wider(self, width: int, *, horizon_s: float) -> RoadPlanner:
        """A planner like this one that searches another width, and another time ahead [s]."""
        settings = replace(self.settings, width=width, horizon_s=horizon_s)
        return replace(self, settings=settings, room=beam_arrays(settings, self.library))

    def hurried(self) -> RoadPlanner:
        """A planner like this one, limits of speed no rule: what is beyond them has a price."""
        route = self.horizon.route
        freed = route._replace(slowing=-math.inf, time=np.zeros_like(route.time))
        return replace(self, horizon=self.horizon._replace(route=freed))

    @property
    def limits_leave_time(self) -> bool:
        """Whether limits of speed leave time for a goal, as the cost to go estimates it."""
        route, goals = self.horizon.route, self.horizon.goals
        here = np.argmin(np.hypot(*(route.point - self.local.start.middle[:2]).T))
        stations = route.spacing * np.arange(len(route.time))
        lasts = np.interp(goals.extent[:, 0], stations, route.time) - route.time[here]
        return bool((lasts <= goals.tick[:, 1] * self.tick).any())

    def past(self, others: Sequence[Obstacle]) -> RoadPlanner:
        """A planner like this one, among others of its kind besides: what these hold is known.

        What it holds itself was proven past them as they saw it, so it may come a little nearer.
        """
        scene = replace(self.scene, traffic=(*self.scene.traffic, *others))
        back = SE2(self.frame).inverse()
        more = tuple(moved_obstacle(one, back, digits=DIGITS) for one in others)
        local = replace(self.local, traffic=(*self.local.traffic, *more))
        return replace(self, scene=scene, local=local, kind=tuple(others))._cleared()

    def without(self, names: Collection[str]) -> RoadPlanner:
        """A planner like this one, some of those who move not there."""
        scene, local = (
            replace(one, traffic=tuple(k for k in one.traffic if k.name not in names))
            for one in (self.scene, self.local)
        )
        return replace(self, scene=scene, local=local)._cleared()

    def until(self, tick: int) -> RoadPlanner:
        """A planner like this one, all goals over at a tick at the latest."""
        goals = self.horizon.goals
        ticks = np.minimum(goals.tick, tick)
        return replace(self, horizon=self.horizon._replace(goals=goals._replace(tick=ticks)))

    def opened(self, state: Array) -> RoadPlanner:
        """A planner like this one, those stop signs done before which it stands in a state (5,)."""
        rear, speed = state[:3], float(state[3])
        left = [one for one in self.barriers if not one.opens_for(self.vehicle, rear, speed)]
        if len(left) == len(self.barriers):
            return self
        return replace(self, barriers=tuple(left))._cleared()

    def _cleared(self) -> RoadPlanner:
        """The same once traffic or barriers are others."""
        clearing, closed = _kept_clear_of(
            self.local, self.vehicle, self.settings, self.barriers, self.route, self.horizon.goals
        )
        route = self.horizon.route._replace(closed=closed)
        return replace(self, horizon=self.horizon._replace(clearing=clearing, route=route))

    def waits(self, state: Array, *, tick: int) -> str:
        """Which line is closed ahead of a state (5,) at a tick, as the end of a sentence."""
        for one in self.barriers:
            begin, end = one.time
            if begin <= self.time_of(tick) <= end and one.from_body(self.vehicle, state[:3])[1]:
                return f"; the line of {one.stop_line.name} is closed ahead of it"
        return ""

    @property
    def hindrance(self) -> str:
        """What may keep the vehicle from its route, as the end of a sentence."""
        return hindrance(self.route, self.local, self.vehicle)

    def notes(self, controls: Array) -> tuple[str, ...]:
        """What of the file, and of its rules under controls (n, 2) of ticks, is not obeyed."""
        looks, wheelbase = math.ceil(self.tick / LOOK), self.vehicle.model.wheelbase
        held, look = np.repeat(controls, looks, axis=0), self.tick / looks
        states = _kernels_motion.driven(wheelbase, look, self.start_state, held)
        times: Array = self.scene.start.time + look * np.arange(len(states), dtype=np.float64)
        rules = broken_rules(self.local, self.vehicle, self.route.lanelets, states, times)
        return (*self.scene.notes, *rules)

    def warm(self) -> None:
        """Compile the kernels and touch the room, before time counts."""
        first, _ = self.decide(self.start_state, tick=0, tail=None)
        self.decide(first.states[self.every], tick=self.every, tail=first.tail(self.every))

    def plan_of(
        self, state: Array, controls: Array, *, tick: int = 0, max_step: float = 0.05
    ) -> Plan:
        """The plan from a state (5,) at a tick under controls (n, 2), as the scene was given.

        Its samples are at most `max_step` [m, rad] apart.
        """
        return plan_of_controls(
            self.vehicle.model,
            np.concatenate([self.world(state[:3]), state[3:]]),
            controls,
            tick=self.tick,
            start_time=self.time_of(tick),
            max_step=max_step,
        )

    def decide(
        self, state: Array, *, tick: int, tail: RoadDecision | None
    ) -> tuple[RoadDecision, bool]:
        """What to do from a state (5,) at a tick, and whether it is not the tail of the last plan.

        The `tail` of the last plan is proven again from where the vehicle is, and kept unless a
        new plan is better; then it is polished further. A motion that is not free is driven
        only where none is: then braking.
        """
        old = None if tail is None else self._again(state, tail)
        settled = old is not None and old.reaches
        # Where the last plan leads to a goal, only nodes that may better it are followed.
        below = SLACK * self.price(old) if old is not None and settled and old.stops else math.inf
        new = self.search(state, tick=tick, narrow=settled, below=below)
        if new is not None:
            new = self.polished(new) if self._may_stand(new) else None
        if old is None:
            return (self._emergency(state, tick) if new is None else new), True
        if new is None or not self._better(new, old):
            kept = self.polished(old, passes=PASSES)
            return kept, kept is not old
        return new, True

    def _may_stand(self, plan: RoadDecision) -> bool:
        """Whether a plan reaches a goal, or nobody of its kind comes where it stops."""
        if plan.reaches or not self.kind:
            return True
        n = len(plan.controls)
        still = np.array([*plan.states[n, :3], 0.0, plan.states[n, 4]])
        last = max(float(one.motion.time[-1]) for one in self.kind if one.motion is not None)
        lasting = max(math.ceil((last - self.time_of(plan.tick + n)) / self.tick), 1)
        stands = self.plan_of(still, np.zeros((lasting, 2)), tick=plan.tick + n)
        off = self.settings.off_traffic_m
        least = (nearest_to(stands, self.vehicle, one, enough=off) for one in self.kind)
        return all(one.distance > off for one in least)

    def polished(self, plan: RoadDecision, *, passes: int = ROUND, rounds: int = 1) -> RoadDecision:
        """A plan to a goal made cheaper by `polished_controls`; any other as it is."""
        if not plan.reaches:
            return plan
        controls = polished_controls(self.horizon, plan, passes=passes, rounds=rounds)
        if controls is None:
            return plan
        return self.of_controls(plan.states[0], plan.tick, controls, plan.lasting, reaches=True)

    def search(
        self, state: Array, *, tick: int, narrow: bool = False, below: float = math.inf
    ) -> RoadDecision | None:
        """A new plan from a state (5,) with a fail-safe stop after it; None if none was found.

        With a cost `below`, only a plan to a goal that costs less is an answer.
        A vehicle at rest from which no motion is free stands, as long as standing is free.
        """
        library, settings = self.library, self.settings
        ahead = self.every * math.floor(settings.horizon_s / self.scene.step + 1e-9)
        until = min(tick + ahead, self.last_tick)
        x, y, heading, speed, steering = state.tolist()
        speed = 0.0 if abs(speed) <= AT_REST else speed  # stops end with what rounding left
        if until <= tick or speed < 0.0:  # the library knows no motion from backward travel
            return None
        width = min(settings.narrow, settings.width) if narrow else settings.width
        task = HorizonTask(
            x=x,
            y=y,
            heading=heading,
            speed=speed,
            steering=steering,
            tick=tick,
            until=until,
            cell=CELL,
            turn_cell=TURN_CELL,
            speed_cell=SPEED_CELL,
            width=width,
            abreast=max(math.ceil(SHARE * width), 1),
            greed=settings.greed,
            below=below,
        )
        first = _kernels_motion.maneuvers_from(library.limits, library.trims, speed, steering)
        stop = math.ceil(LONGEST_STOP / self.tick)
        controls = np.zeros((until - tick + library.limits.ticks + stop, 2))
        reaches, n, whole = _kernels_beam.search_beam(
            task, self.horizon, first, self.room, np.array(SHARES), controls
        )
        if whole == 0:
            standing = self._standing(state, tick)
            free = _kernels_motion.free_ticks(
                self.horizon.clearing, np.array(standing.states), tick
            )
            return standing if free else None
        if whole < 0:
            return None
        found = self.of_controls(state, tick, controls[:whole], n, reaches=reaches)
        return found if self.every == 1 else self._in_steps(found)

    def _in_steps(self, plan: RoadDecision) -> RoadDecision | None:
        """A plan whose stop has one control in each step, their mean, as far as that is free."""
        n, every = plan.lasting, self.every
        stop = np.pad(plan.controls[n:], [(0, (n - len(plan.controls)) % every), (0, 0)])
        means = stop.reshape(-1, every, 2).mean(axis=1)
        controls = np.concatenate([plan.controls[:n], np.repeat(means, every, axis=0)])
        state, tick, reaches = plan.states[0], plan.tick, plan.reaches
        held = self.of_controls(state, tick, controls, n, reaches=reaches)
        if self._free_ticks(held.states, tick) == len(controls):
            return held
        return self.of_controls(state, tick, controls[:n], n, reaches=True) if reaches else None

    def _standing(self, state: Array, tick: int) -> RoadDecision:
        """A step of rest."""
        return self.of_controls(state, tick, np.zeros((self.every, 2)), 0, reaches=False)

    def of_controls(
        self, state: Array, tick: int, controls: Array, lasting: int, *, reaches: bool
    ) -> RoadDecision:
        """The plan from a state (5,) under controls (n, 2), those of its stop included."""
        states = _kernels_motion.driven(
            self.vehicle.model.wheelbase, self.tick, np.array(state), np.array(controls)
        )
        return RoadDecision(
            tick=tick, states=states, controls=controls, lasting=lasting, reaches=reaches
        )

    def standing_on(self, plan: RoadDecision) -> RoadDecision:
        """A plan and its stop that meet a goal there or at rest after it; any other as it is."""
        rest = max(self.last_tick - plan.tick - len(plan.controls), 0)
        controls = np.concatenate([plan.controls, np.zeros((rest, 2))])
        on = self.of_controls(plan.states[0], plan.tick, controls, plan.lasting, reaches=True)
        states, tick = np.array(on.states), plan.tick + plan.lasting
        met = _kernels_costs.first_goal(self.horizon, states[plan.lasting :], tick)
        n = plan.lasting + met
        clearing = self.horizon.clearing
        if met < 0 or _kernels_motion.free_ticks(clearing, states[: n + 1], plan.tick) < n:
            return plan
        lasting = max(n, len(plan.controls))
        return self.of_controls(plan.states[0], plan.tick, controls[:lasting], n, reaches=True)

    def _again(self, state: Array, tail: RoadDecision) -> RoadDecision | None:
        """The tail of a plan from where the vehicle is; None if it is not free any more."""
        if not len(tail.controls):
            return None
        plan = self.of_controls(state, tail.tick, tail.controls, tail.lasting, reaches=tail.reaches)
        free = self._free_ticks(plan.states, plan.tick)
        if free < len(plan.controls):
            if not (self.kind and plan.reaches and free >= plan.lasting):
                return None
            # Others of its kind drive where it would stop, as it is gone from its goal by then.
            controls = plan.controls[: plan.lasting]
            plan = self.of_controls(state, tail.tick, controls, plan.lasting, reaches=True)
        if plan.reaches:
            until = np.array(plan.states[: plan.lasting + 1])
            if _kernels_costs.first_goal(self.horizon, until, plan.tick) < 0:
                return None
        return plan

    def _free_ticks(self, states: Array, tick: int) -> int:
        """How many ticks of a motion (n + 1, 5) are free, past stop signs where it stands there."""
        clearing = self.horizon.clearing
        if self.kind:
            clearing = clearing._replace(off_traffic=clearing.off_traffic - SEEN_OTHERWISE)
        free = int(_kernels_motion.free_ticks(clearing, np.array(states), tick))
        for k, state in enumerate(states[: free + 1] if free < len(states) - 1 else ()):
            if (opened := self.opened(state)) is not self:
                return k + opened._free_ticks(states[k:], tick + k)
        return free

    def _better(self, new: RoadDecision, old: RoadDecision) -> bool:
        """Whether a new plan is worth leaving the old one for."""
        if new.reaches != old.reaches:
            return new.reaches
        if new.stops != old.stops:
            return new.stops
        if not new.reaches:
            if self._rests(old) and not self._rests(new):
                return False
            # It looks a tick further, unless nothing better than to stop at once was found.
            return new.lasting > 0 or not old.lasting
        return self.price(new) < (1.0 - self.settings.gain) * self.price(old)

    def _rests(self, plan: RoadDecision) -> bool:
        """Whether nobody comes where a plan stops, until the goals are over."""
        tick = plan.tick + len(plan.controls)
        still = np.repeat(plan.states[-1:], max(self.last_tick - tick, 0) + 1, axis=0)
        return _kernels_motion.free_ticks(self.horizon.clearing, still, tick) == len(still) - 1

    def price(self, plan: RoadDecision, *, ticks: int | None = None) -> float:
        """Cost of a plan, or of its first ticks, its stop left out."""
        n = plan.lasting if ticks is None else ticks
        states, controls = np.array(plan.states[: n + 1]), np.array(plan.controls[:n])
        return float(_kernels_costs.price(self.horizon, states, controls))

    def _emergency(self, state: Array, tick: int) -> RoadDecision:
        """Full braking straight on, free or not."""
        step, speeds = self.scene.step, [float(state[3])]
        while speeds[-1]:
            left = max(abs(speeds[-1]) - self.vehicle.model.max_acceleration * step, 0.0)
            speeds.append(math.copysign(left, speeds[-1]))
        rates = np.repeat(np.diff(speeds) / step, self.every)
        controls = np.stack([rates, np.zeros_like(rates)], axis=-1).reshape(-1, 2)
        if not len(controls):
            return self._standing(state, tick)
        return self.of_controls(state, tick, controls, 0, reaches=False)


def road_planner(
    scene: RoadScene, vehicle: RoadVehicle | None = None, settings: RoadSettings | None = None
) -> RoadPlanner:
    """Everything for driving on a scene, made once."""
    vehicle = vehicle or RoadVehicle()
    settings, (edge, traffic) = settings or RoadSettings(), kept_at_start(scene, vehicle)
    if edge < settings.off_edge_m:  # half of what the start keeps, where that keeps less
        settings = replace(settings, off_edge_m=0.5 * edge)
    if traffic < settings.off_traffic_m:
        settings = replace(settings, off_traffic_m=0.5 * traffic)
    tick = tick_of(scene.step)
    wanted = [one.speed for one in scene.goals if one.speed is not None]
    fastest = math.ceil(max(scene.start.speed, *(low for low, _ in wanted), settings.top_speed))
    top = min(fastest, vehicle.model.max_speed)
    frame = vehicle.rear_of(scene.start.middle)
    local = scene.moved(SE2(frame).inverse(), digits=DIGITS)
    route = route_of(local)
    stated = {one.number: one.speed_limit for one in local.lanelets}
    limits = {limit for k in route.lanelets if (limit := stated[k]) is not None}
    library = road_library(
        vehicle, top_speed=top, step=scene.step, within=wanted, at=sorted(limits)
    )
    goals = goal_arrays(local, route, tick=tick)
    until = local.start.time + _last_tick(goals, settings, tick) * tick
    closed = tuple(
        one
        for one in barriers(local, vehicle, route.lanelets, until=until)
        if not one.comes_too_late(vehicle, local.start, settings.off_traffic_m + DEEP)
    )
    clearing, lines = _kept_clear_of(local, vehicle, settings, closed, route, goals)
    horizon = RoadArrays(
        clearing=clearing,
        limits=library.limits,
        trims=library.trims,
        maneuvers=library.maneuvers,
        route=route_arrays(route)._replace(closed=lines),
        goals=goals,
        obstacles=static_obstacles(local, route, vehicle),
        weights=weights_of(scene, vehicle),
    )
    return RoadPlanner(
        scene=scene,
        frame=frame,
        local=local,
        vehicle=vehicle,
        settings=settings,
        route=route,
        library=library,
        horizon=horizon,
        room=beam_arrays(settings, library),
        barriers=closed,
    )


def _last_tick(goals: GoalArrays, settings: RoadSettings, tick: float) -> int:
    """When the last stop is over."""
    return max(int(goals.tick[:, 1].max()), 0) + math.ceil(
        (settings.horizon_s + LONGEST_STOP) / tick
    )


def _kept_clear_of(
    local: RoadScene,
    vehicle: RoadVehicle,
    settings: RoadSettings,
    closed: Sequence[Barrier],
    route: Route,
    goals: GoalArrays,
) -> tuple[Clearing, Array]:
    """What has to be kept clear of until the last stop, and `RouteArrays.closed`."""
    tick, keep = tick_of(local.step), settings.off_traffic_m
    clearing = clearing_of(
        replace(local, traffic=(*local.traffic, *(one.obstacle for one in closed))),
        vehicle,
        tick=tick,
        last_tick=_last_tick(goals, settings, tick),
        off_edge=settings.off_edge_m,
        off_traffic=keep,
    )
    return clearing, closed_lines(closed, route, vehicle, local.start.time, keep)
