"""The scenario file, schema 1, as values: what each key is called and what it may hold.

Checked here is what a key may hold by itself; what fits together is checked where the values
are made of it (`problem.py`, `costs.py`, `automaton/`).
"""

import itertools
import math
from typing import Annotated, Any, ClassVar, Literal, Self

from annotated_types import Ge
from pydantic import (
    AllowInfNan,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationInfo,
    model_validator,
)

from maneuver_automaton.scenario.parts import (
    Count,
    FilePart,
    Interval,
    Name,
    Need,
    NotNegative,
    Number,
    Point,
    Polygon,
    Polygons,
    Pose2D,
    Positive,
    Several,
    Size,
    Text,
    Truth,
    Whole,
    exactly,
    holding,
    need,
    one_or_many,
    optional,
    refusal,
)
from maneuver_automaton.scenario.vehicles import VehiclePart

Pose = Annotated[
    tuple[Number, ...],
    Several("a pose [x, y, heading], a list of 3 numbers", at_least=3, at_most=4),
]
Seconds = Annotated[Positive | Literal["free"], Need("a positive number of seconds, or free")]


def _listed(value: Any, info: ValidationInfo) -> Any:
    """A list of numbers, as many as the model of the file has of them."""
    names = (info.context or {}).get(f"{info.field_name}_names", ())
    if not isinstance(value, list) or (names and len(value) != len(names)):
        count = f"{len(names)} numbers ({', '.join(names)})" if names else "numbers"
        raise need(f"a list of {count}")
    return value


Vector = Annotated[tuple[Number, ...], BeforeValidator(_listed)]
Numbers = Annotated[tuple[Number, ...], Several("a list of numbers")]


class NamedTrim(FilePart):
    """One trim: a name, and what holds it; what is left out follows from the rest being steady."""

    name: Name = Field(description="a name that no other trim has")
    control: Vector | None = optional("constant control; unicycle: [v, omega]; car: [v, steering]")
    state: Vector | None = optional(
        "reduced state of a vehicle that has one; second_order_car: [v, steering]"
    )


class Axis(FilePart):
    """Equally spaced values of one control, both ends included."""

    one_of: ClassVar = ("step", "count")

    min: Number = Field(description="smallest value")
    max: Number = Field(description="largest value")
    step: Positive | None = optional("distance of neighbours")
    count: Count | None = optional("number of values")


Axes = Annotated[tuple[Axis, ...], Several("a list with one axis per control", at_least=1)]


class GridPart(FilePart, title="Grid"):
    """One trim for every combination of values: of controls, or of speeds and what else is steady.

    The axes of a kinematic vehicle are those of its control. Any other vehicle has axes by name:
    of its body velocity, its reduced state or its control; the rest is solved for.
    """

    control: Axes | None = optional("one axis {min, max, step or count} per control")
    speed_m_s: Axis | None = optional("axis of the speed ahead")
    lateral_speed_m_s: Axis | None = optional("axis of the speed to the left")
    turn_rate_rad_s: Axis | None = optional("axis of the turn rate")
    climb_m_s: Axis | None = optional("axis of the speed upwards")
    steering_rad: Axis | None = optional("axis of the steering angle")
    max_lateral_acceleration_m_s2: Positive | None = optional(
        "greatest speed times turn rate of a trim; left out: no limit"
    )
    leave_out: Truth = Field(
        False, description="true: points without a trim are left out, not refused"
    )


class ManeuversPart(FilePart):
    """How trims of a grid are joined, where that needs no solver."""

    pairs: Annotated[Literal["all", "neighbours"], Need("all or neighbours")] = Field(
        "neighbours", description="all, or neighbours: at most one level apart in every axis"
    )
    late: Truth = Field(False, description="also what is as quick but changes late")
    strokes_m: Numbers = Field((), description="lengths from rest to rest, negative in reverse")
    turns_rad: Numbers = Field((), description="turns on the spot, from rest to rest")


NamedTrims = Annotated[tuple[NamedTrim, ...], Several("a list of at least one trim", at_least=1)]


