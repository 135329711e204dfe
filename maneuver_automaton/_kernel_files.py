"""Files of compiled kernels, and how they run without numba, whose import takes longer than a plan.

A file begins with machine code and with what it needs to run, in terms of Python and LLVM: numba's
C parts, which do not import the rest of it, and an engine are enough. The second half is for numba
itself, which takes over where it was imported already, and where a file does not fit.
"""

from __future__ import annotations

import builtins
import contextlib
import ctypes
import functools
import hashlib
import os
import pickle
import platform
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._cache_files import read_checked
from maneuver_automaton._kernel_folders import kernel_folder, shipped_folder
from maneuver_automaton._kernel_list import kernel_named, record_name

FORMAT = 4  # of the files; counts into their names
NUMBERS = re.compile("bool|u?int(8|16|32|64)|float(32|64)|complex(64|128)")  # in arrays
SCALARS = {type(None): "none", bool: "bool", int: "int64", float: "float64", complex: "complex128"}
SCALARS |= {np.bool_: "bool", np.int64: "int64", np.float64: "float64"}
X86_64_V3 = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "xsave")


class MachineCode(NamedTuple):
    """The beginning of a file: what is needed to run a kernel without numba."""

    file: str  # its name
    code: bytes  # as the linker has it
    entry: str  # name of what Python calls; empty: Python interprets it, as numba has it
    environment: str  # name of what leads to the constants
    constants: list[Any]
    defines: list[str]  # names
    needs: list[str]  # names that others define
    shares: list[tuple[str, str]]  # kernels that it calls where they lie, and their arguments


def file_name(function: Any, numba: str, closed: str, target: Any, kinds: str) -> str:
    """The name of the file of a kernel that is compiled for arguments of some kinds."""
    code = function.__code__
    key = (
        (FORMAT, numba, sys.version_info[:2], getattr(sys, "abiflags", "")),
        (source_digest(code.co_filename), code.co_firstlineno, code.co_code.hex()),
        (closed, target, kinds),
    )
    digest = hashlib.sha256(repr(key).encode()).hexdigest()[:24]
    return f"{kernel_name(function)}-{digest}.nbc"


def kernel_name(function: Any) -> str:
    """How a kernel is called in names of files, and in the list."""
    return f"{function.__module__}.{function.__qualname__}".replace("<locals>.", "")


def folders(own: tuple[Any, ...], folder: Path) -> Iterator[tuple[Path, tuple[Any, ...]]]:
    """Where to look for kernels, and for which processor they are there: `own` in the last one."""
    if shipped := shipped_folder():
        yield from ((shipped, (own[0], one, "")) for one in processors())
    yield folder, own


def processors() -> list[str]:
    """Kinds of processors, as LLVM names them, that this one can stand for; the best one first."""
    from llvmlite import binding

    if platform.machine().lower() not in ("x86_64", "amd64"):
        return ["generic"]
    features = binding.get_host_cpu_features()
    can = all(features.get(one, False) for one in X86_64_V3)
    return ["x86-64-v3", "x86-64"] if can else ["x86-64"]


def kinds_of(args: Iterable[Any]) -> str:
    """The types of arguments, as names of files have them; KeyError where only numba knows them."""
    kinds = []
    for one in args:
        if type(one) is np.ndarray:
            kinds.append(_array_kind(one.dtype, one.ndim, one.flags.num))
        elif isinstance(one, tuple):
            kinds.append(f"{record_name(type(one))}({kinds_of(one)})")
        else:
            kinds.append(SCALARS[float if isinstance(one, float) else type(one)])
    return ",".join(kinds)


def types_of(args: Iterable[Any]) -> tuple[Any, ...]:
    """What `kinds_of` tells apart, as values that are found in half the time."""
    found: list[Any] = []
    for one in args:
        kind = type(one)
        if kind is np.ndarray:
            found += (one.dtype, one.ndim, one.flags.num)
        elif kind in SCALARS or not isinstance(one, tuple):
            found.append(kind)
        else:
            found += (kind, types_of(one))
    return tuple(found)


@functools.cache
def _array_kind(dtype: np.dtype[Any], axes: int, flags: int) -> str:
    if not (NUMBERS.fullmatch(dtype.name) and dtype.isnative and flags & 0x100):  # aligned
        raise KeyError(dtype)
    held = "" if flags & 0x400 else ", read only"
    return f"{dtype.name}[{axes}{'C' if flags & 1 else 'F' if flags & 2 else 'A'}{held}]"


