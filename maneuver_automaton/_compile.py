"""The `kernel` decorators: compile a loop once, and never run a stale one.

Compiled code is kept on disk (`_kernel_folders`), and runs without numba (`_kernel_files`): that is
imported where a kernel has to be compiled, and by what will call kernels again and again, as it
tells types sooner. Where nothing can be written, kernels work without.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

from maneuver_automaton._cache_files import PLAINLY, say_once
from maneuver_automaton._interrupts import compiler_works
from maneuver_automaton._kernel_files import kinds_of, loaded, types_of
from maneuver_automaton._kernel_folders import kernel_folder

Kernel = TypeVar("Kernel", bound=Callable[..., Any])  # the function that is compiled
Record = TypeVar("Record", bound=type)


class CompiledLater:
    """A function that numba takes over when it is called, or compiled into another one."""

    def __init__(self, function: Callable[..., Any], make: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._make = make
        self.loaded: dict[str, Callable[..., Any]] = {}  # without numba, by kinds of arguments
        self._entries: dict[tuple[Any, ...], Callable[..., Any]] = {}  # the same by their types
        self._run: Callable[..., Any] = self._run_without_numba

    @functools.cached_property
    def compiled(self) -> Callable[..., Any]:
        """What numba makes of it, which runs from now on."""
        _meet_numba()
        self._run = made = self._make(self._function)
        return cast("Callable[..., Any]", made)

    @functools.cached_property
    def only_entry(self) -> Callable[..., Any]:
        """What numba made of it for the only types that it was called with so far."""
        (made,) = self.overloads.values()  # which looks at all types: once
        return cast("Callable[..., Any]", made.entry_point)

    def load(self, kinds: str) -> Callable[..., Any] | None:
        """What was compiled for arguments of some kinds, without numba; None: ask numba."""
        with _LOADING:
            if kinds not in self.loaded and (found := loaded(self._function, kinds)):
                self.loaded[kinds] = found
            return None if "numba" in sys.modules else self.loaded.get(kinds)

    def load_for(self, args: tuple[Any, ...]) -> Callable[..., Any] | None:
        """What was compiled for arguments of these types, without numba; None: ask numba."""
        if "numba" in sys.modules:
            return None
        types = types_of(args)
        if entry := self._entries.get(types):
            return entry
        try:
            kinds = kinds_of(args)
        except (AttributeError, KeyError):  # what only numba can type
            return None
        if entry := self.loaded.get(kinds) or self.load(kinds):
            self._entries[types] = entry
        return entry

    def _run_without_numba(self, *args: Any) -> Any:
        return (self.load_for(args) or self.compiled)(*args)

    def __call__(self, *args: Any) -> Any:
        """Run it, compiled."""
        return self._run(*args)

    def __getattr__(self, name: str) -> Any:
        """What numba knows of it: its signatures, its code."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.compiled, name)

    def __reduce__(self) -> str:
        """It is sent to other processes by its name."""
        return self._function.__qualname__


def kernel(function: Kernel) -> Kernel:
    """Compile `function` with numba: without the GIL, cached on disk, IEEE division."""
    return _later(function, _cached, {})


def bare_kernel(function: Kernel) -> Kernel:
    """A `kernel` that makes no array, and so need not count references to those it is given.

    A call that takes a dozen arrays otherwise spends most of a microsecond on the counts.
    """
    return _later(function, _cached, NO_COUNTS)


def inner_kernel(function: Kernel) -> Kernel:
    """Compile a function that only other kernels call: no wrapper for Python, no file of its own.

    Its code is part of the kernels that call it; without the wrapper it compiles in half the time.
    """
    return _later(function, _inner, {})


def bare_inner_kernel(function: Kernel) -> Kernel:
    """An `inner_kernel` that makes no array, and so counts no references."""
    return _later(function, _inner, NO_COUNTS)


def shared_kernel(function: Kernel) -> Kernel:
    """An `inner_kernel` that is compiled once, and called where it lies by those that call it.

    For what many kernels need, and what takes long enough that a call counts for nothing. It may
    make arrays, whoever calls it.
    """
    return _later(function, _shared, {"_nrt": True})


def bare_shared_kernel(function: Kernel) -> Kernel:
    """A `shared_kernel` that makes no array, and so counts no references."""
    return _later(function, _shared, NO_COUNTS)


def by_value(record: Record) -> Record:
    """Have kernels copy a record of arrays where they hand it over, and count references to them.

    For records that kernels make of new arrays; all others are handed over by their address.
    """
    record.by_value = True  # type: ignore[attr-defined]
    return record


def plain(function: Kernel) -> Kernel:
    """A kernel as Python has it, for callers of a formula that kernels need as well."""
    return cast("Kernel", getattr(function, "__wrapped__", function))


