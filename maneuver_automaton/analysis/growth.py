"""Growth bounds of the value of a fixed horizon, from words of turns on the spot and straights.

Also the unit cost of a trim: what coasting costs per second, the same at every instant.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_whole, freeze, vector_text, wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import BrokenSymmetry, InvalidAutomaton, NotATrim
from maneuver_automaton.models import Model

NODES = 5  # of the Gauss-Legendre rule on a segment: exact for polynomials of degree 9
HEADINGS = np.pi / 2 * 2.0 ** (-0.5 * np.arange(11))  # [rad] tried for the first drive


class _PoseCost(Protocol):
    """A stage cost of the pose seen from the goal plus one of the control."""

    @property
    def pose_weights(self) -> Array: ...
    @property
    def pose_orders(self) -> Array: ...
    def pose_rates(self, poses: ArrayLike) -> Array: ...
    def control_rates(self, controls: ArrayLike) -> Array: ...


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GrowthBound:
    """``V_t(x) <= B(t) least_rate(x)`` at the poses that were tried, and nowhere proven between.

    Examples
    --------
    >>> GrowthBound(times=[1.0, 2.0], bounds=[1.0, 1.5], worst=[[0, 1, 0], [0, 1, 0]], samples=2)
    GrowthBound(B(2 s) = 1.5 s, sampled at 2 poses)
    """

    times: Array  # (n,) rising [s]
    bounds: Array  # (n,) B [s], rises
    worst: Array  # (n, 3) pose seen from the goal that asks for it
    samples: int  # poses tried

    def __post_init__(self) -> None:
        for name in ("times", "bounds"):
            freeze(self, name)
        freeze(self, "worst", last=3)
        t, b = self.times, self.bounds
        if t.ndim != 1 or t.shape != b.shape or (np.diff(t) <= 0.0).any() or not t[0] > 0.0:
            raise ValueError("times: need one axis of rising positive times, with one growth each")
        if not (b > 0.0).all() or (np.diff(b) < 0.0).any():
            raise ValueError(f"growth: got {b.tolist()}, need positive numbers that rise")

    def __repr__(self) -> str:
        last = f"B({self.times[-1]:.6g} s) = {self.bounds[-1]:.6g} s"
        return f"GrowthBound({last}, sampled at {self.samples} poses)"


def ring_poses(cost: _PoseCost, *, levels: ArrayLike, parts: int = 4) -> Array:
    """Poses (n, 3) seen from the goal that cost `levels` per second, shared among x, y, heading.

    With exponents (4, 2, 4) the poses of one level are those of another, x and heading multiplied
    by s and y by s^2: near the goal, where the unicycle drives like its homogeneous approximation,
    one octave of s stands for all, if speeds and turn rates scale with it.

    Parameters
    ----------
    cost : MixedOrderCost, or alike
        The stage cost, of the pose seen from the goal plus one of the control.
    levels : (k,) array_like
        Positive costs per second.
    parts : int
        Each share is a multiple of 1 / parts; all signs are taken.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> squares = SimpleNamespace(pose_weights=np.ones(3), pose_orders=np.full(3, 2.0))
    >>> ring_poses(squares, levels=[4.0], parts=1).tolist()[:3]
    [[0.0, 0.0, -2.0], [0.0, 0.0, 2.0], [0.0, -2.0, 0.0]]
    """
    rates = as_array("levels", levels)
    parts = as_whole("parts", parts)
    if rates.ndim != 1 or not (rates > 0.0).all() or parts < 1:
        raise ValueError(f"levels: got {rates.tolist()} in {parts} parts, need positive numbers")
    shares = [s for s in itertools.product(range(parts + 1), repeat=3) if sum(s) == parts]
    sizes = np.multiply.outer(rates, np.array(shares) / parts) / cost.pose_weights
    magnitudes = (sizes ** (1.0 / cost.pose_orders)).reshape(-1, 3)
    magnitudes[:, 2] = np.minimum(magnitudes[:, 2], np.pi)  # what is beyond costs less
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    every: Array = (magnitudes[:, None] * signs).reshape(-1, 3) + 0.0  # no negative zero
    _, first = np.unique(every, axis=0, return_index=True)
    return every[np.sort(first)]


def growth_bound(
    automaton: Automaton, cost: _PoseCost, *, poses: ArrayLike, times: ArrayLike
) -> GrowthBound:
    """B(t) from words turn, move, turn, move: the best of a family at each pose, the worst pose.

    The robot turns to a heading, drives until the goal lies ahead or behind, turns to the heading
    of the goal, drives there and rests. The family is: the headings ``HEADINGS`` to both sides, the
    two along the line to the goal (turn, move, turn), the one it has; one spin rate and one speed
    of the library in each word, of either sign; and rest, all the time. All coasting times are
    free, so B bounds the value over words with free switching times. Exact but for rounding where
    the exponents are even, up to 8.

    Source: the idea, Worthmann et al. (2016), *Model predictive control of nonholonomic mobile
    robots without stabilizing constraints and costs*; the family of words is ours.

    Parameters
    ----------
    automaton : Automaton
        A library of the plane with rest, straights and spins of both signs.
    cost : MixedOrderCost, or alike
        The stage cost, of the pose seen from the goal plus one of the control.
    poses : (n, 3) array_like
        Poses seen from the goal at which the bound is taken [m, m, rad]; not the goal itself.
    times : (k,) array_like
        Rising times [s].

    Raises
    ------
    InvalidAutomaton
        If the library lacks a rest, straights or spins of both signs.
    ValueError
        If the times do not rise, or a pose is the goal.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_grid(Unicycle(), [[-1, 0, 1], [-1, 0, 1]])
    >>> distance = SimpleNamespace(
    ...     pose_rates=lambda poses: np.abs(poses).sum(axis=-1),
    ...     control_rates=lambda controls: np.zeros(np.shape(controls)[:-1]),
    ... )
    >>> growth_bound(robot, distance, poses=[[-1, 0, 0]], times=[0.5, 1.0, 2.0]).bounds.tolist()
    [0.375, 0.5, 0.5]
    """
    rows, t = as_array("poses", poses, last=3), as_array("times", times)
    if t.ndim != 1 or not t.size or not t[0] > 0.0 or (np.diff(t) <= 0.0).any():
        raise ValueError(f"times: got {t.tolist()}, need one axis of rising positive times")
    paces = _paces(automaton, cost)
    least = float(cost.control_rates(automaton.controls).min())
    seen = np.concatenate([rows[:, :2], wrapped(rows[:, 2:])], axis=-1).reshape(-1, 3)
    values = np.array([_values(pose, paces, cost, t) for pose in seen])
    rates = cost.pose_rates(seen) + least
    if not (rates > 0.0).all():
        raise ValueError(f"least: got {rates.min()}, need positive costs: leave out the goal")
    ratios = values / rates[:, None]
    worst = np.argmax(ratios, axis=0)
    bounds = np.maximum.accumulate(ratios[worst, np.arange(t.size)])
    return GrowthBound(times=t, bounds=bounds, worst=seen[worst], samples=rates.size)


_Paces = tuple[list[tuple[Array, Array]], float]
"""Speeds (4,) and what they cost per second in both signs (4, 2), pair by pair; what rest costs."""


def _paces(automaton: Automaton, cost: _PoseCost) -> _Paces:
    twists, controls = automaton.body_velocities, automaton.controls
    spins = _both_signs(twists, controls, axis=2)
    straights = _both_signs(twists, controls, axis=0)
    rest = automaton.rest
    lacking = [
        what
        for what, there in (
            ("a rest", rest is not None),
            ("spins to both sides", spins),
            ("straights ahead and back", straights),
        )
        if not there
    ]
    if lacking or rest is None:
        raise InvalidAutomaton(f"growth bound: the library lacks {', '.join(lacking)}")
    pairs = [
        (np.array([spin, speed] * 2), cost.control_rates(np.array([right_left, back_ahead] * 2)))
        for (spin, right_left), (speed, back_ahead) in itertools.product(spins, straights)
    ]
    return pairs, float(cost.control_rates(controls[rest]))


def _both_signs(
    twists: Array, controls: Array, *, axis: int
) -> Sequence[tuple[float, tuple[Array, Array]]]:
    """Sizes of the twists along one axis alone that come in both signs, with their controls."""
    alone = (np.delete(twists, axis, axis=1) == 0.0).all(axis=1)
    row = {float(twists[k, axis]): controls[k] for k in np.flatnonzero(alone)}
    return [(size, (row[-size], row[size])) for size in sorted(row) if size > 0.0 and -size in row]


def _values(pose: Array, paces: _Paces, cost: _PoseCost, times: Array) -> Array:
    """Least cost (k,) of the family from a pose over each of the times."""
    segments, (pairs, rest_rate) = _segments(pose), paces
    least: Array = times * (cost.pose_rates(pose) + rest_rate)
    for pace, control in pairs:
        words = _word_costs(segments, pace, control, cost, times)
        driven = np.minimum(times[:, None], (np.abs(segments[2]) / pace).sum(axis=-1))
        totals = words + rest_rate * (times[:, None] - driven)
        least = np.minimum(least, totals.min(axis=1))
    return least


def _word_costs(
    segments: tuple[Array, Array, Array], pace: Array, control: Array, cost: _PoseCost, times: Array
) -> Array:
    """Costs (k, f) of words with speeds (4,) over each of the times, without rest."""
    starts, directions, lengths = segments
    durations, signed = np.abs(lengths) / pace, np.sign(lengths) * pace
    begins = np.cumsum(durations, axis=-1) - durations
    driving = np.where(lengths > 0.0, control[:, 1], control[:, 0])
    spent = np.clip(times[:, None, None] - begins, 0.0, durations)  # (k, f, 4)
    points, weights = np.polynomial.legendre.leggauss(NODES)
    gone = spent[..., None] * signed[..., None] * (0.5 * (points + 1.0))
    poses = starts[..., None, :] + gone[..., None] * directions[..., None, :]
    words: Array = ((cost.pose_rates(poses) @ (0.5 * weights) + driving) * spent).sum(axis=-1)
    return words


def _segments(pose: Array) -> tuple[Array, Array, Array]:
    """Turn, move, turn, move to the goal: starts and directions (f, 4, 3), lengths (f, 4)."""
    x, y, heading = pose
    ahead = np.arctan2(-y, -x)
    line = wrapped(np.array([ahead, ahead + np.pi]))
    first = np.concatenate([HEADINGS, -HEADINGS, line, [heading]])
    if y != 0.0:
        first = first[np.sin(first) != 0.0]
    on_line, zero = np.isin(first, line), np.zeros_like(first)
    sideways = -y / np.sin(first) if y != 0.0 else zero
    along = np.where(on_line, np.hypot(x, y) * np.cos(first - ahead), sideways)
    back = np.where(on_line, 0.0, -(x + along * np.cos(first)))
    lengths = np.stack([first - heading, along, -first, back], axis=-1)
    here = (zero + x, zero + y)
    there = (x + along * np.cos(first), y + along * np.sin(first))
    starts = [(*here, zero + heading), (*here, first), (*there, first), (*there, zero)]
    turn = (zero, zero, zero + 1.0)
    directions = [turn, (np.cos(first), np.sin(first), zero), turn, (zero + 1.0, zero, zero)]
    return np.moveaxis(np.array(starts), -1, 0), np.moveaxis(np.array(directions), -1, 0), lengths


def unit_cost(
    stage_cost: Callable[[Array, Array], ArrayLike],
    model: Model,
    *,
    state: ArrayLike,
    control: ArrayLike,
    duration: float = 10.0,
    tolerance: float = 1e-9,
) -> float:
    """Cost per second of the trim that starts at `state` under a constant control.

    An invariant cost is constant along a trim, so coasting for T seconds costs T times this. That
    the cost is constant is checked at 101 instants.

    Source: the paper, Prop. 9.

    Parameters
    ----------
    stage_cost : callable
        ``l(x, u)`` of one state (n_x,), pose first, and one control (n_u,).
    model : Model
        The vehicle.
    state : (n_x,) array
        Pose and reduced state where the trim starts.
    control : (n_u,) array
        Its control, in the model's units.
    duration : float
        How long the trim is followed for the check [s].
    tolerance : float
        Greatest rate of the reduced state and greatest change of the cost admitted, the latter
        relative to the cost (at least 1) [-].

    Returns
    -------
    float
        The cost per second, ``l(x(0), u)``.

    Raises
    ------
    NotATrim
        If the reduced state does not stay where it is.
    BrokenSymmetry
        If the cost changes along the trim.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> unit_cost(lambda x, u: u @ u, Unicycle(), state=np.zeros(3), control=[1.5, 0.5])
    2.5
    """
    dof, n_controls = model.group.dof, len(model.control_names)
    x = as_array("state", state, last=dof + len(model.reduced_names))
    u = as_array("control", control, last=n_controls)
    rates = model.reduced_dynamics(x[dof:], u)
    if np.any(np.abs(rates) > tolerance):
        worst = int(np.argmax(np.abs(rates)))
        raise NotATrim(
            f"{model.name}: no trim at u = {vector_text(u)}: {model.reduced_names[worst]} changes "
            f"by {rates[worst]:.4g} per second, need 0"
        )
    times = np.linspace(0.0, duration, 101)
    twist = model.body_velocity(x[dof:], u)
    poses = (model.group(x[:dof]) @ model.group.exp(np.multiply.outer(times, twist))).pose
    costs = np.array([float(np.asarray(stage_cost(np.append(p, x[dof:]), u))) for p in poses])
    change = np.abs(costs - costs[0])
    if change.max() > tolerance * max(1.0, abs(costs[0])):
        worst = int(np.argmax(change))
        raise BrokenSymmetry(
            f"stage cost is not constant along the trim u = {vector_text(u)} of the {model.name}: "
            f"{costs[0]:.4g} at the start, {costs[worst]:.4g} after {times[worst]:.4g} s at pose "
            f"{vector_text(poses[worst])}; it depends on the pose, so the trim has no unit cost"
        )
    return float(costs[0])
