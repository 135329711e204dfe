"""Least effort: controls between those of a library, constant on equal parts of a plan's time.

A grid of trims leaves the best control between two of its points out, and mixes its neighbours
instead, which costs more the coarser the grid. From a plan of trims, direct single shooting finds
the controls of least effort near it: the poses in between follow from the controls, in closed
form, so that nothing is left to be integrated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost, StageCost, prices_switches, terms_of
from maneuver_automaton.groups.se2 import chained
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Trim
from maneuver_automaton.refinement.retiming import control_box, driftless
from maneuver_automaton.words.closing import EndConditions, closest_times

PIECES = 16
ITERATIONS = 60
CONVERGED = 1e-6  # change of a control, relative to the greatest: the effort is off by its square
TINY = 1e-12  # an effort that is none
MET = 1e-9  # [m, rad] from the end of the plan, and relative to its time
SMALL = 1e-3  # [rad] below which series take the place of quotients
SHOWN = ".4g"  # digits of a control in the name of its trim


@dataclass(frozen=True, slots=True, eq=False)
class _Shooting:
    """Controls (k, n_u), constant for `lasts` each, and where they lead."""

    start: Array  # (dof,)
    end: Array  # (dof,)
    columns: Array  # (dof, n_u) twists of unit controls
    weight: Array  # (n_u, n_u) of the effort
    lasts: float  # [s]

    def effort(self, flat: Array) -> float:
        """Effort of controls (k n_u,)."""
        return 0.5 * float(flat @ self.gradient(flat))

    def gradient(self, flat: Array) -> Array:
        """The derivative (k n_u,) of the effort."""
        controls = flat.reshape(-1, self.columns.shape[1])
        return np.asarray(2.0 * self.lasts * (controls @ self.weight).ravel())

    def missed(self, flat: Array) -> Array:
        """How far from the end the controls lead (dof,)."""
        twists = flat.reshape(-1, self.columns.shape[1]) @ self.columns.T
        return np.asarray(self._poses(twists)[-1] - self.end)

    def slopes(self, flat: Array) -> Array:
        """The derivatives (dof, k n_u) of `missed`."""
        twists = flat.reshape(-1, self.columns.shape[1]) @ self.columns.T
        poses = self._poses(twists)
        t, v_x, v_y = self.lasts, twists[:, 0], twists[:, 1]
        ahead, aside, d_ahead, d_aside = _quotients(t * twists[:, 2])
        c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
        # Of the end by the twist of a piece: its own displacement, and all later ones, which turn
        # with it about where it ends.
        by = np.zeros((len(twists), self.start.size, self.start.size))
        by[:, 0, 0], by[:, 0, 1] = t * (c * ahead - s * aside), -t * (c * aside + s * ahead)
        by[:, 1, 0], by[:, 1, 1] = t * (s * ahead + c * aside), t * (c * ahead - s * aside)
        x = t * t * (d_ahead * v_x - d_aside * v_y)
        y = t * t * (d_aside * v_x + d_ahead * v_y)
        arm = poses[-1, :2] - poses[1:, :2]
        by[:, 0, 2] = c * x - s * y - t * arm[:, 1]
        by[:, 1, 2] = s * x + c * y + t * arm[:, 0]
        for k in range(2, self.start.size):
            by[:, k, k] = t
        return np.asarray(np.moveaxis(by @ self.columns, 0, 1).reshape(self.start.size, -1))

    def nearest_to_none(self, controls: Array) -> Array | None:
        """Controls (k, n_u) of least effort from a guess, without limits; None if not found soon.

        Gauss-Newton: the controls of least effort that lead to the end if the poses change as they
        do at the last ones.
        """
        inverse = np.linalg.inv(self.weight)
        flat = controls.ravel()
        for _ in range(ITERATIONS):
            slopes = self.slopes(flat)
            cheap = (slopes.reshape(-1, *controls.shape) @ inverse).reshape(slopes.shape)
            target = slopes @ flat - self.missed(flat)
            answer = np.linalg.lstsq(cheap @ slopes.T, target, rcond=None)[0] @ cheap
            change = float(np.abs(answer - flat).max())
            flat = np.asarray(answer)
            if change <= CONVERGED * float(np.abs(flat).max()):
                return flat.reshape(controls.shape)
        return None

    def within(self, box: Array, controls: Array) -> Array:
        """Controls (k, n_u) of least effort within limits (n_u, 2), from a guess."""
        # Kernels are compiled where SciPy is not installed, by what their modules import.
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        size = max(self.effort(controls.ravel()), TINY)
        found = minimize(  # type: ignore[call-overload]  # its stubs want one-dimensional types
            lambda flat: self.effort(flat) / size,
            controls.ravel(),
            jac=lambda flat: self.gradient(flat) / size,
            method="SLSQP",
            bounds=Bounds(*np.tile(box, (len(controls), 1)).T),
            constraints=NonlinearConstraint(self.missed, 0.0, 0.0, jac=self.slopes),
            options={"maxiter": ITERATIONS, "ftol": CONVERGED**2},
        )
        return np.asarray(np.clip(found.x.reshape(controls.shape), box[:, 0], box[:, 1]))

    def _poses(self, twists: Array) -> Array:
        """Poses (k + 1, dof) before and after each piece."""
        ahead, aside, _, _ = _quotients(self.lasts * twists[:, 2])
        steps = self.lasts * twists
        v_x, v_y = steps[:, 0].copy(), steps[:, 1].copy()
        steps[:, 0], steps[:, 1] = ahead * v_x - aside * v_y, aside * v_x + ahead * v_y
        return chained(self.start, steps)


def least_effort(
    plan: Plan,
    model: Model,
    *,
    cost: StageCost | None = None,
    limits: ArrayLike | None = None,
    pieces: int = PIECES,
) -> Plan:
    """A plan of least effort from the start to the end of another one, in the same time.

    Its controls are constant on equal parts of the time, whatever the library has. It ends exactly
    where the other one does, turns as often, and costs less; where no such plan is found, the other
    one is handed back. It is a local optimum, the one that the plan leads to.

    Source: direct single shooting, Betts (2010), *Practical Methods for Optimal Control*, Sec. 3.4,
    by Gauss-Newton; by SLSQP of SciPy where limits are met.

    Parameters
    ----------
    plan : Plan
        Of a driftless vehicle whose body velocity is linear in its control.
    model : Model
        That vehicle.
    cost : StageCost, optional
        Effort, and time if you like; the squared norm of the control if left out.
    limits : (n_u, 2) array, optional
        Least and greatest control; the model's own if left out.
    pieces : int
        Parts of the time. The excess over controls that may change at any instant falls with their
        square.

    Returns
    -------
    Plan
        Its trims are named by their controls.

    Raises
    ------
    ValueError
        If the vehicle is another, or the cost counts more than effort and time.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> left = Trim(name="left", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead, left), durations=[2.0, 1.0])
    >>> better = least_effort(plan, Unicycle(), pieces=8)
    >>> bool(np.allclose(better.end, plan.end)), better.duration
    (True, 3.0)
    >>> from maneuver_automaton.refinement.retiming import effort_report
    >>> round(effort_report(plan).cost, 2), round(effort_report(better).cost, 2)
    (4.0, 3.72)
    """
    if pieces < 2:
        raise ValueError(f"least effort: pieces must be at least 2, got {pieces}")
    terms = terms_of(Cost(effort=1.0) if cost is None else cost)
    if (
        terms is None
        or not terms.effort > 0.0
        or terms.norm
        or terms.length
        or prices_switches(terms)
    ):
        raise ValueError(
            "least effort: the terms() of the cost have to be effort, and at most time beside it"
        )
    box = control_box(model, limits, asks="least effort")
    driftless(plan.trims, model, asks="least effort")
    columns = _columns(plan, model)
    if not plan.duration > 0.0:
        return plan
    weight = np.eye(len(box)) if terms.effort_matrix is None else terms.effort_matrix
    shooting = _Shooting(plan.start, plan.end, columns, weight, plan.duration / pieces)
    first = np.clip(_averages(plan, pieces), box[:, 0], box[:, 1])
    controls = shooting.nearest_to_none(first)
    if controls is None or ((controls < box[:, 0]) | (controls > box[:, 1])).any():
        controls = shooting.within(box, first)
    better = _closed(plan, controls, columns, shooting.lasts)
    if better is None or not _effort(better, weight) < _effort(plan, weight):
        return plan
    return better


def _columns(plan: Plan, model: Model) -> Array:
    """Twists (dof, n_u) of unit controls; refuse a model that is not linear in them."""
    n_controls = len(model.control_names)
    columns = np.array(
        [model.body_velocity(np.zeros(0), one) for one in np.eye(n_controls)]
    ).T.reshape(plan.start.size, n_controls)
    for trim in plan.trims:
        if np.abs(columns @ trim.control - trim.body_velocity).max() > MET:
            raise ValueError(
                f"least effort: the body velocity of the {model.name} is not linear in its "
                f"control at trim {trim.name!r}; need a vehicle for which it is"
            )
    return columns


def _averages(plan: Plan, pieces: int) -> Array:
    """Controls of a plan, averaged over equal parts of its time (pieces, n_u)."""
    controls = np.array([trim.control for trim in plan.trims])
    ends = np.append(0.0, np.cumsum(plan.durations))
    driven = np.vstack(
        [np.zeros(controls.shape[1]), np.cumsum(controls * plan.durations[:, None], axis=0)]
    )
    times = np.linspace(0.0, ends[-1], pieces + 1)
    along = np.stack([np.interp(times, ends, column) for column in driven.T], axis=-1)
    return np.asarray(np.diff(along, axis=0) * pieces / ends[-1])


def _closed(plan: Plan, controls: Array, columns: Array, lasts: float) -> Plan | None:
    """The plan of these controls, its times changed in the last digits so that it ends exactly."""
    twists = controls @ columns.T
    durations = np.full(len(controls), lasts)
    conditions = EndConditions(
        start=plan.start,
        twists=twists,
        goal=plan.end,
        rows=np.ones((1, len(controls))),
        targets=np.array([plan.duration]),
    )
    times, worst = closest_times(conditions, durations)
    if worst > MET * (1.0 + plan.duration):
        return None
    trims = []
    for control, twist in zip(controls, twists, strict=True):
        name = f"({', '.join(format(float(one), SHOWN) for one in control)})"
        trims.append(Trim(name=name, body_velocity=twist, control=control))
    return Plan(plan.start, tuple(trims), durations=times, start_time=plan.start_time)


def _effort(plan: Plan, weight: Array) -> float:
    controls = np.array([trim.control for trim in plan.trims])
    return float(np.einsum("ki,ij,kj,k->", controls, weight, controls, plan.durations))


def _quotients(angle: Array) -> tuple[Array, Array, Array, Array]:
    """``sin a / a``, ``(1 - cos a) / a`` (k,), and their derivatives."""
    near = np.abs(angle) < SMALL
    a = np.where(near, 1.0, angle)
    square = angle * angle
    ahead = np.where(near, 1.0 - square / 6.0, np.sin(a) / a)
    half = np.sin(0.5 * angle)
    aside = np.where(near, 0.5 * angle * (1.0 - square / 12.0), 2.0 * half * half / a)
    d_ahead = np.where(near, -angle / 3.0 * (1.0 - square / 10.0), (np.cos(a) - ahead) / a)
    d_aside = np.where(near, 0.5 - 0.125 * square, (np.sin(a) - aside) / a)
    return ahead, aside, d_ahead, d_aside
