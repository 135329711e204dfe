"""Fields that the tests cover, and who does."""

from __future__ import annotations

import functools

import maneuver_automaton as ma

CAR = ma.Car(wheelbase=2.0, max_steering=0.6)
FORWARDS = {"ahead": (2.0, 0.0), "left": (2.0, 0.6), "right": (2.0, -0.6)}
BACKWARDS = {"back": (-1.0, 0.0), "back left": (-1.0, 0.6), "back right": (-1.0, -0.6)}
BODY = ma.Box([3.5, 1.8], [1.0, 0.0])
OBLONG = [[0, 0], [40, 0], [40, 34], [0, 34]]
POND = ma.Polygon(
    [[0, 0], [48, 0], [56, 30], [20, 40], [-4, 26]], [[[22, 17], [28, 17], [28, 22], [22, 22]]]
)


@functools.cache
def tractor(*, backs: bool = False) -> ma.Planner:
    """A car that may back."""
    trims = FORWARDS | (BACKWARDS if backs else {})
    search = ma.SearchSettings(improve=False, max_expansions=20000)
    return ma.Planner(ma.Automaton.of_controls(CAR, trims), footprint=BODY, search=search)


@functools.cache
def oblong() -> ma.FieldResult:
    """Four swaths of an oblong, with a headland that takes turns forwards."""
    return ma.cover(ma.FieldProblem(tractor(), OBLONG, width=3.0, headland=12.0), time_limit=10.0)


@functools.cache
def pond() -> ma.FieldResult:
    """A field with five corners and a pond in it."""
    field = ma.FieldProblem(tractor(backs=True), POND, width=4.0)
    return ma.cover(field, time_limit=10.0)
