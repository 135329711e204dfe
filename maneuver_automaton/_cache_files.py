"""Files that can be made again: with a checksum, from nobody but the user, within a size."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import stat
import uuid
from collections.abc import Iterable
from pathlib import Path

DIGEST = hashlib.sha256().digest_size  # [bytes] in front of the content
PLAINLY = "kernels are compiled as numba does by itself, which takes longer"
LOG = logging.getLogger("maneuver_automaton")

_said: set[str] = set()


def say_once(kind: str, text: str) -> None:
    """Log one warning of a kind in a process: a line on stderr where no handler is set up."""
    if kind not in _said:
        _said.add(kind)
        LOG.warning(text)


def read_checked(path: Path, *, trusted: bool = False) -> bytes | None:
    """The content of a file of `write_checked`; None if there is none.

    `trusted` is for content that is code: the file must be the user's or the installer's.
    """
    try:
        with path.open("rb") as stream:
            if trusted and (why := distrusted(os.fstat(stream.fileno()))):
                raise ValueError(f"it is {why}")
            content = stream.read()
    except FileNotFoundError:
        return None
    if hashlib.sha256(content[DIGEST:]).digest() != content[:DIGEST]:
        raise ValueError("it is not what was written")
    return content[DIGEST:]


def write_checked(path: Path, content: bytes) -> None:
    """Write `content` behind its checksum, in one step; nobody but the owner may write the file."""
    beside = path.with_name(f".part-{uuid.uuid4().hex}")
    handle = os.open(
        beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644
    )
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(hashlib.sha256(content).digest() + content)
        beside.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise


def distrusted(status: os.stat_result, *, shared: bool = False) -> str:
    """Why a file or folder may hold the code of somebody else; empty if it does not.

    A `shared` folder is one that the group may write, or all, each their own files: what lies in
    it is looked at as well.
    """
    if os.name != "posix":
        return ""
    package = Path(__file__).stat().st_uid
    if status.st_uid not in (os.geteuid(), package, 0):
        return f"owned by another user ({status.st_uid})"
    if shared:
        others = 0 if status.st_mode & stat.S_ISVTX else stat.S_IWOTH
    else:
        others = stat.S_IWGRP | stat.S_IWOTH
    if status.st_mode & others:
        return f"writable by others (mode {stat.S_IMODE(status.st_mode):o})"
    return ""


def keep_within(folder: Path, most: int) -> None:
    """Remove the files of a folder that were used least recently, until `most` bytes are left."""
    files = sorted(files_of([folder]), key=lambda one: one[1].st_mtime, reverse=True)
    total = 0
    for path, status in files:
        total += status.st_size
        if total > most:
            with contextlib.suppress(OSError):
                path.unlink()


def used_now(path: Path) -> None:
    """Note that a file was used, for `keep_within`."""
    with contextlib.suppress(OSError):
        os.utime(path)


def files_of(folders: Iterable[Path]) -> list[tuple[Path, os.stat_result]]:
    """Every file below `folders`, with its size and times; what cannot be read is left out."""
    found = []
    for folder in folders:
        for place, _, names in os.walk(folder):
            for name in names:
                with contextlib.suppress(OSError):
                    path = Path(place) / name
                    found.append((path, path.lstat()))
    return found
