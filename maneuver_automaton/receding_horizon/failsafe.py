"""Motions where no plan leads on: fail-safe trajectories, and the motion that is hit last."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.validation import trims_between
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import AnyObstacle, Obstacle
from maneuver_automaton.planning.tracking import clearance_at, free_until, stands_free
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import _kernels_failsafe as kernels
from maneuver_automaton.receding_horizon.candidates import allowed
from maneuver_automaton.receding_horizon.log import first_part
from maneuver_automaton.receding_horizon.rest_of_plan import followed_by, merged
from maneuver_automaton.receding_horizon.settings import Settings
from maneuver_automaton.search._kernels_nodes import EMPTY
from maneuver_automaton.search.arrays import LatticeArrays
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.words.library import NO_TRIM

CELL = 0.25  # of the search, in turning radii
HEADINGS = 24
LONGEST = 32  # shortest edge durations that a trim is held
IMPATIENCE = 0.1  # seconds of safety that a second of driving is worth
MOST_NODES = 2**16
TIMELY = 16  # expansions between two looks at the clock
MOST_EXPANSIONS = 4000
HALVINGS = 6  # of the last coast, to leave it as soon as it is safe to stand
WAITING = 1e6  # [s] a tick is less than that, unless no trim moves


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FailSafe:
    """A motion that stays free as long as was found possible."""

    plan: Plan
    free_until: float  # [s] of the world's clock
    complete: bool  # whether that is as long as was asked for
    expansions: int


def search_fail_safe(
    problem: Problem,
    *,
    until: float,
    budget: Budget = UNLIMITED,
    max_expansions: int = MOST_EXPANSIONS,
) -> FailSafe:
    """A motion from the problem's start that is free of its obstacles until a time, if possible.

    A vehicle that can rest ends at rest, as soon as it is safe there. Where no motion is free until
    then, the one that is free for longest comes back.

    Parameters
    ----------
    problem : Problem
        Its goals do not matter.
    until : float
        [s] of the world's clock.
    budget : Budget
        Its time ends the search with what it has.
    max_expansions : int
        Poses to go on from.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Motion, Obstacle, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "back": (-1, 0)})
    >>> passing = Obstacle(Disc(1.0), motion=Motion([0, 4], [[2, -4, 0], [2, 4, 0]]))
    >>> problem = Problem(robot, [2, 0, 0], [9, 0, 0], obstacles=passing)
    >>> found = search_fail_safe(problem, until=4.0)
    >>> found.complete, found.plan.word[-1], bool(abs(found.plan.end[0] - 2.0) > 1.0)
    (True, 'rest', True)
    """
    query = lattice_query(_to_rest(problem), (0,))
    at, rest = problem.start_time, query.automaton.rest
    if rest is not None and query.library.number_of[rest] < 0 and not problem.moves:
        # where nothing moves rest is no edge of the lattice, and free for ever if it is now
        free = stands_free(problem, problem.start, time=at, duration=until - at) > 0.0
        trims = (query.automaton.trims[rest],)
        stood = Plan(problem.start, trims, durations=[until - at], start_time=at)
        return FailSafe(plan=stood, free_until=until if free else at, complete=free, expansions=0)
    task, scene = _task(query, until), query.around
    if problem.bounds.x is None and problem.bounds.y is None:  # motions may lead anywhere
        window, edge_window = scene.window.copy(), scene.edge_window.copy()
        window[:4] = edge_window[:4] = [-math.inf, -math.inf, math.inf, math.inf]
        scene = scene._replace(window=window, edge_window=edge_window)
    for library in _libraries(query, task):
        search = _arrays(MOST_NODES)
        kernels.begin(task, library, scene, search)
        left = max_expansions
        while left > 0 and kernels.expand(task, library, scene, search, min(TIMELY, left)):
            left = 0 if budget.is_over else left - TIMELY
        if search.state[kernels.FOUND] >= 0:
            break
    state = search.state
    node = int(state[kernels.BEST])
    free_until = float(search.nodes[node, kernels.SAFE])
    complete, plan = bool(state[kernels.FOUND] >= 0), _plan(query, task, search, node)
    return FailSafe(
        plan=_soonest(problem, plan) if complete else plan,
        free_until=free_until,
        complete=complete,
        expansions=int(state[kernels.EXPANSIONS]),
    )


def _soonest(problem: Problem, plan: Plan) -> Plan:
    """The plan, whose last coast before it rests is as short as is safe."""
    if problem.parts or any(plan.maneuvers) or len(plan.trims) < 2 or not plan.trims[-1].is_rest:
        return plan
    until, least, most = plan.start_time + plan.duration, 0.0, float(plan.durations[-2])
    for _ in range(HALVINGS):
        half = 0.5 * (least + most)
        stands = float(plan.durations[-1]) + float(plan.durations[-2]) - half
        sooner = replace(plan, durations=np.append(plan.durations[:-2], [half, stands]))
        pose = sooner.switching_poses[-2]
        if stands_free(problem, pose, time=until - stands, duration=stands) >= stands:
            plan, most = sooner, half
        else:
            least = half
    return plan


def _to_rest(problem: Problem) -> Problem:
    """The problem with a rest to be reached, anywhere, where maneuvers lead to one."""
    automaton = problem.automaton
    if automaton.is_kinematic or automaton.rest is None:
        return problem
    first = automaton.index_of(problem.first_trim.name)
    if first not in trims_between(automaton, first, [automaton.rest]):
        return problem
    goal = replace(problem.goals[0], trim=automaton.trims[automaton.rest].name, free_heading=False)
    return replace(problem, goals=(goal,))


def _libraries(query: LatticeQuery, task: kernels.FailSafeTask) -> Iterator[LatticeArrays]:
    """The library; for a vehicle that cannot rest, first one that leads away for short times."""
    arrays, numbered = query.library.arrays, query.library.arrays.library
    turns = numbered.twists[:, 2] != 0.0
    if not task.rests and turns.any():
        longest = np.where(turns, numbered.longest, np.minimum(numbered.longest, task.longest))
        yield arrays._replace(library=numbered._replace(longest=longest))
    yield arrays


def _task(query: LatticeQuery, until: float) -> kernels.FailSafeTask:
    library = query.library
    arrays = library.arrays
    numbered = arrays.library
    m = numbered.n_trims
    holds = arrays.coasts.durations[:, 0]
    tick = float(holds[holds > 0.0].min(initial=math.inf))
    if not tick < WAITING:  # only maneuvers move it
        tick = float(np.median(arrays.edges.time)) if arrays.edges.time.size else 1.0
    still = np.flatnonzero(~numbered.twists[:m].any(axis=1))
    rest_of = np.full(len(numbered.transitions.cost), -1)
    rest_of[numbered.class_of[still][::-1]] = still[::-1]  # the first of each class
    return kernels.FailSafeTask(
        pose=tuple(query.start.tolist()),
        trim=max(query.start_trim, 0),
        clock=float(query.problem.start_time),
        until=float(until),
        rests=bool(still.size),
        rest_of=rest_of,
        holds=np.where(holds < LONGEST * tick, holds, tick),
        cell=CELL * library.radius,
        headings=HEADINGS,
        tick=tick,
        longest=LONGEST * tick,
        impatience=IMPATIENCE,
    )


def _arrays(n: int) -> kernels.FailSafeArrays:
    """Room for `n` nodes, a power of two."""
    return kernels.FailSafeArrays(
        nodes=np.empty((n, 8)),
        links=np.empty((n, 3), dtype=np.int64),
        cells=np.full(4 * n, EMPTY),
        heap_key=np.empty(n),
        heap_node=np.empty(n, dtype=np.int64),
        state=np.zeros(5, dtype=np.int64),
    )


def _plan(
    query: LatticeQuery, task: kernels.FailSafeTask, search: kernels.FailSafeArrays, node: int
) -> Plan:
    """The path to a node, and rest there, or the last trim, as long as that is free."""
    problem, automaton, library = query.problem, query.automaton, query.library
    rows: list[int] = []
    last = node
    while search.links[node, kernels.PARENT] >= 0:
        rows.append(node)
        node = int(search.links[node, kernels.PARENT])
    word = [] if query.start_trim == NO_TRIM else [automaton.trims[library.trims[task.trim]]]
    times, between = [0.0] * len(word), list[Maneuver | None]()
    for row in reversed(rows):
        edge = int(search.links[row, kernels.EDGE])
        if edge >= 0:
            maneuver = automaton.maneuvers[library.arrays.edges.maneuver[edge]]
            begin, end = (automaton.trims[automaton.index_of(name)]
                          for name in (maneuver.source, maneuver.target))  # fmt: skip
            if word[-1].name != begin.name:
                word, times, between = [*word, begin], [*times, 0.0], [*between, None]
            word, times, between = [*word, end], [*times, 0.0], [*between, maneuver]
        else:
            held = automaton.trims[library.trims[search.links[row, kernels.TRIM]]]
            _coast(word, times, between, held, float(search.nodes[row, kernels.LASTING]))
    trim = int(search.links[last, kernels.TRIM])
    goes_on = int(task.rest_of[library.arrays.library.class_of[trim]]) if task.rests else trim
    left = float(search.nodes[last, kernels.SAFE] - search.nodes[last, kernels.CLOCK])
    if goes_on >= 0 and (task.rests or left > 0.0):
        _coast(word, times, between, automaton.trims[library.trims[goes_on]], left)
    if any(between):
        start, at = problem.start, problem.start_time
        return Plan(start, word, durations=times, maneuvers=tuple(between), start_time=at)
    word_, durations = merged(word, times)
    return Plan(problem.start, word_, durations=durations, start_time=problem.start_time)


def _coast(
    word: list[Trim], times: list[float], between: list[Maneuver | None], trim: Trim, lasting: float
) -> None:
    """Append a coast to a word, or prolong its last one."""
    if word and word[-1].name == trim.name:
        times[-1] += lasting
        return
    if word:
        between.append(None)
    word.append(trim)
    times.append(lasting)


def looked_at(here: Problem, settings: Settings) -> float:
    """Time [s] that is looked at: as far as is asked for, or until all obstacles are static."""
    until = here.start_time + settings.look_ahead
    if here.moves and settings.pad is not None:
        quiet = here.quiet_after
        comes = (isinstance(one, Obstacle) and one.presence[0] == quiet for one in here.obstacles)
        until = min(until, quiet + settings.step if any(comes) else quiet)  # what comes last counts
    return max(until, here.start_time + settings.step)


def settled(problem: Problem) -> Problem:
    """The problem without what is gone by its start, and with what has come to rest as it stands.

    A search is quicker among static obstacles.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Motion, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    >>> passing = Obstacle(Disc(1.0), motion=Motion([0, 4], [[2, -4, 0], [2, 4, 0]]))
    >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=passing)
    >>> settled(problem).moves, settled(replace(problem, start_time=4.0)).moves
    (True, False)
    """
    now, kinds = problem.start_time, []
    for one in problem.obstacles:
        kind = _KEPT
        if isinstance(one, Obstacle) and one.motion is not None:
            first, last = one.presence
            if last < now:
                kind = _GONE
            elif one.motion.time[-1] <= now and first <= now and last == math.inf:
                kind = _STANDS
        kinds.append(kind)
    if not any(kinds):
        return problem
    return replace(problem, obstacles=_as_they_stand(problem.obstacles, tuple(kinds)))


_KEPT, _STANDS, _GONE = range(3)


@functools.lru_cache(maxsize=8)
def _as_they_stand(
    obstacles: tuple[AnyObstacle, ...], kinds: tuple[int, ...]
) -> tuple[AnyObstacle, ...]:
    """The same values at every call, so that what was prepared for them serves again."""
    found: list[AnyObstacle] = []
    for one, kind in zip(obstacles, kinds, strict=True):
        if kind == _STANDS and isinstance(one, Obstacle):
            found.append(Obstacle(one.at(math.inf), height=one.height, name=one.name))
        elif kind == _KEPT:
            found.append(one)
    return tuple(found)


MOMENTS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of a step, after which a motion may stop
SAMPLES = 64  # at which the clearance is looked at
ALIKE = 1e-3  # [s] between contacts that come at the same time


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mitigation:
    """A motion that is hit, or comes closer than it should."""

    plan: Plan
    contact: float  # [s] of the world's clock, when it is hit first; the time asked for if never
    clearance: float  # [m] least one until then, as far as looked for; inf if not measured
    reason: str  # the predicted contact


def mitigate(here: Problem, *, step: float, until: float, known: Sequence[Plan] = ()) -> Mitigation:
    """The motion whose first contact is latest; of those alike, the one with most clearance.

    Tried are to stand still, the `known` plans, these stopped at several moments, and every trim of
    the library held for several moments and then stopped; a vehicle that cannot stop goes on with
    its last trim.

    The margin does not count: contact alone does, until a time [s] of the world's clock.
    """
    bare = replace(here, margin=0.0)
    length = until - here.start_time
    tried = [_contact(bare, plan, until) for plan in _motions(bare, step, length, known)]
    latest = max(one.contact for one in tried)
    alike = [one for one in tried if one.contact >= latest - ALIKE]
    return max(alike, key=lambda one: one.clearance)


def _motions(here: Problem, step: float, length: float, known: Sequence[Plan]) -> Iterator[Plan]:
    """All that is tried, as long as is looked at."""
    trims = here.automaton.trims
    rests = [trim for trim in trims if trim.is_rest]
    at, start = here.start_time, here.start
    yield Plan(start, rests[:1], durations=[length] * len(rests[:1]), start_time=at)
    moving = [Plan(start, (trim,), durations=[length], start_time=at) for trim in trims]
    for plan in (*known, *moving):
        moments = [share * step for share in MOMENTS] if rests else []
        for after in (length, *moments):
            stopped = _stopped(plan, after, length, rests)
            if allowed(here, stopped):
                yield stopped


def _stopped(plan: Plan, after: float, length: float, rests: list[Trim]) -> Plan:
    """The beginning of a plan, then rest; without one its last trim goes on."""
    begun = first_part(plan, min(after, length))
    left = length - begun.duration
    if left <= 0.0 or not begun.trims:
        return begun
    last = rests[0] if rests else begun.trims[-1]
    return followed_by(
        begun, Plan(begun.end, (last,), durations=[left], start_time=plan.start_time)
    )


def _contact(here: Problem, plan: Plan, until: float) -> Mitigation:
    free = free_until(here, plan)
    contact = plan.start_time + free
    if free >= plan.duration and contact < until:
        contact += stands_free(here, plan.end, time=contact, duration=until - contact)
    times = np.linspace(plan.start_time, contact, SAMPLES)
    clearance = float(clearance_at(here, plan.pose_at(times), times).min())
    said = (
        f"contact is predicted at {contact:.6g} s"
        if contact < until
        else f"the clearance is predicted to fall to {clearance:.3g} m"
    )
    reason = f"no motion is free until {until:.6g} s; {said}"
    return Mitigation(plan=plan, contact=contact, clearance=clearance, reason=reason)
