"""Shapes as values: bodies of vehicles, obstacles, occupancy maps, motions.

All are solids, and closed: to touch one is to collide with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array, freeze, wrapped
from maneuver_automaton._brief import brief
from maneuver_automaton._ceilings import FASTEST, FASTEST_TURN, LARGEST_BODY, check_size
from maneuver_automaton.collision.geometry import (
    Geometry,
    are_points,
    is_geometry,
    one_ring,
    rings_of_geometry,
)
from maneuver_automaton.groups import SE2, LieGroup

GAP = 1e-8  # of the size of a motion: how far beside its next pose a twist may lead


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """A polygon, concave or with holes if need be, its corners in either order.

    A polygon of shapely may stand for the corners: its holes are taken too.

    Examples
    --------
    >>> Polygon([[0, 0], [4, 0], [4, 2]]).moved(SE2([1.0, 0.0, 0.0])).corners.tolist()
    [[1.0, 0.0], [5.0, 0.0], [5.0, 2.0]]
    >>> import shapely
    >>> court = shapely.box(0, 0, 9, 9).difference(shapely.box(3, 3, 6, 6))
    >>> len(Polygon(court).corners), len(Polygon(court).holes)
    (4, 1)
    """

    corners: Array  # (n, 2) [m]
    holes: tuple[Array, ...] = ()  # (n, 2) each [m]

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self, corners: ArrayLike | Geometry, holes: Sequence[ArrayLike] = ()
        ) -> None: ...

    def __post_init__(self) -> None:
        if is_geometry(self.corners):
            if len(self.holes):
                raise ValueError("polygon: got holes beside geometry of shapely, which has its own")
            rings = one_ring("polygon", self.corners)
            object.__setattr__(self, "corners", rings.corners)
            object.__setattr__(self, "holes", rings.holes)
        object.__setattr__(self, "corners", _ring("polygon: corners", self.corners))
        holes = tuple(_ring("polygon: a hole", hole) for hole in self.holes)
        object.__setattr__(self, "holes", holes)

    def moved(self, by: LieGroup) -> Polygon:
        """The shape moved by a planar pose."""
        return Polygon(_acted(by, self.corners), tuple(_acted(by, ring) for ring in self.holes))


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """A disc.

    Examples
    --------
    >>> Disc(0.5).moved(SE2([1.0, 2.0, 0.3])).center.tolist()
    [1.0, 2.0]
    """

    radius: float  # [m]
    center: Array = field(default_factory=lambda: np.zeros(2))  # (2,) [m]

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(self, radius: float, center: ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "center", last=2)
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"disc: radius must be positive, got {self.radius} m")
        check_size("disc: radius", self.radius)
        check_size("disc: center", self.center)

    def moved(self, by: LieGroup) -> Disc:
        """The shape moved by a planar pose."""
        return Disc(self.radius, _acted(by, self.center))


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A rectangle: its size [length, width], its center, and the direction of its length.

    Examples
    --------
    >>> Box([4.0, 2.0]).corners.tolist()
    [[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]
    """

    size: Array  # (2,) [m]
    center: Array = field(default_factory=lambda: np.zeros(2))  # (2,) [m]
    heading: float = 0.0  # [rad]

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self, size: ArrayLike, center: ArrayLike = ..., heading: float = 0.0
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "size", last=2)
        freeze(self, "center", last=2)
        if not (self.size > 0.0).all():
            raise ValueError(f"box: size must be positive, got {self.size.tolist()} m")
        check_size("box: size", self.size)
        check_size("box: center", self.center)
        if not math.isfinite(self.heading):
            raise ValueError(f"box: heading must be finite, got {self.heading} rad")

    @property
    def corners(self) -> Array:
        """Corners (4, 2) counter-clockwise, the first behind on the right [m]."""
        signs = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        return _acted(SE2(np.append(self.center, self.heading)), signs * self.size)

    def moved(self, by: LieGroup) -> Box:
        """The shape moved by a planar pose."""
        return Box(self.size, _acted(by, self.center), self.heading + float(_planar(by).pose[2]))


