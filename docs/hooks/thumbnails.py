"""Thumbnails of the gallery, drawn for the size at which it shows them.

``python docs/hooks/thumbnails.py`` draws them from the plans that are kept in docs/plans; names of
scenarios may follow. Each shows the plane alone and a bar of scale: no title, axes or legend.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from maneuver_automaton import plotting

ROOT = Path(__file__).parents[2]
FOLDER = "pictures/thumbnails"  # in docs
SIZE_IN, DPI = (3.2, 2.1), 200  # shown at 240 to 320 pixels: text of 10 pt is 10 to 14 of them high
TEXT_PT, BAR_SHARE = 10.0, 0.28  # of the width, at most, that the bar of scale takes
STRIP, MARGIN = 0.12, 0.03  # of the picture: below the plane, and beside the bar
DECADE = (5.0, 2.0, 1.0)


def thumbnail(value: Any, path: Path) -> None:
    """Write the thumbnail of a plan, a closed loop, or those of several vehicles."""
    figure = Figure(figsize=SIZE_IN, dpi=DPI)
    ax = figure.add_axes((0.0, STRIP, 1.0, 1.0 - STRIP))
    plotting.draw_plane(ax, value, legend=False)
    ax.set_axis_off()
    _scale(figure, ax)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    path.parent.mkdir(parents=True, exist_ok=True)
    few = Image.open(drawn).convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE)
    few.save(path, optimize=True)


def _scale(figure: Figure, ax: Axes) -> None:
    """A bar of a round length below the plane, and how long it is."""
    ax.apply_aspect()
    left, right = ax.get_xlim()
    most = BAR_SHARE * (right - left)
    decades = (10.0**k for k in range(6, -7, -1))
    length = next(part * ten for ten in decades for part in DECADE if part * ten <= most)
    end = MARGIN + length / (right - left)
    bar = Line2D([MARGIN, end], [STRIP / 2] * 2, color="black", linewidth=2.0)
    figure.add_artist(bar)
    figure.text(end + MARGIN, STRIP / 2, f"{length:g} m", fontsize=TEXT_PT, va="center_baseline")


def main(names: Collection[str]) -> None:
    """Draw those that are named, or all."""
    import gallery

    for kept in sorted(gallery.PLANS.glob("*.json.gz")):
        stem = kept.name.split(".")[0]
        if not names or stem in names:
            thumbnail(gallery.value_of(kept), ROOT / "docs" / FOLDER / f"{stem}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
