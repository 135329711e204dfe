"""Signs, lights and stop lines of CommonRoad; and what of a file is read, but not obeyed.

Signs are those that commonroad-io 2026.1 knows by country. One list serves all: no two countries
mean different rules by one name, and files use German names everywhere. Speeds are in m/s in every
country, those of R2-1 too, as commonroad-io takes them, unless a unit follows the number. Of a
limit that is no such speed (some files state -1) nothing is known, so it is not obeyed.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from maneuver_automaton.formats.text_source import Element
from maneuver_automaton.roads import Lanelet
from maneuver_automaton.roads.lanelets import StopLine

# Germany and Zamunda, China, Italy: 274; a zone; USA and Puerto Rico; Spain; Russia; Argentina;
# Belgium; France; Greece, whose letter is a rho, or is typed as a P; Croatia.
LIMITS = ("274", "274.1", "r2-1", "r301", "3.24", "r15", "c43", "b14", "ρ-32", "p-32", "b31")
UNITS = {"": 1.0, "m/s": 1.0, "km/h": 1 / 3.6, "kmh": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704}
STOPS = ("206", "r1-1", "r1-3", "r2")  # Germany; USA and Australia; USA, all ways; Spain
YIELDS = ("205", "r1-2", "r1")  # Germany; Australia and USA; Spain
# Whether a line is closed in a phase of a light.
COLORS = {"red": True, "redYellow": True, "yellow": True, "green": False, "inactive": False}
WAYS = ("left", "straight", "right", "leftStraight", "straightRight", "leftRight", "all")
STRAIGHT = math.radians(30.0)  # to which a lanelet goes straight on from the one before it
FALSE = ("false", "0")
SIDES = ("leftBound", "rightBound")
WITHOUT_REFS = (*SIDES, "trajectory", "occupancySet")  # many points and states
LIGHT, SIGN = "trafficLightRef", "trafficSignRef"
OTHERS = ("sidewalk", "crosswalk", "bicycleLane", "busLane")  # lanes that are not for cars
READ = (
    *("lanelet", "trafficSign", "trafficLight", "intersection", "planningProblem"),
    *("obstacle", "staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle"),
    *("location", "scenarioTags", "tags"),  # nothing to obey
)


def signs_of(root: Element) -> dict[int, list[Element]]:
    """What each traffic sign of a file shows, by its id."""
    return {one.whole("id"): list(one.all("trafficSignElement")) for one in root.all("trafficSign")}


def sign_name(shown: Element) -> str:
    """The name of a sign as lists hold it."""
    return shown.need("trafficSignID").text.strip().casefold()


def limits_of(shown: list[Element]) -> Iterator[float]:
    """The speed limits [m/s] that a traffic sign shows."""
    for one in shown:
        if sign_name(one) in LIMITS and (limit := _speed_on(one)) is not None:
            yield limit


def _speed_on(shown: Element) -> float | None:
    """The speed that a sign shows [m/s], stated as 13.9, 50kmh or 30 mph; None if it shows none."""
    stated = shown.get("additionalValue")
    text = "" if stated is None else stated.text.strip().casefold()
    found = re.fullmatch(rf"((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*({'|'.join(UNITS)})", text)
    return None if found is None else float(found[1]) * UNITS[found[2]] or None


def refs(element: Element, tag: str) -> Iterator[int]:
    """What an element refers to by a name."""
    return (one.whole("ref") for one in element.all(tag))


def stop_lines(
    root: Element, lanelets: Mapping[int, Lanelet], step: float, notes: list[str]
) -> Iterator[StopLine]:
    """Lines at stop signs and lights, else at the ends of lanelets; of both, a light that is on."""
    signs, turns = signs_of(root), _turns(root)
    lights = {one.whole("id"): one for one in root.all("trafficLight")}
    at = {one.whole("id"): one for one in root.all("lanelet")}
    for number, element in at.items():
        here, lanelet = _refs_of(element), lanelets[number]
        ends = [point_of(one) for line in element.all("stopLine") for one in line.all("point")]
        if not ends:
            ends = _end_of(lanelet)
            # Of lanelets in a row that refer to one light, the last one has it at its end.
            here = here.difference(*(_refs_of(at[k]) for k in lanelet.successors if k in at))
        if not here:
            continue
        if len(ends) != 2:
            raise element.error(f"got the stop line {ends}, need two points, or none for its end")
        if len(set(ends)) == 1:
            notes.append(f"the stop line of lanelet {number} has no length: it is at its end")
            ends = _end_of(lanelet)
        line, lit = np.array(ends), False
        for ref in sorted(ref for tag, ref in here if tag == LIGHT and ref in lights):
            phases, offset = _phases(lights[ref], step)
            lit = lit or bool(phases)
            if any(closed for _, closed in phases):
                yield StopLine(
                    name=f"traffic light {ref}",
                    line=line,
                    lanelet=number,
                    onward=_onward(lights[ref], lanelet, lanelets, turns),
                    phases=phases,
                    offset=offset,
                )
        for ref in sorted(ref for tag, ref in here if tag == SIGN):
            if not any(sign_name(one) in STOPS for one in signs.get(ref, ())):
                continue
            if lit:
                notes.append(f"stop sign {ref}: the traffic light at its line holds instead")
            else:
                yield StopLine(name=f"stop sign {ref}", line=line, lanelet=number)


def _end_of(lanelet: Lanelet) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in (lanelet.left[-1], lanelet.right[-1])]


def _refs_of(lanelet: Element) -> set[tuple[str, int]]:
    """Lights and signs that a lanelet, or its stop line, refers to."""
    places = [lanelet, *lanelet.all("stopLine")]
    return {(tag, ref) for one in places for tag in (LIGHT, SIGN) for ref in refs(one, tag)}


def point_of(element: Element) -> tuple[float, float]:
    """The place that an element states [m]."""
    return element.need("x").number(), element.need("y").number()


def _phases(light: Element, step: float) -> tuple[tuple[tuple[float, bool], ...], float]:
    """Durations [s] of the phases of a light and whether each closes the line; their begin [s]."""
    cycle = light.get("cycle")
    switches = [one.get("active") for one in (light, cycle) if one is not None]
    if cycle is None or any(one is not None and one.text.strip() in FALSE for one in switches):
        return (), 0.0
    phases, colors = [], set[str]()
    for one in cycle.all("cycleElement"):
        color, lasts = one.need("color"), one.need("duration")
        if color.text.strip() not in COLORS:
            raise color.error(f"got {color.text.strip()!r}, need one of {', '.join(COLORS)}")
        if not lasts.number() > 0.0:
            raise lasts.error(f"got {lasts.text.strip()}, need a positive number of steps")
        colors.add(color.text.strip())
        phases.append((step * lasts.number(), COLORS[color.text.strip()]))
    if colors <= {"inactive"}:
        return (), 0.0
    offset = cycle.get("timeOffset")
    return tuple(phases), 0.0 if offset is None else step * offset.number()


def _turns(root: Element) -> dict[int, str]:
    """Which way lanelets turn that an intersection tells apart."""
    return {
        ref: way
        for incoming in (one for area in root.all("intersection") for one in area.all("incoming"))
        for way in ("left", "straight", "right")
        for kind in ("successors", "outgoing")
        for ref in refs(incoming, f"{kind}{way.capitalize()}")
    }


def _onward(
    light: Element, lanelet: Lanelet, lanelets: Mapping[int, Lanelet], turns: Mapping[int, str]
) -> tuple[int, ...] | None:
    """The successors of a lanelet that a light is for; None if it is for all."""
    stated = light.get("direction")
    way = "all" if stated is None else stated.text.strip()
    if stated is not None and way not in WAYS:
        raise stated.error(f"got {way!r}, need one of {', '.join(WAYS)}")
    if way == "all":
        return None
    return tuple(
        k
        for k in lanelet.successors
        if k in lanelets and (turns.get(k) or _way(lanelet, lanelets[k])) in way.casefold()
    )


def _way(before: Lanelet, after: Lanelet) -> str:
    """Which way a lanelet leads from the one before it, by its last direction."""
    a, b = (one.center[-1] - one.center[-2] for one in (before, after))
    turn = math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)
    return "straight" if abs(turn) <= STRAIGHT else ("left" if turn > 0.0 else "right")


def not_obeyed(root: Element) -> Iterator[str]:
    """What a file states that drives on roads do not obey, a sentence each."""
    signs, others = Counter[str](), Counter[str]()
    for shown in signs_of(root).values():
        for one in shown:
            name, sign = sign_name(one), one.need("trafficSignID").text.strip() or "unknown"
            if name in YIELDS:
                others[f"give way ({sign}): nobody is touched, and no more is kept"] += 1
            elif name not in STOPS and (name not in LIMITS or _speed_on(one) is None):
                signs[sign] += 1
    if signs:
        yield f"not obeyed: traffic signs {_counted(signs)}"
    yield from others
    for light in root.all("trafficLight"):
        if light.get("cycle", "cycleElement") is None:
            yield f"not obeyed: traffic light {light.whole('id')} states no cycle"
    lanes = list(root.all("lanelet"))
    kinds = Counter(one.text.strip() for lane in lanes for one in lane.all("laneletType"))
    if kept := {kind: n for kind, n in kinds.items() if kind in OTHERS}:
        yield f"not obeyed: lanelets of the type {_counted(kept)} are driven on as any other"
    bounds = [one for lane in lanes for side in SIDES for one in lane.all(side)]
    if any("solid" in one.text for bound in bounds for one in bound.all("lineMarking")):
        yield "not obeyed: solid lines between lanes of one direction are crossed"
    every = [root]
    for element in every:  # which grows meanwhile
        every += [one for one in element.children if one.tag not in WITHOUT_REFS]
    ids = {one.attributes.get("id", "").strip() for one in every}
    all_refs = [
        (one.tag, one.attributes["ref"].strip()) for one in every if "ref" in one.attributes
    ]
    if lost := Counter(f"{tag} {ref}" for tag, ref in all_refs if ref not in ids):
        yield f"not followed, since the file holds nothing of this id: {_counted(lost)}"
    if unread := Counter(one.tag for one in root.children if one.tag not in READ):
        yield f"not read: the elements {_counted(unread)}"


def _counted(found: Mapping[str, int]) -> str:
    return ", ".join(k if n == 1 else f"{k} ({n} times)" for k, n in sorted(found.items()))
