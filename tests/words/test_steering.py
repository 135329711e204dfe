"""Three coasting times in closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.groups import SE2
from maneuver_automaton.words import steer
from maneuver_automaton.words._kernels_steering import pairs_ending, steer_batch
from tests import reference
from tests.quickly import draws

LEFT, RIGHT, AHEAD, BACK = [1.0, 0, 1.0], [1.0, 0, -1.0], [1.0, 0, 0], [-1.0, 0, 0]
SPIN, SPIN_BACK = [0.0, 0, 1.0], [0.0, 0, -1.0]
TURN = 2.0 * np.pi
SIZEABLE = st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(0.1, 2.0) | st.floats(-2.0, -0.1)

# turn or straight, for each of three trims; three straights never span
KINDS = [kind for kind in itertools.product((1.0, 0.0), repeat=3) if any(kind)]


def planted(rng, kinds, *, sideways, displaced):
    """Random trims (n, 3), times, displacements (n, 2, 3) and ends for each row of `kinds`."""
    n = len(kinds)
    twists = rng.uniform(0.2, 2.0, (n, 3, 3)) * rng.choice([-1.0, 1.0], (n, 3, 3))
    twists[:, :, 1] *= sideways
    twists[:, :, 2] *= kinds
    between = displaced * rng.uniform(-1.0, 1.0, (n, 2, 3))
    with np.errstate(divide="ignore"):
        longest = np.minimum(TURN / np.abs(twists[:, :, 2]), 4.0)
    times = rng.uniform(0.02, 0.98, (n, 3)) * longest
    end = SE2(np.zeros((n, 3)))
    for k in range(3):
        end = end @ SE2.exp(times[:, k, None] * twists[:, k])
        if k < 2:
            end = end @ SE2(between[:, k])
    return twists, between, times, np.array(end.pose)


@pytest.mark.parametrize("displaced", [0.0, 1.0], ids=["joined", "displaced"])
@pytest.mark.parametrize("sideways", [0.0, 1.0], ids=["ahead", "sideways"])
@pytest.mark.parametrize("kind", KINDS)
def test_planted_times_are_found(kind, sideways, displaced):
    if sum(kind) == 1.0 and not (displaced or sideways) and kind != (0.0, 1.0, 0.0):
        pytest.skip("neighbouring straights ahead are parallel: no isolated solution")
    rng = np.random.default_rng(1)
    n = 400
    twists, between, times, goals = planted(
        rng, np.tile(kind, (n, 1)), sideways=sideways, displaced=displaced
    )
    found = np.array(
        [
            steer_batch(twists[i], np.arange(3)[None], between[i : i + 1], goals[i : i + 1], 1e-12)
            for i in range(n)
        ]
    )[:, 0]
    off = np.abs(found - times[:, None, :]).max(axis=2)
    assert np.nanmin(off, axis=1).max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_every_triple_of_times_ends_at_the_goal(kind):
    rng = np.random.default_rng(2)
    n = 12
    twists, between, times, goals = planted(rng, np.tile(kind, (n, 1)), sideways=1.0, displaced=1.0)
    for row, steps, known, goal in zip(twists, between, times, goals, strict=True):
        found = steer(row, goal, displacements=steps)
        assert 1 <= len(found) <= 2
        assert np.abs(found - known).max(axis=1).min() < 1e-6
        for solution in found:
            assert solution.min() >= 0.0
            end = reference.word_end(row, solution, steps)
            assert np.abs(reference.off_goal(end, goal)).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_root_finding_from_many_starts_finds_nothing_else(kind):
    rng = np.random.default_rng(4)
    twists, between, _, goals = planted(rng, np.tile(kind, (3, 1)), sideways=1.0, displaced=1.0)
    for row, steps, goal in zip(twists, between, goals, strict=True):
        found = steer(row, goal, displacements=steps)
        for root in reference.steering_roots(row, goal, steps, starts=12, longest=8.0, rng=rng):
            assert np.abs(found - root).max(axis=1).min() < 1e-4


@settings(max_examples=draws(40))
@given(
    arrays(np.float64, (3, 3), elements=SIZEABLE),
    *(arrays(np.float64, 3, elements=SIZEABLE) for _ in range(2)),
    arrays(np.float64, 3, elements=st.floats(-50.0, 50.0)),
)
def test_a_moved_start_and_goal_have_the_same_times(twists, start, goal, by):
    begin, end, motion = SE2(start), SE2(goal), SE2(by)
    relative = (begin.inverse() @ end).pose
    here = steer(twists, relative)
    there = steer(twists, ((motion @ begin).inverse() @ (motion @ end)).pose)
    for times in there:
        off = reference.off_goal(reference.plain_end(twists, times), relative)
        assert np.abs(off).max() < 1e-8
    if len(here) == len(there):  # two solutions at a tangency come and go with rounding
        for times in there:  # of equal sums, either may come first
            assert np.abs(here - times).max(axis=1).min() < 1e-4


# By hand.


def test_dubins_words():
    half_oval = steer([LEFT, AHEAD, LEFT], [0.0, 5.0, np.pi])
    assert half_oval == pytest.approx(np.array([[np.pi / 2, 3.0, np.pi / 2]]))
    lane_change = steer([LEFT, AHEAD, RIGHT], [4.0, 2.0, 0.0])
    assert lane_change == pytest.approx(np.array([[np.pi / 6, 2 * np.sqrt(3), np.pi / 6]]))
    three_turns = steer([RIGHT, LEFT, RIGHT], [0.0, 0.0, np.pi])
    assert np.array([np.pi / 3, 5 * np.pi / 3, np.pi / 3]) == pytest.approx(three_turns[0])


def test_reeds_shepp_three_point_turn():
    # on the spot by half a turn, forward, back and forward: a third of a half turn each
    turn = steer([LEFT, [-1.0, 0, 1.0], LEFT], [0, 0, np.pi])
    assert turn[0] == pytest.approx([np.pi / 3] * 3)


def test_turn_move_turn():
    found = steer([SPIN, AHEAD, SPIN], [1.0, 1.0, np.pi / 2])
    assert found == pytest.approx(np.array([[np.pi / 4, np.sqrt(2), np.pi / 4]]))
    backwards = steer([SPIN, BACK, SPIN], [-1.0, -1.0, np.pi / 2])
    assert backwards == pytest.approx(found)


def test_headings_count_modulo_a_turn():
    for turns in (-2, 1, 5):
        found = steer([SPIN, AHEAD, SPIN], [1.0, 1.0, np.pi / 2 + turns * TURN])
        assert found == pytest.approx(np.array([[np.pi / 4, np.sqrt(2), np.pi / 4]]))


# Degenerate triples.


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_tangent_circles(sign):
    # the goal is as far as the turns reach: two solutions become one
    known = np.array([1.0, np.pi, 0.7])
    goal = reference.word_end([LEFT, RIGHT, LEFT], known)
    found = steer([LEFT, RIGHT, LEFT], goal)
    assert len(found) == 1
    assert found[0] == pytest.approx(known, abs=1e-6)
    outward = goal[:2] + np.array(
        [-np.sin(goal[2]), np.cos(goal[2]) - 1.0]
    )  # from centre to centre
    shift = np.append(1e-6 * outward / np.linalg.norm(outward), 0.0)
    assert len(steer([LEFT, RIGHT, LEFT], goal + sign * shift)) == (0 if sign > 0 else 2)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_scaling_lengths_scales_straights_and_keeps_angles(size):
    scale = np.array([size, size, 1.0])
    here = steer([LEFT, AHEAD, RIGHT], [4.0, 2.0, 0.3])
    there = steer(np.array([LEFT, AHEAD, RIGHT]) * scale, np.array([4.0, 2.0, 0.3]) * scale)
    assert there == pytest.approx(here, abs=1e-7)


# With a climb.


@pytest.mark.parametrize(
    ("twists", "goal", "options", "message"),
    [
        ([LEFT, AHEAD], [1, 0, 0], {}, r"twists: got shape \(2, 3\), need \(3, 3\)"),
        ([[1, 0]] * 3, [1, 0, 0], {}, r"twists: got shape \(3, 2\), need 3 components last"),
        ([LEFT, AHEAD, [np.nan] * 3], [1, 0, 0], {}, "twists: got nan, need finite numbers"),
        ([LEFT] * 3, [[1, 0, 0]], {}, r"goal: got shape \(1, 3\), need \(3,\)"),
        ([LEFT] * 3, [1, 0, 0, 0], {}, r"goal: got shape \(4,\), need 3 components last"),
        (
            [LEFT] * 3,
            [1, 0, 0],
            {"displacements": [[0, 0, 0]]},
            r"displacements: got shape \(1, 3\), need \(2, 3\)",
        ),
        ([LEFT] * 3, [1, 0, 0], {"tolerance": 0.0}, "tolerance must be positive, got 0.0"),
        (
            [LEFT] * 3,
            [1, 0, 0],
            {"tolerance": np.inf},
            "tolerance must be finite, got inf",
        ),
    ],
)
def test_wrong_input(twists, goal, options, message):
    with pytest.raises(ValueError, match=message):
        steer(twists, goal, **options)


def test_pairs_of_trims_that_end_at_a_pose_are_found():
    rng = np.random.default_rng(4)
    twists = np.array([[1.0, 0, 0], [-1, 0, 0], [1, 0, 0.5], [1, 0, -0.5], [0, 0, 1], [0.3, 1, 0]])
    for i, j in itertools.product(range(6), repeat=2):
        times = rng.uniform(0.1, 3.0, 2)
        end = (SE2.exp(times[0] * twists[i]) @ SE2.exp(times[1] * twists[j])).pose
        found = pairs_ending(complex(*end[:2]), end[2], twists, 1e-9).tolist()
        assert [i, j] in found
        aside = pairs_ending(complex(*end[:2]) + 0.1 + 0.1j, end[2] + 0.1, twists, 1e-3).tolist()
        assert [i, j] not in aside
