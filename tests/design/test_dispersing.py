"""Libraries with fewer maneuvers: against all choices, and what always holds."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.design import disperse_library
from maneuver_automaton.design.dispersing import _distances
from maneuver_automaton.primitives import Maneuver

CAR = ma.load_stock_library("second_order_car")


def small(n, seed):
    """A unicycle with inertia that hops from rest to rest, to n random poses."""
    rng = np.random.default_rng(seed)
    robots = ma.load_stock_library("second_order_unicycle")
    rest = robots.trims[robots.rest]
    hops = [
        Maneuver(
            name=f"hop {k}", source=rest.name, target=rest.name, displacement=end, duration=1.0
        )
        for k, end in enumerate(rng.uniform([-2.0, -2.0, -3.0], [2.0, 2.0, 3.0], size=(n, 3)))
    ]
    return ma.Automaton(robots.model, (rest,), tuple(hops))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_no_choice_is_better_than_the_bound_nor_twice_as_good(seed, most):
    library = small(9, seed)
    done = disperse_library(library, most=most)
    sources = [library.index_of(one.source) for one in library.maneuvers]
    apart = _distances(library, library.trim_classes[sources], None)
    best = min(apart[:, list(some)].min(axis=1).max() for some in combinations(range(9), most))
    assert done.at_least <= best + 1e-12
    assert best <= done.dispersion <= 2.0 * best + 1e-12


def test_by_hand():
    # ends at 0, 1, 2, 3, 10 m straight ahead: first the one at 0, then that at 10, then that at 3
    rest = small(1, 0).trims[0]
    hops = tuple(
        Maneuver(name=f"{x} m", source=rest.name, target=rest.name,
                 displacement=[x, 0.0, 0.0], duration=1.0 + x)
        for x in (0.0, 1.0, 2.0, 3.0, 10.0)
    )  # fmt: skip
    library = ma.Automaton(small(1, 0).model, (rest,), hops)
    done = disperse_library(library, most=3)
    assert done.by_size == ((1, 10.0), (2, 3.0), (3, 1.0))
    assert (done.dispersion, done.at_least) == (1.0, 0.5)


def test_what_is_left_stays_connected_and_is_part_of_the_library():
    done = disperse_library(CAR, most=120)
    whole, left = validate(CAR), validate(done.automaton)
    assert left.connected == whole.connected
    assert left.dead_ends == whole.dead_ends
    assert len(done.automaton.maneuvers) == 120
    assert {id(one) for one in done.automaton.maneuvers} <= {id(one) for one in CAR.maneuvers}
    assert done.automaton.trims == CAR.trims


def test_more_maneuvers_are_never_farther():
    done = disperse_library(CAR, most=len(CAR.maneuvers))
    distances = [distance for _, distance in done.by_size]
    assert distances == sorted(distances, reverse=True)
    assert (done.dispersion, done.at_least) == (0.0, 0.0)
    again = disperse_library(CAR, most=200)
    assert dict(again.by_size).items() <= dict(done.by_size).items()


def test_the_order_of_maneuvers_decides_ties_only():
    turned = replace(CAR, maneuvers=CAR.maneuvers[::-1])
    one, other = (disperse_library(library, most=300) for library in (CAR, turned))
    assert one.dispersion == pytest.approx(other.dispersion, rel=0.2)


def test_what_cannot_be_dispersed_is_said():
    with pytest.raises(ValueError, match="the library has no maneuvers"):
        disperse_library(ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1, 0)}), most=3)
    with pytest.raises(ValueError, match="3 maneuvers cannot lead from rest to every trim"):
        disperse_library(CAR, most=3)
    with pytest.raises(ValueError, match="metres_per_radian must be positive, got -1"):
        disperse_library(CAR, most=200, metres_per_radian=-1.0)
