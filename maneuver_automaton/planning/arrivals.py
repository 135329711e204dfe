"""How poses on the way may be passed: arrivals that stand for them, and the best by estimates.

A leg between two poses costs about what its cheapest word of three trims does, where nothing is in
the way. By these estimates free headings and places are improved before any leg is planned. Valleys
of the cost are narrow beside headings at which a trim of a word vanishes; those are found in closed
form, as words of two trims and a turn on the spot.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton.headings import posed
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.blocked import why_goal_blocked, why_off_lattice
from maneuver_automaton.planning.bounds import straight_bound
from maneuver_automaton.planning.on_the_way import goal_around
from maneuver_automaton.planning.result import PlanStatus
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem, Via
from maneuver_automaton.search.lattice_goals import nodes_within
from maneuver_automaton.search.limits import closed_bound, shortest_trims, three_are_enough
from maneuver_automaton.words._kernels_steering import steer_batch
from maneuver_automaton.words.library import most_different, moving_trims
from maneuver_automaton.words.shortest import reeds_shepp_length

HEADINGS = 12  # that stand for a free one at least, beside those along the lines to neighbours
MOST_HEADINGS = 48  # the same where legs are estimated in a moment
MOST_ESTIMATES = 150_000  # words of three trims that are tried in all to estimate legs
ALONG_GATE = (0.5, 0.2, 0.8)  # shares of a gate at which it is crossed at first
AROUND = 4  # places at the rim of a tolerance
MOST_SPEEDS = 3  # straight trims in which a vehicle with inertia passes, beside rest
MOST_LETTERS = 7  # trims of which words are tried to estimate a leg
STEERED = 1e-12  # relative, for circles that touch
NEARLY = 1e-10  # [rad, s] of a turn that is none
BESIDE = 1e-7  # [rad] beside a heading at which a trim vanishes: on one side it is a full turn
INSIDE = 1e-7  # share of a tolerance that is left
VALLEYS = 8  # chains of arrivals that are improved by estimates
SWEEPS = 16  # over the arrivals of a chain
STAR = np.array([-1.0, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1.0])  # steps tried, of the reach
NARROWER = 0.35  # of the reach from sweep to sweep in which nothing is gained
ROUNDED = 1e-7  # share of a cost by which equal ones differ: times of words by a root of rounding


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """How a pose on the way is passed: where, and in which trim."""

    pose: Array  # (dof,)
    trim: str | None = None  # rest, or any for a vehicle that switches at will

    @property
    def key(self) -> tuple[bytes, str | None]:
        """Equal for equal arrivals."""
        return self.pose.tobytes(), self.trim

    def off(self, other: Arrival) -> float:
        """How far [m, rad] another one is: the larger of the distance and the turn."""
        apart = np.array(self.pose - other.pose)
        turn = math.remainder(float(apart[2]), 2.0 * math.pi)
        apart[2] = 0.0
        return max(float(np.linalg.norm(apart)), abs(turn))


def arrivals_of(
    problem: Problem, number: int
) -> tuple[tuple[Arrival, ...], tuple[PlanStatus, str] | None]:
    """The arrivals that stand for a pose on the way, or why there is none: a status, a sentence."""
    via, automaton = problem.via[number], problem.automaton
    around = goal_around(via)
    if automaton.lattice is not None:
        nodes = [one for one in nodes_within(problem, around) if max(via.off(one.pose)) <= 1e-9]
        if not nodes:
            said = why_off_lattice(problem, replace(around, tolerance_m=via.tolerance_m))
            return (), (PlanStatus.NO_PLAN, _about(said or "no node of the lattice is on it"))
        found = [Arrival(one.pose, one.trim) for one in nodes]
    elif automaton.translated is not None:
        found = [
            Arrival(pose, trim)
            for place in _places(problem, number)
            for pose, trim in posed(automaton, place, "via", free=via.free_heading)
        ]
    else:
        poses = [
            _turned_to(place, heading)
            for place in _places(problem, number)
            for heading in _headings(problem, number)
        ]
        found = [Arrival(pose, trim) for pose in poses for trim in _trims(problem, via)]
    blocked = [why_goal_blocked(problem, Goal(one.pose, trim=one.trim)) for one in found]
    if all(blocked):
        bare = replace(problem, parts={})  # they may be elsewhere within a maneuver
        proven = not via.radius and why_goal_blocked(bare, around)
        return (), (PlanStatus.GOAL_BLOCKED if proven else PlanStatus.NO_PLAN, _about(blocked[0]))
    return tuple(one for one, why in zip(found, blocked, strict=True) if not why), None


def _about(said: str) -> str:
    """What is said of a goal, said of a pose on the way."""
    return said.replace("at the goal ", "").replace("the goal is", "it is")


def _places(problem: Problem, number: int) -> Iterator[Array]:
    """Poses (dof,) at the places of a pose on the way, with the heading that is stated."""
    via = problem.via[number]
    places = [0, 1, *range(3, via.pose.size)]
    if via.gate is None:
        yield via.pose
    else:
        for share in (*_straight_through(problem, number), *ALONG_GATE):
            pose = np.array(via.pose)
            pose[places] = via.gate[0] + share * (via.gate[1] - via.gate[0])
            yield pose
    for k in range(AROUND if via.tolerance_m else 0):
        angle = float(problem.start[2]) + 2.0 * math.pi * k / AROUND
        pose = np.array(via.pose)
        pose[:2] += (1.0 - INSIDE) * via.tolerance_m * np.array([math.cos(angle), math.sin(angle)])
        yield pose


def _straight_through(problem: Problem, number: int) -> Iterator[float]:
    """The share of a gate at which the line between its neighbours crosses it."""
    gate = problem.via[number].gate
    ends = [problem.start, *(one.pose for one in problem.via), problem.goals[0].pose]
    before, after = ends[number][:2], ends[number + 2][:2]
    assert gate is not None
    lines = np.column_stack([gate[1, :2] - gate[0, :2], before - after])
    if problem.order == "given" and abs(np.linalg.det(lines)) > INSIDE:
        share = float(np.linalg.solve(lines, before - gate[0, :2])[0])
        yield min(max(share, 0.0), 1.0)


def first_least(costs: Array) -> int:
    """The first of the costs (n,) that are the least but for rounding.

    Headings between which a vehicle turns on the spot cost the same: in a moved problem rounding
    would choose another one of them.
    """
    return int(np.argmax(costs <= costs.min() * (1.0 + ROUNDED)))


def _turned_to(pose: Array, heading: float) -> Array:
    turned = np.array(pose)
    turned[2] = heading
    return turned


def _headings(problem: Problem, number: int) -> list[float]:
    """Headings at a pose on the way: its own, or along the lines to neighbours and all around."""
    via = problem.via[number]
    if not via.free_heading:
        return [float(via.pose[2])]
    automaton = problem.automaton
    turns = automaton.body_velocities[:, 2].any() or any(
        one.displacement[2] for one in automaton.maneuvers
    )
    if not turns:
        return [float(problem.start[2])]
    ends = [problem.start, *(one.pose for one in problem.via), problem.goals[0].pose]
    before, here, after = ends[number : number + 3]
    lines = [after - before, here - before, after - here]
    angles = [math.atan2(line[1], line[0]) for line in lines if line[:2].any()]
    if problem.order == "free":
        angles = angles[:1]
    elif estimates_words(problem):
        angles += _of_single_trims(problem, here - before, 1.0)
        angles += _of_single_trims(problem, after - here, -1.0)
    first = angles[0] if angles else float(problem.start[2])
    count = headings_tried(problem)
    angles += [first + 2.0 * math.pi * k / count for k in range(count)]
    from_start = [math.remainder(angle - problem.start[2], 2.0 * math.pi) for angle in angles]
    return [
        float(problem.start[2]) + angle
        for angle in {round(one, 9): one for one in from_start}.values()
    ]


def _of_single_trims(problem: Problem, way: Array, side: float) -> list[float]:
    """Headings at which one trim leads along a way, at its end (side 1) or at its begin (-1)."""
    found, distance = list[float](), float(np.hypot(way[0], way[1]))
    for twist in moving_trims(problem.automaton, problem.cost).twists[:MOST_LETTERS].tolist():
        speed, rate = math.hypot(twist[0], twist[1]), twist[2]
        if speed > 0.0 and distance * abs(rate) <= 2.0 * speed:
            half = math.asin(distance * rate / (2.0 * speed))  # of the turn on the way
            straight = math.atan2(way[1], way[0]) - math.atan2(twist[1], twist[0])
            found += [
                straight + side * half,
                straight + side * (math.copysign(math.pi, rate) - half),
            ]
    return found


def headings_tried(problem: Problem) -> int:
    """How many headings stand for a free one: more where a leg is estimated in a moment."""
    if not estimates_words(problem):
        return HEADINGS
    n = len(problem.via)
    letters = len(moving_trims(problem.automaton, problem.cost).twists)
    legs = (n + 1) * (1 if problem.order == "given" else n) * min(letters, MOST_LETTERS) ** 3
    places = max((sum(1 for _ in _places(problem, k)) for k in range(n)), default=1)
    return int(np.clip(math.sqrt(MOST_ESTIMATES / legs) / places, HEADINGS, MOST_HEADINGS))


def _trims(problem: Problem, via: Via) -> list[str | None]:
    """Trims in which a pose on the way may be passed, None for rest, or for switching at will."""
    automaton = problem.automaton
    if not problem.has_inertia or via.stop:
        return [None]
    moving = [trim for trim in automaton.trims if not trim.is_rest]
    straight = [trim for trim in moving if not trim.body_velocity[2]] or moving

    def speed(trim: Trim) -> float:
        return float(np.linalg.norm(trim.body_velocity[[0, 1, *range(3, problem.start.size)]]))

    ahead = [one for one in straight if one.body_velocity[0] >= 0.0] or straight
    few = sorted(ahead, key=speed)[:: -max(1, math.ceil(len(ahead) / MOST_SPEEDS))]
    rest: list[str | None] = [None] if automaton.rest is not None else []
    return rest + [trim.name for trim in few]


def freedoms(problem: Problem, via: Via) -> Iterator[tuple[Callable[[Array, float], Array], float]]:
    """How a pose may be moved within what a pose on the way admits, and how far at first."""
    places = [0, 1, *range(3, via.pose.size)]

    def turned(pose: Array, by: float) -> Array:
        return _turned_to(pose, pose[2] + by)

    def along(direction: Array) -> Callable[[Array, float], Array]:
        def shifted(pose: Array, by: float) -> Array:
            to = np.array(pose)
            to[places] += by * direction
            if via.gate is not None and not via.tolerance_m:
                way = via.gate[1] - via.gate[0]
                share = min(1.0, max(0.0, float((to[places] - via.gate[0]) @ way / (way @ way))))
                to[places] = via.gate[0] + share * way
                return to
            beyond = via.offs(to)[0]
            off = to[places] - via.place
            if beyond > 0.0 and via.gate is None:
                to[places] = via.place + off * (
                    (1.0 - INSIDE) * via.tolerance_m / np.linalg.norm(off)
                )
            return pose if beyond > 0.0 and via.gate is not None else to

        return shifted

    if via.free_heading and problem.automaton.body_velocities[:, 2].any():
        yield turned, 2.0 * math.pi / headings_tried(problem)
    if via.gate is not None:
        length = float(np.linalg.norm(via.gate[1] - via.gate[0]))
        yield along((via.gate[1] - via.gate[0]) / length), length / 2.0
    if via.tolerance_m:
        ahead, left = math.cos(problem.start[2]), math.sin(problem.start[2])
        directions = np.eye(len(places))
        directions[:2, :2] = [[ahead, left], [-left, ahead]]
        for direction in directions:
            yield along(direction), via.tolerance_m


def set_bound(problem: Problem, way: Goal | None, goal: Goal) -> float:
    """No leg costs less that begins within the tolerance of a pose, or at the start."""
    if way is None:
        return _least(problem, goal)
    free = goal.free_heading or way.free_heading
    to = replace(goal, free_heading=free, tolerance_m=goal.tolerance_m + way.tolerance_m)
    return _least(problem.starting_at(way.pose, time=problem.start_time), to)


def _least(problem: Problem, goal: Goal) -> float:
    """No plan to a goal costs less, whatever its trims: by distance and turn alone."""
    if problem.has_inertia:
        return straight_bound(problem, (goal,), parts=True)
    return closed_bound(problem, goal)


def estimates_words(problem: Problem) -> bool:
    """Whether words of three trims tell what legs cost: in a plane, with trims switched at will."""
    automaton = problem.automaton
    bound = automaton.lattice is not None or automaton.translated is not None
    return not (problem.has_inertia or bound or problem.start.size != 3)


class LegCosts:
    """What legs of a problem cost about, where nothing is in the way.

    For a vehicle that switches at will in a plane, the shortest path of a car, or the cheapest word
    of three trims; else a bound.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.by_words = estimates_words(problem)
        self.are_least = False  # between poses none costs less
        if self.by_words:
            library = moving_trims(problem.automaton, problem.cost)
            self.car = shortest_trims(problem.automaton, problem.cost)
            self.are_least = len(library.twists) <= MOST_LETTERS and three_are_enough(problem)
            few = most_different(library.twists, min(MOST_LETTERS, len(library.twists)))
            self.twists = np.vstack([library.twists[few][:, :3], [[0.0, 0.0, 1.0]]])
            self.rates = library.rates[few]
            letters = range(len(few))
            self.words = np.array(list(itertools.product(letters, repeat=3)), dtype=np.int64)
            self.pairs = np.array(list(itertools.product(letters, repeat=2)), dtype=np.int64)

    def to(self, begins: Array, ends: Sequence[Goal]) -> Array:
        """Costs (m, n) from poses (m, dof) to goals."""
        exact = not any(one.free_heading or one.tolerance_m or one.tolerance_rad for one in ends)
        if self.by_words and exact:
            return self.between(begins, np.array([one.pose for one in ends]))
        problem = self.problem
        heres = [problem.starting_at(begin, time=problem.start_time) for begin in begins]
        return np.array([[_least(here, end) for end in ends] for here in heres])

    def between(self, begins: Array, ends: Array) -> Array:
        """Costs (m, n) of the cheapest words from poses (m, 3) to poses (n, 3)."""
        seen = (SE2(begins[:, None]).inverse() @ SE2(ends[None])).pose.reshape(-1, 3)
        if self.car is not None:
            lengths = reeds_shepp_length(seen, radius=self.car.radius)
            return self.car.per_metre * lengths.reshape(len(begins), len(ends))
        times = self._times(self.words, seen)
        rates = self.rates[self.words][:, None, None]
        least = np.where(np.isnan(times), np.inf, times * rates).sum(axis=-1).min(axis=(0, 2))
        return np.where(np.isfinite(least), least, 0.0).reshape(len(begins), len(ends))

    def _times(self, words: IntArray, seen: Array) -> Array:
        """Times (w, k, 2, 3) [s] of words to poses (k, 3) seen from their start; nan: none."""
        # Full turns are left out.
        k = len(seen)
        times = steer_batch(
            self.twists,
            np.repeat(words, k, axis=0),
            np.zeros((len(words) * k, 2, 3)),
            np.tile(seen, (len(words), 1)),
            STEERED,
        ).reshape(len(words), k, 2, 3)
        turns = np.abs(self.twists[words, 2])[:, None, None]
        times = np.where(times * turns > 2.0 * math.pi - NEARLY, 0.0, times)
        return np.where(times < -NEARLY, np.nan, times)

    def headings(self, before: Array, place: Array, after: Array) -> Array:
        """Headings at a place between two poses at which words to or from it lose a trim."""
        spin = np.full((len(self.pairs), 1), len(self.twists) - 1)
        here = np.array([[place[0], place[1], 0.0]])
        arriving = self._times(
            np.hstack([self.pairs, spin]), (SE2(before).inverse() @ SE2(here)).pose
        )
        leaving = self._times(
            np.hstack([spin, self.pairs]), (SE2(here).inverse() @ SE2(after)).pose
        )
        found = np.concatenate(
            [
                np.where(np.isnan(arriving).any(axis=-1), np.nan, -arriving[..., 2]).ravel(),
                np.where(np.isnan(leaving).any(axis=-1), np.nan, leaving[..., 0]).ravel(),
            ]
        )
        beside = found[~np.isnan(found)][:, None] + np.array([-BESIDE, BESIDE])
        return np.asarray(beside.ravel())


