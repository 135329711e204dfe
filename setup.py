"""Build: the scenarios of the repository, of which there is one copy, go into the wheel."""

from __future__ import annotations

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

SCENARIOS = ("*.yaml", "maps/*")  # of the folder `scenarios`; its pictures stay behind


class BuildWithScenarios(build_py):
    """Copy the scenarios beside the modules; an editable install finds them where they are."""

    def run(self) -> None:
        """Copy the modules, then the scenarios."""
        super().run()
        if self.editable_mode:
            return
        folder = Path(__file__).parent / "scenarios"
        files = sorted(path for pattern in SCENARIOS for path in folder.glob(pattern))
        if not files:
            raise FileNotFoundError(f"{folder}: holds no scenario, so the wheel would have none")
        for path in files:
            target = Path(self.build_lib) / "maneuver_automaton" / path.relative_to(folder.parent)
            self.mkpath(str(target.parent))
            self.copy_file(str(path), str(target))


setup(cmdclass={"build_py": BuildWithScenarios})
