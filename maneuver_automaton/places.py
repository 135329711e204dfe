"""What places cost: near obstacles, on priced ground, uphill, or by a function of the user's own.

The vehicle, its trims and its maneuvers look the same wherever a group element moves them; what
they cost here does not. So these costs stand beside the invariant one, and a motion is priced by
integrating them along it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import (
    Array,
    as_array,
    as_number,
    check_fields,
    check_range,
    freeze,
    plain_numbers,
)
from maneuver_automaton._brief import brief
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton._lazy import shapely
from maneuver_automaton._limits import check_size
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, AnyShape, Box, OccupancyMap, Shape, as_shapes
from maneuver_automaton.collision._kernels_clearance import NEAR, SHARP
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.motion import planar
from maneuver_automaton.collision.outline import united
from maneuver_automaton.collision.surroundings import ShapePart, parts_of
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.groups import SE2, LieGroup

PER = ("metre", "second")
SCALE = 0.1  # [m] nothing that is priced is finer, unless a cost says its own `scale`
STEP = 1e-4  # [m, rad] of central differences
EXACT = 1.1 / (NEAR * SHARP)  # of a reach to a distance, below which clearances are exact


class PlaceCost(Protocol):
    """A cost that sees where the vehicle is: a finite rate of at least 0 at poses.

    Rates and `per` are all that it takes. It may also have ``gradient(poses, velocities)``, its
    derivatives (..., dof) by the pose; ``moved(by)``, the same cost elsewhere; ``on(problem)``, the
    cost once it knows obstacles and body; ``smooth()``, nearly the same without jumps, for better
    coasting times; ``jumps(lines, aside)``, by how much rates may jump near lines, as `Ground` says
    it; ``scale`` [m], the size of its finest feature; ``continuous``, whether rates never jump; and
    ``allows(poses, velocities)`` (...,), where the vehicle may be at all. What is missing is found
    by differences, is 0, or is the cost at poses moved back.

    Examples
    --------
    >>> class KeepRight:
    ...     per = "metre"
    ...     def rates(self, poses, velocities):
    ...         return np.maximum(poses[..., 1], 0.0)  # left of y = 0
    >>> gradient_of(KeepRight(), np.array([[0.0, 2.0, 0.0]]), np.zeros((1, 3))).round(6).tolist()
    [[0.0, 1.0, 0.0]]
    """

    @property
    def per(self) -> str:
        """Of what: "metre" of the way of the pose, or "second"."""
        ...

    def rates(self, poses: Array, velocities: Array) -> Array:
        """Rates (...,) of at least 0 at poses (..., dof) under body velocities (..., dof)."""
        ...


class _Surrounded(Protocol):
    """What costs look at of a problem."""

    @property
    def automaton(self) -> Automaton: ...
    @property
    def obstacles(self) -> tuple[AnyObstacle, ...]: ...
    @property
    def footprint(self) -> tuple[Shape, ...]: ...
    @property
    def parts(self) -> Mapping[str, tuple[Shape, ...]]: ...
    @property
    def body_height(self) -> tuple[float, float]: ...


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """``weight (1 - d / within)^2`` where the body is at d < `within` from what stands still.

    The distance is that of the body and of all that it carries, to the nearest obstacle; the margin
    is not taken off. Obstacles that move do not count, nor do those above or below the body.

    Examples
    --------
    >>> from maneuver_automaton import Box, Disc, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
    >>> wall = Box([20.0, 1.0], [0.0, 2.0])
    >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=wall, footprint=Disc(0.5))
    >>> near = Clearance(weight=4.0, within=2.0).on(problem)
    >>> near.rates(np.zeros((1, 3)), np.zeros((1, 3))).tolist()  # 1 m to the wall
    [1.0]
    """

    weight: float
    within: float  # [m]
    per: str = field(default="metre", kw_only=True)

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("clearance", self, "weight", least=0)
        check_fields("clearance", self, "within", unit="m")
        _check_per("clearance", self.per)

    def rates(self, poses: Array, velocities: Array) -> Array:
        """Zero: nothing is near before the cost is bound to a problem."""
        return np.zeros(poses.shape[:-1])

    def moved(self, by: LieGroup) -> Clearance:
        """The cost itself: obstacles are moved with the problem."""
        return self

    def on(self, problem: _Surrounded) -> PlaceCost:
        """The cost among the obstacles of a problem, for its body."""
        names: tuple[str, ...] = problem.automaton.model.part_names
        bodies: list[tuple[int | None, tuple[Shape, ...]]] = [(None, problem.footprint)]
        bodies += [(names.index(name), shapes) for name, shapes in problem.parts.items()]
        frame = own_frame(problem.obstacles, np.zeros(3))
        kinds: dict[tuple[float, float] | None, list[AnyObstacle]] = {}
        for one in problem.obstacles:
            if isinstance(one, OccupancyMap):
                kinds.setdefault(None, []).append(one)
            elif one.motion is None:
                kinds.setdefault(one.height, []).append(one)
        around: list[tuple[int | None, tuple[float, float] | None, World]] = []
        for height, standing in kinds.items():
            for part, shapes in bodies:
                world = world_of(tuple(standing), shapes, frame, keep=float(self.within))
                # Clearances are exact below a share of the reach of a body.
                body = world.body._replace(reach=max(world.body.reach, EXACT * self.within))
                around.append((part, height, replace(world, body=body)))
        return _Near(
            clearance=self,
            around=tuple(around),
            body_height=problem.body_height,
            automaton=problem.automaton,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Near:
    """A clearance among obstacles."""

    clearance: Clearance
    # number of a part or None for the body, the heights of obstacles [m], and how it is among them
    around: tuple[tuple[int | None, tuple[float, float] | None, World], ...]
    body_height: tuple[float, float]  # [m]
    automaton: Automaton
    continuous: ClassVar[bool] = True

    @property
    def per(self) -> str:
        return self.clearance.per

    @property
    def scale(self) -> float:
        return 0.5 * self.clearance.within

    def rates(self, poses: Array, velocities: Array) -> Array:
        return self.rates_along(poses, velocities, None)

    def rates_along(self, poses: Array, velocities: Array, states: Array | None) -> Array:
        near = 1.0 - self.distances(poses, states) / self.clearance.within
        return np.asarray(self.clearance.weight * near * near)

    def distances(self, poses: Array, states: Array | None) -> Array:
        """To the nearest obstacle (...,), at most `within` [m]; carried parts need states."""
        flat = poses.reshape(-1, poses.shape[-1])
        best = np.full(len(flat), self.clearance.within)
        for part, height, world in self.around:
            frames = flat[:, :3]
            if part is not None:
                if states is None:
                    continue
                model: Any = self.automaton.model
                seen = np.asarray(model.part_poses(states.reshape(len(flat), -1)))[:, part, :3]
                frames = (SE2(frames) @ SE2(seen)).pose
            rows = self._level_with(height, flat)
            found = np.maximum(clearances(world, world.seen(frames[rows])), 0.0)
            best[rows] = np.minimum(best[rows], found)
        return best.reshape(poses.shape[:-1])

    def _level_with(
        self, height: tuple[float, float] | None, poses: Array
    ) -> NDArray[np.bool_] | slice:
        """Where the body is neither above nor below obstacles of a height."""
        low, high = self.body_height
        if height is None or (poses.shape[1] == 3 and low == high == 0.0):
            return slice(None)
        altitude = poses[:, 3:].sum(axis=1)
        return np.asarray((altitude + low <= height[1]) & (altitude + high >= height[0]))


@dataclass(frozen=True, eq=False)
class Ground:
    """Ground with a price: areas, or a raster; nothing outside.

    `areas` cost `price` where the pose is in one of them. A raster of prices comes in by
    `of_raster`, a costmap of Nav2 by `of_costmap`, elevation by `of_elevation`.

    Examples
    --------
    >>> from maneuver_automaton import Box
    >>> lawn = Ground(Box([4.0, 2.0]), price=3.0)
    >>> lawn.rates(np.array([[1.0, 0.5, 0.0], [9.0, 0.0, 0.0]]), np.zeros((2, 3))).tolist()
    [3.0, 0.0]
    """

    areas: tuple[Shape, ...]
    price: float = 1.0
    per: str = field(default="metre", kw_only=True)
    raster: Raster | None = field(default=None, kw_only=True)
    edge: float = field(default=0.0, kw_only=True)  # [m] over which the price of areas rises

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            areas: AnyShape | Sequence[AnyShape],
            price: float = 1.0,
            *,
            per: str = "metre",
            raster: Raster | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        object.__setattr__(self, "areas", as_shapes("ground", self.areas))
        check_fields("ground", self, "price", least=0)
        _check_per("ground", self.per)
        if bool(self.areas) == (self.raster is not None):
            raise ValueError("ground: need areas or a raster")

    @classmethod
    def of_raster(
        cls,
        prices: ArrayLike,
        *,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        price: float = 1.0,
        per: str = "metre",
    ) -> Ground:
        """Prices (rows, columns) of cells, row 0 lowest as in an `OccupancyMap`, times `price`.

        Between the middles of cells they are interpolated.

        Examples
        --------
        >>> ground = Ground.of_raster([[0.0, 4.0]], resolution=1.0)
        >>> ground.rates(np.array([[1.0, 0.5, 0.0]]), np.zeros((1, 3))).tolist()
        [2.0]
        """
        values = as_array("ground: prices", prices)
        check_range("ground: prices", values.min(initial=0.0), least=0)
        raster = Raster(values, resolution=resolution, origin=as_array("ground: origin", origin))
        return cls((), price, per=per, raster=raster)

    @classmethod
    def of_costmap(
        cls,
        values: ArrayLike,
        *,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        price: float = 1.0,
        per: str = "metre",
    ) -> tuple[Ground, OccupancyMap]:
        """Ground and obstacles of a costmap of Nav2: 252 costs `price`, 253 and above are blocked.

        Blocked cells cost as much as the dearest others, which counts beside them alone.

        Examples
        --------
        >>> ground, walls = Ground.of_costmap([[0, 126, 254]], resolution=0.5, price=2.0)
        >>> ground.raster.values.tolist(), walls.blocked.tolist()
        ([[0.0, 0.5, 1.0]], [[False, False, True]])
        """
        cells = as_array("costmap: values", values)
        if cells.ndim != 2 or not cells.size:
            raise ValueError(f"costmap: values have shape {cells.shape}, need (rows, columns)")
        if not (cells.min() >= 0.0 and cells.max() <= 255.0):
            raise ValueError(
                f"costmap: values reach from {cells.min():g} to {cells.max():g}, need 0 to 255"
            )
        prices = np.minimum(cells, 252.0) / 252.0
        ground = cls.of_raster(prices, resolution=resolution, origin=origin, price=price, per=per)
        walls = OccupancyMap(cells >= 253.0, resolution=resolution, origin=origin, name="costmap")
        return ground, walls

    @classmethod
    def of_elevation(
        cls,
        heights: ArrayLike,
        *,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        price: float = 1.0,
        max_cross_slope: float | None = None,
    ) -> Ground:
        """Hills of `heights` (rows, columns) [m]: uphill costs `price` per metre climbed.

        Downhill is free. Where the ground slopes more than `max_cross_slope` [rise per metre] from
        the left of the vehicle to its right, or back, it must not be.

        Examples
        --------
        >>> hill = Ground.of_elevation([[0.0, 1.0, 2.0]], resolution=2.0, price=10.0)
        >>> up, down = np.array([[[3.0, 1.0, 0.0]], [[3.0, 1.0, np.pi]]])
        >>> ahead = np.array([[1.0, 0.0, 0.0]])
        >>> hill.rates(up, ahead).tolist(), hill.rates(down, ahead).tolist()
        ([5.0], [0.0])
        """
        values = as_array("elevation: heights", heights)
        if max_cross_slope is not None:
            max_cross_slope = as_number("elevation: max_cross_slope", max_cross_slope)
            check_range("elevation: max_cross_slope", max_cross_slope, least=0)
        hills = Raster(
            values,
            resolution=resolution,
            origin=as_array("elevation: origin", origin),
            are_heights=True,
            max_cross_slope=max_cross_slope,
        )
        return cls((), price, raster=hills)

    @property
    def scale(self) -> float:
        """Size [m] of the finest feature."""
        if self.raster is not None:
            return self.raster.resolution
        widths = [radius or 2.0 * core.area / core.length for core, radius, *_ in self._parts()]
        return min(SCALE, 0.5 * min(widths))

    @property
    def extent(self) -> tuple[Shape, ...]:
        """Shapes outside of which nothing costs."""
        if self.raster is None:
            return self.areas
        rows, columns = self.raster.values.shape
        size = self.raster.resolution * np.array([columns, rows])
        middle = SE2(self.raster.origin).act(0.5 * size)
        return (Box(size, middle, heading=float(self.raster.origin[2])),)

    @property
    def isotropic(self) -> bool:
        """Whether the rate is the same for all headings and velocities."""
        return self.raster is None or not self.raster.are_heights

    def rates(self, poses: Array, velocities: Array) -> Array:
        """Rates (...,) at poses (..., dof) under body velocities (..., dof)."""
        if self.raster is None:
            inside = self._depths if self.edge else self._inside
            return np.asarray(self.price * inside(poses[..., :2]))
        if not self.raster.are_heights:
            return np.asarray(self.price * self.raster.at(self.raster.values, poses[..., :2]))
        uphill, speed = self.raster.climb(poses, velocities)
        share = np.divide(uphill, speed, out=np.zeros_like(speed), where=speed > 0.0)
        return np.asarray(self.price * np.maximum(share, 0.0))

    def allows(self, poses: Array, velocities: Array) -> NDArray[np.bool_]:
        """Whether the ground slopes little enough across the vehicle."""
        if self.raster is None or self.raster.max_cross_slope is None:
            return np.ones(poses.shape[:-1], dtype=np.bool_)
        left = np.zeros_like(velocities)
        left[..., 1] = 1.0
        return np.abs(self.raster.climb(poses, left)[0]) <= self.raster.max_cross_slope + 1e-9

    def smooth(self) -> Ground:
        """Ground that is nearly the same, but has no jump at the edge of an area."""
        return self if self.raster is not None else replace(self, edge=self.scale)

    def jumps(self, lines: Array, aside: Array) -> Array:
        """By how much the rate may jump (n,) within `aside` (n,) [m] of lines (n, points, 2)."""
        discs, _, edges, most = self._shapes()
        ways = shapely.linestrings(lines)
        near = shapely.dwithin(edges, ways, aside)
        for disc in discs:
            away = np.hypot(*np.moveaxis(lines - disc.middle, -1, 0)).max(axis=1)
            met = shapely.dwithin(disc.core, ways, disc.radius + aside)
            near |= met & (away >= disc.radius - aside)
        return np.asarray(most * near)

    def moved(self, by: LieGroup) -> Ground:
        """The ground moved by a planar pose."""
        raster = None if self.raster is None else self.raster.moved(by)
        return replace(self, areas=tuple(one.moved(by) for one in self.areas), raster=raster)

    @kept_by_first
    def _parts(self) -> list[ShapePart]:
        """Shapes outside of which nothing costs, as shapely knows them."""
        return parts_of(self.extent)

    @kept_by_first
    def _shapes(self) -> tuple[list[ShapePart], Any, Any, float]:
        """Discs, the rest as one, its outline, and by how much the rate jumps there at most."""
        whole = united(one.core for one in self._parts() if not one.radius)
        edges = whole.boundary
        shapely.prepare([whole, edges])
        seen = np.ones(1) if self.raster is None else self.raster.slopes or self.raster.values
        discs = [one for one in self._parts() if one.radius]
        return discs, whole, edges, self.price * float(np.abs(seen).max())

    def _inside(self, places: Array) -> NDArray[np.bool_]:
        discs, whole, *_ = self._shapes()
        inside = shapely.intersects_xy(whole, *np.moveaxis(places, -1, 0))
        for disc in discs:
            inside |= np.hypot(*np.moveaxis(places - disc.middle, -1, 0)) <= disc.radius
        return np.asarray(inside)

    def _depths(self, places: Array) -> Array:
        """From 0 half an edge outside of all areas to 1 as far inside of one, without a kink."""
        discs, whole, edges, _ = self._shapes()
        points = shapely.points(places)
        away = shapely.distance(edges, points)  # NaN where there are discs alone
        depth = np.where(shapely.intersects(whole, points), away, -away)
        for disc in discs:
            depth = np.fmax(depth, disc.radius - np.linalg.norm(places - disc.middle, axis=-1))
        share = np.clip(0.5 + depth / self.edge, 0.0, 1.0)
        return np.asarray(share * share * (3.0 - 2.0 * share))


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Values at the middles of square cells, row 0 lowest, and linear between."""

    values: Array  # (rows, columns)
    resolution: float = field(kw_only=True)  # [m]
    origin: Array = field(default_factory=lambda: np.zeros(3), kw_only=True)  # (3,) as of a map
    are_heights: bool = field(default=False, kw_only=True)  # [m] and not prices
    max_cross_slope: float | None = field(default=None, kw_only=True)
    slopes: tuple[Array, Array] | None = field(init=False, default=None)  # along columns, rows

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "values")
        freeze(self, "origin", last=3)
        if self.values.ndim != 2 or not self.values.size:
            raise ValueError(
                f"ground: the raster has shape {self.values.shape}, need (rows, columns)"
            )
        check_fields("ground", self, "resolution", unit="m")
        check_size("ground: origin", self.origin[:2])
        if self.are_heights:
            x, y = (
                np.gradient(self.values, self.resolution, axis=axis)
                if self.values.shape[axis] > 1
                else np.zeros_like(self.values)
                for axis in (1, 0)
            )
            object.__setattr__(self, "slopes", (x, y))

    def at(self, values: Array, places: Array) -> Array:
        """Values (...,) at places (..., 2) [m]; 0 outside."""
        cells = SE2(self.origin).inverse().act(places) / self.resolution
        column, row = cells[..., 0], cells[..., 1]
        rows, columns = values.shape
        inside = (column >= 0.0) & (column <= columns) & (row >= 0.0) & (row <= rows)
        (i, up), (j, right) = (
            _between(np.where(inside, at, 0.0), count)
            for at, count in ((row, rows), (column, columns))
        )
        above, beside = np.minimum(i + 1, rows - 1), np.minimum(j + 1, columns - 1)
        low = (1.0 - right) * values[i, j] + right * values[i, beside]
        high = (1.0 - right) * values[above, j] + right * values[above, beside]
        return np.asarray(np.where(inside, (1.0 - up) * low + up * high, 0.0))

    def climb(self, poses: Array, velocities: Array) -> tuple[Array, Array]:
        """Height gained per second (...,) [m/s] at body velocities, and the speeds in the plane."""
        assert self.slopes is not None
        turned = poses[..., 2] - self.origin[2]
        cosine, sine = np.cos(turned), np.sin(turned)
        ahead, left = velocities[..., 0], velocities[..., 1]
        places = poses[..., :2]
        alike = places.ndim > 2 and bool((places == places[:1]).all())  # the same at every heading
        x, y = (self.at(one, places[:1] if alike else places) for one in self.slopes)
        gained = x * (cosine * ahead - sine * left) + y * (sine * ahead + cosine * left)
        return np.asarray(gained), np.asarray(np.hypot(ahead, left))

    def moved(self, by: LieGroup) -> Raster:
        """The raster moved by a planar pose."""
        return replace(self, origin=(planar(by) @ SE2(self.origin)).pose)


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """A cost elsewhere: that of the pose moved back."""

    cost: PlaceCost
    by: LieGroup

    @property
    def per(self) -> str:
        return self.cost.per

    @property
    def scale(self) -> float:
        return scale_of(self.cost)

    def rates(self, poses: Array, velocities: Array) -> Array:
        return rates_along(self.cost, self._back(poses), velocities)

    def allows(self, poses: Array, velocities: Array) -> NDArray[np.bool_]:
        return allowed(self.cost, self._back(poses), velocities)

    def on(self, problem: _Surrounded) -> PlaceCost:
        return replace(self, cost=bound(self.cost, problem))

    def _back(self, poses: Array) -> Array:
        return np.asarray((self.by.inverse() @ type(self.by)(poses)).pose)


