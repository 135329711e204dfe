"""The vehicle of a scenario file: model, parameters with their units, bodies; and back.

What a file says of a model follows from the parameters of its class: each is a key with the unit
behind, needed where the class has no value for it.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Union

from annotated_types import Gt, Lt
from pydantic import (
    AllowInfNan,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    PlainValidator,
    Strict,
    Tag,
    TypeAdapter,
    ValidationInfo,
    WithJsonSchema,
    create_model,
)

from maneuver_automaton.formats.yaml_source import shown
from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS, is_of_a_kind
from maneuver_automaton.scenario.parts import (
    FilePart,
    Interval,
    Name,
    Need,
    NotNegative,
    Number,
    Point,
    Polygon,
    Positive,
    Several,
    Size,
    made,
    missing,
    need,
    one_or_many,
    optional,
    refusal,
    stated,
)

SHARP = "an angle between 0 and pi / 2, 1.5708"
Sharp = Annotated[float, Strict(), AllowInfNan(False), Gt(0), Lt(math.pi / 2), Need(SHARP)]


class BodyShape(FilePart, title="Shape"):
    """A rigid shape in the frame of the vehicle: rectangle, polygon or disc."""

    one_of: ClassVar = ("rectangle_m", "polygon_m", "disc_m")
    goes_with: ClassVar = {"reference_m": ("rectangle_m",)}

    rectangle_m: Size | None = optional("[length, width], ahead and aside")
    reference_m: Point | None = optional(
        "where the pose sits in the rectangle, from its centre: [ahead, left]; "
        "a rear axle has ahead < 0"
    )
    polygon_m: Polygon | None = optional("corners [x, y]")
    disc_m: Positive | None = optional("radius of a disc around the pose")


Footprint = Annotated[
    Annotated[BodyShape, Tag("<one>")]
    | Annotated[
        tuple[BodyShape, ...],
        Several("a shape or a list of at least one shape", at_least=1),
        Tag("<many>"),
    ],
    Discriminator(one_or_many),
]
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
NO_TYRES = {  # of a vehicle that is no car
    "max_lateral_acceleration_m_s2": "no such key, which car, second_order_car, "
    "accelerating_car, car_with_trailer and single_track have; a zone limits it for any vehicle"
}
MEASURES = {  # the parameters of all models, by their units
    "m": "wheelbase hitch_length hitch_length_2 hitch_length_3 hitch_offset hitch_offset_2 "
    "hitch_offset_3 front rear height resolution turning_radius",
    "rad": "max_steering max_hitch max_tilt max_articulation",
    "m_s": "max_speed min_speed max_lateral_speed max_climb",
    "rad_s": "max_turn_rate max_steering_rate max_tilt_rate max_articulation_rate",
    "m_s2": "max_acceleration max_lateral_acceleration max_climb_acceleration gravity",
    "rad_s2": "max_angular_acceleration",
    "kg": "mass",
    "kg_m2": "inertia",
    "n": "max_force min_force",
    "n_m": "max_torque",
    "n_s_m": "drag lateral_drag",
    "n_m_s": "turn_drag",
    "per_rad": "cornering",
}
STATE_UNITS = {  # of what reduced states hold
    "speed": "m_s",
    "lateral_speed": "m_s",
    "climb": "m_s",
    "turn_rate": "rad_s",
    **dict.fromkeys(("steering", "hitch", "tilt", "lateral_tilt", "articulation"), "rad"),
}
AT_REST = "steering_at_rest"


def _at_rest(value: Any) -> Any:
    known = {"free": 0.0, "forbidden": math.inf}
    if isinstance(value, str) and value in known:
        return known[value]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and 0.0 <= value < math.inf):
        raise need("free, forbidden, or a price of at least 0 per radian")
    return float(value)


AtRest = Annotated[
    float,
    PlainValidator(_at_rest),
    WithJsonSchema({"anyOf": [{"enum": ["free", "forbidden"]}, {"type": "number", "minimum": 0}]}),
]
UNIT_OF = {name: unit for unit, names in MEASURES.items() for name in names.split()}
WHAT = {  # each model is
    "unicycle": "A robot that drives ahead and turns on the spot; control [v, omega].",
    "car": "A car that rolls without slip, its pose on the rear axle; control [v, steering].",
    "second_order_unicycle": "A robot with inertia; state [v, omega], control their rates.",
    "second_order_car": "A car with inertia, its pose on the rear axle; state [v, steering], "
    "control their rates.",
    "accelerating_car": "A car with inertia that steers at once, as AROC has it; state [v], "
    "control [rate, angle].",
    "car_with_trailer": "A car that pulls a trailer; state [hitch], control [v, steering].",
    "single_track": "A car on linear tyres; state [v, v aside, turn rate, steering]; left out: "
    "a BMW 320i.",
    "hovercraft": "A body on an air cushion; state [v, v aside, turn rate], "
    "control [force ahead, torque].",
    "helicopter": "A small helicopter; state [v, v aside, climb, turn rate, tilt, tilt aside].",
    "lattice_body": "A body that moves by lattice primitives alone, of a file of Nav2 or SBPL or "
    "of a preset.",
    "omnidirectional": "A platform that moves ahead, aside and turns at once; "
    "control [v, v aside, omega].",
    "rear_steered_car": "A forklift, its pose on the front axle, that steers its rear axle; "
    "control [v, angle of the rear wheels].",
    "four_wheel_steering_car": "A car that steers both axles, its pose between them; "
    "control [v, angle in front, angle at the rear].",
    "articulated_vehicle": "A wheel loader that bends in its middle, its pose on the front axle; "
    "state [articulation], control [v, its rate].",
    "tractor_with_trailers": "A tractor with one to three trailers; state [hitch, ...], "
    "control [v, steering].",
}
WORDS = {  # on parameters, of all models or of one, that say more than their limits
    "wheelbase": "distance of the axles, a positive number",
    "hitch_length": "from the hitch to the trailer's axle",
    "min_speed": "left out: as fast in reverse",
    "steering_at_rest": "while it stands: free, forbidden, or a price per radian; left out: free",
    "min_force": "left out: as strong in reverse",
    "max_lateral_acceleration": "greatest speed times turn rate; left out: no limit",
    "footprint": "shape of the body",
    "footprint_height_m": "[low, high] of the body above the ground, where others of a fleet fly; "
    "left out: it counts at all heights",
    "car_with_trailer.footprint": "shape of the car",
    "single_track.inertia": "about the vertical",
    "single_track.front": "from the front axle to the pose",
    "single_track.rear": "from the rear axle to the pose",
    "single_track.height": "of the centre of gravity",
    "single_track.cornering": "stiffness over load and friction",
    "single_track.friction": "of the tyres",
    "single_track.min_speed": "from which the model holds",
    "hovercraft.inertia": "about the vertical, a positive number",
    "hovercraft.drag": "force per speed ahead, a positive number",
    "hovercraft.lateral_drag": "force per speed aside, a positive number",
    "hovercraft.turn_drag": "torque per turn rate, a positive number",
    "hovercraft.max_force": "ahead, a positive number",
    "helicopter.max_climb": "up and down, a positive number",
    "helicopter.max_climb_acceleration": "less than gravity",
    "helicopter.drag": "over speed and mass; left out: 0",
    "helicopter.min_speed": "left out: as fast backwards",
    "helicopter.gravity": "left out: 9.81",
    "helicopter.footprint": "shape of the body, seen from above",
    "helicopter.footprint_height_m": "[low, high] of the body about its altitude; left out: "
    "a flat body",
    "articulated_vehicle.front": "from the joint to the front axle",
    "articulated_vehicle.rear": "from the joint to the rear axle",
    "articulated_vehicle.footprint": "shape of the front part",
    "articulated_vehicle.rear_part": "shape of the rear part, seen from the middle of its axle",
    "tractor_with_trailers.hitch_length": "from the first hitch to the axle of its trailer",
    **{
        f"tractor_with_trailers.hitch_length_{k}": f"of trailer {k}; left out: no such trailer"
        for k in (2, 3)
    },
    **{
        f"tractor_with_trailers.hitch_offset{k}": "from the axle in front back to the hitch; "
        "left out: 0"
        for k in ("", "_2", "_3")
    },
    "tractor_with_trailers.footprint": "shape of the tractor",
    "lattice_body.resolution": "side of a cell, a positive number",
    "lattice_body.turning_radius": "as the file of primitives has it",
}
TRAILER = "shape of the trailer, seen from the middle of its axle"


@functools.cache
def part_of(model: str) -> type[FilePart]:
    """What a file says of the vehicles of a model, by the parameters of its class."""
    parameters = dataclasses.fields(KINDS[model])

    def text(name: str, otherwise: str = "") -> str:
        return WORDS.get(f"{model}.{name}") or WORDS.get(name) or otherwise

    fields: dict[str, Any] = {"model": (Literal[model], Field(description=model))}
    for one in parameters:
        unit = "per_s" if (model, one.name) == ("helicopter", "drag") else UNIT_OF.get(one.name)
        key = one.name if unit is None else f"{one.name}_{unit}"
        number: Any = Number if one.name.startswith("min_") and one.default is None else Positive
        if one.name in ("max_steering", "max_tilt", "max_articulation"):
            number = Sharp
        elif one.name == AT_REST:
            number = AtRest
        elif one.name.startswith("hitch_offset"):
            number = Number
        elif one.default == 0.0:
            number = NotNegative
        limits = SHARP if number is Sharp else "a positive number"
        said = text(one.name, limits if one.default is not None else "left out: no limit")
        if one.default is dataclasses.MISSING:
            fields[key] = (number, Field(description=said))
        else:
            fields[key] = (number | None, optional(said))
    for key, shape in (("footprint", Footprint), ("footprint_height_m", Interval)):
        fields[key] = (shape | None, optional(text(key)))
    for carried in KINDS[model].part_names:
        fields[carried] = (Footprint | None, optional(text(carried, TRAILER)))
    name = "".join(word.title() for word in model.split("_"))
    part = create_model(f"{name}Part", __base__=FilePart, __doc__=WHAT[model], **fields)
    is_car = any(one.name == "max_lateral_acceleration" for one in parameters)
    part.instead = REFUSED if is_car else REFUSED | NO_TYRES
    return part


MODELS = tuple(WHAT)
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
    "rear_steered_car": "forklift forklifttruck fork rearsteering reachtruck counterbalance",
    "four_wheel_steering_car": "4ws fourwheelsteering fourwheelsteer doubleackermann "
    "dualackermann crab allwheelsteering",
    "articulated_vehicle": "wheelloader loader articulated centerarticulated lhd dumper",
    "tractor_with_trailers": "ntrailer generalntrailer roadtrain twotrailers tuggertrain",
}


class OwnPart(FilePart):
    """A vehicle of the user's own, by its name: the model itself is given to the program."""

    model: Name = Field(
        description="the name of a model that is given with --model",
        json_schema_extra=lambda schema: schema.update({"not": {"enum": list(MODELS)}}),
    )
    footprint: Footprint | None = optional("shape of the body")
    footprint_height_m: Interval | None = optional(
        "[low, high] of the body about its altitude, or above the ground"
    )
    parts: dict[str, Footprint] | None = optional(
        "shapes of what it carries, by the model's names of these"
    )


