"""Vehicles on steered wheels that roll without slip: cars, with limited rates, with trailers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.models.vehicle import Components, Vehicle, check_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Car(Vehicle):
    """``heading' = v tan(steering) / wheelbase``, driving along its heading; control [v, steering].

    The pose is that of the middle of the rear axle.

    Source: LaValle (2006), *Planning Algorithms*, Eq. (13.15).

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float, optional
        Greatest steering angle to either side, less than pi / 2 [rad]; pi / 2 itself if None.
    max_speed : float, optional
        Greatest speed, forward and in reverse [m/s]; no limit if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = Car(wheelbase=2.5, max_steering=0.6)
    >>> car.body_velocity(np.zeros(0), np.array([2.0, 0.5])).round(3).tolist()
    [2.0, 0.0, 0.437]
    >>> round(car.turning_radius, 2)
    3.65
    """

    wheelbase: float  # [m]
    max_steering: float | None = None  # [rad]
    max_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "car"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "steering")

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the rear axle [m]; zero if steering has no limit."""
        if self.max_steering is None:
            return 0.0
        return self.wheelbase / math.tan(self.max_steering)

    @property
    def control_limits(self) -> Array:
        """Least and greatest speed [m/s] and steering angle [rad]: (2, 2)."""
        limits = self._limits(self.control_names)
        return np.clip(limits, [[-math.inf], [-math.pi / 2]], [[math.inf], [math.pi / 2]])

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return u[0], 0.0, u[0] * np.tan(u[1]) / self.wheelbase

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        steering = np.abs(as_array("control", control, last=2)[..., 1])
        if np.any(steering >= math.pi / 2):
            worst = float(steering.max())
            raise ValueError(f"car: steering must be less than pi / 2, got {worst:.6g} rad")
        return Vehicle.body_velocity(self, reduced_state, control)


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceleratingCar(Vehicle):
    """``speed' = acceleration``, rolling without slip; control [acceleration, steering].

    The reduced state is [speed]; ``heading' = speed tan(steering) / wheelbase``. The pose is that
    of the middle of the rear axle.

    Source: the car of the toolbox AROC; Kochdumper et al. (2021), *AROC: a toolbox for automated
    reachset optimal controller synthesis*, HSCC.

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed, max_acceleration : float
        Greatest speed [m/s], greatest rate of it up and down [m/s^2].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = AcceleratingCar(wheelbase=2.3, max_steering=1.0, max_speed=30.0, max_acceleration=9.0)
    >>> car.body_velocity(np.array([2.3]), np.array([1.0, np.pi / 4])).round(3).tolist()
    [2.3, 0.0, 1.0]
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    min_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "accelerating_car"
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed",)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return z[0], 0.0, z[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of [speed]: the acceleration."""
        return (u[0],)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrderCar(Vehicle):
    """``speed' = acceleration, steering' = steering_rate``, rolling without slip.

    The reduced state is [speed, steering], the control [acceleration, steering_rate]; the pose is
    that of the middle of the rear axle, and ``heading' = speed tan(steering) / wheelbase``.

    Source: the *kinematic single-track model* of Althoff, Koschi, Manzinger (2017), CommonRoad:
    composable benchmarks for motion planning on roads, and its vehicle models.

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed : float
        Greatest speed [m/s].
    max_acceleration : float
        Greatest rate of the speed, up and down [m/s^2].
    max_steering_rate : float
        Greatest rate of the steering angle to either side [rad/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.
    steering_at_rest : float
        Price of every radian that the wheels turn while the car stands, beside what a plan costs
        otherwise [1/rad]; inf: they never do.

    Examples
    --------
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5,
    ...                      max_acceleration=1.0, max_steering_rate=0.5)
    >>> car.body_velocity(np.array([2.0, 0.5]), np.array([1.0, 0.0])).round(3).tolist()
    [2.0, 0.0, 0.39]
    >>> car.reduced_limits.tolist()
    [[-2.5, 2.5], [-0.75, 0.75]]
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    max_steering_rate: float  # [rad/s]
    min_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    steering_at_rest: float = 0.0  # [1/rad]
    name: ClassVar[str] = "second_order_car"
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "steering")

    def steered(self, states: Array, controls: Array) -> tuple[Array, Array]:
        """Speeds between samples (n - 1,), the greater of both ends, and angles at them (n,)."""
        speeds = np.abs(states[:, 0])
        return np.maximum(speeds[:-1], speeds[1:]), states[:, 1]

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the rear axle [m]."""
        return self.wheelbase / math.tan(self.max_steering)

    @property
    def kinematic(self) -> Car:
        """The car whose paths it can follow if it stops where the curvature jumps."""
        return Car(wheelbase=self.wheelbase, max_steering=self.max_steering)

    def state_along(self, twist: Array, pace: float) -> Array:
        """Reduced state (2,) in which it moves with ``pace * twist``: the wheel stays as it is.

        Examples
        --------
        >>> car = SecondOrderCar(wheelbase=2.0, max_steering=1.0, max_speed=2.0,
        ...                      max_acceleration=1.0, max_steering_rate=0.5)
        >>> car.state_along(np.array([-1.0, 0.0, 0.5]), 0.0).round(4).tolist()
        [-0.0, -0.7854]
        """
        steering = math.atan(self.wheelbase * float(twist[2]) / float(twist[0]))
        return np.array([pace * float(twist[0]), steering])

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return z[0], 0.0, z[0] * np.tan(z[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, steering]: the control."""
        return u[0], u[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class CarWithTrailer(Vehicle):
    """A kinematic car that pulls one trailer, hitched at its rear axle; control [speed, steering].

    The reduced state is [hitch], the heading of the car less that of the trailer:
    ``hitch' = speed tan(steering) / wheelbase - speed sin(hitch) / hitch_length``. The pose is
    that of the middle of the car's rear axle. In reverse the hitch is unstable.

    Source: LaValle (2006), *Planning Algorithms*, Eq. (13.19), for one trailer.

    Parameters
    ----------
    wheelbase, hitch_length : float
        Distance of the axles of the car; of the trailer's axle from the hitch [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed : float
        Greatest speed [m/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_hitch : float, optional
        Greatest angle at the hitch to either side [rad]; no limit if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> truck = CarWithTrailer(wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5)
    >>> truck.reduced_dynamics(np.array([np.pi / 2]), np.array([0.5, 0.0])).tolist()
    [-1.0]
    >>> (truck.part_poses(np.array([np.pi / 2])).round(3) + 0.0).tolist()
    [[0.0, 0.5, -1.571]]
    """

    wheelbase: float  # [m]
    hitch_length: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    min_speed: float | None = None  # [m/s]
    max_hitch: float | None = None  # [rad]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "car_with_trailer"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "steering")
    reduced_names: ClassVar[tuple[str, ...]] = ("hitch",)
    part_names: ClassVar[tuple[str, ...]] = ("trailer",)

    @property
    def kinematic(self) -> Car:
        """The car that pulls, alone: it has the same controls and twists."""
        return Car(wheelbase=self.wheelbase, max_steering=self.max_steering)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return u[0], 0.0, u[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of [hitch]: turn rate of the car less that of the trailer."""
        return (u[0] * np.tan(u[1]) / self.wheelbase - u[0] * np.sin(z[0]) / self.hitch_length,)

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, Any, Any], ...]:
        """Components of the pose of each part: the middle of the trailer's axle.

        Source: turned back by the hitch angle, then back along the trailer by its length.
        """
        return ((-self.hitch_length * np.cos(z[0]), self.hitch_length * np.sin(z[0]), -z[0]),)


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

    @property
    def kinematic(self) -> Car:
        """The car that pulls, alone: it has the same controls and twists."""
        return Car(wheelbase=self.wheelbase, max_steering=self.max_steering)

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