Shape: TypeAlias = Polygon | Disc | Box
AnyShape: TypeAlias = Shape | Geometry | ArrayLike  # what stands for a shape: points are corners


def as_shapes(what: str, value: Any, *, or_else: str = "") -> tuple[Shape, ...]:
    """Shapes from a shape, geometry of shapely, a list of corners, or a sequence of these.

    A MultiPolygon or GeometryCollection becomes its polygons, with their holes.

    Raises
    ------
    ValueError
        If it is or holds anything else; the message begins with `what`, and names what would do
        `or_else`.

    Examples
    --------
    >>> import shapely
    >>> shapes = as_shapes("body", [Disc(1.0), shapely.box(0, 0, 2, 1), [(0, 0), (1, 0), (1, 1)]])
    >>> [type(shape).__name__ for shape in shapes]
    ['Disc', 'Polygon', 'Polygon']
    """
    if isinstance(value, Polygon | Disc | Box):
        return (value,)
    if is_geometry(value):
        return tuple(Polygon(*rings) for rings in rings_of_geometry(what, value))
    if isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        if are_points(value):
            return (_polygon_of_points(what, value),)
        return tuple(one for part in value for one in as_shapes(what, part))
    raise ValueError(
        f"{what}: got {value!r}, need {or_else}Polygon, Disc or Box, geometry of shapely, or "
        "corners (n, 2)"
    )


def as_shape(what: str, value: Any) -> Shape:
    """The one shape that a shape, geometry of shapely or list of corners is.

    Raises
    ------
    ValueError
        As `as_shapes`, or if it is none or several.
    """
    shapes = as_shapes(what, value)
    if len(shapes) != 1:
        raise ValueError(f"{what}: got {len(shapes)} shapes, need one; give each by itself")
    return shapes[0]


def _polygon_of_points(what: str, points: Any) -> Polygon:
    try:
        return Polygon(points)
    except ValueError as error:
        raise ValueError(f"{what}: {str(error).removeprefix('polygon: ')}") from error


