"""Pictures, films and pages of results; what draws them is loaded beside the planning."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from maneuver_automaton._interrupts import is_main_program
from maneuver_automaton.cli.inputs import Options
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.recording import Recording, recording_of


def draw(result: Any, name: str, file: Path, options: Options) -> None:
    """Write the pictures of a result that were asked for: `file` with their endings."""
    recording, plotting = recording_of(result), ready_to_draw()
    moves, on_roads = not why_no_film(recording), bool(recording.world.lanes)
    if options.plot and (moves or not on_roads):
        look = options.look.look(name)
        plotting.save_picture(recording, file.with_suffix(".png"), look=look)
        is_plan = recording.kind == "plan"
        if is_plan and plotting.flies_among_heights(recording):
            plotting.save_picture(recording, file.with_name("plan_3d.png"), look=look, view="space")
        if is_plan and options.budgets.gap is not None and recording.movers[0].has_plan:
            plotting.save_progress_figure(result, file.with_name("progress.png"), title=look.title)
        if recording.alternatives:
            path = file.with_name("alternatives.png")
            plotting.save_picture(recording, path, look=look, view="alternatives")
    if options.animate and moves:
        save_film(recording, file.with_suffix(".gif"), options.look.look(name))
    page = options.html or (options.animate and file.name == "closed_loop")
    if page and (moves or not on_roads or len(recording.movers) == 1):
        plotting.player_of(result, title=options.look.title or name).save(file.with_suffix(".html"))


def save_film(recording: Recording, path: Path, look: Look) -> None:
    """Animate a result; the title stands above those on roads alone."""
    plotting = ready_to_draw()
    titled = plotting.Look(title=look.title) if recording.world.lanes else None
    plotting.save_film(recording, path, look=titled)


def why_no_film(recording: Recording) -> str:
    """Why nothing moves in a result: it holds no plan; empty if something does."""
    if any(one.has_plan for one in recording.movers):
        return ""
    return f"holds no plan, its status is {recording.status!r}"


def ready_to_draw() -> Any:
    """What draws; Matplotlib writes no documentation of its classes, a fifth of its import."""
    from matplotlib import artist

    artist.kwdoc = lambda artist: ""
    from maneuver_automaton import plotting

    return plotting


class Draughtsman:
    """A process that draws: it loads Matplotlib while this one plans, and draws while it prints."""

    def __init__(self, process: int, pipe: int) -> None:
        self.process = process
        self.pipe = pipe  # -1 once it is closed

    def begin(self, draw: Callable[..., None], *args: Any) -> bool:
        """Have it draw; False where it cannot be told what."""
        try:
            order = pickle.dumps((draw, args))
        except Exception:  # noqa: BLE001, a model may hold functions that have no name
            return False
        try:
            with os.fdopen(self.pipe, "wb") as pipe:
                self.pipe = -1
                pipe.write(order)
        except OSError:  # it is gone
            return False
        return True

    def is_done(self) -> bool:
        """Wait for its pictures; False if something went wrong with them."""
        _, status = os.waitpid(self.process, 0)
        self.process = -1
        return status == 0

    def dismiss(self) -> None:
        """Have it end, if it has not yet."""
        if self.pipe >= 0:
            os.close(self.pipe)
        if self.process >= 0:
            os.kill(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)


@contextlib.contextmanager
def draughtsman(*, wanted: bool) -> Iterator[Draughtsman | None]:
    """A process that draws, if one is wanted and there is a processor for it; or none."""
    able = wanted and is_main_program() and sys.platform == "linux"
    if not (able and len(os.sched_getaffinity(0)) > 1):
        yield None
        return
    read, write = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(write)
        _serve(read)
    os.close(read)
    one = Draughtsman(process, write)
    try:
        yield one
    finally:
        one.dismiss()


def _serve(read: int) -> None:
    """Load what draws, wait for an order, carry it out and end; who asked does what fails."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        ready_to_draw()
        from maneuver_automaton.plotting.pictures import figure_of  # noqa: F401

        with os.fdopen(read, "rb") as pipe:
            order = pipe.read()
        if order:
            draw, args = pickle.loads(order)
            draw(*args)
            code = 0
    finally:
        os._exit(code)
