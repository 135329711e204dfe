"""Films of any result: what moves over what stands still, written as GIF, HTML or video."""

from __future__ import annotations

import io
import math
import tempfile
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.plotting.cast import Cast, cast_of
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.obstacles import MOVING, moving_shapes, show_presence
from maneuver_automaton.plotting.pages import DPI, EDGE, page_of, settled
from maneuver_automaton.plotting.paths import (
    DART,
    DART_SIZE,
    HELD_STYLE,
    JUMP,
    JUMP_STYLE,
    draw_ends,
)
from maneuver_automaton.plotting.pictures import draw_world, plane_entries, see
from maneuver_automaton.plotting.together import DASHES, HATCH
from maneuver_automaton.plotting.track import placed
from maneuver_automaton.recording import recording_of
from maneuver_automaton.recording.values import few

FRAMES_PER_SECOND = 15
MOST_FRAMES = 150  # longer motions are shown faster
PAUSE_S = 1.0  # on the last picture
PALETTE, MOST_SAMPLES = 128, 16  # colours, and pictures that they are taken from
NEARLY_WHITE = 247  # of 255, in each channel: Pillow looks 252 up in place of white, by distance
ENDINGS = (".gif", ".mp4")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Film:
    """A figure whose `moving` artists show another time at every call of `show`."""

    figure: Figure
    moving: Sequence[Artist]  # drawn over all others, in this order
    show: Callable[[float], None]  # a time [s]
    times: Array  # (n,) of the pictures [s]
    samples: Sequence[float]  # times whose pictures have all colours


def picture_times(begin: float, end: float) -> Array:
    """Times (n,) of the pictures of a motion [s]: in real time where that is short enough."""
    frames = max(1, min(MOST_FRAMES, math.ceil((end - begin) * FRAMES_PER_SECOND) + 1))
    return np.linspace(begin, end, frames)


def check_film_path(path: str | Path) -> Path:
    """The path, if a film can be written to it: by its ending, .gif or .mp4."""
    target = Path(path)
    ending = target.suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(
            f"animation: got the file name {target.name}, need one ending in {', '.join(ENDINGS)}"
        )
    if ending == ".mp4":
        from matplotlib.animation import FFMpegWriter

        if not FFMpegWriter.isAvailable():
            raise ValueError(
                f"animation: got the file name {target.name}, but Matplotlib finds no ffmpeg, "
                "which writes .mp4; install ffmpeg, or choose an ending of .gif"
            )
    return target


def _gif(film: Film) -> bytes:
    from PIL import Image

    canvas: Any = film.figure.canvas  # Matplotlib leaves its drawing calls without types
    for artist in film.moving:
        artist.set_animated(True)  # left out of what is drawn once
    canvas.draw()
    still = canvas.copy_from_bbox(film.figure.bbox)

    def picture(time: float) -> Image.Image:
        canvas.restore_region(still)
        film.show(time)
        for artist in film.moving:
            film.figure.draw_artist(artist)
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

    # one palette for all, so that what does not move does not flicker
    samples = np.concatenate([np.asarray(picture(time)) for time in film.samples[:MOST_SAMPLES]])
    palette = Image.fromarray(samples).quantize(colors=PALETTE)
    palette.putpalette(_with_white(palette.getpalette() or []))
    images = [
        picture(time).quantize(palette=palette, dither=Image.Dither.NONE) for time in film.times
    ]
    lasts = [round(1000.0 / FRAMES_PER_SECOND)] * (len(images) - 1) + [round(1000.0 * PAUSE_S)]
    stream = io.BytesIO()
    images[0].save(
        stream, format="GIF", save_all=True, append_images=images[1:], duration=lasts, loop=0
    )
    return stream.getvalue()


def _with_white(palette: Sequence[int]) -> list[int]:
    """The palette with white for what is nearly white: taking means would make paper grey."""
    colors = np.array(palette).reshape(-1, 3)
    colors[colors.min(axis=1) >= NEARLY_WHITE] = 255
    return [int(channel) for channel in colors.ravel()]


def _video(film: Film) -> bytes:
    from matplotlib.animation import FFMpegWriter

    writer = FFMpegWriter(fps=FRAMES_PER_SECOND, codec="h264", extra_args=["-pix_fmt", "yuv420p"])
    pause = [film.times[-1]] * round(PAUSE_S * FRAMES_PER_SECOND)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.mp4"
        with writer.saving(film.figure, str(file), DPI):
            for time in [*film.times, *pause]:
                film.show(float(time))
                writer.grab_frame()
        return file.read_bytes()


WIDTH = 6.4  # [in]
TRAIL_S = 2.0  # of what each of several drove is shown
OUTLINED = 40  # so many vehicles at most have outlines
REMEMBERED = 6  # plans of one vehicle that are still fading
MOST_NAMES, MOST_SAID = 12, 2  # trims in the legend, and events of a step that are told
COLOR_SAMPLES = 6  # pictures that the colours of the film are taken from


