"""Compiled kernels on disk: whatever is wrong with a file, its kernel is compiled again.

numba's own cache raises where a file is damaged or a disk is full, and unpickles, which can run any
code, whatever lies in its folder. Here a file holds one signature of one kernel, behind a checksum,
and is read only if nobody but the user or the installer can have written it.
"""

from __future__ import annotations

import functools
import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler import CompileResult
from numba.core.intrinsics import INTR_MATH
from numba.core.runtime import _nrt_python
from numba.core.serialize import dumps

from maneuver_automaton import _kernel_files, _kernel_list
from maneuver_automaton._cache_files import read_checked, say_once, write_checked
from maneuver_automaton._compile_all import compile_missing
from maneuver_automaton._kernel_folders import shipped_folder

OTHER = "made for another processor, Python or numba: kernels are compiled anew, once"

_kernel_files.name_memory(_nrt_python.c_helpers)  # as numba does, which compiles the rest anew


class KernelCache:
    """The cache of one kernel, as numba's dispatcher asks for it."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        """`function` as Python has it."""
        self.folder, self.function = folder, function
        self.name = _kernel_files.kernel_name(function)
        _kernel_files.source_digest(function.__code__.co_filename)  # or OSError: there is none
        closed = [cell.cell_contents for cell in function.__closure__ or ()]
        self.closed = dumps(closed).hex() if closed else ""

    @property
    def cache_path(self) -> str:
        """The folder of the files."""
        return str(self.folder)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """What was compiled for a signature; None if that is not to be had."""
        found = self._found(signature, target_context)
        if (
            found is None
            and self.name in _kernel_list.kernel_names()
            and tuple(signature) in _kernel_list.signatures_of(self.name)
            and _compiled(tuple(_kernel_list.compiled_with(self.name)))
        ):
            found = self._found(signature, target_context)
        return found

    def _found(self, signature: Any, target_context: Any) -> Any:
        own = target_context.codegen().magic_tuple()
        for folder, target in _kernel_files.folders(own, self.folder):
            path = folder / self._file(signature, target)
            try:
                content = read_checked(path, trusted=True)
                if content is None:
                    continue
                stream = io.BytesIO(content)
                machine, (types, notes, payload) = pickle.load(stream), pickle.load(stream)
                if types != signature:
                    continue
                (name, kind, names), *payload = payload
                payload = (name, kind, (machine.code, names)), *payload
                for name, args in notes["shares"]:  # before what calls it where it lies
                    _kernel_list.kernel_named(name).compile(args)  # type: ignore[attr-defined]
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
            (name, kind, (code, names)), *payload, environments = compiled._reduce()
            # To load an environment imports its module, of numba's own some with all of SciPy; only
            # its constants are read.
            read = tuple(one for one in environments if one.consts)
            payload = (name, kind, names), *payload, read
            module, own = compiled.library._final_module, compiled.environment
            every = [*module.functions, *module.global_variables]
            needs = [one.name for one in every if one.is_declaration and "llvm." not in one.name]
            if compiled.reload_init or set(read) - {own} or not hasattr(compiled.library, "shares"):
                needs.append("numba")  # which nothing defines
            entry = "" if notes["stated"] else compiled.fndesc.llvm_cpython_wrapper_name
            defines = [one.name for one in every if not one.is_declaration]
            shares = [(name, _kinds_of(args)) for name, args in notes["shares"]]
            linked = [*needs, *INTR_MATH], shares
            held = own.env_name, list(own.consts)
            machine = _kernel_files.MachineCode(path.name, code, entry, *held, defines, *linked)
            write_checked(path, dumps(machine) + dumps((signature, notes, payload)))
        except OSError as error:
            why = error.strerror or error
            say_once("not kept", f"{self.folder}: compiled kernels cannot be kept here: {why}")

    def _file(self, signature: Any, target: Any) -> str:
        kinds = _kinds_of(getattr(signature, "args", signature))
        of_it = self.function, numba.__version__, self.closed
        return _kernel_files.file_name(*of_it, target, kinds)


@functools.cache
def _compiled(names: tuple[str, ...]) -> bool:
    """Have kernels compiled, the first time that one of them is missing."""
    if shipped_folder() and not _kernel_list.later_uses(names[0]):
        say_once("shipped", f"{shipped_folder()}: {OTHER}")
    try:
        failed = compile_missing(names)
    except OSError as error:  # a full disk, no more processes: each kernel is compiled when used
        say_once("alone", f"kernels are compiled one by one: {error.strerror or error}")
        return False
    for failure in failed or ():
        say_once(failure, f"{failure}: compiled when it is used")
    return failed is not None


def _kinds_of(types: Any) -> str:
    """Types of arguments, as names of files have them."""
    kinds = []
    for kind in types:
        try:
            kinds.append(_kernel_list.stated_kind(_kernel_list.stated(kind)))
        except (AttributeError, ImportError, ValueError):  # of a kind that no list has
            kinds.append(str(kind))
    return ",".join(kinds)
