"""A small CommonRoad file of our own: two lanes to the right, one car on the first."""

from __future__ import annotations

from maneuver_automaton.formats.commonroad import read_commonroad


def points(bound, y, *, length=200.0):
    ends = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x in (0.0, length / 2, length))
    return f"<{bound}>{ends}</{bound}>"


def lanelet(number, low, high, more=""):
    return (
        f'<lanelet id="{number}">{points("leftBound", high)}{points("rightBound", low)}'
        f"{more}</lanelet>"
    )


def piece(number, low, high, more="", *, y=(0.0, 4.0)):
    """A lanelet between two stations, y from the right bound to the left one."""

    def bound(tag, y):
        ends = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x in (low, high))
        return f"<{tag}>{ends}</{tag}>"

    bounds = bound("leftBound", y[1]) + bound("rightBound", y[0])
    return f'<lanelet id="{number}">{bounds}{more}</lanelet>'


def sign(number, name, value=None):
    shown = "" if value is None else f"<additionalValue>{value}</additionalValue>"
    return (
        f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>{name}</trafficSignID>'
        f"{shown}</trafficSignElement></trafficSign>"
    )


def light(number, *phases, offset=0, more=""):
    """A traffic light with phases (color, steps)."""
    cycle = "".join(
        f"<cycleElement><duration>{lasts}</duration><color>{color}</color></cycleElement>"
        for color, lasts in phases
    )
    return (
        f'<trafficLight id="{number}"><cycle>{cycle}<timeOffset>{offset}</timeOffset></cycle>'
        f"{more}</trafficLight>"
    )


def place(x, end, *, y=2.0, begin=0):
    """A goal of 20 m by 4 m until a step."""
    return (
        "<goalState><position><rectangle><length>20</length><width>4</width>"
        f"<center><x>{x}</x><y>{y}</y></center></rectangle></position>"
        + interval("time", begin, end)
        + "</goalState>"
    )


def state(tag, *, x, y, heading=0.0, speed=None, time=0):
    velocity = "" if speed is None else f"<velocity><exact>{speed}</exact></velocity>"
    return (
        f"<{tag}><position><point><x>{x}</x><y>{y}</y></point></position>"
        f"<orientation><exact>{heading}</exact></orientation>{velocity}"
        f"<time><exact>{time}</exact></time></{tag}>"
    )


def car(number, *, x, y, speed, steps, size=(4.5, 1.8), step=0.1):
    recorded = "".join(
        state("state", x=x + speed * step * k, y=y, speed=speed, time=k)
        for k in range(1, steps + 1)
    )
    return (
        f'<obstacle id="{number}"><role>dynamic</role><type>car</type>'
        f"<shape><rectangle><length>{size[0]}</length><width>{size[1]}</width></rectangle></shape>"
        f"{state('initialState', x=x, y=y, speed=speed)}"
        f"<trajectory>{recorded}</trajectory></obstacle>"
    )


def square(x, y, size):
    low, high = -0.5 * size, 0.5 * size
    corners = [(x + a, y + b) for a, b in ((low, low), (high, low), (high, high), (low, high))]
    ring = "".join(f"<point><x>{a}</x><y>{b}</y></point>" for a, b in corners)
    return f"<polygon>{ring}</polygon>"


def predicted(number, sets, *, x, y, speed=0.0):
    """Somebody whose occupancies are given: (shapes, what is in the element time)."""
    occupancies = "".join(
        f"<occupancy><shape>{''.join(shapes)}</shape>{time}</occupancy>" for shapes, time in sets
    )
    return (
        f'<obstacle id="{number}"><role>dynamic</role><type>car</type>'
        "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
        f"{state('initialState', x=x, y=y, speed=speed)}"
        f"<occupancySet>{occupancies}</occupancySet></obstacle>"
    )


def parked(number, *, x, y, size=(4.5, 1.8)):
    return (
        f'<obstacle id="{number}"><role>static</role><type>parkedVehicle</type>'
        f"<shape><rectangle><length>{size[0]}</length><width>{size[1]}</width></rectangle></shape>"
        f"{state('initialState', x=x, y=y)}</obstacle>"
    )


def interval(tag, low, high):
    return f"<{tag}><intervalStart>{low}</intervalStart><intervalEnd>{high}</intervalEnd></{tag}>"


GOAL = (
    '<goalState><position><lanelet ref="2"/></position>'
    + interval("orientation", -0.2, 0.2)
    + interval("time", 20, 40)
    + "</goalState>"
)


def problem(number=100, *, goal=GOAL, x=10.0, y=2.0, speed=12.0):
    start = state("initialState", x=x, y=y, speed=speed)
    return f'<planningProblem id="{number}">{start}{goal}</planningProblem>'


LANES = (
    lanelet(1, 0.0, 4.0, '<adjacentLeft ref="2" drivingDir="same"/>'),
    lanelet(2, 4.0, 8.0, '<adjacentRight ref="1" drivingDir="same"/><speedLimit>20</speedLimit>'),
)


def commonroad(*parts, step=0.1):
    text = "\n".join(parts or (*LANES, car(7, x=35.0, y=2.0, speed=6.0, steps=40), problem()))
    return (
        f'<?xml version="1.0"?>\n<commonRoad timeStepSize="{step}" commonRoadVersion="2018b" '
        f'benchmarkID="TST_Lanes-1_1_T-1" author="us" source="nowhere">\n{text}\n</commonRoad>\n'
    )


def scene_of(folder, *parts, case=0, step=0.1):
    file = folder / "road.xml"
    file.write_text(commonroad(*parts, step=step))
    return read_commonroad(file)[case].road
