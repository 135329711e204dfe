"""Libraries made to measure: the fewest trims that lose no more than a factor, with its proof."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, as_whole, check_range
from maneuver_automaton._brief import brief
from maneuver_automaton.analysis.coverage import poses_in_ball
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost, StageCost, check_cost
from maneuver_automaton.design.choice import Choice, best_choices, mixing_factors
from maneuver_automaton.design.proof import SEED, WordsProof, proven_factor
from maneuver_automaton.design.reeds_shepp import MOST_TRIMS
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.groups import SE2
from maneuver_automaton.scenario.build_file import build_file_of_text
from maneuver_automaton.scenario.parts import at
from maneuver_automaton.scenario.scenario import cost_of

SAME = 1e-9  # relative: twists per cost that differ by less are one
SAMPLES = 1000  # goals at which the factor of short words is looked at first
SIX = 6  # trims of Reeds and Shepp
FEWEST_TRIMS = 3  # of words: a pose has three coordinates
MOST_CANDIDATES = 2000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DesignedLibrary:
    """A library, and the factor by which its words are costlier than those of all candidates.

    `factor` is proven; `by_size` are the best libraries of each size, as pairs of a number of trims
    and their factor for words of any length.
    """

    automaton: Automaton
    candidates: int  # how many controls the trims were chosen from
    within: float  # the factor that was asked for
    factor: float  # proven, for the words that were asked for
    any_length: float  # for words of any length: proven, for every start and every goal
    hardest: str  # the candidate that loses most, if words may have any length
    by_size: tuple[tuple[int, float], ...]
    words: WordsProof | None  # of short words, where these were asked for

    __repr__ = brief

    @property
    def holds(self) -> bool:
        """Whether the factor that was asked for is proven."""
        return self.factor <= self.within * (1.0 + SAME)


def design_library(
    candidates: Automaton,
    *,
    cost: StageCost | None = None,
    within: float = 1.05,
    most: int = 24,
    max_trims: int | None = None,
    radius: float | None = None,
    tasks: ArrayLike | None = None,
    least: float | None = None,
    tolerance: float = 0.01,
    most_boxes: int = 1_500_000,
) -> DesignedLibrary:
    """The smallest library whose words cost at most `within` times those of all candidates.

    The factor is ``sup C_L(g) / C(g)`` over goals g: C is what the cheapest word of all candidates
    costs (strictly: no word costs less than C, and some come as near to it as one likes), C_L the
    same for words of the library. By symmetry the start does not matter.

    - Words of any length (`max_trims` is None): whatever the candidates do, the library does by
      mixing its trims, ``twist_j = sum share_i twist_i``, at ``sum share_i rate_i`` per second. So
      the greatest ``sum share_i rate_i / rate_j`` bounds the factor for *every* start and goal, and
      short goals along candidate j attain it. A mixture is followed in the limit of many switches,
      and ends as near to the goal as one likes.
    - Words of at most `max_trims` trims: the optimum must be known in closed form. It is where the
      cheapest twists are straight and full lock, as for length, or for time at one speed: then C is
      the length of the shortest path of Reeds and Shepp, or of Dubins without reverse. The factor
      is proven over the disc of goals by boxes of goals; see `WordsProof`.

    The fastest straights always belong to the library, and trims come with their mirror images
    where the candidates do. Of cars and unicycles every size then is the best possible one (among
    candidates that no mixture of others makes superfluous); of vehicles that also move sideways it
    is found one trim after the other.

    Parameters
    ----------
    candidates : Automaton
        All trims that the vehicle might be given: a grid of controls, say. Rest is left out.
    cost : StageCost
        What a plan costs; its length if left out. Prices per switch cannot be designed for.
    within : float
        The factor that is asked for, at least 1.
    most : int
        Trims that the library may have.
    max_trims : int, optional
        Trims that a word may have, at least 3; any number if left out.
    radius : float, optional
        Goals are within this distance of the start, at all headings [m]; needed with `max_trims`.
    tasks : (n, 2, 3) array, optional
        Starts and goals [m, m, rad] that are to be among the goals: without a radius, the disc
        reaches to the farthest of them.
    least : float, optional
        Goals whose shortest path is shorter do not count [m], as the ratio of two small numbers
        says little; half a turning radius if left out.
    tolerance : float
        By which what is proven for short words may exceed what was found at some goal.
    most_boxes : int
        Boxes after which the proof ends with what it has.

    Returns
    -------
    DesignedLibrary
        The smallest library that keeps the factor, or the best one of at most `most` trims: whether
        it `holds`, says the value.

    Raises
    ------
    ValueError
        If an argument cannot be, trims cost nothing, or no closed form is known for short words.

    Source: Botros, Smith (2019), *Computing a minimal set of t-spanning motion primitives for
    lattice planners*, arXiv 1903.10483, for the factor, there over the points of a lattice.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> speeds = np.linspace(-1.0, 1.0, 21)
    >>> grid = Automaton.of_grid(Unicycle(), [speeds, speeds])
    >>> designed = design_library(grid, cost=Cost(effort=1.0, time=1.0))
    >>> len(designed.automaton), round(designed.factor, 3)
    (12, 1.04)
    """
    cost = Cost(length=1.0) if cost is None else cost
    within, most = as_number("design: within", within), as_whole("design: most", most)
    tolerance = as_number("design: tolerance", tolerance)
    _check(candidates, cost, within, most, max_trims)
    moving = np.flatnonzero(candidates.body_velocities.any(axis=1))
    twists = candidates.body_velocities[moving]
    trims = [candidates.trims[k] for k in moving]
    rates = cost.rates(candidates.controls[moving], twists)
    if not len(trims):
        raise ValueError("design: all candidates rest, need some that move")
    if not (rates > 0.0).all():
        name = trims[int(rates.argmin())].name
        raise ValueError(
            f"design: the candidate {name!r} moves and costs nothing, so that no factor bounds "
            "what replaces it; add a price of time, or leave it out"
        )
    choices = list(best_choices(twists, rates, most=max(most, SIX)))
    points = twists / rates[:, None]
    prove = None
    if max_trims is not None:
        choices = [one for one in choices if _circle(points, one) is not None]
        prove = _proof_of_words(points, choices, max_trims, radius, tasks, least)
    choices = [one for one in choices if len(one.chosen) <= most]
    finite = _better(choices)
    if not finite:
        raise ValueError(
            f"design: no library of at most {most} trims follows all {len(trims)} candidates"
            + (" by short words, which take straights and full lock" if prove is not None else "")
            + ", need more trims"
        )
    good = [one for one in finite if one.factor <= within * (1.0 + SAME)]
    best = min(good, key=lambda one: len(one.chosen)) if good else finite[-1]
    words = None
    if prove is not None and max_trims is not None:
        words = prove(tolerance=tolerance, most_boxes=most_boxes)
        words = replace(words, max_trims=max_trims)
    hardest = int(mixing_factors(twists, rates, best.chosen).argmax())
    chosen = tuple(trims[k] for k in best.chosen)
    return DesignedLibrary(
        automaton=Automaton(candidates.model, chosen, name=candidates.name),
        candidates=len(trims),
        within=within,
        factor=best.factor if words is None else words.factor,
        any_length=best.factor,
        hardest=trims[hardest].name,
        by_size=tuple((len(one.chosen), one.factor) for one in finite),
        words=words,
    )


def _better(choices: list[Choice]) -> list[Choice]:
    """Of the choices that follow all candidates those better than every smaller one, by size."""
    kept: list[Choice] = []
    for one in sorted(choices, key=lambda one: (len(one.chosen), one.factor)):
        if one.factor < (kept[-1].factor * (1.0 - SAME) if kept else math.inf):
            kept.append(one)
    return kept


def _proof_of_words(
    points: Array,
    choices: list[Choice],
    max_trims: int,
    radius: float | None,
    tasks: ArrayLike | None,
    least: float | None,
) -> Callable[..., WordsProof]:
    """What proves the factor of short words; refuses what has no optimum in closed form.

    Source: Dubins (1957), *On curves of minimal length*: without reverse, three trims are enough.
    """
    circle = _circle(points, choices[0]) if choices else None
    if circle is None:
        raise ValueError(
            "design: max_trims: the optimum of these candidates has no closed form, which it has "
            "where straights and full lock are the cheapest twists, as at the cost of length; "
            "leave max_trims out, then words may have any length"
        )
    turning_radius, reverse = circle
    posed = _task_goals(tasks)
    if radius is None:
        if not len(posed):
            raise ValueError("design: radius: max_trims needs a radius of goals [m], or tasks")
        radius = float(np.hypot(posed[:, 0], posed[:, 1]).max())
    check_range("design: radius", radius, unit="m")
    least = 0.5 * turning_radius if least is None else least
    check_range("design: least", least, unit="m")
    return functools.partial(
        proven_factor,
        turning_radius=turning_radius,
        radius=radius,
        max_trims=max_trims if reverse else max(max_trims, MOST_TRIMS),
        least=least,
        goals=np.concatenate([posed, poses_in_ball(radius, SAMPLES, seed=SEED)]),
    )


def _circle(points: Array, choice: Choice) -> tuple[float, bool] | None:
    """Radius of the circles of shortest paths [m], and whether some go in reverse; None if others.

    Source: Sussmann, Tang (1991), *Shortest paths for the Reeds-Shepp car*, for the rectangle,
    which is what six trims mix to.
    """
    ahead, turn = points[:, 0], points[:, 2]
    if np.delete(points, (0, 2), axis=1).any() or not turn.any() or not (ahead > 0.0).any():
        return None
    speed, reverse, moving = float(ahead.max()), bool((ahead < 0.0).any()), ahead > 0.0
    if reverse:
        rate = float(np.abs(turn).max())
    elif (turn[~moving] != 0.0).any():
        return None
    else:
        rate = speed * float((np.abs(turn[moving]) / ahead[moving]).max())
    gears = (1.0, -1.0) if reverse else (1.0,)
    corners = np.array([[gear, side] for gear in gears for side in (-1.0, 0.0, 1.0)])
    held = points[choice.chosen][:, [0, 2]] / np.array([speed, rate])
    apart = np.abs(held[None] - corners[:, None]).max(axis=2).min(axis=1)
    if apart.max() > SAME or np.abs(ahead).max() > speed * (1.0 + SAME):
        return None
    return speed / rate, reverse


def _task_goals(tasks: ArrayLike | None) -> Array:
    """Goals (n, 3) of tasks as they are seen from their starts."""
    if tasks is None:
        return np.zeros((0, 3))
    pairs = as_array("design: tasks", tasks, last=3)
    if pairs.ndim != 3 or pairs.shape[1] != 2 or not len(pairs):
        raise ValueError(f"design: tasks have shape {pairs.shape}, need (n, 2, 3): start and goal")
    return (SE2(pairs[:, 0]).inverse() @ SE2(pairs[:, 1])).pose


def _check(
    candidates: Automaton, cost: StageCost, within: float, most: int, max_trims: int | None
) -> None:
    """Refuse what no design can take."""
    if not candidates.is_kinematic:
        raise ValueError(
            f"design: the trims of this {candidates.model.name} are joined by maneuvers; need a "
            "kinematic vehicle, whose trims can follow one another at will"
        )
    if len(candidates) > MOST_CANDIDATES:
        raise ValueError(
            f"design: got {len(candidates)} candidates, need at most {MOST_CANDIDATES}"
        )
    check_cost(cost)
    if cost.switching(candidates.body_velocities) > 0.0:
        raise ValueError(
            "design: prices of switch and direction_change belong to the scenario: the best of all "
            "words, which a design compares with, is known for prices per second and metre only"
        )
    check_range("design: within", within, least=1)
    check_range("design: most", most, least=1)
    if max_trims is not None and max_trims < FEWEST_TRIMS:
        raise ValueError(
            f"design: max_trims must be at least {FEWEST_TRIMS}, as a pose has so many "
            f"coordinates, got {max_trims}"
        )


def design_of_file(
    path: Path | str, *, instead: Mapping[str, float] | None = None
) -> DesignedLibrary:
    """The library that a design file asks for: a build file with the key `design`.

    Values of `within`, `most`, `max_trims` and `radius_m` in `instead` hold instead of those
    stated.
    """
    name, text = str(path), read_text(Path(path))
    asked = build_file_of_text(text, name=name)
    document = parse(text, name=name, what="a design file")
    if asked.file.design is None:
        raise document.error(
            (), "misses the key design: how the trims are chosen, such as {within: 1.05}"
        )
    part = asked.file.design.model_copy(update=dict(instead or {}))
    with at(document, ("trims",)):
        candidates = Automaton(asked.model, asked.trims, name=asked.file.library)
    cost = cost_of(document, part.cost, candidates, within=("design",))
    with at(document, ("design",)):
        return design_library(
            candidates,
            cost=cost,
            within=part.within,
            most=part.most,
            max_trims=part.max_trims,
            radius=part.radius_m,
            tasks=part.tasks,
            least=part.least_m,
            tolerance=part.tolerance,
        )