class Coasting(Protocol):
    """What coasts from pose to pose: a plan."""

    @property
    def coasts(self) -> tuple[Array, Array, Array]:
        """Times (n,) [s], planar poses (n, 3), and the twist (n - 1, 3) after each but the last."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Poses in time, still before and after; between two linear, the heading too, or on an arc.

    With twists it coasts from each pose with a constant body velocity until the next: the motion of
    a vehicle that holds its trims, exactly, with one pose for each.

    Examples
    --------
    >>> Motion([0.0, 2.0], [[0, 0, 0], [4, 0, 0]]).at(0.5).tolist()
    [1.0, 0.0, 0.0]
    >>> half_turn = Motion([0.0, 1.0], [[0, 0, 0], [0, 2, np.pi]], twist=[[np.pi, 0, np.pi]])
    >>> half_turn.at(0.5).round(9).tolist()
    [1.0, 1.0, 1.570796327]
    """

    time: Array  # (n,) [s], rising
    pose: Array  # (n, 3) [m, m, rad]
    twist: Array | None = None  # (n - 1, 3) [m/s, m/s, rad/s] in the body's frame, after each pose

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self, time: ArrayLike, pose: ArrayLike, twist: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "time")
        freeze(self, "pose", last=3)
        if self.time.ndim != 1 or self.pose.shape != (self.time.size, 3) or not self.time.size:
            raise ValueError(
                f"motion: got {self.time.shape} times and poses {self.pose.shape}, "
                "need (n,) and (n, 3) with n >= 1"
            )
        if not (np.diff(self.time) > 0.0).all():
            raise ValueError(f"motion: times must rise, got {self.time.tolist()} s")
        check_size("motion: pose", self.pose[:, :2])
        if self.twist is None:
            self._refuse_jumps()
        else:
            self._refuse_gaps()

    @classmethod
    def of_plan(cls, plan: Coasting) -> Motion:
        """The motion of a vehicle that drives a plan, and stays where it ends.

        Along trims it is exact; along a maneuver it coasts from sample to sample of its course.

        Raises
        ------
        ValueError
            If a maneuver has no course.

        Examples
        --------
        >>> from maneuver_automaton.automaton import Plan
        >>> from maneuver_automaton.primitives import Trim
        >>> left = Trim(name="left", body_velocity=[1.0, 0.0, 0.5], control=[1.0, 0.5])
        >>> plan = Plan([0.0, 0.0, 0.0], (left,), durations=[np.pi], start_time=2.0)
        >>> Motion.of_plan(plan).at(2.0 + np.pi).round(6).tolist()
        [2.0, 2.0, 1.570796]
        """
        times, poses, twists = plan.coasts
        return cls(times, poses, twists)

    def _refuse_gaps(self) -> None:
        """Raise a ValueError at the first pose that its twist does not lead to, or too fast."""
        freeze(self, "twist", last=3)
        assert self.twist is not None
        if self.twist.shape != (self.time.size - 1, 3):
            raise ValueError(
                f"motion: got twists {self.twist.shape}, need one for all poses but the last, "
                f"({self.time.size - 1}, 3)"
            )
        lasting = np.diff(self.time)
        ends = (SE2(self.pose[:-1]) @ SE2.exp(lasting[:, None] * self.twist)).pose
        off = ends - self.pose[1:]
        off[:, 2] = wrapped(off[:, 2])
        far = 1.0 + np.abs(self.pose).max() + self.covered
        gaps = np.flatnonzero(np.abs(off).max(axis=1, initial=0.0) > GAP * far)
        if gaps.size:
            k = int(gaps[0])
            raise ValueError(
                f"motion: twist {k + 1} leads {np.hypot(*off[k, :2]):.3g} m and "
                f"{abs(off[k, 2]):.3g} rad beside pose {k + 2}"
            )
        speeds = np.hypot(self.twist[:, 0], self.twist[:, 1])
        for rates, most, units in (
            (speeds, FASTEST, "m/s"),
            (np.abs(self.twist[:, 2]), FASTEST_TURN, "rad/s"),
        ):
            if rates.size and rates.max() > most:
                k = int(np.argmax(rates))
                raise ValueError(
                    f"motion: twist {k + 1} is {rates[k]:.6g} {units}, need at most {most:g} "
                    f"{units}"
                )

    def _refuse_jumps(self) -> None:
        """Raise a ValueError at the first pose that nothing reaches in time."""
        lasting = np.diff(self.time)
        steps = np.diff(self.pose, axis=0)
        covered = np.hypot(steps[:, 0], steps[:, 1])
        for change, most, units in (
            (covered, FASTEST, ("m", "m/s")),
            (np.abs(steps[:, 2]), FASTEST_TURN, ("rad", "rad/s")),
        ):
            jumps = np.flatnonzero(change > most * lasting)
            if jumps.size:
                k = int(jumps[0])
                raise ValueError(
                    f"motion: pose {k + 2} at {self.time[k + 1]:.6g} s is {change[k]:.6g} "
                    f"{units[0]} from pose {k + 1}, {lasting[k]:.6g} s before: that is "
                    f"{change[k] / lasting[k]:.6g} {units[1]}, need at most {most:g} {units[1]}"
                )

    @property
    def rates(self) -> Array:
        """Rates (n - 1, 3) between poses: twists, or else those of the pose itself."""
        if self.twist is not None:
            return self.twist
        return np.asarray(np.diff(self.pose, axis=0) / np.diff(self.time)[:, None])

    @property
    def speeds(self) -> Array:
        """Speed (n - 1,) of the frame's origin between poses [m/s]."""
        rates = self.rates
        return np.hypot(rates[:, 0], rates[:, 1])

    @property
    def turn_rates(self) -> Array:
        """How fast the frame turns (n - 1,) between poses, in either sense [rad/s]."""
        return np.abs(self.rates[:, 2])

    @property
    def bends(self) -> Array:
        """Acceleration (n - 1,) of the frame's origin between poses [m/s^2]; 0 on lines."""
        return self.speeds * self.turn_rates if self.twist is not None else 0.0 * self.speeds

    @property
    def covered(self) -> float:
        """Path of the frame's origin [m]."""
        return float(self.speeds @ np.diff(self.time))

    def fastest(self, reach: float) -> float:
        """No point that is within `reach` [m] of the frame's origin is ever faster [m/s]."""
        return float((self.speeds + reach * self.turn_rates).max(initial=0.0))

    def at(self, time: ArrayLike) -> Array:
        """Poses (..., 3) at `time` (...,) [s]."""
        times = np.asarray(time, dtype=np.float64)
        if self.twist is None or self.time.size == 1:
            columns = [np.interp(times, self.time, self.pose[:, k]) for k in range(3)]
            return np.stack(columns, axis=-1)
        since = np.clip(times, self.time[0], self.time[-1])
        k = np.clip(np.searchsorted(self.time, since, side="right") - 1, 0, len(self.twist) - 1)
        found = (
            SE2(self.pose[k]) @ SE2.exp((since - self.time[k])[..., None] * self.twist[k])
        ).pose
        # The heading of a group element is one of many; that of a motion goes on from pose to pose.
        found = np.array(found)
        found[..., 2] = self.pose[k, 2] + (since - self.time[k]) * self.twist[k, 2]
        late = times >= self.time[-1]
        return np.where(late[..., None], self.pose[-1], found)

    def times_for_lines(self, turn: float) -> Array:
        """Times (m,) between which lines stand for it: on arcs it turns no more than `turn` [rad].

        Examples
        --------
        >>> Motion([0, 1], [[0, 0, 0], [0, 2, np.pi]], [[np.pi, 0, np.pi]]).times_for_lines(2.0)
        array([0. , 0.5, 1. ])
        """
        if self.twist is None:
            return self.time
        lasting = np.diff(self.time)
        counts = np.maximum(np.ceil(self.turn_rates * lasting / turn), 1.0).astype(np.int64)
        begins = [
            first + step * np.arange(n) / n
            for first, step, n in zip(self.time[:-1], lasting, counts.tolist(), strict=True)
        ]
        return np.append(np.concatenate([np.zeros(0), *begins]), self.time[-1])

    def moved(self, by: LieGroup) -> Motion:
        """The motion moved by a planar pose."""
        return Motion(self.time, (_planar(by) @ SE2(self.pose)).pose, self.twist)


