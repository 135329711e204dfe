"""Motion primitives of CommonRoad (XML): states of a kinematic single-track model, step by step.

A primitive leads from a speed and steering angle to another; it may follow one that ends where it
begins. The reference point is the middle of the rear axle. Newer files name their vehicle, older
ones (2019) have another root and call the first state `Start`. A step is a primitive's duration by
its last `time_step`; primitives that were cut at a limit state the duration of whole ones, so the
longest of the file's primitives of that duration tells the step.

As an automaton: a pair of speed and steering is a trim, a primitive is a maneuver of the
second-order car under controls that are constant in each step. They are worked out of the states,
and the motion is driven anew with them: `deviation_of` says how far from the file that leads.

Source: Althoff, Koschi, Manzinger (2017), *CommonRoad: composable benchmarks for motion planning on
roads*, IV, and CommonRoad-search.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton._limits import FASTEST, STEEPEST_STEERING
from maneuver_automaton.automaton import Automaton, Trajectory
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.formats.lattice import ending_at, levels_of, nearest_level
from maneuver_automaton.formats.text_source import Element, read_xml, root_tag
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive, drive_all

KIND = "CommonRoad primitives"
ROOT, OLDER_ROOT = "MotionPrimitiveFile", "Trajectories"
MOST_BYTES = 100_000_000
FIELDS = ("x", "y", "orientation", "velocity", "steering_angle")
STEP_UNIT = 0.1  # [s] of a deci-second
DIGITS = 9  # of a second, to which durations in either unit are the same
TENTHS, SECONDS = "deci-second", "second"  # units of a duration
FITS = 0.01  # [m/s, rad] states closer than this follow each other, as in CommonRoad-search
WHOLE = 1e-6  # of a deci-second
LARGE = 1e-5  # [m, rad] off its states: worth a word
VEHICLES: Mapping[str, SecondOrderCar] = {
    "BMW_320i": SecondOrderCar(
        wheelbase=2.5789128,
        max_steering=1.066,
        max_speed=50.8,
        min_speed=-13.9,
        max_acceleration=11.5,
        max_steering_rate=0.4,
    )
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPrimitive:
    """One primitive, as it stands in the file."""

    duration: float  # [unit] as stated: that of a whole primitive, if this one was cut
    states: Array  # (n, 5) x, y, orientation, velocity, steering angle [m, m, rad, m/s, rad]
    line: int = 0  # of the file; 0 if it came from none
    unit: str = TENTHS  # of the duration; a whole number of deci-seconds

    def __post_init__(self) -> None:
        freeze(self, "states", last=len(FIELDS))

    @property
    def seconds(self) -> float:
        """The duration [s]."""
        return STEP_UNIT * self.duration if self.unit == TENTHS else self.duration


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadPrimitives:
    """A file of primitives."""

    primitives: tuple[RoadPrimitive, ...]
    vehicle: str | None = None  # None: an older file, which names none

    def steps(self) -> tuple[float, ...]:
        """Seconds from state to state of each primitive."""
        most: dict[float, int] = {}
        for one in self.primitives:
            lasting = round(one.seconds, DIGITS)
            most[lasting] = max(most.get(lasting, 1), len(one.states) - 1)
        return tuple(one.seconds / most[round(one.seconds, DIGITS)] for one in self.primitives)


def is_commonroad_primitives(path: Path) -> bool:
    """Whether the root of an XML file is that of primitives."""
    return root_tag(path) in (ROOT, OLDER_ROOT)


def read_commonroad_primitives(path: Path) -> RoadPrimitives:
    """The primitives of a file, as they stand there."""
    root = read_xml(path, what="a file of primitives", most=MOST_BYTES)
    if root.tag not in (ROOT, OLDER_ROOT):
        raise root.error(f"need {ROOT} or {OLDER_ROOT}, the root of {KIND}")
    vehicle = root.need("VehicleType").text.strip() if root.tag == ROOT else None
    if vehicle == "":
        raise root.need("VehicleType").error("is empty, need the name of a vehicle")
    rows = root.need("Trajectories") if root.tag == ROOT else root
    primitives = tuple(_primitive(row) for row in rows.all("Trajectory"))
    if not primitives:
        raise rows.error("holds no Trajectory, need at least one")
    return RoadPrimitives(primitives=primitives, vehicle=vehicle)


def save_commonroad_primitives(file: RoadPrimitives, path: Path) -> None:
    """Write primitives, in one step; every number reads back to the last bit."""
    write_text_atomically(path, commonroad_primitives_text(file))


def commonroad_primitives_text(file: RoadPrimitives) -> str:
    """The text of a file of primitives."""
    older = file.vehicle is None
    lines = ['<?xml version="1.0" ?>']
    if not older:
        lines += [f"<{ROOT}>", f"   <VehicleType>{escape(file.vehicle or '', False)}</VehicleType>"]
    pad = "" if older else "   "
    lines.append(f"{pad}<{OLDER_ROOT}>")
    for one in file.primitives:
        lines += [f"{pad}   {line}" for line in _trajectory_lines(one, older=older)]
    lines.append(f"{pad}</{OLDER_ROOT}>")
    if not older:
        lines.append(f"</{ROOT}>")
    return "\n".join(lines) + "\n"


def vehicle_of(file: RoadPrimitives) -> SecondOrderCar:
    """The vehicle that a file names, if known; or fitted: its wheelbase, its largest values."""
    if (known := VEHICLES.get(file.vehicle or "")) is not None:
        return known
    crossed, turned = _lengths_and_turns(file)
    if not np.abs(turned).max() > 0.0:
        raise InvalidLibrary(
            f"vehicle: {file.vehicle or 'an older file, which names none'}; no primitive turns, so "
            f"nothing tells its wheelbase; need one of {', '.join(VEHICLES)}"
        )
    states = np.concatenate([one.states for one in file.primitives])
    rates = [
        np.abs(np.diff(one.states[:, 3:], axis=0)).max(axis=0) / step
        for one, step in zip(file.primitives, file.steps(), strict=True)
    ]
    most = np.maximum(np.max(rates, axis=0), 1e-3)
    speeds = states[:, 3]
    return SecondOrderCar(
        wheelbase=float(crossed @ crossed / (crossed @ turned)),
        max_steering=float(max(np.abs(states[:, 4]).max(), 1e-3)),
        max_speed=float(max(speeds.max(), 1e-3)),
        min_speed=float(min(speeds.min(), 0.0)),
        max_acceleration=float(most[0]),
        max_steering_rate=float(most[1]),
    )


def automaton_of_commonroad_primitives(
    file: RoadPrimitives, *, vehicle: SecondOrderCar | None = None, name: str = ""
) -> Automaton:
    """The automaton of a file; primitives cut at a limit end in trims of their own."""
    model = vehicle_of(file) if vehicle is None else vehicle
    # Speed and steering (2, 2) of the trims where each primitive begins and ends.
    ends = np.array([one.states[[0, -1], 3:] for one in file.primitives])
    for k in range(2):
        levels = levels_of(ends[:, 0, k], ends[:, 1, k], apart=FITS)
        ends[..., k] = nearest_level(ends[..., k].ravel(), levels).reshape(-1, 2)
    pairs = np.unique(np.concatenate(ends), axis=0)
    trims = tuple(
        Trim(
            name=f"speed {speed:.4g}, steering {steering:.4g}",
            body_velocity=model.body_velocity(np.array([speed, steering]), np.zeros(2)),
            control=np.zeros(2),
            reduced_state=np.array([speed, steering]),
        )
        for speed, steering in pairs.tolist()
    )
    index = {tuple(pair): k for k, pair in enumerate(pairs.tolist())}
    maneuvers = []
    for k, (course, pair) in enumerate(zip(_courses_between(model, file, ends), ends, strict=True)):
        source, target = (trims[index[tuple(end)]].name for end in pair.tolist())
        label = f"primitive {k + 1}"
        maneuvers.append(Maneuver.along(course, name=label, source=source, target=target))
    return Automaton(model, trims, tuple(maneuvers), name=name)


def deviation_of(file: RoadPrimitives, automaton: Automaton) -> tuple[float, str]:
    """How far the maneuvers made of a file are from its states at most [m]; in words too."""
    off, moved = [], np.zeros(2)
    for one, step, maneuver in zip(file.primitives, file.steps(), automaton.maneuvers, strict=True):
        assert maneuver.course is not None  # it was made with one
        times = step * np.arange(len(one.states), dtype=np.float64)
        nearest = np.abs(maneuver.course.time - times[:, None]).argmin(axis=1)
        gaps = np.abs(maneuver.course.pose[nearest] - one.states[:, :3])
        off.append((float(np.hypot(gaps[:, 0], gaps[:, 1]).max()), float(gaps[:, 2].max())))
        ends = (automaton[maneuver.source].reduced_state, automaton[maneuver.target].reduced_state)
        moved = np.maximum(moved, np.abs(np.array(ends) - one.states[[0, -1], 3:]).max(axis=0))
    position, heading = np.max(off, axis=0).tolist()
    most, (speed, steering) = np.max(off, axis=1), moved.tolist()
    beyond = int(np.count_nonzero(most > LARGE))
    return position, (
        f"driven with controls that are constant in each step, {beyond} "
        f"{'primitive is' if beyond == 1 else 'primitives are'} more than {LARGE:g} m or rad off "
        f"their states; at most {position:.2g} m and {heading:.2g} rad (primitive "
        f"{int(most.argmax()) + 1}); their ends were moved by {speed:.2g} m/s and "
        f"{steering:.2g} rad to meet"
    )


def commonroad_primitives_of_automaton(automaton: Automaton) -> RoadPrimitives:
    """A primitive a maneuver, a state each 0.1 s; a file of the older kind names no vehicle."""
    car, label = automaton.model, automaton.name or "automaton"
    if not isinstance(car, SecondOrderCar):
        raise InvalidLibrary(
            f"{label}: a file of {KIND} states speed and steering angle of a second_order_car, got "
            f"an automaton of the {car.name}"
        )
    if not automaton.maneuvers:
        raise InvalidLibrary(f"{label}: has no maneuver; a file of {KIND} needs at least one")
    named = next((name for name, known in VEHICLES.items() if known == car), None)
    return RoadPrimitives(
        primitives=tuple(_stated(car, maneuver) for maneuver in automaton.maneuvers), vehicle=named
    )


def _primitive(row: Element) -> RoadPrimitive:
    duration = row.need("Duration")
    unit = duration.attributes.get("unit", TENTHS)
    if unit not in (TENTHS, SECONDS):
        raise duration.error(f"unit: got {unit!r:.40}, need {TENTHS} or {SECONDS}")
    lasting = duration.number()
    if unit == TENTHS and not (lasting >= 1.0 and lasting.is_integer()):
        raise duration.error(f"got {lasting:g}, need a whole number of at least 1")
    if not lasting > 0.0:
        raise duration.error(f"got {lasting:g}, need a positive number of seconds")
    path = row.get("Path")
    between = [] if path is None else list(path.all("State"))
    rows = [row.need("Initial|Start"), *between, row.need("Final")]
    steps = [state.need("time_step").number() for state in rows]
    for k, (state, step) in enumerate(zip(rows, steps, strict=True)):
        if step != steps[0] + k:
            raise state.need("time_step").error(f"got {step:g}, need {steps[0] + k:g}")
    states = np.array([[state.need(name).number() for name in FIELDS] for state in rows])
    for k, name in enumerate(FIELDS[:3]):
        if states[0, k] != 0.0:
            said = f"got {states[0, k]:g}, need 0: a primitive begins at the origin"
            raise rows[0].need(name).error(said)
    for state, (speed, steering) in zip(rows, states[:, 3:].tolist(), strict=True):
        if abs(speed) > FASTEST:
            said = f"got {speed:g} m/s, need at most {FASTEST:g} m/s in size"
            raise state.need("velocity").error(said)
        if abs(steering) > STEEPEST_STEERING:
            said = f"got {steering:g} rad, need at most {STEEPEST_STEERING:g} rad in size"
            raise state.need("steering_angle").error(said)
    stated = int(lasting) if unit == TENTHS else lasting
    return RoadPrimitive(duration=stated, states=states, line=row.line, unit=unit)


def _trajectory_lines(one: RoadPrimitive, *, older: bool) -> list[str]:
    first = "Start" if older else "Initial"
    last = len(one.states) - 1
    lines = ["<Trajectory>", f'   <Duration unit="{one.unit}">{one.duration!r}</Duration>']
    lines += _state_lines(first, one.states[0], 0, pad="   ")
    lines += _state_lines("Final", one.states[-1], last, pad="   ")
    between = [
        line
        for k in range(1, last)
        for line in _state_lines("State", one.states[k], k, pad=6 * " ")
    ]
    path = ["   <Path>", *between, "   </Path>"] if between else ["   <Path/>"]
    return [*lines, *path, "</Trajectory>"]


def _state_lines(tag: str, state: Array, step: int, *, pad: str) -> list[str]:
    x, y, orientation, velocity, steering = state.tolist()
    entries = {"x": x, "y": y, "steering_angle": steering, "velocity": velocity}
    entries |= {"orientation": orientation, "time_step": step}
    inner = [f"{pad}   <{key}>{value!r}</{key}>" for key, value in entries.items()]
    return [f"{pad}<{tag}>", *inner, f"{pad}</{tag}>"]


def _lengths_and_turns(file: RoadPrimitives) -> tuple[Array, Array]:
    """For every step: the integral of speed times tan(steering) [m], and the turn [rad]."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    share, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    crossed, turned = [], []
    for one, step in zip(file.primitives, file.steps(), strict=True):
        begin, change = one.states[:-1, 3:, None], np.diff(one.states[:, 3:], axis=0)[..., None]
        speed, steering = np.moveaxis(begin + change * share, 1, 0)
        crossed.append(step * (speed * np.tan(steering)) @ weights)
        turned.append(np.diff(one.states[:, 2]))
    return np.concatenate(crossed), np.concatenate(turned)


