"""Pictures, films and pages of results; what draws them is loaded beside the planning."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from maneuver_automaton import plotting
from maneuver_automaton import recording as recordings
from maneuver_automaton._interrupts import is_main_program
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.plotting.look import Look, size_of


@dataclass(frozen=True, slots=True, kw_only=True)
class LookOptions:
    """What the command line says of pictures."""

    title: str | None = None  # None: the name of the scenario, and none in a paper
    size: str | None = None  # WIDTH or WIDTHxHEIGHT [in]
    style: str = "screen"
    plot: bool = True
    animate: bool = False
    html: bool = False

    def __post_init__(self) -> None:
        if self.size is not None or self.style != "screen":
            self.look()  # Matplotlib is needed anyway, and a wrong size is told before planning

    def look(self, name: str = "") -> Look:
        """The look of a picture of the scenario `name`; raises InvalidScenario."""
        title = self.title if self.title is not None else name
        if self.title is None and self.style == "paper":
            title = ""  # the caption has it
        try:
            size = None if self.size is None else size_of(self.size)
            return Look(title=title, size=size, style=self.style)
        except ValueError as error:
            raise InvalidScenario(f"--{error}") from error


def draw(result: Any, name: str, file: Path, asked: LookOptions, progress: bool) -> None:
    """Write the pictures of a result that were asked for: `file` with their endings."""
    recording, look, plotting = recordings.recording_of(result), asked.look(name), ready_to_draw()
    moves, on_roads = not why_no_film(recording), bool(recording.world.lanes)
    if asked.plot and (moves or not on_roads):
        plotting.save_picture(recording, file.with_suffix(".png"), look=look)
        is_plan = recording.kind == "plan"
        if is_plan and plotting.flies_among_heights(recording):
            plotting.save_picture(recording, file.with_name("plan_3d.png"), look=look, view="space")
        if is_plan and progress and recording.movers[0].has_plan:
            plotting.save_progress_figure(result, file.with_name("progress.png"), title=look.title)
        if recording.alternatives:
            path = file.with_name("alternatives.png")
            plotting.save_picture(recording, path, look=look, view="alternatives")
    if asked.animate and moves:
        save_film(recording, file.with_suffix(".gif"), look)
    page = asked.html or (asked.animate and file.name == "closed_loop")
    if page and (moves or not on_roads or len(recording.movers) == 1):
        plotting.player_of(result, title=asked.title or name).save(file.with_suffix(".html"))


def save_film(recording: recordings.Recording, path: Path, look: Look) -> None:
    """Animate a result; the title stands above those on roads alone."""
    plotting = ready_to_draw()
    titled = plotting.Look(title=look.title) if recording.world.lanes else None
    plotting.save_film(recording, path, look=titled)


def why_no_film(recording: recordings.Recording) -> str:
    """Why nothing moves in a result: it holds no plan; empty if something does."""
    return "" if recording.drivers else f"holds no plan, its status is {recording.status!r}"


def ready_to_draw() -> Any:
    """What draws; Matplotlib writes no documentation of its classes, a third of its import."""
    from matplotlib import artist

    artist.kwdoc = lambda artist: ""
    artist.Artist._update_set_signature_and_docstring = lambda: None  # type: ignore[attr-defined]
    return plotting


@dataclass(slots=True, eq=False)
class Draughtsman:
    """A process that draws: it loads Matplotlib while this one plans, and draws while it prints."""

    process: int
    pipe: int  # -1 once it is closed
    at_hand: ClassVar[Draughtsman | None] = None

    def begin(self, draw: Callable[..., None], *args: Any) -> bool:
        """Have it draw; False where it cannot be told what."""
        try:
            order = pickle.dumps((draw, args))
            with os.fdopen(self.pipe, "wb") as pipe:
                self.pipe = -1
                pipe.write(order)
        except Exception:  # noqa: BLE001, a model may hold functions without a name; or it is gone
            return False
        return True

    def is_done(self) -> bool:
        """Wait for its pictures; False if something went wrong with them."""
        _, status = os.waitpid(self.process, 0)
        self.process = -1
        return status == 0

    def dismiss(self) -> None:
        """Have it end, if it has not yet."""
        Draughtsman.at_hand = None
        if self.pipe >= 0:
            os.close(self.pipe)
        if self.process >= 0:
            os.kill(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)
        self.process = self.pipe = -1


@contextlib.contextmanager
def draughtsman(*, wanted: bool) -> Iterator[Draughtsman | None]:
    """Have a process at hand that draws, if one is wanted and there is a processor for it."""
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
    Draughtsman.at_hand = one = Draughtsman(process, write)
    try:
        yield one
    finally:
        one.dismiss()


def _serve(read: int) -> None:
    """Load what draws, wait for an order, carry it out and end; who asked does what fails."""
    code = 1
    try:
        for one in (signal.SIGINT, signal.SIGTERM):
            signal.signal(one, signal.SIG_DFL)
        for stream in (0, 1, 2):
            os.dup2(os.open(os.devnull, os.O_RDWR), stream)
        _ = ready_to_draw().figure_of
        from maneuver_automaton.plotting.pages import prepare

        prepare()
        with os.fdopen(read, "rb") as pipe:
            order = pipe.read()
        if order:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is begun is drawn
            draw, args = pickle.loads(order)
            draw(*args)
            code = 0
    finally:
        os._exit(code)
