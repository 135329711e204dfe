"""Figures as files: pages of a plane and panels, drawn without a display, replaced in one step."""

from __future__ import annotations

import contextlib
import io
import math
import struct
import textwrap
import warnings
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import LayoutEngine

from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.plotting.colors import INK
from maneuver_automaton.plotting.look import HEAD_PT, TITLE_PT, Look
from maneuver_automaton.plotting.style import (
    CHARACTER,
    NAME_LENGTH,
    SMALL_PT,
    TEXT_PT,
    Entries,
    plain,
)

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
ROW, APART = 0.177, 0.042  # [in] of a legend, and around axes and labels


def _title_lines(look: Look, width: float, *others: str) -> list[tuple[str, float, str]]:
    """Lines of (text, size [pt], weight): the title, then `others`, the first bold without one."""
    said = [look.title, *([] if look.is_paper else others)]
    shown = [(text, k) for k, text in enumerate(said) if text]
    lines = []
    for place, (text, k) in enumerate(shown):
        size = TITLE_PT if k == 0 else HEAD_PT if place == 0 else TEXT_PT
        most = max(20, int(width / ((0.0077 if place else 0.0092) * size)))
        filled = "\n".join(textwrap.fill(line, most) for line in text.split("\n"))
        lines.append((filled, size, "normal" if place else "bold"))
    return lines


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """A figure with its axes: the plane, and what is over time, beside or below it."""

    figure: Figure
    plane: Any  # Axes, or Axes3D
    panels: tuple[Axes, ...]
    is_stacked: bool  # the panels stand above each other


class Snug(LayoutEngine):
    """Gives axes of one mosaic what numbers and labels, looked at once, leave of a page.

    Matplotlib's own engine looks at them four times, which takes longer than to draw them.
    """

    _adjust_compatible = _colorbar_gridspec = False

    def __init__(self, top: float, foot: float) -> None:
        super().__init__()
        self.ends = ((EDGE, EDGE), (top, foot))  # [in] beside, and above and below all axes

    def execute(self, fig: Any) -> None:
        """Give the axes and their labels their places."""
        beyond, labels, cells, edges = [], [], [], []  # [px]
        apart = APART * fig.dpi
        for ax in fig.axes:
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_label_coords(0.5, 0.5)  # in the axes, until it is known how far outside
            one, inner = ax.get_subplotspec(), ax.bbox
            outer = ax.get_tightbbox(for_layout_only=True)
            high = ax.xaxis.label.get_window_extent().height + apart * bool(ax.get_xlabel())
            wide = ax.yaxis.label.get_window_extent().width + apart * bool(ax.get_ylabel())
            across = inner.x0 - outer.x0, outer.x1 - inner.x1
            beyond.append((across, (outer.y1 - inner.y1, inner.y0 - outer.y0)))
            labels.append(((wide, 0.0), (0.0, high)))
            cells.append([(span[0], span[-1]) for span in (one.colspan, one.rowspan)])
        numbers, grid = np.array(beyond) + apart, one.get_gridspec()
        for k, ratios in enumerate((grid.get_width_ratios(), grid.get_height_ratios())):
            begin, end = (fig.dpi * room for room in self.ends[k])
            place, room = ([one[k] for one in cells], [0, 1]), np.zeros((len(ratios), 2))
            np.maximum.at(room, place, (numbers + labels)[:, k])
            sizes = (fig.bbox.size[k] - begin - end - room.sum()) * np.divide(ratios, sum(ratios))
            ends = begin + np.cumsum(np.insert(room, 1, sizes, axis=1)).reshape(-1, 3)
            edges.append(ends[place] / fig.bbox.size[k])
        for ax, (x0, x1), (y0, y1), needed in zip(fig.axes, *edges, numbers, strict=True):
            ax.set_position((x0, 1.0 - y1, x1 - x0, y1 - y0))
            ax.apply_aspect()
            ax.xaxis.set_label_coords(0.5, -needed[1, 1] / ax.bbox.height)
            ax.yaxis.set_label_coords(-needed[0, 0] / ax.bbox.width, 0.5)


