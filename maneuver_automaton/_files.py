"""Files that are whole or not there, written beside the target first; journals, line by line."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
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

    A reader sees the old file or the new one, never a part; on failure the old one stays. A device
    or a pipe is written to, not replaced.
    """
    target = path.resolve()  # a link keeps pointing where it points
    target.parent.mkdir(parents=True, exist_ok=True)
    for part in target.parent.glob(f"{PART}*"):  # left by processes that were killed
        with contextlib.suppress(OSError):
            if time.time() - part.stat().st_mtime > OLD:
                part.unlink()
    beside = target.parent / f"{PART}{uuid.uuid4().hex}"
    try:
        if target.exists() and not target.is_file():
            target.write_bytes(content)
            return
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


def stem_of(path: Path) -> str:
    """The name of a file without its ending; bytes that are not UTF-8 are spelled out."""
    return path.stem.encode("utf-8", "backslashreplace").decode("utf-8")


def journal_lines(path: Path) -> list[str]:
    """The whole lines of a journal, without one that a kill cut off; none if it is not there."""
    text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
    return text.split("\n")[:-1]


@contextlib.contextmanager
def journal(path: Path, head: str = "") -> Iterator[Callable[[Sequence[str]], None]]:
    """What writes lines to a journal, each on the disk at once; one that was cut off is removed.

    A journal that is empty begins with the line `head`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as stream:
        stream.seek(0)
        stream.truncate(stream.read().rfind(b"\n") + 1)

        def write(lines: Sequence[str]) -> None:
            stream.write("".join(f"{line}\n" for line in lines).encode())
            stream.flush()
            os.fsync(stream.fileno())

        if head and not stream.seek(0, os.SEEK_END):
            write([head])
        yield write


def relative(path: Path, folder: Path) -> str:
    """The path as seen from a folder, with the slashes of every system."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # on another drive
        return path.absolute().as_posix()
