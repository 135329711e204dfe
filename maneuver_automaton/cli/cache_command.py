"""`cache show`, `cache clear`: files that can be made again; `compile`: kernels made now."""

from __future__ import annotations

import contextlib
import shutil
import time
from pathlib import Path

from maneuver_automaton._cache_files import files_of
from maneuver_automaton._compile_all import compile_missing
from maneuver_automaton._kernel_folders import (
    KERNELS,
    kernel_base,
    kernel_folder,
    user_cache_folder,
)
from maneuver_automaton._kernel_list import listed
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain
from maneuver_automaton.cli.inputs import writing
from maneuver_automaton.cli.terminal import console, table
from maneuver_automaton.search.cost_to_go import FOLDER, MOST_BYTES

MEGABYTE = 1e6  # [bytes]
CACHE = "MANEUVER_AUTOMATON_CACHE_DIR"


def show() -> int:
    """List the folders of the cache, with what they hold."""
    now = kernel_folder()
    rows = []
    for folder in _folders():
        files = files_of([folder])
        size = sum(status.st_size for _, status in files) / MEGABYTE
        what = "compiled kernels" if folder == now else "compiled kernels of another version"
        if folder.name == FOLDER:
            what = f"tables of the cost to go, at most {MOST_BYTES / MEGABYTE:g} MB"
        rows.append([what, str(len(files)), f"{size:.1f}", str(folder)])
    columns = ["", "files", "MB", "folder"]
    console().print(table("", columns, rows, numbers=(1, 2)), soft_wrap=True)
    return FOUND


def clear() -> int:
    """Remove what the cache holds; it is made again when it is needed."""
    folders = _folders()
    size = sum(status.st_size for _, status in files_of(folders)) / MEGABYTE
    for folder in folders:
        with writing(folder):
            shutil.rmtree(folder)
    console().print(f"{size:.1f} MB removed", soft_wrap=True)
    return FOUND


def _folders() -> list[Path]:
    """What this package made in its cache folders, of this version and of others."""
    found: list[Path] = []
    with contextlib.suppress(OSError, RuntimeError):  # no home folder
        found += sorted(kernel_base().glob(f"{KERNELS}*"))
        if kernel_base() != user_cache_folder():
            found += sorted(user_cache_folder().glob(f"{KERNELS}*"))
        found.append(user_cache_folder() / FOLDER)
    return [folder for folder in found if folder.is_dir() and not folder.is_symlink()]


def compile_all(*, jobs: int | None) -> int:
    """Compile what is missing in the user's cache, and say where it lies."""
    began = time.perf_counter()
    failed = compile_missing(jobs=jobs)
    if failed is None:
        complain(f"compile: no folder can be written; {CACHE} names another one")
        return BAD_INPUT
    for failure in failed:
        complain(failure)
    took = time.perf_counter() - began
    line = f"{len(listed()) - len(failed)} kernels are compiled, after {took:.1f} s: "
    console().print(f"{line}{kernel_folder()}", soft_wrap=True)
    return BAD_INPUT if failed else FOUND
