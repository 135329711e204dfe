"""All a planner needs: automaton, start, goals, cost, and the limits of the word."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton import place_prices
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
from maneuver_automaton._kept import kept_by_first, kept_with
from maneuver_automaton._limits import MOST_HEADING, MOST_TURNS, check_heading, check_size
from maneuver_automaton.automaton import Automaton, Plan, Primitive
from maneuver_automaton.automaton.headings import motion_of, posed
from maneuver_automaton.collision import (
    AnyObstacle,
    AnyShape,
    Obstacle,
    Shape,
    Zone,
    as_footprint,
    as_obstacles,
)
from maneuver_automaton.costs import Cost, StageCost, check_cost, prices_switches
from maneuver_automaton.groups import SE2, LieGroup, SE2xR, Translations, group_of
from maneuver_automaton.models import OnLattice, OnlyTranslated
from maneuver_automaton.models.speeds import standing_price
from maneuver_automaton.places import PlaceCost, bound, check_place_costs, moved
from maneuver_automaton.primitives import Maneuver, Trim, on_the_spot
from maneuver_automaton.via import Via as Via

_Element: TypeAlias = SE2 | SE2xR | Translations
MOST_KNOWN = 1 << 14  # maneuvers of a library whose costs are kept
STANDING = 1e-3  # [m/s] slower is no direction of travel
STATE_TOLERANCE = 1e-9  # between a reduced state that is stated and a trim's, in its units
ORDERS = ("given", "free")
MOST_UNORDERED = 12  # poses on the way whose order is free
SEARCH_METHODS = ("auto", "words", "insertion", "lattice")


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """Where a plan ends: exactly at `pose`, or at any heading there.

    Examples
    --------
    >>> Goal([5, 5, 0], tolerance_m=0.1).pose.tolist()
    [5.0, 5.0, 0.0]
    """

    pose: Array  # (dof,) [m, m, rad(, m)]; without heading if translations alone move the vehicle
    trim: str | None = field(default=None, kw_only=True)
    state: Array | None = field(default=None, kw_only=True)  # (n_z,) reduced, in place of a trim
    free_heading: bool = field(default=False, kw_only=True)
    tolerance_m: float = field(default=0.0, kw_only=True)
    tolerance_rad: float = field(default=0.0, kw_only=True)

    __repr__ = brief

    if TYPE_CHECKING:  # any numbers will do for the pose

        def __init__(
            self,
            pose: ArrayLike | _Element,
            *,
            trim: str | None = None,
            state: ArrayLike | Mapping[str, float] | None = None,
            free_heading: bool = False,
            tolerance_m: float = 0.0,
            tolerance_rad: float = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "pose", last=(2, 3, 4))
        if self.state is not None and not isinstance(self.state, Mapping):  # names need a model
            freeze(self, "state")
        if self.pose.ndim != 1:
            raise ValueError(f"goal: pose has shape {self.pose.shape}, need one pose")
        check_size("goal: pose", self.pose[[0, 1, *range(3, self.pose.size)]])
        check_heading("goal: pose", self.pose)
        check_fields("goal", self, "tolerance_m", "tolerance_rad", least=0)

    def off(self, pose: Array) -> tuple[float, float]:
        """How far a pose (dof,) is from this one: distance [m] and turn [rad], 0 if any will do.

        Examples
        --------
        >>> Goal(pose=[1.0, 0.0, 0.0]).off(np.array([1.0, 2.0, 2 * np.pi]))
        (2.0, 0.0)
        """
        distance, turn = apart(self.pose, pose)
        return distance, 0.0 if self.free_heading else turn


class Unstated(float):
    """A number that nobody has stated."""


UNSTATED = Unstated(0.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Horizon:
    """How long a plan lasts and how many trims it may have."""

    time: float | None = None  # [s] exactly this long; None: free
    max_trims: int | None = None  # rest included; None: no limit
    min_coast: float = UNSTATED  # [s] of every trim but rest; unstated: 0.02 where hardly costlier
    max_time: float | None = None  # [s] at most, with a free final time
    stay: bool = False  # at the goal for ever, where nothing may pass later, with a free final time

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("horizon", self, "time", "max_time", unit="s")
        if self.time is not None and self.max_time is not None:
            raise ValueError("horizon: max_time is for a free final time, but time is fixed")
        if self.time is not None and self.stay:
            raise ValueError("horizon: stay is for a free final time, but time is fixed")
        check_fields("horizon", self, "max_trims", least=1)
        check_fields("horizon", self, "min_coast", least=0, unit="s")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bounds:
    """Where the pose may be: closed intervals, None where there is no limit."""

    x: tuple[float, float] | None = None  # [m]
    y: tuple[float, float] | None = None  # [m]
    z: tuple[float, float] | None = None  # [m]

    def __post_init__(self) -> None:
        plain_numbers(self)
        for name in ("x", "y", "z"):
            pair = getattr(self, name)
            if pair is not None and not (len(pair) == 2 and pair[0] < pair[1]):
                raise ValueError(f"bounds: {name} must be [low, high] with low < high, got {pair}")

    @property
    def are_open(self) -> bool:
        """Whether there is no limit in any direction.

        Examples
        --------
        >>> Bounds().are_open, Bounds(x=(0.0, 5.0)).are_open
        (True, False)
        """
        return self.x is None and self.y is None and self.z is None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchSettings:
    """How to search; the defaults suit most problems."""

    method: str = "auto"  # auto | words | insertion | lattice
    max_expansions: int | None = None  # of nodes, by the lattice; the same plan at every call
    cell: float | None = None  # [m] of the lattice, scaled to the vehicle if None
    headings: int | None = None  # of the lattice, 72 if None
    weight: float | None = None  # of the cost to go in the first pass, 2 if None
    backwards: bool = False  # from the goals, on a lattice of cells and headings
    show_nodes: bool = False  # hand over what the first plan's search expanded
    improve: bool = True  # a plan that was found; otherwise the first that passes is returned
    polish: bool = True  # plans with inertia, beyond what the library has

    def __post_init__(self) -> None:
        plain_numbers(self)
        if self.method not in SEARCH_METHODS:
            raise ValueError(
                f"search: method must be one of {', '.join(SEARCH_METHODS)}, got {self.method!r}"
            )
        check_fields("search", self, "cell", unit="m")
        check_fields("search", self, "max_expansions", "headings", "weight", least=1)


@dataclass(frozen=True, eq=False)
class Problem:
    """From a start pose to a goal with the trims of an automaton, as cheaply as can be.

    Parameters
    ----------
    automaton : Automaton
        The vehicle, its trims, and the maneuvers between them.
    start : (dof,) array, or a group element
        Pose at the start: x [m], y [m], heading [rad], and z [m] of a vehicle that flies.
    goals : (dof,) or (n, dof) array, a group element, a Goal, or a sequence of these
        Where the plan ends: at the one that is the cheapest to reach.
    cost : StageCost
        What a plan costs, such as a `Cost`; the time in seconds if left out.
    horizon : Horizon
        How long the plan lasts, and how many trims it may have; both free if left out.
    start_trim : str, optional
        Name of the trim in which the vehicle starts; rest if left out.
    start_state : (n_z,) array or mapping of str to float, optional
        The reduced state in which it starts instead, in the order of the model's `reduced_names` or
        by these names; what is left out of a mapping is 0. It need be that of no trim.
    start_time : float
        Time at the start [s], on the clock of the moving obstacles.
    bounds : Bounds
        Intervals in which the pose must stay; none if left out.
    search : SearchSettings
        How to search; the defaults suit most problems.
    obstacles : obstacle, map, shape, shapely geometry, corners, or a sequence of these
        What the body must not touch. A list of points (n, 2) [m] is a polygon; of a multipolygon
        each part counts, and holes are free.
    footprint : shape, shapely geometry, corners, or a sequence of these
        The body, in the frame of the pose [m]; a point if left out.
    parts : mapping of str to shapes
        Bodies of what the vehicle carries, such as its trailer, each in the frame of its part.
    body_height : (float, float)
        Lowest and highest point of the body [m] about the altitude of the pose; in the plane above
        the ground, where other vehicles fly: (0, 0), nothing stated, counts at all heights.
    margin : float
        Distance [m] that the body keeps from every obstacle.
    zones : sequence of Zone
        Where only some motions are admitted.
    place_costs : PlaceCost, or a sequence of these
        What a motion costs beside `cost` because of where it goes: `Clearance`, `Ground`.
    via : Via, pose, or a sequence of these
        What the plan passes on its way to the goal.
    order : str
        Whether that is passed in the order ``given``, or in the best one: ``free``.

    Raises
    ------
    ValueError
        If one of them has a wrong shape, is not finite or out of its range, or does not suit the
        vehicle.
    UnknownTrim
        If a trim is named that the automaton does not have.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    >>> Problem(robot, [0, 0, 0], [1, 1, 0], cost=Cost(effort=1.0)).goals[0].pose.tolist()
    [1.0, 1.0, 0.0]
    """

    automaton: Automaton
    start: Array  # (dof,) [m, m, rad(, m)]
    goals: tuple[Goal, ...]  # a Goal, a pose, or several of either
    cost: StageCost = field(default_factory=lambda: Cost(time=1.0), kw_only=True)
    horizon: Horizon = field(default_factory=Horizon, kw_only=True)
    start_trim: str | None = field(default=None, kw_only=True)
    start_state: Array | None = field(default=None, kw_only=True)  # (n_z,) in place of a trim
    start_time: float = field(default=0.0, kw_only=True)  # [s]
    bounds: Bounds = field(default_factory=Bounds, kw_only=True)
    search: SearchSettings = field(default_factory=SearchSettings, kw_only=True)
    obstacles: tuple[AnyObstacle, ...] = field(default=(), kw_only=True)
    footprint: tuple[Shape, ...] = field(default=(), kw_only=True)  # empty: the vehicle is a point
    parts: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict, kw_only=True)  # carried
    body_height: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)  # [m] about z
    margin: float = field(default=0.0, kw_only=True)  # [m] distance kept from every obstacle
    zones: tuple[Zone, ...] = field(default=(), kw_only=True)  # where not every motion is admitted
    place_costs: tuple[PlaceCost, ...] = field(default=(), kw_only=True)  # beside the invariant one
    via: tuple[Via, ...] = field(default=(), kw_only=True)  # what is passed on the way
    order: str = field(default="given", kw_only=True)  # in which: given | free

    __repr__ = brief

    if TYPE_CHECKING:  # numbers, group elements, one goal or several will do

        def __init__(
            self,
            automaton: Automaton,
            start: ArrayLike | _Element,
            goals: ArrayLike | _Element | Goal | Sequence[Goal],
            *,
            cost: StageCost = ...,
            horizon: Horizon = ...,
            start_trim: str | None = None,
            start_state: ArrayLike | Mapping[str, float] | None = None,
            start_time: float = 0.0,
            bounds: Bounds = ...,
            search: SearchSettings = ...,
            obstacles: AnyObstacle | AnyShape | Sequence[AnyObstacle | AnyShape] = (),
            footprint: AnyShape | Sequence[AnyShape] = (),
            parts: Mapping[str, AnyShape | Sequence[AnyShape]] = ...,
            body_height: tuple[float, float] = (0.0, 0.0),
            margin: float = 0.0,
            zones: Sequence[Zone] = (),
            place_costs: PlaceCost | Sequence[PlaceCost] = (),
            via: Via | ArrayLike | _Element | Sequence[Via] = (),
            order: str = "given",
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        dof = self.automaton.model.group.dof
        check_cost(self.cost)
        _known_rates(self.automaton, self.cost)
        for name, kind in (("bounds", Bounds), ("horizon", Horizon), ("search", SearchSettings)):
            if not isinstance(value := getattr(self, name), kind):
                raise ValueError(f"{name}: got {value!r:.60}, need {kind.__name__}(...)")
        object.__setattr__(self, "goals", _as_goals(self.goals))
        self._settle_states()
        if self.automaton.translated is not None:
            self._give_headings(self.automaton.translated)
        self._check_group()
        self._check_ends()
        check_size("margin", self.margin)
        if self.horizon.time is not None and dof > 2:
            fastest = np.abs(self.automaton.body_velocities[:, 2]).max()
            turns = self.horizon.time * fastest / math.tau
            if turns > MOST_TURNS:
                raise ValueError(
                    f"horizon: time is {self.horizon.time:g} s, in which the {turns:.3g} whole "
                    f"turns of a trim would all be tried, need at most {MOST_TURNS}"
                )
        object.__setattr__(self, "obstacles", as_obstacles(self.obstacles))
        object.__setattr__(self, "footprint", as_footprint(self.footprint))
        carried = self.automaton.model.part_names
        for name in self.parts:
            if name not in carried:
                raise ValueError(
                    f"parts: the {self.automaton.model.name} carries no {name!r}, only "
                    f"{', '.join(carried) or 'nothing'}"
                )
        bodies = {name: as_footprint(shapes) for name, shapes in self.parts.items()}
        object.__setattr__(self, "parts", bodies)
        low, high = self.body_height
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise ValueError(
                f"body_height must be [low, high] with low <= high, got {self.body_height} m"
            )
        object.__setattr__(self, "zones", tuple(self.zones))
        object.__setattr__(self, "place_costs", check_place_costs(self.place_costs))
        for zone in self.zones:
            for trim in zone.trims or ():
                self.automaton.index_of(trim)
        check_range("margin", self.margin, least=0, unit="m")
        object.__setattr__(self, "via", _as_vias(self.via))
        if self.order not in ORDERS:
            raise ValueError(f"order must be one of {', '.join(ORDERS)}, got {self.order!r}")
        if self.via:
            self._check_via()

    def _check_via(self) -> None:
        """What is on the way are poses of the vehicle, which can stand where it is to stay."""
        if self.horizon.time is not None:
            raise ValueError(
                f"via: the time is fixed, {self.horizon.time:g} s, and nothing says how it is "
                "shared out on the way; need a free final time"
            )
        if self.order == "free" and len(self.via) > MOST_UNORDERED:
            raise ValueError(f"via: {len(self.via)} in a free order, need at most {MOST_UNORDERED}")
        automaton, dof = self.automaton, self.start.size
        if (model := automaton.translated) is not None:  # one of its headings stands for any
            unstated = model.stated.group.dof

            def facing(one: Via) -> Via:
                if one.pose.size != unstated and not one.free_heading:
                    return one
                place = one.pose if one.pose.size == unstated else one.place
                return replace(one, pose=np.insert(place, 2, self.start[2]), free_heading=True)

            object.__setattr__(self, "via", tuple(map(facing, self.via)))
        for k, via in enumerate(self.via, 1):
            if via.pose.size != dof:
                raise ValueError(
                    f"via {k}: pose has {via.pose.size} numbers, need {dof} "
                    f"for the {automaton.model.name}"
                )
            if model is not None and not via.free_heading:
                posed(automaton, via.pose, f"via {k}")
            if automaton.rest is None and (via.stay_s or (via.stop and self.has_inertia)):
                raise ValueError(
                    f"via {k}: the {automaton.model.name} has no trim that stands still, so it "
                    "cannot stop there"
                )

    def _check_group(self) -> None:
        """Poses are those of SE2 or SE2xR: what plans knows no other product of groups."""
        model = self.automaton.model
        group, known, twist = model.group, group_of(model.group.dof), np.ones(model.group.dof)
        if group is not known and (group.exp(twist).pose != known.exp(twist).pose).any():
            raise ValueError(
                f"the {model.name} moves in {group.__name__}, and plans are for SE2, SE2xR and "
                "translations of the plane and of space"
            )

    def _check_start(self) -> None:
        dof = self.automaton.model.group.dof
        freeze(self, "start", last=dof)
        if self.start.ndim != 1:
            raise ValueError(f"start: pose has shape {self.start.shape}, need one pose")
        if not max(map(abs, self.start.tolist())) <= MOST_HEADING:
            check_size("start: pose", self.start[[0, 1, *range(3, dof)]])
            check_heading("start: pose", self.start)
        if not math.isfinite(self.start_time):
            raise ValueError(f"start: time must be finite, got {self.start_time} s")

    def _check_ends(self) -> None:
        """Start and goals are poses of the vehicle, and their trims its own."""
        self._check_start()
        dof = self.start.size
        for goal in self.goals:
            if goal.pose.size != dof:
                raise ValueError(
                    f"goal: pose has {goal.pose.size} numbers, need {dof} "
                    f"for the {self.automaton.model.name}"
                )
            if goal.trim is not None:
                self.automaton.index_of(goal.trim)
        if self.start_trim is not None:
            self.automaton.index_of(self.start_trim)
        if not self.automaton.is_kinematic:
            self._check_rests()

    def _give_headings(self, model: OnlyTranslated) -> None:
        """Start and goals of a vehicle that translations alone move get headings of its trims."""
        start = as_array("start", self.start)
        if self.start_trim is None or start.shape != (model.group.dof,):
            ((pose, trim),) = posed(self.automaton, start, "start", trim=self.start_trim)
            object.__setattr__(self, "start", pose)
            object.__setattr__(self, "start_trim", trim)
        goals = tuple(
            replace(goal, pose=pose, trim=trim, free_heading=False)
            for goal in self.goals
            for pose, trim in posed(
                self.automaton,
                goal.pose,
                "goal",
                trim=goal.trim,
                free=goal.free_heading or goal.pose.size == model.stated.group.dof,
            )
        )
        object.__setattr__(self, "goals", goals)

    def _settle_states(self) -> None:
        """Reduced states at the ends are those of the model; one that a trim has is that trim."""
        if self.start_state is not None:
            state, trim = settled_state(
                self.automaton, self.start_state, "start", trim=self.start_trim
            )
            object.__setattr__(self, "start_state", state)
            object.__setattr__(self, "start_trim", trim)
        goals = list(self.goals)
        for k, goal in enumerate(goals):
            if goal.state is not None:
                state, trim = settled_state(self.automaton, goal.state, "goal", trim=goal.trim)
                goals[k] = replace(goal, state=state, trim=trim)
                object.__setattr__(self, "goals", tuple(goals))

    def _check_rests(self) -> None:
        """A vehicle with inertia begins and ends in a trim, or in a state that is stated."""
        ends = [("start", self.start_trim, self.start_state)]
        ends += [("goal", goal.trim, goal.state) for goal in self.goals]
        for what, trim, state in ends:
            if trim is None and state is None and self.automaton.rest is None:
                raise ValueError(
                    f"{what}: the {self.automaton.model.name} has no trim that stands still, need "
                    f"the name of one of its trims: {', '.join(self.automaton.trim_names[:12])}"
                )

    @property
    def first_trim(self) -> Trim:
        """The trim in which the vehicle starts; rest unless one is named, or a state is stated.

        On a lattice that is the rest at the heading next to that of the start. Where the heading
        belongs to the trim, the start must have it: within a maneuver there is no first trim.
        """
        if self.start_state is not None:
            return on_the_spot.trim_at(self.automaton.model, self.start_state, "start state")
        if self.start_trim is not None and self.automaton.translated is not None:
            posed(self.automaton, self.start, "start", trim=self.start_trim)
        if self.start_trim is None and self.automaton.lattice is not None:
            return self._rest_facing(self.automaton.lattice, float(self.start[2]))
        return self._trim_or_rest(self.start_trim)

    def last_trim(self, goal: Goal) -> Trim:
        """The trim in which the vehicle ends at `goal`; rest unless one is named, or a state is.

        On a lattice that is the rest at the heading next to that of the goal, as the lattice lies
        under the start.
        """
        if goal.state is not None:
            return on_the_spot.trim_at(self.automaton.model, goal.state, "goal state")
        model = self.automaton.lattice
        if goal.trim is None and model is not None:
            begun = model.heading(self.first_trim.reduced_state)
            return self._rest_facing(model, float(goal.pose[2] - self.start[2]) + begun)
        return self._trim_or_rest(goal.trim)

    def _rest_facing(self, model: OnLattice, heading: float) -> Trim:
        """The trim at rest whose heading on the lattice is nearest; the first of equals."""
        off = [
            abs(math.remainder(model.heading(trim.reduced_state) - heading, 2.0 * math.pi))
            if trim.is_rest
            else math.inf
            for trim in self.automaton.trims
        ]
        return self.automaton.trims[int(np.argmin(off))]

    def _trim_or_rest(self, name: str | None) -> Trim:
        """A trim by its name, or rest; any trim where there is no rest and it is left at will."""
        known = self.automaton
        return known.trims[known.rest or 0] if name is None else known[name]

    @property
    def rates(self) -> Array:
        """Cost per second of every trim (m,)."""
        return self.cost.rates(self.automaton.controls, self.automaton.body_velocities)

    def rates_of(self, plan: Plan) -> Array:
        """Cost per second (n,) of the trims of a plan, which may be others than the library's."""
        return self.rates_of_trims(plan.trims)

    def rates_of_trims(self, trims: Sequence[Trim]) -> Array:
        """Cost per second (n,) of some trims, which may be others than the library's."""
        known = self._rates
        try:
            return np.array([known[trim] for trim in trims])
        except KeyError:
            return _rates_of_others(self.automaton, self.cost, tuple(trims)).copy()

    def cost_of(self, plan: Plan) -> float:
        """Cost of a plan of any primitives: `invariant_cost_of`, and what places cost."""
        invariant = self.invariant_cost_of(plan)
        if not self.place_costs:
            return invariant
        return invariant + sum(one.price for one in self.place_prices_of(plan))

    def place_prices_of(self, plan: Plan) -> tuple[place_prices.PlacePrice, ...]:
        """What a plan costs because of where it goes, for every one of the place costs.

        Examples
        --------
        >>> from maneuver_automaton import Box, Ground, Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
        >>> lawn = Ground(Box([2.0, 2.0], center=[4.0, 0.0]), price=3.0)
        >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], place_costs=lawn)
        >>> plan = Plan([0.0, 0.0, 0.0], (robot["ahead"],), durations=[9.0])
        >>> [round(one.price, 2) for one in problem.place_prices_of(plan)]
        [6.0]
        """

        def prices() -> tuple[place_prices.PlacePrice, ...]:
            model, beside = self.automaton.model, self.invariant_cost_of(plan)
            price = functools.partial(place_prices.price_along, beside=beside)
            return tuple(price(cost, plan, model) for cost in self.bound_place_costs)

        return kept_with(plan, self.bound_place_costs, prices)

    @property
    def bound_place_costs(self) -> tuple[PlaceCost, ...]:
        """The place costs, each knowing the obstacles and the body of the problem."""
        setting, costs = self.setting, self.setting.place_costs
        return kept_with(setting, costs, lambda: tuple(bound(one, setting) for one in costs))

    def invariant_cost_of(self, plan: Plan) -> float:
        """The part of a plan's cost that does not see where it goes: rates, prices of switches.

        Along a maneuver the rates are integrated from sample to sample by the trapezoidal rule:
        exact for time and effort, and for the length wherever the speed is linear.
        """
        if not any(plan.maneuvers):
            return self.cost_of_trims(plan.trims, plan.durations)
        coasting = float(self.rates_of(plan) @ plan.durations)
        maneuvers = sum(self.maneuver_cost(one) for one in plan.maneuvers if one)
        if not prices_switches(self.cost):
            return coasting + maneuvers
        driven = [self.velocities_along(one) for one in plan.primitives]
        return coasting + maneuvers + self.cost.switching(np.concatenate(driven))

    def cost_of_trims(self, trims: Sequence[Trim], durations: Array) -> float:
        """Invariant cost of trims that last `durations` (n,) [s], with the switches between."""
        if not trims:
            return 0.0
        coasting = float(self.rates_of_trims(trims).dot(durations))
        if not prices_switches(self.cost):
            return coasting
        return coasting + self.cost.switching(np.array([trim.body_velocity for trim in trims]))

    def maneuver_cost(self, maneuver: Maneuver) -> float:
        """Cost of a maneuver without the prices of switches.

        Raises
        ------
        ValueError
            If it has no course.
        """
        course, model = maneuver.course, self.automaton.model
        if maneuver.duration == 0.0:
            return 0.0
        if course is None:
            raise ValueError(f"maneuver {maneuver.name!r}: has no course, so its cost is not known")
        known = kept_with(self.automaton, ("prices", self.cost), dict[str, tuple[Maneuver, float]])
        entry = known.get(maneuver.name)
        if entry is None or entry[0] is not maneuver:
            controls = course.control[:-1]
            ends = [
                self.cost.rates(controls, model.body_velocity(states, controls))
                for states in (course.reduced_state[:-1], course.reduced_state[1:])
            ]
            rate = float(np.diff(course.time) @ (ends[0] + ends[1])) / 2.0
            standing = standing_price(model, course.reduced_state, course.control)
            entry = maneuver, maneuver.cost_multiplier * rate + standing
            if len(known) < MOST_KNOWN or maneuver.name in known:
                known[maneuver.name] = entry
        return entry[1]

    def velocities_along(self, primitive: Primitive) -> Array:
        """Body velocities (n, dof) of a primitive, one for every stretch in one direction."""
        if isinstance(primitive, Trim):
            return primitive.body_velocity[None]
        if primitive.course is None:
            return primitive.displacement[None]
        course = primitive.course
        between = (course.reduced_state[:-1] + course.reduced_state[1:]) / 2.0
        rows = self.automaton.model.body_velocity(between, course.control[:-1])
        rows = rows[np.abs(rows[:, 0]) > STANDING]
        if not len(rows):
            return np.zeros((1, self.start.size))
        signs = np.sign(rows[:, 0])
        return np.asarray(rows[np.append(True, signs[1:] != signs[:-1])])

    def starting_at(
        self,
        start: ArrayLike | _Element,
        *,
        time: float,
        goals: ArrayLike | _Element | Goal | Sequence[Goal] | None = None,
        trim: str | None = None,
        state: ArrayLike | Mapping[str, float] | None = None,
        horizon: Horizon | None = None,
    ) -> Problem:
        """The same problem from another start (dof,) at another time [s], perhaps to other goals.

        What stays the same is not checked again: that takes longer than a search of few words. The
        trim or reduced state at the start is that of the problem, unless one is given.

        Raises
        ------
        ValueError
            If the start or a goal is no pose of the vehicle, or the time is not finite.
        UnknownTrim
            If a trim is named that the automaton does not have.

        Examples
        --------
        >>> from maneuver_automaton.models import Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
        >>> later = Problem(robot, [0, 0, 0], [1, 1, 0]).starting_at(np.ones(3), time=0.5)
        >>> later.start.tolist(), later.start_time, later.goals[0].pose.tolist()
        ([1.0, 1.0, 1.0], 0.5, [1.0, 1.0, 0.0])
        """
        changed: dict[str, Any] = {"start": start, "start_time": as_number("time", time)}
        if goals is not None:
            changed["goals"] = goals
        if trim is not None or state is not None:
            changed.update(start_trim=trim, start_state=state)
        if horizon is not None:
            changed["horizon"] = horizon
        longer = horizon is not None and (horizon.time or 0.0) > (self.horizon.time or 0.0)
        if longer or self.automaton.translated is not None:  # more turns, or a heading of a trim's
            return replace(self, **changed)
        moved: Problem = object.__new__(Problem)
        if goals is not None:
            changed["goals"] = _as_goals(goals)
        moved.__dict__.update(self._same, **changed)
        if horizon is None:
            moved.__dict__["_setting"] = self.setting
        if goals is None and trim is None and state is None:
            moved._check_start()
        else:
            moved._settle_states()
            moved._check_ends()
        return moved

    @functools.cached_property
    def _same(self) -> dict[str, Any]:
        """What problems from other starts have in common with this one."""
        known = {one.name: self.__dict__[one.name] for one in fields(self)}
        return {"moves": self.moves, "_rates": self._rates, **known}

    @functools.cached_property
    def _rates(self) -> dict[Trim, float]:
        return _known_rates(self.automaton, self.cost)

    @property
    def setting(self) -> Problem:
        """The problem that this one was made from: only ends and clock may differ.

        What depends on nothing else is kept with it, for all the queries of a planner.

        Examples
        --------
        >>> from maneuver_automaton.models import Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
        >>> one = Problem(robot, [0, 0, 0], [1, 1, 0])
        >>> one.starting_at([2, 0, 0], time=0.0).setting is one, one.setting is one
        (True, True)
        """
        made_from: Problem = self.__dict__.get("_setting", self)
        return made_from

    @property
    def ends(self) -> tuple[str | None, tuple[tuple[str | None, bool], ...]]:
        """Trim at the start; trim and freedom of the heading at every goal: ends but for poses."""
        return self.start_trim, tuple((goal.trim, goal.free_heading) for goal in self.goals)

    def moved(self, by: LieGroup) -> Problem:
        """The problem moved by the group element `by`, all around it too; bounds must be open.

        Raises
        ------
        ValueError
            If there are bounds, or the vehicle does not look the same after a rotation in `by`.
        """
        by = motion_of(self.automaton, by)
        if not self.bounds.are_open:
            raise ValueError("problem: bounds do not move with the symmetry")
        group = type(by)
        return replace(
            self,
            start=(by @ group(self.start)).pose,
            goals=tuple(replace(goal, pose=(by @ group(goal.pose)).pose) for goal in self.goals),
            obstacles=tuple(obstacle.moved(by) for obstacle in self.obstacles),
            zones=tuple(zone.moved(by) for zone in self.zones),
            place_costs=tuple(moved(cost, by) for cost in self.place_costs),
            via=tuple(one.moved(by) for one in self.via),
        )

    @property
    def has_inertia(self) -> bool:
        """Whether the vehicle cannot switch at will between the trims that it needs."""
        return self.automaton.has_inertia

    @property
    def climbs_among_obstacles(self) -> bool:
        """Whether a vehicle that switches at will has more than a plane, and something is there.

        Examples
        --------
        >>> from maneuver_automaton import Automaton, Disc, Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
        >>> Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=Disc(1.0, [4, 0])).climbs_among_obstacles
        False
        """
        in_space = self.start.size > 3 and self.automaton.is_kinematic
        return in_space and bool(self.obstacles) and self.search.method in ("auto", "lattice")

    @property
    def has_states(self) -> bool:
        """Whether the vehicle starts or ends in a reduced state that is that of no trim."""
        return self.start_state is not None or any(goal.state is not None for goal in self.goals)

    @property
    def has_tolerance(self) -> bool:
        """Whether a plan may end beside a goal; on a lattice also whether at any heading."""
        turns = self.automaton.lattice is not None
        return any(
            goal.tolerance_m > 0.0 or goal.tolerance_rad > 0.0 or (turns and goal.free_heading)
            for goal in self.goals
        )

    @property
    def rests_at_both_ends(self) -> bool:
        """Whether the vehicle starts and ends at rest, or in states that are no others."""
        rests = [one.reduced_state.tolist() for one in self.automaton.trims if one.is_rest]
        ends = [self.first_trim, *map(self.last_trim, self.goals)]
        return all(one.is_rest or one.reduced_state.tolist() in rests for one in ends)

    @functools.cached_property
    def quiet_after(self) -> float:
        """When [s] the last moving obstacle has stopped, come or gone; -inf if nothing moves."""
        times = [-math.inf]
        for one in self.obstacles:
            if isinstance(one, Obstacle) and one.motion is not None:
                times += [float(one.motion.time[-1]), *filter(math.isfinite, one.presence)]
        return max(times)

    @functools.cached_property
    def moves(self) -> bool:
        """Whether an obstacle moves."""
        return any(getattr(one, "motion", None) is not None for one in self.obstacles)


