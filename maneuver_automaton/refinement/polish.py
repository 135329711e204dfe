"""Polish plans of a vehicle with inertia: several guesses, the best exact motion that is accepted.

For each guess: with the lines between body and obstacles kept as the guess has them, which is quick
and seldom fails; from there with lines that are free. The first guess goes to the end at once, of
the others only those that come close to the best. Whatever is found is closed: it ends at the goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import Obstacle, Shape
from maneuver_automaton.collision.convex import convex_pieces, pieces_seen_from
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import lateral_limit
from maneuver_automaton.optimal_control import Guess, SolveStatus
from maneuver_automaton.optimal_control.polishing import Begin, held, intervals_for, polish
from maneuver_automaton.optimal_control.problem import RunningCost, resampled
from maneuver_automaton.optimal_control.scene import (
    LEAST_DURATION,
    MOST_DURATION,
    USUAL,
    BodyPart,
    Guard,
    MotionEnds,
    MovingSolid,
    NodeOnTheWay,
    PlacesAt,
    Polished,
    PolishScene,
    PolishSettings,
    settled,
)
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.problem import Bounds
from maneuver_automaton.refinement.closure import PolishedMotion, closed
from maneuver_automaton.refinement.gear_sequences import gears_of, without_shuffles

NEAR = 1.12  # share of the best cost so far up to which free lines are tried
SLOW = 1.6  # times the best cost so far: of guesses that take longer none came out best
DEEP_ITERATIONS = 150  # from a guess inside obstacles, before it is led out of them
SHUFFLE = 6  # changes of gear from which on gears are fixed first
FIRST_BUILD = 0.3  # [s] that writing a problem down is expected to take
LONGER = 3  # times the usual iterations, for free lines: among many obstacles they take so many
ROOM = 20.0  # times the usual distance from all limits, where closing the end needed more
EVEN = 1e-9  # [s] by which equal steps may differ
SHUFFLED = 0.01  # radii of the body: shorter stretches in one gear are none that a plan names
STEADY = 1e-3  # share of the cost by which a motion without them may be costlier
FINER = 0.6  # share of the step with which the best is solved once more


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PolishTask:
    """A vehicle, its start and goal, and the obstacles around it."""

    model: Model
    start: Array  # (dof,)
    start_state: Array  # (n_z,)
    goal: tuple[float | None, ...]  # (dof,) None for a heading or a height that is free
    goal_state: tuple[float | None, ...]  # (n_z,) None for what is free
    parts: tuple[BodyPart, ...] = ()  # the body; without one, no obstacle counts
    obstacles: tuple[Shape, ...] = ()  # static
    movers: tuple[Obstacle, ...] = ()
    start_time: float = 0.0  # [s] on their clock
    bounds: Bounds = field(default_factory=Bounds)  # of the reference point
    margin: float = 0.0  # [m] distance kept from obstacles
    guards: tuple[tuple[Guard, Shape], ...] = ()  # limits of the twist where the body touches
    durations: tuple[float, float] = (LEAST_DURATION, MOST_DURATION)  # [s] least and greatest
    places: PlacesAt | None = None  # what they cost, seen from the start, as the objective

    def __post_init__(self) -> None:
        freeze(self, "start", last=self.model.group.dof)
        freeze(self, "start_state", last=len(self.model.reduced_names))
        for name, count in (
            ("goal", self.model.group.dof),
            ("goal_state", len(self.model.reduced_names)),
        ):
            values = tuple(None if v is None else float(v) for v in getattr(self, name))
            object.__setattr__(self, name, values)
            if len(values) != count:
                raise ValueError(f"polish: {name} has {len(values)} components, need {count}")
        if self.goal[0] is None or self.goal[1] is None:
            raise ValueError("polish: the goal's place must be given, only its heading may be None")
        low, high = self.model.reduced_limits.T
        if ((self.start_state < low) | (self.start_state > high)).any():
            raise ValueError(
                f"polish: start_state {self.start_state.tolist()} is outside the model's limits "
                f"{self.model.reduced_limits.tolist()}"
            )

    @property
    def scene(self) -> PolishScene:
        """Body, obstacles and bounds seen from the start."""
        pieces = pieces_seen_from(self.obstacles, self.start[:3]).each()
        most = lateral_limit(self.model)  # a limit of the vehicle that is none of one state alone
        everywhere = [Guard(lateral=most)] if math.isfinite(most) else []
        return PolishScene(
            parts=self.parts,
            pieces=tuple((settled(corners), by + self.margin) for corners, by in pieces),
            movers=tuple(mover for one in self.movers for mover in self._movers_of(one)),
            walls=tuple(self._walls()),
            guards=(*everywhere, *map(self._seen, self.guards)),
            places=self.places,
        )

    def _seen(self, one: tuple[Guard, Shape]) -> Guard:
        """A guard with its solids seen from the start."""
        guard, shape = one
        seen = pieces_seen_from((shape,), self.start[:3]).each()
        return guard._replace(solids=tuple((settled(corners), by) for corners, by in seen))

    def _movers_of(self, obstacle: Obstacle) -> Iterator[MovingSolid]:
        """The convex pieces of an obstacle that moves, seen from the start and its time."""
        motion, origin, since = obstacle.motion, self.start[:3], self.start_time
        assert motion is not None

        def poses(times: Array) -> Array:
            return np.asarray((SE2(origin).inverse() @ SE2(motion.at(since + times))).pose)

        first, last = obstacle.presence
        for corners, by in convex_pieces(obstacle.shape):
            yield MovingSolid(corners, by + self.margin, poses, (first - since, last - since))

    def _walls(self) -> list[tuple[float, float, float]]:
        cosine, sine = math.cos(self.start[2]), math.sin(self.start[2])
        axes = ((self.bounds.x, 0, (cosine, -sine)), (self.bounds.y, 1, (sine, cosine)))
        walls = []
        for pair, axis, (a, b) in axes:
            if pair is not None:
                low, high = (limit - float(self.start[axis]) for limit in pair)
                walls += [(a, b, high), (-a, -b, -low)]
        return [(a, b, c) for a, b, c in settled(np.array(walls).reshape(-1, 3)).tolist()]

    def ends(self, heading: float) -> MotionEnds:
        """First and last state seen from the start; the heading nearest to one that is near [rad].

        Places are counted from the start before they are turned, so that no digit is lost.
        """
        group = group_of(self.start.size)
        filled = np.array([0.0 if v is None else v for v in self.goal])
        origin = np.array([*self.start[:2], 0.0, *self.start[3:]])
        turned = np.where(np.arange(self.start.size) == 2, self.start, 0.0)
        end: list[float | None] = [
            float(v) for v in (group(turned).inverse() @ group(filled - origin)).pose
        ]
        if self.goal[2] is None:
            end[2] = None
        else:
            turn = self.goal[2] - float(self.start[2])
            end[2] = heading + math.remainder(turn - heading, 2.0 * math.pi)
        if len(self.goal) > 3 and self.goal[3] is None:
            end[3] = None
        still = (0.0,) * self.start.size
        return MotionEnds(
            (*still, *self.start_state.tolist()), (*end, *self.goal_state), self.durations
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Attempt:
    """One call of the solver."""

    guess: int  # number of the guess
    kind: str  # fixed planes | lines | elastic | gears | room | finer
    duration: float  # [s] of the result
    status: str
    iterations: int
    seconds: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PolishResult:
    """The best motion, and the attempts made for it."""

    motion: PolishedMotion | None
    reason: str  # why there is none
    attempts: tuple[Attempt, ...]


Accepts = Callable[[PolishedMotion], bool]


def polish_guesses(
    task: PolishTask,
    guesses: Iterable[Guess],
    *,
    stage_cost: RunningCost | None = None,
    budget: Budget = UNLIMITED,
    most_iterations: int | None = None,
    accepts: Accepts = lambda motion: True,
) -> PolishResult:
    """The best exact motion that some guesses lead to; raises MissingExtra without CasADi.

    `guesses`: seen from the start, the most promising first, asked for one by one; see there.
    `stage_cost`: per second, on top of 1 for the time. `most_iterations` of the solver, over all
    guesses: the attempts then do not depend on the clock, unless the time is over before.
    `accepts`: whether a motion is sound, say by an audit: solver success proves nothing.
    """
    return _Polishing(task, task.scene, guesses, stage_cost, budget, most_iterations, accepts).run()


def polish_through(
    task: PolishTask,
    guess: Guess,
    via: Sequence[NodeOnTheWay],
    *,
    stays: Sequence[tuple[int, float]] = (),
    stage_cost: RunningCost | None = None,
    budget: Budget = UNLIMITED,
    most_iterations: int | None = None,
) -> list[PolishedMotion] | str:
    """Exact motions through poses on the way that a guess leads to; why there is none, if so.

    One follows the other where a reduced state on the way is given, one leads past all others.
    `guess`: seen from the start, with nodes at the poses on the way; `via`: these in order, with
    pose and reduced state seen from the start; None is free. `stays`: nodes at which it stands
    between two of the motions, and how long [s], which what moves goes on for.
    """
    ends, why = task.ends(float(guess.state[-1, 2])), ""
    scene = replace(task.scene, stays=tuple(stays))
    most = min(most_iterations or USUAL.max_iterations, USUAL.max_iterations)
    for room in (1.0, ROOM):  # more of it where closing broke a limit
        some = replace(USUAL, tightening=room * USUAL.tightening, max_iterations=most)
        found = polish(task.model, ends, scene, guess, stage_cost=stage_cost, settings=some,
                       via=via, budget=budget)  # fmt: skip
        if not found.is_feasible:
            return found.reason
        ending = _closed_through(task, found, (*via, (len(found.control), ends.end)), budget)
        if not isinstance(ending, str):
            return ending
        why = ending
    return why


def _closed_through(
    task: PolishTask, found: Polished, nodes: Sequence[NodeOnTheWay], budget: Budget
) -> list[PolishedMotion] | str:
    """The motions closed from node to node, each from where the one before it came out."""
    group, here = group_of(task.start.size), np.zeros(task.start.size)
    first, state, begun = 0, task.start_state, task.start_state
    dof, control, durations = here.size, list[Array](), list[Array]()
    motions = list[PolishedMotion]()
    for last, wanted in nodes:
        aim = np.array([found.state[last, k] if v is None else v for k, v in enumerate(wanted)])
        seen = np.array((group(here).inverse() @ group(aim[:dof])).pose)
        seen[2] = aim[2] - here[2]
        ending = closed(
            task.model,
            state,
            [
                None if value is None else float(at)
                for value, at in zip(wanted, [*seen, *aim[dof:]], strict=True)
            ],
            control=found.control[first:last],
            durations=found.durations[first:last],
            budget=budget,
        )
        if isinstance(ending, str):
            return ending
        control.append(ending.control)
        durations.append(ending.durations)
        turned = here[2] + ending.course.pose[-1, 2]
        here = np.array((group(here) @ group(ending.course.pose[-1])).pose)
        here[2], first, state = turned, last, ending.course.reduced_state[-1]
        if None in wanted[dof:] and last < len(found.control):
            continue
        every, lasting = np.concatenate(control), np.concatenate(durations)
        course = drive(task.model, begun, control=every, durations=lasting)
        motions.append(PolishedMotion(course=course, control=every, durations=lasting, error=0.0))
        begun, control, durations = state, [], []
    return motions


def _in_steps(guess: Guess, count: int) -> Guess:
    state = resampled(guess.state, count + 1)
    return Guess(state=state, control=held(guess.control, count), duration=guess.duration)


@dataclass(slots=True, eq=False)
class _Polishing:
    """The state of one run."""

    task: PolishTask
    scene: PolishScene
    guesses: Iterable[Guess]
    stage_cost: RunningCost | None
    budget: Budget
    most_iterations: int | None  # None: the clock alone says when to stop
    accepts: Accepts
    best: PolishedMotion | None = None
    best_raw: Polished | None = None
    best_guess: int = 0
    steps: list[int] = field(default_factory=list)  # that each guess has
    reason: str = "no guess was given"
    attempts: list[Attempt] = field(default_factory=list)
    building: float = FIRST_BUILD  # [s] the longest so far

    def run(self) -> PolishResult:
        quick: list[tuple[float, int, Polished]] = []
        for number, guess in enumerate(self.guesses):
            if self._is_over():
                break
            self.steps.append(len(guess.control))
            if self.best is not None:
                if guess.duration > SLOW * self.best.objective:
                    continue
                # it is slow: steps as short as those of a motion worth it
                fewer = min(self.steps[-1], intervals_for(NEAR * self.best.objective))
                guess = _in_steps(guess, fewer)
            rough = self._rough(number, guess)
            if rough is None:
                continue
            if self.best is None:
                self._lines(number, rough)
            else:
                quick.append((rough.objective, number, rough))
        for objective, number, rough in sorted(quick, key=lambda one: one[0]):
            if self.best is None or objective < NEAR * self.best.objective:
                self._lines(number, rough)
        self._finer()
        if self.task.movers:  # each interval is kept free of all that moves through it meanwhile
            self._finer()
        return PolishResult(motion=self.best, reason="" if self.best else self.reason,
                            attempts=tuple(self.attempts))  # fmt: skip

    def _left(self) -> float:
        """Time for a solver [s]: the time left less that to write a problem down."""
        return self.budget.left - self.building

    def _work_left(self) -> int | None:
        """Iterations that are left; None if they are not counted."""
        if self.most_iterations is None:
            return None
        return self.most_iterations - sum(one.iterations for one in self.attempts)

    def _is_over(self) -> bool:
        """Whether neither time nor iterations are left for another solve."""
        work = self._work_left()
        return self._left() <= 0.0 or (work is not None and work <= 0)

    def _rough(self, number: int, guess: Guess) -> Polished | None:
        """Where a guess leads with fixed planes, or with fixed gears; not where something moves."""
        if self.task.movers:
            return self._among_movers(number, guess)
        gears = gears_of(self.task.model, guess)
        shuffles = np.count_nonzero(np.diff(gears)) >= SHUFFLE
        unfinished: list[Polished] = []
        if not shuffles:
            found = self._solve("fixed planes", number, guess, fixed_planes=True)
            if found.is_feasible:
                return found
            if not self._left() > 0.0:
                return None
            found = self._solve("lines", number, guess, most=DEEP_ITERATIONS)
            unfinished.append(found)
            if found.status is not SolveStatus.SOLVED and self._left() > 0.0:
                out = self._solve("elastic", number, guess, elastic=True)
                if out.status is SolveStatus.SOLVED:
                    found = self._solve("lines", number, out.as_guess)
                    unfinished.append(found)
            if found.status is SolveStatus.SOLVED:
                self._consider(found, number)
                return None
        if self._left() > 0.0:
            unfinished.append(self._solve("gears", number, guess, gears=gears))
            if unfinished[-1].status is SolveStatus.SOLVED:
                self._consider(unfinished[-1], number)
                return None
        # None is solved; a result near enough to a motion is closed and audited all the same.
        for one in unfinished:
            if self.best is None and (one.is_feasible or one.status is SolveStatus.OUT_OF_BUDGET):
                self._consider(one, number)
        return None

    def _among_movers(self, number: int, guess: Guess) -> Polished | None:
        """Where a guess leads with free lines: the lines of what moves do not stand still."""
        found = self._solve("lines", number, guess)
        if not (found.is_feasible or self._is_over()):
            out = self._solve("elastic", number, guess, elastic=True)
            if out.status is SolveStatus.SOLVED and not self._is_over():
                found = self._solve("lines", number, out.as_guess)
        if found.is_feasible:
            self._consider(found, number)
        return None

    def _lines(self, number: int, rough: Polished) -> None:
        """Solve with free lines from the result of fixed planes, which is kept if that fails.

        Without a line, and prices of places, that is what fixed planes have solved.
        """
        is_there = rough.status is SolveStatus.SOLVED and not (rough.lines or self.scene.places)
        if not (is_there or self._is_over()):
            patient = replace(USUAL, max_iterations=LONGER * USUAL.max_iterations)
            found = self._solve("lines", number, rough.as_guess, settings=patient)
            # What was not solved to the end may be sound all the same: it is closed and audited.
            ended = found.is_feasible or found.status is SolveStatus.OUT_OF_BUDGET
            worth = found.status is SolveStatus.SOLVED or found.objective < rough.objective
            if ended and worth and self._consider(found, number):
                return
        if is_there or self.best is None:
            self._consider(rough, number)

    def _finer(self) -> None:
        """The best once more with smaller steps, while there is time for it."""
        raw = self.best_raw
        if raw is None or self._is_over() or np.ptp(raw.durations) > EVEN:
            return
        work = self._work_left()
        if self._left() < 3.0 * raw.seconds if work is None else work < 3 * raw.iterations:
            return
        steps = max(self.steps[self.best_guess], len(raw.durations))
        count = math.ceil(steps / FINER)
        if self.task.movers or len(raw.durations) < steps:
            count = max(min(count, USUAL.nodes[1]), len(raw.durations) + 1)
        if count > USUAL.nodes[1]:
            return
        guess = _in_steps(raw.as_guess, count)
        found = self._solve("finer", self.best_guess, guess, begin=Begin.NEARBY)
        if found.is_feasible:
            self._consider(found, self.best_guess)

    def _solve(
        self,
        kind: str,
        number: int,
        guess: Guess,
        *,
        fixed_planes: bool = False,
        elastic: bool = False,
        gears: Array | None = None,
        begin: Begin = Begin.GUESS,
        most: int | None = None,
        settings: PolishSettings = USUAL,
    ) -> Polished:
        began = self.budget.elapsed
        work = self._work_left()
        if work is not None:
            most = max(min(work, settings.max_iterations if most is None else most), 1)
            settings = replace(settings, fixed_iterations=min(most, settings.fixed_iterations))
        if most is not None:
            settings = replace(settings, max_iterations=min(most, settings.max_iterations))
        found = polish(
            self.task.model,
            self.task.ends(float(guess.state[-1, 2])),
            self.scene,
            guess,
            stage_cost=self.stage_cost,
            settings=settings,
            fixed_planes=fixed_planes,
            elastic=elastic,
            gears=gears,
            begin=begin,
            budget=self.budget,
        )
        self.building = max(self.building, found.seconds - found.solve_s)
        self.attempts.append(
            Attempt(
                guess=number,
                kind=kind,
                duration=found.duration,
                status=found.status.value,
                iterations=found.iterations,
                seconds=self.budget.elapsed - began,
            )
        )
        if found.status is not SolveStatus.SOLVED and self.best is None:
            self.reason = f"{kind}: {found.reason}"
        return found

    def _consider(self, found: Polished, number: int, *, again: bool = True) -> bool:
        """Close the motion found, and keep it if it is accepted and better."""
        if self.best is not None and found.objective >= self.best.objective:
            return True
        gears = None
        if not self.task.movers:  # whose places follow from an even pace
            gears = without_shuffles(self.task.model, found, SHUFFLED * self._reach)
        if again and gears is not None and not self._is_over():
            steady = self._solve("gears", number, found.as_guess, gears=gears)
            worth = steady.objective < (1.0 + STEADY) * found.objective
            kept = steady.is_feasible and worth
            if kept and self._keep(number, steady, self._closed(steady), found):
                return True
        ending = self._closed(found)
        if isinstance(ending, str):
            self.reason = ending
            even = np.ptp(found.durations) <= EVEN
            if not (again and even and found.status is SolveStatus.SOLVED) or self._is_over():
                return False
            roomier = replace(USUAL, tightening=ROOM * USUAL.tightening)
            roomy = self._solve("room", number, found.as_guess, settings=roomier)
            if roomy.status is not SolveStatus.SOLVED:
                return False
            return self._consider(roomy, number, again=False)
        return self._keep(number, found, ending, found)

    @property
    def _reach(self) -> float:
        """How big the greatest part of the body is [m]."""
        return max((part.reach for part in self.task.parts), default=0.0)

    def _closed(self, found: Polished) -> PolishedMotion | str:
        return closed(
            self.task.model,
            self.task.start_state,
            self.task.ends(float(found.state[-1, 2])).end,
            control=found.control,
            durations=found.durations,
            budget=self.budget,
        )

    def _keep(
        self, number: int, found: Polished, ending: PolishedMotion | str, raw: Polished
    ) -> bool:
        """Keep a closed motion if it is accepted and better; `raw` is where finer steps begin."""
        if isinstance(ending, str):
            return False
        motion = replace(ending, objective=found.objective)
        if self.best is not None and motion.objective >= self.best.objective:
            return True
        if not self.accepts(motion):
            self.reason = "what was found is not accepted"
            return False
        self.best, self.best_raw, self.best_guess = motion, raw, number
        return True
