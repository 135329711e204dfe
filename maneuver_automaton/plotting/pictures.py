"""The picture of any result as a file: the plane, what happens over time, a heading, a legend."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from maneuver_automaton.plotting.cast import MARGIN, Cast, cast_of, cast_of_alternatives
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.over_time import panels_of
from maneuver_automaton.plotting.pages import EDGE, page_of, write_figure
from maneuver_automaton.plotting.plane import draw_cast, plane_entries
from maneuver_automaton.plotting.searches import draw_cost_bar
from maneuver_automaton.plotting.style import word_text
from maneuver_automaton.recording import Recording, recording_of

VIEWS = ("plane", "space", "alternatives")
WORD_LINES, CHARACTER = 2, 0.08  # lines of the word, and [in] of each character
MOST_REASONS, MOST_NAMES = 4, 4  # above a picture, and names of vehicles for each
MOST_BROKEN, TEXT_WIDTH = 2, 132


def save_picture(
    result: Any, path: str | Path, *, look: Look | None = None, view: str = "plane"
) -> None:
    """Write the picture of any `result` that `figure_of` makes.

    The file is replaced in one step; its ending chooses the format.

    Raises
    ------
    TypeError
        If it is no result.
    ValueError
        If there is no such view of it, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(figure_of(result, look=look, view=view), path)


def figure_of(result: Any, *, look: Look | None = None, view: str = "plane") -> Figure:
    """The picture of any `result`: those who drive among what is around them, and over time.

    Parameters
    ----------
    result : Plan, PlanResult, ClosedLoop, FleetResult, FleetLog, a drive on roads, or Recording
        What to draw. Without a plan it shows start and goals, and says why there is none.
    look : Look, optional
        Title, size and style.
    view : str
        "plane"; "space", in space, from above and from the side, if all fly; or "alternatives",
        all plans of one result over each other.

    Returns
    -------
    Figure
        It belongs to no window; its axes are the plane, then what is over time.

    Raises
    ------
    TypeError
        If it is no result.
    ValueError
        If there is no such view of it.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Problem, Unicycle, plan
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> figure = figure_of(plan(Problem(robot, [0, 0, 0], [2, 0, 0])), look=Look(title="Ahead"))
    >>> figure.texts[0].get_text(), len(figure.axes)
    ('Ahead', 3)
    """
    recording, look = recording_of(result), look or Look()
    if recording.world.lanes and not look.title:
        look = replace(look, title=recording.title)
    if view not in VIEWS:
        raise ValueError(f"view: got {view!r}, need one of {', '.join(VIEWS)}")
    if view == "space":
        from maneuver_automaton.plotting.space import space_figure

        return space_figure(cast_of(recording), heading_of(recording, look), look)
    if view == "alternatives":
        if not recording.movers[0].has_plan:
            raise ValueError(f"alternatives: the result holds no plan: {recording.reason}")
        count = 1 + len(recording.alternatives)
        said = "1 plan" if count == 1 else f"{count} locally optimal plans, best first"
        return _figure(cast_of_alternatives(recording, width=60), [said], look)
    if recording.alternatives:
        recording = replace(recording, alternatives=())
    return _figure(cast_of(recording), heading_of(recording, look), look)


def _figure(cast: Cast, lines: Sequence[str], look: Look) -> Figure:
    panels = panels_of(cast)
    wide, high = np.ptp(cast.box, axis=0) * (1.0 + 2.0 * MARGIN)
    entries = [*plane_entries(cast)]
    known = {name for _, name in entries}
    entries += [row for panel in panels for row in panel.entries if row[1] not in known]
    page = page_of(
        look,
        lines,
        entries,
        shape=max(float(wide), 1e-9) / max(float(high), 1e-9),
        panels=[panel.height for panel in panels],
    )
    artists = draw_cast(page.plane, cast, numbered=look.numbered)
    for ax, panel in zip(page.panels, panels, strict=False):
        panel.draw(ax)
    page.share_times()
    if (ticks := artists.get("nodes")) is not None and ticks.get_array() is not None:
        draw_cost_bar(page.figure, page.plane, ticks)
    return page.figure


def heading_of(recording: Recording, look: Look) -> list[str]:
    """Lines that say how it ended and what is known of it, the word of a plan, what went wrong."""
    first = recording.movers[0]
    facts = [f"{one.label} {one.text}" for one in recording.heading]
    if recording.kind == "plan" and not first.has_plan:
        return [one.text for one in recording.heading]
    tells = recording.kind == "closed_loop" or bool(recording.reason)  # more than the facts do
    lines = [recording.ending] if tells and recording.kind != "plan" else []
    lines += [" · ".join(facts), recording.world.source]
    if recording.kind == "plan":
        lines.append(_word(first.pieces[0].word, look))
    broken = [one.text for one in recording.events if one.kind == "broken"]
    lines += [textwrap.shorten(text, TEXT_WIDTH, placeholder=" …") for text in broken[:MOST_BROKEN]]
    if (more := len(broken) - MOST_BROKEN) > 0:
        lines.append(f"and {more} more guarantee{'s' if more > 1 else ''} broken")
    return lines + _reasons(recording)


def _word(word: Sequence[str], look: Look) -> str:
    """The word of a plan in the lines that there are for it."""
    return word_text(word, width=int((look.width - 2.0 * EDGE) / CHARACTER), lines=WORD_LINES)


def _reasons(recording: Recording) -> list[str]:
    """Why some do not arrive: a line for each reason, with the names that it holds for."""
    named: dict[str, list[str]] = {}
    for one in recording.movers:
        if one.name and not (one.has_plan and one.reached):
            named.setdefault(one.reason or "no plan", []).append(one.name)
    lines = []
    for reason, names in named.items():
        more = len(names) - MOST_NAMES
        rest = f" and {more} more" if more > 0 else ""
        lines.append(f"{', '.join(names[:MOST_NAMES])}{rest}: {reason}")
    more = len(lines) - MOST_REASONS
    return lines if more <= 0 else [*lines[:MOST_REASONS], f"and {more} more reasons"]