def bound(function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
    """A call of a kernel with these very arguments: their types are looked at now, and not again.

    To find out the types of a hundred arrays takes longer than a small search. They stay what they
    are, since the arguments do; what the arrays hold may change between two calls.

    Examples
    --------
    >>> @kernel
    ... def total(numbers):
    ...     return numbers[0] + numbers[1]
    >>> import numpy as np
    >>> numbers = np.array([1.0, 2.0])
    >>> call = bound(total, numbers)
    >>> numbers[0] = 5.0
    >>> call()
    7.0
    """
    if not isinstance(function, CompiledLater):
        return functools.partial(function, *args)
    if entry := function.load_for(args):
        return functools.partial(entry, *args)
    import numba

    types = tuple(map(numba.typeof, args))
    function.compiled.compile(types)  # type: ignore[attr-defined]
    compiled = function.compiled.overloads[types]  # type: ignore[attr-defined]
    return functools.partial(compiled.entry_point, *args)


def called_again(function: Kernel) -> Kernel:
    """What is called in place of a kernel that was called with arguments of the same types.

    It does not look at them again, which takes longer than some calls.
    """
    if not isinstance(function, CompiledLater):
        return function
    if "compiled" in vars(function):
        entries = [function.only_entry] if len(function.overloads) == 1 else []
    else:
        entries = list(function.loaded.values())
    return cast("Kernel", entries[0]) if len(entries) == 1 else function


_LOADING = threading.RLock()
NO_COUNTS: dict[str, Any] = {"_nrt": False}
LINKED = (0, 63), (0, 68)  # the first and the last numba whose insides `_linking` is known to fit


def _later(function: Kernel, make: Callable[..., Any], options: dict[str, Any]) -> Kernel:
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return function  # numba would hand it back as well
    return cast("Kernel", CompiledLater(function, functools.partial(make, options=options)))


@functools.cache
def _meet_numba() -> None:
    """Tell numba how to type functions that it has not taken over yet, and whom to tell of work."""
    from numba.core import event
    from numba.extending import typeof_impl

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            compiler_works(True)

        def on_end(self, event: Any) -> None:
            compiler_works(False)

    typeof_impl.register(CompiledLater, lambda value, context: typeof_impl(value.compiled, context))
    event.register("numba:compile", Listener())


def _pipeline(name: str) -> dict[str, Any]:
    """How `_linking` compiles, for a numba that it was tried with; others compile as they do."""
    import numba

    if not LINKED[0] <= numba.version_info.short <= LINKED[1]:
        first, last = (".".join(map(str, one)) for one in LINKED)
        say_once("plainly", f"{PLAINLY}: numba is {numba.__version__}, known are {first} to {last}")
        return {}
    try:
        from maneuver_automaton import _linking
    except Exception as error:  # noqa: BLE001, nobody promised that these insides stay as they are
        say_once("plainly", f"{PLAINLY}: {type(error).__name__}: {error}")
        return {}
    return {"pipeline_class": getattr(_linking, name)}


def _inner(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    import numba

    made = numba.njit(
        nogil=True,
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        **_pipeline("LinkedCompiler"),
        **options,
    )
    return _for_any_number(made(function))


def _for_any_number(compiled: Any) -> Any:
    """Have it compiled once: numba does so anew for every integer that stands in a call of it."""
    from numba import types

    def widened(kind: Any) -> Any:
        if isinstance(kind, types.UniTuple | types.Tuple):
            return types.Tuple.from_types(tuple(map(widened, kind.types)))
        return kind.literal_type if isinstance(kind, types.IntegerLiteral) else kind

    if usual := getattr(compiled, "get_call_template", None):  # none: numba is switched off
        compiled.get_call_template = lambda args, kws: usual(
            tuple(map(widened, args)), {name: widened(kind) for name, kind in kws.items()}
        )
    return compiled


def _shared(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    how = _pipeline("SharedCompiler")
    if not how:  # compiled plainly, it is linked into what calls it
        return _inner(function, options)
    options = {"no_cpython_wrapper": True, **options}
    return _for_any_number(_cached(function, options, "SharedCompiler"))


def _cached(
    function: Callable[..., Any], options: dict[str, Any], compiler: str = "KernelCompiler"
) -> Any:
    import numba

    compiled = numba.njit(
        nogil=True, error_model="numpy", no_cfunc_wrapper=True, **_pipeline(compiler), **options
    )(function)
    folder = kernel_folder()
    if folder is not None and compiled is not function:  # it is, where numba is switched off
        from maneuver_automaton._kernel_cache import KernelCache

        with contextlib.suppress(OSError):  # no source file: an interactive session, a doctest
            compiled._cache = KernelCache(function, folder)
    return compiled
