"""Two motions, at two places: are they the same motion primitive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_array
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import moved_state


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Equivalence:
    """How two motions are related: ``a == group_element b``, up to `worst_deviation`."""

    equivalent: bool
    group_element: LieGroup  # moves the first pose of b onto the first pose of a
    worst_deviation: float  # greatest difference of a coordinate [m, rad, the model's units]
    worst_time: float  # when it occurs [s]
    component: str  # coordinate in which it occurs; reduced states are z1, z2, ...


def same_motion_primitive(
    trajectory_a: ArrayLike,
    trajectory_b: ArrayLike,
    *,
    times: ArrayLike,
    group: type[LieGroup],
    tolerance: float = 1e-9,
) -> Equivalence:
    """Whether one group element moves all of motion b onto motion a.

    The element is that which joins the first poses. Headings are compared as they are, so a motion
    with a full turn more is another motion; reduced states have to agree unmoved.

    Source: the paper, Def. 4.

    Parameters
    ----------
    trajectory_a, trajectory_b : (n, n_x) arrays
        States at the same instants: pose, then reduced state.
    times : (n,) array
        These instants [s], counted from the start of each motion.
    group : type[LieGroup]
        Group that moves the poses.
    tolerance : float
        Greatest difference of a coordinate admitted [m, rad, the model's units].

    Returns
    -------
    Equivalence
        The group element, and how well it fits.

    Raises
    ------
    ValueError
        If the shapes do not fit together.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> times = np.linspace(0.0, 2.0, 5)
    >>> coast = SE2.exp(times[:, None] * [1.0, 0.0, 0.5])
    >>> a = (SE2([0.0, 1.0, 0.0]) @ coast).pose
    >>> b = (SE2([4.0, 0.0, np.pi]) @ coast).pose
    >>> same = same_motion_primitive(a, b, times=times, group=SE2)
    >>> same.equivalent, same.group_element.pose.round(3).tolist()
    (True, [4.0, 1.0, -3.142])
    """
    a, b = as_array("trajectory_a", trajectory_a), as_array("trajectory_b", trajectory_b)
    times = as_array("times", times)
    if a.ndim != 2 or a.shape[1] < group.dof or a.shape != b.shape or len(times) != len(a):
        raise ValueError(
            f"same_motion_primitive: got shapes {a.shape}, {b.shape} and {times.shape} for "
            f"trajectory_a, trajectory_b and times, need (n, n_x) twice, with n_x at least "
            f"{group.dof}, and (n,)"
        )
    if not len(times):
        raise ValueError("same_motion_primitive: got no samples, need at least 1")
    element = group(a[0, : group.dof]) @ group(b[0, : group.dof]).inverse()
    deviation = np.abs(moved_state(element, b) - a)
    row, column = np.unravel_index(int(np.argmax(deviation)), deviation.shape)
    names = (*group.coordinates, *(f"z{i + 1}" for i in range(a.shape[1] - group.dof)))
    return Equivalence(
        equivalent=bool(deviation[row, column] <= tolerance),
        group_element=element,
        worst_deviation=float(deviation[row, column]),
        worst_time=float(times[row]),
        component=names[column],
    )
