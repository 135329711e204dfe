"""The `kernel` decorators: compile a loop once, and never run a stale one.

Compiled code is kept on disk (`_kernel_folders`); where nothing can be written, kernels work
without.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar, cast

from maneuver_automaton._kernel_folders import kernel_folder

Kernel = TypeVar("Kernel", bound=Callable[..., Any])  # the function that is compiled


def kernel(function: Kernel) -> Kernel:
    """Compile `function` with numba: without the GIL, cached on disk, IEEE division.

    Examples
    --------
    >>> @kernel
    ... def double(x):
    ...     return 2.0 * x
    >>> double(1.5)
    3.0
    """
    return _cached(function, {})


def bare_kernel(function: Kernel) -> Kernel:
    """A `kernel` that makes no array, and so need not count references to those it is given.

    A call that takes a dozen arrays otherwise spends most of a microsecond on the counts.
    """
    return _cached(function, NO_COUNTS)


def inner_kernel(function: Kernel) -> Kernel:
    """Compile a function that only other kernels call: no wrapper for Python, no file of its own.

    Its code is part of the kernels that call it; without the wrapper it compiles in half the time.
    """
    return _inner(function, {})


def bare_inner_kernel(function: Kernel) -> Kernel:
    """An `inner_kernel` that makes no array, and so counts no references."""
    return _inner(function, NO_COUNTS)


def inlined_kernel(function: Kernel) -> Kernel:
    """A `bare_inner_kernel` that LLVM merges into its callers, wherever they call it.

    A call hands over every field of every structure it is given, hundreds of words for a scene;
    merged, none is copied. It is typed once, on its own.
    """
    return _inner(function, {"forceinline": True, **NO_COUNTS})


NO_COUNTS: dict[str, Any] = {"_nrt": False}


def _inner(function: Kernel, options: dict[str, Any]) -> Kernel:
    import numba

    from maneuver_automaton._linking import LinkedCompiler

    return cast(
        "Kernel",
        numba.njit(
            nogil=True,
            error_model="numpy",
            no_cpython_wrapper=True,
            no_cfunc_wrapper=True,
            pipeline_class=LinkedCompiler,
            **options,
        )(function),
    )


def _cached(function: Kernel, options: dict[str, Any]) -> Kernel:
    import numba

    from maneuver_automaton._linking import KernelCompiler

    compiled = numba.njit(
        nogil=True,
        error_model="numpy",
        no_cfunc_wrapper=True,
        pipeline_class=KernelCompiler,
        **options,
    )(function)
    folder = kernel_folder()
    if folder is not None and compiled is not function:  # it is, where numba is switched off
        from maneuver_automaton._kernel_cache import KernelCache

        with contextlib.suppress(OSError):  # no source file: an interactive session, a doctest
            compiled._cache = KernelCache(function, folder)
    return cast("Kernel", compiled)