class AutomatonPart(FilePart):
    """The library of trims: listed, a grid, a file, or a named one."""

    one_of: ClassVar = ("trims", "grid", "file", "preset")
    goes_with: ClassVar = {"maneuvers": ("trims", "grid")}

    trims: NamedTrims | None = optional("trims, each {name, control or state}")
    grid: GridPart | None = optional("all combinations of values")
    file: Name | None = optional("library file, relative to this file")
    preset: Name | None = optional("name of a built-in library")
    maneuvers: ManeuversPart | None = optional("how trims are joined")


def _by_names(value: Any) -> Any:
    numbers = (
        isinstance(value, dict)
        and value
        and all(
            isinstance(one, int | float) and not isinstance(one, bool) for one in value.values()
        )
    )
    if not numbers:
        raise need("a mapping of numbers, such as {speed_m_s: 1.37, steering_rad: 0.12}")
    return value


State = Annotated[dict[str, Number], BeforeValidator(_by_names)]


class StartPart(FilePart, title="Start"):
    """Where the plan begins."""

    pose: Pose = Field(description="[x, y, heading]")
    trim: Name | None = optional("the first trim")
    state: State | None = optional(
        "with inertia, in place of a trim: speeds, steering angle, {speed_m_s, steering_rad, ...}"
    )
    time_s: Number = Field(0.0, description="time at the start")


class GoalPart(FilePart):
    """Where the plan ends."""

    pose: Pose = Field(description="[x, y, heading]")
    trim: Name | None = optional("the last trim")
    state: State | None = optional("with inertia, in place of a trim, as of the start")
    heading: Annotated[Literal["free"], Need("free, or no such key")] | None = optional(
        "free: the third number of the pose does not matter"
    )
    tolerance_m: NotNegative = Field(0.0, description="distance that is near enough; 0: exact")
    tolerance_rad: NotNegative = Field(0.0, description="heading that is near enough; 0: exact")


ViaPose = Annotated[
    tuple[Number, ...],
    Several("a pose [x, y, heading], or [x, y] with free_heading", at_least=2, at_most=4),
]
GatePoint = Annotated[
    tuple[Number, ...], Several("a point [x, y], two numbers", at_least=2, at_most=3)
]
Gate = Annotated[tuple[GatePoint, GatePoint], exactly(2, "a list of two points [x, y]")]


class ViaPart(FilePart, title="Via"):
    """What the plan passes on its way: a pose, or a gate."""

    pose: ViaPose | None = optional("[x, y, heading]; of a gate it lies on it, for the heading")
    free_heading: Truth = Field(False, description="true: any heading will do")
    tolerance_m: NotNegative = Field(0.0, description="distance that is near enough; 0: exact")
    stop: Truth = Field(False, description="true: it comes to rest there")
    stay_s: NotNegative = Field(0.0, description="how long it stands there")
    gate: Gate | None = optional("[[x, y], [x, y]]: a segment that is crossed anywhere")

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if self.pose is None and self.gate is None:
            raise refusal("got neither pose nor gate, need one of them")
        if self.pose is not None and len(self.pose) == 2 and not self.free_heading:
            raise refusal("got 2 numbers, need [x, y, heading], or free_heading: true", key="pose")
        return self


Goals = Annotated[
    Annotated[GoalPart, Tag("<one>")]
    | Annotated[
        tuple[GoalPart, ...],
        Several("a goal or a list of at least one goal", at_least=1),
        Tag("<many>"),
    ],
    Discriminator(one_or_many),
]


def _norm_order(value: Any) -> Any:
    if isinstance(value, float | int) and not isinstance(value, bool) and value in (1, 2):
        return int(value)
    return "inf" if value == math.inf else value


Row = Annotated[tuple[Number, ...], Several("a row of the matrix, a list of numbers", at_least=1)]
Matrix = Annotated[tuple[Row, ...], Several("a square matrix, a list of rows", at_least=1)]


