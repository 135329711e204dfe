"""Zones: parts of the plane in which only some motions are admitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, check_fields, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.collision.shapes import AnyShape, Shape, as_shape
from maneuver_automaton.groups import LieGroup

EXCEEDED = 1e-9  # relative, by which a limit may be exceeded


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Zone:
    """Where the vehicle moves under a guard: slowly, forwards only, with less grip, by some trims.

    It holds wherever any part of the body, or of what it carries, is in the zone, its border
    included. To stand still is always admitted by a limit.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box
    >>> school = Zone(shape=Box([10.0, 4.0]), max_speed=1.0, reverse=False)
    >>> school.admits(np.array([[0.9, 0, 0], [1.5, 0, 0], [-0.5, 0, 0]])).tolist()
    [True, False, False]
    """

    shape: Shape
    max_speed: float | None = None  # [m/s]
    reverse: bool = True  # whether it may drive backwards
    max_lateral_acceleration: float | None = None  # [m/s^2] speed times turn rate
    trims: tuple[str, ...] | None = None  # only these, and maneuvers between them; None: all
    name: str = ""

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            shape: AnyShape,
            max_speed: float | None = None,
            reverse: bool = True,
            max_lateral_acceleration: float | None = None,
            trims: Sequence[str] | None = None,
            name: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        object.__setattr__(self, "shape", as_shape("zone", self.shape))
        check_fields("zone", self, "max_speed", "max_lateral_acceleration", least=0)
        if self.trims is not None:
            object.__setattr__(self, "trims", tuple(self.trims))
        limits = (self.max_speed, self.max_lateral_acceleration, self.trims)
        if limits == (None,) * 3 and self.reverse and type(self).admits is Zone.admits:
            raise ValueError(
                "zone: forbids nothing, need max_speed, max_lateral_acceleration, reverse=False or "
                "trims"
            )

    def admits(self, twists: Array) -> NDArray[np.bool_]:
        """Whether body velocities (..., dof) are admitted in the zone, whatever the trim is."""
        speeds = np.linalg.norm(twists[..., :2], axis=-1)
        good = np.ones(speeds.shape, dtype=np.bool_)
        if self.max_speed is not None:
            good &= speeds <= self.max_speed * (1.0 + EXCEEDED) + EXCEEDED
        if self.max_lateral_acceleration is not None:
            lateral = speeds * np.abs(twists[..., 2])
            good &= lateral <= self.max_lateral_acceleration * (1.0 + EXCEEDED) + EXCEEDED
        if not self.reverse:
            good &= twists[..., 0] >= -EXCEEDED
        return good

    def admits_names(self, names: Sequence[str]) -> bool:
        """Whether trims of these names are admitted in the zone, whatever their velocities."""
        return self.trims is None or all(name in self.trims for name in names)

    def moved(self, by: LieGroup) -> Zone:
        """The zone moved by a planar pose."""
        return replace(self, shape=self.shape.moved(by))

    @property
    def words(self) -> str:
        """Its name, or what it asks for."""
        return self.name or f"zone ({self.asks})"

    @property
    def asks(self) -> str:
        """What it asks for.

        Examples
        --------
        >>> from maneuver_automaton.collision import Box
        >>> Zone(shape=Box([10.0, 4.0]), max_speed=1.0, reverse=False).asks
        'at most 1 m/s, forwards only'
        """
        asked = [
            f"at most {self.max_speed:g} m/s" if self.max_speed is not None else "",
            "forwards only" if not self.reverse else "",
            f"at most {self.max_lateral_acceleration:g} m/s^2 sideways"
            if self.max_lateral_acceleration is not None
            else "",
            f"only {', '.join(self.trims)}" if self.trims is not None else "",
        ]
        return ", ".join(words for words in asked if words)
