"""Build the package with its kernels compiled, so that nobody waits for the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

COMPILE = (
    "import sys, pathlib\n"
    "from maneuver_automaton._compile_all import ship\n"
    "print(*ship(pathlib.Path(sys.argv[1])), sep='\\n')\n"
)


class BuildWithKernels(build_py):
    """Copies the package, and compiles its kernels where they are copied to."""

    def run(self) -> None:
        """Copy, and compile unless the package stays where it is."""
        super().run()
        if self.editable_mode:
            return  # they are compiled when they are used first
        package = Path(self.build_lib).absolute() / "maneuver_automaton"
        found = os.environ.get("PYTHONPATH")  # pip names what a build needs there
        paths = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, (str(package.parent), found))),
        }
        if subprocess.run([sys.executable, "-c", COMPILE, str(package)], env=paths).returncode:
            self.warn("kernels were not compiled: they will be when they are used first")


class WithMachineCode(Distribution):
    """A package for one kind of processor."""

    def has_ext_modules(self) -> bool:
        """Whether a wheel suits one kind of machine only."""
        return True


setup(cmdclass={"build_py": BuildWithKernels}, distclass=WithMachineCode)