class CostPart(FilePart):
    """Weights of the stage cost, 0 unless stated."""

    effort: NotNegative = Field(0.0, description="c1, of the squared control per second")
    norm: NotNegative = Field(0.0, description="c2, of the norm of the control per second")
    time: NotNegative = Field(0.0, description="c3, per second")
    effort_matrix: Matrix | None = optional("R of the effort; left out: the identity")
    norm_order: Annotated[
        Literal[1, 2, "inf"], BeforeValidator(_norm_order), Need("1, 2 or inf")
    ] = Field(2, description="1, 2 or inf")
    length: NotNegative = Field(0.0, description="per metre driven")
    switch: NotNegative = Field(0.0, description="per switch of trims")
    direction_change: NotNegative = Field(0.0, description="per change between forward and reverse")


Per = Annotated[Literal["metre", "second"], Need("metre or second")]


class ClearancePart(FilePart):
    """What it costs to be near to obstacles that stand still."""

    weight: NotNegative = Field(description="price at contact")
    within_m: Positive = Field(description="distance from which on nothing is paid")
    per: Per = Field("metre", description="metre of the way, or second")


class GroundPart(FilePart):
    """Ground with a price."""

    one_of: ClassVar = ("polygon_m", "raster", "costmap", "elevation")
    goes_with: ClassVar = {
        "holes_m": ("polygon_m",),
        "resolution_m": ("raster", "costmap", "elevation"),
        "origin": ("raster", "costmap", "elevation"),
        "max_cross_slope": ("elevation",),
        "per": ("polygon_m", "raster", "costmap"),
    }

    polygon_m: Polygon | None = optional("corners [x, y]")
    holes_m: Polygons = Field((), description="polygons inside polygon_m that cost nothing")
    raster: Name | None = optional("prices: .npy, row 0 lowest, or an image whose white is 1")
    costmap: Name | None = optional("costs of Nav2: 252 costs price, 253 and above are obstacles")
    elevation: Name | None = optional("heights [m]: a metre climbed costs price")
    resolution_m: Positive | None = optional("size of a cell")
    origin: Pose2D = Field((0.0, 0.0, 0.0), description="pose of the lower left corner")
    price: NotNegative = Field(1.0, description="price, or factor of the raster's values")
    max_cross_slope: NotNegative | None = optional("greatest slope from left to right, rise by way")
    per: Per = Field("metre", description="metre of the way, or second")


class PricedCostPart(CostPart, title="Cost"):
    """Weights of the stage cost, 0 unless stated, and what places cost beside it."""

    clearance: ClearancePart | None = optional("{weight, within_m}: near obstacles")
    ground: Annotated[tuple[GroundPart, ...], Several("a list of ground")] = Field(
        (), description="a list of {polygon_m, price}, {raster, ...}, ..."
    )


class HorizonPart(FilePart):
    """How long a plan lasts, and of how many trims it may consist."""

    time_s: Seconds = Field("free", description="exactly this long, or free")
    max_trims: Count | None = optional("largest number of trims, rest included")
    min_coast_s: NotNegative | None = optional(
        "shortest time in a trim; omitted: 0.02, unless the plan gets costlier"
    )
    max_time_s: Positive | None = optional("longest time, when time_s is free")
    stay: Truth = Field(
        False, description="it stays at the goal, when time_s is free: nothing may pass there later"
    )


class BoundsPart(FilePart):
    """Where the pose may be."""

    x: Interval | None = optional("[low, high]")
    y: Interval | None = optional("[low, high]")
    z: Interval | None = optional("[low, high]")


class DiscPart(FilePart, title="Disc"):
    """A disc in the world."""

    center: Point = Field(description="[x, y]")
    radius: Positive = Field(description="radius")


class BoxPart(FilePart, title="Box"):
    """A rectangle in the world."""

    center: Point = Field(description="[x, y]")
    size: Size = Field(description="[length, width]")
    heading_rad: Number = Field(0.0, description="direction of its length")


TimedPose = Annotated[
    tuple[Number, Number, Number, Number], exactly(4, "[time, x, y, heading], four numbers")
]


TimedPoses = Annotated[
    tuple[TimedPose, ...],
    Several("a list of at least one [time, x, y, heading]", at_least=1),
    holding(
        lambda motion: all(one[0] < after[0] for one, after in itertools.pairwise(motion)),
        "poses [time, x, y, heading] whose times rise",
    ),
]
Twists = Annotated[
    tuple[Pose, ...], Several("a list of [v_x, v_y, turn rate], one for every pose but the last")
]


