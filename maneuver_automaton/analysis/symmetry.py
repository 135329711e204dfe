"""Symmetry under a group: of the dynamics, and of cost, constraints and boundary conditions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.analysis.examine import (
    NOWHERE,
    Draw,
    Question,
    Region,
    SymmetryReport,
    examine,
    unit_of,
)
from maneuver_automaton.analysis.shift import StateControlFunction
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

    def cause(broken: tuple[str, ...], violated: tuple[int, ...]) -> str:
        """Why the dynamics depend on where they are, from what shows it."""
        turns, drifts = names[violated[0]].startswith("heading"), violated[0] < region.group.dof
        if any(motion.startswith("translation") for motion in broken):
            what = "currents or a map" if drifts else "ground or friction"
            return f"it depends on the place, as with {what} that changes from place to place"
        if any(motion.startswith("rotation") for motion in broken):
            what = "in a steady wind or current" if drifts else "under gravity on a slope"
            what = "with a compass needle" if turns else what
            where = "" if turns else "the heading, so on "
            return f"it depends on {where}a direction of the world, as {what}"
        return "it depends on the height, as with thinner air"

    return Question(what=what, names=lambda i: name.format(names[i]), units=units, cause=cause)


BoundaryFunction = Callable[[Array, Array], ArrayLike]
"""``r(x_0, x_T)`` of the first and the last state (n_x,): one or more numbers."""


def check_stage_cost(
    stage_cost: StateControlFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a stage cost ``l(x, u)`` has the same value at a moved state.

    Source: the paper, Def. 7.

    Parameters
    ----------
    stage_cost : callable
        ``l(x, u)`` of one state (n_x,), pose first, and one control (n_u,).
    region : Region
        Group, and where states and controls are drawn.
    rng : Generator, optional
        Source of the samples; always the same ones if None.
    samples : int
        Random states for each coordinate of the group.
    tolerance : float
        Greatest change admitted, relative to the value there (at least 1) [-].

    Returns
    -------
    SymmetryReport
        Where the worst change happens, and which motions leave the cost alone.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> check_stage_cost(lambda x, u: u @ u, region=region).holds
    True
    >>> check_stage_cost(lambda x, u: x[0] ** 2 + x[1] ** 2, region=region).intact
    ('rotation',)
    """
    return _check("stage cost", stage_cost, region, rng, samples, tolerance)


def check_constraint(
    constraint: StateControlFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a constraint ``g(x, u) <= 0``, of one or more rows, has the same value when moved.

    Source: the paper, Def. 7. Parameters and result are those of `check_stage_cost`.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> report = check_constraint(lambda x, u: [u[0] - 1.0, x[1] - 3.0], region=region)
    >>> report.components
    ('constraint 2',)
    """
    return _check("constraint", constraint, region, rng, samples, tolerance)


def check_boundary_condition(
    boundary_condition: BoundaryFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a boundary condition ``r(x_0, x_T) = 0`` stays the same when both ends are moved.

    A fixed start or goal never does; `shifted_problem` moves it along.

    Source: the paper, Def. 7. Parameters are those of `check_stage_cost`; the state of the report
    is the pair of ends (2, n_x).

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> def distance(first, last):
    ...     return np.hypot(*(last - first)[:2]) - 3.0
    >>> check_boundary_condition(distance, region=region).holds
    True
    """
    return _check(
        "boundary condition",
        lambda ends, _: boundary_condition(*ends),
        region,
        rng,
        samples,
        tolerance,
        draw=lambda rng: (np.array([region.state(rng), region.state(rng)]), NOWHERE),
    )


def _check(
    what: str,
    function: StateControlFunction,
    region: Region,
    rng: np.random.Generator | None,
    samples: int,
    tolerance: float,
    draw: Draw | None = None,
) -> SymmetryReport:
    said = "r(x_0, x_T)" if draw else what

    def defect(by: LieGroup, state: Array, control: Array) -> tuple[Array, float]:
        both = (function(one, control) for one in (state, moved_state(by, state)))
        here, there = (np.atleast_1d(as_array(said, value)) for value in both)
        return there - here, float(np.abs(here).max(initial=0.0))

    def cause(broken: tuple[str, ...], violated: tuple[int, ...]) -> str:
        place = any(motion.startswith(("translation", "climb")) for motion in broken)
        depends = "the place" if place else "a direction of the world"
        return f"it depends on {depends}: shift its references along with the problem"

    question = Question(
        what=what,
        names=lambda i: "value" if what == "stage cost" else f"{what} {i + 1}",
        units=lambda i: "",
        cause=cause,
    )
    return examine(
        question,
        defect,
        region=region,
        rng=rng,
        samples=samples,
        tolerance=tolerance,
        draw=draw,
    )


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