def page_of(
    look: Look, lines: Sequence[str], legend: Entries, *, shape: float, panels: Sequence[float] = ()
) -> Page:
    """A page with a heading of some lines, a legend along its lower edge, a plane, and panels.

    The plane is `shape` times as wide as high; `panels` are their heights, compared with others'.
    They stand beside the plane, or below it if that is flat or the page narrow. A page whose stated
    height leaves too little room has none.
    """
    figure, top, foot = _framed(look, lines, legend)
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
    figure.set_layout_engine(Snug(top, foot + 2.0 * APART))
    count = len(panels)
    if flat:
        names: list[Any] = [
            [str(k) if k < count else "." for k in range(first, first + columns)]
            for first in range(0, count, columns)
        ]
        heights = [high, *[panel] * rows]
        axes = figure.subplot_mosaic([["plane"] * columns, *names], height_ratios=heights)
    else:
        axes = figure.subplot_mosaic(
            [["plane", str(k)] for k in range(count)],
            width_ratios=(PLANE, 1.0 - PLANE),
            height_ratios=list(panels),
        )
    over_time = tuple(axes[str(k)] for k in range(count))
    return Page(figure, axes["plane"], over_time, is_stacked=not flat or columns == 1)


def space_page(look: Look, lines: Sequence[str], legend: Entries, *, shape: float) -> Page:
    """A page with axes in space above two of the plane, each `shape` times as wide as high."""
    figure, top, foot = _framed(look, lines, legend)
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
    figure, top = _headed(look, lines, width)
    _settle(figure, look.height or top + height, top)
    return figure, figure.subplot_mosaic(mosaic, empty_sentinel="", **ratios)


def _framed(look: Look, lines: Sequence[str], legend: Entries) -> tuple[Figure, float, float]:
    """A figure with heading and legend, and the heights [in] that these take."""
    figure, top = _headed(look, lines, look.width)
    return figure, top, _legend_below(figure, legend) + EDGE


def _headed(look: Look, lines: Sequence[str], width: float) -> tuple[Figure, float]:
    """A figure with a heading from the upper left corner down, and the height [in] of that."""
    figure, top = Figure(figsize=(width, FIRST), dpi=DPI, facecolor="white"), EDGE
    FigureCanvasAgg(figure)  # it belongs to no window
    for text, size, weight in _title_lines(look, width - 2.0 * EDGE, *lines):
        figure.text(
            EDGE / width, 1.0 - top / FIRST, text, fontsize=size, fontweight=weight, color=INK,
            va="top", ha="left", parse_math=False, linespacing=1.25,
        )  # fmt: skip
        top += 1.42 * size / 72.0 * (1 + text.count("\n"))
    return figure, top + 0.5 * EDGE


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
    longest = max(min(len(name), NAME_LENGTH) for _, name in entries)
    most = int((figure.get_figwidth() - 2.0 * EDGE) / (CHARACTER * longest + 0.44))
    rows = math.ceil(len(entries) / max(1, min(len(entries), most)))
    legend = figure.legend(
        [handle for handle, _ in entries], [str(k) for k in range(len(entries))],
        loc="outside lower left", frameon=False, borderaxespad=1.0,
        ncols=math.ceil(len(entries) / rows), fontsize=SMALL_PT, borderpad=0.0, handlelength=1.8,
        columnspacing=1.6, labelspacing=0.45,
    )  # fmt: skip
    plain(legend, entries)
    return ROW * rows - 0.05


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
            stream.write(_png(figure))
        else:
            figure.savefig(stream, format=ending, metadata=UNDATED.get(ending))
    write_bytes_atomically(target, stream.getvalue())


def _png(figure: Figure) -> bytes:
    """The figure as a PNG; no row by the one above, which is quicker, and no larger for lines."""
    canvas: Any = figure.canvas
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    (high, wide), dots = pixels.shape[:2], round(figure.dpi / 0.0254)  # of a meter
    parts = {
        b"IHDR": struct.pack(">IIBBBBB", wide, high, 8, 2, 0, 0, 0),
        b"pHYs": struct.pack(">IIB", dots, dots, 1),
        b"IDAT": zlib.compress(np.pad(pixels.reshape(high, -1), ((0, 0), (1, 0))).tobytes(), 2),
        b"IEND": b"",
    }
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts.items()
    )
