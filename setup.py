"""Build: kernels are compiled, and the scenarios, of which there is one copy, go into the wheel."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

SCENARIOS = (
    "*.yaml",
    "fleets/*.yaml",
    "maps/*",
)  # of the folder `scenarios`; its pictures stay behind
COMPILE = (
    "import sys, pathlib\n"
    "from maneuver_automaton._compile_all import ship\n"
    "print(*ship(pathlib.Path(sys.argv[1])), sep='\\n')\n"
)


class BuildWhole(build_py):
    """Copies the modules, then what is made of them and what belongs to them."""

    def run(self) -> None:
        """Build; an editable install finds scenarios where they are, and compiles at first use."""
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib).absolute() / "maneuver_automaton"
        self._add_scenarios(package)
        self._compile_kernels(package)

    def _add_scenarios(self, package: Path) -> None:
        folder = Path(__file__).parent / "scenarios"
        files = sorted(path for pattern in SCENARIOS for path in folder.glob(pattern))
        if not files:
            raise FileNotFoundError(f"{folder}: holds no scenario, so the wheel would have none")
        for path in files:
            target = package / path.relative_to(folder.parent)
            self.mkpath(str(target.parent))
            self.copy_file(str(path), str(target))

    def _compile_kernels(self, package: Path) -> None:
        known = os.environ.get("PYTHONPATH")  # where pip puts what a build needs
        paths = os.pathsep.join(filter(None, (str(package.parent), known)))
        command = [sys.executable, "-c", COMPILE, str(package)]
        with contextlib.ExitStack() as stack:
            shown = None  # standard output, of which pip shows nothing but with -v
            with contextlib.suppress(OSError):  # no terminal
                shown = stack.enter_context(Path("/dev/tty").open("w"))
                print(file=shown, flush=True)
            environment = {**os.environ, "PYTHONPATH": paths}
            if subprocess.run(command, env=environment, stdout=shown).returncode:
                self.warn("kernels were not compiled: they will be when they are used first")


class WithMachineCode(Distribution):
    """A package for one kind of processor."""

    def has_ext_modules(self) -> bool:
        """Whether a wheel suits one kind of machine only."""
        return True


setup(cmdclass={"build_py": BuildWhole}, distclass=WithMachineCode)
