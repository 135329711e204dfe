"""Before pictures are drawn: the command line draws, and reads no documentation."""

from __future__ import annotations


def skip_documentation() -> None:
    """Have Matplotlib write none for its classes, which is a fifth of its import."""
    from matplotlib import artist

    artist.kwdoc = _nothing  # type: ignore[assignment]


def _nothing(_: object) -> str:
    return ""
