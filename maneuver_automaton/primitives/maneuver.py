"""Maneuvers: transitions between trims, the edges of a maneuver automaton."""

from __future__ import annotations

from dataclasses import dataclass

from maneuver_automaton._arrays import Array, freeze


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Maneuver:
    """A transition of fixed displacement, duration and cost from one trim to another.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-B.

    Examples
    --------
    >>> Maneuver(name="brake", source="cruise", target="rest", displacement=[2.0, 0.0, 0.0],
    ...          duration=1.5).is_identity
    False
    """

    name: str
    source: str  # name of the trim it leaves
    target: str  # name of the trim it reaches
    displacement: Array  # (dof,) pose gained, in the frame where it starts
    duration: float = 0.0  # [s]

    def __post_init__(self) -> None:
        freeze(self, "displacement", last=(3, 4))
        if not self.duration >= 0.0:
            raise ValueError(
                f"maneuver {self.name!r}: duration must not be negative, got {self.duration} s"
            )

    @property
    def is_identity(self) -> bool:
        """Whether it changes nothing and takes no time: the switch of a kinematic vehicle."""
        return self.duration == 0.0 and not self.displacement.any()
