"""The loop behind every check of a symmetry, and what it found, in a sentence.

States are drawn, one coordinate after the other is moved, and the worst that changes is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, check_range, freeze, vector_text
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import Model


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SymmetryReport:
    """Whether something is invariant under a group, and if not, where, how much, and why.

    Each coordinate of the group is tried on its own: translation in x, in y, rotation, climb. The
    group they generate is the whole group, so nothing else needs to be tried.
    """

    what: str  # "vector field", "stage cost", ...
    holds: bool
    worst_violation: float  # in the units of the component
    tolerance: float  # relative to the values met there (at least 1) [-]
    state: Array  # (n_x,) where the worst happens; (2, n_x) for boundary conditions
    control: Array  # (n_u,), or (pieces, n_u) for a flow; empty for boundary conditions
    group_element: LieGroup  # that moves the state there
    components: tuple[str, ...]  # violated there, worst first; none if all holds
    broken: tuple[str, ...]  # the motions it is not invariant under, worst first
    intact: tuple[str, ...]  # the motions it is invariant under
    message: str

    def __str__(self) -> str:
        return self.message


def motion_of(coordinate: str) -> str:
    """Name of the motion that moves one coordinate."""
    name, _, number = coordinate.partition("_")
    kind = {"heading": "rotation", "z": "climb"}.get(name, f"translation in {name}")
    return f"{kind} of part {number}" if number else kind


def unit_of(coordinate: str) -> str:
    """Say the unit of a coordinate of a pose, with a space in front."""
    return " rad" if coordinate.startswith("heading") else " m"


def listed(motions: Sequence[str]) -> str:
    """Motions in a row, with 'translation' for all planar ones together."""
    planar = {"translation in x", "translation in y"}
    if planar <= set(motions):
        motions = [*(motion for motion in motions if motion not in planar), "translation"]
    if len(motions) < 2:
        return "".join(motions)
    return f"{', '.join(motions[:-1])} and {motions[-1]}"


REACH = 10.0  # poses are drawn this far from the origin [m]
RATES = 200  # random states and controls at which rates are looked at
USUAL = 2.0  # what has no limit is drawn from -USUAL to USUAL


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Region:
    """Boxes of states and controls; a check draws from them evenly.

    Parameters
    ----------
    group : type[LieGroup]
        Group whose symmetry is in question; it moves the first `group.dof` components of a state.
    states : (n_x, 2) array
        Least and greatest value of each component: pose, then reduced state.
    controls : (n_u, 2) array
        Least and greatest value of each control.
    reduced_names : tuple of str
        Names of the components of the reduced state, for messages.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> Region.of(SE2, n_controls=2, reduced_names=["speed"]).state_names
    ('x', 'y', 'heading', 'speed')
    """

    group: type[LieGroup]
    states: Array
    controls: Array
    reduced_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("states", "controls"):
            freeze(self, name, last=2)
            box = getattr(self, name)
            if box.ndim != 2 or np.any(box[:, 0] > box[:, 1]):
                raise ValueError(
                    f"region: {name} must be rows of least and greatest value, got {box.tolist()}"
                )
        if len(self.states) != len(self.state_names):
            raise ValueError(
                f"region: states has {len(self.states)} rows, need one for each of "
                f"{', '.join(self.state_names)}"
            )

    @classmethod
    def of(
        cls, group: type[LieGroup], *, n_controls: int, reduced_names: Sequence[str] = ()
    ) -> Region:
        """Region of the usual size for a plain function: 10 m around the origin, 2 otherwise."""
        unlimited = np.array([-np.inf, np.inf])
        reduced = np.tile(unlimited, (len(reduced_names), 1))
        return cls(
            group=group,
            states=np.concatenate([_poses(group), _finite(reduced)]),
            controls=_finite(np.tile(unlimited, (n_controls, 1))),
            reduced_names=tuple(reduced_names),
        )

    @classmethod
    def of_model(cls, model: Model) -> Region:
        """Region of a model: its limits, and the usual size where it has none."""
        return cls(
            group=model.group,
            states=np.concatenate([_poses(model.group), _finite(model.reduced_limits)]),
            controls=_finite(model.control_limits),
            reduced_names=model.reduced_names,
        )

    @classmethod
    def inside_of_model(cls, model: Model) -> tuple[Region, float]:
        """Middle half of what limits leave to the reduced state, and for how long it stays inside.

        The time [s] is that of the fastest of many random rates; infinite without such limits.
        """
        whole = cls.of_model(model)
        limits, dof = model.reduced_limits, model.group.dof
        limited = np.isfinite(limits).all(axis=1)
        if not limited.any():
            return whole, np.inf
        room = (limits[limited, 1] - limits[limited, 0]) / 4.0
        states = np.array(whole.states)
        states[dof:][limited] += np.stack([room, -room], axis=-1)
        region = replace(whole, states=states)
        rng = np.random.default_rng(0)
        drawn = np.array([region.state(rng)[dof:] for _ in range(RATES)])
        controls = np.array([region.control(rng) for _ in range(RATES)])
        rates = np.abs(model.reduced_dynamics(drawn, controls))[:, limited].max(axis=0)
        with np.errstate(divide="ignore"):
            return region, float((room / rates).min())

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the components of a state: pose, then reduced state."""
        return (*self.group.coordinates, *self.reduced_names)

    def state(self, rng: np.random.Generator) -> Array:
        """Draw one state (n_x,)."""
        return rng.uniform(self.states[:, 0], self.states[:, 1])

    def control(self, rng: np.random.Generator) -> Array:
        """Draw one control (n_u,)."""
        return rng.uniform(self.controls[:, 0], self.controls[:, 1])

    def element(self, rng: np.random.Generator, *, axis: int) -> LieGroup:
        """Draw a group element that moves one coordinate only."""
        low, high = _poses(self.group)[axis]
        return self.group(np.where(np.arange(self.group.dof) == axis, rng.uniform(low, high), 0.0))


