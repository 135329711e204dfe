"""How long a user waits: import, help, and the plan command, as whole processes.

``python benchmarks/startup.py``: medians of `--repeats` processes each; `cold` compiles every
kernel into an empty folder first, once.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCENARIOS = ("parking.yaml", "grid_1681.yaml")


def seconds(arguments, environment) -> float:
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, check=False
    )
    lap = time.perf_counter() - began
    if done.returncode != 0:
        raise SystemExit(done.stderr.decode())
    return lap


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    repeats = parser.parse_args().repeats
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {
            "NUMBA_CACHE_DIR": str(Path(folder) / "kernels"),
            "MANEUVER_AUTOMATON_CACHE_DIR": str(Path(folder) / "cache"),
            "PYTHONPATH": str(ROOT),
        }
        out = str(Path(folder) / "out")

        def lap(name: str, arguments, times: int = repeats) -> float:
            laps = [seconds(arguments, environment) for _ in range(times)]
            print(f"  {name:44} {statistics.median(laps):8.3f} s")
            return statistics.median(laps)

        print(f"whole processes, median of {repeats}")
        base = lap("python -c pass", ["-c", "pass"])
        numpy = lap("import numpy", ["-c", "import numpy"])
        package = lap("import maneuver_automaton", ["-c", "import maneuver_automaton"])
        lap("import maneuver_automaton, plan", ["-c", "from maneuver_automaton import plan"])
        print(f"  {'import alone':44} {package - base:8.3f} s, numpy {numpy - base:.3f} s")
        lap("--help", ["-m", "maneuver_automaton", "--help"])
        plan = ["-m", "maneuver_automaton", "plan", "--quiet", "--out", out]
        for name in SCENARIOS:
            scenario = str(ROOT / "scenarios" / name)
            cold = lap(f"plan {name} --no-plot, cold", [*plan, "--no-plot", scenario], 1)
            warm = lap(f"plan {name} --no-plot, warm", [*plan, "--no-plot", scenario])
            print(f"  {'ratio':44} {cold / warm:8.1f}")
            lap(f"plan {name}, warm, with pictures", [*plan, scenario])


if __name__ == "__main__":
    main()
