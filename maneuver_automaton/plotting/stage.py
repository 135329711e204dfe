"""Static and moving obstacles of an animation, and its clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import INK, Color
from maneuver_automaton.plotting.ends import draw_ends, end_handles
from maneuver_automaton.plotting.limits import draw_limits, limit_handles
from maneuver_automaton.plotting.obstacles import (
    MOVING,
    MovingShape,
    draw_obstacles,
    moving_shapes,
    obstacle_handles,
    show_presence,
)
from maneuver_automaton.plotting.pages import (
    DPI,
    axes_at,
    bottom_legend,
    legend_rows,
    new_figure,
)
from maneuver_automaton.plotting.paths import trim_handles
from maneuver_automaton.plotting.scene import Scene, set_view
from maneuver_automaton.plotting.track import Track

WIDTH, LEFT, RIGHT, TOP = 6.4, 0.75, 0.2, 0.45  # [in]
LOWEST, HIGHEST = 1.6, 4.8  # [in] of the plane
MOST_NAMES = 12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Stage:
    """A figure with obstacles, start and goals, on which a vehicle is to drive."""

    figure: Figure
    ax: Axes
    traffic: PathCollection
    moving: list[MovingShape]
    clock: Text

    def show(self, time: float) -> None:
        """Put moving obstacles where they are at `time` [s]."""
        self.traffic.set_paths([one.at(time) for one in self.moving])
        there = [one.there(time) for one in self.moving]
        show_presence(self.traffic, [MOVING] * len(there), there)


def stage_of(
    scene: Scene, track: Track, *, colors: Mapping[str, Color], box: Array, size: float
) -> Stage:
    """The stage for a `track` in a `scene`: shows `box` (2, 2), marks suit a path of `size` [m]."""
    handles, names = _legend_entries(scene, track, colors)
    inner = WIDTH - LEFT - RIGHT
    wide, high = np.ptp(box, axis=0).tolist()
    height = min(max(inner * high / wide, LOWEST), HIGHEST)
    bottom = 0.62 + 0.2 * legend_rows(names, inner)
    figure = new_figure(WIDTH, even_height(bottom + height + TOP))
    ax = axes_at(figure, left=LEFT, bottom=bottom, width=inner, height=height)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    draw_ends(ax, track.start, scene.goals, size=size, reached=scene.reached)
    obstacles = draw_obstacles(ax, scene.obstacles, time=scene.times[0])
    draw_limits(ax, scene.zones, scene.bounds)
    set_view(ax, box, track.start[:2])
    return Stage(
        figure=figure,
        ax=ax,
        traffic=obstacles.moving,
        moving=moving_shapes(scene.obstacles),
        clock=figure.text(
            LEFT / WIDTH, 1.0 - 0.14 / figure.get_size_inches()[1], "", fontsize=10.0, color=INK,
            va="top", parse_math=False,
        ),
    )  # fmt: skip


def _legend_entries(
    scene: Scene, track: Track, colors: Mapping[str, Color]
) -> tuple[list[Artist], list[str]]:
    """Handles and names of the trims, unless there are many, of the ends, and of obstacles."""
    trims, trim_names = trim_handles(track, colors)
    few = len(trims) <= MOST_NAMES
    ends, end_names = end_handles(scene.goals)
    others, other_names = obstacle_handles(scene.obstacles, scene.times[:1])
    limits, limit_names = limit_handles(scene.zones, scene.bounds)
    return (
        [*trims[: None if few else 0], *ends, *others, *limits],
        [*trim_names[: None if few else 0], *end_names, *other_names, *limit_names],
    )


def even_height(inches: float) -> float:
    """A height that is an even number of pixels, as films need it."""
    return 2.0 * round(inches * DPI / 2.0) / DPI
