"""Closing the last digits of a word: as little as possible, and never a negative time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.words.closing import EndConditions, closed_at, closest_times
from tests.quickly import draws
from tests.reference import plain_end

TWISTS = np.array([[1, 0, 0.5], [1, 0, 0], [-1, 0, 0.25], [0, 0, 1], [0.5, 0.3, -0.8]], dtype=float)
TURNING = [0, 2, 3, 4]


def end_of(start, twists, durations):
    return (SE2(start) @ SE2(plain_end(twists, durations)[:3])).pose


@given(
    word=st.lists(st.integers(0, 4), min_size=3, max_size=12),
    seed=st.integers(0, 10**6),
    free_heading=st.booleans(),
    far=st.sampled_from([0.0, 1e3, 1e6]),
)
@settings(max_examples=draws(150))
def test_what_is_nearly_there_gets_there(word, seed, free_heading, far):
    rng = np.random.default_rng(seed)
    twists = TWISTS[word]
    times = rng.uniform(0.3, 2.0, len(word))
    start = np.array([far, -far, rng.uniform(-3, 3)])
    goal = end_of(start, twists, times)
    if len(set(word) & set(TURNING)) < 2 or len(set(word)) < 3:
        return  # its columns may not span
    off = 1e-7 * rng.standard_normal(len(word))
    closed = closed_at(start, twists, times + off, goal, free_heading=free_heading)
    reached = end_of(start, twists, closed)
    ulp = np.spacing(far) + 1e-12
    assert np.hypot(*(reached - goal)[:2]) < 4.0 * ulp
    assert free_heading or abs(reached[2] - goal[2]) < 1e-12
    # no larger a change than the one that is undone
    assert np.linalg.norm(closed - times - off) < 1.01 * np.linalg.norm(off) + 1e-9


def test_a_word_that_cannot_get_there_is_as_good_as_it_gets():
    straight = np.array([[1.0, 0.0, 0.0]])
    closed = closed_at(np.zeros(3), straight, np.array([1.9]), np.array([2.0, 1.0, 0.0]))
    assert closed == pytest.approx([1.9], abs=0.2)
    assert closed.min() >= 0.0


CLIMBING = np.column_stack([TWISTS, [0.2, 0.0, -0.3, 0.1, 0.0]])


@given(seed=st.integers(0, 10**6), fixed=st.booleans())
@settings(max_examples=draws(100))
def test_altitude_and_the_sum_of_times_are_met_too(seed, fixed):
    rng = np.random.default_rng(seed)
    twists = CLIMBING[[0, 2, 3, 1, 4, 0]]
    times = rng.uniform(0.3, 2.0, len(twists))
    start = np.array([5.0, -3.0, rng.uniform(-3, 3), 2.0])
    goal = (SE2xR(start) @ SE2xR(plain_end(twists, times))).pose
    conditions = EndConditions(
        start=start, twists=twists, goal=goal,
        rows=np.ones((1, len(times))) if fixed else None,
        targets=np.array([times.sum()]) if fixed else np.zeros(0),
    )  # fmt: skip
    off = 1e-6 * rng.standard_normal(len(times))
    closed, missing = closest_times(conditions, times + off)
    reached = (SE2xR(start) @ SE2xR(plain_end(twists, closed))).pose
    assert missing < 1e-12
    assert reached == pytest.approx(goal, abs=1e-11)
    assert not fixed or closed.sum() == pytest.approx(times.sum(), abs=1e-12)
    assert np.linalg.norm(closed - times - off) < 1.01 * np.linalg.norm(off) + 1e-9


def closed_by_svd(conditions: EndConditions, durations: np.ndarray) -> tuple[np.ndarray, float]:
    """The same by LAPACK, on the values and derivatives that `EndConditions` states."""
    best, least, now = durations, math.inf, np.array(durations)
    lasting = now != 0.0
    for _ in range(8):
        gap, columns = conditions.missing(now)
        worst = float(np.abs(gap).max())
        if worst < least:
            best, least = now, worst
        elif least < 1e-9:
            break
        if worst < 1e-15 or not lasting.any():
            break
        change = np.zeros(now.size)
        change[lasting] = np.linalg.lstsq(columns[:, lasting], gap, rcond=1e-9)[0]
        now = np.maximum(now + change, 0.0)
    return best, least


@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 9),
    dof=st.sampled_from([3, 4]),
    kind=st.sampled_from(["any", "straight", "turns on the spot"]),
    displaced=st.booleans(),
    free_heading=st.booleans(),
    timed=st.booleans(),
)
@settings(max_examples=draws(200))
def test_the_kernel_does_what_singular_values_of_lapack_do(
    seed, n, dof, kind, displaced, free_heading, timed
):
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(n, dof))
    twists[:, 2] *= kind != "straight"
    twists[:, :2] *= kind != "turns on the spot"
    times = rng.uniform(0.0, 3.0, n) * (rng.random(n) < 0.8)
    group = SE2 if dof == 3 else SE2xR
    start = 10.0 * rng.normal(size=dof)
    end = group(start)
    for twist, time in zip(twists, times, strict=True):
        end = end @ group.exp(time * twist)
    product = rng.normal(size=dof) if displaced else None
    goal = np.array((end if product is None else end @ group(product)).pose)
    goal[2] += float(free_heading)
    conditions = EndConditions(
        start=start,
        twists=twists,
        goal=goal,
        free_heading=free_heading,
        product=product,
        rows=np.ones((1, n)) if timed else None,
        targets=np.array([times.sum()] if timed else []),
    )
    near = times + (times > 0.0) * 1e-5 * rng.random(n)
    expected, missed = closed_by_svd(conditions, near)
    found, missing = closest_times(conditions, near)
    assert found == pytest.approx(expected, abs=1e-11)
    assert missing <= max(3.0 * missed, 1e-12)
