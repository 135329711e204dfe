"""Plans of trims and maneuvers where nothing is in the way: words, then insertion."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.alternatives import distinct
from maneuver_automaton.search.linked_insertion import improve_linked_words
from maneuver_automaton.search.linked_words import scan_linked_words, steer_linked_words
from maneuver_automaton.search.result import SearchResult, SearchStatus
from maneuver_automaton.words.word import Word

CLOSED_FORM = 3  # trims of a word whose times follow in closed form
SCANNED_TRIMS = 14  # that words of four trims are made of
SCAN_SHARE = 0.4  # of the time that is left, for scanning
SEED_SLACK = 0.1  # share by which words may be dearer than a plan that is known, and yet be seeds
SEEDS = 4  # words of three trims that insertion begins with, beside the cheapest one


def search_words_with_maneuvers(
    problem: Problem,
    goal: Goal,
    *,
    time_limit: float = math.inf,
    alternatives: int = 0,
    upper_bound: float = math.inf,
) -> SearchResult:
    """Plans to a goal in free space: words of up to four trims, and what insertion makes of them.

    Parameters
    ----------
    problem : Problem
        Its first trim, and the last one of `goal`, are those named, or rest. Obstacles and bounds
        are not looked at.
    goal : Goal
    time_limit : float
        [s] after which the search ends with what it has. Where the problem limits its expansions,
        every stage counts its work, and the time only ends it earlier.
    alternatives : int
        How many plans beside the cheapest.
    upper_bound : float
        Cost of a plan that is known: what costs as much is left out. Insertion still begins with
        words that are a little dearer.

    Returns
    -------
    SearchResult
        Locally optimal words, cheapest first.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> controls = {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> goal = Goal(pose=[3.0, 1.0, 0.0], trim="ahead")
    >>> problem = Problem(robot, [0, 0, 0], goal, start_trim="ahead")
    >>> best = search_words_with_maneuvers(problem, goal).solutions[0]
    >>> [robot.trim_names[k] for k in best.trims]
    ['left', 'ahead', 'right']
    """
    *_, last = maneuver_word_stages(
        problem, goal, time_limit=time_limit, alternatives=alternatives, upper_bound=upper_bound
    )
    return last


def maneuver_word_stages(
    problem: Problem,
    goal: Goal,
    *,
    time_limit: float = math.inf,
    alternatives: int = 0,
    upper_bound: float = math.inf,
) -> Iterator[SearchResult]:
    """What is found so far after each stage: short words, longer ones, and insertion seed by seed.

    The parameters are those of `search_words_with_maneuvers`; the last stage is its answer.
    """
    if not problem.automaton.body_velocities.any():  # nothing that words are made of
        yield SearchResult(status=SearchStatus.EXHAUSTED, solutions=())
        return
    deadline = time.monotonic() + time_limit
    counted = problem.search.max_expansions is not None
    asked = max(alternatives, SEEDS - 1)
    near = upper_bound * (1.0 + SEED_SLACK)
    found: list[Word] = []
    counts: dict[str, int] = {}

    def stage(more: SearchResult) -> SearchResult:
        nonlocal found
        everything = [*found, *more.solutions]
        found = list(distinct(problem, everything, most=len(everything)))
        _add(counts, more.counts)
        kept = tuple(one for one in found if one.cost < upper_bound)[: alternatives + 1]
        out = time.monotonic() > deadline
        none = SearchStatus.OUT_OF_BUDGET if out else SearchStatus.EXHAUSTED
        status = SearchStatus.FOUND if kept else none
        return SearchResult(status=status, solutions=kept, counts=dict(counts))

    yield stage(
        steer_linked_words(
            problem, goal, alternatives=asked, time_limit=time_limit, upper_bound=near
        )
    )
    seeds = found[:SEEDS]  # they differ more than the words of four trims, which come in families
    left = deadline - time.monotonic()
    if left > 0.0:
        yield stage(
            scan_linked_words(
                problem,
                goal,
                alternatives=asked,
                alphabet=SCANNED_TRIMS,
                time_limit=left if counted else SCAN_SHARE * left,
                upper_bound=found[alternatives].cost if len(found) > alternatives else near,
            )
        )
    left = deadline - time.monotonic()
    most = problem.horizon.max_trims
    if left > 0.0 and found and (most is None or most > CLOSED_FORM):
        seeds = [found[0], *(one for one in seeds if one is not found[0])]
        for one in improve_linked_words(problem, goal, seeds, time_limit=left):
            yield stage(one)


def _add(counts: dict[str, int], more: dict[str, int]) -> None:
    for name, value in more.items():
        counts[name] = counts.get(name, 0) + value
