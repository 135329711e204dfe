"""The vehicle of a scenario file as values: model, parameters with their units, body."""

from __future__ import annotations

import difflib
import math
import re
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Gt, Lt
from pydantic import (
    AllowInfNan,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationInfo,
)
from pydantic_core import PydanticCustomError

from maneuver_automaton.scenario.checks import (
    Interval,
    Name,
    Need,
    NotNegative,
    Number,
    Part,
    Point,
    Polygon,
    Positive,
    Several,
    need,
    one_or_many,
)

SHARP = "an angle between 0 and pi / 2, 1.5708"
Sharp = Annotated[float, Strict(), AllowInfNan(False), Gt(0), Lt(math.pi / 2), Need(SHARP)]


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
        None,
        description="where the pose sits in the rectangle, from its centre: [ahead, left]; "
        "a rear axle has ahead < 0",
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
    Discriminator(one_or_many),
]


ABOVE_GROUND = (
    "[low, high] of the body above the ground, where others of a fleet fly; left out: it counts at "
    "all heights"
)


STEERED = "state max_steering_rate_rad_s of second_order_car or single_track"
REFUSED = {  # limits of rates that are no state of any vehicle
    **dict.fromkeys(
        ("max_jerk", "max_jerk_m_s3", "max_lateral_jerk_m_s3"),
        "no such key: no vehicle has its acceleration as a state; state max_acceleration_m_s2",
    ),
    **dict.fromkeys(
        ("max_curvature_rate", "max_curvature_rate_per_m_s", "max_curvature_rate_1_m_s"),
        f"no such key: the curvature changes as the wheels turn; {STEERED}",
    ),
}
LATERAL = "greatest speed times turn rate; left out: no limit"


class Vehicle(Part):
    """A vehicle that is no car."""

    instead: ClassVar = REFUSED | {
        "max_lateral_acceleration_m_s2": "no such key, which car, second_order_car, "
        "accelerating_car, car_with_trailer and single_track have; a zone limits it for any vehicle"
    }


class UnicyclePart(Vehicle):
    """A robot that drives ahead and turns on the spot; control [v, omega]."""

    model: Literal["unicycle"] = Field(description="unicycle")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_turn_rate_rad_s: Positive | None = Field(None, description="left out: no limit")
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class CarPart(Part):
    """A car that rolls without slip, its pose on the rear axle; control [v, steering]."""

    instead: ClassVar = REFUSED

    model: Literal["car"] = Field(description="car")
    wheelbase_m: Positive = Field(description="distance of the axles, a positive number")
    max_steering_rad: Sharp | None = Field(None, description="left out: no limit")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_lateral_acceleration_m_s2: Positive | None = Field(None, description=LATERAL)
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class SecondOrderUnicyclePart(Vehicle):
    """A robot with inertia; state [v, omega], control their rates."""

    model: Literal["second_order_unicycle"] = Field(description="second_order_unicycle")
    max_speed_m_s: Positive = Field(description="a positive number")
    max_turn_rate_rad_s: Positive = Field(description="a positive number")
    max_acceleration_m_s2: Positive = Field(description="a positive number")
    max_angular_acceleration_rad_s2: Positive = Field(description="a positive number")
    min_speed_m_s: Number | None = Field(None, description="left out: as fast in reverse")
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class SecondOrderCarPart(Part):
    """A car with inertia, its pose on the rear axle; state [v, steering], control their rates."""

    instead: ClassVar = REFUSED

    model: Literal["second_order_car"] = Field(description="second_order_car")
    wheelbase_m: Positive = Field(description="distance of the axles, a positive number")
    max_steering_rad: Sharp = Field(description=SHARP)
    max_speed_m_s: Positive = Field(description="a positive number")
    max_acceleration_m_s2: Positive = Field(description="a positive number")
    max_steering_rate_rad_s: Positive = Field(description="a positive number")
    min_speed_m_s: Number | None = Field(None, description="left out: as fast in reverse")
    max_lateral_acceleration_m_s2: Positive | None = Field(None, description=LATERAL)
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class AcceleratingCarPart(Part):
    """A car with inertia that steers at once, as AROC has it; state [v], control [rate, angle]."""

    instead: ClassVar = REFUSED

    model: Literal["accelerating_car"] = Field(description="accelerating_car")
    wheelbase_m: Positive = Field(description="distance of the axles, a positive number")
    max_steering_rad: Sharp = Field(description=SHARP)
    max_speed_m_s: Positive = Field(description="a positive number")
    max_acceleration_m_s2: Positive = Field(description="a positive number")
    min_speed_m_s: Number | None = Field(None, description="left out: as fast in reverse")
    max_lateral_acceleration_m_s2: Positive | None = Field(None, description=LATERAL)
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class CarWithTrailerPart(Part):
    """A car that pulls a trailer; state [hitch], control [v, steering]."""

    instead: ClassVar = REFUSED

    model: Literal["car_with_trailer"] = Field(description="car_with_trailer")
    wheelbase_m: Positive = Field(description="distance of the axles, a positive number")
    hitch_length_m: Positive = Field(description="from the hitch to the trailer's axle")
    max_steering_rad: Sharp = Field(description=SHARP)
    max_speed_m_s: Positive = Field(description="a positive number")
    min_speed_m_s: Number | None = Field(None, description="left out: as fast in reverse")
    max_hitch_rad: Positive | None = Field(None, description="left out: no limit")
    max_lateral_acceleration_m_s2: Positive | None = Field(None, description=LATERAL)
    footprint: Footprint | None = Field(None, description="shape of the car")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)
    trailer: Footprint | None = Field(
        None, description="shape of the trailer, seen from the middle of its axle"
    )