def _poses(group: type[LieGroup]) -> Array:
    """(dof, 2): headings of either sign, positions around the origin."""
    reach = np.array([np.pi if name.startswith("heading") else REACH for name in group.coordinates])
    return np.stack([-reach, reach], axis=-1)


def _finite(limits: Array) -> Array:
    """Limits (n, 2) with a box of the usual size where one is infinite."""
    low, high = limits[:, 0], limits[:, 1]
    least = np.where(np.isfinite(low), low, np.minimum(-USUAL, high - 2 * USUAL))
    most = np.where(np.isfinite(high), high, np.maximum(USUAL, low + 2 * USUAL))
    return np.stack([least, most], axis=-1)


Draw = Callable[[np.random.Generator], tuple[Array, Array]]
"""Draws a state and a control."""

Defect = Callable[[LieGroup, Array, Array], tuple[Array, float]]
"""What changes at a state, under a control, when it is moved: (n,), and what is greatest there."""

NOWHERE = np.zeros(0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Question:
    """What is asked, and the words for the answer."""

    what: str  # "vector field"
    names: Callable[[int], str]  # of the components of the defect
    units: Callable[[int], str]  # of the same, with a space in front
    cause: Callable[[tuple[str, ...], tuple[int, ...]], str]  # from motions, components


@dataclass(frozen=True, slots=True, eq=False)
class Worst:
    """The sample, among those that move one coordinate, where most changes."""

    defect: Array
    admitted: float  # in the units of the defect
    state: Array
    control: Array
    by: LieGroup

    @property
    def violation(self) -> float:
        """Greatest change of a component."""
        return float(np.abs(self.defect).max(initial=0.0))

    @property
    def excess(self) -> float:
        """Violation over what is admitted."""
        return self.violation / self.admitted


def examine(
    question: Question,
    defect: Defect,
    *,
    region: Region,
    rng: np.random.Generator | None,
    samples: int,
    tolerance: float,
    draw: Draw | None = None,
) -> SymmetryReport:
    """Try `samples` random states, as `draw` draws them, for every coordinate of the group."""
    check_range("samples", samples, least=1)
    check_range("tolerance", tolerance, infinite=True)
    rng = np.random.default_rng(0) if rng is None else rng

    def tried(axis: int) -> Worst:
        by = region.element(rng, axis=axis)
        state, control = draw(rng) if draw else (region.state(rng), region.control(rng))
        change, size = defect(by, state, control)
        return Worst(change, tolerance * max(1.0, size), state, control, by)

    by_motion = {
        motion_of(name): max((tried(axis) for _ in range(samples)), key=lambda worst: worst.excess)
        for axis, name in enumerate(region.group.coordinates)
    }
    ranked = sorted(by_motion, key=lambda motion: -by_motion[motion].excess)
    broken = tuple(motion for motion in ranked if by_motion[motion].excess > 1.0)
    intact = tuple(motion for motion in by_motion if motion not in broken)
    worst = by_motion[ranked[0]]
    size = np.abs(worst.defect)
    order = np.argsort(-size, kind="stable")
    violated = tuple(int(i) for i in order if size[i] > worst.admitted)
    if broken:
        first = violated[0]
        still = f"; still invariant under {listed(intact)}" if intact else ""
        under = f", u = {vector_text(worst.control)}" if worst.control.size else ""
        message = (
            f"{question.what} is not invariant under {listed(broken)}: {question.names(first)} "
            f"changes by {abs(worst.defect[first]):.4g}{question.units(first)} at x = "
            f"{vector_text(worst.state)}{under}, moved by {vector_text(worst.by.pose)}{still}; "
            f"{question.cause(broken, violated)}"
        )
    else:
        message = (
            f"{question.what} is invariant under {listed(intact)} "
            f"(worst violation {worst.violation:.3g} in {samples} samples each)"
        )
    return SymmetryReport(
        what=question.what,
        holds=not broken,
        worst_violation=worst.violation,
        tolerance=tolerance,
        state=worst.state,
        control=worst.control,
        group_element=worst.by,
        components=tuple(question.names(i) for i in violated),
        broken=broken,
        intact=intact,
        message=message,
    )
