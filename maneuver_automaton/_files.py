"""Files that are whole or not there: write beside the target, then replace it."""

from __future__ import annotations

import contextlib
import os
import uuid
from pathlib import Path


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Replace the file `path` by `content` in one step; missing folders are made.

    A reader sees the old file or the new one, never a part; on failure the old one stays.

    Raises
    ------
    OSError
        If the folder cannot be made or written.
    """
    target = path.resolve()  # a link keeps pointing where it points
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.parent / f".part-{uuid.uuid4().hex}"
    try:
        with beside.open("xb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        with contextlib.suppress(FileNotFoundError):
            beside.chmod(target.stat().st_mode & 0o777)  # keep the permissions of what is replaced
        beside.replace(target)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise


def write_text_atomically(path: Path, text: str) -> None:
    """Replace the file `path` by `text` in UTF-8 in one step; see `write_bytes_atomically`."""
    write_bytes_atomically(path, text.encode("utf-8"))
