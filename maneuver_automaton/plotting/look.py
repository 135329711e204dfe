"""How a picture is to look: its title, its size, and whether it is for a screen or a paper."""

from __future__ import annotations

import math
from dataclasses import dataclass

WIDTHS = {"screen": 9.6, "paper": 7.16}  # [in]; a paper's is that of two columns
LEAST, MOST = 2.5, 40.0  # [in] of either side
NARROW = 6.0  # [in] in which nothing has room beside the plane
TITLE_PT, HEAD_PT = 11.0, 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Title, size and style of a picture.

    Parameters
    ----------
    title : str
        The first line, above the numbers.
    size : (width, height), optional
        Of the page [in]; the height None follows from what is shown, and a page too low for all
        leaves out what is over time. If left out, the page is 9.6 in wide, or 7.16 in, two
        columns, in a paper.
    style : str
        "screen", or "paper": numbers and word are left to the caption.

    numbered : bool
        Whether the bodies of several vehicles are numbered by their times.

    Examples
    --------
    >>> Look(style="paper", size=(3.5, None)).width, Look().width
    (3.5, 9.6)
    """

    title: str = ""
    size: tuple[float, float | None] | None = None
    style: str = "screen"
    numbered: bool = False

    def __post_init__(self) -> None:
        if self.style not in WIDTHS:
            raise ValueError(f"style: got {self.style!r}, need one of {', '.join(WIDTHS)}")
        for side in self.size or ():
            if side is not None and not (math.isfinite(side) and LEAST <= side <= MOST):
                raise ValueError(f"size: got {side} in, need from {LEAST:g} to {MOST:g} in")

    @property
    def width(self) -> float:
        """Width of the page [in]."""
        return WIDTHS[self.style] if self.size is None else self.size[0]

    @property
    def height(self) -> float | None:
        """Height of the page [in]; None if it follows from what is shown."""
        return None if self.size is None else self.size[1]

    @property
    def is_narrow(self) -> bool:
        """Whether the page is a single column."""
        return self.width < NARROW

    @property
    def is_paper(self) -> bool:
        """Whether what a caption tells is left out."""
        return self.style == "paper"


def size_of(text: str) -> tuple[float, float | None]:
    """The size that a text such as 7.16 or 7.16x3 states [in]."""
    width, times, height = text.lower().partition("x")
    try:
        return float(width), float(height) if times else None
    except ValueError:
        raise ValueError(f"size: got {text!r}, need WIDTH or WIDTHxHEIGHT in inches") from None
