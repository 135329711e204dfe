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
from llvmlite.binding import add_symbol
from numba.core.compiler import CompileResult
from numba.core.runtime import _nrt_python
from numba.core.serialize import dumps
from numba.core.types.containers import BaseTuple

from maneuver_automaton._cache_files import read_checked, say_once, write_checked
from maneuver_automaton._compile_all import compile_missing, processors
from maneuver_automaton._kernel_folders import shipped_folder
from maneuver_automaton._kernel_list import (
    compiled_with,
    kernel_named,
    kernel_names,
    later_uses,
    signatures_of,
)

ENDING = ".nbc"
OTHER = "made for another processor, Python or numba: kernels are compiled anew, once"
FORMAT = 3  # of the files; counts into their names


class KernelCache:
    """The cache of one kernel, as numba's dispatcher asks for it."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        """`function` as Python has it."""
        code = function.__code__
        self.folder, self.function = folder, function
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
        _find_memory()
        found = self._found(signature, target_context)
        if (
            found is None
            and _is_listed(self.name, signature)
            and _compiled(tuple(compiled_with(self.name)))
        ):
            found = self._found(signature, target_context)
        return found

    def _found(self, signature: Any, target_context: Any) -> Any:
        own = target_context.codegen().magic_tuple()
        places = [(self.folder, own)]
        if shipped := shipped_folder():
            places = [(shipped, (own[0], one, "")) for one in processors()] + places
        for folder, target in places:
            path = folder / self._file(signature, target)
            try:
                content = read_checked(path, trusted=True)
                if content is None:
                    continue
                stated, notes, payload = pickle.loads(content)
                if stated != signature:
                    continue
                for name, args in notes["shares"]:  # before what calls it where it lies
                    kernel_named(name).compile(args)  # type: ignore[attr-defined]
                compiled = CompileResult._rebuild(target_context, *payload)
                vars(compiled.library).update(notes)
                if notes["stated"] is None:
                    return compiled
                from maneuver_automaton._linking import interpreted

                made_of = self.function, compiled.fndesc, compiled.environment, compiled.library
                return compiled._replace(entry_point=interpreted(*made_of))
            except Exception as error:  # noqa: BLE001, the kernel is compiled whatever is wrong here
                say_once("damaged", f"{path}: {error or type(error).__name__}: compiled again")
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, if it can be kept."""
        if compiled.library.has_dynamic_globals or any(
            not one.can_cache for one in compiled.lifted
        ):
            return
        path = self.folder / self._file(signature, compiled.codegen.magic_tuple())
        try:
            notes: dict[str, Any] = {"shares": [], "stated": None}
            notes |= {name: getattr(compiled.library, name, it) for name, it in notes.items()}
            *payload, environments = compiled._reduce()
            # To load an environment imports its module, of numba's own some with all of SciPy; only
            # its constants are read.
            read = tuple(one for one in environments if one.consts)
            write_checked(path, dumps((signature, notes, (*payload, read))))
        except OSError as error:
            why = error.strerror or error
            say_once("not kept", f"{self.folder}: compiled kernels cannot be kept here: {why}")

    def _file(self, signature: Any, target: Any) -> str:
        places = _places(getattr(signature, "args", signature))
        key = repr((self.made_from, target, signature, places))
        return f"{self.name}-{hashlib.sha256(key.encode()).hexdigest()[:24]}{ENDING}"


@functools.cache
def _find_memory() -> None:
    """Name what compiled kernels call for their memory; the rest of it is compiled into them."""
    # numba does so as well, and then compiles that rest in each process, for 20 ms.
    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _is_listed(name: str, signature: Any) -> bool:
    return name in kernel_names() and tuple(signature) in signatures_of(name)


@functools.cache
def _compiled(names: tuple[str, ...]) -> bool:
    """Have kernels compiled, the first time that one of them is missing."""
    if shipped_folder() and not later_uses(names[0]):
        say_once("shipped", f"{shipped_folder()}: {OTHER}")
    try:
        failed = compile_missing(names)
    except OSError as error:  # a full disk, no more processes: each kernel is compiled when used
        say_once("alone", f"kernels are compiled one by one: {error.strerror or error}")
        return False
    for failure in failed or ():
        say_once(failure, f"{failure}: compiled when it is used")
    return failed is not None


def _places(kinds: Any) -> list[str]:
    """The modules that types are from: numba fails to load code for structures that have moved."""
    found = []
    for kind in kinds:
        if isinstance(kind, BaseTuple):
            found += [getattr(kind, "instance_class", tuple).__module__, *_places(kind.types)]
    return found


@functools.cache
def _source_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
