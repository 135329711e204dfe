"""A vehicle's bodies in time: where they are, between which heights, and as others see them."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._lazy import shapely
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import sampled_finely
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.shapes import Box, Disc, Obstacle, Polygon, Shape
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_library import altitude_ranges

BANDS = 8  # into which a climb is cut at most, about, to be an obstacle of one height in each
THIN = 1e-6  # [m] by which what is flat stands out, either way
OFF = 2e-5  # [m] by which a body may leave the coasts that stand for its maneuvers


class HeightBand(NamedTuple):
    """From when until when [s] a body keeps between two heights [m]."""

    begin: float
    end: float
    low: float
    high: float

    def above(self, low: float, high: float) -> float:
        """How far [m] it is above or below what stands between two heights; 0 if beside it."""
        return max(self.low - high, low - self.high, 0.0)


ALWAYS = (HeightBand(-math.inf, math.inf, -math.inf, math.inf),)  # of what has no height of its own


@dataclass(frozen=True, eq=False)
class Levels:
    """The altitude of a vehicle in time, linear between, and how far its body reaches about it."""

    time: Array  # (n,) [s]
    altitude: Array  # (n,) [m], held before and after
    body: tuple[float, float]  # [m] lowest and highest point about it
    swing: Array = field(default_factory=lambda: np.zeros(0))  # (n - 1,) [m] off that line at most

    def __post_init__(self) -> None:
        if not np.size(self.swing):
            object.__setattr__(self, "swing", np.zeros(np.size(self.time) - 1))
        for name in ("time", "altitude", "swing"):
            freeze(self, name)

    @classmethod
    def of_plan(cls, plan: Plan, body: tuple[float, float]) -> Levels:
        """Those of a vehicle that drives a plan in space; its body from low to high about z [m]."""
        times, _, _ = plan.coasts
        of = np.searchsorted(plan.switching_times, 0.5 * (times[1:] + times[:-1])) - 1
        off = _swings(plan)
        swing = np.array([off.get(id(plan.primitives[k]), 0.0) for k in of.tolist()])
        return cls(times, plan.pose_at(times)[:, 3], body, swing)

    @functools.cached_property
    def bands(self) -> tuple[HeightBand, ...]:
        """Stretches of time, for ever in both directions, each with bounds of the heights in it."""
        spread = float(np.ptp(self.altitude))
        most = max(spread / BANDS, self.body[1] - self.body[0], THIN) * (1.0 + 1e-9)
        found: list[HeightBand] = []
        for one in self._pieces(most):
            low, high = one.low, one.high
            if found:
                low, high = min(low, found[-1].low), max(high, found[-1].high)
            if found and high - low <= most:
                found[-1] = HeightBand(found[-1].begin, one.end, low, high)
            else:
                found.append(one)
        below, above = self.body[0] - THIN, self.body[1] + THIN
        grown = [one._replace(low=one.low + below, high=one.high + above) for one in found]
        grown[0] = grown[0]._replace(begin=-math.inf)
        grown[-1] = grown[-1]._replace(end=math.inf)
        return tuple(grown)

    def _pieces(self, most: float) -> list[HeightBand]:
        """Stretches between two times, cut where they climb more than that [m]."""
        at = float(self.altitude[0])
        pieces = [HeightBand(float(self.time[0]), float(self.time[0]), at, at)]
        rows = itertools.pairwise(zip(self.time.tolist(), self.altitude.tolist(), strict=True))
        for ((begin, first), (end, last)), off in zip(rows, self.swing.tolist(), strict=True):
            n = max(1, math.ceil(abs(last - first) / most))
            times, levels = np.linspace(begin, end, n + 1), np.linspace(first, last, n + 1)
            for (t, z), (t_after, z_after) in itertools.pairwise(
                zip(times.tolist(), levels.tolist(), strict=True)
            ):
                pieces.append(HeightBand(t, t_after, min(z, z_after) - off, max(z, z_after) + off))
        return pieces

    @property
    def reach(self) -> tuple[float, float]:
        """How far the body reaches about its altitude where that may be off [m]."""
        off = float(np.max(self.swing, initial=0.0))
        return self.body[0] - off, self.body[1] + off

    def at(self, time: ArrayLike) -> Array:
        """Altitudes (...,) at `time` (...,) [s]."""
        return np.asarray(np.interp(np.asarray(time), self.time, self.altitude))


def levels_of(problem: Problem, plan: Plan | None = None) -> Levels | None:
    """Heights of a vehicle on a plan, or at its start; None if it counts at all heights."""
    low, high = problem.body_height
    in_plane = problem.start.size == 3
    if plan is not None and not in_plane:
        return Levels.of_plan(plan, (low, high))
    if in_plane and not low < high:
        return None
    altitude = np.zeros(1) if in_plane else problem.start[3:]
    return Levels(np.array([problem.start_time]), altitude, (low, high))


def _swings(plan: Plan) -> dict[int, float]:
    """How far [m] altitudes of maneuvers are off the lines between their samples, by identity."""
    found = {}
    for source, one, target in zip(plan.trims, plan.maneuvers, plan.trims[1:], strict=False):
        if one is None or one.course is None:
            continue
        samples = one.course.pose[:, 3]
        climbs = np.array([[source.body_velocity[3], target.body_velocity[3]]])
        low, _ = altitude_ranges([one], climbs, np.array([0]), np.array([samples.size - 1]))
        found[id(one)] = float(samples.min() - low[0])
    return found


def followed(plan: Plan, shapes: Mapping[str, tuple[Shape, ...]]) -> Plan:
    """A plan whose coasts are followed within `OFF` by bodies, each by its part's name, or ""."""
    if not any(plan.maneuvers):
        return plan
    reaches = tuple((part, radius_of(own)) for part, own in shapes.items())
    finer = tuple(one and sampled_finely(one, reaches, OFF) for one in plan.maneuvers)
    return replace(plan, maneuvers=finer)