class ObstaclePart(FilePart, title="Obstacle"):
    """What the vehicle must not touch."""

    one_of: ClassVar = ("polygon_m", "disc_m", "box_m", "map")
    goes_with: ClassVar = {
        "holes_m": ("polygon_m",),
        "unknown": ("map",),
        "height_m": ("polygon_m", "disc_m", "box_m"),
        "motion": ("polygon_m", "disc_m", "box_m"),
        "twists": ("motion",),
        "present_s": ("polygon_m", "disc_m", "box_m"),
    }

    polygon_m: Polygon | None = optional("corners [x, y]")
    holes_m: Polygons = Field((), description="polygons that are free inside polygon_m")
    disc_m: DiscPart | None = optional("{center, radius}")
    box_m: BoxPart | None = optional("{center, size, heading_rad}")
    map: Name | None = optional("occupancy map (YAML), relative to this file")
    unknown: Annotated[Literal["blocked", "free"], Need("blocked or free")] = Field(
        "blocked", description="what unknown cells of the map are"
    )
    height_m: Interval | None = optional("[low, high] of a body in space")
    motion: TimedPoses | None = optional("poses in time, linear between")
    twists: Twists | None = optional(
        "velocities in its own frame after each pose: it moves on arcs"
    )
    present_s: Interval | None = optional("[from, to]: it is there then alone")


class SearchPart(FilePart):
    """How to search, and for how long."""

    method: Annotated[
        Literal["auto", "words", "insertion", "lattice"], Need("auto, words, insertion or lattice")
    ] = Field("auto", description="auto, words, insertion or lattice")
    time_limit_s: Positive = Field(5.0, description="upper bound for search and refinement")
    max_expansions: Count | None = optional("upper bound for the nodes expanded")
    cell_m: Positive | None = optional("lattice: size of a cell")
    headings: Count | None = optional("lattice: number of headings")
    weight: (
        Annotated[float, Strict(), AllowInfNan(False), Ge(1), Need("a finite number of at least 1")]
        | None
    ) = optional("lattice: weight of the cost to go")
    backwards: Truth = Field(
        False, description="lattice_body: search from the goals; false: from the start"
    )
    show_nodes: Truth = Field(False, description="lattice: draw what the first plan's search tried")
    improve: Truth = Field(
        True, description="look for better plans once there is one; false: return the first"
    )
    polish: Truth = Field(
        True, description="with inertia: motions that the library does not have; false: none"
    )


class PushPart(FilePart):
    """A displacement in the vehicle's own frame, as by a hand."""

    after_step: Whole = Field(description="number of the step, the first is 0")
    by: Pose = Field(description="[x, y, heading] seen from the vehicle")


Pushes = Annotated[
    tuple[PushPart, ...],
    Several("a list of pushes"),
    holding(
        lambda pushes: len({push.after_step for push in pushes}) == len(pushes),
        "pushes after different steps",
    ),
]


class NoisePart(FilePart):
    """What a vehicle does beside its plan."""

    position_m: NotNegative = Field(0.0, description="standard deviation per axis and step")
    heading_rad: NotNegative = Field(0.0, description="standard deviation per step")
    measured_position_m: NotNegative = Field(0.0, description="standard deviation, seen alone")
    measured_heading_rad: NotNegative = Field(0.0, description="standard deviation, seen alone")
    reduced_state: Numbers | None = optional(
        "standard deviation per step of each speed, angle, ... of a vehicle with inertia"
    )
    twist_scale: Pose | None = optional("true over nominal body velocity, per component")
    pushes: Pushes = Field((), description="a list of {after_step, by}")


class LateNoisePart(NoisePart, title="Disturbance"):
    """What the vehicle does beside its plan; random numbers come from the seed."""

    delay_steps: Annotated[Literal[0, 1], Need("0 or 1")] = Field(
        0, description="how late the controller sees the pose"
    )
    seed: Whole = Field(0, description="seed of the random numbers")


