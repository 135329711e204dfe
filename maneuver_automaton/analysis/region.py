"""Where a check draws its random states and controls from, and what their components are called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import Model

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
        region = cls(
            group=model.group,
            states=states,
            controls=whole.controls,
            reduced_names=model.reduced_names,
        )
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
