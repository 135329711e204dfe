"""Pictures, films and pages of results; what draws them is loaded beside the planning."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton._interrupts import is_main_program
from maneuver_automaton.cli.options import Options

if TYPE_CHECKING:  # Matplotlib takes half a second
    from maneuver_automaton.plotting import Look


def draw(result: Any, name: str, file: Path, options: Options) -> None:
    """Write the pictures of a result that were asked for: `file` with their endings."""
    moves = not why_no_film(result)
    if options.plot and (moves or not on_roads(result)):
        look = options.look.look(name)
        save_picture(result, file.with_suffix(".png"), look)
        if type(result).__name__ == "PlanResult":
            _draw_more(result, file, options, look.title)
    if options.animate and moves:
        save_film(result, file.with_suffix(".gif"), options.look.look(name))
    page = options.html or (options.animate and file.name == "closed_loop")
    if page and (moves or not type(result).__name__.startswith("RoadFleet")):
        result.player(title=options.look.title or name).save(file.with_suffix(".html"))


def _draw_more(result: Any, file: Path, options: Options, title: str) -> None:
    """Further pictures of a plan, where there is something to see in them."""
    plotting = ready_to_draw()
    if plotting.flies_among_heights(result.problem):
        plotting.save_space_figure(result, file.with_name("plan_3d.png"), title=title)
    if options.budgets.gap is not None and result.plan is not None:
        plotting.save_progress_figure(result, file.with_name("progress.png"), title=title)
    if result.alternatives:
        plotting.save_alternatives_figure(result, file.with_name("alternatives.png"), title=title)


def why_no_film(result: Any) -> str:
    """Why nothing moves in a result: it holds no plan; empty if something does."""
    kind = type(result).__name__
    if kind in ("FleetResult", "RoadFleetResult", "RoadFleetDrive"):
        moves = bool(result.plans)
    else:
        moves = kind not in ("PlanResult", "RoadPlanResult") or result.plan is not None
    status = getattr(result, "status", "no_plan")
    return "" if moves else f"holds no plan, its status is {getattr(status, 'value', status)!r}"


def on_roads(result: Any) -> bool:
    """Whether a result is a plan or a drive on roads."""
    return type(result).__name__.startswith("Road")


def save_picture(result: Any, path: Path, look: Look) -> None:
    """Draw any result."""
    plotting, kind = ready_to_draw(), type(result).__name__
    if kind in ("RoadFleetResult", "RoadFleetDrive"):
        plotting.save_road_fleet_figure(result, _vehicle(result), path, look=look)
    elif on_roads(result):
        plan = result.plan if kind == "RoadPlanResult" else result.driven
        planner = result.planner
        plotting.save_road_figure(planner.scene, planner.vehicle, plan, path, look=look)
    elif kind == "PlanResult":
        plotting.save_plan_figure(result, path, nodes=result.nodes, look=look)
    elif kind == "FleetResult":
        plotting.save_fleet_figure(result, path, look=look)
    elif kind == "FleetLog":
        plotting.save_fleet_loop_figure(result, path, look=look)
    else:
        plotting.save_closed_loop_figure(result, path, look=look)


def save_film(result: Any, path: Path, look: Look) -> None:
    """Animate any result in which something moves."""
    plotting, kind = ready_to_draw(), type(result).__name__
    if kind in ("RoadFleetResult", "RoadFleetDrive"):
        plotting.save_road_fleet_animation(result, _vehicle(result), path, look=look)
    elif on_roads(result):
        plan = result.plan if kind == "RoadPlanResult" else result.driven
        planner = result.planner
        titled = replace(planner.scene, name=look.title or planner.scene.name)
        plotting.save_road_animation(titled, planner.vehicle, plan, path)
    elif kind == "PlanResult":
        plotting.save_plan_animation(result.plan, path, problem=result.problem)
    elif kind == "FleetResult":
        plotting.animate_fleet(result, path)
    elif kind == "FleetLog":
        plotting.animate_fleet_loop(result, path)
    else:
        plotting.save_closed_loop_animation(result, path)


def _vehicle(result: Any) -> Any:
    return next(iter(result.results.values())).planner.vehicle


def ready_to_draw() -> Any:
    """What draws; Matplotlib writes no documentation of its classes, a fifth of its import."""
    from matplotlib import artist

    artist.kwdoc = _nothing  # type: ignore[assignment]
    from maneuver_automaton import plotting

    return plotting


def _nothing(_: object) -> str:
    return ""


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
    if not (wanted and is_main_program() and sys.platform == "linux" and _processors() > 1):
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


def _processors() -> int:
    return len(os.sched_getaffinity(0))


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
        from maneuver_automaton.plotting import plan_figures  # noqa: F401

        with os.fdopen(read, "rb") as pipe:
            order = pipe.read()
        if order:
            draw, args = pickle.loads(order)
            draw(*args)
            code = 0
    finally:
        os._exit(code)
