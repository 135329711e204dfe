"""Draw vehicles in the plane, each in its colour: paths, bodies at equal times, both ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.cast import Actor, Cast
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.paths import HELD_STYLE, JUMP, JUMP_STYLE
from maneuver_automaton.plotting.style import Entries, dashed_handle, line_handle, mark_handle

HATCH = "/////"
DASHES = (0, (3, 2))
FRONT = 0.8  # of the reach of a body, a line from its pose on shows where it looks
DIM = {12: (2.0, 0.30), 40: (1.4, 0.22)}  # width [pt] of paths, alpha of bodies, for up to so many
THIN = (0.9, 0.16)  # ... and for more
HELD = 0.45  # towards white, the shade of plans that were held
NUMBER_PT, STEP_PT = 6.5, 6.0
CASING = [withStroke(linewidth=3.0, foreground="white")]  # others may end where one starts
SLACK_S = 1e-6


def draw_vehicles(ax: Axes, cast: Cast, *, numbered: bool = False) -> dict[str, Any]:
    """Draw all vehicles of a cast, with bodies on their paths; the artists by what they show."""
    actors = cast.actors
    driving, small = [one for one in actors if one.mover.has_plan], cast.small
    seen = [one for one in driving if one not in small]
    missed = [
        one for one in actors if one not in small and not (one.mover.has_plan and one.mover.reached)
    ]
    lost = [one for one in small if not one.mover.has_plan]
    dots = [one for one in small if one.mover.has_plan]
    width, alpha = next((weights for most, weights in DIM.items() if len(actors) <= most), THIN)
    along = [(one, time) for one in driving for time in _between(one, cast.times)]
    held = [(track, one) for one in actors for _, track in one.held]
    wanted = [(ring, one) for one in missed for ring in one.goal_outlines]
    fronts, inks = [], []  # from poses to the fronts of bodies, at the start and at the end
    for one in seen:
        ahead = np.array([[0.0, 0.0], [FRONT * max(ring[:, 0].max() for ring in one.body), 0.0]])
        ends = one.mover.pose_at(np.array([one.mover.start_time, one.mover.arrival]))[:, :3]
        fronts += [SE2(pose).act(ahead) for pose in ends]
        inks += [one.color, (1.0, 1.0, 1.0) if one.mover.reached else one.color]
    artists: dict[str, Any] = {
        "paths": LineCollection(
            [one.track.pose[:, :2] for one in driving], colors=[one.color for one in driving],
            linewidths=width, capstyle="round", joinstyle="round", zorder=3.0,
        ),
        "bodies": _bodies(along, face=0.4 * alpha, edge=2.2 * alpha),
        "starts": _bodies(
            [(one, one.mover.start_time) for one in seen], face=0.0, edge=1.0, width=1.5
        ),
        "goals": _bodies([(one, one.mover.arrival) for one in seen if one not in missed], face=1.0),
        "missing": _bodies([(one, one.mover.arrival) for one in missed], hatch=HATCH, width=1.0),
        "fronts": LineCollection(fronts, linewidths=1.2, colors=inks, zorder=3.7),
        "wanted": PolyCollection(
            [ring for ring, _ in wanted], facecolors="none", linewidths=1.0, linestyles=[DASHES],
            edgecolors=[one.color for _, one in wanted], zorder=2.2,
        ),
        "held": LineCollection(
            [track.pose[:, :2] for track, _ in held], linewidths=1.0, linestyles=[HELD_STYLE],
            colors=[shaded(one.color, HELD) for _, one in held], zorder=1.9,
        ),
        "jumps": LineCollection(
            [line for one in actors for _, line in one.jumps], colors=[JUMP], linewidths=1.3,
            linestyles=[JUMP_STYLE], zorder=3.3,
        ),
    }  # fmt: skip
    artists["starts"].set_path_effects(CASING)
    for part in artists.values():
        ax.add_collection(part, autolim=False)
    goals = [(goal.pose, one) for one in lost for goal in one.mover.goals]
    artists |= {
        "start marks": _marks(ax, [(one.track.start, one) for one in dots], size=26.0),
        "goal marks": _marks(ax, [(one.track.end, one) for one in dots], size=20.0, filled=True),
        "missing marks": _marks(
            ax, [(one.track.start, one) for one in lost], size=34.0, filled=True, marker="X"
        ),
        "wanted marks": _marks(ax, goals, size=24.0),
    }
    for one in actors if cast.is_many else ():
        _number(ax, one)
    for one, time in along if numbered else ():
        _step(ax, one, time, int(np.searchsorted(cast.times, time)))
    return artists


def vehicle_entries(cast: Cast, *, moving: bool = False) -> Entries:
    """Legend entries: the vehicles if they are few, and what marks say; `moving`: of a film."""
    actors = cast.actors
    named = () if cast.is_many else [one for one in actors if one.name]
    rows: list[tuple[Artist, str]] = [
        (line_handle(one.color, width=3.4), one.name) for one in named
    ]
    if not all(one.mover.has_plan and one.mover.reached for one in actors):
        said = "not arrived" if all(one.mover.has_plan for one in actors) else "no plan"
        rows.append((Patch(facecolor="white", edgecolor=INK, hatch=HATCH, linewidth=0.8), said))
    if moving and any(one.goal_outlines for one in actors):
        rows.append((Patch(facecolor="none", edgecolor=INK, linestyle=DASHES), "goal"))
    elif not moving:
        square = mark_handle("s", size=6.5)
        rows += [(square, "start"), (mark_handle("s", size=6.5, face=INK), "goal")]
    times = cast.times
    if not moving and len(times) > 2 and any(one.body for one in actors):
        said = f"body every {float(np.median(np.diff(times))):.3g} s"
        rows.append((Patch(facecolor=(*GREY, 0.15), edgecolor=GREY, linewidth=0.8), said))
    if any(one.mover.regions for one in actors):
        rows.append((Patch(facecolor="none", edgecolor=INK, linestyle=(0, (4, 3))), "goal region"))
    if any(one.held for one in actors):
        rows.append((dashed_handle(shaded(GREY, HELD), HELD_STYLE, width=1.0), "plan held"))
    if any(one.jumps for one in actors):
        rows.append((dashed_handle(JUMP, JUMP_STYLE, width=1.3), "disturbance"))
    return rows


def _between(one: Actor, times: Array) -> list[float]:
    """Those of the times at which it is under way [s]."""
    first, last = one.mover.start_time + SLACK_S, one.mover.arrival - SLACK_S
    return [time for time in times.tolist() if first < time < last]


def _bodies(
    at: Sequence[tuple[Actor, float]], *, face: float | None = None, edge: float | None = None,
    hatch: str = "", width: float = 0.7,
) -> PolyCollection:  # fmt: skip
    """Outlines of vehicles at times, filled with a share `face` of their colours."""
    rows = [(ring, one.color) for one, time in at for ring in one.bodies_along(np.array([time]))]
    colors: list[Color] = [color for _, color in rows]
    look: dict[str, Any] = {"edgecolors": colors, "zorder": 3.6}
    if hatch:
        look |= {"facecolors": "white", "hatch": hatch}
    elif face == 1.0:
        look |= {"facecolors": colors, "edgecolors": [shaded(c, -0.4) for c in colors]}
    else:
        look = {
            "facecolors": [(*color, face) for color in colors] if face else "none",
            "edgecolors": [(*color, edge) for color in colors],
            "zorder": 2.4 if face else 3.8,
        }
    return PolyCollection([ring for ring, _ in rows], linewidths=width, **look)


def _marks(
    ax: Axes, poses: Sequence[tuple[Array, Actor]], *, size: float, filled: bool = False,
    marker: str = "o",
) -> PathCollection:  # fmt: skip
    colors = [one.color for _, one in poses]
    at = np.array([pose[:2] for pose, _ in poses]).reshape(-1, 2)
    return ax.scatter(
        at[:, 0], at[:, 1], s=size, marker=marker, linewidths=1.3,
        facecolors=colors if filled else "none", edgecolors=colors, zorder=3.6 if filled else 3.8,
    )  # fmt: skip


def _number(ax: Axes, one: Actor) -> Text:
    x, y = one.track.start[:2].tolist()
    return ax.annotate(
        one.label, (x, y), xytext=(3.5, 3.5), textcoords="offset points",
        fontsize=NUMBER_PT, color=shaded(one.color, -0.35), fontweight="bold", zorder=6.0,
        parse_math=False, path_effects=[withStroke(linewidth=1.6, foreground="white")],
        annotation_clip=True,
    )  # fmt: skip


def _step(ax: Axes, one: Actor, time: float, number: int) -> Text:
    """The number of a time at the body that stands there at that time."""
    x, y = one.mover.pose_at(time)[:2]
    return ax.text(
        x, y, str(number), fontsize=STEP_PT, color=shaded(one.color, -0.35),
        ha="center", va="center", zorder=5.0, clip_on=True, parse_math=False,
        path_effects=[withStroke(linewidth=1.4, foreground="white")],
    )  # fmt: skip
