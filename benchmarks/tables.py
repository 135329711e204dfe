"""Tables and spreads, as the benchmarks print them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np


def show(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows under a header; the first column to the left, the others to the right."""
    cells = [list(header), *([_cell(value) for value in row] for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    for number, row in enumerate(cells):
        padded = [
            word.ljust(width) if k == 0 else word.rjust(width)
            for k, (word, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(padded).rstrip())
        if number == 0:
            print("  ".join("-" * width for width in widths))


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, float):
        return (
            "-" if not math.isfinite(value) else f"{value:.4g}" if value < 1e3 else f"{value:.0f}"
        )
    return str(value)


def spread(values: Iterable[float], *, percentiles: Sequence[float] = (50, 90, 99, 100)) -> str:
    """Percentiles of the finite values in one line; the number of others, if any."""
    drawn = np.array(list(values), dtype=float)
    finite = drawn[np.isfinite(drawn)]
    if not finite.size:
        return "no value"
    names = {50: "median", 100: "max"}
    words = [f"{names.get(p, f'p{p:g}')} {np.percentile(finite, p):.4g}" for p in percentiles]
    missing = drawn.size - finite.size
    return ", ".join(words) + (f" ({missing} without)" if missing else "")


def median(values: Iterable[float]) -> float:
    """Median of the finite values, inf if there are none."""
    finite = [value for value in values if math.isfinite(value)]
    return float(np.median(finite)) if finite else math.inf


def verdict(met: bool) -> str:
    return "met" if met else "NOT MET"
