"""Transitions between classes of trims: cheapest chains of maneuvers, for any number of trims."""

from __future__ import annotations

import functools
import itertools
import operator

import networkx
import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.words.library import SWITCH, transitions_of
from tests.search.automata import linked, model_of_kinds


def gears(*, maneuvers):
    """Two classes of two trims each: a vehicle that switches at will within a gear."""
    trims = tuple(
        Trim(name=name, body_velocity=twist, control=[0, 0], reduced_state=[kind])
        for name, twist, kind in [
            ("ahead", [1.0, 0, 0], 0.0), ("left", [1.0, 0, 1.0], 0.0),
            ("back", [-1.0, 0, 0], 1.0), ("back left", [-1.0, 0, 1.0], 1.0),
        ]
    )  # fmt: skip
    return Automaton(model_of_kinds(), trims, maneuvers)


def stop(source, target, *, price=1.0, turn=0.5):
    return Maneuver(
        name=f"{source}-{target}",
        source=source,
        target=target,
        displacement=[0.2, 0.1, turn],
        duration=price,
    )


def test_a_kinematic_library_has_one_class_and_the_identity():
    speeds = np.linspace(-1.0, 1.0, 41)
    grid = Automaton.of_grid(Unicycle(), [speeds, speeds])
    known = transitions_of(grid, np.zeros(0))
    assert known.class_of.shape == (1681,)
    assert known.displacement.shape == (1, 1, 4)
    assert not known.displacement.any()
    assert known.cost.tolist() == known.time.tolist() == [[0.0]]
    assert known.chain(3, 1000) == ((SWITCH, 1000),)
    assert known.chain(3, 3) == ()


def test_a_chain_switches_to_the_trim_that_a_maneuver_leaves():
    automaton = gears(maneuvers=(stop("left", "back"), stop("back left", "ahead", price=3.0)))
    known = transitions_of(automaton, np.array([1.0, 3.0]))
    assert known.chain(0, 3) == ((SWITCH, 1), (0, 2), (SWITCH, 3))
    assert known.chain(1, 2) == ((0, 2),)
    assert known.chain(2, 1) == ((SWITCH, 3), (1, 0), (SWITCH, 1))
    a, b = known.class_of[0], known.class_of[2]
    assert known.cost[a, b] == 1.0
    assert known.time[b, a] == 3.0
    assert known.displacement[a, b].tolist() == [0.2, 0.1, 0.5, 0.0]


def test_where_no_maneuver_leads_there_is_no_chain():
    known = transitions_of(gears(maneuvers=(stop("left", "back"),)), np.ones(1))
    with pytest.raises(ValueError) as error:
        known.chain(2, 0)
    assert str(error.value) == "no maneuvers lead from trim 2 to trim 0"
    assert known.cost[known.class_of[2], known.class_of[0]] == np.inf


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


def test_of_equally_cheap_chains_the_one_that_is_followed_is_the_one_that_is_composed():
    """From the middle of a chain, and from its begin, others of the same cost might be cheapest."""
    rng = np.random.default_rng(3)
    kinds = range(14)
    trims = tuple(
        Trim(name=f"{k}", body_velocity=[1.0 + k, 0, 0], control=[0, 0], reduced_state=[float(k)])
        for k in kinds
    )
    pairs = [pair for pair in itertools.permutations(kinds, 2) if rng.random() < 0.25]
    prices = rng.integers(1, 4, len(pairs)) * 0.1
    moves = rng.uniform(-1.0, 1.0, (len(pairs), 3))
    maneuvers = tuple(
        Maneuver(name=f"{a}-{b}", source=f"{a}", target=f"{b}", displacement=move, duration=price)
        for (a, b), price, move in zip(pairs, prices, moves, strict=True)
    )
    known = transitions_of(Automaton(model_of_kinds(), trims, maneuvers), prices)
    for a, b in pairs_of(kinds, known):
        chain = [maneuver for maneuver, _ in known.chain(a, b)]
        pose = functools.reduce(operator.matmul, [SE2(moves[k]) for k in chain])
        at = (known.class_of[a], known.class_of[b])
        assert known.cost[at] == pytest.approx(prices[chain].sum())
        np.testing.assert_allclose(known.displacement[at][:3], pose.pose, atol=1e-12)


def pairs_of(kinds, known):
    """Trims between which a chain leads."""
    linked_pairs = [
        (a, b)
        for a, b in itertools.permutations(kinds, 2)
        if np.isfinite(known.cost[known.class_of[a], known.class_of[b]])
    ]
    assert len(linked_pairs) > 100
    return linked_pairs
