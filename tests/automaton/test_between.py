"""The part of an automaton that leads from one trim to another."""

from __future__ import annotations

import networkx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import part_between, trims_between
from maneuver_automaton.models import LatticeBody
from maneuver_automaton.primitives import Maneuver, Trim

N = 6


def automaton(pairs):
    angles = np.arange(N) * np.pi / 4
    trims = [
        Trim(
            name=str(k),
            body_velocity=np.zeros(3),
            control=np.zeros(3),
            reduced_state=np.array([np.cos(a), np.sin(a)]),
        )
        for k, a in enumerate(angles)
    ]
    maneuvers = [
        Maneuver(name=f"{i}{j}", source=str(i), target=str(j), displacement=np.ones(3))
        for i, j in pairs
    ]
    return Automaton(LatticeBody(resolution=0.1), tuple(trims), tuple(maneuvers))


@given(
    pairs=st.sets(st.tuples(st.integers(0, N - 1), st.integers(0, N - 1))),
    start=st.integers(0, N - 1),
    goals=st.sets(st.integers(0, N - 1), min_size=1),
)
def test_trims_between_are_those_of_the_graph(pairs, start, goals):
    library = automaton(pairs)
    graph = library.graph()
    ahead = networkx.descendants(graph, str(start)) | {str(start)}
    back = set().union(*(networkx.ancestors(graph, str(goal)) | {str(goal)} for goal in goals))
    expected = sorted(int(name) for name in ahead & back)
    assert trims_between(library, start, goals).tolist() == expected
    part = part_between(library, start, tuple(goals))
    kept = sorted({*expected, start, *goals})
    assert [int(name) for name in part.trim_names] == kept
    assert all(part[name] is library[name] for name in part.trim_names)
    assert len(part.maneuvers) == sum(i in kept and j in kept for i, j in pairs)
    assert (part is library) == (len(kept) == N)
