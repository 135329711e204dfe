"""The scenario file, schema 1, as values: what each key is called and what it may hold.

Checked here is what a key may hold by itself; what fits together is checked where the values
are made of it (`problem.py`, `costs.py`, `automaton/`).
"""

from __future__ import annotations

import itertools
import math
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Lt
from pydantic import (
    AfterValidator,
    AllowInfNan,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationInfo,
    field_validator,
)
from pydantic_core import PydanticCustomError

from maneuver_automaton.scenario.checks import Need, Number, Part, Several, Text, need

MODELS = ("unicycle", "car")
LATER_MODELS = (
    "second_order_unicycle",
    "second_order_car",
    "car_with_trailer",
    "single_track",
    "hovercraft",
    "helicopter",
)

Positive = Annotated[float, Strict(), AllowInfNan(False), Gt(0), Need("a positive number")]
NotNegative = Annotated[
    float, Strict(), AllowInfNan(False), Ge(0), Need("a finite number of at least 0")
]
Count = Annotated[int, Strict(), Ge(1), Need("a whole number of at least 1")]
Name = Annotated[str, Strict(), Field(pattern=r"\S"), Need("a name, a text that is not empty")]
Point = Annotated[
    tuple[Number, Number], Several("a point [x, y], two numbers", at_least=2, at_most=2)
]


