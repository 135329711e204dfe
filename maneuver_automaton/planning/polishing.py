"""Polish plans of vehicles with inertia: guesses of different gears, the best that is accepted."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import AnyObstacle, Box, Obstacle, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import blocked_rectangles
from maneuver_automaton.collision.shapes import origin_near
from maneuver_automaton.collision.surroundings import parts_of, surroundings_of
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import Interval
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.optimal_control import Guess, load_casadi, why_no_casadi
from maneuver_automaton.optimal_control.polishing import intervals_for
from maneuver_automaton.optimal_control.problem import RunningCost
from maneuver_automaton.optimal_control.scene import BodyPart, Guard, NodeOnTheWay, PlacesAt
from maneuver_automaton.planning.incumbents import Incumbents, PlanningStep
from maneuver_automaton.planning.on_the_way import coasts_of, passed_on_the_way
from maneuver_automaton.planning.polished_price import (
    PolishedPrice,
    admitted_durations,
    polished_price,
)
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Horizon, Problem, moves
from maneuver_automaton.refinement.closure import PolishedMotion
from maneuver_automaton.refinement.gear_sequences import gear_sequences
from maneuver_automaton.refinement.guesses import (
    PathGuesses,
    course_guess,
    guess_at,
    path_guesses,
    timed,
)
from maneuver_automaton.refinement.polish import (
    PolishResult,
    PolishTask,
    polish_guesses,
    polish_through,
)
from maneuver_automaton.refinement.stop_and_steer import follows_paths, simpler_problem
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.setup import search_setup, sub_library
from maneuver_automaton.search.words import search_setup_words
from maneuver_automaton.via import MET

NUMBERS_ALONE = "part_poses of the vehicle takes numbers alone, no symbols"
NO_TERMS = "the cost has no method terms(), which would return the weights it is the sum of"
POINT = ((np.zeros((1, 2)), 0.0),)  # the body of a vehicle without a footprint
SAMPLES = 500  # of a plan that passes above or below obstacles
EXPANSIONS_AN_ITERATION = 4  # of the lattice, in place of one iteration of polishing
FEWEST_ITERATIONS = 100  # however few expansions are allowed: one guess to its end
MOST_WORDS = 100  # that switch at will and are looked at for other ways to turn
OTHER_TURNS = 6  # ways to turn that are tried
STRAIGHT = 1e-6  # [rad] between two samples
NEAR_HEADING = 1.0  # [rad] from the heading of a plan, to which its motion is a guess
WAY_SHARE = 0.5  # of the time left, for each guess past poses on the way
BY_TIME = Cost(time=1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Aimed:
    """A guess and the goal to which it leads."""

    guess: Guess
    goal_index: int


def why_not_polished(problem: Problem) -> str:
    """Why plans of a problem cannot be polished; empty if they can."""
    if problem.automaton.lattice is not None:
        return "the vehicle moves by the maneuvers of its library alone"
    if not problem.automaton.model.reduced_names:
        return "the vehicle has no inertia"
    if not problem.search.polish:
        return "it is not asked for"
    if problem.parts and not _frames_take_symbols(problem.automaton.model):
        return NUMBERS_ALONE
    unlimited = problem.horizon.time is None and problem.horizon.max_time is None
    if unlimited and polished_price(problem).cost.time == 0.0:
        return "time costs nothing"
    return why_no_casadi()


def _frames_take_symbols(model: Model) -> bool:
    """Whether the poses of what a vehicle carries follow by arithmetic alone, as intervals do."""
    try:
        model.part_frames([Interval(-0.1, 0.1)] * len(model.reduced_names))  # type: ignore[attr-defined]
    except (TypeError, ValueError, AttributeError):
        return False
    return True


def left_out(*problems: Problem) -> tuple[str, ...]:
    """What plans of some problems do without that they should have, and why: a sentence each."""
    for one in problems:
        if not one.automaton.model.reduced_names:
            continue  # there is nothing to polish: CasADi is not asked for
        why = why_not_polished(one)
        if why and why in (why_no_casadi(), NUMBERS_ALONE):
            return (f"plans are not polished, and may cost much more: {why}",)
        if not why and terms_of(one.cost) is None:
            return (f"plans are polished in time alone: {NO_TERMS}",)
    return ()


@dataclass(slots=True, eq=False)
class Polish(PlanningStep):
    """Polish kinematic plans of different gears, and the plans found; offer what is cheaper."""

    guesses: list[Aimed] = field(default_factory=list)  # along kinematic plans that are known
    otherwise: Callable[[], None] | None = None  # offers what there is where nothing is gained
    tried: float = math.inf  # cost of the cheapest plan when all guesses were tried before

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """The solver, and tables of the kinematic libraries."""
        if not problem.rests_at_both_ends:
            return
        load_casadi()
        along = path_guesses(problem.automaton.model)
        for library in along.libraries if along else ():
            cost_to_go_table(simpler_problem(problem, library, cost=BY_TIME))

    def offer(self, found: Incumbents) -> None:
        """Offer what polishing finds in all the time that is left."""
        known = found.cost
        if found.for_better.is_over or found.is_enough or known == self.tried < math.inf:
            return  # no time for more than checks, or no plan that is new
        self.polish(found)
        if self.otherwise and found.cost == known and not found.budget.is_over:
            self.otherwise()

    def polish(self, found: Incumbents, *, share: float = 1.0) -> bool:
        """Offer what polishing finds within a share of the time; whether all guesses were tried."""
        problem, budget = found.problem, found.for_better.stage(share)
        if budget.is_over or why_not_polished(problem):
            return not budget.is_over
        price = polished_price(problem)
        known = _worth_polishing(found, price)
        if known and all(isinstance(one, Trim) and one.is_rest for one in known[0][0].primitives):
            return True  # it is there already
        first = known[0][0] if known else None
        stage_cost, places = price.stage_cost(first), price.places(first)
        solids = _without_passed(problem, known[0][0]) if known else [problem]
        work, before = iterations_within(budget), found.cost
        for solid, goal_index, guesses in (
            (solid, *group)
            for solid in solids
            if found.cost == before
            for group in _in_groups(found, known, self.guesses, budget)
        ):
            if budget.is_over or (work is not None and work <= 0):
                break
            try:
                polished = polish_plans(
                    solid,
                    guesses,
                    goal_index,
                    stage_cost,
                    places=places,
                    budget=budget,
                    most_iterations=work,
                    accepts=functools.partial(found.offer, goal_index=goal_index),
                )
            except RuntimeError:  # the solver gave up on a number; the plan in hand stays
                found.counts.update(solver_errors=1)
                continue
            found.counts.update(polished=len(polished.attempts))
            if work is not None:
                work -= sum(attempt.iterations for attempt in polished.attempts)
        return not budget.is_over


def _worth_polishing(found: Incumbents, price: PolishedPrice) -> list[tuple[Plan, int]]:
    """The cheapest by the price, the quickest, the cheapest; if none, one that nearly was."""
    every = [(one.plan, one.goal_index) for one in found.plans]  # the cheapest first
    by_price = sorted(every, key=lambda one: price.of(one[0]))[:1]
    by_time = sorted(every, key=lambda one: one[0].duration)[:1]
    known = list({id(one[0]): one for one in (*by_price, *by_time, *every[:1])}.values())
    # One that is late may be made quicker, one maneuver of too many trims, one too fast for a zone
    # slower.
    return known or sorted(found.misfits, key=lambda one: one[0].duration)[:1]


def _in_groups(
    found: Incumbents, known: Sequence[tuple[Plan, int]], paths: Sequence[Aimed], budget: Budget
) -> Iterator[tuple[int, Iterable[Guess]]]:
    """Guesses for one goal each, polished together; along paths it cannot follow they come last."""
    problem = found.problem
    if known:
        yield from _by_goal(problem, _guesses(found, known, paths, budget))
    model = problem.automaton.model
    led = path_guesses(model) is not None and not follows_paths(model)  # paths are guesses only
    if led and problem.rests_at_both_ends and not problem.moves:  # they know nothing of time
        yield from _by_goal(problem, guesses_along_paths(problem, budget))


def _guesses(
    found: Incumbents, known: Sequence[tuple[Plan, int]], paths: Sequence[Aimed], budget: Budget
) -> Iterator[Aimed]:
    """Guesses along kinematic plans; where they are none, or gain nothing, the plans known."""
    problem, cost = found.problem, found.cost
    if problem.rests_at_both_ends and follows_paths(problem.automaton.model) and not problem.moves:
        along = guesses_along_paths(problem, budget)
        if (first := next(along, None)) is not None:
            yield first
            yield from along
            if found.cost == cost < math.inf:
                yield Aimed(guess_of_plan(known[0][0]), known[0][1])
            return
        yield from paths
    aimed = [Aimed(guess_of_plan(plan), goal_index) for plan, goal_index in known]
    yield from aimed
    yield from _other_headings(problem, aimed[0])
    if problem.automaton.translated is None and not (problem.obstacles or problem.zones):
        yield from _other_turns(problem, known, budget)


def _other_turns(
    problem: Problem, known: Sequence[tuple[Plan, int]], budget: Budget
) -> Iterator[Aimed]:
    """Guesses along words that switch at will, and turn in other ways than the plans known."""
    seen, index = {_turns(plan) for plan, _ in known}, known[0][1]
    quickest = replace(problem, cost=BY_TIME, horizon=Horizon())
    setup = sub_library(search_setup(quickest, problem.goals[index]))
    for word in search_setup_words(
        quickest, setup, alternatives=MOST_WORDS, budget=budget, spare=False
    ):
        plan = plan_of(problem, word)
        if (turns := _turns(plan)) not in seen:
            seen.add(turns)
            yield Aimed(guess_of_plan(plan), index)
        if len(seen) > OTHER_TURNS:
            return


def _turns(plan: Plan) -> tuple[int, ...]:
    """The sides to which a plan turns, one after the other, and how many times around in all."""
    headings = plan.sample().pose[:, 2]
    turned = np.diff(headings)
    sides = np.sign(turned[np.abs(turned) > STRAIGHT]).astype(int)
    around = round(float(headings[-1] - headings[0]) / math.pi)  # of plans to one heading
    return (around, *sides[np.flatnonzero(np.diff(sides, prepend=0))].tolist())


def _by_goal(problem: Problem, aimed: Iterator[Aimed]) -> Iterator[tuple[int, Iterable[Guess]]]:
    """Guesses for each goal; those of a single one as they come, so that the first is soon."""
    if len(problem.goals) == 1:
        yield 0, (one.guess for one in aimed)
        return
    every = list(aimed)
    for goal_index in dict.fromkeys(one.goal_index for one in every):
        yield goal_index, [one.guess for one in every if one.goal_index == goal_index]


def _other_headings(problem: Problem, known: Aimed) -> list[Aimed]:
    """A guess aimed at the other goals at its place, those of the nearest headings first."""
    aim = problem.goals[known.goal_index].pose
    turns = [abs(math.remainder(goal.pose[2] - aim[2], 2.0 * math.pi)) for goal in problem.goals]
    return [
        Aimed(known.guess, k)
        for k in np.argsort(turns, kind="stable").tolist()
        if 0.0 < turns[k] <= NEAR_HEADING
        and np.array_equal(np.delete(problem.goals[k].pose, 2), np.delete(aim, 2))
    ]


def iterations_within(budget: Budget) -> int | None:
    """Iterations of the solver that a budget of expansions allows; None if they do not count."""
    most = budget.expansions
    return None if most is None else FEWEST_ITERATIONS + most // EXPANSIONS_AN_ITERATION


def _without_passed(problem: Problem, known: Plan) -> list[Problem]:
    """The problem without obstacles that a `known` plan passes above or below: all are high.

    Before that, if it is another one, without those that are above or below it where it is nearest.
    """
    origin, body = origin_near(known.start[:2]), parts_of(problem.footprint)
    times = known.start_time + np.linspace(0.0, known.duration, SAMPLES)
    poses = known.pose_at(times).copy()
    poses[:, :2] -= origin
    near, over = list[AnyObstacle](), list[AnyObstacle]()
    for one in problem.obstacles if problem.start.size > 3 else ():
        if not (isinstance(one, Obstacle) and one.height):
            continue
        around = surroundings_of((replace(one, height=None),), origin)
        apart = around.nearest(body, poses[:, :3], times).distance
        low, high = poses[apart.argmin(), 3] + problem.body_height
        near += [one] if max(low - one.height[1], one.height[0] - high) > problem.margin else []
        over += [one] if apart.min() <= problem.margin else []
    return [
        replace(problem, obstacles=tuple(one for one in problem.obstacles if one not in passed))
        if passed
        else problem
        for passed in ([near, over] if len(near) > len(over) else [over])
    ]


def guesses_along_paths(problem: Problem, budget: Budget) -> Iterator[Aimed]:
    """Guesses from kinematic plans whose gears differ, a promising one before all are searched.

    None for a vehicle for which no kinematic one stands.
    """
    along = path_guesses(problem.automaton.model)
    if along is None:
        return
    simpler = simpler_problem(problem, along.libraries[0], cost=BY_TIME)

    def estimate(plan: Plan) -> float:
        places = sum(one.price for one in simpler.place_prices_of(plan))
        return timed(plan, along.pace).duration + places / float(simpler.rates.max())

    for drive in gear_sequences(simpler, along.libraries, estimate, budget=budget):
        yield guess_along(problem, along, drive.plan)


def guess_along(problem: Problem, along: PathGuesses, path: Plan) -> Aimed:
    """A guess along a kinematic plan, seen from its start, and the goal where it ends."""
    seen = replace(path, start=np.zeros(problem.start.size), start_time=0.0)
    goal_index = int(np.argmin([sum(goal.off(path.end)) for goal in problem.goals]))
    first, last = problem.first_trim, problem.last_trim(problem.goals[goal_index])
    return Aimed(along.guess(seen, first.reduced_state, last.reduced_state), goal_index)


def guess_of_plan(plan: Plan) -> Guess:
    """States and controls of a plan of any vehicle, seen from its start."""
    return course_guess(replace(plan, start=np.zeros(plan.start.size), start_time=0.0).sample())


def polish_plans(
    problem: Problem,
    guesses: Iterable[Guess],
    goal_index: int,
    stage_cost: RunningCost | None,
    *,
    places: PlacesAt | None = None,
    budget: Budget,
    most_iterations: int | None = None,
    accepts: Callable[[Plan], bool],
) -> PolishResult:
    """Polish guesses that lead to one goal; `accepts` checks and audits what comes out.

    With `most_iterations` of the solver the work is counted, and time only ends it earlier.
    """
    return polish_guesses(
        polish_task(problem, goal_index, places),
        guesses,
        stage_cost=stage_cost,
        budget=budget,
        most_iterations=most_iterations,
        accepts=lambda motion: accepts(_plan_of(problem, goal_index, motion)),
    )


def polish_task(problem: Problem, goal_index: int, places: PlacesAt | None) -> PolishTask:
    """The vehicle, its ends and what is around it."""
    goal = problem.goals[goal_index]
    first, last = problem.first_trim, problem.last_trim(goal)
    # a zone that does not admit the motion by its name is not entered at all
    zones = [one for one in problem.zones if one.admits_names((first.name, last.name))]
    closed = [one.shape for one in problem.zones if one not in zones]
    pose: list[float | None] = goal.pose.tolist()
    if goal.free_heading:
        pose[2] = None
    # The reduced state of a last trim; None for what follows from the last pose.
    follows = (
        () if problem.automaton.translated is None else problem.automaton.translated.follows_pose
    )
    values = last.reduced_state.tolist()
    return PolishTask(
        model=problem.automaton.model,
        start=problem.start,
        start_state=first.reduced_state,
        goal=tuple(pose),
        goal_state=tuple(None if k in follows else value for k, value in enumerate(values)),
        parts=_body_parts(problem),
        obstacles=(
            *(shape for one in problem.obstacles if not moves(one) for shape in _shapes_of(one)),
            *closed,
        ),
        movers=tuple(one for one in problem.obstacles if isinstance(one, Obstacle) and moves(one)),
        start_time=problem.start_time,
        bounds=problem.bounds,
        margin=problem.margin,
        guards=tuple(
            (Guard(speed, lateral, one.reverse), one.shape)
            for one in zones
            for limits in [(one.max_speed, one.max_lateral_acceleration)]
            for speed, lateral in [[math.inf if most is None else most for most in limits]]
        ),
        durations=admitted_durations(problem),
        places=places,
    )


def _plan_of(
    problem: Problem, goal_index: int, *motions: PolishedMotion, stays: Sequence[float] = ()
) -> Plan:
    """The plan of some motions, which stays at rest between them for so many seconds each."""
    automaton, last = problem.automaton, problem.last_trim(problem.goals[goal_index])
    trims = problem.first_trim, *[automaton.trims[automaton.rest or 0]] * len(stays), last
    return Plan(
        problem.start,
        trims,
        durations=[0.0, *stays, 0.0],
        maneuvers=[
            motion.maneuver("polished", source=source.name, target=target.name)
            for motion, (source, target) in zip(motions, itertools.pairwise(trims), strict=True)
        ],
        start_time=problem.start_time,
    )


def polish_on_the_way(
    found: Incumbents, guesses: Iterable[tuple[Plan, int]], budget: Budget
) -> bool:
    """Offer guesses polished as wholes, past all poses on their way; whether one is cheaper.

    A guess is a plan and its goal. The motion rests where it has to, and passes each pose as it
    likes. A place that may be chosen stays.
    """
    problem, before = found.problem, found.cost
    if budget.is_over or why_not_polished(problem):
        return False
    for plan, goal_index in guesses:
        try:
            better = _polished_through(problem, plan, goal_index, budget.part(WAY_SHARE))
        except RuntimeError:  # the solver gave up on a number; the plan in hand stays
            found.counts.update(solver_errors=1)
            continue
        found.counts.update(polished=1)
        if better is not None:
            found.offer(better, goal_index)
        if budget.is_over:
            break
    return found.cost < before


def _polished_through(
    problem: Problem, known: Plan, goal_index: int, budget: Budget
) -> Plan | None:
    """The plan to which one guess leads, if there is one; where it stops on its way it rests."""
    passed, times = passed_on_the_way(problem, known), [0.0]
    moving, stays = known.durations.copy(), list[float]()  # it is polished without its stays
    for one in passed:
        asked, at = problem.via[one.number - 1], one.time - known.start_time
        times.append(at - sum(stays))
        stays += [asked.stay_s] * asked.stop
        for k, (trim, begin, end) in enumerate(coasts_of(known) if asked.stay_s else ()):
            if trim.is_rest and begin >= at - MET and end - begin >= asked.stay_s - MET:
                moving[k] = max(moving[k] - asked.stay_s, 0.0)
                break
    known = replace(known, durations=moving)
    price = polished_price(problem)
    task = polish_task(_without_passed(problem, known)[-1], goal_index, price.places(known))
    course = replace(known, start=np.zeros(known.start.size), start_time=0.0).sample()
    times, count = [*times, known.duration], intervals_for(known.duration)
    nodes = np.round(count * np.array(times) / known.duration).astype(int)
    if np.diff(nodes).min() < 1:
        return None
    guess = guess_at(course, np.interp(np.arange(count + 1), nodes, times))
    via, standing = list[NodeOnTheWay](), list[tuple[int, float]]()
    dof, rest = known.start.size, problem.automaton.rest or 0
    for one, node in zip(passed, nodes[1:-1].tolist(), strict=True):
        state, asked = guess.state[node], problem.via[one.number - 1]
        standing.append((node, asked.stay_s))
        if asked.stay_s:  # the wheels may be turned where it stops for no time
            state = np.append(state[:dof], problem.automaton.trims[rest].reduced_state)
        pose = (one.pose if asked.radius > 0.0 else asked.pose).tolist()
        pose[2] = None if asked.free_heading else pose[2]
        free = (None,) * (len(state) - dof)
        seen = replace(task, goal=tuple(pose), goal_state=free).ends(float(state[2])).end
        via.append((node, (*seen[:dof], *(state[dof:].tolist() if asked.stop else free))))
    stage_cost = price.stage_cost(known)
    work = iterations_within(budget)
    motions = polish_through(
        task, guess, via, stays=standing, stage_cost=stage_cost, most_iterations=work, budget=budget
    )
    found = [] if isinstance(motions, str) else motions
    return _plan_of(problem, goal_index, *found, stays=stays) if found else None


def _shapes_of(obstacle: AnyObstacle) -> list[Shape]:
    """What does not move, as shapes: the blocked cells of a map are joined to few boxes."""
    if isinstance(obstacle, Obstacle):
        return [obstacle.shape]
    low, high = np.split(obstacle.resolution * blocked_rectangles(obstacle.blocked), 2, axis=1)
    middles, heading = SE2(obstacle.origin).act((low + high) / 2.0), float(obstacle.origin[2])
    return [Box(size, at, heading) for size, at in zip(high - low, middles, strict=True)]


def _body_parts(problem: Problem) -> tuple[BodyPart, ...]:
    own = tuple(piece for shape in problem.footprint for piece in convex_pieces(shape))
    parts = [BodyPart(solids=own or POINT)] if problem.obstacles or problem.zones else []
    model = problem.automaton.model
    for name, shapes in problem.parts.items():
        solids = tuple(piece for shape in shapes for piece in convex_pieces(shape))
        parts.append(BodyPart(solids=solids, pose=_frame_of(model, model.part_names.index(name))))
    return tuple(parts)


def _frame_of(model: Model, which: int) -> Callable[[Components], Sequence[Any]]:
    frames = model.part_frames  # type: ignore[attr-defined]
    return lambda z: tuple(frames(z)[which])