def check_place_costs(value: Any) -> tuple[PlaceCost, ...]:
    """Costs of places from one or several."""
    costs = tuple(value) if isinstance(value, Sequence) else (value,)
    for k, cost in enumerate(costs):
        if not callable(getattr(cost, "rates", None)):
            raise ValueError(
                f"place_costs[{k}]: got {cost!r:.60}, need Clearance, Ground, or an object with "
                "rates(poses, velocities) and per"
            )
        _check_per(f"place_costs[{k}]", getattr(cost, "per", None))
        if type(cost).__hash__ is None:
            raise ValueError(f"place_costs[{k}]: {type(cost).__name__} has no hash; need one")
    return costs


def bound(cost: PlaceCost, problem: _Surrounded) -> PlaceCost:
    """The cost once it knows obstacles and body of a problem; itself if it does not ask."""
    on: Callable[[Any], PlaceCost] | None = getattr(cost, "on", None)
    return cost if on is None else on(problem)


def moved(cost: PlaceCost, by: LieGroup) -> PlaceCost:
    """The cost moved by a group element: by its own method, or at poses moved back."""
    own: Callable[[LieGroup], PlaceCost] | None = getattr(cost, "moved", None)
    return _Moved(cost, by) if own is None else own(by)


def smoothed(cost: PlaceCost) -> PlaceCost:
    """The cost without jumps; itself if it does not say."""
    own: Callable[[], PlaceCost] | None = getattr(cost, "smooth", None)
    return cost if own is None else own()


