"""Trims: steady motions, the nodes of a maneuver automaton."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import FASTEST, FASTEST_SPIN
from maneuver_automaton.groups import LieGroup

Pose = TypeVar("Pose", bound=LieGroup)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trim:
    """Motion that looks the same at every instant: constant control, constant twist.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-A; the paper's Definition 5.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> turn = Trim(name="turn", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
    >>> turn.coast(SE2([0.0, 0.0, 0.0]), np.pi).pose.round(3).tolist()
    [0.0, 2.0, 3.142]
    """

    name: str
    body_velocity: Array  # (dof,) [m/s, m/s, rad/s(, m/s)]; [m/s, m/s] where nothing turns
    control: Array  # (n_u,), the model's units
    reduced_state: Array = field(default_factory=lambda: np.zeros(0))  # (n_z,), the model's units
    max_duration: float = math.inf  # [s]

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "body_velocity", last=(2, 3, 4))
        freeze(self, "control")
        freeze(self, "reduced_state")
        if not isinstance(self.name, str) or not self.name.strip():
            raise ValueError(
                f"trim: got the name {self.name!r}, need at least one visible character"
            )
        places = [0, 1, *range(3, self.body_velocity.shape[-1])]
        fastest = float(np.abs(self.body_velocity[..., places]).max(initial=0.0))
        if fastest > FASTEST:
            raise ValueError(
                f"trim {self.name!r}: body_velocity holds {fastest:g} m/s, "
                f"need at most {FASTEST:g} m/s"
            )
        spin = float(np.abs(self.body_velocity[..., 2:3]).max(initial=0.0))
        if spin > FASTEST_SPIN:
            raise ValueError(
                f"trim {self.name!r}: body_velocity turns at {spin:g} rad/s, "
                f"need at most {FASTEST_SPIN:g} rad/s"
            )
        if not self.max_duration > 0.0:
            raise ValueError(
                f"trim {self.name!r}: max_duration must be positive, got {self.max_duration} s"
            )

    @property
    def is_rest(self) -> bool:
        """Whether the trim is a rest: zero twist."""
        return not any(self.body_velocity.tolist())

    def coast(self, start: Pose, duration: ArrayLike) -> Pose:
        """Poses after coasting from `start` for `duration` (...,) [s]."""
        return start @ start.exp(np.multiply.outer(np.asarray(duration), self.body_velocity))