def _check_model(value: Any, info: ValidationInfo) -> Any:
    """A mapping that names one of the models, or the user's own where that is given."""
    if not isinstance(value, dict):
        raise need("a mapping with the key model")
    context = info.context or {}
    own = context.get("own")  # the name of the model that is given beside the file
    known = context.get("one_is", own)  # the same, where other vehicles may have other models
    model = value.get("model")
    if known is not None and model == known:
        return value
    what = f"{own!r}, the model that is given" if own else f"one of {', '.join(MODELS)}"
    if known is not None and own is None:
        what = f"{known!r}, the model that is given, or {what}"
    if "model" not in value:
        raise missing("model", what)
    if model not in MODELS or own is not None:
        raise refusal(f"got {shown(model)}, need {what}{'' if own else _hint(model)}", key="model")
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


def _by_model(value: Any, info: ValidationInfo) -> FilePart:
    """The part of the model that a mapping names: those of all others are not made for it."""
    model = _check_model(value, info)["model"]
    part = part_of(model) if model in MODELS else OwnPart
    return part.model_validate(value, context=info.context)


class _AnyModel:
    """Annotation: the schema of a mapping that names any of the models."""

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        tagged = [Annotated[part_of(model), Tag(model)] for model in MODELS]
        kinds = Union[(*tagged, Annotated[OwnPart, Tag("<own>")])]  # type: ignore[valid-type]
        return handler(TypeAdapter(Annotated[kinds, Discriminator(str)]).core_schema)


VehiclePart = Annotated[Any, PlainValidator(_by_model), _AnyModel()]


def model_of(part: Any, *, own: Model | None = None) -> Model:
    """The model that a file describes, by its `VehiclePart`; `own` where it names a user's."""
    if isinstance(part, OwnPart):
        assert own is not None  # a file that names another is refused when it is read
        return own
    model: Model = made(KINDS[part.model], part)
    return model


def carried_of(part: Any) -> Mapping[str, Any]:
    """Bodies of what a vehicle carries, as the file states them."""
    if isinstance(part, OwnPart):
        return part.parts or {}
    bodies = {name: getattr(part, name) for name in KINDS[part.model].part_names}
    return {name: body for name, body in bodies.items() if body is not None}


def described(model: Model) -> dict[str, Any]:
    """What a scenario file says of a model; limits that it does not have are left out."""
    if not is_of_a_kind(model):
        raise ValueError(f"vehicle: a file cannot state {model.name!r}, only {', '.join(MODELS)}")
    values = stated(part_of(model.name), model)
    return {"model": model.name} | {
        key: "forbidden" if value == math.inf else float(value) for key, value in values.items()
    }