@dataclass(frozen=True, slots=True, eq=False)
class BetterArrivals:
    """Better arrivals at some poses on the way in an order, by what legs are estimated to cost."""

    problem: Problem
    costs: LegCosts
    order: Sequence[int]  # numbers of the poses on the way

    def chain(self, poses: Sequence[Array], is_over: Callable[[], bool]) -> list[Array]:
        """Poses with headings and places that cost less, from those of a chain of arrivals."""
        best, scale = [np.array(one) for one in poses], 1.0
        for _ in range(SWEEPS):
            gained = False
            for k in range(len(best)):
                if is_over():
                    return best
                tried = self._tried(best, k, scale)
                if len(tried) == 1:
                    continue
                sums = self._through(best, k, tried)
                least = first_least(sums)
                if sums[least] < sums[0] - INSIDE * scale:
                    best[k], gained = tried[least], True
            scale *= 1.0 if gained and scale == 1.0 else NARROWER
        return best

    def _tried(self, chain: list[Array], k: int, scale: float) -> Array:
        """Poses (m, 3) near that of an arrival and in its valleys, itself first."""
        problem, via, here = self.problem, self.problem.via[self.order[k]], chain[k]
        found = [here]
        for moved, reach in freedoms(problem, via):
            found += [moved(here, scale * reach * by) for by in STAR.tolist()]
        if via.free_heading and estimates_words(problem):
            before, after = self._around(chain, k)
            found += [
                _turned_to(here, heading) for heading in self.costs.headings(before, here, after)
            ]
        return np.array(found)

    def _around(self, chain: list[Array], k: int) -> tuple[Array, Array]:
        """The poses before and after an arrival."""
        goal = self.problem.goals[0].pose
        before = chain[k - 1] if k else self.problem.start
        return before, chain[k + 1] if k + 1 < len(chain) else goal

    def _through(self, chain: list[Array], k: int, poses: Array) -> Array:
        """What both legs beside an arrival cost, for poses (m, 3) in its place."""
        before = self._around(chain, k)[0][None]
        ends = list(self.problem.goals) if k + 1 == len(chain) else [Goal(chain[k + 1])]
        onward = self.costs.to(poses, ends).min(axis=1)
        return np.asarray(self.costs.between(before, poses)[0] + onward)
