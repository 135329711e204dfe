"""Compiled kernels on disk: whatever is wrong with a file, its kernel is compiled again.

numba's own cache raises where a file is damaged or a disk is full, and unpickles, which can run any
code, whatever lies in its folder. Here a file holds one signature of one kernel, behind a checksum,
and is read only if nobody but the user or the installer can have written it.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.core.types.containers import BaseTuple

from maneuver_automaton._cache_files import read_checked, say_once, write_checked

ENDING = ".nbc"
FORMAT = 1  # of the files; counts into their names


class KernelCache:
    """The cache of one kernel, as numba's dispatcher asks for it."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        """`function` as Python has it.

        Raises
        ------
        OSError
            If its source is not in a file.
        """
        code = function.__code__
        self.folder = folder
        self.name = f"{function.__module__}.{function.__qualname__}".replace("<locals>.", "")
        closed = [cell.cell_contents for cell in function.__closure__ or ()]
        self.made_from = (
            (FORMAT, numba.__version__, sys.version_info[:2], getattr(sys, "abiflags", "")),
            (_source_digest(code.co_filename), code.co_firstlineno, code.co_code.hex()),
            dumps(closed).hex() if closed else "",
        )

    @property
    def cache_path(self) -> str:
        """The folder of the files."""
        return str(self.folder)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """What was compiled for a signature; None if that is not to be had."""
        target_context.refresh()
        path = self._path(signature, target_context.codegen())
        try:
            content = read_checked(path, trusted=True)
            if content is None:
                return None
            stated, payload = pickle.loads(content)
            if stated == signature:
                return CompileResult._rebuild(target_context, *payload)
        except Exception as error:  # noqa: BLE001, the kernel is compiled whatever is wrong here
            say_once("damaged", f"{path}: {error or type(error).__name__}: compiled again")
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, if it can be kept."""
        if compiled.library.has_dynamic_globals or any(
            not one.can_cache for one in compiled.lifted
        ):
            return
        path = self._path(signature, compiled.codegen)
        try:
            write_checked(path, dumps((signature, compiled._reduce())))
        except OSError as error:
            why = error.strerror or error
            say_once("not kept", f"{self.folder}: compiled kernels cannot be kept here: {why}")

    def _path(self, signature: Any, codegen: Any) -> Path:
        places = _places(getattr(signature, "args", signature))
        key = repr((self.made_from, codegen.magic_tuple(), signature, places))
        return self.folder / f"{self.name}-{hashlib.sha256(key.encode()).hexdigest()[:24]}{ENDING}"


def _places(kinds: Any) -> list[str]:
    """The modules that types are from: numba fails to load code for structures that have moved."""
    found = []
    for kind in kinds:
        if isinstance(kind, BaseTuple):
            place = getattr(kind, "instance_class", tuple).__module__
            found += [place, *_places(kind.types)]
    return found


@functools.cache
def _source_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
