"""A tractor with one, two or three trailers, each hitched on or off the axle in front of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton.models.vehicle import Components, Vehicle, check_parameters

OFFSETS = ("hitch_offset", "hitch_offset_2", "hitch_offset_3")


class _OfEach:
    """Names, one for each trailer: of a tractor those it pulls, of the class the most."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def __get__(self, tractor: Any, owner: type) -> tuple[str, ...]:
        return self.names if tractor is None else self.names[: len(tractor.lengths)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TractorWithTrailers(Vehicle):
    """A kinematic tractor that pulls up to three trailers; control [speed, steering].

    The reduced state has one angle for each hitch: the heading of what pulls less that of the
    trailer. A vehicle that moves at ``v`` and turns at ``omega`` pulls a trailer, hitched
    ``offset`` behind its axle and ``length`` before the trailer's own, which turns at
    ``(v sin(hitch) - offset omega cos(hitch)) / length`` and moves at
    ``v cos(hitch) + offset omega sin(hitch)``. The pose is that of the middle of the tractor's
    rear axle. In reverse the hitches are unstable.

    Source: Altafini (2001), *Some properties of the general n-trailer*, Int. J. Control 74(4).
    The truck with dolly and semitrailer of Ljungqvist, Evestedt, Axehill, Cirillo, Pettersson
    (2019), *A path planning and path-following control framework for a general 2-trailer with a
    car-like tractor*, J. Field Robotics 36(8), has a wheelbase of 4.6 m, a hitch 1.7 m behind the
    axle, and lengths of 3.9 m and 8.0 m.

    Parameters
    ----------
    wheelbase : float
        Distance of the axles of the tractor [m].
    hitch_length, hitch_length_2, hitch_length_3 : float
        From a hitch to the axle of its trailer [m]; None: no such trailer.
    hitch_offset, hitch_offset_2, hitch_offset_3 : float
        From the axle in front of a hitch back to it [m]; negative before the axle.
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_hitch : float
        Greatest angle at each hitch to either side [rad].
    max_speed : float
        Greatest speed [m/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.

    Examples
    --------
    >>> truck = TractorWithTrailers(wheelbase=4.6, hitch_length=3.9, hitch_offset=1.7,
    ...     hitch_length_2=8.0, max_steering=0.7, max_hitch=1.0, max_speed=3.0)
    >>> truck.reduced_names, truck.part_names
    (('hitch', 'hitch_2'), ('trailer', 'trailer_2'))
    >>> truck.part_poses(np.zeros(2)).tolist()
    [[-5.6, 0.0, 0.0], [-13.6, 0.0, 0.0]]
    """

    wheelbase: float  # [m]
    hitch_length: float  # [m]
    max_steering: float  # [rad]
    max_hitch: float  # [rad]
    max_speed: float  # [m/s]
    min_speed: float | None = None  # [m/s]
    hitch_offset: float = 0.0  # [m]
    hitch_length_2: float | None = None  # [m]
    hitch_offset_2: float = 0.0  # [m]
    hitch_length_3: float | None = None  # [m]
    hitch_offset_3: float = 0.0  # [m]
    name: ClassVar[str] = "tractor_with_trailers"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "steering")
    reduced_names: ClassVar[Any] = _OfEach("hitch", "hitch_2", "hitch_3")
    part_names: ClassVar[Any] = _OfEach("trailer", "trailer_2", "trailer_3")

    def __post_init__(self) -> None:
        check_parameters(self, but=OFFSETS)
        for name in OFFSETS:
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{self.name}: {name} must be finite, got {getattr(self, name)}")
        if self.hitch_length_3 is not None and self.hitch_length_2 is None:
            raise ValueError(f"{self.name}: hitch_length_3 needs hitch_length_2, got None")

    @property
    def lengths(self) -> tuple[float, ...]:
        """From each hitch to the axle of its trailer [m], one for each trailer."""
        lengths = (self.hitch_length, self.hitch_length_2, self.hitch_length_3)
        return tuple(length for length in lengths if length is not None)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return u[0], 0.0, u[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of each hitch: turn rate of what pulls less that of the trailer."""
        speed, _, turn = self.velocity(z, u)
        rates = []
        for k, length in enumerate(self.lengths):
            across = getattr(self, OFFSETS[k]) * turn  # of the hitch, to the right
            cosine, sine = np.cos(z[k]), np.sin(z[k])
            turned = (speed * sine - across * cosine) / length
            rates.append(turn - turned)
            speed, turn = speed * cosine + across * sine, turned
        return tuple(rates)

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, Any, Any], ...]:
        """Components of the pose of each trailer: the middle of its axle."""
        x, y, heading = 0.0 * z[0], 0.0 * z[0], 0.0 * z[0]
        frames = []
        for k, length in enumerate(self.lengths):
            offset = getattr(self, OFFSETS[k])
            x, y = x - offset * np.cos(heading), y - offset * np.sin(heading)
            heading = heading - z[k]
            x, y = x - length * np.cos(heading), y - length * np.sin(heading)
            frames.append((x, y, heading))
        return tuple(frames)
