"""Shapes as values: bodies of vehicles, obstacles, occupancy maps, motions.

All are solids, and closed: to touch one is to collide with it.
"""

from __future__ import annotations

import functools
import math
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array, check_fields, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import LARGEST_BODY, check_size
from maneuver_automaton.collision.geometry import (
    Geometry,
    are_points,
    is_geometry,
    one_ring,
    rings_of_geometry,
)
from maneuver_automaton.collision.motion import STANDS, Motion, planar
from maneuver_automaton.groups import SE2, LieGroup

SIDES = np.array([[-0.5, 0.5, 0.5, -0.5], [-0.5, -0.5, 0.5, 0.5]])  # of a box, where corners are
GRID = 65536.0  # [m] between the origins of neighbourhoods: far enough to share, near enough to see
PLAIN = 1e-6  # sine of the angle at a corner, beyond which rounding does not decide its side


@dataclass(frozen=True, eq=False)
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

    @functools.cached_property
    def is_plain(self) -> bool:
        """Whether its ring surely surrounds its area once: of three or four corners, all one way.

        Nothing is said of others: those have to be looked at by whoever wants to know.
        """
        few = not self.holes and len(self.corners) <= 4
        return few and bool(_turn_one_way(self.corners[None])[0])

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
        plain_numbers(self)
        freeze(self, "center", last=2)
        check_fields("disc", self, "radius", unit="m")
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
        plain_numbers(self)
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
        one = box_corners(self.center[None], np.array([self.heading]), self.size[None])
        return np.asarray(one[0])

    def moved(self, by: LieGroup) -> Box:
        """The shape moved by a planar pose."""
        return Box(self.size, _acted(by, self.center), self.heading + float(planar(by).pose[2]))


def box_corners(centers: Array, headings: Array, sizes: Array) -> Array:
    """Corners (n, 4, 2) of boxes [m], as of each, from arrays of what boxes have."""
    cosine, sine = np.cos(headings)[:, None], np.sin(headings)[:, None]
    x, y = sizes[:, :1] * SIDES[0], sizes[:, 1:] * SIDES[1]
    corners = np.empty((len(centers), 4, 2))
    corners[..., 0] = centers[:, :1] + (cosine * x - sine * y)
    corners[..., 1] = centers[:, 1:] + (sine * x + cosine * y)
    return corners


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
        f"{what}: got {reprlib.repr(value)}, need {or_else}Polygon, Disc or Box, geometry of "
        "shapely, or corners (n, 2)"
    )


def as_shape(what: str, value: Any) -> Shape:
    """The one shape that a shape, geometry of shapely or list of corners is."""
    shapes = as_shapes(what, value)
    if len(shapes) != 1:
        raise ValueError(f"{what}: got {len(shapes)} shapes, need one; give each by itself")
    return shapes[0]


def _polygon_of_points(what: str, points: Any) -> Polygon:
    try:
        return Polygon(points)
    except ValueError as error:
        raise ValueError(f"{what}: {str(error).removeprefix('polygon: ')}") from error


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
        plain_numbers(self)
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
            if self.motion is None:  # one that comes and goes counts as a moving one
                object.__setattr__(self, "motion", STANDS)

    @property
    def presence(self) -> tuple[float, float]:
        """From when until when [s] it is there."""
        return (-math.inf, math.inf) if self.present_s is None else self.present_s

    def lasts(self, *, fleeting: bool) -> tuple[float, float]:
        """`presence`; one that is `fleeting`, as on roads, is there while its motion lasts."""
        if not fleeting or self.motion is None or self.present_s is not None:
            return self.presence
        first, last = self.motion.time[[0, -1]].tolist()
        return first, last

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
        plain_numbers(self)
        whole = isinstance(self.blocked, np.ndarray) and self.blocked.dtype.kind in "biu"
        given: NDArray[Any] = self.blocked if whole else as_array("map: cells", self.blocked)
        if given.ndim != 2 or given.size == 0:
            raise ValueError(f"map: cells have shape {given.shape}, need (rows, columns)")
        cells = given.astype(np.bool_, order="C")
        cells.setflags(write=False)
        object.__setattr__(self, "blocked", cells)
        freeze(self, "origin", last=3)
        check_fields("map", self, "resolution", unit="m")
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
        return replace(self, origin=(planar(by) @ SE2(self.origin)).pose)


AnyObstacle: TypeAlias = Obstacle | OccupancyMap


class ByKind(NamedTuple):
    """Shapes by their kinds, each with its number; the boxes in arrays."""

    boxes: NDArray[np.int64]  # (n,)
    centers: Array  # (n, 2) [m] of the boxes
    headings: Array  # (n,) [rad]
    sizes: Array  # (n, 2) [m]
    discs: list[tuple[int, Disc]]
    polygons: list[tuple[int, Polygon]]
    maps: list[tuple[int, OccupancyMap]]
    quads: NDArray[np.int64]  # (m,) the boxes, then the plain polygons of four corners
    corners: Array  # (m, 4, 2) [m] of these
    others: list[tuple[int, Polygon]]  # that are not among them


