"""The vehicle on the road: a second-order car, and its automaton of trims and ramps between them.

A trim is a speed and a steering angle that are held. The angles of a speed are spread between
those of the lateral limit and of the car itself, closer to straight ahead, and no two neighbours
are further apart than a maneuver can steer: tight turns, which only slow driving admits, need more
of them. Every maneuver lasts the same time and changes both at constant rates.

The search works on arrays, which a kernel makes in 30 ms; the `Automaton` of the same trims and
maneuvers, 18,000 values with their courses, takes 1.5 s and is made when it is asked for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, check_fields, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.roads import _kernels_motion
from maneuver_automaton.roads.arrays import Limits, Maneuvers, RoadTrims
from maneuver_automaton.roads.plans import ramps, trim_of


def bmw_320i() -> SecondOrderCar:
    """The car of CommonRoad's benchmarks, its acceleration held to what a dry road gives.

    Source: Althoff, Würsching (2020), *CommonRoad: Vehicle Models*, vehicle 2: wheelbase, limits of
    steering, speed. The 11.5 m/s^2 that it states are the limit of its tyres; 8 are used here.

    Examples
    --------
    >>> bmw_320i().max_steering
    1.066
    """
    return SecondOrderCar(
        wheelbase=2.5789,
        max_steering=1.066,
        max_speed=50.8,
        min_speed=0.0,
        max_acceleration=8.0,
        max_steering_rate=0.4,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadVehicle:
    """A car with a rectangular body; the pose is that of the rear axle's middle.

    Source of the numbers: as `bmw_320i`; the middle is the center of mass.

    Examples
    --------
    >>> car = RoadVehicle()
    >>> car.middle_of([0.0, 0.0, 0.0]).round(4).tolist()
    [1.4227, 0.0, 0.0]
    >>> car.rear_of([3.0, 0.0, 0.0]).round(4).tolist()
    [1.5773, 0.0, 0.0]
    """

    model: SecondOrderCar = field(default_factory=bmw_320i)
    length: float = 4.508  # [m]
    width: float = 1.610  # [m]
    ahead: float = 1.42273  # [m] from the rear axle to the middle of the body
    power_speed: float = 7.319  # [m/s] beyond it, what the engine gives falls with speed
    engine: float = 8.0  # [m/s^2] the engine gives up to that speed
    lateral: float = 5.0  # [m/s^2] across, at most, where maneuvers begin and end
    friction: float = 9.0  # [m/s^2] along and across together, there; fail-safe stops may take more

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        sizes = ("length", "width", "power_speed", "engine", "lateral", "friction")
        check_fields("road vehicle", self, *sizes)
        if not math.isfinite(self.ahead):
            raise ValueError(f"road vehicle: ahead must be finite, got {self.ahead} m")

    @property
    def footprint(self) -> Box:
        """The body, seen from the rear axle."""
        return Box([self.length, self.width], [self.ahead, 0.0])

    def middle_of(self, rear: ArrayLike) -> Array:
        """Pose (..., 3) of the body's middle where the rear axle is at `rear` (..., 3)."""
        return (SE2(np.asarray(rear)) @ SE2(np.array([self.ahead, 0.0, 0.0]))).pose

    def rear_of(self, middle: ArrayLike) -> Array:
        """Pose (..., 3) of the rear axle where the body's middle is at `middle` (..., 3)."""
        return (SE2(np.asarray(middle)) @ SE2(np.array([-self.ahead, 0.0, 0.0]))).pose

    def steering_of(self, speed: float, turn_rate: float) -> float:
        """Steering angle that turns at a rate [rad/s], within the limit; zero at rest [rad]."""
        if speed <= 0.0:
            return 0.0
        angle = math.atan(turn_rate * self.model.wheelbase / speed)
        return min(max(angle, -self.model.max_steering), self.model.max_steering)

    def sharpest(self, speed: ArrayLike) -> Array:
        """Greatest steering angle at speeds [m/s] that keeps the lateral limit [rad]."""
        squares = np.maximum(np.square(np.asarray(speed, dtype=np.float64)), 1e-9)
        angles = np.arctan(self.lateral * self.model.wheelbase / squares)
        return np.minimum(angles, self.model.max_steering)


