"""How commands end when a stream is closed, a signal comes, or a process is killed."""

from __future__ import annotations

import io
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton import _cache_files, _files, _kernel_folders, planning
from maneuver_automaton._interrupts import (
    compiler_works,
    listening,
    patient,
    stopped,
)
from maneuver_automaton.cli import folder_runs, run
from maneuver_automaton.planning import PlanStatus
from maneuver_automaton.receding_horizon import RecedingHorizon, simulate
from maneuver_automaton.roads import RoadPlanner
from maneuver_automaton.scenario import build_file
from maneuver_automaton.search import cost_to_go
from maneuver_automaton.search.cost_to_go import FOLDER
from tests.roads.files import GOAL, LANES, commonroad, interval, problem
from tests.scenario.files import SCENARIO, but

PLAN = ["plan", "x.yaml", "--no-plot"]
LONG = SCENARIO.replace("x_trims: 4}", "").replace(  # never done before its time limit
    "horizon: {time_s: free, ma", "obstacles: [{disc_m: {center: [0.5, 0.6], radius: 0.1}}]\n#"
)
LATE = GOAL.replace(interval("time", 20, 40), interval("time", 0, 5))
AHEAD_ONLY = but("    - {name: spin, control: [0.0, 1.0]}\n", "")
STREAMS = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
FILES = {"x.yaml": SCENARIO, "none.yaml": AHEAD_ONLY, "bad.yaml": "schema: 2"}
pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture(autouse=True)
def in_front() -> Iterator[None]:
    """Not as a process in the background, which ignores Ctrl-C, and so do its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def written(name: str = "plan.json") -> dict[str, object]:
    """The content of a result."""
    return json.loads((Path("out") / name).read_text())  # type: ignore[no-any-return]


# --- streams ---


def unusable(how: str) -> io.TextIOBase | None:
    """A stream that takes nothing."""
    if how == "left":
        reader, writer = os.pipe()
        os.close(reader)
        return os.fdopen(writer, "w")
    stream = None if how == "none" else Path("/dev/full").open("w")  # noqa: SIM115
    if how == "closed":
        stream.close()
    return stream


@STREAMS
@pytest.mark.parametrize(
    ("which", "how"),
    [*(("stdout", how) for how in ("full", "closed", "none", "left")), ("stderr", "full")],
)
def test_a_stream_that_takes_nothing_leaves_the_exit_code_true(monkeypatch, which, how):
    lost = which == "stdout" and how in ("full", "closed")
    for arguments, code in (
        (["plan", "x.yaml", "--no-plot"], 0),
        (["plan", "none.yaml", "--no-plot"], 1),
        (["plan", "bad.yaml"], 2),
        (["schema"], 2 if lost else 0),
    ):
        stream = unusable(how)
        monkeypatch.setattr(sys, which, stream)
        assert run(arguments) == code
        if stream is not None:
            stream.close()  # what was led to nowhere is not written again


@STREAMS
def test_what_is_not_printed_is_said(monkeypatch, capsys):
    with Path("/dev/full").open("w") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        assert run(["schema"]) == 2
    said = capsys.readouterr().err
    assert said == "standard output: cannot be written: No space left on device\n"


@STREAMS
def test_streams_of_a_shell():
    to, code = ">&- 2>&- <&-", 0
    order = f"{sys.executable} -m maneuver_automaton schema {to}"
    root = {"PYTHONPATH": str(Path(__file__).parents[1])}
    assert subprocess.run(order, shell=True, env=os.environ | root, check=False).returncode == code


# --- signals ---


def at_once(number: int = signal.SIGINT) -> None:
    """Send a signal to this process, and let it be taken."""
    os.kill(os.getpid(), number)
    for _ in range(3):
        time.sleep(0.0)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("found", [True, False])
def test_the_best_plan_so_far(monkeypatch, capsys, number, code, found):
    plan = sys.modules["maneuver_automaton.planning.plan"]
    answered = plan.answer

    def interrupted(*args, **settings):
        before = answered(*args, **settings) if found else None
        at_once(number)
        return before or answered(*args, **settings)  # which finds that the time is over

    monkeypatch.setattr(plan, "answer", interrupted)
    if not found:
        Path("x.yaml").write_text(
            SCENARIO + "obstacles: [{disc_m: {center: [0.5, 0.6], radius: 0.1}}]"
        )
    with listening():
        assert run(PLAN) == code
    document = written()
    assert document["interrupted"] is True
    assert document["status"] == ("found" if found else "out_of_budget")
    assert "Traceback" not in capsys.readouterr().err
    monkeypatch.undo()


def test_a_plan_that_nobody_interrupts_does_not_say_so():
    with listening():
        assert run([*PLAN, "--quiet"]) == 0
    assert "interrupted" not in written()


def test_while_a_kernel_is_compiled(monkeypatch):
    def compiling(problem, **settings):
        compiler_works(True)
        try:
            at_once()
        finally:
            compiler_works(False)

    monkeypatch.setattr(planning, "plan", compiling)
    with listening():
        assert run([*PLAN, "--quiet"]) == 130
    assert written()["status"] == PlanStatus.OUT_OF_BUDGET.value
    assert written()["reason"] == "interrupted before there was a plan"


def test_the_second_signal_breaks_off():
    with listening(), patient():
        at_once()
        assert stopped()
        with patient():
            pass  # what is asked within a patient block still comes to its own end
        with pytest.raises(KeyboardInterrupt):
            at_once()


def test_before_the_libraries_are_loaded():
    code = (
        "import os, signal, sys\n"
        "class Sends:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Sends())\n"
        "sys.argv = ['x', 'schema']\n"
        "from maneuver_automaton.cli import main\n"
        "main()\n"
    )
    root = {"PYTHONPATH": str(Path(__file__).parents[1])}
    order = [sys.executable, "-c", code]
    done = subprocess.run(order, env=os.environ | root, capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")


def test_a_loop_keeps_the_steps_that_were_driven(monkeypatch):
    part = "receding_horizon: {step_s: 0.25, steps: 12}\n"
    Path("x.yaml").write_text(SCENARIO.replace("free", "8.0") + part)
    assert run(["mpc", "x.yaml", "--no-plot", "--quiet", "--steps", "2", "--out", "two"]) == 1
    drive, calls = RecedingHorizon.step, itertools.count(1)

    def step(self, *args, **settings):
        if next(calls) == 3:
            at_once()
        return drive(self, *args, **settings)

    monkeypatch.setattr(RecedingHorizon, "step", step)
    with listening():
        assert run(["mpc", "x.yaml", "--no-plot", "--quiet"]) == 130
    document, two = (
        written("closed_loop.json"),
        json.loads(Path("two/closed_loop.json").read_text()),
    )
    assert document["interrupted"] is True
    assert document["reason"].endswith("after 2 steps, when the loop was interrupted")
    assert len(document["steps"]) == 3
    assert document["cost"] == two["cost"]
    assert document["steps"][-1]["value"] == pytest.approx(two["steps"][-1]["value"])
    monkeypatch.setattr(RecedingHorizon, "step", drive)
    assert run(["mpc", "x.yaml", "--no-plot", "--quiet", "--resume", "out/closed_loop.json"]) != 2


def test_a_build_says_that_it_can_go_on(monkeypatch, capsys):
    def build(*_: object, **__: object) -> None:
        at_once()

    monkeypatch.setattr(build_file, "build", build)
    Path("b.yaml").write_text(
        "{schema: 1, library: a, vehicle: {model: unicycle}, "
        "trims: {speed: [0, 1], turn_rate: [0]}}"
    )
    with listening():
        assert run(["automaton", "build", "b.yaml"]) == 130
    said = "b.yaml: interrupted: called again, the build goes on after what is done\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    "jobs", ["1", pytest.param("2", marks=[pytest.mark.slow, pytest.mark.exhaustive])]
)
def test_a_folder_tells_of_every_file(monkeypatch, capfd, jobs):
    for name in "abcd":
        Path("many").mkdir(exist_ok=True)
        Path("many", f"{name}.yaml").write_text(SCENARIO if name == "a" else LONG)
    results = folder_runs.in_parallel

    def interrupted(function, problems, **settings):
        for number, row in enumerate(results(function, problems, **settings)):
            yield row
            if number == 0:
                at_once()  # as the terminal's Ctrl-C, which processes of ours ignore

    monkeypatch.setattr(folder_runs, "in_parallel", interrupted)
    with listening():
        assert run(["plan", "many", "--jobs", jobs, "--no-plot", "--time-limit", "30"]) == 130
    out, said = capfd.readouterr()
    assert all(f"{name}.yaml" in out for name in "abcd")
    assert "d.yaml: interrupted before it was planned" in said
    assert "Traceback" not in said
    assert "interrupted" not in json.loads(Path("out/a/plan.json").read_text())
    for name in "bc":  # with two processes one may be under way, wherever the machine is quick
        file = Path("out", name, "plan.json")
        waited = f"{name}.yaml: interrupted before it was planned" in said
        assert waited != file.exists()
        assert waited or json.loads(file.read_text())["interrupted"] is True
    assert not Path("out/d").exists()


def test_statistics_are_of_the_loops_that_were_done(monkeypatch):
    Path("x.yaml").write_text(SCENARIO + "receding_horizon: {step_s: 0.5}\n")
    calls = itertools.count(1)

    def interrupted(problem, **settings):
        if next(calls) == 3:
            at_once()
        return simulate(problem, **settings)

    monkeypatch.setattr(
        sys.modules["maneuver_automaton.receding_horizon.statistics"], "simulate", interrupted
    )
    with listening():
        assert run(["mpc", "x.yaml", "--no-plot", "--quiet", "--seeds", "5"]) == 130
    document = written("statistics.json")
    assert document["interrupted"] is True
    assert document["loops_run"] == 2
    calls = itertools.count(3)
    Path("out/statistics.json").unlink()
    with listening():
        assert run(["mpc", "x.yaml", "--no-plot", "--quiet", "--seeds", "5"]) == 130
    assert not Path("out/statistics.json").exists()  # none was done


@pytest.mark.parametrize("step", [0, 3])
def test_a_drive_on_roads(monkeypatch, step):
    Path("road.xml").write_text(commonroad())
    decide, calls = RoadPlanner.decide, itertools.count(-1)  # twice before the first step

    def interrupted(*args, **settings):
        if next(calls) == step:
            at_once()
        return decide(*args, **settings)

    monkeypatch.setattr(RoadPlanner, "decide", interrupted)
    with listening():
        assert run(["mpc", "road.xml", "--no-plot", "--quiet"]) == 130
    document = written("closed_loop.json")
    assert document["interrupted"] is True
    assert len(document["steps"]) == step + 1
    assert "when the drive was interrupted" in document["reason"]


@pytest.mark.parametrize("found", [True, False])
def test_a_plan_on_roads(monkeypatch, found):
    Path("road.xml").write_text(commonroad() if found else commonroad(*LANES, problem(goal=LATE)))
    search = RoadPlanner.search

    def interrupted(*args, **settings):
        at_once()
        return search(*args, **settings)

    monkeypatch.setattr(RoadPlanner, "search", interrupted)
    with listening():
        assert run(["plan", "road.xml", "--no-plot", "--quiet"]) == 130
    document = written()
    assert document["interrupted"] is True
    assert document["status"] == ("found" if found else "out_of_budget")
    assert ("interrupted" in document["reason"]) is not found


# --- kill -9 ---


def killed(write: Callable[[], object]) -> bool:
    """Call a function in a process of its own that is killed before its first file is there."""
    child = os.fork()
    if child == 0:
        try:
            Path.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
            write()
        finally:
            os._exit(0)  # whatever was raised, no other test is for this process
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


WRITING = {
    "out/plan.json": lambda: run([*PLAN, "--quiet"]),
    "l.json": lambda: run(["automaton", "build", "x.yaml", "-o", "l.json"]),
    "out/closed_loop.json": lambda: run(["mpc", "loop.yaml", "--no-plot", "--quiet"]),
    "table": lambda: cost_to_go._save(np.ones(10_000, np.float32), Path("table").resolve()),
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("name", WRITING)
def test_killed_while_it_writes_a_command_leaves_whole_files(capfd, name):
    Path("loop.yaml").write_text(SCENARIO + "receding_horizon: {step_s: 0.5}\n")
    assert killed(WRITING[name])
    assert not Path(name).exists()
    WRITING[name]()  # the next one finds nothing amiss
    before = Path(name).read_bytes()
    assert killed(WRITING[name])  # what would be replaced stays
    assert Path(name).read_bytes() == before
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_killed_at_any_moment_a_file_is_whole(folder):
    code = (
        "import itertools, pathlib\n"
        "from maneuver_automaton._files import write_bytes_atomically\n"
        "for k in itertools.cycle(range(256)):\n"
        "    write_bytes_atomically(pathlib.Path('out/plan.json'), bytes([k]) * 200_000)\n"
    )
    root = {"PYTHONPATH": str(Path(__file__).parents[1])}
    for k in range(4):
        process = subprocess.Popen([sys.executable, "-c", code], env=os.environ | root)
        while not Path("out/plan.json").exists():
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(0.05 + 0.003 * k)
        process.kill()
        process.wait()
        content = Path("out/plan.json").read_bytes()
        assert content == content[:1] * 200_000
    left = list(Path("out").glob(".part-*"))
    for part in left:
        os.utime(part, (1, 1))
    _files.write_text_atomically(Path("out/plan.json"), "{}")  # the next run works, and tidies up
    assert [path.name for path in Path("out").iterdir()] == ["plan.json"]


# --- what is kept ---


def test_the_cache_is_shown_and_cleared(folder, monkeypatch, capsys):
    monkeypatch.setenv("MANEUVER_AUTOMATON_CACHE_DIR", str(folder / "cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "numba"))
    tables, kernels = folder / "cache" / FOLDER, folder / "numba" / f"{_kernel_folders.KERNELS}0"
    for place in (tables, kernels):
        place.mkdir(parents=True)
        _cache_files.write_checked(place / "a", bytes(2_000_000))
    (folder / "cache" / "mine.txt").write_text("not of the cache")
    assert run(["cache", "show"]) == 0
    printed = capsys.readouterr().out
    assert "tables of the cost to go, at most 500 MB" in printed
    assert "compiled kernels of another version" in printed
    assert printed.count(" 2.0 ") == 2
    assert run(["cache", "clear"]) == 0
    assert capsys.readouterr().out == "4.0 MB removed\n"
    assert not tables.exists()
    assert not kernels.exists()
    assert (folder / "cache" / "mine.txt").exists()
    assert run(["cache", "clear"]) == 0