class SingleTrackPart(Part):
    """A car on linear tyres; state [v, v aside, turn rate, steering]; left out: a BMW 320i."""

    instead: ClassVar = REFUSED

    model: Literal["single_track"] = Field(description="single_track")
    mass_kg: Positive | None = Field(None, description="a positive number")
    inertia_kg_m2: Positive | None = Field(None, description="about the vertical")
    front_m: Positive | None = Field(None, description="from the front axle to the pose")
    rear_m: Positive | None = Field(None, description="from the rear axle to the pose")
    height_m: Positive | None = Field(None, description="of the centre of gravity")
    cornering_per_rad: Positive | None = Field(None, description="stiffness over load and friction")
    friction: Positive | None = Field(None, description="of the tyres")
    max_steering_rad: Sharp | None = Field(None, description=SHARP)
    max_steering_rate_rad_s: Positive | None = Field(None, description="a positive number")
    max_acceleration_m_s2: Positive | None = Field(None, description="a positive number")
    min_speed_m_s: Positive | None = Field(None, description="from which the model holds")
    max_speed_m_s: Positive | None = Field(None, description="a positive number")
    max_lateral_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_turn_rate_rad_s: Positive | None = Field(None, description="left out: no limit")
    max_lateral_acceleration_m_s2: Positive | None = Field(None, description=LATERAL)
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class HovercraftPart(Vehicle):
    """A body on an air cushion; state [v, v aside, turn rate], control [force ahead, torque]."""

    model: Literal["hovercraft"] = Field(description="hovercraft")
    mass_kg: Positive = Field(description="a positive number")
    inertia_kg_m2: Positive = Field(description="about the vertical, a positive number")
    drag_n_s_m: Positive = Field(description="force per speed ahead, a positive number")
    lateral_drag_n_s_m: Positive = Field(description="force per speed aside, a positive number")
    turn_drag_n_m_s: Positive = Field(description="torque per turn rate, a positive number")
    max_force_n: Positive = Field(description="ahead, a positive number")
    max_torque_n_m: Positive = Field(description="a positive number")
    min_force_n: Number | None = Field(None, description="left out: as strong in reverse")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_lateral_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_turn_rate_rad_s: Positive | None = Field(None, description="left out: no limit")
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class HelicopterPart(Vehicle):
    """A small helicopter; state [v, v aside, climb, turn rate, tilt, tilt aside]."""

    model: Literal["helicopter"] = Field(description="helicopter")
    max_speed_m_s: Positive = Field(description="a positive number")
    max_lateral_speed_m_s: Positive = Field(description="a positive number")
    max_climb_m_s: Positive = Field(description="up and down, a positive number")
    max_turn_rate_rad_s: Positive = Field(description="a positive number")
    max_tilt_rad: Sharp = Field(description=SHARP)
    max_tilt_rate_rad_s: Positive = Field(description="a positive number")
    max_climb_acceleration_m_s2: Positive = Field(description="less than gravity")
    max_angular_acceleration_rad_s2: Positive = Field(description="a positive number")
    drag_per_s: NotNegative | None = Field(None, description="over speed and mass; left out: 0")
    min_speed_m_s: Number | None = Field(None, description="left out: as fast backwards")
    gravity_m_s2: Positive | None = Field(None, description="left out: 9.81")
    footprint: Footprint | None = Field(None, description="shape of the body, seen from above")
    footprint_height_m: Interval | None = Field(
        None, description="[low, high] of the body about its altitude; left out: a flat body"
    )


class LatticeBodyPart(Vehicle):
    """A body that moves by lattice primitives alone, of a file of Nav2 or SBPL or of a preset."""

    model: Literal["lattice_body"] = Field(description="lattice_body")
    resolution_m: Positive = Field(description="side of a cell, a positive number")
    turning_radius_m: Positive | None = Field(None, description="as the file of primitives has it")
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


