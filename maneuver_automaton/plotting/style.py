"""The look that all pictures share: sizes, thin axes, and legends that show names as they are."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, ScalarFormatter

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK, Color

TEXT_PT = 9.0
SMALL_PT = 8.0
FAR_M = 1e5  # from here on coordinates are counted from a round number
NAME_LENGTH = 60  # characters of a name before it is cut
Entries = Sequence[tuple[Artist, str]]
"""What a legend shows: handles and names."""

LEAST_SHARE = 0.3  # of the width of axes that a legend beside them leaves
CHARACTER = 0.062  # [in] of a character in a legend


def tidy(ax: Axes, *, x: str, y: str) -> None:
    """Label the axes, keep two of the four spines, and draw a faint grid."""
    ax.set_xlabel(x, fontsize=TEXT_PT, color=INK, parse_math=False)
    ax.set_ylabel(y, fontsize=TEXT_PT, color=INK, parse_math=False)
    if ax.xaxis.get_tick_params().get("labelsize") == SMALL_PT:
        return  # they are tidy
    ax.tick_params(labelsize=SMALL_PT, color=GREY, labelcolor=INK, length=3.0, width=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(color=GREY, linewidth=0.6)
    ax.grid(visible=True, color=GREY, alpha=0.22, linewidth=0.5)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(formatter := axis.get_major_formatter(), ScalarFormatter):
            formatter.set_useOffset(False)


def count_from_near(ax: Axes, place: Array) -> None:
    """Number far-away axes from a round number near `place` (2,), which their label names."""
    for axis, coordinate in ((ax.xaxis, place[0]), (ax.yaxis, place[1])):
        if abs(coordinate) >= FAR_M:
            origin = float(round(coordinate, -3))
            axis.set_major_formatter(
                FuncFormatter(lambda tick, _, origin=origin: f"{tick - origin:.6g}")
            )
            axis.set_label_text(f"{axis.get_label_text()} from {origin:.0f}")


def shortened(text: str, length: int = NAME_LENGTH) -> str:
    """`text`, its middle left out if it is longer than `length`."""
    if len(text) <= length:
        return text
    tail = (length - 1) // 3
    return f"{text[: length - 1 - tail]}…{text[-tail:]}"


def line_handle(color: Color, *, width: float = 2.6, marker: str = "") -> Line2D:
    """A legend handle: a short line, or a hollow `marker` instead."""
    if marker:
        return Line2D(
            [], [], linestyle="none", marker=marker, markersize=8.0, color=color,
            markerfacecolor="none", markeredgewidth=1.8,
        )  # fmt: skip
    return Line2D([], [], color=color, linewidth=width, solid_capstyle="butt")


def dashed_handle(color: Color, style: Any, *, width: float) -> Line2D:
    """A legend handle: a short line of a style."""
    handle = line_handle(color, width=width)
    handle.set_linestyle(style)
    return handle


def mark_handle(marker: str, *, size: float, edge: Color = INK, face: Any = "white") -> Line2D:
    """A legend handle: a marker with an edge."""
    return Line2D(
        [], [], linestyle="none", marker=marker, markersize=size, markeredgecolor=edge,
        markerfacecolor=face, markeredgewidth=1.3 if marker == "D" else 1.0,
    )  # fmt: skip


def plain(legend: Legend, entries: Entries) -> Legend:
    """The `legend` with names as they are: no mathematics, no hidden leading underscore."""
    for text, (_, label) in zip(legend.get_texts(), entries, strict=True):
        text.set_parse_math(False)
        text.set_text(shortened(label))
    return legend


def outer_legend(ax: Axes, entries: Entries) -> Legend:
    """A legend right of `ax`, which makes room unless a layout engine does."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    place = ax.get_position()
    longest = max((min(len(name), NAME_LENGTH) for _, name in entries), default=1)
    width = place.width - (CHARACTER * longest + 0.6) / figure.get_figwidth()
    if figure.get_layout_engine() is None and width > LEAST_SHARE * place.width:
        ax.set_position((place.x0, place.y0, width, place.height))
    legend = ax.legend(
        [handle for handle, _ in entries], [str(k) for k in range(len(entries))],
        loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize=SMALL_PT, frameon=False,
        borderaxespad=0.0, borderpad=0.1, labelspacing=0.3, columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip
    return plain(legend, entries)


_BY_UNIT = {
    "m/s": "speed lateral_speed speed_ahead speed_aside climb",
    "rad/s": "turn_rate steering_rate articulation_rate tilt_rate lateral_tilt_rate",
    "rad": "steering front_steering rear_steering articulation hitch hitch_2 hitch_3 tilt "
    "lateral_tilt",
    "m/s²": "acceleration climb_acceleration",
    "rad/s²": "angular_acceleration",
    "1": "heading_cos heading_sin",
    "N": "force",
    "N m": "torque",
}
UNITS = {name: unit for unit, names in _BY_UNIT.items() for name in names.split()}
ARROW = " → "
POLISHED = "polished"  # what planning calls a motion by optimal control


def control_labels(names: Sequence[str]) -> list[str]:
    """Axis labels of controls: words, with the unit of those whose name says what they are."""
    return [
        name.replace("_", " ") + (f" [{UNITS[name]}]" if name in UNITS else "") for name in names
    ]


def shown_name(name: str) -> str:
    """The name of a trim or maneuver as pictures show it: "polished" alone says little."""
    head, comma, rest = name.partition(",")
    return f"{head} motion{comma}{rest}" if head == POLISHED else name


def word_text(word: Sequence[str], *, width: int, lines: int) -> str:
    """A word in at most `lines` of `width` characters, its middle left out if it is longer."""
    if not word:
        return "no motion"
    if list(word) == [POLISHED]:
        return "one motion by optimal control"
    names = [shortened(shown_name(name), 80) for name in word]
    whole = textwrap.wrap(ARROW.join(names), width, break_long_words=False)
    if len(whole) <= lines or len(names) < 4:
        return "\n".join(whole)
    room, head = width * lines - 16, 1
    tail = names[-2:] if len(ARROW.join([names[0], "…", *names[-2:]])) < room else names[-1:]
    while len(ARROW.join([*names[: head + 1], "…", *tail])) < room and head < len(names) - 3:
        head += 1
    cut = ARROW.join([*names[:head], "…", *tail]) + f" ({len(names)} trims)"
    return "\n".join(textwrap.wrap(cut, width, break_long_words=False))
