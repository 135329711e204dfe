"""Figures as files: pages of a plane and panels, drawn without a display, replaced in one step."""

from __future__ import annotations

import contextlib
import functools
import io
import math
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from PIL import Image

from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.plotting import style
from maneuver_automaton.plotting.colors import INK
from maneuver_automaton.plotting.look import HEAD_PT, TITLE_PT, Look
from maneuver_automaton.plotting.style import Entries

DPI = 130
# text as text, in fonts that journals take; the same picture gives the same bytes
VECTOR: Any = {
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "picture",
}
UNDATED: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
PLANE = 0.57  # share of the width that the plane has beside what is over time
FLAT = 1.7  # a plane so much wider than high is given the width of the page
LOW, HIGH, LEAST_PLANE = 3.6, 5.6, 0.8  # [in] height of the plane
PANEL, LEAST_PANEL, COLUMN = 1.15, 0.55, 2.15  # [in] heights over time, and the least width
TICKS, LABEL, EDGE = 0.2, 0.4, 0.12  # [in] of numbers, of numbers and a label, and of the page
FIRST = 4.0  # [in] height of a page before it is known


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """A figure with its axes: the plane, and what is over time, beside or below it."""

    figure: Figure
    plane: Any  # Axes, or Axes3D
    panels: tuple[Axes, ...]
    is_stacked: bool  # the panels stand above each other


_BLANK: list[Figure] = []


def prepare() -> None:
    """Make axes for the next page with a plane beforehand, which is a fifth of the work on it."""
    manager: Any = fontManager  # it would look up the font of a text each time it is laid out
    manager.findfont = functools.cache(manager.findfont)
    Image.preinit()  # which loads the formats of images
    _BLANK.append(Figure())
    for ax in _BLANK[0].subplots(1, 3):  # most have a plane and two panels
        style.tidy(ax, x="", y="")
        for axis in (ax.xaxis, ax.yaxis):
            axis.get_major_ticks(11)  # hardly any has more


