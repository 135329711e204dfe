"""A closed loop in motion: the vehicle drives, its plan ahead of it, the plans before fading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.bodies import DART, DART_SIZE
from maneuver_automaton.plotting.closed_loop_plane import JUMP, JUMP_STYLE
from maneuver_automaton.plotting.closed_loop_track import (
    driven_track,
    loop_colors,
    loop_scene,
    loop_view,
)
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.film import Film, check_film_path, picture_times, write_film
from maneuver_automaton.plotting.footprint import placed
from maneuver_automaton.plotting.stage import Stage, stage_of
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.receding_horizon import ClosedLoop

REMEMBERED = 6  # plans that are still fading


def save_closed_loop_animation(
    loop: ClosedLoop, path: str | Path, *, footprint: Any = None
) -> None:
    """Write a closed `loop` as a moving picture; the file is replaced in one step.

    Parameters
    ----------
    loop : ClosedLoop
        What to show; without a step there is a single picture.
    path : str or Path
        Where to write: a .gif, or an .mp4 where Matplotlib finds ffmpeg.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; that of the problem if left out, a dart if it has none.

    Raises
    ------
    ValueError
        If the ending is none of these, or .mp4 without ffmpeg.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = check_film_path(path)
    write_film(_film(loop, footprint=footprint), target)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Scene:
    """The parts of a film that change, and the loop that they show."""

    loop: ClosedLoop
    body: list[Array]
    colors: Mapping[str, Color]
    driven: Track
    plans: list[Track]  # one per step
    old: LineCollection
    ahead: LineCollection
    trail: LineCollection
    jumps: LineCollection
    vehicle: PolyCollection
    clock: Text

    def show(self, time: float) -> None:
        """Set everything to a `time` [s]."""
        loop = self.loop
        k = _step_at(loop, time)
        self.vehicle.set_verts(placed(self.body, _pose_at(loop, time)[None]))
        self.clock.set_text(_clock_text(loop, k, time))
        if k is None:
            return
        begin = loop.times[0]
        self._set(self.trail, self.driven, begin, time)
        plan = self.plans[k]
        arrived = loop.reached and time >= loop.times[-1]
        self._set(self.ahead, plan, time, time if arrived else np.inf)
        past = range(max(0, k - REMEMBERED), k)
        self.old.set_segments([self.plans[n].pose[:, :2] for n in past])
        fading = [0.75 * (1.0 - (k - n) / (REMEMBERED + 1)) for n in past]
        self.old.set_color([(*GREY, alpha) for alpha in fading])
        self.jumps.set_segments(
            [
                [plan.end[:2], pose[:2]]
                for plan, pose, at in zip(loop.driven, loop.poses[1:], loop.times[1:], strict=True)
                if at <= time
            ]
        )

    def _set(self, lines: LineCollection, track: Track, begin: float, end: float) -> None:
        """Have `lines` show the part of a `track` between two times."""
        shown = track.between(begin, end)
        lines.set_segments([places for _, places in shown])
        lines.set_color([self.colors[name] for name, _ in shown])


def _film(loop: ClosedLoop, *, footprint: Any) -> Film:
    colors = loop_colors(loop)
    around = loop_scene(loop, footprint=footprint)
    box, size = loop_view(loop, around)
    stage = stage_of(around, driven_track(loop), colors=colors, box=box, size=size)
    scene = _scene(stage, loop, list(around.body) or [DART_SIZE * size * DART], colors=colors)

    def show(time: float) -> None:
        scene.show(time)
        stage.show(time)

    return Film(
        figure=stage.figure,
        moving=[
            stage.traffic, scene.old, scene.jumps, scene.trail, scene.ahead, scene.vehicle,
            scene.clock,
        ],
        show=show,
        times=picture_times(float(loop.times[0]), float(loop.times[-1])),
        samples=[float(loop.times[-1]), *(step.time for step in loop.steps)],
    )  # fmt: skip


def _scene(
    stage: Stage, loop: ClosedLoop, body: list[Array], *, colors: Mapping[str, Color]
) -> _Scene:
    scene = _Scene(
        loop=loop,
        body=body,
        colors=colors,
        driven=driven_track(loop),
        plans=[track_of_plan(step.plan) for step in loop.steps],
        old=LineCollection([], linewidths=1.0, zorder=1.5),
        ahead=LineCollection([], linewidths=1.5, zorder=3.2),
        trail=LineCollection([], linewidths=3.2, capstyle="butt", zorder=3.0),
        jumps=LineCollection([], colors=[JUMP], linewidths=1.4, linestyles=[JUMP_STYLE], zorder=2),
        vehicle=PolyCollection(
            [], facecolors=[(*GREY, 0.35)], edgecolors=[INK], linewidths=1.2, zorder=6.0
        ),
        clock=stage.clock,
    )
    for part in (scene.old, scene.ahead, scene.trail, scene.jumps, scene.vehicle):
        stage.ax.add_collection(part, autolim=False)
    return scene


def _step_at(loop: ClosedLoop, time: float) -> int | None:
    """Number in the log of the step under way; None if there is no step."""
    if not loop.steps:
        return None
    after = int(np.searchsorted(loop.times, time, side="right"))
    return min(max(after - 1, 0), len(loop.steps) - 1)


def _pose_at(loop: ClosedLoop, time: float) -> Array:
    k = _step_at(loop, time)
    if k is None or time >= loop.times[-1]:
        return np.asarray(loop.poses[-1])
    return loop.driven[k].pose_at(time)


def _clock_text(loop: ClosedLoop, k: int | None, time: float) -> str:
    """Time and value; whether the step under way replanned or broke a guarantee."""
    text = f"{time:.2f} s"
    if k is None or time >= loop.times[-1]:
        return f"{text} · {'goal reached' if loop.reached else loop.reason}"
    step = loop.steps[k]
    parts = [text, f"step {step.number}", f"V = {step.value:.4g}"]
    if step.replanned:
        parts.append("replanned")
    if step.violations:
        parts.append("guarantee broken")
    return " · ".join(parts)