def extent_of(cost: PlaceCost) -> tuple[Shape, ...]:
    """Shapes outside of which it is 0; none if the cost does not say."""
    own: tuple[Shape, ...] = getattr(cost, "extent", ())
    return own


def scale_of(cost: PlaceCost) -> float:
    """Size [m] of the finest feature."""
    about = f"place cost {type(cost).__name__}: scale"
    scale = as_number(about, getattr(cost, "scale", SCALE))
    check_range(about, scale, unit="m", infinite=True)
    return scale


def jumps_along(cost: PlaceCost, lines: Array, aside: Array) -> Array:
    """By how much a rate may jump (n,) within `aside` of lines (n, points, 2); 0 if not said."""
    own: Callable[[Array, Array], Array] | None = getattr(cost, "jumps", None)
    return np.zeros(len(lines)) if own is None else own(lines, aside)


def allowed(cost: PlaceCost, poses: Array, velocities: Array) -> NDArray[np.bool_]:
    """Where (...,) the vehicle may be; everywhere if the cost does not say."""
    own: Callable[[Array, Array], NDArray[np.bool_]] | None = getattr(cost, "allows", None)
    said = np.ones(poses.shape[:-1]) if own is None else own(poses, velocities)
    return _answer(cost, "allows", said, poses.shape[:-1]).astype(np.bool_)


