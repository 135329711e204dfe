"""The libraries that come with the package: there, small, connected, exact."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.automaton.library import stock_libraries
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.primitives.connecting import maneuver_defect
from tests.reference_dynamics import trim_defect

LEAST = {  # trims, maneuvers
    "articulated_vehicle": (15, 40),
    "car_with_trailer": (20, 80),
    "helicopter": (20, 250),
    "hovercraft": (20, 150),
    "second_order_car": (40, 300),
    "second_order_unicycle": (25, 300),
    "single_track": (20, 200),
    "tractor_with_three_trailers": (11, 40),
    "tractor_with_trailers": (11, 40),
}
MOST_BYTES = 350_000
SAMPLED = 12  # maneuvers of each that are driven again; all of them in benchmarks


def test_there_is_one_for_every_stock_vehicle():
    assert stock_libraries() == tuple(LEAST)


@pytest.mark.parametrize("name", LEAST)
def test_a_stock_library(name):
    automaton = ma.load_stock_library(name)
    model = automaton.model
    assert automaton.name == name
    assert model.name == name.replace("three_", "")
    trims, maneuvers = LEAST[name]
    assert len(automaton) >= trims
    assert len(automaton.maneuvers) >= maneuvers
    report = validate(automaton)
    assert report.connected
    assert report.controllable
    assert automaton.rest is not None or name == "single_track"
    file = resources.files("maneuver_automaton") / "libraries" / f"{name}.json"
    assert len(file.read_bytes()) <= MOST_BYTES
    for trim in automaton.trims[:: max(1, trims // 5)]:
        assert trim_defect(model, trim) < 1e-8
    rng = np.random.default_rng(0)
    for k in rng.choice(len(automaton.maneuvers), SAMPLED, replace=False):
        one = automaton.maneuvers[k]
        source, target = automaton[one.source], automaton[one.target]
        assert maneuver_defect(model, one, source=source, target=target) < 1e-6


def test_one_that_there_is_not():
    with pytest.raises(InvalidLibrary) as error:
        ma.load_stock_library("hoovercraft")
    assert str(error.value) == (
        f"no stock library 'hoovercraft' among {', '.join(LEAST)}; did you mean 'hovercraft'?"
    )