def settled_state(
    automaton: Automaton, state: Any, what: str, *, trim: str | None = None
) -> tuple[Array | None, str | None]:
    """A reduced state at an end, or else the name of the trim that has it, rather one at rest."""
    if trim is not None:
        raise ValueError(f"{what}: both the trim {trim!r} and a state are given, need one of them")
    if automaton.translated is not None or automaton.lattice is not None:
        raise ValueError(
            f"{what}: the trims of the {automaton.model.name} belong to headings, so it cannot "
            "start or end in a state between them; need a trim"
        )
    known = on_the_spot.state_of(automaton.model, state, what)
    here = [
        one for one in automaton.trims if np.abs(one.reduced_state - known).max() <= STATE_TOLERANCE
    ]
    if here:
        return None, min(here, key=lambda one: not one.is_rest).name
    return known, None


def apart(one: Array, other: Array) -> tuple[float, float]:
    """How far two poses (dof,) are from each other: distance [m], and turn [rad] up to pi."""
    off = other - one
    way = off[:2] if off.size == 3 else off[[0, 1, *range(3, off.size)]]
    return math.sqrt(way.dot(way)), abs(math.remainder(off.item(2), 2.0 * math.pi))


def moves(obstacle: AnyObstacle) -> bool:
    """Whether an obstacle moves."""
    return isinstance(obstacle, Obstacle) and obstacle.motion is not None


