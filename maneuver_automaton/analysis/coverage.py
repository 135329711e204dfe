"""Poses that words of bounded cost reach in free space, and how well a library covers them all.

Dispersion, and the factor by which it detours, are of words that begin and end at rest where the
library has rest, and both are found by sampling: the true values, over all poses, may be worse than
those over the samples.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray, check_fields, plain_numbers, wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import LatticeBody
from maneuver_automaton.search.lattice_library import path_length

EVEN = 16  # the number of bins of headings is a multiple: usual headings lie within, not between
MEASURES = ("time", "length")
SHORTEST = 1e-9  # of the greatest cost: steps that cost less are not taken


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSettings:
    """How far to go, in which steps, and which poses count as one."""

    measure: str = "time"  # time [s] | length [m]
    most: float = 8.0  # greatest cost of a word [s or m]
    edge_cost: float = 0.5  # trims last a multiple of what costs this [s or m]
    same_m: float = 0.02  # poses of one trim in one cell of this side count as one
    same_rad: float = 0.02  # [rad], or a little less
    most_nodes: int = 100_000

    def __post_init__(self) -> None:
        plain_numbers(self)
        if self.measure not in MEASURES:
            raise ValueError(
                f"reach: measure must be one of {', '.join(MEASURES)}, got {self.measure!r}"
            )
        sizes = ("most", "edge_cost", "same_m", "same_rad", "most_nodes")
        check_fields("reach", self, *sizes, infinite=True)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reached:
    """Poses by rising cost; the first is the start."""

    poses: Array  # (n, 3) [m, m, rad]
    costs: Array  # (n,) [s or m]
    classes: IntArray  # (n,) of trims, in which the vehicle is there
    complete: bool  # whether the search ended before `most_nodes` were found


def reached(automaton: Automaton, *, start: str | None = None, settings: ReachSettings) -> Reached:
    """The poses that words from the origin reach, cheapest first; in the trim `start`, or at rest.

    Nodes are expanded in waves: all that cost less than the cheapest one and its cheapest step; a
    cell that is found again for less is expanded again. A cell keeps the cheapest pose found in it,
    exactly; on a lattice whose points are further apart than the cells nothing is lost, elsewhere
    the costs are upper bounds.

    Source: Dijkstra (1959), *A note on two problems in connexion with graphs*; Barraquand, Latombe
    (1993), *Nonholonomic multibody mobile robots*, for one node a cell.

    Raises
    ------
    ValueError
        If the vehicle does not move in the plane.
    """
    if automaton.model.group is not SE2:
        raise ValueError(f"reach: {automaton.model.name} is no vehicle in the plane")
    index = automaton.rest if start is None else automaton.index_of(start)
    first = int(automaton.trim_classes[index or 0])
    return _searched(first, _steps(automaton, settings), settings)


def _steps(automaton: Automaton, settings: ReachSettings) -> dict[int, _Nodes]:
    """Maneuvers, and every trim for one edge, by class: where they lead, from 0."""
    rows: defaultdict[int, list[tuple[Array, float, int]]] = defaultdict(list)
    for trim, where in zip(automaton.trims, automaton.trim_classes.tolist(), strict=True):
        rate = 1.0 if settings.measure == "time" else float(np.hypot(*trim.body_velocity[:2]))
        if not trim.is_rest and rate > 0.0:
            seconds = min(settings.edge_cost / rate, trim.max_duration)
            there = SE2.exp(seconds * trim.body_velocity).pose
            rows[where].append((there, settings.edge_cost, where))
    for maneuver, (source, target) in zip(
        automaton.maneuvers, automaton.maneuver_classes.tolist(), strict=True
    ):
        cost = maneuver.duration if settings.measure == "time" else path_length(maneuver)
        if maneuver.displacement.any() or source != target:
            rows[source].append((maneuver.displacement, cost, target))
    return {
        where: _Nodes(*map(np.array, zip(*entries, strict=True))) for where, entries in rows.items()
    }


def _searched(first: int, steps: dict[int, _Nodes], settings: ReachSettings) -> Reached:
    least = min(
        (float(table.costs[table.costs > 0.0].min(initial=math.inf)) for table in steps.values()),
        default=math.inf,
    )
    open_ = _Nodes(np.zeros((1, 3)), np.zeros(1), np.array([first], dtype=np.int64))
    closed: list[_Nodes] = []
    known: dict[int, float] = {}
    complete = True
    while open_.costs.size:
        limit = float(open_.costs.min()) + max(least, SHORTEST * settings.most)
        due = open_.costs < limit
        wave, open_ = _cheapest([open_.chosen(due)], settings), open_.chosen(~due)
        fresh = _unknown(wave, known, settings)
        if not fresh.costs.size:
            continue
        closed.append(fresh)
        if len(known) >= settings.most_nodes:
            complete = False
            break
        open_ = _cheapest([open_, *_followers(fresh, steps, settings)], settings)
    nodes = _cheapest(closed, settings)
    nodes = nodes.chosen(np.argsort(nodes.costs, kind="stable"))
    return Reached(**nodes._asdict(), complete=complete)


class _Nodes(NamedTuple):
    poses: Array
    costs: Array
    classes: IntArray

    def chosen(self, rows: IntArray | NDArray[np.bool_]) -> _Nodes:
        return _Nodes(self.poses[rows], self.costs[rows], self.classes[rows])

    def keys(self, settings: ReachSettings) -> IntArray:
        """One number for each cell and class."""
        bins = EVEN * math.ceil(2.0 * math.pi / (EVEN * settings.same_rad))
        x, y = np.round(self.poses[:, :2].T / settings.same_m).astype(np.int64)
        heading = np.mod(np.round(self.poses[:, 2] * bins / (2.0 * math.pi)).astype(np.int64), bins)
        wide = 1 << 20
        keys: IntArray = ((self.classes * bins + heading) * wide + x + wide // 2) * wide + y
        return keys


def _cheapest(parts: Sequence[_Nodes], settings: ReachSettings) -> _Nodes:
    """Of all the nodes one for each cell and class."""
    nodes = _Nodes(*map(np.concatenate, zip(*parts, strict=True)))
    order = np.argsort(nodes.costs, kind="stable")
    _, firsts = np.unique(nodes.keys(settings)[order], return_index=True)
    return nodes.chosen(order[firsts])


def _unknown(nodes: _Nodes, known: dict[int, float], settings: ReachSettings) -> _Nodes:
    """Nodes whose cells were not closed before, or at a higher cost; they are now."""
    fresh = np.zeros(nodes.costs.size, dtype=bool)
    pairs = zip(nodes.keys(settings).tolist(), nodes.costs.tolist(), strict=True)
    for k, (key, cost) in enumerate(pairs):
        if cost < known.get(key, math.inf) - SHORTEST * settings.most:
            known[key] = cost
            fresh[k] = True
    return nodes.chosen(fresh)


def _followers(nodes: _Nodes, steps: dict[int, _Nodes], settings: ReachSettings) -> list[_Nodes]:
    parts = []
    for where in np.unique(nodes.classes).tolist():
        table = steps.get(where)
        if table is None:
            continue
        here = nodes.chosen(nodes.classes == where)
        poses = (SE2(here.poses[:, None]) @ SE2(table.poses)).pose.reshape(-1, 3)
        costs = (here.costs[:, None] + table.costs).ravel()
        targets = np.broadcast_to(table.classes, (here.costs.size, table.costs.size)).ravel()
        parts.append(_Nodes(poses, costs, targets).chosen(costs <= settings.most))
    return parts


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageSettings:
    """Where poses are drawn, how far apart they are, and which words may reach them."""

    radius: float = 2.0  # [m] of the disc of positions; headings are all
    metres_per_radian: float = 1.0  # what a radian of heading counts for in a distance [m]
    samples: int = 2000  # for the dispersion
    pairs: int = 100  # for the stretch factor
    seed: int = 0  # of the scrambled Halton sequence
    reach: ReachSettings = field(default_factory=ReachSettings)

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("coverage", self, "radius", "metres_per_radian", "samples", "pairs")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Dispersion:
    """How far a pose can be from all that are reached [m]."""

    largest: float
    mean: float
    pose: Array  # (3,) the sample that is furthest from all
    reached: int  # poses at which words end
    most: float  # cost of the costliest of them [s or m]: less where the search was cut short


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StretchFactor:
    """By how much the library detours at most, against a body that drives and turns any way."""

    largest: float
    median: float
    pose: Array  # (3,) to which the detour is largest
    pairs: int  # poses that were compared


def settings_for(automaton: Automaton) -> CoverageSettings:
    """Settings to the size of a library: a disc of twice its longest maneuver.

    Words may take as long as four of the longest maneuvers, or eight edges of half a second.
    """
    spans = [one.duration for one in automaton.maneuvers]
    distances = [float(np.linalg.norm(m.displacement[:2])) for m in automaton.maneuvers]
    edge_cost = 0.5
    most = max(4.0 * max(spans, default=0.0), 8.0 * edge_cost)
    radius = 2.0 * max(distances, default=0.0) or 2.0
    body = automaton.model
    cell = body.resolution / 4.0 if isinstance(body, LatticeBody) else radius / 100.0
    reach = ReachSettings(most=most, edge_cost=edge_cost, same_m=cell)
    return CoverageSettings(radius=radius, reach=reach)


def dispersion(
    automaton: Automaton, *, start: str | None = None, settings: CoverageSettings | None = None
) -> Dispersion:
    """Distance of a pose in a ball to the nearest that words of bounded cost reach, at most.

    ``max over poses g of min over reached h of d(g, h)``, with ``d^2 = dx^2 + dy^2 + (L dh)^2``,
    L as `metres_per_radian` says and headings modulo a turn. Trims last whole edges here, so that
    of a library with trims is an upper bound of its own; that of a lattice is not.

    Source: Niederreiter (1992), *Random Number Generation and Quasi-Monte Carlo Methods*, Ch. 6,
    for dispersion; LaValle (2006), *Planning Algorithms*, Sec. 5.2.3; Pivtoraiko, Kelly (2005),
    *Efficient constrained path planning via search in state lattices*, for what a lattice covers.

    Parameters
    ----------
    automaton : Automaton
        The library, of a vehicle in the plane.
    start : str, optional
        Trim at the origin; rest if None.
    settings : CoverageSettings, optional
        Ball, samples, and the words that count.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "back": (-1, 0)})
    >>> coarse = CoverageSettings(radius=1.0, samples=200, reach=ReachSettings(most=1.0))
    >>> bool(dispersion(robot, settings=coarse).largest > np.pi / 2)  # it cannot turn
    True
    """
    settings = settings or CoverageSettings()
    words = _at_rest(automaton, reached(automaton, start=start, settings=settings.reach))
    samples = poses_in_ball(settings.radius, settings.samples, seed=settings.seed)
    distances, _ = _nearest(words.poses, samples, settings.metres_per_radian)
    worst = int(distances.argmax())
    return Dispersion(
        largest=float(distances[worst]),
        mean=float(distances.mean()),
        pose=samples[worst],
        reached=len(words.poses),
        most=float(words.costs.max()),
    )


def stretch_factor(
    automaton: Automaton, *, settings: CoverageSettings | None = None
) -> StretchFactor:
    """The t by which the library spans what it reaches: its cost over `straight_costs`, at most.

    Poses are those at which words of the library end within the ball, next to the samples of a
    Halton sequence; a pose at the origin is left out. A library t-spans a lattice if t times the
    cost of the best motion pays for a word to each of its points.

    Source: Botros, Smith (2019), *Computing a minimal set of t-spanning motion primitives for
    lattice planners*, arXiv 1903.10483, Definition of a t-spanner, here over sampled poses.

    Parameters
    ----------
    automaton : Automaton
        The library, of a vehicle in the plane.
    settings : CoverageSettings, optional
        Ball, number of pairs, and the words that count.

    Raises
    ------
    ValueError
        If no word ends in the ball but at the origin.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> stretch_factor(robot, settings=CoverageSettings(radius=1.0, pairs=20)).largest > 2.0
    True
    """
    settings = settings or CoverageSettings()
    words = _at_rest(automaton, reached(automaton, settings=settings.reach))
    inside = np.linalg.norm(words.poses[:, :2], axis=1) <= settings.radius
    inside &= words.costs > 0.0
    if not inside.any():
        raise ValueError(
            f"stretch factor: no word of at most {settings.reach.most:g} ends within "
            f"{settings.radius:g} m"
        )
    poses, costs = words.poses[inside], words.costs[inside]
    samples = poses_in_ball(settings.radius, settings.pairs, seed=settings.seed)
    _, chosen = _nearest(poses, samples, settings.metres_per_radian)
    chosen = np.unique(chosen)
    least = straight_costs(automaton, poses[chosen], measure=settings.reach.measure)
    known = np.isfinite(least) & (least > 0.0)
    chosen = chosen[known]
    if not chosen.size:
        raise ValueError("stretch factor: no pose that was reached is away from the origin")
    ratios = costs[chosen] / least[known]
    worst = int(ratios.argmax())
    x, y, heading = poses[chosen][worst]
    return StretchFactor(
        largest=float(ratios[worst]),
        median=float(np.median(ratios)),
        pose=np.array([x, y, wrapped(heading)]),
        pairs=len(chosen),
    )


def straight_costs(automaton: Automaton, poses: Array, *, measure: str = "time") -> Array:
    """Least costs (n,) of a body that drives and turns any way as fast as the library does.

    They are lower bounds for every vehicle: the distance, or the longer of the times for the
    distance and for the turn.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (2, 0), "left": (0, 1)})
    >>> straight_costs(robot, np.array([[3.0, 4.0, 0.1]])).tolist()
    [2.5]
    """
    distances, turns = np.hypot(poses[:, 0], poses[:, 1]), np.abs(wrapped(poses[:, 2]))
    if measure == "length":
        return distances
    twists = [trim.body_velocity for trim in automaton.trims]
    for maneuver in automaton.maneuvers:
        if maneuver.course is not None:
            course = maneuver.course
            twists.extend(automaton.model.body_velocity(course.reduced_state, course.control))
        elif maneuver.duration > 0.0:
            twists.append(maneuver.displacement / maneuver.duration)
    speeds, turn_rates = np.hypot(*np.array(twists).T[:2]), np.abs(np.array(twists)[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        times = (distances / speeds.max(), turns / turn_rates.max())
    return np.asarray(np.fmax(*times))  # nothing to do takes no time


def poses_in_ball(radius: float, count: int, *, seed: int) -> Array:
    """Poses (count, 3) spread evenly over a disc and all headings: a scrambled Halton sequence.

    Source: Owen (2017), *A randomized Halton algorithm in R*, arXiv 1706.02808, by SciPy.
    """
    from scipy.stats import qmc

    share, around, heading = qmc.Halton(3, seed=seed).random(count).T
    distance, angle = radius * np.sqrt(share), 2.0 * np.pi * around
    turn = 2.0 * np.pi * heading - np.pi
    return np.stack([distance * np.cos(angle), distance * np.sin(angle), turn], axis=-1)


def _at_rest(automaton: Automaton, words: Reached) -> Reached:
    """The words that end where the vehicle can stand; all of them if it never can."""
    still = ~automaton.body_velocities.any(axis=1)
    ends = np.isin(words.classes, automaton.trim_classes[still if still.any() else ...])
    return replace(
        words, poses=words.poses[ends], costs=words.costs[ends], classes=words.classes[ends]
    )


def _nearest(poses: Array, samples: Array, length: float) -> tuple[Array, IntArray]:
    """Distance (n,) of each sample to the nearest pose, and which it is (n,)."""
    from scipy.spatial import cKDTree

    turn = 2.0 * np.pi * length
    places = np.stack([poses[:, 0], poses[:, 1], np.mod(length * poses[:, 2], turn)], axis=-1)
    around = np.concatenate([places + np.array([0.0, 0.0, k * turn]) for k in (-1.0, 0.0, 1.0)])
    asked = np.stack([samples[:, 0], samples[:, 1], np.mod(length * samples[:, 2], turn)], axis=-1)
    distances, rows = cKDTree(around).query(asked)
    return np.asarray(distances), np.asarray(rows, dtype=np.int64) % len(poses)