LONGEST_TICK = 0.1  # [s] the proof between two ticks is for motions this short
DURATION = 0.5  # [s] of a maneuver, or the nearest number of time steps
SPEED_STEP = 1.0  # [m/s] between speeds if a maneuver lasts that long; else in proportion
FASTER = 0.2  # [m/s] than a speed of the grid
SHARES = (0.0, 0.05, 0.16, 0.36, 0.66, 1.0)  # of the sharpest angle, to either side
MOST_STEPS = 4  # of speed that a maneuver spans
SAMPLES = 0.5  # [m] between those of courses: a fine library takes 230 MB
LEFT_OUT = (2.5, 3.5)  # steps of speed: changes that others do as well


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadLibrary:
    """Trims and maneuvers of one vehicle."""

    limits: Limits
    trims: RoadTrims
    maneuvers: Maneuvers

    def automaton(self, model: SecondOrderCar) -> Automaton:
        """The trims and maneuvers as an `Automaton`, to be drawn, saved, or planned with elsewhere.

        Their names are those in the words of plans. Holding a trim is no maneuver.

        Examples
        --------
        >>> car = RoadVehicle()
        >>> library = road_library(car, top_speed=1.0).automaton(car.model)
        >>> len(library), library.maneuvers[0].name
        (34, 'acceleration 0, steering rate 0.362')
        """
        states = np.stack([self.trims.speed, self.trims.steering], axis=-1)
        trims = [trim_of(model, state) for state in states]
        sources = np.repeat(np.arange(len(states)), np.diff(self.maneuvers.first))
        changing = np.flatnonzero(self.maneuvers.control.any(axis=1))
        control = self.maneuvers.control[changing]
        maneuvers = ramps(
            model,
            [trims[k] for k in sources[changing]],
            [trims[k] for k in self.maneuvers.target[changing]],
            control=control,
            durations=np.full(len(control), self.limits.tick * self.limits.ticks),
            max_step_m=SAMPLES,
        )
        return Automaton(model, tuple(trims), maneuvers, name="ramps")


def tick_of(step: float) -> float:
    """The longest tick of at most 0.1 s that divides the time step [s] of a scene."""
    return step / math.ceil(step / LONGEST_TICK - 1e-9)


def road_library(
    vehicle: RoadVehicle,
    *,
    top_speed: float,
    step: float = LONGEST_TICK,
    within: Sequence[tuple[float, float]] = (),
    at: Sequence[float] = (),
) -> RoadLibrary:
    """Trims of speeds up to `top_speed`, and all maneuvers of them.

    A maneuver lasts a whole number of a scene's time steps [s], so that controls change at these.
    Some trims are `within` each interval, and some `at` each speed of a list [m/s].

    Examples
    --------
    >>> library = road_library(RoadVehicle(), top_speed=3.0)
    >>> library.trims.speed.size, library.maneuvers.pose.shape[1:]
    (66, (5, 3))
    >>> float(library.trims.steering.max())
    1.066
    """
    tick = tick_of(step)
    ticks = max(round(DURATION / step), 1) * round(step / tick)
    apart = SPEED_STEP * tick * ticks / DURATION
    engine = min(vehicle.engine, vehicle.model.max_acceleration)
    grid = apart * np.arange(math.floor(top_speed / apart + 1e-9) + 1)
    # From speeds beyond it, the engine does not lead to the next one of the grid.
    level = engine * vehicle.power_speed * tick * ticks / apart - apart
    more = [
        (low, high)
        for low, high in within
        if low > 0.0 and high < grid[-1] and not ((grid >= low) & (grid <= high)).any()
    ]
    # What is hardly faster than one of the grid is not worth a trim.
    exact = [one for one in at if one < grid[-1] and one % apart > FASTER]
    if any(low > level for low, _ in within):
        exact += (0.5 * (grid[:-1] + grid[1:]))[grid[:-1] > level].tolist()
    speeds = np.union1d(grid, [*np.mean(np.reshape(more, (-1, 2)), axis=1), *exact])
    most_steps = MOST_STEPS + len(speeds) - len(grid)
    angles = [
        _angles(float(sharpest), most=vehicle.model.max_steering_rate * tick * ticks)
        for sharpest in vehicle.sharpest(speeds)
    ]
    counts = [len(one) for one in angles]
    limits = Limits(
        wheelbase=vehicle.model.wheelbase,
        tick=tick,
        ticks=ticks,
        rate=vehicle.model.max_steering_rate,
        sharpest=vehicle.model.max_steering,
        braking=vehicle.model.max_acceleration,
        lateral=vehicle.lateral,
        friction=vehicle.friction,
        engine=engine,
        power_speed=vehicle.power_speed,
        left_out=(LEFT_OUT[0] * apart, LEFT_OUT[1] * apart),
        most_steps=most_steps,
        weight_along=0.05,
        weight_across=0.05,
        weight_jerk=0.002,
    )
    trims = RoadTrims(
        speed=np.repeat(speeds, counts),
        steering=np.concatenate(angles),
        first=np.cumsum([0, *counts]).astype(np.int64),
    )
    most = trims.speed.size * (2 * most_steps + 1) * max(counts)
    return RoadLibrary(
        limits=limits, trims=trims, maneuvers=_kernels_motion.maneuvers_between(limits, trims, most)
    )


def _angles(sharpest: float, *, most: float) -> Array:
    """Steering angles (n,) of one speed, neighbours at most `most` apart [rad]."""
    right = [0.0]
    for before, after in itertools.pairwise(SHARES):
        parts = max(math.ceil((after - before) * sharpest / most - 1e-9), 1)
        right += [sharpest * (before + (after - before) * k / parts) for k in range(1, parts + 1)]
    return np.array([*(-angle for angle in right[:0:-1]), *right])
