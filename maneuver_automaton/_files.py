"""Files that are whole or not there: write beside the target, then replace it."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import time
import uuid
from pathlib import Path
from typing import BinaryIO

PART = ".part-"  # what the names of files begin with that are not whole yet
OLD = 3600.0  # [s] since a part was written: whoever wrote it was killed


def open_input(path: Path) -> BinaryIO:
    """Open a file to read it; a pipe or a device, which may never end, is none."""
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "it is a pipe or a device, need a file", str(path))
    return path.open("rb")


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Replace the file `path` by `content` in one step; missing folders are made.

    A reader sees the old file or the new one, never a part; on failure the old one stays.
    """
    target = path.resolve()  # a link keeps pointing where it points
    target.parent.mkdir(parents=True, exist_ok=True)
    for part in target.parent.glob(f"{PART}*"):  # left by processes that were killed
        with contextlib.suppress(OSError):
            if time.time() - part.stat().st_mtime > OLD:
                part.unlink()
    beside = target.parent / f"{PART}{uuid.uuid4().hex}"
    try:
        with beside.open("xb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        with contextlib.suppress(FileNotFoundError):
            beside.chmod(target.stat().st_mode & 0o777)  # keep the permissions of what is replaced
        beside.replace(target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            beside.unlink()
        if isinstance(error, OSError):
            error.filename = str(path)  # not of the part, of which nobody knows
        raise


def write_text_atomically(path: Path, text: str) -> None:
    """Replace the file `path` by `text` in UTF-8 in one step; see `write_bytes_atomically`."""
    write_bytes_atomically(path, text.encode("utf-8"))


def relative(path: Path, folder: Path) -> str:
    """The path as seen from a folder, with the slashes of every system."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive
        return path.absolute().as_posix()
