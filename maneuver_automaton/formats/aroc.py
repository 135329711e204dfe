"""Maneuver automata exported by AROC: `automaton.xml` and `primitives/`, zipped or not; read only.

Every child of `automaton.xml` names a file of one primitive: numbers of those that may follow, from
1; states and inputs; and the set that the vehicle occupies while a controller keeps it near the
motion, which is not read. The states are (x, y, speed, heading) of a car that accelerates, its
steering is an input; the wheelbase is not stated, and is fitted to the changes of the heading.

As an automaton: a speed is a trim, a primitive is a maneuver, driven anew with the inputs of the
file. An automaton lets everything follow that begins at the speed where a primitive ends; AROC lets
follow what its controllers were proven for. `deviation_of` counts what is added, and says how far
from the stated states the motions lead.

Source: Kochdumper et al. (2021), *AROC: a toolbox for automated reachset optimal controller
synthesis*, HSCC.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.lattice import ending_at, levels_of, nearest_level
from maneuver_automaton.formats.text_source import Element, read_xml
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import AcceleratingCar
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive

LIST, FOLDER = "automaton.xml", "primitives"
MOST_BYTES = 50_000_000
STATES = ("x", "y", "orientation", "velocity")
INPUTS = ("acceleration", "steer")
FITS = 0.01  # [m/s] speeds closer than this are one
LEAST = 1e-3  # of a limit that no primitive shows [m/s, m/s^2, rad]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArocPrimitive:
    """One primitive, as it stands in its file."""

    name: str  # of the file
    successors: tuple[int, ...]  # positions of those that may follow, from 0
    time: Array  # (n,) [s]
    states: Array  # (n, 4) x, y, orientation, velocity
    inputs: Array  # (m, 2) acceleration, steering angle, each for an equal number of steps

    def __post_init__(self) -> None:
        freeze(self, "time")
        freeze(self, "states", last=len(STATES))
        freeze(self, "inputs", last=len(INPUTS))


def export_at(path: Path) -> Path | zipfile.Path | None:
    """The folder of an export: that of its list, one in an archive or folder, itself, or None."""
    base: Path | zipfile.Path = path.parent if path.name == LIST else path
    if path.suffix.lower() == ".zip" and path.is_file():
        try:
            base = zipfile.Path(path)
        except (OSError, zipfile.BadZipFile) as error:
            raise InvalidScenario(f"{path}: cannot be read as a zip archive: {error}") from error
    elif not base.is_dir():
        return None
    within = () if path.name == LIST else (one for one in base.iterdir() if one.is_dir())
    places = (base, *within)
    there = (one for one in places if (one / LIST).is_file() and (one / FOLDER).is_dir())
    return next(there, None)


def read_aroc(path: Path) -> tuple[ArocPrimitive, ...]:
    """The primitives of a folder or an archive, in the order of its list."""
    folder = export_at(path)
    if folder is None:
        raise InvalidScenario(f"{path}: is no export of AROC, need {LIST} and {FOLDER}/")
    root = read_xml(folder / LIST, what="a list of primitives", most=MOST_BYTES)
    if not root.children:
        raise root.error("names no primitive, need at least one")
    return tuple(_primitive(folder, child, len(root.children)) for child in root.children)


def wheelbase_of(primitives: tuple[ArocPrimitive, ...]) -> float:
    """The wheelbase that fits the changes of the heading best [m]."""
    crossed, turned = [], []
    for one in primitives:
        control, spans = _controls(one), np.diff(one.time)
        mean = 0.5 * (one.states[:-1, 3] + one.states[1:, 3])
        crossed.append(mean * np.tan(control[:, 1]) * spans)
        turned.append(np.diff(one.states[:, 2]))
    length, turn = np.concatenate(crossed), np.concatenate(turned)
    if not abs(float(length @ turn)) > 0.0:
        raise InvalidLibrary(f"{LIST}: no primitive turns, so nothing tells the wheelbase")
    return float(length @ length / (length @ turn))


def automaton_of_aroc(
    primitives: tuple[ArocPrimitive, ...], *, model: AcceleratingCar | None = None, name: str = ""
) -> Automaton:
    """The automaton of an export, for another `model` than the one fitted to it if it is given."""
    speeds = np.concatenate([one.states[:, 3] for one in primitives])
    inputs = np.concatenate([one.inputs for one in primitives])
    if model is None:
        model = AcceleratingCar(
            wheelbase=wheelbase_of(primitives),
            max_steering=max(float(np.abs(inputs[:, 1]).max()), LEAST),
            max_speed=max(float(speeds.max()), LEAST),
            min_speed=min(float(speeds.min()), 0.0),
            max_acceleration=max(float(np.abs(inputs[:, 0]).max()), LEAST),
        )
    limits = np.vstack([model.reduced_limits, model.control_limits])
    for what, (low, high), values in zip(
        ("a speed", "an acceleration", "a steering angle"), limits, (speeds, *inputs.T), strict=True
    ):
        worst = float(values[np.abs(values - 0.5 * (low + high)).argmax()])
        if not low <= worst <= high:
            raise InvalidLibrary(
                f"{LIST}: has {what} of {worst:g}, but the vehicle keeps to {low:g} to {high:g}"
            )
    begins = np.array([one.states[0, 3] for one in primitives])
    ends = np.array([one.states[-1, 3] for one in primitives])
    levels = levels_of(begins, ends, apart=FITS)
    begin_levels, end_levels = nearest_level(begins, levels), nearest_level(ends, levels)
    _check_successors(primitives, begin_levels, end_levels)
    trims = {
        speed: Trim(
            name=f"speed {speed:.5g}",
            body_velocity=np.array([speed, 0.0, 0.0]),
            control=np.zeros(2),
            reduced_state=np.array([speed]),
        )
        for speed in levels.tolist()
    }
    maneuvers = []
    for one, begin, end in zip(primitives, begin_levels.tolist(), end_levels.tolist(), strict=True):
        spans, control = np.diff(one.time), _controls(one)
        missing = end - begin - float(control[:, 0] @ spans)  # that it ends at the speed of a trim
        control[:, 0] += missing / float(spans.sum())
        course = ending_at(drive(model, [begin], control=control, durations=spans), end)
        maneuvers.append(
            Maneuver.along(
                course, name=Path(one.name).stem, source=trims[begin].name, target=trims[end].name
            )
        )
    return Automaton(model, tuple(trims.values()), tuple(maneuvers), name=name)


def deviation_of(primitives: tuple[ArocPrimitive, ...], automaton: Automaton) -> tuple[float, str]:
    """How far the maneuvers of `automaton_of_aroc` are from the files at most [m]; in words too."""
    off = []
    for one, maneuver in zip(primitives, automaton.maneuvers, strict=True):
        assert maneuver.course is not None  # it was made with one
        times = one.time - one.time[0]
        nearest = np.abs(maneuver.course.time - times[:, None]).argmin(axis=1)
        seen = (SE2(one.states[0, :3]).inverse() @ SE2(one.states[:, :3])).pose
        gap = np.abs(maneuver.course.pose[nearest] - seen)
        speed = np.abs(maneuver.course.reduced_state[nearest, 0] - one.states[:, 3])
        off.append((float(np.hypot(gap[:, 0], gap[:, 1]).max()), gap[:, 2].max(), speed.max()))
    table = np.array(off)
    position, heading, speed = table.max(axis=0).tolist()
    worst = primitives[int(table.max(axis=1).argmax())].name
    sources = [maneuver.source for maneuver in automaton.maneuvers]
    allowed = sum(sources.count(maneuver.target) for maneuver in automaton.maneuvers)
    added = allowed - sum(len(set(one.successors)) for one in primitives)
    return position, (
        f"driven with the inputs of the files, motions are at most {position:.2g} m, "
        f"{heading:.2g} rad and {speed:.2g} m/s off their states ({worst}); {added} "
        f"pair{'' if added == 1 else 's'} may follow each other that AROC does not let follow"
    )


def _primitive(folder: Path | zipfile.Path, listed: Element, n: int) -> ArocPrimitive:
    name = listed.text.strip()
    if not name or name != Path(name).name or "\0" in name:
        raise listed.error(f"got {name!r:.60}, need the name of a file in {FOLDER}")
    root = read_xml(folder / FOLDER / name, what="a primitive", most=MOST_BYTES)
    successors = []
    for child in root.need("successors").children:
        number = child.number()
        if not (number.is_integer() and 1 <= number <= n):
            raise child.error(f"got {number:g}, need the number of a primitive, 1 to {n}")
        successors.append(int(number) - 1)
    rows = root.need("trajectory", "states").children
    if len(rows) < 2:
        raise root.need("trajectory", "states").error(f"got {len(rows)} states, need at least 2")
    time = np.array([row.need("time").number() for row in rows])
    for k in range(1, len(rows)):
        if not time[k] > time[k - 1]:
            said = f"got {time[k]:g}, need more than {time[k - 1]:g}, that of the state before"
            raise rows[k].need("time").error(said)
    inputs = root.need("trajectory", "inputs")
    given = [[row.need(name).number() for name in INPUTS] for row in inputs.children]
    steps = len(rows) - 1
    if len(given) == len(rows):
        given = given[:-1]  # one for every state: nothing follows the last
    if not given or steps % len(given):
        raise inputs.error(
            f"got {len(inputs.children)} inputs for {len(rows)} states, need one for every step "
            f"or every few of the {steps}"
        )
    return ArocPrimitive(
        name=name,
        successors=tuple(successors),
        time=time,
        states=np.array([[row.need(what).number() for what in STATES] for row in rows]),
        inputs=np.array(given),
    )


def _controls(one: ArocPrimitive) -> Array:
    return np.repeat(one.inputs, (len(one.states) - 1) // len(one.inputs), axis=0)


def _check_successors(primitives: tuple[ArocPrimitive, ...], begins: Array, ends: Array) -> None:
    for k, one in enumerate(primitives):
        for follower in one.successors:
            if begins[follower] != ends[k]:
                raise InvalidLibrary(
                    f"{one.name}: ends at {ends[k]:g} m/s, but its successor "
                    f"{primitives[follower].name} begins at {begins[follower]:g} m/s; need the same"
                )
