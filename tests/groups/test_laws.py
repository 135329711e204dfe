"""Laws that hold in every group, for tiny, everyday and large numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import SearchStrategy

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2, LieGroup, SE2xR, product, translations
from tests.compare import assert_same_motion

GROUPS = [SE2, SE2xR, translations(3), product(SE2, SE2)]
every_group = pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)

EVERYDAY = st.floats(-3.0, 3.0)
TINY = st.floats(-1e-7, 1e-7) | st.floats(-1e-300, 1e-300)
SPECIAL = st.sampled_from([0.0, -0.0, 1.0, np.pi, -np.pi, np.pi / 2, 5e-324])
LARGE_TURN, LARGE_SPEED = st.floats(-100.0, 100.0), st.floats(-1e6, 1e6)


def is_angle(group: type[LieGroup]) -> Array:
    return np.array([name.startswith("heading") for name in group.coordinates])


def twists(group: type[LieGroup]) -> SearchStrategy[Array]:
    """Everyday twists and, as often, tiny ones, where cancellation hides, and large ones."""
    large = st.tuples(*(LARGE_TURN if angle else LARGE_SPEED for angle in is_angle(group)))
    kinds = [arrays(np.float64, group.dof, elements=kind) for kind in (EVERYDAY, TINY, SPECIAL)]
    mixed = arrays(np.float64, group.dof, elements=EVERYDAY | TINY | SPECIAL)
    return st.one_of(*kinds, mixed, large.map(np.array))


def elements(group: type[LieGroup]) -> SearchStrategy[LieGroup]:
    return twists(group).map(group)


def rounding(group: type[LieGroup], *numbers: Array) -> float:
    """What float64 may lose in a few operations on poses or twists of this size, no floor added."""
    total = np.sum([np.abs(n).reshape(-1, group.dof).sum(axis=0) for n in numbers], axis=0)
    return float(1e-13 * (1.0 + total[is_angle(group)].sum()) * total.sum() + 1e-320)


def room_to_undo(group: type[LieGroup], twist: Array) -> float:
    """|sin(w/2) / (w/2)|, zero where a constant twist closes its circle; 1 for no turn."""
    turns = twist[..., is_angle(group)]
    return float(np.abs(np.sinc(turns / (2 * np.pi))).min(initial=1.0))


@every_group
@given(data=st.data())
def test_composition_is_associative(group, data):
    a, b, c = (data.draw(elements(group)) for _ in range(3))
    atol = rounding(group, a.pose, b.pose, c.pose)
    assert_same_motion((a @ b) @ c, a @ (b @ c), atol=atol)


@every_group
@given(data=st.data())
def test_identity_changes_nothing(group, data):
    a = data.draw(elements(group))
    assert_same_motion(a @ group.identity(), a, atol=0.0)
    assert_same_motion(group.identity() @ a, a, atol=0.0)


@every_group
@given(data=st.data())
def test_inverse_undoes_from_both_sides(group, data):
    a = data.draw(elements(group))
    atol = rounding(group, a.pose)
    assert_same_motion(a @ a.inverse(), group.identity(), atol=atol)
    assert_same_motion(a.inverse() @ a, group.identity(), atol=atol)


@every_group
@given(data=st.data())
def test_inverse_of_a_composition_runs_backwards(group, data):
    a, b = data.draw(elements(group)), data.draw(elements(group))
    atol = rounding(group, a.pose, b.pose)
    assert_same_motion((a @ b).inverse(), b.inverse() @ a.inverse(), atol=atol)


@every_group
@given(data=st.data())
def test_log_undoes_exp_with_all_its_turns(group, data):
    twist = data.draw(twists(group))
    room = room_to_undo(group, twist)
    assume(room > 1e-4)
    atol = rounding(group, twist) / room
    np.testing.assert_allclose(group.exp(twist).log(), twist, rtol=0.0, atol=atol)


@every_group
@given(data=st.data())
def test_exp_undoes_log(group, data):
    a = data.draw(elements(group))
    room = room_to_undo(group, a.pose)
    assume(room > 1e-4)
    assert_same_motion(group.exp(a.log()), a, atol=rounding(group, a.pose, a.log()) / room)


@every_group
@given(data=st.data())
def test_tiny_motions_are_their_twists(group, data):
    twist = data.draw(arrays(np.float64, group.dof, elements=TINY))
    size = np.abs(twist).max()
    np.testing.assert_allclose(group.exp(twist).pose, twist, rtol=1e-15, atol=0.51 * size**2)
    np.testing.assert_allclose(group(twist).log(), twist, rtol=1e-15, atol=0.51 * size**2)


@every_group
@given(data=st.data())
def test_coasting_twice_is_coasting_for_the_sum(group, data):
    twist = data.draw(twists(group))
    s, t = data.draw(st.floats(-3.0, 3.0)), data.draw(st.floats(-3.0, 3.0) | TINY)
    atol = rounding(group, s * twist, t * twist)
    assert_same_motion(
        group.exp(s * twist) @ group.exp(t * twist), group.exp((s + t) * twist), atol=atol
    )


@every_group
@given(data=st.data())
def test_adjoint_moves_twists_to_the_left(group, data):
    a, twist = data.draw(elements(group)), data.draw(twists(group))
    moved = a.adjoint() @ twist
    atol = rounding(group, a.pose, twist, moved)
    assert_same_motion(a @ group.exp(twist) @ a.inverse(), group.exp(moved), atol=atol)


@every_group
@given(data=st.data())
def test_adjoint_is_a_homomorphism(group, data):
    a, b = data.draw(elements(group)), data.draw(elements(group))
    size = rounding(group, a.pose, b.pose) + 1e-13
    both = a.adjoint() @ b.adjoint()
    np.testing.assert_allclose((a @ b).adjoint(), both, rtol=0.0, atol=size)
    np.testing.assert_allclose(group.identity().adjoint(), np.eye(group.dof), atol=0.0)


@every_group
@given(data=st.data())
def test_act_is_an_action(group, data):
    a, b = data.draw(elements(group)), data.draw(elements(group))
    points = data.draw(arrays(np.float64, (4, group.space), elements=EVERYDAY | TINY))
    atol = rounding(group, a.pose, b.pose) * 4.0 + 1e-12 * (1.0 + np.abs(a.pose).sum())
    np.testing.assert_allclose((a @ b).act(points), a.act(b.act(points)), rtol=0.0, atol=atol)
    np.testing.assert_array_equal(group.identity().act(points), points)


@every_group
@given(data=st.data())
def test_pose_rates_are_the_derivative_of_coasting(group, data):
    everyday = arrays(np.float64, group.dof, elements=EVERYDAY)
    a, twist, step = group(data.draw(everyday)), data.draw(everyday), 1e-5
    ahead, behind = a @ group.exp(step * twist), a @ group.exp(-step * twist)
    slope = (ahead.pose - behind.pose) / (2 * step)
    np.testing.assert_allclose(a.pose_rates(twist), slope, rtol=0.0, atol=1e-7)


@every_group
@given(data=st.data())
def test_body_twist_undoes_pose_rates(group, data):
    a, twist = data.draw(elements(group)), data.draw(twists(group))
    atol = 1e-14 * np.abs(twist).sum() + 1e-320
    np.testing.assert_allclose(a.body_twist(a.pose_rates(twist)), twist, rtol=0.0, atol=atol)


@every_group
def test_batches_are_loops(group):
    rng = np.random.default_rng(1)
    a, b = group(rng.normal(size=(3, 1, group.dof))), group(rng.normal(size=(4, group.dof)))
    twist, points = rng.normal(size=(4, group.dof)), rng.normal(size=(4, group.space))
    for i, j in np.ndindex(3, 4):
        one, other = group(a.pose[i, 0]), group(b.pose[j])
        np.testing.assert_array_equal((a @ b).pose[i, j], (one @ other).pose)
        np.testing.assert_array_equal(a.act(points)[i, j], one.act(points[j]))
        np.testing.assert_array_equal(a.pose_rates(twist)[i, j], one.pose_rates(twist[j]))
        np.testing.assert_array_equal(a.body_twist(twist)[i, j], one.body_twist(twist[j]))
        np.testing.assert_allclose(a.inverse().pose[i, 0], one.inverse().pose, atol=1e-15)
        np.testing.assert_allclose(b.log()[j], other.log(), atol=1e-15)
        np.testing.assert_allclose(group.exp(twist).pose[j], group.exp(twist[j]).pose, atol=1e-15)
        np.testing.assert_array_equal(b.adjoint()[j], other.adjoint())


@every_group
def test_poses_are_read_only_copies(group):
    source = np.zeros(group.dof)
    a = group(source)
    source[0] = 1.0
    assert a.pose[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        a.pose[0] = 1.0


@every_group
def test_results_can_be_written_to(group):
    a = group.identity()
    for result in (a.log(), a.adjoint(), a.pose_rates(a.log())):
        result[...] = 7.0
    assert not a.pose.any()


@every_group
def test_wrong_poses_and_twists_are_refused(group):
    with pytest.raises(ValueError, match=f"pose: got shape .* need {group.dof} components last"):
        group(np.zeros(group.dof + 1))
    with pytest.raises(ValueError, match="pose: got nan, need finite numbers"):
        group(np.full(group.dof, np.nan))
    with pytest.raises(ValueError, match=f"twist: got shape .* need {group.dof} components last"):
        group.exp(np.zeros(group.dof + 1))
    with pytest.raises(ValueError, match="points: got shape"):
        group.identity().act(np.zeros(group.space + 1))
