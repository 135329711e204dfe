"""The `kernel` decorators: compile a loop once, and never run a stale one.

numba's own cache looks at the file of one function and does not see edits in a file it calls.
So the compiled code lies in a folder named after a hash of *every* kernel source, inside the
user's cache folder; where nothing can be written, kernels work without a cache.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from maneuver_automaton._cache_files import distrusted, say_once

Kernel = TypeVar("Kernel", bound=Callable[..., Any])  # the function that is compiled


HOW = ("_compile.py", "_linking.py")  # how kernels are compiled
KERNELS = "kernels-"  # what the names of folders of compiled kernels begin with


def user_cache_folder() -> Path:
    """Where files that can be made again are kept: the platform's cache folder of this user."""
    if override := os.environ.get("MANEUVER_AUTOMATON_CACHE_DIR"):
        return Path(override)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "maneuver_automaton"


def kernel_base() -> Path:
    """Where the folders of compiled kernels are, one for every state of their sources."""
    base = os.environ.get("NUMBA_CACHE_DIR")
    return Path(base) if base else user_cache_folder()


def source_hash() -> str:
    """Hash of every kernel source and of how they are compiled, 16 hexadecimal digits."""
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for path in sorted((*package.rglob("_kernels*.py"), *(package / one for one in HOW))):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache
def kernel_folder() -> Path | None:
    """Folder of the compiled kernels, made if need be; None where there is none to be trusted.

    Compiled kernels are pickles, which can run any code: they are read from folders that belong to
    the user or the installer, and that nobody else can write.
    """
    folder = None
    try:
        folder = kernel_base() / f"{KERNELS}{source_hash()}"
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o755, exist_ok=True)
        why = distrusted(folder.parent.stat(), shared=True) or distrusted(folder.stat())
    except OSError as error:
        why = error.strerror or str(error)
    except RuntimeError:
        why = "there is no home folder"
    if why:
        say_once("folder", f"{folder or 'cache'}: {why}: kernels are compiled anew at every start")
        return None
    return folder


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
