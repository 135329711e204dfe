"""Transitions between classes of trims: cheapest chains of maneuvers, for any number of trims."""

from __future__ import annotations

import itertools

import networkx
import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.words.library import transitions_of
from tests.search.automata import linked


def test_chains_cost_what_networkx_says_and_lead_where_their_maneuvers_do():
    rng = np.random.default_rng(1)
    for seed in range(5):
        twists = [[float(v), 0.0, 0.0] for v in range(6)]
        full = linked(twists, rng=np.random.default_rng(seed))
        kept = tuple(m for m in full.maneuvers if rng.random() < 0.35)
        automaton = Automaton(full.model, full.trims, kept)
        prices = rng.uniform(0.1, 2.0, len(kept))
        known = transitions_of(automaton, prices)
        graph = networkx.DiGraph()
        graph.add_nodes_from(range(6))
        for maneuver, price in zip(kept, prices, strict=True):
            graph.add_edge(
                automaton.index_of(maneuver.source),
                automaton.index_of(maneuver.target),
                weight=price,
            )
        for a, b in itertools.permutations(range(6), 2):
            pair = known.class_of[a], known.class_of[b]
            if not networkx.has_path(graph, a, b):
                assert known.cost[pair] == np.inf
                continue
            assert known.cost[pair] == pytest.approx(networkx.dijkstra_path_length(graph, a, b))
            pose = SE2([0.0, 0.0, 0.0])
            for maneuver, _ in known.chain(a, b):
                pose = pose @ SE2(kept[maneuver].displacement)
            assert known.displacement[pair][:3] == pytest.approx(pose.pose, abs=1e-12)