def page_of(
    look: Look, lines: Sequence[str], legend: Entries, *, shape: float, panels: Sequence[float] = ()
) -> Page:
    """A page with a heading of some lines, a legend along its lower edge, a plane, and panels.

    The plane is `shape` times as wide as high; `panels` are their heights, compared with others'.
    They stand beside the plane, or below it if that is flat or the page narrow. A page whose stated
    height leaves too little room has none.
    """
    figure = _BLANK.pop() if _BLANK else Figure()
    top = _headed(figure, look, lines, look.width)
    foot = _legend_below(figure, legend) + EDGE
    flat = shape > FLAT or look.is_narrow or not panels
    columns = max(1, min(len(panels), int(look.width / COLUMN))) if flat else 1
    rows = math.ceil(len(panels) / columns)
    frame = top + foot + LABEL
    if look.height is not None:
        least = rows * (LEAST_PANEL + LABEL) + LEAST_PLANE if flat else LEAST_PANEL * len(panels)
        if look.height - frame < least:
            panels, flat, rows = (), True, 0
    wide = look.width - LABEL - EDGE
    panel = PANEL
    if flat and rows and look.height is not None:
        panel = min(PANEL, (look.height - frame - LEAST_PLANE) / rows - LABEL)
    below = rows * (panel + LABEL) if flat else 0.0
    if look.height is not None:
        high = max(look.height - frame - below, LEAST_PLANE)
    elif flat:
        high = min(max(wide / shape, 1.5 * LEAST_PLANE), HIGH)
    else:
        stacked = sum(panels) * PANEL + (len(panels) - 1) * TICKS
        high = max(min(max(PLANE * wide / shape, LOW), HIGH), stacked)
    _settle(figure, frame + high + below, top)
    count = len(panels)
    if flat:
        grid = figure.add_gridspec(1 + rows, columns, height_ratios=[high, *[panel] * rows])
        spots = [grid[0, :], *(grid[1 + k // columns, k % columns] for k in range(count))]
    else:
        shares = (PLANE, 1.0 - PLANE)
        grid = figure.add_gridspec(count, 2, width_ratios=shares, height_ratios=panels)
        spots = [grid[:, 0], *(grid[k, 1] for k in range(count))]
    for ax, spot in zip(figure.axes, spots, strict=False):
        ax.set_subplotspec(spot)
    for ax in figure.axes[len(spots) :]:
        ax.remove()
    for spot in spots[len(figure.axes) :]:
        figure.add_subplot(spot)
    return Page(figure, figure.axes[0], tuple(figure.axes[1:]), not flat or columns == 1)


def space_page(look: Look, lines: Sequence[str], legend: Entries, *, shape: float) -> Page:
    """A page with axes in space above two of the plane, each `shape` times as wide as high."""
    top = _headed(figure := Figure(), look, lines, look.width)
    foot = _legend_below(figure, legend) + EDGE
    below = min(max(0.45 * look.width / shape, 1.5 * LEAST_PLANE), 0.5 * HIGH)
    frame = top + foot + 2.0 * LABEL
    above = 0.54 * look.width if look.height is None else look.height - frame - below
    above = max(above, LEAST_PLANE)
    _settle(figure, frame + above + below, top)
    axes = figure.subplot_mosaic(
        [["space", "space"], ["above", "aside"]],
        height_ratios=(above, below),
        per_subplot_kw={"space": {"projection": "3d", "computed_zorder": False}},
    )
    axes["space"].patch.set_alpha(0.0)
    return Page(figure, axes["space"], (axes["above"], axes["aside"]), is_stacked=False)


def plain_page(
    look: Look,
    lines: Sequence[str],
    mosaic: list[Any],
    *,
    width: float,
    height: float,
    **ratios: Any,
) -> tuple[Figure, dict[str, Axes]]:
    """A page of a `width` [in] with a heading and a `mosaic` of a `height` [in]."""
    top = _headed(figure := Figure(), look, lines, width)
    _settle(figure, look.height or top + height, top)
    return figure, figure.subplot_mosaic(mosaic, empty_sentinel="", **ratios)


def _headed(figure: Figure, look: Look, lines: Sequence[str], width: float) -> float:
    """Give a figure a title, then `lines`, the first bold without one; their height [in]."""
    figure.set(figwidth=width, figheight=FIRST, dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)  # it belongs to no window
    top, said = EDGE, [look.title, *([] if look.is_paper else lines)]
    shown = [(text, k) for k, text in enumerate(said) if text]
    for place, (text, k) in enumerate(shown):
        size = TITLE_PT if k == 0 else HEAD_PT if place == 0 else style.TEXT_PT
        most = max(20, int((width - 2.0 * EDGE) / ((0.0077 if place else 0.0092) * size)))
        filled = "\n".join(textwrap.fill(line, most) for line in text.split("\n"))
        figure.text(
            EDGE / width, 1.0 - top / FIRST, filled, fontsize=size, color=INK, va="top", ha="left",
            fontweight="normal" if place else "bold", parse_math=False, linespacing=1.25,
        )  # fmt: skip
        top += 1.42 * size / 72.0 * (1 + filled.count("\n"))
    return top + 0.5 * EDGE


def _settle(figure: Figure, height: float, top: float) -> None:
    """Give a figure its height [in], of which the axes have what is below the heading."""
    height = 2.0 * round(height * DPI / 2.0) / DPI
    figure.set_figheight(height)
    left, low = EDGE / figure.get_figwidth(), EDGE / height
    rect = (left, low, 1.0 - 2.0 * left, 1.0 - low - top / height)
    figure.set_layout_engine("constrained", rect=rect)
    for text in figure.texts:  # they were placed from the upper edge of another height
        text.set_y(1.0 - (1.0 - text.get_position()[1]) * FIRST / height)


def _legend_below(figure: Figure, entries: Entries) -> float:
    """Put a legend along the lower edge, and return its height [in]."""
    if not entries:
        return 0.0
    longest = max(min(len(name), style.NAME_LENGTH) for _, name in entries)
    most = int((figure.get_figwidth() - 2.0 * EDGE) / (style.CHARACTER * longest + 0.44))
    rows = math.ceil(len(entries) / max(1, min(len(entries), most)))
    legend = figure.legend(
        [handle for handle, _ in entries], [str(k) for k in range(len(entries))],
        loc="outside lower left", frameon=False, borderaxespad=1.0,
        ncols=math.ceil(len(entries) / rows), fontsize=style.SMALL_PT, borderpad=0.0,
        handlelength=1.8, columnspacing=1.6, labelspacing=0.45,
    )  # fmt: skip
    style.plain(legend, entries)
    with any_script():
        return float(legend.get_window_extent().height / figure.dpi)


@contextlib.contextmanager
def any_script() -> Iterator[None]:
    """No warning of a trim that is named in a script which the font lacks."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def settled(figure: Figure) -> Figure:
    """The figure laid out once, so that what moves later moves no axes."""
    engine = figure.get_layout_engine()
    if engine is not None:
        with any_script():
            engine.execute(figure)
        figure.set_layout_engine("none")
    return figure


def write_figure(figure: Figure, path: str | Path) -> None:
    """Write `figure` to `path`, by its ending (.png, .pdf, .svg; .png if there is none)."""
    target = Path(path)
    ending = target.suffix.lstrip(".").lower() or "png"
    stream = io.BytesIO()
    with any_script(), rc_context(VECTOR):
        if ending == "png":
            # `savefig` lays the figure out once more than this. The level is a fast one: the file
            # is hardly larger for it.
            canvas: Any = figure.canvas
            canvas.draw()
            pixels = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
            pixels.save(stream, format="png", dpi=(figure.dpi, figure.dpi), compress_level=2)
        else:
            figure.savefig(stream, format=ending, metadata=UNDATED.get(ending))
    write_bytes_atomically(target, stream.getvalue())
