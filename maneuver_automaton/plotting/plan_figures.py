"""The picture of a plan as a file: its path among obstacles, and its controls over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_array
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.labels import control_labels, result_text, stated_labels, word_text
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import (
    heading_height,
    heading_text,
    new_figure,
    title_lines,
    write_figure,
)
from maneuver_automaton.plotting.paths import bare_scene
from maneuver_automaton.plotting.plan_page import LEFT, RIGHT, Sheet, plan_page
from maneuver_automaton.plotting.scene import (
    plan_scene,
)
from maneuver_automaton.plotting.track import Track, track_of_document, track_of_plan

WORD_LINES, CHARACTER = 2, 0.08  # lines of the word, and [in] of each character


def save_plan_figure(
    result: PlanResult,
    path: str | Path,
    *,
    footprint: Any = None,
    nodes: ArrayLike | None = None,
    look: Look | None = None,
) -> None:
    """Write the picture of a `result`: obstacles, path, what the body sweeps, controls over time.

    Without a plan it shows start and goal, and says why there is none. The file is replaced in
    one step; its ending chooses the format.

    Parameters
    ----------
    result : PlanResult
        What to draw.
    path : str or Path
        Where to write.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; that of the problem if left out.
    nodes : (n, 3) or (n, 4) array_like, optional
        Poses that the search has expanded [m, m, rad], and the cost of each.
    look : Look, optional
        Title, size and style.

    Raises
    ------
    ValueError
        If the nodes are none, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(plan_figure(result, footprint=footprint, nodes=nodes, look=look), path)


def plan_figure(
    result: PlanResult,
    *,
    footprint: Any = None,
    nodes: ArrayLike | None = None,
    look: Look | None = None,
) -> Figure:
    """The picture of a `result` that `save_plan_figure` writes, in no window.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Problem, Unicycle, plan
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> figure = plan_figure(plan(Problem(robot, [0, 0, 0], [2, 0, 0])), look=Look(title="Ahead"))
    >>> figure.texts[0].get_text()
    'Ahead'
    """
    problem, plan = result.problem, result.plan
    look = look or Look()
    if plan is None:
        track = Track(problem.start, ())
        headline = _no_plan_text(result.status.value, result.reason)
    else:
        track = track_of_plan(plan)
        error = result.terminal_error
        headline = result_text(
            cost=result.cost,
            duration=plan.duration,
            error_m=None if error is None else error.position_m,
            error_rad=None if error is None else error.heading_rad,
            clearance_m=result.clearance_m,
        )
    sheet = Sheet(
        track=track,
        scene=plan_scene(problem, plan, footprint=footprint),
        word="" if plan is None else _word(plan.word, look),
        headline=headline,
        labels=control_labels(problem.automaton.model.control_names),
        state_labels=control_labels(problem.automaton.model.reduced_names),
        look=look,
        nodes=None if nodes is None else as_array("nodes", nodes, last=(3, 4)),
        reached=result.reached,
        narrowest=result.narrowest,
    )
    return plan_page(sheet)


def save_plan_file_figure(
    document: Mapping[str, Any],
    path: str | Path,
    *,
    footprint: Any = None,
    look: Look | None = None,
) -> None:
    """Write the picture of a loaded plan.json: that of `save_plan_figure`, from the file alone.

    The file states neither body nor obstacles. Controls are numbered if it does not name them.

    Raises
    ------
    KeyError
        If a key of the contract is missing.
    ValueError
        If the trajectory holds no numbers, or its columns differ in length.
    """
    track = track_of_document(document)
    error = document.get("terminal_error") or {}
    look = look or Look()
    if track is None:
        headline = _no_plan_text(str(document["status"]), document.get("reason") or "")
        write_figure(_empty_figure(headline, look), path)
        return
    sheet = Sheet(
        track=track,
        scene=bare_scene(track, footprint=footprint),
        word=_word([str(part["name"]) for part in document["primitives"]], look),
        headline=result_text(
            cost=document.get("cost"),
            duration=document.get("duration_s"),
            error_m=error.get("position_m"),
            error_rad=error.get("heading_rad"),
            clearance_m=document.get("clearance_m"),
        ),
        labels=stated_labels(document, "control"),
        state_labels=stated_labels(document, "reduced_state"),
        look=look,
    )
    write_figure(plan_page(sheet), path)


def _word(word: Sequence[str], look: Look) -> str:
    """The word of a plan in the lines that there are for it."""
    return word_text(word, width=int((look.width - LEFT - RIGHT) / CHARACTER), lines=WORD_LINES)


def _no_plan_text(status: str, reason: str) -> str:
    return f"{status.replace('_', ' ')}: {reason}".rstrip(": ")


def _empty_figure(headline: str, look: Look) -> Figure:
    lines = title_lines(look, look.width - 0.6, headline)
    figure = new_figure(look.width, heading_height(lines) + 0.18)
    heading_text(figure, lines, left=0.3)
    return figure
