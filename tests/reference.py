"""Slow, obvious twins of the kernels: matrix exponentials, differences, SLSQP from many starts."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.optimize import least_squares, minimize

from maneuver_automaton._arrays import Array, wrapped

TIE = 1e-5  # [s] times closer than this are the same solution


def hat(twist: ArrayLike) -> Array:
    """Homogeneous generator of a twist: (3, 3) in the plane, (4, 4) with altitude."""
    v = np.asarray(twist, dtype=np.float64)
    if v.size == 3:
        return np.array([[0.0, -v[2], v[0]], [v[2], 0.0, v[1]], [0.0, 0.0, 0.0]])
    generator = np.zeros((4, 4))
    generator[0, 1], generator[1, 0] = -v[2], v[2]
    generator[:3, 3] = v[0], v[1], v[3]
    return generator


def matrix_of(pose: ArrayLike) -> Array:
    """Homogeneous matrix of a pose (x, y, heading(, z))."""
    g = np.asarray(pose, dtype=np.float64)
    c, s = np.cos(g[2]), np.sin(g[2])
    if g.size == 3:
        return np.array([[c, -s, g[0]], [s, c, g[1]], [0.0, 0.0, 1.0]])
    matrix = np.eye(4)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:3, 3] = g[0], g[1], g[3]
    return matrix


def word_end(twists: ArrayLike, times: ArrayLike, displacements: ArrayLike | None = None) -> Array:
    """End (dof,) of a word by matrix exponentials, its heading in [-pi, pi]."""
    rows = np.asarray(twists, dtype=np.float64)
    moves = np.zeros_like(rows) if displacements is None else np.array(displacements, float)
    matrix = np.eye(rows.shape[1] if rows.shape[1] == 3 else 4)
    for i, time in enumerate(np.asarray(times, dtype=np.float64)):
        matrix = matrix @ expm(time * hat(rows[i]))
        if i < len(moves):
            matrix = matrix @ matrix_of(moves[i])
    heading = np.arctan2(matrix[1, 0], matrix[0, 0])
    return np.array([matrix[0, -1], matrix[1, -1], heading, *matrix[2:-1, -1]])


def off_goal(end: ArrayLike, goal: ArrayLike) -> Array:
    """End minus goal, the heading modulo a full turn."""
    off = np.asarray(end, dtype=np.float64) - np.asarray(goal, dtype=np.float64)
    off[2] = wrapped(off[2])
    return off


def plain_end(twists: ArrayLike, times: ArrayLike, displacements: ArrayLike | None = None) -> Array:
    """`word_end` in complex numbers, heading not wrapped: quick enough for differences."""
    rows = np.asarray(twists, dtype=np.float64)
    moves = np.zeros_like(rows) if displacements is None else np.array(displacements, float)
    place, heading, altitude = 0j, 0.0, 0.0
    for i, time in enumerate(np.asarray(times, dtype=np.float64)):
        half = 0.5 * rows[i, 2] * time
        step = complex(rows[i, 0], rows[i, 1]) * time * np.sinc(half / np.pi)
        place += step * np.exp(1j * (heading + half))
        heading += 2.0 * half
        altitude += rows[i, 3] * time if rows.shape[1] == 4 else 0.0
        if i < len(moves):
            place += complex(moves[i, 0], moves[i, 1]) * np.exp(1j * heading)
            heading += moves[i, 2]
            altitude += moves[i, 3] if moves.shape[1] == 4 else 0.0
    return np.array([place.real, place.imag, heading, altitude])[: rows.shape[1]]


def jacobian(
    twists: ArrayLike,
    times: ArrayLike,
    displacements: ArrayLike | None = None,
    *,
    step: float = 1e-5,
) -> Array:
    """Derivatives (dof, n) of the end by the times, by central differences."""
    t = np.asarray(times, dtype=np.float64)
    columns = []
    for shift in step * np.eye(t.size):
        later = plain_end(twists, t + shift, displacements)
        earlier = plain_end(twists, t - shift, displacements)
        columns.append((later - earlier) / (2.0 * step))
    return np.array(columns).T


def hessian(
    twists: ArrayLike, times: ArrayLike, price: ArrayLike, displacements: ArrayLike | None = None
) -> Array:
    """Second derivatives (n, n) of ``price . end`` by the times, by differences of differences."""
    t = np.asarray(times, dtype=np.float64)
    p, step = np.asarray(price, dtype=np.float64), 1e-4
    rows = []
    for shift in step * np.eye(t.size):
        later = jacobian(twists, t + shift, displacements, step=step)
        earlier = jacobian(twists, t - shift, displacements, step=step)
        rows.append(p @ (later - earlier) / (2.0 * step))
    return np.array(rows)


@dataclass(frozen=True, slots=True, eq=False)
class Word:
    """A word whose best times are asked for: complex numbers, one line per formula."""

    twists: Array  # (n, 3) or (n, 4)
    rates: Array  # (n,)
    goal: Array  # (dof,)
    total: float | None = None  # [s] the times add up to
    at_most: float | None = None  # [s] they add up to at most

    def conditions(self, times: Array) -> tuple[Array, Array]:
        """End minus goal (and the total), with its derivatives by the times."""
        velocity = self.twists[:, 0] + 1j * self.twists[:, 1]
        rate = self.twists[:, 2]
        headings = np.concatenate([[0.0], np.cumsum(rate * times)])
        half = 0.5 * rate * times
        steps = velocity * times * np.sinc(half / np.pi) * np.exp(1j * (headings[:-1] + half))
        places = np.cumsum(steps)
        # a longer trim moves its own end on, and turns what follows about it
        slopes = velocity * np.exp(1j * headings[1:]) + 1j * rate * (places[-1] - places)
        rows = [slopes.real, slopes.imag, rate]
        off = [places[-1].real, places[-1].imag, headings[-1]] - self.goal[:3]
        off[2] = wrapped(off[2])
        if self.twists.shape[1] == 4:
            rows.append(self.twists[:, 3])
            off = np.append(off, self.twists[:, 3] @ times - self.goal[3])
        if self.total is not None:
            rows.append(np.ones(times.size))
            off = np.append(off, times.sum() - self.total)
        return off, np.array(rows)

    def slsqp(self, start: Array) -> Array | None:
        """Times (n,) where SLSQP ends that starts at `start`; None where it does not converge."""
        constraints = [
            {
                "type": "eq",
                "fun": lambda t: self.conditions(t)[0],
                "jac": lambda t: self.conditions(t)[1],
            }
        ]
        if self.at_most is not None:
            limit = self.at_most
            constraints.append(
                {
                    "type": "ineq",
                    "fun": lambda t: np.array([limit - t.sum()]),
                    "jac": lambda t: -np.ones((1, t.size)),
                }
            )
        solved = minimize(
            lambda t: self.rates @ t,
            start,
            jac=lambda t: self.rates,
            bounds=[(0.0, None)] * start.size,
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": 60, "ftol": 1e-13},
        )
        times = np.maximum(solved.x, 0.0)
        late = self.at_most is not None and times.sum() > self.at_most + 1e-7
        if late or not np.isfinite(times).all() or np.abs(self.conditions(times)[0]).max() > 1e-7:
            return None
        return times

    def cost(self, times: Array) -> float:
        return float(self.rates @ times)

    def is_local_optimum(self, times: Array, rng: np.random.Generator) -> bool:
        """Whether SLSQP, pushed off a little three times, comes back."""
        for _ in range(3):
            pushed = times * (1.0 + 0.01 * rng.standard_normal(times.size))
            back = self.slsqp(pushed)
            if back is None or np.abs(back - times).max() > 1e-3 * (1.0 + times.max()):
                return False
        return True

    def feasible(self, start: Array) -> Array | None:
        """Times near `start` that meet the conditions, by Gauss-Newton; None if it gets nowhere."""
        times = start.copy()
        for _ in range(40):
            off, matrix = self.conditions(times)
            if np.abs(off).max() < 1e-10:
                break
            step = np.linalg.lstsq(matrix, -off, rcond=1e-9)[0]
            times = times + step * min(1.0, 2.0 / (1e-9 + np.abs(step).max()))
        else:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            periods = 2.0 * np.pi / np.abs(self.twists[:, 2])
            turned = np.mod(times, periods)
        times = np.where((times < 0.0) & np.isfinite(periods), turned, times)
        return times if times.min() > -1.0 else None

    def local_optima(self, *, starts: int, longest: float, rng: np.random.Generator) -> list[Array]:
        """Locally optimal positive times, from random starts up to `longest` [s] per trim."""
        found: list[Array] = []
        for _ in range(starts):
            near = self.feasible(rng.uniform(0.0, longest, len(self.rates)))
            times = None if near is None else self.slsqp(np.maximum(near, 0.0))
            if times is None or times.min() < 1e-6:
                continue
            if any(np.abs(times - other).max() < TIE * (1.0 + times.max()) for other in found):
                continue
            if self.is_local_optimum(times, rng):
                found.append(times)
        return found


def words_of(n_trims: int, length: int) -> Iterator[tuple[int, ...]]:
    """Every word without equal neighbours."""
    for word in itertools.product(range(n_trims), repeat=length):
        if all(a != b for a, b in itertools.pairwise(word)):
            yield word


def steering_roots(
    twists: ArrayLike,
    goal: ArrayLike,
    displacements: ArrayLike | None = None,
    *,
    starts: int,
    longest: float,
    rng: np.random.Generator,
) -> list[Array]:
    """Times that meet the goal, by root finding from random starts; turns in [0, one turn)."""
    rows = np.asarray(twists, dtype=np.float64)
    with np.errstate(divide="ignore"):
        periods = 2.0 * np.pi / np.abs(rows[:, 2])
    reach = np.minimum(periods, longest)
    found: list[Array] = []
    for _ in range(starts):
        solved = least_squares(
            lambda t: off_goal(plain_end(rows, t, displacements), goal),
            rng.uniform(0.0, 1.0, len(rows)) * reach,
            jac=lambda t: jacobian(rows, t, displacements),
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        if np.abs(solved.fun).max() > 1e-10:
            continue
        turning = np.isfinite(periods)
        times = solved.x.copy()
        times[turning] = np.mod(times[turning], periods[turning])
        times[turning & (periods - times < 1e-8)] = 0.0
        times[np.abs(times) < 1e-8] = 0.0
        if times.min() < 0.0:
            continue
        if not any(np.abs(times - other).max() < TIE * (1.0 + times.max()) for other in found):
            found.append(times)
    return found


def multipliers(word: Word, times: Array) -> Array:
    """Prices of the conditions that best explain `times` as optimal."""
    _, matrix = word.conditions(times)
    return np.asarray(np.linalg.lstsq(matrix.T, -word.rates, rcond=1e-10)[0])


def least_reduced_cost(
    library: Array, rates: Array, word: Word, times: Array, prices: Array, *, samples: int = 200
) -> float:
    """Smallest reduced cost of all trims at a grid of moments, ends included.

    A trim is inserted for a moment, and for minus a moment: the difference is its effect.
    """
    least = np.inf
    step = 1e-6
    for i, time in enumerate(times):
        for at in np.linspace(0.0, time, samples):
            for trim, rate in zip(library, rates, strict=True):
                rows = np.insert(word.twists, i, [word.twists[i], trim], axis=0)
                split = np.concatenate([times[:i], [at, step, time - at], times[i + 1 :]])
                longer = Word(rows, np.zeros(len(rows)), word.goal, total=word.total)
                later = longer.conditions(split)[0]
                split[i + 1] = -step
                earlier = longer.conditions(split)[0]
                least = min(least, rate + float(prices @ (later - earlier)) / (2.0 * step))
    return float(least)
