"""Libraries of trims and maneuvers of the second-order car: building, exactness, files.

``python benchmarks/maneuver_library.py``: processor seconds to build libraries of growing
size by bang-bang maneuvers, to write and to read them, size of the file, and the greatest
distance of a sample of displacements from those of DOP853 at rtol 1e-12.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library, save_library
from maneuver_automaton.models import SecondOrderCar, rollout
from maneuver_automaton.primitives.connecting import pieces

CAR = SecondOrderCar(
    wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0, max_steering_rate=0.5
)
SIZES = [(5, 5, "all"), (9, 5, "neighbours"), (9, 5, "all"), (9, 7, "neighbours"), (9, 7, "all")]


def error(maneuver) -> float:
    """Distance of the displacement from that of the ODE solver."""
    course = maneuver.course
    state = np.concatenate([np.zeros(3), course.reduced_state[0]])
    for begin, end, control in pieces(course.time, course.control):
        times = [begin, end]
        state = rollout(CAR, state, control=control, times=times, rtol=1e-12, atol=1e-13)[-1]
    return float(np.abs(state[:3] - maneuver.displacement).max())


def measured(n_speeds: int, n_steerings: int, pairs: str, path: Path, samples: int) -> list[str]:
    grid = {
        "speed": np.linspace(-CAR.max_speed, CAR.max_speed, n_speeds),
        "steering": np.linspace(-CAR.max_steering, CAR.max_steering, n_steerings),
    }
    times = [time.process_time()]
    library = Automaton.of_model(CAR, grid, pairs=pairs)
    times.append(time.process_time())
    save_library(library, path)
    times.append(time.process_time())
    load_library(path)
    times.append(time.process_time())
    chosen = np.random.default_rng(0).choice(len(library.maneuvers), samples, replace=False)
    worst = max(error(library.maneuvers[k]) for k in chosen)
    laps = [f"{seconds:.3f}" for seconds in np.diff(times)]
    counts = [str(len(library)), str(len(library.maneuvers)), pairs]
    return [*counts, *laps, f"{path.stat().st_size / 1000:.0f}", f"{worst:.1e}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=30, help="maneuvers held against DOP853")
    samples = parser.parse_args().samples
    head = ["trims", "maneuvers", "pairs", "build s", "write s", "read s", "kB", "error"]
    rows = [head]
    with tempfile.TemporaryDirectory() as folder:
        rows += [measured(*size, Path(folder) / "car.json", samples) for size in SIZES]
    for row in rows:
        print("".join(f"{cell:>12}" for cell in row))


if __name__ == "__main__":
    main()
