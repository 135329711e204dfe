"""Symmetry of the dynamics under a group: of the vector field, and of the flow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.analysis._examine import Question, examine
from maneuver_automaton.analysis.region import Region
from maneuver_automaton.analysis.report import SymmetryReport, unit_of
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import (
    Model,
    VectorField,
    equivariance_defect,
    moved_state,
    rollout,
    vector_field,
)


def check_vector_field(
    dynamics: Model | VectorField,
    *,
    region: Region | None = None,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a vector field looks the same wherever the group moves it.

    Source: the paper, remark on an alternative characterization of symmetry groups.

    Parameters
    ----------
    dynamics : Model or callable
        A model, or a plain ``f(x, u)`` for one state (n_x,), pose first, and one control (n_u,).
    region : Region, optional
        Group, and where states and controls are drawn; for a model its own limits if None.
    rng : Generator, optional
        Source of the samples; always the same ones if None.
    samples : int
        Random states for each coordinate of the group.
    tolerance : float
        Greatest change admitted, relative to the greatest rate met there (at least 1) [-].

    Returns
    -------
    SymmetryReport
        Where the worst change happens, and which motions the field is still invariant under.

    Raises
    ------
    ValueError
        If a plain function comes without a region, or does not return finite rates (n_x,).

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> from maneuver_automaton.models import Unicycle
    >>> check_vector_field(Unicycle()).holds
    True
    >>> def windy(x, u):
    ...     return [u[0] * np.cos(x[2]) + 0.3, u[0] * np.sin(x[2]), u[1]]
    >>> report = check_vector_field(windy, region=Region.of(SE2, n_controls=2))
    >>> report.broken, report.intact
    (('rotation',), ('translation in x', 'translation in y'))
    """
    f, region = _field_and_region(dynamics, region)

    def defect(by: LieGroup, state: Array, control: Array) -> tuple[Array, float]:
        rates = as_array("f(x, u)", f(state, control), last=state.size)
        change = equivariance_defect(f, by, state=state, control=control)
        return change, float(np.abs(rates).max())

    return examine(
        _question("vector field", "{} rate", "/s", region),
        defect,
        region=region,
        draw=lambda rng: (region.state(rng), region.control(rng)),
        rng=rng,
        samples=samples,
        tolerance=tolerance,
    )


def check_flow(
    dynamics: Model | VectorField,
    *,
    region: Region | None = None,
    rng: np.random.Generator | None = None,
    samples: int = 10,
    piece_durations: tuple[float, ...] = (0.5, 1.0, 0.5),
    tolerance: float = 1e-6,
) -> SymmetryReport:
    """Whether a moved start has the moved motion, by an ODE solver, with random controls.

    Headings are compared as they are, full turns included.

    Source: the paper, Def. 2.

    Parameters
    ----------
    dynamics, region, rng, samples
        As for `check_vector_field`.
    piece_durations : tuple of float
        How long each of the random constant controls lasts [s]. Of a model without a region they
        are shortened so that its reduced state stays within its limits.
    tolerance : float
        Greatest difference of the ends admitted, relative to the greatest coordinate
        (at least 1) [-]. The solver is run with a thousandth of it.

    Returns
    -------
    SymmetryReport
        As for `check_vector_field`; its control is a row for each piece.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> check_flow(Car(wheelbase=2.0, max_steering=0.6), samples=2).holds
    True
    """
    if not piece_durations or not min(piece_durations) > 0.0:
        raise ValueError(f"piece_durations: got {piece_durations}, need positive times [s]")
    if region is None and not callable(dynamics):
        region, seconds = Region.inside_of_model(dynamics)
        share = min(1.0, seconds / sum(piece_durations))
        piece_durations = tuple(share * duration for duration in piece_durations)
    f, region = _field_and_region(dynamics, region)

    def flow(state: Array, controls: Array) -> Array:
        for control, duration in zip(controls, piece_durations, strict=True):
            span, accuracy = [0.0, duration], tolerance / 1000
            state = rollout(f, state, control=control, times=span, rtol=accuracy, atol=accuracy)[-1]
        return state

    def defect(by: LieGroup, state: Array, control: Array) -> tuple[Array, float]:
        here = moved_state(by, flow(state, control))
        return flow(moved_state(by, state), control) - here, float(np.abs(here).max())

    return examine(
        _question("flow", f"{{}} after {sum(piece_durations):.4g} s", "", region),
        defect,
        region=region,
        draw=lambda rng: (
            region.state(rng),
            np.array([region.control(rng) for _ in piece_durations]),
        ),
        rng=rng,
        samples=samples,
        tolerance=tolerance,
    )


def _field_and_region(
    dynamics: Model | VectorField, region: Region | None
) -> tuple[VectorField, Region]:
    if not callable(dynamics):
        return vector_field(dynamics), Region.of_model(dynamics) if region is None else region
    if region is None:
        name = getattr(dynamics, "__name__", type(dynamics).__name__)
        raise ValueError(
            f"{name}: a plain function needs a region, such as Region.of(SE2, n_controls=2)"
        )
    return dynamics, region


def _question(what: str, name: str, per: str, region: Region) -> Question:
    names = region.state_names

    def units(i: int) -> str:
        return f"{unit_of(names[i])}{per}" if i < region.group.dof else ""

    return Question(
        what=what,
        names=lambda i: name.format(names[i]),
        units=units,
        cause=_cause_in(region),
    )


def _cause_in(region: Region) -> Callable[[tuple[str, ...], tuple[int, ...]], str]:
    """Words for why the dynamics depend on where they are, from what shows it."""

    def cause(broken: tuple[str, ...], violated: tuple[int, ...]) -> str:
        name = region.state_names[violated[0]]
        turns, drifts = name.startswith("heading"), violated[0] < region.group.dof
        if any(motion.startswith("translation") for motion in broken):
            what = "currents or a map" if drifts else "ground or friction"
            return f"it depends on the place, as with {what} that changes from place to place"
        if any(motion.startswith("rotation") for motion in broken):
            what = "in a steady wind or current" if drifts else "under gravity on a slope"
            what = "with a compass needle" if turns else what
            where = "" if turns else "the heading, so on "
            return f"it depends on {where}a direction of the world, as {what}"
        return "it depends on the height, as with thinner air"

    return cause