@kept_by_first
def _rates_of_others(automaton: Automaton, cost: StageCost, trims: tuple[Trim, ...]) -> Array:
    controls = np.array([one.control for one in trims])
    return cost.rates(controls, np.array([one.body_velocity for one in trims]))


@kept_by_first
def _known_rates(automaton: Automaton, cost: StageCost) -> dict[Trim, float]:
    rates = np.asarray(cost.rates(automaton.controls, automaton.body_velocities))
    if rates.shape != (len(automaton),):
        raise ValueError(
            f"cost: the rates of {len(automaton)} trims have shape {rates.shape}, need "
            f"({len(automaton)},)"
        )
    known = dict(zip(automaton.trims, rates.tolist(), strict=True))
    for trim, rate in known.items():
        if not 0.0 <= rate < math.inf:
            raise ValueError(
                f"cost: trim {trim.name!r} costs {rate:g} per second, need a number of at least 0"
            )
    return known


def _as_vias(value: Any) -> tuple[Via, ...]:
    if isinstance(value, Via):
        return (value,)
    if isinstance(value, Sequence) and all(isinstance(one, Via) for one in value):
        return tuple(value)
    if isinstance(value, Sequence) and any(isinstance(one, Via | _Element) for one in value):
        return tuple(via for one in value for via in _as_vias(one))
    return tuple(Via(pose) for pose in np.atleast_2d(as_array("via: pose", value)))


def _as_goals(value: Any) -> tuple[Goal, ...]:
    if isinstance(value, Goal):
        return (value,)
    if isinstance(value, tuple) and all(type(one) is Goal for one in value) and value:
        return value
    if isinstance(value, Sequence) and any(isinstance(v, Goal | _Element) for v in value):
        return tuple(goal for one in value for goal in _as_goals(one))
    poses = as_array("goal: pose", value)
    if poses.ndim not in (1, 2) or poses.size == 0:
        raise ValueError(f"goal: got shape {poses.shape}, need one pose or a list of poses")
    return tuple(Goal(pose=pose) for pose in np.atleast_2d(poses))


def between_trims(problem: Problem) -> Problem:
    """The problem without states at its ends, for what does not depend on them."""
    return _between_trims(problem.setting) if problem.has_states else problem


@kept_by_first
def _between_trims(setting: Problem) -> Problem:
    automaton = setting.automaton
    name = automaton.trim_names[automaton.rest or 0]
    goals = tuple(
        replace(goal, state=None, trim=name) if goal.state is not None else goal
        for goal in setting.goals
    )
    start = name if setting.start_state is not None else setting.start_trim
    return replace(setting, start_state=None, start_trim=start, goals=goals)
