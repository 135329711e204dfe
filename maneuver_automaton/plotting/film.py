"""Moving pictures as files: a figure, its artists that move, and the times of its pictures."""

from __future__ import annotations

import io
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.plotting.pages import DPI

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
    """The path, if a film can be written to it: by its ending, .gif or .mp4.

    Raises
    ------
    ValueError
        If the ending is another one, or .mp4 and Matplotlib finds no ffmpeg.
    """
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


def write_film(film: Film, path: str | Path) -> None:
    """Write a `film` to `path`, by its ending; the file is replaced in one step.

    Raises
    ------
    ValueError
        As `check_film_path`.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = check_film_path(path)
    writers = {".gif": _gif, ".mp4": _video}
    write_bytes_atomically(target, writers[target.suffix.lower()](film))


def _gif(film: Film) -> bytes:
    from PIL import Image

    canvas: Any = film.figure.canvas  # Matplotlib leaves its drawing calls without types
    for artist in film.moving:
        artist.set_animated(True)  # left out of what is drawn once
    canvas.draw()
    still = canvas.copy_from_bbox(film.figure.bbox)

    def picture(time: float) -> Array:
        canvas.restore_region(still)
        film.show(time)
        for artist in film.moving:
            film.figure.draw_artist(artist)
        return np.array(canvas.buffer_rgba())[..., :3]

    # one palette for all, so that what does not move does not flicker
    samples = np.concatenate([picture(time) for time in list(film.samples)[:MOST_SAMPLES]])
    palette = Image.fromarray(samples).quantize(colors=PALETTE)
    palette.putpalette(_with_white(palette.getpalette() or []))
    images = [
        Image.fromarray(picture(time)).quantize(palette=palette, dither=Image.Dither.NONE)
        for time in film.times
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
    return _grabbed(film, writer, [*film.times, *pause], name="film.mp4")


def _grabbed(film: Film, writer: Any, times: Sequence[float] | Array, *, name: str) -> bytes:
    """What a Matplotlib `writer` makes of the pictures at `times` [s]."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        with writer.saving(film.figure, str(file), DPI):
            for time in times:
                film.show(float(time))
                writer.grab_frame()
        return file.read_bytes()
