"""A cost and a model of a user's own: through planning, bounds, loop, fleet and polishing.

What they say of themselves by their methods they get, as built-in ones do; what they do not say is
told in one line, with the method that would say it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.planning.polished_price import polished_price
from maneuver_automaton.planning.polishing import NO_TERMS
from maneuver_automaton.refinement.retiming import retime
from maneuver_automaton.refinement.shooting import least_effort
from tests.search.cases import compiled_only

pytestmark = compiled_only


@dataclass(frozen=True)
class Plain:
    """A user's cost: only rates and switches."""

    def rates(self, controls, body_velocities):
        return 1.0 + np.linalg.norm(body_velocities[..., :2], axis=-1)

    def switching(self, body_velocities):
        return 0.1 * max(len(body_velocities) - 1, 0)


class Stated(Plain):
    """The same, which says what it is the sum of."""

    def terms(self):
        return BUILT_IN


BUILT_IN = ma.Cost(time=1.0, length=1.0, switch=0.1)
COSTS = {"built in": BUILT_IN, "stated": Stated(), "plain": Plain()}
CAR = ma.UserModel(
    name="cart",
    group=ma.SE2,
    control_names=("speed", "turn rate"),
    reduced_names=(),
    velocity=lambda z, u: [u[0], 0.0, u[1]],
    dynamics=lambda z, u: [],
)
TRIMS = {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1), "back": (-1, 0)}
CART = ma.Automaton.of_controls(CAR, TRIMS)
WALL = ma.Box([0.4, 2.0], [2.0, 0.6])
COUNTED = ma.SearchSettings(max_expansions=2000)


def problem(cost, **changes):
    values = {"obstacles": WALL, "footprint": ma.Box([0.4, 0.2]), "search": COUNTED} | changes
    return ma.Problem(CART, [0, 0, 0], [4, 0, 0], cost=cost, **values)


def test_plans_cost_what_those_of_the_built_in_cost_do():
    costs = {name: ma.plan(problem(cost), time_limit=60.0).cost for name, cost in COSTS.items()}
    assert costs["stated"] == costs["built in"]
    assert costs["plain"] == pytest.approx(costs["built in"], rel=0.02)  # switches are unseen


def test_words_do():
    free = {"obstacles": (), "search": ma.SearchSettings(), "horizon": ma.Horizon(max_trims=3)}
    asked = {name: ma.plan(problem(cost, **free)) for name, cost in COSTS.items()}
    assert len({round(one.cost, 9) for one in asked.values()}) == 1
    assert asked["stated"].bound.kind == asked["built in"].bound.kind == "exhaustive"


class Scalar(Plain):
    def rates(self, controls, body_velocities):
        return 1.0


class Negative(Plain):
    def rates(self, controls, body_velocities):
        return -body_velocities[:, 0]


class Unhashed(Plain):
    __hash__ = None


@pytest.mark.parametrize(
    ("cost", "said"),
    [
        (5.0, "cost: float has no method rates, need rates and switching"),
        (Unhashed(), "cost: Unhashed has no hash; need a value that does not change"),
        (Scalar(), "cost: the rates of 5 trims have shape (), need (5,)"),
        (Negative(), "cost: trim 'ahead' costs -1 per second, need a number of at least 0"),
    ],
)
def test_what_is_no_cost_is_told_where_it_is_given(cost, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        problem(cost)


class Rover:
    """No `UserModel`, and little of what one has."""

    name, control_names, velocity = (
        "rover",
        ("speed", "turn rate"),
        lambda self, z, u: [u[0], 0, u[1]],
    )


def test_what_is_no_model_is_told_where_it_is_given():
    said = "^Rover is no model: it has no group, reduced_names, .*; need a maneuver_automaton.User"
    doors = (
        lambda: ma.Automaton.of_controls(Rover(), TRIMS),
        lambda: ma.Automaton.of_grid(Rover(), [[0, 1], [0]]),
        lambda: ma.Automaton.of_model(Rover(), {"speed": [0.0]}),
        lambda: ma.Automaton(Rover(), CART.trims),
    )
    for door in doors:
        with pytest.raises(ValueError, match=said):
            door()


def test_what_asks_for_terms_says_so():
    plan = ma.Plan([0, 0, 0], (CART["ahead"],), durations=[1.0])
    for asks in (retime, least_effort):
        with pytest.raises(ValueError, match=r"terms\(\)"):
            asks(plan, ma.Unicycle(), cost=Plain())
    with pytest.raises(ValueError, match="prices of switch"):
        ma.design_library(CART, cost=Plain())


@pytest.mark.slow
def test_bounds_hold_for_every_cost():
    aside = replace(problem(BUILT_IN, obstacles=()), goals=ma.Goal([0.0, 1.5, 0.0]))
    cheapest = ma.plan(aside, time_limit=60.0).cost
    work = {"incumbent": cheapest, "max_work": 4_000_000, "time_limit": 60.0}
    bounds = {
        name: ma.lower_bound(replace(aside, cost=cost), **work) for name, cost in COSTS.items()
    }
    assert {one.kind for one in bounds.values()} == {"shortest"}
    assert bounds["stated"].value == bounds["built in"].value
    assert 0.5 * cheapest < bounds["plain"].value <= cheapest


@pytest.mark.parametrize("name", COSTS)
def test_a_loop_drives_at_it(name):
    loop = ma.RecedingHorizon(problem(COSTS[name]), step=0.5, time_limit=1.0)
    _, log = loop.step(np.zeros(3))
    assert 4.0 < log.value < 12.0


@pytest.mark.parametrize("name", COSTS)
def test_a_fleet_does(name):
    one = problem(COSTS[name], obstacles=())
    other = replace(one, start=[4.0, 1.0, np.pi], goals=ma.Goal([0.0, 1.0, np.pi]))
    result = ma.plan_fleet(ma.FleetProblem((one, other)), time_limit=5.0)
    assert all(one.plan is not None for one in result.results.values())


def cart_with_inertia(cost, **changes):
    model = ma.UserModel(
        name="sled",
        group=ma.SE2,
        control_names=("push", "turn rate"),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, u[1]],
        dynamics=lambda z, u: [u[0]],
        control_limits=[[-1, 1], [-1, 1]],
        reduced_limits=[[-1, 1]],
    )
    rests = ma.trims_of(model, {"speed": [0.0, 1.0], "turn rate": [0.0]}).trims
    automaton = ma.Automaton(model, rests)
    return ma.Problem(automaton, [0, 0, 0], [3, 0, 0], cost=cost, search=COUNTED, **changes)


@pytest.mark.parametrize("name", COSTS)
def test_a_vehicle_with_inertia_is_polished_at_it_or_told_what_is_missing(name):
    pytest.importorskip("casadi")
    one = cart_with_inertia(COSTS[name])
    price = polished_price(one).cost
    assert (price.time, price.length) == ((1.0, 1.0) if name != "plain" else (1.0, 0.0))
    said = any(NO_TERMS in note for note in ma.plan(one, time_limit=5.0).notes)
    assert said == (name == "plain")