@functools.lru_cache(maxsize=32)  # FCL and the audit have them as the search does
def by_kind(solids: tuple[AnyObstacle | Shape, ...]) -> ByKind:
    """Shapes, those of obstacles, and maps by their kinds."""
    every = [getattr(one, "shape", one) for one in solids]
    numbers = [k for k, one in enumerate(every) if isinstance(one, Box)]
    boxes: list[Any] = [every[k] for k in numbers]
    others = [(k, one) for k, one in enumerate(every) if not isinstance(one, Box)]
    polygons = [(k, one) for k, one in others if isinstance(one, Polygon)]
    fours = {k: one.corners for k, one in polygons if len(one.corners) == 4 and not one.holes}
    rings = np.concatenate([NOWHERE, *fours.values()]).reshape(-1, 4, 2)
    plain = _turn_one_way(rings)
    quads = {k: True for k, is_plain in zip(fours, plain.tolist(), strict=True) if is_plain}
    # The bytes of many small arrays are put together in a fraction of the time.
    centers = np.frombuffer(b"".join([one.center for one in boxes])).reshape(-1, 2)
    sizes = np.frombuffer(b"".join([one.size for one in boxes])).reshape(-1, 2)
    headings = np.array([one.heading for one in boxes])
    return ByKind(
        boxes=np.array(numbers, dtype=np.int64),
        centers=centers,
        headings=headings,
        sizes=sizes,
        discs=[(k, one) for k, one in others if isinstance(one, Disc)],
        polygons=polygons,
        maps=[(k, one) for k, one in others if isinstance(one, OccupancyMap)],
        quads=np.array([*numbers, *quads], dtype=np.int64),
        corners=np.concatenate([box_corners(centers, headings, sizes), rings[plain]]),
        others=[(k, one) for k, one in polygons if k not in quads],
    )


def _turn_one_way(rings: Array) -> NDArray[np.bool_]:
    """Which rings (m, n, 2) turn to one side at all corners, whatever rounding does."""
    at, after = rings[..., 0] + 1j * rings[..., 1], np.arange(-1, rings.shape[1] - 1)
    sides = at - at[:, after]
    turns = sides[:, after].conj() * sides
    by, least = turns.imag, PLAIN * np.abs(turns)
    return np.asarray((by > least).all(axis=1) | (-by > least).all(axis=1))


NOWHERE: Array = np.zeros((0, 2))


def origin_near(place: ArrayLike) -> tuple[float, float]:
    """Where to count from so that coordinates near `place` (2 or more) lose no digit.

    Examples
    --------
    >>> origin_near([3.0, -4.0]), origin_near([1e9 + 5.0, 0.0])
    ((0.0, 0.0), (1000013824.0, 0.0))
    """
    x, y, *_ = np.asarray(place).tolist()
    return GRID * round(x / GRID), GRID * round(y / GRID)


def name_of(obstacle: AnyObstacle, index: int, place: str) -> str:
    """What messages call an obstacle, the `index`-th of a problem, and a place at it."""
    if isinstance(obstacle, OccupancyMap):
        name = "map" if obstacle.name == "map" else f"map {obstacle.name}"
        return f"{name}, cell at {place}"
    if obstacle.name:
        return f"obstacle {obstacle.name!r}"
    return f"obstacle {index} ({type(obstacle.shape).__name__.lower()} near {place})"


def as_obstacles(value: Any) -> tuple[AnyObstacle, ...]:
    """Obstacles from obstacles, maps and all that `as_shapes` takes, or one of these."""
    if isinstance(value, Obstacle | OccupancyMap):
        return (value,)
    if type(value) is tuple and {Obstacle, OccupancyMap}.issuperset(map(type, value)):
        return value
    is_sequence = isinstance(value, np.ndarray | Sequence) and not isinstance(value, str)
    if is_sequence and not are_points(value):
        return tuple(one for part in value for one in as_obstacles(part))
    shapes = as_shapes("obstacles", value, or_else="Obstacle, OccupancyMap, ")
    return tuple(Obstacle(shape) for shape in shapes)


def as_footprint(value: Any) -> tuple[Shape, ...]:
    """Parts of a body from all that `as_shapes` takes; empty for a vehicle that is a point."""
    shapes = as_shapes("footprint", value)
    for shape in shapes:
        reach = reach_of(shape)
        if reach > LARGEST_BODY:
            raise ValueError(
                f"footprint: reaches {reach:g} m from the pose, need at most {LARGEST_BODY:g} m"
            )
    return shapes


def reach_of(shape: Shape) -> float:
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


def _acted(by: LieGroup, points: Array) -> Array:
    return np.asarray(planar(by).act(points))