STANDS = Motion([0.0], [[0.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A shape in the world, or, with a motion, a shape in a frame that moves.

    A polygon of shapely, or a list of corners, may stand for the shape. With `present_s` it is
    there from the first time to the last alone, whether it moves or not.

    Examples
    --------
    >>> crossing = Obstacle(Disc(0.3), motion=Motion([0.0, 1.0], [[0, 0, 0], [2, 0, 0]]))
    >>> crossing.at(0.5).center.tolist()
    [1.0, 0.0]
    """

    shape: Shape
    height: tuple[float, float] | None = field(default=None, kw_only=True)  # [m]; None: any
    motion: Motion | None = field(default=None, kw_only=True)
    present_s: tuple[float, float] | None = field(default=None, kw_only=True)  # None: at all times
    name: str = field(default="", kw_only=True)

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            shape: AnyShape,
            *,
            height: tuple[float, float] | None = None,
            motion: Motion | None = None,
            present_s: tuple[float, float] | None = None,
            name: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", as_shape("obstacle", self.shape))
        if self.height is not None and not (
            len(self.height) == 2
            and all(math.isfinite(z) for z in self.height)
            and self.height[0] < self.height[1]
        ):
            raise ValueError(
                f"obstacle: height must be [low, high] with low < high, got {self.height}"
            )
        if self.present_s is not None:
            first, last = self.present_s
            if not first <= last:
                raise ValueError(
                    f"obstacle: present_s must be [from, to] with from <= to, got {self.present_s}"
                )
            if self.motion is None:  # what comes and goes is looked at over time, like what moves
                object.__setattr__(self, "motion", STANDS)

    @property
    def presence(self) -> tuple[float, float]:
        """From when until when [s] it is there."""
        return (-math.inf, math.inf) if self.present_s is None else self.present_s

    def at(self, time: float) -> Shape:
        """The shape where it is at `time` [s]."""
        return self.shape if self.motion is None else self.shape.moved(SE2(self.motion.at(time)))

    def moved(self, by: LieGroup) -> Obstacle:
        """The obstacle moved by a pose, its heights too where that has an altitude."""
        rise = float(by.pose[..., 3:].sum())
        height = None if self.height is None else (self.height[0] + rise, self.height[1] + rise)
        if self.motion is not None:
            return replace(self, motion=self.motion.moved(by), height=height)
        return replace(self, shape=self.shape.moved(by), height=height)


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyMap:
    """Square cells, each blocked or free; all outside the map is free.

    Rows are counted upwards, from the origin along the map's y axis, and columns along its x axis:
    cell (i, j) is the square from ``(j, i) * resolution`` to ``(j + 1, i + 1) * resolution``. So
    the array's first row is the lowest one, and an array with the top row first, as pictures are
    read, comes in through `of_picture`. What is not zero is blocked; ``data != 0`` of an
    OccupancyGrid of ROS, in rows of its width, has this order, and blocks what is not known (-1).

    Parameters
    ----------
    blocked : (rows, columns) array
        True, or a number that is not 0, where blocked.
    resolution : float
        Size of a cell [m].
    origin : (3,) array
        Pose of the lower left corner of cell (0, 0) [m, m, rad].
    name : str
        What messages call it.

    Examples
    --------
    >>> room = OccupancyMap([[1, 1], [0, 1]], resolution=0.5, origin=[2.0, 0.0, 0.0])
    >>> int(room.blocked.sum()), room.extent.tolist()
    (3, [1.0, 1.0])
    """

    blocked: NDArray[np.bool_]  # (rows, columns), row 0 at the origin, rows along its y
    resolution: float = field(kw_only=True)  # [m] size of a cell
    origin: Array = field(default_factory=lambda: np.zeros(3), kw_only=True)  # (3,) pose of the
    #   corner of cell (0, 0) [m, m, rad]
    name: str = field(default="map", kw_only=True)

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            blocked: ArrayLike,
            *,
            resolution: float,
            origin: ArrayLike = ...,
            name: str = "map",
        ) -> None: ...

    def __post_init__(self) -> None:
        given = np.asarray(self.blocked)
        if given.ndim != 2 or given.size == 0:
            raise ValueError(f"map: cells have shape {given.shape}, need (rows, columns)")
        if given.dtype != np.bool_ and given.dtype.kind not in "iuf":
            raise ValueError(f"map: cells have the type {given.dtype}, need booleans or numbers")
        if given.dtype.kind == "f":
            as_array("map: cells", given)
        cells = given.astype(np.bool_)
        cells.setflags(write=False)
        object.__setattr__(self, "blocked", cells)
        freeze(self, "origin", last=3)
        if not (math.isfinite(self.resolution) and self.resolution > 0.0):
            raise ValueError(f"map: resolution must be positive, got {self.resolution} m")
        check_size("map: origin", self.origin[:2])
        check_size("map: size", self.extent)

    @classmethod
    def of_picture(
        cls,
        pixels: ArrayLike,
        *,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        dark: float = 0.5,
        name: str = "map",
    ) -> OccupancyMap:
        """The map of a picture, its top row first: dark pixels are blocked.

        Parameters
        ----------
        pixels : (rows, columns) or (rows, columns, 1 to 4) array
            Shades, or colours, of which the mean of red, green and blue counts: whole numbers from
            0 to the largest of their type, or numbers from 0 (black) to 1 (white). What is
            transparent (the last of 2 or 4 channels at most one half) is not known, and blocked.
        resolution : float
            Size of a pixel [m].
        origin : (3,) array
            Pose of the lower left corner of the picture [m, m, rad].
        dark : float
            Shade, from 0 to 1, below which a pixel is blocked.
        name : str
            What messages call it.

        Examples
        --------
        >>> OccupancyMap.of_picture([[0.0, 1.0], [1.0, 1.0]], resolution=1.0).blocked.tolist()
        [[False, False], [True, False]]
        """
        return cls(_dark(pixels, dark)[::-1], resolution=resolution, origin=origin, name=name)

    @property
    def extent(self) -> Array:
        """Size (2,) along the map's own x and y [m]."""
        rows, columns = self.blocked.shape
        return self.resolution * np.array([columns, rows], dtype=np.float64)

    def moved(self, by: LieGroup) -> OccupancyMap:
        """The map moved by a planar pose."""
        return replace(self, origin=(_planar(by) @ SE2(self.origin)).pose)


AnyObstacle: TypeAlias = Obstacle | OccupancyMap


def name_of(obstacle: AnyObstacle, index: int, place: str) -> str:
    """What messages call an obstacle, the `index`-th of a problem, and a place at it."""
    if isinstance(obstacle, OccupancyMap):
        name = "map" if obstacle.name == "map" else f"map {obstacle.name}"
        return f"{name}, cell at {place}"
    if obstacle.name:
        return f"obstacle {obstacle.name!r}"
    return f"obstacle {index} ({type(obstacle.shape).__name__.lower()} near {place})"


def as_obstacles(value: Any) -> tuple[AnyObstacle, ...]:
    """Obstacles from obstacles, maps and all that `as_shapes` takes, or one of these.

    Raises
    ------
    ValueError
        If it holds anything else.
    """
    if isinstance(value, Obstacle | OccupancyMap):
        return (value,)
    if type(value) is tuple and all(isinstance(one, Obstacle | OccupancyMap) for one in value):
        return value
    if _holds_parts(value):
        return tuple(one for part in value for one in as_obstacles(part))
    shapes = as_shapes("obstacles", value, or_else="Obstacle, OccupancyMap, ")
    return tuple(Obstacle(shape) for shape in shapes)


def as_footprint(value: Any) -> tuple[Shape, ...]:
    """Parts of a body from all that `as_shapes` takes; empty for a vehicle that is a point.

    Raises
    ------
    ValueError
        If it holds anything else, or reaches too far.
    """
    shapes = as_shapes("footprint", value)
    for shape in shapes:
        reach = _reach(shape)
        if reach > LARGEST_BODY:
            raise ValueError(
                f"footprint: reaches {reach:g} m from the pose, need at most {LARGEST_BODY:g} m"
            )
    return shapes


def _holds_parts(value: Any) -> bool:
    """Whether it is a sequence, and not one of points."""
    is_sequence = isinstance(value, np.ndarray | Sequence) and not isinstance(value, str)
    return is_sequence and not are_points(value)


def _reach(shape: Shape) -> float:
    """Greatest distance [m] of a point of a shape from the origin."""
    if isinstance(shape, Disc):
        return math.hypot(*shape.center) + shape.radius
    return float(np.hypot(*shape.corners.T).max())


def _dark(pixels: ArrayLike, dark: float) -> NDArray[np.bool_]:
    """Pixels that are dark or transparent, in the order of the picture."""
    given = np.asarray(pixels)
    white = np.iinfo(given.dtype).max if given.dtype.kind in "iu" else 1.0
    shades = as_array("map: pixels", given) / white
    if given.ndim not in (2, 3) or (given.ndim == 3 and given.shape[2] not in (1, 2, 3, 4)):
        raise ValueError(
            f"map: pixels have shape {given.shape}, need (rows, columns) or (rows, columns, 1 to 4)"
        )
    if shades.size and not (shades.min() >= 0.0 and shades.max() <= 1.0):
        raise ValueError(
            f"map: pixels reach from {given.min()} to {given.max()}, need 0 (black) to {white:g} "
            f"(white) as their type is {given.dtype}"
        )
    if given.ndim == 2:
        return np.asarray(shades < dark)
    if given.shape[2] in (1, 3):
        return np.asarray(shades.mean(axis=-1) < dark)
    return np.asarray((shades[..., :-1].mean(axis=-1) < dark) | (shades[..., -1] <= 0.5))


def _ring(name: str, corners: ArrayLike) -> Array:
    ring = np.array(as_array(name, corners))
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise ValueError(f"{name}: got shape {ring.shape}, need (n, 2) with n >= 3")
    check_size(name, ring)
    ring.setflags(write=False)
    return ring


def _planar(by: LieGroup) -> SE2:
    return SE2(by.pose[..., :3])


def _acted(by: LieGroup, points: Array) -> Array:
    return np.asarray(_planar(by).act(points))