class RecedingHorizonPart(FilePart):
    """Closed loop, for mpc."""

    step_s: Positive = Field(description="time between two plans")
    steps: Count | None = optional("largest number of steps; left out: 100")
    margin: NotNegative = Field(
        0.0, description="a new word must be cheaper by more than this; 0: the optimum"
    )
    retimed: Truth = Field(False, description="drive plans at the pace of uniform effort")
    pieces: Count | None = optional(
        "parts of a plan with controls between those of the library; left out: 0"
    )
    stay: Truth = Field(False, description="go on within the goal's tolerance for all steps")
    disturbance: LateNoisePart | None = optional("{position_m, heading_rad, seed, ...}")


class MaskLimitPart(FilePart, title="MaskLimit"):
    """The greatest speed where a mask has a value v from 1 to 100: base + multiplier * v."""

    base: Number = Field(description="of the speed")
    multiplier: Number = Field(description="of the value of the mask")
    unit: Annotated[Literal["percent", "m_s"], Need("percent or m_s")] = Field(
        "percent", description="percent of the fastest trim, or m_s [m/s]"
    )


TrimNames = Annotated[tuple[Name, ...], Several("a list of at least one trim", at_least=1)]


class ZonePart(FilePart):
    """A part of the plane in which not every motion is admitted."""

    one_of: ClassVar = ("polygon_m", "map")
    goes_with: ClassVar = {
        "holes_m": ("polygon_m",),
        "speed_limit": ("map",),
        "max_speed_m_s": ("polygon_m",),
        "reverse": ("polygon_m",),
        "max_lateral_acceleration_m_s2": ("polygon_m",),
        "trims": ("polygon_m",),
    }

    polygon_m: Polygon | None = optional("corners [x, y]")
    holes_m: Polygons = Field((), description="polygons inside polygon_m that are not in the zone")
    map: Name | None = optional("mask of a speed filter (YAML), relative to this file")
    speed_limit: MaskLimitPart | None = optional("{base, multiplier, unit} of the mask")
    max_speed_m_s: NotNegative | None = optional("greatest speed in it")
    reverse: Truth = Field(True, description="false: forwards only")
    max_lateral_acceleration_m_s2: NotNegative | None = optional(
        "greatest speed times turn rate in it"
    )
    trims: TrimNames | None = optional("only these trims, and maneuvers between them")


Obstacles = Annotated[tuple[ObstaclePart, ...], Several("a list of obstacles")]
Zones = Annotated[tuple[ZonePart, ...], Several("a list of zones")]
Vias = Annotated[tuple[ViaPart, ...], Several("a list of poses and gates on the way")]


class ScenarioFile(FilePart):
    """A motion planning problem: vehicle, automaton, start, goal, cost."""

    schema_version: Literal[1] = Field(alias="schema", description="1")
    name: Text | None = optional("what the situation is called")
    vehicle: VehiclePart = Field(description="a mapping {model, ...}")
    automaton: AutomatonPart = Field(description="a mapping with trims, grid, file or preset")
    start: StartPart = Field(description="a mapping {pose, ...}")
    goal: Goals = Field(description="a mapping {pose, ...}, or a list of these")
    cost: PricedCostPart = Field(
        default_factory=lambda: PricedCostPart(time=1.0), description="left out: {time: 1}"
    )
    horizon: HorizonPart = Field(
        default_factory=HorizonPart, description="left out: free time, any number of trims"
    )
    bounds_m: BoundsPart = Field(default_factory=BoundsPart, description="left out: none")
    margin_m: NotNegative = Field(0.0, description="distance kept from everything")
    obstacles: Obstacles = Field((), description="what the vehicle must not touch")
    zones: Zones = Field((), description="where not every motion is admitted")
    via: Vias = Field((), description="poses and gates that are passed on the way")
    order: Annotated[Literal["given", "free"], Need("given or free")] = Field(
        "given", description="in which what is on the way is passed: given, or free, the best one"
    )
    search: SearchPart = Field(default_factory=SearchPart, description="how to search")
    receding_horizon: RecedingHorizonPart | None = optional("only for mpc")

    @property
    def goals(self) -> tuple[GoalPart, ...]:
        """One or several."""
        return self.goal if isinstance(self.goal, tuple) else (self.goal,)