def _courses_between(model: SecondOrderCar, file: RoadPrimitives, ends: Array) -> list[Trajectory]:
    """The motions under controls that lead from state to state, from trim to trim."""
    most = max(len(one.states) for one in file.primitives) - 1
    control = np.zeros((len(ends), most, 2))
    durations = np.zeros((len(ends), most))
    for k, (one, step) in enumerate(zip(file.primitives, file.steps(), strict=True)):
        states = one.states[:, 3:].copy()
        states[0], states[-1] = ends[k]
        control[k, : len(states) - 1] = np.diff(states, axis=0) / step
        durations[k, : len(states) - 1] = step
    courses = drive_all(model, ends[:, 0], control=control, durations=durations)
    return [ending_at(course, last) for course, last in zip(courses, ends[:, 1], strict=True)]


def _stated(car: SecondOrderCar, maneuver: Maneuver) -> RoadPrimitive:
    """A maneuver by its states each tenth of a second."""
    course = maneuver.course
    if course is None:
        raise InvalidLibrary(
            f"maneuver {maneuver.name!r}: has no course; a file of {KIND} states what is between"
        )
    tenths = round(maneuver.duration / STEP_UNIT)
    if tenths < 1 or abs(maneuver.duration / STEP_UNIT - tenths) > WHOLE:
        raise InvalidLibrary(
            f"maneuver {maneuver.name!r}: lasts {maneuver.duration:.6g} s, but a file of {KIND} "
            f"has whole tenths of a second"
        )
    times = STEP_UNIT * np.arange(tenths + 1, dtype=np.float64)
    marks = np.unique(np.concatenate([course.time, times[:-1]]).round(12))
    spans = np.diff(marks)
    which = np.searchsorted(course.time, marks[:-1] + 0.5 * spans, side="right") - 1
    control = course.control[np.clip(which, 0, None)]
    again = drive(car, course.reduced_state[0], control=control, durations=spans)
    keep = np.abs(again.time - times[:, None]).argmin(axis=1)
    states = np.concatenate([again.pose[keep], again.reduced_state[keep]], axis=1)
    states[-1] = np.concatenate([maneuver.displacement, course.reduced_state[-1]])
    return RoadPrimitive(duration=tenths, states=states + 0.0)