def _rising(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise need("an interval [low, high] with low < high")
    return value


Interval = Annotated[
    tuple[Number, Number],
    Several("an interval [low, high], two numbers", at_least=2, at_most=2),
    AfterValidator(_rising),
]
Pose = Annotated[
    tuple[Number, ...],
    Several("a pose [x, y, heading], a list of 3 numbers", at_least=3, at_most=4),
]
Polygon = Annotated[tuple[Point, ...], Several("a list of at least 3 points [x, y]", at_least=3)]
SHARP = "an angle between 0 and pi / 2, 1.5708"
Seconds = Annotated[Positive | Literal["free"], Need("a positive number of seconds, or free")]


def _list_of_numbers(value: Any, info: ValidationInfo) -> Any:
    names = (info.context or {}).get("control_names", ())
    if not isinstance(value, list) or (names and len(value) != len(names)):
        count = f"{len(names)} numbers ({', '.join(names)})" if names else "numbers"
        raise need(f"a list of {count}")
    return value


Control = Annotated[tuple[Number, ...], BeforeValidator(_list_of_numbers)]


def _one_or_many(value: Any) -> str:
    return "<many>" if isinstance(value, list) else "<one>"


class Shape(Part):
    """A rigid shape in the frame of the vehicle: rectangle, polygon or disc."""

    one_of: ClassVar = ("rectangle_m", "polygon_m", "disc_m")
    goes_with: ClassVar = {"reference_m": ("rectangle_m",)}

    rectangle_m: (
        Annotated[
            tuple[Positive, Positive],
            Several("[length, width], two positive numbers", at_least=2, at_most=2),
        ]
        | None
    ) = Field(None, description="[length, width], ahead and aside")
    reference_m: Point | None = Field(
        None, description="where the pose sits in the rectangle, from its centre: [ahead, left]"
    )
    polygon_m: Polygon | None = Field(None, description="corners [x, y]")
    disc_m: Positive | None = Field(None, description="radius of a disc around the pose")


Footprint = Annotated[
    Annotated[Shape, Tag("<one>")]
    | Annotated[
        tuple[Shape, ...],
        Several("a shape or a list of at least one shape", at_least=1),
        Tag("<many>"),
    ],
    Discriminator(_one_or_many),
]


class UnicyclePart(Part):
    """A robot that drives ahead and turns on the spot; control [v, omega]."""

    model: Literal["unicycle"] = Field(description="unicycle")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_turn_rate_rad_s: Positive | None = Field(None, description="left out: no limit")
    footprint: Footprint | None = Field(None, description="shape of the body")


class CarPart(Part):
    """A car that rolls without slip, its pose on the rear axle; control [v, steering]."""

    model: Literal["car"] = Field(description="car")
    wheelbase_m: Positive = Field(description="distance of the axles, a positive number")
    max_steering_rad: (
        Annotated[float, Strict(), AllowInfNan(False), Gt(0), Lt(math.pi / 2), Need(SHARP)] | None
    ) = Field(None, description="left out: no limit")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    footprint: Footprint | None = Field(None, description="shape of the body")


def _check_model(value: Any) -> Any:
    if not isinstance(value, dict):
        raise need("a mapping with the key model")
    if "model" not in value:
        what = f"one of {', '.join(MODELS)}"
        raise PydanticCustomError("missing_key", "", {"key": "model", "what": what})
    if value["model"] not in MODELS:
        later = " (it is not in this version)" if value["model"] in LATER_MODELS else ""
        what = f"one of {', '.join(MODELS)}{later}"
        raise PydanticCustomError("at_key", "", {"key": "model", "need": what})
    return value


def _model_of(value: Any) -> str:
    model = value["model"] if isinstance(value, dict) else value.model
    return f"<{model}>"


VehiclePart = Annotated[
    Annotated[UnicyclePart, Tag("<unicycle>")] | Annotated[CarPart, Tag("<car>")],
    Discriminator(_model_of),
    BeforeValidator(_check_model),
]


class NamedControl(Part):
    """One trim of a kinematic vehicle: a name and a constant control."""

    name: Name = Field(description="a name that no other trim has")
    control: Control = Field(description="unicycle: [v, omega]; car: [v, steering]")


class Axis(Part):
    """Equally spaced values of one control, both ends included."""

    one_of: ClassVar = ("step", "count")

    min: Number = Field(description="smallest value")
    max: Number = Field(description="largest value")
    step: Positive | None = Field(None, description="distance of neighbours")
    count: Count | None = Field(None, description="number of values")


class Grid(Part):
    """One trim for every combination of control values."""

    control: Annotated[
        tuple[Axis, ...], Several("a list with one axis per control", at_least=1)
    ] = Field(description="one axis {min, max, step or count} per control")


class AutomatonPart(Part):
    """The library of trims: listed, a grid, a file, or a named one."""

    one_of: ClassVar = ("trims", "grid", "file", "preset")

    trims: (
        Annotated[tuple[NamedControl, ...], Several("a list of at least one trim", at_least=1)]
        | None
    ) = Field(None, description="trims, each {name, control}")
    grid: Grid | None = Field(None, description="all combinations of control values")
    file: Name | None = Field(None, description="library file, relative to this file")
    preset: Name | None = Field(None, description="name of a built-in library")


class Start(Part):
    """Where the plan begins."""

    pose: Pose = Field(description="[x, y, heading]")
    trim: Name | None = Field(None, description="the first trim")
    time_s: Number = Field(0.0, description="time at the start")


class GoalPart(Part):
    """Where the plan ends."""

    pose: Pose = Field(description="[x, y, heading]")
    trim: Name | None = Field(None, description="the last trim")
    heading: Annotated[Literal["free"], Need("free, or no such key")] | None = Field(
        None, description="free: the third number of the pose does not matter"
    )
    tolerance_m: NotNegative = Field(0.0, description="distance that is near enough; 0: exact")
    tolerance_rad: NotNegative = Field(0.0, description="heading that is near enough; 0: exact")


Goals = Annotated[
    Annotated[GoalPart, Tag("<one>")]
    | Annotated[
        tuple[GoalPart, ...],
        Several("a goal or a list of at least one goal", at_least=1),
        Tag("<many>"),
    ],
    Discriminator(_one_or_many),
]


def _norm_order(value: Any) -> Any:
    if isinstance(value, float | int) and not isinstance(value, bool) and value in (1, 2):
        return int(value)
    return "inf" if value == math.inf else value


class CostPart(Part):
    """Weights of the stage cost; what is left out is 0."""

    effort: NotNegative = Field(0.0, description="c1, of the squared control per second")
    norm: NotNegative = Field(0.0, description="c2, of the norm of the control per second")
    time: NotNegative = Field(0.0, description="c3, per second")
    effort_matrix: (
        Annotated[
            tuple[
                Annotated[
                    tuple[Number, ...],
                    Several("a row of the matrix, a list of numbers", at_least=1),
                ],
                ...,
            ],
            Several("a square matrix, a list of rows", at_least=1),
        ]
        | None
    ) = Field(None, description="R of the effort; left out: the identity")
    norm_order: Annotated[
        Literal[1, 2, "inf"], BeforeValidator(_norm_order), Need("1, 2 or inf")
    ] = Field(2, description="1, 2 or inf")
    length: NotNegative = Field(0.0, description="per metre driven")
    switch: NotNegative = Field(0.0, description="per switch of trims")
    direction_change: NotNegative = Field(0.0, description="per change between forward and reverse")


class HorizonPart(Part):
    """How long a plan lasts, and of how many trims it may consist."""

    time_s: Seconds = Field("free", description="exactly this long, or free")
    max_trims: Count | None = Field(None, description="largest number of trims, rest included")
    min_coast_s: NotNegative = Field(0.0, description="shortest time in a trim")
    max_time_s: Positive | None = Field(None, description="longest time, when time_s is free")


class BoundsPart(Part):
    """Where the pose may be."""

    x: Interval | None = Field(None, description="[low, high]")
    y: Interval | None = Field(None, description="[low, high]")
    z: Interval | None = Field(None, description="[low, high]")


class Disc(Part):
    """A disc in the world."""

    center: Point = Field(description="[x, y]")
    radius: Positive = Field(description="radius")


class Box(Part):
    """A rectangle in the world."""

    center: Point = Field(description="[x, y]")
    size: Annotated[
        tuple[Positive, Positive],
        Several("[length, width], two positive numbers", at_least=2, at_most=2),
    ] = Field(description="[length, width]")
    heading_rad: Number = Field(0.0, description="direction of its length")


TimedPose = Annotated[
    tuple[Number, Number, Number, Number],
    Several("[time, x, y, heading], four numbers", at_least=4, at_most=4),
]


def _in_time(motion: tuple[TimedPose, ...]) -> tuple[TimedPose, ...]:
    if any(later[0] <= earlier[0] for earlier, later in itertools.pairwise(motion)):
        raise need("poses [time, x, y, heading] whose times rise")
    return motion


class Obstacle(Part):
    """What the vehicle must not touch."""

    one_of: ClassVar = ("polygon_m", "disc_m", "box_m", "map")
    goes_with: ClassVar = {
        "holes_m": ("polygon_m",),
        "unknown": ("map",),
        "height_m": ("polygon_m", "disc_m", "box_m"),
        "motion": ("polygon_m", "disc_m", "box_m"),
    }

    polygon_m: Polygon | None = Field(None, description="corners [x, y]")
    holes_m: Annotated[tuple[Polygon, ...], Several("a list of polygons", at_least=0)] = Field(
        (), description="polygons that are free inside polygon_m"
    )
    disc_m: Disc | None = Field(None, description="{center, radius}")
    box_m: Box | None = Field(None, description="{center, size, heading_rad}")
    map: Name | None = Field(None, description="occupancy map (YAML), relative to this file")
    unknown: Annotated[Literal["blocked", "free"], Need("blocked or free")] = Field(
        "blocked", description="what unknown cells of the map are"
    )
    height_m: Interval | None = Field(None, description="[low, high] of a body in space")
    motion: (
        Annotated[
            tuple[TimedPose, ...],
            Several("a list of at least one [time, x, y, heading]", at_least=1),
            AfterValidator(_in_time),
        ]
        | None
    ) = Field(None, description="poses in time, linear between")


class SearchPart(Part):
    """How to search, and for how long."""

    method: Annotated[
        Literal["auto", "words", "insertion", "lattice"],
        Need("auto, words, insertion or lattice"),
    ] = Field("auto", description="auto, words, insertion or lattice")
    time_limit_s: Positive = Field(5.0, description="ceiling for search and refinement")
    max_expansions: Count | None = Field(None, description="ceiling for the nodes expanded")
    cell_m: Positive | None = Field(None, description="lattice: size of a cell")
    headings: Count | None = Field(None, description="lattice: number of headings")
    weight: (
        Annotated[float, Strict(), AllowInfNan(False), Ge(1), Need("a finite number of at least 1")]
        | None
    ) = Field(None, description="lattice: weight of the cost to go")
    show_nodes: bool = Field(False, description="lattice: draw what the first plan's search tried")


class PushPart(Part):
    """A displacement in the vehicle's own frame, as by a hand."""

    after_step: Annotated[int, Strict(), Ge(0), Need("a whole number of at least 0")] = Field(
        description="number of the step, the first is 0"
    )
    by: Pose = Field(description="[x, y, heading] seen from the vehicle")


class Disturbance(Part):
    """What the vehicle does beside its plan; random numbers come from the seed."""

    position_m: NotNegative = Field(0.0, description="standard deviation per axis and step")
    heading_rad: NotNegative = Field(0.0, description="standard deviation per step")
    measured_position_m: NotNegative = Field(0.0, description="standard deviation, seen alone")
    measured_heading_rad: NotNegative = Field(0.0, description="standard deviation, seen alone")
    twist_scale: Pose | None = Field(
        None, description="true over nominal body velocity, per component"
    )
    pushes: Annotated[tuple[PushPart, ...], Several("a list of pushes", at_least=0)] = Field(
        (), description="a list of {after_step, by}"
    )
    delay_steps: Annotated[Literal[0, 1], Need("0 or 1")] = Field(
        0, description="how late the controller sees the pose"
    )
    seed: Annotated[int, Strict(), Ge(0), Need("a whole number of at least 0")] = Field(
        0, description="seed of the random numbers"
    )

    @field_validator("pushes")
    @classmethod
    def _one_push_a_step(cls, pushes: tuple[PushPart, ...]) -> tuple[PushPart, ...]:
        if len({push.after_step for push in pushes}) < len(pushes):
            raise need("pushes after different steps")
        return pushes


class RecedingHorizonPart(Part):
    """Closed loop, for mpc."""

    step_s: Positive = Field(description="time between two plans")
    steps: Count | None = Field(None, description="largest number of steps; left out: 100")
    margin: NotNegative = Field(
        0.0, description="a new word must be cheaper by more than this; 0: the optimum"
    )
    retimed: bool = Field(False, description="drive plans at the pace of uniform effort")
    stay: bool = Field(False, description="go on within the goal's tolerance for all steps")
    disturbance: Disturbance | None = Field(
        None, description="{position_m, heading_rad, seed, ...}"
    )


class ZonePart(Part):
    """A part of the plane in which not every motion is admitted."""

    polygon_m: Polygon = Field(description="corners [x, y]")
    max_speed_m_s: NotNegative | None = Field(None, description="greatest speed in it")
    reverse: bool = Field(True, description="false: forwards only")
    max_lateral_acceleration_m_s2: NotNegative | None = Field(
        None, description="greatest speed times turn rate in it"
    )
    trims: (
        Annotated[tuple[Name, ...], Several("a list of at least one trim", at_least=1)] | None
    ) = Field(None, description="only these trims, and maneuvers between them")


class ScenarioFile(Part):
    """A motion planning problem: vehicle, automaton, start, goal, cost."""

    schema_version: Literal[1] = Field(alias="schema", description="1")
    name: Text | None = Field(None, description="what the situation is called")
    vehicle: VehiclePart = Field(description="a mapping {model, ...}")
    automaton: AutomatonPart = Field(description="a mapping with trims, grid, file or preset")
    start: Start = Field(description="a mapping {pose, ...}")
    goal: Goals = Field(description="a mapping {pose, ...}, or a list of these")
    cost: CostPart = Field(
        default_factory=lambda: CostPart(time=1.0), description="left out: {time: 1}"
    )
    horizon: HorizonPart = Field(
        default_factory=HorizonPart, description="left out: free time, any number of trims"
    )
    bounds_m: BoundsPart = Field(default_factory=BoundsPart, description="left out: none")
    margin_m: NotNegative = Field(0.0, description="distance kept from everything")
    obstacles: Annotated[tuple[Obstacle, ...], Several("a list of obstacles", at_least=0)] = Field(
        (), description="what the vehicle must not touch"
    )
    zones: Annotated[tuple[ZonePart, ...], Several("a list of zones", at_least=0)] = Field(
        (), description="where not every motion is admitted"
    )
    search: SearchPart = Field(default_factory=SearchPart, description="how to search")
    receding_horizon: RecedingHorizonPart | None = Field(None, description="only for mpc")
