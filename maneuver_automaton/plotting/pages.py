"""Figures as files: laid out in inches, rendered without a display, replaced in one step."""

from __future__ import annotations

import io
import math
import textwrap
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.plotting.colors import INK
from maneuver_automaton.plotting.look import HEAD_PT, TITLE_PT, Look
from maneuver_automaton.plotting.style import NAME_LENGTH, SMALL_PT, TEXT_PT, plain

DPI = 130
# text as text, in fonts that journals take; the same picture gives the same bytes
VECTOR: Any = {
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "picture",
}
UNDATED: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


def new_figure(width: float, height: float) -> Figure:
    """A figure of `width` and `height` [in] that belongs to no window."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def axes_at(figure: Figure, *, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes in `figure` whose inner box is given in inches."""
    wide, high = figure.get_size_inches()
    return figure.add_axes((left / wide, bottom / high, width / wide, height / high))


def stacked_axes(
    figure: Figure, count: int, *, left: float, bottom: float, width: float, height: float,
    gap: float = 0.16,
) -> list[Axes]:  # fmt: skip
    """`count` axes above each other in a box given in inches; the first is on top."""
    each = (height - gap * (count - 1)) / count
    return [
        axes_at(figure, left=left, bottom=bottom + k * (each + gap), width=width, height=each)
        for k in reversed(range(count))
    ]


def hide_times(column: Sequence[Axes]) -> None:
    """Leave the times to the axes below."""
    for ax in column:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)


def heading_text(figure: Figure, lines: Sequence[tuple[str, float, str]], *, left: float) -> None:
    """Lines of (text, size [pt], weight) from the upper left corner down, `left` in inches."""
    wide, high = figure.get_size_inches()
    top = 0.12
    for text, size, weight in lines:
        figure.text(
            left / wide, 1.0 - top / high, text, fontsize=size, fontweight=weight, color=INK,
            va="top", ha="left", parse_math=False, linespacing=1.25,
        )  # fmt: skip
        top += 1.42 * size / 72.0 * (1 + text.count("\n"))


def heading_height(lines: Sequence[tuple[str, float, str]]) -> float:
    """Height [in] that lines of `heading_text` take, from the upper edge down."""
    return 0.12 + sum(1.42 * size / 72.0 * (1 + text.count("\n")) for text, size, _ in lines)


def title_lines(look: Look, width: float, *others: str) -> list[tuple[str, float, str]]:
    """Lines of `heading_text`: the title, then `others`, the first of which is bold without one.

    All are wrapped to a `width` [in]. In a paper the title stands alone.
    """
    said = [look.title, *([] if look.is_paper else others)]
    shown = [(text, k) for k, text in enumerate(said) if text]
    lines = []
    for place, (text, k) in enumerate(shown):
        size = TITLE_PT if k == 0 else HEAD_PT if place == 0 else TEXT_PT
        most = max(20, int(width / ((0.0077 if place else 0.0092) * size)))
        lines.append((fill(text, most), size, "normal" if place else "bold"))
    return lines


def fill(text: str, most: int) -> str:
    """The text in lines of at most so many characters; lines that it has stay lines."""
    return "\n".join(textwrap.fill(line, most) for line in text.split("\n"))


def legend_rows(labels: Sequence[str], width: float, *, length: int = NAME_LENGTH) -> int:
    """Rows that a legend of `labels`, cut to a `length`, takes in `width` [in]."""
    return math.ceil(len(labels) / _columns(labels, width, length))


def bottom_legend(
    figure: Figure, handles: Sequence[Artist], labels: Sequence[str], *, left: float, width: float,
    length: int = NAME_LENGTH,
) -> None:  # fmt: skip
    """A legend in rows along the lower edge of `figure`, in a strip given in inches."""
    wide, high = figure.get_size_inches()
    legend = figure.legend(
        handles, [str(k) for k in range(len(labels))], loc="lower left", frameon=False,
        bbox_to_anchor=(left / wide, 0.06 / high), ncols=_columns(labels, width, length),
        fontsize=SMALL_PT, borderaxespad=0.0, borderpad=0.0, handlelength=1.8,
        columnspacing=1.6, labelspacing=0.45,
    )  # fmt: skip
    plain(legend, labels, length=length)


def write_figure(figure: Figure, path: str | Path) -> None:
    """Write `figure` to `path`, by its ending (.png, .pdf, .svg; .png if there is none).

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = Path(path)
    ending = target.suffix.lstrip(".").lower() or "png"
    stream = io.BytesIO()
    with warnings.catch_warnings(), rc_context(VECTOR):
        # a trim may be named in a script that the font lacks
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        if ending == "png":
            # a fast level: the size of the file hardly depends on it, the time does
            figure.savefig(stream, format="png", dpi=DPI, pil_kwargs={"compress_level": 2})
        else:
            figure.savefig(stream, format=ending, metadata=UNDATED.get(ending))
    write_bytes_atomically(target, stream.getvalue())


def _columns(labels: Sequence[str], width: float, length: int) -> int:
    longest = max((min(len(label), length) for label in labels), default=1)
    most = max(1, min(len(labels), int(width / (0.062 * longest + 0.44))))
    return math.ceil(len(labels) / math.ceil(len(labels) / most))
