"""Prices of places in polishing: a convex model of them about the last answer, written anew.

Of a rate numbers alone are known. It is looked at beside the way as far as the next answer may be
from there, so that the ridge between two walls and the border of an area are seen. The price of a
way is a sum over its nodes and looks between: the model has its slope in all that moves, and curves
as the rates do, but not along the way: a node that slides changes no price. Rates times symbols for
the way were tried: they are not convex, and take the solver ten times as many iterations.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control.blocks import Kind, kind_of
from maneuver_automaton.optimal_control.ipopt import load_casadi
from maneuver_automaton.optimal_control.problem import resampled
from maneuver_automaton.optimal_control.scene import PlacesAt, Point, settled

MOST_LOOKS = 1 << 14  # at rates along a motion


class PlaceTerm(NamedTuple):
    """The model about a point of n nodes."""

    about: Array  # (n, dof) its poses
    slope: Array  # (n, dof) of the price
    along: Array  # (n,) [rad] direction of the way
    curve: Array  # (n, dof) along the way, across it, and of the other coordinates
    rates: Array  # (n - 1,) per second of each interval

    @property
    def given(self) -> Array:
        """Parameters of the blocks: of nodes one after the other, then of intervals."""
        nodes = np.column_stack([self.about, self.slope, self.along, self.curve])
        return np.concatenate([nodes.ravel(), self.rates])

    def price(self, point: Point) -> float:
        """What the model adds to the objective at another point: the price but for a constant."""
        by = point.state[:, : self.about.shape[1]] - self.about
        bent = (self.curve * _turned(by, -self.along) ** 2).sum()
        return float((self.slope * by).sum() + bent + self.rates @ point.durations)


def place_term(places: PlacesAt, point: Point, dof: int, *, beside: float) -> PlaceTerm:
    """The model about a point, of rates so far `beside` it [m]."""
    fine, parts = _with_looks(places, point, dof)
    pose, steps = fine.state[:, :dof], _steps(fine, dof)
    lengths = np.sqrt((steps * steps).sum(axis=1))
    ahead = np.divide(steps, lengths[:, None], out=np.zeros_like(steps), where=lengths[:, None] > 0)
    x, y = _at_nodes(steps)[:, :2].T
    along = np.where(np.hypot(x, y) > 0.0, np.arctan2(y, x), pose[:, 2])
    weights = np.column_stack([_at_nodes(lengths), _at_nodes(fine.durations)])  # [m, s]
    here, slopes, curve = _rates(places, fine, pose), np.zeros_like(pose), np.zeros_like(pose)
    for k in range(dof):
        step = np.zeros_like(pose)
        step[:, k] = beside
        step = _turned(step, along)
        more, less = (_rates(places, fine, pose + sign * step) for sign in (1.0, -1.0))
        slopes[:, k] = (weights * (more - less)).sum(axis=1) / (2.0 * beside)
        bends = np.maximum(more + less - 2.0 * here, 0.0) / (2.0 * beside**2)
        curve[:, k] = (weights[:, k == 0 :] * bends[:, k == 0 :]).sum(axis=1)
    slope, middles = _turned(slopes, along), _middles(here)
    slope[1:] += middles[:, :1] * ahead
    slope[:-1] -= middles[:, :1] * ahead
    rates = middles[:, 1].reshape(-1, parts).mean(axis=1)
    moves = resampled(np.eye(len(point.state)), len(pose)).T  # with each node all that is near it
    return PlaceTerm(point.state[:, :dof], moves @ slope, along[::parts], moves @ curve, rates)


def price_of_places(places: PlacesAt, point: Point, dof: int) -> float:
    """What the places of a point cost."""
    fine, _ = _with_looks(places, point, dof)
    steps, rates = _steps(fine, dof), _middles(_rates(places, fine, fine.state[:, :dof]))
    return float(rates[:, 0] @ np.sqrt((steps * steps).sum(axis=1)) + rates[:, 1] @ fine.durations)


def _with_looks(places: PlacesAt, point: Point, dof: int) -> tuple[Point, int]:
    """The point with nodes between its own, so many parts each: at its scale nothing is missed.

    Over the corner of an area that no node is in, the solver would lead the way.
    """
    steps = _steps(point, dof)
    longest = float(np.sqrt((steps * steps).sum(axis=1).max(initial=0.0)))
    parts = min(max(math.ceil(longest / places.scale), 1), MOST_LOOKS // len(steps))
    held = (np.repeat(one, parts, axis=0) for one in (point.control, point.durations / parts))
    return Point(resampled(point.state, parts * len(steps) + 1), *held), parts


def _rates(places: PlacesAt, point: Point, pose: Array) -> Array:
    control = np.vstack([point.control, point.control[-1:]])
    return settled(places.rates(pose, point.state[:, pose.shape[1] :], control))


def _steps(point: Point, dof: int) -> Array:
    """Changes of place (n - 1, dof) [m], without the turn."""
    steps = np.diff(point.state[:, :dof], axis=0)
    steps[:, 2] = 0.0
    return steps


def _turned(vectors: Array, angles: Array) -> Array:
    """Vectors (n, dof), of which x and y are turned by angles (n,) [rad]."""
    (x, y), c, s = vectors[:, :2].T, np.cos(angles), np.sin(angles)
    return np.column_stack([c * x - s * y, s * x + c * y, vectors[:, 2:]])


def _middles(values: Array) -> Array:
    """Means (n - 1, ...) over intervals."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _at_nodes(values: Array) -> Array:
    """Of each node (n, ...) half of what the intervals beside it have."""
    half = np.concatenate([0.5 * values, np.zeros_like(values[:1])])
    half[1:] += 0.5 * values
    return half


@functools.cache
def place_kind(dof: int) -> Kind:
    """One node: its pose; given the model there."""
    casadi = load_casadi()
    pose, about, slope, curve = (casadi.SX.sym(name, dof) for name in ("x", "at", "slope", "curve"))
    angle = casadi.SX.sym("along")
    by = pose - about
    c, s = casadi.cos(angle), casadi.sin(angle)
    turned = casadi.vertcat(c * by[0] + s * by[1], c * by[1] - s * by[0], by[2:])
    price = casadi.dot(slope, by) + casadi.dot(curve, turned**2)
    return kind_of(casadi, pose, casadi.vertcat(about, slope, angle, curve), price=price)


@functools.cache
def second_kind(paced: bool, intervals: int) -> Kind:
    """One interval: its pace, if it has one, and the duration; given the rate per second."""
    casadi = load_casadi()
    every, rate = casadi.SX.sym("T", 1 + int(paced)), casadi.SX.sym("rate")
    lasting: Any = every[-1] / intervals * (every[0] if paced else 1.0)
    return kind_of(casadi, every, rate, price=rate * lasting)
