"""What the pictures of every kind of result show: texts, legends, artists, and where they are.

Each case is drawn into a file whose bytes are not looked at; the figure is. Films are looked at in
their middle. `exports.py` beside it has the pages.
"""

from __future__ import annotations

import contextlib
import functools
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from maneuver_automaton import plotting
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Zone
from maneuver_automaton.fleet import FleetLog, simulate_fleet
from maneuver_automaton.formats.commonroad import read_commonroad
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting import films as film
from maneuver_automaton.plotting import pictures
from maneuver_automaton.problem import Bounds
from maneuver_automaton.receding_horizon import Disturbance
from maneuver_automaton.recording import recording_of
from maneuver_automaton.roads import (
    RoadScene,
    RoadSettings,
    drive_road,
    drive_roads,
    plan_road,
    plan_roads,
)
from tests.exports.cases import trailer
from tests.fleet import robots
from tests.plotting import fleets, loops
from tests.plotting.cases import flight, parking_plan, plan_of, result_of, slalom_problem
from tests.roads.files import LANES, car, commonroad, parked, problem

DIGITS = 3
MASKED = "to decide [s]"  # axes whose numbers are those of a clock
QUICK = RoadSettings(width=40, narrow=20)


# The results.


def among() -> PlanResult:
    """A plan among one obstacle of every kind."""
    plan = parking_plan()
    found, problem = PlanStatus.FOUND, slalom_problem(plan)
    return PlanResult(
        problem=problem, status=found, reason="", plan=plan, goal_index=0, cost=9.75,
        clearance_m=0.12,
    )  # fmt: skip


def zones() -> PlanResult:
    """A plan through a zone, within bounds, past what moves and what is there for a while."""
    result = among()
    slow = Zone(shape=Box([2.0, 2.0], [0.5, 0.5]), max_speed=1.0)
    door = Obstacle(Box([1.0, 0.1], [0.0, -2.0]), present_s=(0.0, 3.0))
    turning = Motion([0.0, 8.0], [[-3.0, 3.0, 0.0], [3.0, 3.0, 1.0]])
    around = (*result.problem.obstacles, door, Obstacle(Disc(0.3), motion=turning))
    limits = {"zones": (slow,), "bounds": Bounds(x=(-5.0, 5.0), y=(-4.0, 5.0))}
    return replace(result, problem=replace(result.problem, obstacles=around, **limits))


def no_plan() -> PlanResult:
    """Start and goal among obstacles, what may be reached, and why there is no plan."""
    problem = among().problem
    return PlanResult(
        problem=problem, status=PlanStatus.NO_PLAN, reason="walls enclose the goal",
        reached=np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]]),
    )  # fmt: skip


def with_alternatives() -> PlanResult:
    """A plan and two others."""
    others = [plan_of(["straight", "spin"], [1.0, k]) for k in (1.0, 2.0)]
    return result_of(parking_plan(), others=others)


@functools.cache
def fleet_loop() -> FleetLog:
    """Two that cross, pushed a little after every step."""
    noise = Disturbance(position_m=0.01, heading_rad=0.01)
    fleet = robots.crossing(tolerance=0.1, margin=0.2)
    return simulate_fleet(fleet, step=0.5, steps=40, first_time_limit=20.0, disturbance=noise)


@functools.cache
def roads() -> dict[str, RoadScene]:
    """Two problems on two lanes, with a slow car and one that is parked."""
    traffic = (car(7, x=60.0, y=2.0, speed=6.0, steps=60), parked(8, x=120.0, y=6.0))
    two = (problem(100, x=10.0, y=2.0, speed=14.0), problem(101, x=30.0, y=2.0, speed=9.0))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "road.xml"
        file.write_text(commonroad(*LANES, *traffic, *two))
        return {str(one.road.benchmark.problem): one.road for one in read_commonroad(file)}


def road() -> RoadScene:
    """The first of them."""
    return roads()["100"]


RESULTS: dict[str, Callable[[], Any]] = {
    "plan": parking_plan,
    "result": among,
    "result, zones": zones,
    "result, none": no_plan,
    "result, alternatives": with_alternatives,
    "result, trailer": trailer,
    "result, in space": flight,
    "loop": loops.parking_loop,
    "loop, pushed": loops.pushed_loop,
    "loop, unfinished": loops.unfinished_loop,
    "loop, in space": loops.flight_loop,
    "loop, empty": loops.empty_loop,
    "fleet": fleets.crossing,
    "fleet, many": lambda: fleets.row_of(14),
    "fleet loop": fleet_loop,
    "road plan": functools.cache(lambda: plan_road(road(), settings=QUICK)),
    "road drive": functools.cache(lambda: drive_road(road(), settings=QUICK)),
    "road fleet": functools.cache(lambda: plan_roads(roads(), name="road")),
    "road fleet drive": functools.cache(lambda: drive_roads(roads(), settings=QUICK, name="road")),
}
FILMS = ("result, zones", "result, trailer", "loop, pushed", "fleet", "fleet loop", "road drive",
         "road fleet drive")  # fmt: skip