class OmnidirectionalPart(Vehicle):
    """A platform that moves ahead, aside and turns at once; control [v, v aside, omega]."""

    model: Literal["omnidirectional"] = Field(description="omnidirectional")
    max_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_lateral_speed_m_s: Positive | None = Field(None, description="left out: no limit")
    max_turn_rate_rad_s: Positive | None = Field(None, description="left out: no limit")
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(None, description=ABOVE_GROUND)


def _other_than_known(schema: dict[str, Any]) -> None:
    schema["not"] = {"enum": list(MODELS)}


class OwnPart(Part):
    """A vehicle of the user's own, by its name: the model itself is given to the program."""

    model: Name = Field(
        description="the name of a model that is given with --model",
        json_schema_extra=_other_than_known,
    )
    footprint: Footprint | None = Field(None, description="shape of the body")
    footprint_height_m: Interval | None = Field(
        None, description="[low, high] of the body about its altitude, or above the ground"
    )
    parts: dict[str, Footprint] | None = Field(
        None, description="shapes of what it carries, by the model's names of these"
    )


PARTS: tuple[type[Part], ...] = (
    UnicyclePart,
    CarPart,
    SecondOrderUnicyclePart,
    SecondOrderCarPart,
    AcceleratingCarPart,
    CarWithTrailerPart,
    SingleTrackPart,
    HovercraftPart,
    HelicopterPart,
    LatticeBodyPart,
    OmnidirectionalPart,
)
MODELS = tuple(str(part.model_fields["model"].description) for part in PARTS)
MEANT = {  # what others call them: Nav2, OMPL, CommonRoad, dynobench; letters and digits alone
    "unicycle": "differential differentialdrive diffdrive diff skidsteer unicycle1 turtlebot",
    "car": "ackermann bicycle kinematicbicycle carlike tricycle dubins dubinscar reedsshepp "
    "kinematiccar",
    "second_order_unicycle": "unicycle2 dynamicunicycle",
    "second_order_car": "kinematicsingletrack ks dynamiccar car2 ackermannwithinertia",
    "car_with_trailer": "tractortrailer tractorwithtrailer tractor trailer trucktrailer truck "
    "semitrailer cartrailer car1",
    "single_track": "dynamicbicycle dynamicsingletrack st",
    "helicopter": "drone quadrotor quadcopter multirotor uav",
    "omnidirectional": "omni omnidrive holonomic mecanum swerve",
}


def _check_model(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, dict):
        raise need("a mapping with the key model")
    context = info.context or {}
    own = context.get("own")  # the name of the model that is given beside the file
    known = context.get("one_is", own)  # the same, where other vehicles may have other models
    if known is not None and value.get("model") == known:
        return value
    what = f"{own!r}, the model that is given" if own else f"one of {', '.join(MODELS)}"
    if known is not None and own is None:
        what = f"{known!r}, the model that is given, or {what}"
    if "model" not in value:
        raise PydanticCustomError("missing_key", "", {"key": "model", "what": what})
    if value["model"] not in MODELS or own is not None:
        what += "" if own else _hint(value["model"])
        raise PydanticCustomError("at_key", "", {"key": "model", "need": what})
    return value


def _hint(model: Any) -> str:
    """Which model is meant by a name that is none, or how to give one's own."""
    if not isinstance(model, str):
        return ""
    plain = re.sub(r"[^a-z0-9]", "", model.lower())
    for name, words in MEANT.items():
        if plain in words.split():
            return f"; did you mean {name!r}?"
    near = difflib.get_close_matches(model.lower(), MODELS, n=1)
    hint = f"; did you mean {near[0]!r}? A" if near else "; a"
    return f"{hint} vehicle of your own needs --model MODULE:OBJECT"


def _model_of(value: Any) -> str:
    model = value["model"] if isinstance(value, dict) else value.model
    return f"<{model}>" if model in MODELS else "<own>"


VehiclePart = Annotated[
    Annotated[UnicyclePart, Tag("<unicycle>")]
    | Annotated[CarPart, Tag("<car>")]
    | Annotated[SecondOrderUnicyclePart, Tag("<second_order_unicycle>")]
    | Annotated[SecondOrderCarPart, Tag("<second_order_car>")]
    | Annotated[AcceleratingCarPart, Tag("<accelerating_car>")]
    | Annotated[CarWithTrailerPart, Tag("<car_with_trailer>")]
    | Annotated[SingleTrackPart, Tag("<single_track>")]
    | Annotated[HovercraftPart, Tag("<hovercraft>")]
    | Annotated[HelicopterPart, Tag("<helicopter>")]
    | Annotated[LatticeBodyPart, Tag("<lattice_body>")]
    | Annotated[OmnidirectionalPart, Tag("<omnidirectional>")]
    | Annotated[OwnPart, Tag("<own>")],
    Discriminator(_model_of),
    BeforeValidator(_check_model),
]