def loaded(function: Any, kinds: str) -> Callable[..., Any] | None:
    """A kernel that was compiled for some kinds of arguments, without numba; None: ask numba."""
    if "numba" in sys.modules or not (folder := kernel_folder()):
        return None
    with contextlib.suppress(Exception):  # whatever is wrong here, numba meets it too, and says so
        engine = _engine()
        for place, target in folders(engine.target, folder):
            path = place / file_name(function, engine.version, "", target, kinds)
            if content := read_checked(path, trusted=True):
                machine: MachineCode = pickle.loads(content)
                return engine.run(function, machine) if machine.file == path.name else None
    return None


class Engine:
    """What machine code of kernels runs in, where nobody has set how numba compiles."""

    def __init__(self) -> None:
        from llvmlite import binding

        numba: Any = find_spec("numba")
        settings = [one for one in os.environ if one.startswith("NUMBA_")]
        if settings not in ([], ["NUMBA_CACHE_DIR"]) or Path(".numba_config.yaml").exists():
            raise LookupError("numba is set to compile otherwise")
        self.binding, self.folder = binding, Path(numba.origin).parent
        stated = (self.folder / "_version.py").read_text(encoding="utf-8")
        (self.version,) = re.findall('"version": "(.+?)"', stated)
        triple, features = binding.get_process_triple(), binding.get_host_cpu_features()
        self.target = triple, binding.get_host_cpu_name(), features.flatten()
        binding.check_jit_execution()
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        machine = binding.Target.from_triple(triple).create_target_machine(jit=True)
        self.engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
        self.functions, self.defined = self._part("_dynfunc"), set[str]()
        helpers = self._part("_helperlib").c_helpers
        name_memory(self._part("core.runtime._nrt_python").c_helpers)
        self.known = helpers | {f"numba_{name}": address for name, address in helpers.items()}
        self.known |= {f"PyExc_{name}": id(one) for name, one in vars(builtins).items()}
        self.known["numba_unpickle"] = ctypes.cast(UNPICKLE, ctypes.c_void_p).value
        self.known["_Py_NoneStruct"] = id(None)

    def _part(self, name: str) -> Any:
        """A part of numba that is written in C; it is not kept where numba will look for it."""
        folder = self.folder.joinpath(*name.split(".")[:-1])
        spec: Any = PathFinder.find_spec(f"numba.{name}", [str(folder)])
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules.pop(f"numba.{name}", None)
        return module

    def run(self, function: Any, machine: MachineCode) -> Callable[..., Any]:
        """Take in the machine code of a kernel; what Python calls, as numba makes it."""
        for name, of_it in machine.shares:  # before what calls it where it lies
            kernel_named(name).load(of_it)  # type: ignore[attr-defined]
        for name in {*machine.needs} - self.defined:
            if name in self.known:
                self.binding.add_symbol(name, self.known[name])
            elif not self.binding.address_of_symbol(name):  # over which LLVM ends the process
                raise LookupError(name)
        self.engine.add_object_file(self.binding.ObjectFileRef.from_data(machine.code))
        self.engine.finalize_object()
        self.defined.update(machine.defines, machine.needs)
        if not machine.entry:
            return function  # type: ignore[no-any-return]
        environment = self.functions.Environment(function.__globals__)
        environment.consts[:] = machine.constants
        place = self.engine.get_global_value_address(machine.environment)
        ctypes.c_void_p.from_address(place).value = id(environment)
        names = sys.modules[function.__module__], function.__name__, function.__name__
        address = self.engine.get_function_address(machine.entry)
        return self.functions.make_function(*names, address, environment, ())  # type: ignore[no-any-return]


def name_memory(helpers: dict[str, int]) -> None:
    """Name what compiled kernels call for their memory; the rest of it is compiled into them."""
    from llvmlite.binding import add_symbol

    for name, address in helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


# What a kernel holds as a pickle: an error that it raises, the class of what it returns.
UNPICKLE = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)(
    functools.cache(lambda at, size, _digest: pickle.loads(ctypes.string_at(at, size)))
)


_engine = functools.cache(Engine)


@functools.cache
def source_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