# What is kept of them.


@dataclass
class _Seen(Exception):
    """A film that was to be written."""

    film: film.Film


def drawn(save: Callable[[Path], None]) -> Figure:
    """The figure that a function writes."""
    seen: list[Figure] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(pictures, "write_figure", lambda figure, _: seen.append(figure)),
    ):
        save(Path(folder) / "picture.png")
    (figure,) = seen
    return figure


def filmed(save: Callable[[Path], None]) -> film.Film:
    """The film that a function writes."""

    def stop(moving: film.Film) -> bytes:
        raise _Seen(moving)

    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(film, "_gif", stop),
        contextlib.suppress(OSError),
    ):
        try:
            save(Path(folder) / "film.gif")
        except _Seen as seen:
            return seen.film
    raise AssertionError("no film was written")


def picture_record(figure: Figure) -> dict[str, Any]:
    """Texts and legends of a figure, and what each of its axes shows."""
    return {
        "texts": [text.get_text() for text in figure.texts if text.get_text()],
        "legends": [[text.get_text() for text in one.get_texts()] for one in figure.legends],
        "axes": [axes_record(ax) for ax in figure.axes],
    }


def axes_record(ax: Axes) -> dict[str, Any]:
    """Labels, texts and legend of axes, and by type their artists: how many, and where."""
    named = [ax.get_xlabel(), ax.get_ylabel(), ax.get_title(), ax.get_title(loc="left")]
    legend = ax.get_legend()
    shown: dict[str, list[Any]] = {}
    for artist in (*ax.collections, *ax.lines, *ax.patches):
        kind = type(artist).__mro__[0].__name__
        shown.setdefault(kind, []).extend(_parts(artist))
    masked = ax.get_ylabel() == MASKED
    return {
        "labels": [name for name in named if name],
        "texts": [text.get_text() for text in ax.texts if text.get_text()],
        "legend": [] if legend is None else [text.get_text() for text in legend.get_texts()],
        "shown": {kind: _where(parts, masked=masked) for kind, parts in shown.items() if parts},
    }


def _parts(artist: Any) -> list[Any]:
    """Places (n, 2) of each path, marker, line or patch of an artist."""
    if isinstance(artist, Collection):
        if hasattr(artist, "_faces"):  # in space, where the view tells where they are
            return [np.zeros((1, 2))] * len(artist._faces)
        at = np.asarray(artist.get_offsets())
        if len(getattr(artist, "get_sizes", tuple)()):  # one marker each
            return list(at[:, None])
        if len(at) and artist.get_offset_transform() is not None and at.any():
            return list(at[:, None])
        return [path.vertices for path in artist.get_paths() if len(path.vertices)]
    if isinstance(artist, Line2D):
        places = artist.get_xydata()
        return [places] if len(places) else []
    if isinstance(artist, Patch):
        return [artist.get_patch_transform().transform(artist.get_path().vertices)]
    return []


def _where(parts: list[Any], *, masked: bool) -> list[float]:
    """How many parts, the box around them, and the mean of their middles."""
    middles = np.array([np.nanmean(np.asarray(part, dtype=float), axis=0) for part in parts])
    every = np.concatenate(parts)
    columns = slice(0, 1 if masked else 2)
    low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
    numbers = [*low[columns], *high[columns], *np.nanmean(middles, axis=0)[columns]]
    return [len(parts), *(_rounded(number) for number in numbers)]


def film_record(moving: film.Film) -> dict[str, Any]:
    """How many pictures a film has, from when to when, and what is shown in its middle."""
    times = moving.times
    moving.show(float(times[len(times) // 2]))
    span = [_rounded(times[0]), _rounded(times[-1])]
    return {"pictures": len(times), "span_s": span, "middle": picture_record(moving.figure)}


def _rounded(number: Any) -> float:
    return round(float(number), DIGITS) + 0.0


# How they are drawn.


def picture_of(name: str) -> Figure:
    """The picture of a case."""
    result = RESULTS[name]()
    return drawn(lambda path: _save(result, path))


def _save(result: Any, path: Path) -> None:
    view = "plane"
    if isinstance(result, PlanResult) and result.alternatives:
        view = "alternatives"
    elif plotting.flies_among_heights(recording_of(result)):
        view = "space"
    plotting.save_picture(result, path, view=view)


def film_of(name: str) -> film.Film:
    """The film of a case."""
    result = RESULTS[name]()
    return filmed(lambda path: plotting.save_film(result, path))


CASES: dict[str, Callable[[], dict[str, Any]]] = {
    **{f"picture, {name}": lambda name=name: picture_record(picture_of(name)) for name in RESULTS},
    **{f"film, {name}": lambda name=name: film_record(film_of(name)) for name in FILMS},
}


def recorded() -> dict[str, Any]:
    """What every case shows."""
    return {name: show() for name, show in CASES.items()}
