"""The part of an automaton that a plan from one trim to another can pass through."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton.automaton import Automaton

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def trims_between(automaton: Automaton, start: int, goals: Iterable[int]) -> IntArray:
    """Indices, rising, of the trims reached from `start` that lead to one of `goals`.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5,
    ...                      max_acceleration=1.0, max_steering_rate=0.5)
    >>> library = Automaton.of_model(car, {"speed": [0.0, 1.0], "steering": [0.0]})
    >>> trims_between(library, 0, [1]).tolist()
    [0, 1]
    """
    classes, (graph, against) = automaton.trim_classes, _graphs(automaton)
    ahead = _reached(graph, [int(classes[start])])
    back = _reached(against, sorted({int(classes[goal]) for goal in goals}))
    return np.flatnonzero((ahead & back)[classes])


def part_between(automaton: Automaton, start: int, goals: Iterable[int]) -> Automaton:
    """The trims of `trims_between` and the maneuvers among them; the same automaton if that is all.

    Start and goals stay, also where no maneuvers lead from one to the other.
    """
    goals = sorted(set(goals))
    kept = {start, *goals, *trims_between(automaton, start, goals).tolist()}
    return automaton if len(kept) == len(automaton) else _part(automaton, tuple(sorted(kept)))


@kept_by_first
def _graphs(automaton: Automaton) -> tuple[csr_array, csr_array]:
    """Which classes of trims maneuvers link, along them and against them.

    Trims of one class switch at will.
    """
    from scipy.sparse import csr_array

    classes = automaton.trim_classes
    n = int(classes.max()) + 1
    ends = [
        (classes[automaton.index_of(one.source)], classes[automaton.index_of(one.target)])
        for one in automaton.maneuvers
    ]
    sources, targets = np.array(ends, dtype=np.int64).reshape(-1, 2).T
    graph = csr_array((np.ones(len(ends), dtype=np.int8), (sources, targets)), shape=(n, n))
    return graph, graph.T.tocsr()


@kept_by_first
def _part(automaton: Automaton, kept: tuple[int, ...]) -> Automaton:
    trims = tuple(automaton.trims[k] for k in kept)
    names = {trim.name for trim in trims}
    maneuvers = tuple(
        one for one in automaton.maneuvers if one.source in names and one.target in names
    )
    return Automaton(automaton.model, trims, maneuvers, name=automaton.name)


def _reached(graph: csr_array, nodes: list[int]) -> NDArray[np.bool_]:
    from scipy.sparse.csgraph import breadth_first_order

    found: NDArray[np.bool_] = np.zeros(graph.shape[0], dtype=np.bool_)
    for node in nodes:
        found[breadth_first_order(graph, node, return_predecessors=False)] = True
    return found