def save_film(result: Any, path: str | Path, *, look: Look | None = None) -> None:
    """Write a film of any `result`; the file is replaced in one step.

    All bodies move, in real time where that is short enough. Behind one vehicle is what it drove,
    in the colours of its trims, behind several the last two seconds; ahead the plan that it holds.
    More than forty have no outlines; one without a plan stands at its start, hatched, and one that
    leaves is gone once it has arrived.

    Parameters
    ----------
    result : any result, or Recording
        What to show; what takes no time gives a single picture.
    path : str or Path
        Where to write: a .gif, or an .mp4 where Matplotlib finds ffmpeg.
    look : Look, optional
        Title and size.

    Raises
    ------
    TypeError
        If it is no result.
    ValueError
        If the ending is none of these, or .mp4 without ffmpeg.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target, film = check_film_path(path), film_of(result, look=look)
    write_bytes_atomically(target, _video(film) if target.suffix.lower() == ".mp4" else _gif(film))


def film_of(result: Any, *, look: Look | None = None) -> Film:
    """The figure of any `result` that moves, in no window.

    Examples
    --------
    >>> from maneuver_automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> film = film_of(Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0]))
    >>> film.show(1.5)
    >>> film.moving[-1].get_text()
    '1.50 s'
    """
    recording, look = recording_of(result), look or Look()
    cast = cast_of(recording)
    title = look.title or (recording.title if recording.world.lanes else "") or " "
    look = replace(look, title=title, size=look.size or (WIDTH, None))
    wide, high = np.ptp(cast.box, axis=0).tolist()
    shape = max(wide, 1e-9) / max(high, 1e-9)
    page = page_of(look, [], plane_entries(cast, moving=True), shape=shape)
    ax, figure = page.plane, page.figure
    still = draw_world(ax, cast, cast.times[:1])
    still["tracks"].remove()
    _draw_still(ax, cast)
    see(ax, cast)
    clock = figure.text(
        1.0 - EDGE / look.width, 1.0 - EDGE / figure.get_figheight(), "", fontsize=10.0,
        color=INK, ha="right", va="top", parse_math=False,
    )  # fmt: skip
    outlined = len(cast.actors) <= OUTLINED
    old = LineCollection([], linewidths=1.0, zorder=1.5)
    ahead = LineCollection([], linewidths=1.4, linestyles=[HELD_STYLE], zorder=2.8)
    trails = LineCollection([], linewidths=2.4 if outlined else 1.4, capstyle="butt", zorder=3.0)
    jumps = LineCollection([], colors=[JUMP], linewidths=1.4, linestyles=[JUMP_STYLE], zorder=2.0)
    bodies = PolyCollection([], linewidths=1.0 if outlined else 0.0, zorder=4.0)
    for part in (old, jumps, ahead, trails, bodies):
        ax.add_collection(part, autolim=False)
    small = [one for one in cast.small if one.mover.has_plan]
    dots = ax.scatter([], [], s=18.0, linewidths=0.0, zorder=4.1)
    traffic = still["traffic"]
    shapes = moving_shapes(cast.recording.world.obstacles, fleeting=cast.recording.world.fleeting)
    dart = [DART_SIZE * cast.size * DART]

    def show(time: float) -> None:
        there = [one for one in shapes if one.there(time) or not cast.recording.world.fleeting]
        traffic.set_paths([one.at(time) for one in there])
        show_presence(traffic, [MOVING] * len(there), [one.there(time) for one in there])
        _color(old, _fading(cast, time))
        _color(ahead, _ahead(cast, time))
        _color(trails, _trails(cast, time))
        jumps.set_segments([line for one in cast.actors for at, line in one.jumps if at <= time])
        rings = _bodies(cast, time, dart if cast.is_alone else [])
        bodies.set_verts([ring for ring, _ in rings])
        alpha = 0.55 if cast.is_alone else 1.0
        bodies.set_facecolor([(*color, alpha) for _, color in rings])
        bodies.set_edgecolor([INK if cast.is_alone else shaded(color, -0.45) for _, color in rings])
        shown = [] if cast.is_alone else [one for one in small if one.mover.is_there(time)]
        dots.set_offsets(np.array([one.mover.pose_at(time)[:2] for one in shown]).reshape(-1, 2))
        dots.set_facecolor([one.color for one in shown])
        clock.set_text(" · ".join([f"{time:.2f} s", *_said(cast, time)]))

    settled(figure)
    moving: list[Artist] = [traffic, old, jumps, ahead, trails, bodies, dots, clock]
    samples = np.linspace(cast.end, cast.recording.begin, COLOR_SAMPLES).tolist()
    if cast.is_alone:  # one picture of each trim: its colour is in none of the others
        first = {piece.name: float(piece.time[0]) for piece in cast.actors[0].track.pieces[::-1]}
        samples = [cast.end, *first.values()]
    times = picture_times(cast.recording.begin, cast.end)
    return Film(figure=figure, moving=moving, show=show, times=times, samples=samples)


Lines = Sequence[tuple[Array, tuple[float, float, float, float]]]


def _color(collection: LineCollection, lines: Lines) -> None:
    collection.set_segments([places for places, _ in lines])
    collection.set_color([color for _, color in lines])


def _fading(cast: Cast, time: float) -> Lines:
    """Plans that one vehicle held of late, the older the paler."""
    if not cast.is_alone:
        return []
    held = cast.actors[0].held
    k = bisect_right([begin for begin, _ in held], time) - 1
    past = range(max(0, k - REMEMBERED), max(k, 0))
    return [
        (held[n][1].pose[:, :2], (*GREY, 0.75 * (1.0 - (k - n) / (REMEMBERED + 1)))) for n in past
    ]


def _ahead(cast: Cast, time: float) -> Lines:
    """What is left of the plan that each vehicle holds."""
    rows = []
    for one in cast.actors:
        k = bisect_right([begin for begin, _ in one.held], time) - 1
        arrived = one.mover.reached and time >= one.mover.arrival
        if k < 0 or arrived or not one.mover.is_there(time):
            continue
        for name, places in one.held[k][1].between(time, np.inf):
            color = cast.colors[name] if cast.is_alone else one.color
            rows.append((places, (*color, 0.9)))
    return rows


def _trails(cast: Cast, time: float) -> Lines:
    """What one vehicle drove, in the colours of its trims, or each of several of late."""
    if cast.is_alone:
        driven = cast.actors[0].track.between(cast.recording.begin, time)
        return [(places, (*cast.colors[name], 1.0)) for name, places in driven]
    return [
        (places, (*one.color, 0.5))
        for one in cast.actors
        if one.mover.has_plan and one.mover.is_there(time)
        for _, places in one.track.between(time - TRAIL_S, time)
    ]


def _bodies(cast: Cast, time: float, dart: Sequence[Array]) -> list[tuple[Array, Color]]:
    """Outlines of all that drive, and their colours; a dart where there is no body."""
    rows = []
    for one in cast.actors if cast.is_alone else [one for one in cast.actors if one.mover.has_plan]:
        rings = one.bodies_at(time) or (placed(dart, one.mover.pose_at(time)[None]) if dart else [])
        color = one.color
        if cast.is_alone:
            after = int(np.searchsorted(one.track.switching_times[1:-1], time, side="right"))
            pieces = one.track.pieces
            color = cast.colors.get(pieces[after].name, GREY) if pieces else INK
        rows += [(ring, color) for ring in rings]
    return rows


def _said(cast: Cast, time: float) -> list[str]:
    """The step under way of a closed loop, its value, and what happens in it."""
    recording = cast.recording
    values = next((c for c in recording.curves if c.label == "value" and not c.mover), None)
    if values is None:
        return []
    if time >= min(cast.end, float(values.time[-1])):
        return [recording.ending]
    k = max(int(np.searchsorted(values.time, time, side="right")) - 1, 0)
    parts = [f"step {k}"]
    if np.isfinite(values.value[k]):
        parts.append(f"V = {values.value[k]:.4g}")
    at = float(values.time[k])
    if recording.texts("replanned", at):
        parts.append("replanned")
    if swaps := recording.texts("exchanged", at):
        parts.append(f"exchanged: {few(swaps, MOST_SAID)}")
    if recording.texts("broken", at):
        parts.append("guarantee broken")
    return parts


def _draw_still(ax: Any, cast: Cast) -> None:
    """Faint paths, starts and goals, and vehicles without a plan, hatched."""
    driving = [one for one in cast.actors if one.mover.has_plan]
    waiting = [] if cast.is_alone else [one for one in cast.actors if not one.mover.has_plan]
    hatched = [(ring, one) for one in waiting for ring in one.bodies_at(one.mover.start_time)]
    goals = [] if cast.is_alone else [(r, one) for one in cast.actors for r in one.goal_outlines]
    colors = [GREY if cast.is_alone else one.color for one in driving]
    parts = (
        LineCollection(
            [one.track.pose[:, :2] for one in driving], linewidths=0.7, zorder=1.8,
            colors=[(*color, 0.5) for color in colors],
        ),
        PolyCollection(
            [ring for ring, _ in goals], facecolors="none", linewidths=0.7, zorder=2.2,
            edgecolors=[(*one.color, 0.7) for _, one in goals], linestyles=[DASHES],
        ),
        PolyCollection(
            [ring for ring, _ in hatched], facecolors="white", linewidths=0.9, hatch=HATCH,
            edgecolors=[one.color for _, one in hatched], zorder=3.9,
        ),
    )  # fmt: skip
    for part in parts:
        ax.add_collection(part, autolim=False)
    if cast.is_alone:
        (one,) = cast.actors
        draw_ends(
            ax, one.track.start, one.goals, size=cast.size, reached=one.reached, via=one.mover.via
        )
