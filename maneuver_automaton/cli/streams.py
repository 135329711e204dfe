"""Standard streams that may be closed, full or left by their reader: the exit code stays true."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO


class Output(io.TextIOBase):
    """Standard output that keeps what went wrong with it in `failure` instead of raising."""

    def __init__(self, stream: TextIO | None) -> None:
        self.stream = stream
        self.failure: OSError | None = None
        if stream is not None and hasattr(stream, "reconfigure"):
            with contextlib.suppress(ValueError):  # it is closed
                stream.reconfigure(errors="replace")  # names may hold what a terminal cannot show

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the stream."""
        return getattr(self.stream, "encoding", None) or "utf-8"

    def write(self, text: str) -> int:
        """Write, as long as it works."""
        if self.stream is not None and self.failure is None:
            with self._failing():
                self.stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Hand on what was written."""
        if self.stream is not None and self.failure is None:
            with self._failing():
                self.stream.flush()

    def isatty(self) -> bool:
        """Whether a person reads it."""
        try:
            return self.stream is not None and self.stream.isatty()
        except ValueError:  # it is closed
            return False

    def fileno(self) -> int:
        """Of the stream."""
        if self.stream is None:
            raise OSError("the stream is closed")
        return self.stream.fileno()

    @contextlib.contextmanager
    def _failing(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError) as error:
            self.failure = error if isinstance(error, OSError) else OSError(str(error))
            suppressed = contextlib.suppress(OSError, AttributeError, ValueError)
            with suppressed, Path(os.devnull).open("w") as nowhere:
                os.dup2(nowhere.fileno(), self.fileno())  # or the flush at exit would fail, too


@contextlib.contextmanager
def safe_streams() -> Iterator[tuple[Output, Output]]:
    """Standard output and error that never raise, for the time of a block."""
    before = sys.stdout, sys.stderr
    out, err = Output(sys.stdout), Output(sys.stderr)
    sys.stdout, sys.stderr = out, err
    try:
        yield out, err
    finally:
        out.flush()
        err.flush()
        sys.stdout, sys.stderr = before


def open_closed_streams() -> None:
    """Have something behind the numbers 0 to 2, or the next file opened would get what is said."""
    with contextlib.suppress(OSError):
        while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
            continue
        os.close(number)