def radius_of(shapes: tuple[Shape, ...]) -> float:
    """How far any point of a body is from its pose [m]."""
    body = body_of(shapes)
    return math.hypot(body.middle_x, body.middle_y) + body.reach


@dataclass(frozen=True, slots=True, eq=False)
class FleetCourse:
    """A vehicle's bodies in time: each of its parts with a motion, while it is there."""

    shapes: tuple[tuple[Shape, ...], ...]  # of the vehicle and of what it carries
    motions: tuple[Motion, ...]
    until: float = math.inf  # [s] when it is gone; inf if it stays
    grown: float = 0.0  # [m] by how much larger others see it
    levels: Levels | None = None  # between which heights it is; None: it counts at all of them
    bodies: tuple[Obstacle, ...] = field(init=False)  # as they are
    obstacles: tuple[Obstacle, ...] = field(init=False)  # as others see them

    def __post_init__(self) -> None:
        bodies = tuple(
            _during(band, shape, motion)
            for shapes, motion in zip(self.shapes, self.motions, strict=True)
            for shape in shapes
            for band in self.bands
        )
        object.__setattr__(self, "bodies", bodies)
        by = self.grown
        seen = bodies
        if by > 0.0:
            heights = [one.height and (one.height[0] - by, one.height[1] + by) for one in bodies]
            seen = tuple(
                replace(one, shape=larger(one.shape, by), height=height)
                for one, height in zip(bodies, heights, strict=True)
            )
        object.__setattr__(self, "obstacles", seen)

    @property
    def bands(self) -> tuple[HeightBand, ...]:
        """Stretches of time in which it keeps between two heights, as long as it is there."""
        first = min(float(one.time[0]) for one in self.motions)
        bands = ALWAYS if self.levels is None else self.levels.bands
        there = [one for one in bands if one.begin < self.until and one.end > first] or bands[-1:]
        rows = [one._replace(end=min(one.end, self.until)) for one in there]
        return (rows[0]._replace(begin=-math.inf), *rows[1:])

    @property
    def arrived(self) -> tuple[Obstacle, ...]:
        """What is left of it once it has arrived: where it stands, or nothing if it leaves."""
        if self.until < math.inf:
            return ()
        return tuple(where_it_stays(one) for one in self.obstacles if one.presence[1] == math.inf)

    @property
    def staying(self) -> FleetCourse:
        """The same of a vehicle that stays where it ends."""
        return self if self.until == math.inf else replace(self, until=math.inf)

    @property
    def quiet_after(self) -> float:
        """When it has come to rest for good, or is gone [s]."""
        return min(self.until, max(float(one.time[-1]) for one in self.motions))

    def after(self, time: float) -> FleetCourse:
        """What is left of it from a time on [s]."""
        if all(time <= float(one.time[0]) for one in self.motions):
            return self
        return replace(self, motions=tuple(motion_from(one, time) for one in self.motions))


def _during(band: HeightBand, shape: Shape, motion: Motion) -> Obstacle:
    """A body that is between the heights of a band, while that lasts."""
    lasts, there = (band.begin, band.end), (band.low, band.high)
    return Obstacle(
        shape,
        motion=motion,
        present_s=None if lasts == (-math.inf, math.inf) else lasts,
        height=None if there == (-math.inf, math.inf) else there,
    )


@functools.lru_cache(maxsize=8192)
def where_it_stays(body: Obstacle) -> Obstacle:
    """What stands where a moving body ends."""
    assert body.motion is not None
    return Obstacle(body.at(float(body.motion.time[-1])), height=body.height)


def standing_still(body: Obstacle) -> Obstacle:
    """A body that never moves as a static one, round which searches are led; any other as it is."""
    motion = body.motion
    if motion is None or len(motion.time) > 1 or body.presence != (-math.inf, math.inf):
        return body
    return where_it_stays(body)


def motion_from(motion: Motion, time: float) -> Motion:
    """A motion from a time on [s]."""
    if time <= float(motion.time[0]):
        return motion
    first = int(np.searchsorted(motion.time, time, side="right"))
    times = np.concatenate([[time], motion.time[first:]])
    poses = np.concatenate([motion.at(time)[None], motion.pose[first:]])
    return Motion(times, poses, motion.rates[first - 1 :])


@functools.lru_cache(maxsize=1024)
def larger(shape: Shape, by: float) -> Shape:
    """A shape that holds all within a length [m] of another, with square corners."""
    if by <= 0.0:
        return shape
    if isinstance(shape, Disc):
        return Disc(shape.radius + by, shape.center)
    if isinstance(shape, Box):
        return Box(shape.size + 2.0 * by, shape.center, shape.heading)
    return Polygon(shapely.Polygon(shape.corners, shape.holes).buffer(by, join_style="mitre"))