def rates_along(
    cost: PlaceCost, poses: Array, velocities: Array, states: Array | None = None
) -> Array:
    """Rates (...,) where reduced states (..., n_z) are known, which place what is carried."""
    own: Callable[..., Array] | None = getattr(cost, "rates_along", None)
    said = own(poses, velocities, states) if own else cost.rates(poses, velocities)
    rates = _answer(cost, "rates", said, poses.shape[:-1])
    if (least := rates.min(initial=0.0)) < 0.0:
        raise ValueError(f"place cost {type(cost).__name__}: rates: got {least:g}, need at least 0")
    return rates


def gradient_of(
    cost: PlaceCost, poses: Array, velocities: Array, states: Array | None = None
) -> Array:
    """Derivatives (..., dof) of the rates by the pose: its own, or central differences."""
    own: Callable[[Array, Array], Array] | None = getattr(cost, "gradient", None)
    if own is not None:
        return _answer(cost, "gradient", own(poses, velocities), poses.shape)
    axes = np.zeros((poses.shape[-1], *poses.shape))  # the vehicle's, which move with a problem
    for k, axis in enumerate(axes):
        axis[..., k] = 1.0
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    axes[0, ..., 0], axes[0, ..., 1] = c, s
    axes[1, ..., 0], axes[1, ..., 1] = -s, c
    slopes = np.zeros(poses.shape)
    for axis in axes:
        ahead, behind = (
            rates_along(cost, poses + sign * STEP * axis, velocities, states)
            for sign in (1.0, -1.0)
        )
        slopes += ((ahead - behind) / (2.0 * STEP))[..., None] * axis
    return slopes


def _answer(cost: PlaceCost, what: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """What a cost says at poses, as numbers of a shape."""
    about = f"place cost {type(cost).__name__}: {what}"
    found = as_array(about, value)
    if found.shape != shape:
        raise ValueError(f"{about}: got shape {found.shape}, need {shape}")
    return found


def _between(at: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """Cell whose middle is below, and how far on to the next one, held at the border."""
    middle = np.clip(at - 0.5, 0.0, count - 1.0)
    cell = np.minimum(middle.astype(np.int64), count - 1)
    return cell, middle - cell


def _check_per(what: str, per: Any) -> None:
    if per not in PER:
        raise ValueError(f"{what}: per must be 'metre' or 'second', got {per!r}")
