"""The picture of a covered field."""

from __future__ import annotations

from pathlib import Path

import shapely
from matplotlib.collections import LineCollection
from matplotlib.patches import Patch, PathPatch

from maneuver_automaton.field.covering import FieldResult
from maneuver_automaton.plotting import Look, draw_obstacles
from maneuver_automaton.plotting.colors import SEQUENCE
from maneuver_automaton.plotting.obstacles import region_path, shape_path
from maneuver_automaton.plotting.pages import page_of, write_figure
from maneuver_automaton.plotting.style import line_handle, mark_handle


def save_field_picture(covered: FieldResult, path: Path, *, name: str) -> None:
    """Draw field, headland, strips, swaths and turns."""
    problem, (worked, turned) = covered.problem, covered.lengths
    low, high = problem.shape.corners.min(axis=0), problem.shape.corners.max(axis=0)
    margin = 0.04 * float((high - low).max())
    soil, green = (0.93, 0.90, 0.84), (0.80, 0.88, 0.72)
    said = f"{len(covered.swaths)} swaths, {worked:.4g} m · turns {turned:.4g} m"
    plan = covered.result.plan
    if plan is not None:
        said += f" · duration {plan.duration:.4g} s · cost {covered.result.cost:.4g}"
    page = page_of(
        Look(title=name),
        [said, f"{100.0 * covered.covered:.3g} % inside the headland of {problem.headland:g} m"],
        [(Patch(facecolor=soil), "headland"),
         (Patch(facecolor=green), f"worked, {problem.width:g} m wide"),
         (line_handle(SEQUENCE[0]), "swath"), (line_handle(SEQUENCE[1]), "turn"),
         (mark_handle("s", size=6.5), "start")],
        shape=float((high - low)[0] / (high - low)[1]),
    )  # fmt: skip
    for area, color in ((problem.whole, soil), (covered.strips & problem.whole, green)):
        parts = region_path(shapely.get_parts(area))
        page.plane.add_patch(PathPatch(parts, facecolor=color, linewidth=0.0))
    page.plane.add_patch(PathPatch(shape_path(problem.shape), facecolor="none", linewidth=1.2))
    draw_obstacles(page.plane, problem.planner.obstacles)
    turns = [turn.sample().pose[:, :2] for turn in covered.turns]
    for lines, color in ((list(covered.swaths[:, :, :2]), SEQUENCE[0]), (turns, SEQUENCE[1])):
        page.plane.add_collection(LineCollection(lines, colors=[color], linewidths=1.4))
    page.plane.plot(*covered.swaths[0, 0, :2], "s", color="black", markerfacecolor="white")
    page.plane.set_xlim(low[0] - margin, high[0] + margin)
    page.plane.set_ylim(low[1] - margin, high[1] + margin)
    page.plane.set_aspect("equal")
    write_figure(page.figure, path)
