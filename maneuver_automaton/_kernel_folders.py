"""Where compiled kernels lie: in the package, by whoever installed it, and in the user's cache.

numba's own cache looks at the file of one function and does not see edits in a file it calls.
So the compiled code lies in a folder named after a hash of *every* kernel source.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from pathlib import Path

from maneuver_automaton._cache_files import distrusted, say_once

HOW = ("_compile.py", "_linking.py", "_records.py")  # how kernels are compiled
SHIPPED = "compiled"  # folder of the package
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


@functools.cache
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


@functools.cache
def shipped_folder() -> Path | None:
    """Folder of the kernels that were compiled when the package was installed; None without."""
    folder = Path(__file__).parent / SHIPPED / f"{KERNELS}{source_hash()}"
    try:
        return None if distrusted(folder.stat()) else folder
    except OSError:
        return None
