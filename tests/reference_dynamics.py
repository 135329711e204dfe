"""What vehicles do, without the package's own motions: ODE solver, arrays, the paper's formulas."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import rollout, vector_field
from maneuver_automaton.optimal_control.problem import moving_frame


def trim_defect(model, trim, *, duration=5.0):
    """Greatest error of a trim's pose and reduced state after `duration` [s], by an ODE solver."""
    start = np.concatenate([np.zeros(model.group.dof), trim.reduced_state])
    rates = moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics)
    end = rollout(
        lambda x, u: np.array(rates(x.tolist(), u.tolist())),  # quicker than on arrays
        start,
        control=trim.control,
        times=[0.0, duration],
        rtol=1e-10,
        atol=1e-12,
    )[-1]
    pose = trim.coast(model.group.identity(), duration).pose
    return float(np.abs(end - np.concatenate([pose, trim.reduced_state])).max())


def dynamics_defect(problem, model, *, states, controls):
    """Greatest difference of an optimal control problem's dynamics from a model's, at states."""
    mine = problem.dynamics(list(states.T), list(controls.T))
    columns = [np.broadcast_to(rate, (len(states),)) for rate in mine]
    return float(np.abs(np.stack(columns, axis=-1) - vector_field(model)(states, controls)).max())


def trailer_pose(hitch_length):
    """Pose of a trailer's axle in the frame of a car whose reduced state is [hitch], as formulas.

    Source: turned back by the hitch angle, then back along the trailer by its length [m].
    """

    def pose(z):
        return -hitch_length * np.cos(z[0]), hitch_length * np.sin(z[0]), -z[0]

    return pose


def spatial_twist(state, control):
    """Twist (..., 3) of the unicycle in the world frame: (v_1, v_2, u_2).

    With it the flow is ``exp(t xi) @ start``, with the twist in front; it depends on the state.
    The body twist of a trim stands behind, ``start @ exp(t xi)``, and does not. The two are
    related by ``spatial == Ad(start) body``.

    Source: the paper, Prop. 6.
    """
    x, y, heading = np.moveaxis(np.asarray(state, dtype=np.float64), -1, 0)
    speed, turn_rate = np.moveaxis(np.asarray(control, dtype=np.float64), -1, 0)
    v_1 = speed * np.cos(heading) + turn_rate * y
    v_2 = speed * np.sin(heading) - turn_rate * x
    return np.stack([v_1, v_2, np.broadcast_to(turn_rate, v_1.shape)], axis=-1)


def flow(state, control, *, duration):
    """States (..., 3) reached under a constant control after `duration` (...,) [s].

    Source: the paper, Prop. 6, by its spatial twist. The second entry of the translation in
    the proof has a wrong sign in print; the statement, used here, is right.
    """
    seconds = np.asarray(duration, dtype=np.float64)[..., None]
    return (SE2.exp(seconds * spatial_twist(state, control)) @ SE2(state)).pose


def symmetry_matrix(shift):
    """Matrices (..., 4, 4) of the symmetry group of the unicycle, for shifts (..., 3) [m, m, rad].

    They multiply the state in homogeneous coordinates, (x, y, heading, 1).

    Source: the paper, Prop. 3.
    """
    shift = np.asarray(shift, dtype=np.float64)
    matrix = np.zeros((*shift.shape[:-1], 4, 4))
    matrix[..., :2, :2] = SE2(shift).matrix()[..., :2, :2]
    matrix[..., 2, 2] = matrix[..., 3, 3] = 1.0
    matrix[..., :3, 3] = shift
    return matrix


def symmetry_action(shift, state):
    """States (..., 3) moved by shifts (..., 3): ``E g (x, 1)``; the same as ``SE2(g) @ SE2(x)``.

    Source: the paper, Prop. 3.
    """
    state = np.asarray(state, dtype=np.float64)
    homogeneous = np.concatenate([state, np.ones((*state.shape[:-1], 1))], axis=-1)
    projection = np.eye(3, 4)
    return np.einsum("ij,...jk,...k->...i", projection, symmetry_matrix(shift), homogeneous)
