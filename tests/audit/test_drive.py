"""The steps of the drive against the same on arrays, or one at a time."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.audit import _kernels_drive as kernels
from maneuver_automaton.audit.arrays import Stated, TimeElements
from maneuver_automaton.audit.drive import TURN
from maneuver_automaton.audit.frames import INTEGRAL, RULES, SERIES, SLOPES, TO_NODES, N


def before(steps):
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def stated(rng, n=9, dof=3):
    controls = rng.integers(0, 2, (n, 2)).astype(np.float64)
    ends, twists = rng.normal(size=(2, n, dof))
    pieces = np.sort(rng.integers(0, 4, n))
    none = np.zeros((n, 0))
    return Stated(rng.uniform(0.1, 1.0, n), controls, none, none, ends, twists, pieces)


@pytest.mark.parametrize("dof", [3, 4])
def test_a_motion_and_its_bounds(dof):
    rng = np.random.default_rng(dof)
    twists, lengths = rng.normal(size=(5, N, dof)), rng.uniform(0.1, 1.0, 5)
    start, h = rng.normal(size=dof), lengths[:, None]
    rows = np.arange(5)
    elements = TimeElements(rows, np.zeros(5), lengths, rows, rows)
    motion = kernels.followed(start, twists, stated(rng, n=5, dof=dof), elements, RULES)[0]
    heading = start[2] + before(lengths * (INTEGRAL @ twists[..., 2:3]).sum(axis=(1, 2)))[:-1, None]
    heading = heading + h * (twists[..., 2] @ TO_NODES.T)
    turned = np.exp(1j * heading) * (twists[..., 0] + 1j * twists[..., 1])
    rates = np.concatenate([np.stack([turned.real, turned.imag], -1), twists[..., 2:]], axis=-1)
    series = h[..., None] * (INTEGRAL @ rates)
    begins = start + before(series.sum(axis=1))
    series[:, 0] += begins[:-1]
    assert motion.series == pytest.approx(series, abs=1e-13)
    assert motion.nodes[..., 2] == pytest.approx(heading, abs=1e-13)
    last = np.abs(SERIES[-2:] @ rates).max(axis=(1, 2)) * lengths
    assert motion.error == pytest.approx(last, abs=1e-13)
    terms = np.abs(SERIES @ twists)
    most, change = terms.sum(axis=1), SLOPES @ terms / h
    speed = np.hypot(most[:, 0], most[:, 1])
    assert motion.speed == pytest.approx(speed)
    bend = np.hypot(change[:, 0], change[:, 1]) + most[:, 2] * speed
    assert motion.bend == pytest.approx(bend)
    assert motion.swerve == pytest.approx(change[:, 2] + most[:, 2] ** 2)
    assert motion.rise == pytest.approx(change[:, 3:].sum(axis=1))
    assert motion.length == pytest.approx(speed @ lengths)
    assert motion.times == pytest.approx(before(lengths))


def test_runs_hold_one_control_of_one_primitive_and_turn_little():
    rng = np.random.default_rng(1)
    for _ in range(20):
        of, rough = stated(rng), rng.integers(0, 2, 9) * rng.integers(0, 3, 9)
        wide = rng.random(9) < 0.2
        turns, alone = rng.uniform(0.0, 0.5, 9) + 2.0 * TURN * wide, wide | (rough > 0)
        parts = np.where(wide, 3 * 2**rough, 2 ** np.maximum(rough - 1, 0))
        twists = of.twists * [1.0, 1.0, 0.0] + [[0.0, 0.0, 1.0]] * (turns / of.lengths)[:, None]
        found, along = kernels.cut(of, twists, rough, TURN, N)
        assert (along == np.repeat(twists[found.first][:, None], N, axis=1)).all()
        passed = np.floor(before(turns)[:-1] / TURN)
        same = (of.controls[1:] == of.controls[:-1]).all(axis=1)
        same &= (of.pieces[1:] == of.pieces[:-1]) & (passed[1:] == passed[:-1])
        same &= ~(alone[1:] | alone[:-1])
        assert (np.diff(found.run) == np.where(same, 0, 1)).all()
        lasts = np.bincount(found.run, of.lengths)
        assert np.bincount(found.runs, found.lengths) == pytest.approx(lasts)
        assert (
            np.bincount(found.runs) == parts[np.flatnonzero(np.diff(found.run, prepend=-1))]
        ).all()
        assert (found.share == np.where(alone[found.first], found.share, 0.0)).all()


@pytest.mark.parametrize("off", [0.25, np.nan])
def test_what_is_stated_is_compared_where_it_ends(off):
    twists = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.5]])
    of = stated(np.random.default_rng(2), n=2)._replace(
        lengths=np.array([1.0, 2.0]), controls=twists[:, :2].copy(), twists=twists
    )
    elements, along = kernels.cut(of, twists, np.zeros(2, dtype=np.int64), TURN, N)
    ends = np.array([[1.0, 0.0, 0.0], [1.0 + 2.0 * np.sin(1.0), 2.0 - 2.0 * np.cos(1.0), 1.0]])

    def compared(of):
        return kernels.followed(np.zeros(3), along, of, elements, RULES)[1]

    good = compared(of._replace(ends=ends))
    assert good.poses == pytest.approx(ends, abs=1e-14)
    assert good.off < 1e-13
    bad = compared(of._replace(ends=ends + np.array([0.0, 0.0, off])))
    expected = np.inf if np.isnan(off) else off
    assert (bad.off, bad.turned) == (pytest.approx(expected), pytest.approx(expected))
    assert compared(of._replace(ends=ends, twists=np.full((2, 3), np.nan))).off < 1e-13
