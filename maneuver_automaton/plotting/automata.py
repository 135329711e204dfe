"""Draw an automaton: its graph, or its motions where it has too many trims; and its maneuvers."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, Color, track_colors, twist_color
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import plain_page, settled, write_figure
from maneuver_automaton.plotting.paths import ARC_POINTS, DART
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, shortened, tidy
from maneuver_automaton.plotting.track import placed
from maneuver_automaton.primitives import Maneuver, Trim

MOST_SINGLE = 48  # maneuvers that have a panel each
MOST_PANELS = 120
PANEL, LINE, LEAST_WIDTH = 1.5, 0.13, 4.8  # [in] of a panel, of a line of its name, of a page
COLUMNS = 8
IN_LINE, HARD = 25, "\N{NO-BREAK SPACE}"  # characters of a name in a line
FULL_COLOR = 0.6  # [rad] of a change of heading
ROOM = 1.35  # side of a panel, over the size of what is in it
DART_SIZE = 0.075  # of the side of a panel


def draw_maneuvers(ax: Axes, maneuvers: Sequence[Maneuver]) -> dict[str, Any]:
    """Draw `maneuvers` on `ax`, to scale from the origin, which heads right.

    The colour of a path tells its change of heading: orange to the left, blue to the right, grey
    for none. Dots are a second apart. A motion that is not known is a dashed straight line. The
    artists by what they show: paths, and darts at the start and the ends.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> go = Maneuver(name="go", source="rest", target="ahead", displacement=[1.0, 0.0, 0.0])
    >>> len(draw_maneuvers(Figure().add_subplot(), [go])["paths"].get_segments())
    1
    """
    courses = [_poses(maneuver) for maneuver in maneuvers]
    points = np.concatenate([np.zeros((1, 2)), *(poses[:, :2] for poses in courses)])
    low, high = points.min(axis=0), points.max(axis=0)
    center, half = 0.5 * (low + high), 0.5 * ROOM * float((high - low).max()) or 1.0
    colors = [_color(maneuver) for maneuver in maneuvers]
    paths = LineCollection(
        [poses[:, :2] for poses in courses], colors=colors, linewidths=1.3, zorder=3.0,
        linestyles=["solid" if one.course is not None else (0, (3, 2)) for one in maneuvers],
    )  # fmt: skip
    ax.add_collection(paths)
    size = 2.0 * half * DART_SIZE
    ends = np.array([one.displacement[:3] for one in maneuvers]).reshape(-1, 3)
    darts = PolyCollection(
        [*placed([size * DART], np.zeros((1, 3))), *placed([0.85 * size * DART], ends)],
        facecolors=[INK, *colors], linewidths=0.0, zorder=4.0,
    )  # fmt: skip
    ax.add_collection(darts)
    seconds = np.concatenate([  # every full one, the ends left out
        np.zeros((0, 2)),
        *(
            one.course.pose_at(np.arange(1.0, one.duration))[:, :2]
            for one in maneuvers
            if one.course is not None and one.duration > 1.0
        ),
    ])  # fmt: skip
    ax.plot(
        seconds[:, 0], seconds[:, 1], linestyle="none", marker="o", markersize=1.8, color=INK,
        zorder=3.5,
    )  # fmt: skip
    _frame(ax, center, half)
    return {"paths": paths, "darts": darts}


def save_maneuvers_figure(
    automaton: Automaton, path: str | Path, *, look: Look | None = None
) -> None:
    """Write pictures of every maneuver of an `automaton`, each panel to its own scale.

    Up to 48 have a panel each; more are drawn together with those that leave the same trim, in at
    most 120 panels. The file is replaced in one step; its ending chooses the format.

    Parameters
    ----------
    automaton : Automaton
        What to draw.
    path : str or Path
        Where to write.
    look : Look, optional
        Title, width and style; the height follows from the panels.

    Raises
    ------
    ValueError
        If there is no maneuver.
    """
    panels = _panels(automaton)
    if not panels:
        raise ValueError(f"{automaton.name or 'automaton'}: has no maneuver to draw")
    look = look or Look()
    left_out, panels = len(panels) - MOST_PANELS, panels[:MOST_PANELS]
    stated = look.is_paper or look.size is not None
    columns = max(1, min(int(look.width / PANEL) if stated else COLUMNS, len(panels)))
    rows = math.ceil(len(panels) / columns)
    above = LINE * max(name.count("\n") + 1 for name, _ in panels)
    more = f"; {left_out} more trims are left out" if left_out > 0 else ""
    name = shortened(automaton.name or automaton.model.name.replace("_", " "), 40)
    legend = "how wide a panel is stands in it; dots are 1 s apart; orange turns left, blue right"
    figure, axes = plain_page(
        replace(look, size=None),
        [f"{name}: {_count(automaton)}", legend + more],
        [
            [str(k) if k < len(panels) else "" for k in range(first, first + columns)]
            for first in range(0, rows * columns, columns)
        ],
        width=look.width if stated else max(columns * PANEL, LEAST_WIDTH),
        height=rows * (PANEL + above),
    )
    for ax, (name, maneuvers) in zip(axes.values(), panels, strict=True):
        draw_maneuvers(ax, maneuvers)
        ax.text(
            0.04, 0.04, f"{np.ptp(ax.get_xlim()):.2g} m", transform=ax.transAxes, color=INK,
            fontsize=SMALL_PT - 2.0,
        )  # fmt: skip
        ax.set_title(name, fontsize=SMALL_PT - 2.0, color=INK, parse_math=False, pad=2.5)
    write_figure(figure, path)


def _panels(automaton: Automaton) -> list[tuple[str, list[Maneuver]]]:
    """Titles, and the maneuvers under each."""
    if len(automaton.maneuvers) <= MOST_SINGLE:
        return [
            (f"{_wrapped(one.source)}\n{_wrapped(f'to {one.target}, {one.duration:.3g} s')}", [one])
            for one in automaton.maneuvers
        ]
    leaving: dict[str, list[Maneuver]] = {}
    for one in automaton.maneuvers:
        leaving.setdefault(one.source, []).append(one)
    return [
        (f"{_wrapped(f'from {name}')}\n{len(many)} maneuver{'s' if len(many) > 1 else ''}", many)
        for name in automaton.trim_names
        if (many := leaving.get(name))
    ]


def _wrapped(name: str) -> str:
    """A name in lines as wide as a panel, broken between its parts rather than within them."""
    held = shortened(name, 3 * IN_LINE).replace(" ", HARD).replace(f",{HARD}", ", ")
    return textwrap.fill(held, IN_LINE).replace(HARD, " ")


def _count(automaton: Automaton) -> str:
    trims, maneuvers = len(automaton), len(automaton.maneuvers)
    plural = "s" if maneuvers > 1 else ""
    return f"{maneuvers} maneuver{plural} between {trims} trim{'s' if trims > 1 else ''}"


def _poses(maneuver: Maneuver) -> Array:
    if maneuver.course is not None:
        return maneuver.course.pose
    return np.stack([np.zeros_like(maneuver.displacement), maneuver.displacement])


def _color(maneuver: Maneuver) -> Color:
    turn = float(maneuver.displacement[2])
    share = min(1.0, abs(turn) / FULL_COLOR)
    towards = SEQUENCE[1] if turn > 0.0 else SEQUENCE[0]
    red, green, blue = (
        (1.0 - share) * grey + share * full for grey, full in zip(GREY, towards, strict=True)
    )
    return red, green, blue


def _frame(ax: Axes, center: Array, half: float) -> None:
    ax.set_aspect("equal")
    ax.set_xlim(center[0] - half, center[0] + half)
    ax.set_ylim(center[1] - half, center[1] + half)
    ax.set_xticks([0.0])
    ax.set_yticks([0.0])
    ax.tick_params(labelbottom=False, labelleft=False, length=0.0)
    ax.grid(visible=True, color=GREY, alpha=0.3, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[:].set(color=GREY, linewidth=0.5, alpha=0.6)


MOST_NODES = 30
MOST_HEADED = 60  # free switches, or maneuvers, that have an arrow head at each end
LEAST_ALPHA = 0.16  # of arrows where they are very many
SHOWN_S = 1.0  # how long each trim is shown [s]
SPIN_SIZE = 0.45  # of a node, for turns on the spot
MOST_LEVEL_NAMES = 12
NAME_PT, NAME_LENGTH, CHARACTER = 7.5, 40, 0.058  # [pt], characters, [in]
GRAPH, MOTIONS = 4.4, 3.6  # [in] of the graph, and of the motions beside it
RAY, LEAST_LENGTH = 0.27, 6  # of the side of a graph, and characters, for a name that sticks out
RING = 4.2  # [in] of a ring of nodes whose names stick out


def draw_automaton(ax: Axes, automaton: Automaton) -> dict[str, Any]:
    """Draw an `automaton` on `ax`.

    Up to thirty trims are nodes of a graph, each with a picture of one second of its motion;
    thin lines join trims that switch at will, arrows are maneuvers. More trims are points over
    turn rate and speed, joined by lines where there are maneuvers. The artists by what they show:
    nodes, motions, switches, maneuvers and names of a graph, else points and switches.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    >>> [text.get_text() for text in draw_automaton(Figure().add_subplot(), robot)["names"]]
    ['rest', 'ahead']
    """
    if len(automaton) > MOST_NODES:
        return _draw_points(ax, automaton)
    return _draw_graph(ax, automaton)


def draw_motions(ax: Axes, automaton: Automaton) -> LineCollection:
    """Draw one second of every trim from the same pose, to scale, in the colours of the trims."""
    many = len(automaton) > MOST_NODES
    paths = [_motion(trim)[:, :2] for trim in automaton.trims]
    size = max(float(np.abs(path).max()) for path in paths) or 1.0
    colors = _colors(automaton)
    lines = LineCollection(
        paths, colors=colors, linewidths=0.7 if many else 2.2, zorder=3.0,
        alpha=0.6 if many else 1.0,
    )  # fmt: skip
    ax.add_collection(lines)
    moving = [] if many else [k for k, path in enumerate(paths) if np.ptp(path, axis=0).any()]
    ax.add_collection(
        PolyCollection(
            [_arrow_head(paths[k], 0.25 * size) for k in moving],
            facecolors=[colors[k] for k in moving], linewidths=0.0, zorder=3.2,
        )
    )  # fmt: skip
    ax.add_collection(
        PolyCollection([0.08 * size * DART], facecolors=[INK], linewidths=0.0, zorder=4.0)
    )
    ax.update_datalim([(-0.1 * size, -0.1 * size), (0.1 * size, 0.1 * size)])
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    ax.autoscale_view()
    tidy(ax, x="x [m]", y="y [m]")
    return lines


def save_automaton_figure(
    automaton: Automaton, path: str | Path, *, look: Look | None = None
) -> None:
    """Write a picture of an `automaton`: its graph, and one second of each trim to scale.

    The file is replaced in one step; its ending chooses the format.

    Parameters
    ----------
    automaton : Automaton
        What to draw.
    path : str or Path
        Where to write.
    look : Look, optional
        Title, size and style; a narrow page has the motions below the graph.
    """
    look = look or Look()
    points, high = len(automaton) > MOST_NODES, GRAPH
    if not points and len(automaton) > MOST_LEVEL_NAMES:
        longest = max(min(len(name), NAME_LENGTH) for name in automaton.trim_names)
        high = RING + 2.0 * CHARACTER * longest  # names stick out like rays
    stated = look.is_paper or look.size is not None
    width = look.width if stated else high + MOTIONS + 1.0
    name = automaton.name or automaton.model.name.replace("_", " ")
    counts = f"{len(automaton)} trim{'s' if len(automaton) > 1 else ''}"
    if automaton.maneuvers:
        many = len(automaton.maneuvers)
        counts += f", {many} maneuver{'s' if many > 1 else ''}"
    lines, mosaic = [f"{shortened(name, 60)}: {counts}"], [["graph", "motions"]]
    ratios = {"width_ratios": (max(width - MOTIONS, MOTIONS), MOTIONS)}
    if look.is_narrow:
        high, mosaic = min(high, width), [["graph"], ["motions"]]
        high, ratios = high + MOTIONS, {"height_ratios": (high, MOTIONS)}
    figure, axes = plain_page(look, lines, mosaic, width=width, height=high, **ratios)
    graph, motions = axes["graph"], axes["motions"]
    if automaton.maneuvers and not automaton.body_velocities.any():
        draw_maneuvers(motions, automaton.maneuvers)
        said = f"every maneuver, {np.ptp(motions.get_xlim()):.3g} m wide"
    else:
        draw_motions(motions, automaton)
        motions.set_box_aspect(1.0)
        said = "1 s of each trim from the same pose"
    motions.set_title(said, fontsize=TEXT_PT, color=INK, loc="left")
    if not points:
        graph.set_axis_off()
        settled(figure)  # the names have room by the size of the axes
    draw_automaton(graph, automaton)
    write_figure(figure, path)


def _colors(automaton: Automaton) -> list[Color]:
    if len(automaton) > MOST_NODES:
        return [twist_color(trim.body_velocity) for trim in automaton.trims]
    named = track_colors({trim.name: trim.body_velocity for trim in automaton.trims})
    return [named[name] for name in automaton.trim_names]


def _draw_points(ax: Axes, automaton: Automaton) -> dict[str, Any]:
    twists = automaton.body_velocities
    points = ax.scatter(
        twists[:, 2], twists[:, 0], s=min(26.0, 9000.0 / len(automaton)), c=_colors(automaton),
        linewidths=0.0, zorder=3.0,
    )  # fmt: skip
    places = twists[:, [2, 0]]
    pairs = {
        (automaton.index_of(one.source), automaton.index_of(one.target))
        for one in automaton.maneuvers
    }
    switches = LineCollection(
        [places[list(pair)] for pair in sorted(pairs)], colors=[GREY], linewidths=0.6, zorder=2.0,
        alpha=max(0.05, min(0.6, 60.0 / max(len(pairs), 1))),
    )  # fmt: skip
    ax.add_collection(switches)
    tidy(ax, x="turn rate [rad/s]", y="speed ahead [m/s]")
    return {"points": points, "switches": switches}


def _draw_graph(ax: Axes, automaton: Automaton) -> dict[str, Any]:
    centres, radius = _places(automaton)
    colors = _colors(automaton)
    classes = automaton.trim_classes
    nodes = PolyCollection(
        [centre + radius * _disc() for centre in centres], facecolors="white", edgecolors=colors,
        linewidths=1.6, zorder=3.0,
    )  # fmt: skip
    pairs = combinations(range(len(automaton)), 2)
    free = [centres[[a, b]] for a, b in pairs if classes[a] == classes[b]]
    switches = LineCollection(
        free, colors=[GREY], linewidths=0.6,
        alpha=0.7 if len(automaton) <= MOST_LEVEL_NAMES else 0.25, zorder=1.0,
    )  # fmt: skip
    if len(free) <= MOST_HEADED:  # arrow heads at both ends, where there is room between nodes
        ways = [(b, b - a, float(np.linalg.norm(b - a))) for p in free for a, b in (p, p[::-1])]
        tips = [_tip(at, way / far, radius) for at, way, far in ways if far > 2.6 * radius]
        ax.add_collection(PolyCollection(tips, facecolors=[GREY], linewidths=0.0, zorder=2.0))
    pictures, heads = _trim_pictures(automaton, radius)
    motions = LineCollection(
        [picture + centre for picture, centre in zip(pictures, centres, strict=True)],
        colors=colors, linewidths=1.8, zorder=4.0,
    )  # fmt: skip
    artists: dict[str, Any] = {"nodes": nodes, "switches": switches, "motions": motions}
    for part in artists.values():
        ax.add_collection(part)
    ax.add_collection(
        PolyCollection(
            [head + centre for head, centre in zip(heads, centres, strict=True)],
            facecolors=colors, linewidths=0.0, zorder=4.1,
        )
    )  # fmt: skip
    artists["maneuvers"] = _draw_maneuver_arrows(ax, automaton, centres, radius)
    artists["names"] = _draw_names(ax, automaton, centres, radius)
    _make_room(ax, automaton, radius)
    ax.set_axis_off()
    return artists


def _places(automaton: Automaton) -> tuple[Array, float]:
    """Centres (m, 2) on a circle, classes side by side, and the radius of the nodes."""
    many = len(automaton)
    if many == 1:
        return np.zeros((1, 2)), 0.4
    classes = automaton.trim_classes
    firsts = np.array([int(np.argmax(classes == where)) for where in classes])
    order = np.argsort(firsts, kind="stable")
    angle = np.empty(many)
    angle[order] = 0.5 * np.pi - 2.0 * np.pi * np.arange(many) / many
    centres = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return centres, float(min(0.26, 0.8 * np.sin(np.pi / many)))


def _draw_names(ax: Axes, automaton: Automaton, centres: Array, radius: float) -> tuple[Text, ...]:
    """Names outside the circle; where they are many, they stick out like rays."""
    names, length = [], _name_length(ax, automaton)
    for name, (x, y) in zip(automaton.trim_names, centres, strict=True):
        out = np.array([x, y]) if x or y else np.array([0.0, 1.0])
        right, up = np.array([x, y]) + 1.18 * radius * out
        if len(automaton) > MOST_LEVEL_NAMES:
            side, level = ("left" if x > -1e-9 else "right"), "center"
            tilt = np.degrees(np.arctan2(y, x)) if x > -1e-9 else np.degrees(np.arctan2(-y, -x))
        else:
            side = "center" if abs(out[0]) < 0.2 else "left" if x > 0.0 else "right"
            level = "center" if abs(out[1]) < 0.5 else "bottom" if out[1] > 0.0 else "top"
            tilt = 0.0
        names.append(
            ax.text(
                right, up, shortened(name, length), fontsize=NAME_PT, color=INK, ha=side,
                va=level, rotation=tilt, rotation_mode="anchor", parse_math=False, zorder=5.0,
            )
        )  # fmt: skip
    return tuple(names)


def _name_length(ax: Axes, automaton: Automaton) -> int:
    """Characters of a name; those that stick out like rays have no more than the axes have room."""
    if len(automaton) <= MOST_LEVEL_NAMES:
        return NAME_LENGTH
    side = min(ax.bbox.width, ax.bbox.height) / ax.figure.dpi
    return max(LEAST_LENGTH, min(NAME_LENGTH, int(RAY * side / CHARACTER)))


def _make_room(ax: Axes, automaton: Automaton, radius: float) -> None:
    """Limits that leave room for the names, as far as the size of the axes tells."""
    wide, high = ax.bbox.width / ax.figure.dpi, ax.bbox.height / ax.figure.dpi
    name = CHARACTER * min(max(map(len, automaton.trim_names)), _name_length(ax, automaton)) + 0.1
    above = name if len(automaton) > MOST_LEVEL_NAMES else 0.2
    reach = (1.0 if len(automaton) > 1 else 0.0) + 1.2 * radius
    unit = max(min(0.5 * wide - name, 0.5 * high - above), 0.2 * min(wide, high)) / reach  # [in]
    ax.set_aspect("equal")
    ax.set_xlim(-0.5 * wide / unit, 0.5 * wide / unit)
    ax.set_ylim(-0.5 * high / unit, 0.5 * high / unit)


def _motion(trim: Trim) -> Array:
    plan = Plan(np.zeros(trim.body_velocity.size), (trim,), durations=np.array([SHOWN_S]))
    return plan.pose_at(np.linspace(0.0, SHOWN_S, ARC_POINTS))


def _disc() -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _trim_pictures(automaton: Automaton, radius: float) -> tuple[list[Array], list[Array]]:
    """Paths (n, 2) of all trims to one scale, about the centre of their node, and arrow heads."""
    poses = [_motion(trim) for trim in automaton.trims]
    lines = [np.stack([-pose[:, 1], pose[:, 0]], axis=-1) for pose in poses]
    widest = max(float(np.linalg.norm(np.ptp(line, axis=0))) for line in lines)
    scale = 1.25 * radius / widest if widest > 0.0 else 1.0
    pictures, heads = [], []
    for pose, line in zip(poses, lines, strict=True):
        turn = float(np.clip(pose[-1, 2], -1.8 * np.pi, 1.8 * np.pi))
        if not line.any() and turn:
            angle = 0.5 * np.pi + np.linspace(0.0, turn, ARC_POINTS)
            picture = SPIN_SIZE * radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        elif line.any():
            picture = scale * (line - 0.5 * (line.min(axis=0) + line.max(axis=0)))
        else:
            picture = np.zeros((2, 2))
        pictures.append(picture)
        heads.append(_arrow_head(picture, radius))
    return pictures, heads


def _arrow_head(picture: Array, radius: float) -> Array:
    """Arrow head at the end of a picture; a dot for one that does not move."""
    step = picture[-1] - picture[-2]
    length = float(np.linalg.norm(step))
    if length == 0.0:
        return 0.12 * radius * _disc()
    along = step / length
    aside = np.array([-along[1], along[0]])
    tip = picture[-1] + 0.2 * radius * along
    return np.array([tip, picture[-1] + 0.13 * radius * aside, picture[-1] - 0.13 * radius * aside])


def _tip(centre: Array, along: Array, radius: float) -> Array:
    """An arrow head (3, 2) that comes `along` (2,) and touches the node at `centre`."""
    size = min(0.045, 0.3 * radius)
    aside = np.array([-along[1], along[0]])
    tip = centre - 1.03 * radius * along
    foot = tip - size * along
    return np.array([tip, foot + 0.4 * size * aside, foot - 0.4 * size * aside])


def _draw_maneuver_arrows(
    ax: Axes, automaton: Automaton, centres: Array, radius: float
) -> tuple[FancyArrowPatch, ...]:
    """One curved arrow for each ordered pair of trims that a maneuver joins."""
    arrows = []
    pairs = dict.fromkeys((maneuver.source, maneuver.target) for maneuver in automaton.maneuvers)
    many = len(pairs) > MOST_HEADED
    alpha = max(LEAST_ALPHA, MOST_HEADED / len(pairs)) if many else 1.0
    for source, target in pairs:
        both = many and source != target and (target, source) in pairs
        if both and automaton.index_of(target) < automaton.index_of(source):
            continue
        begin, end = centres[automaton.index_of(source)], centres[automaton.index_of(target)]
        apart = end - begin
        gap = 1.12 * radius * apart / max(float(np.linalg.norm(apart)), 1e-12)
        arrow = FancyArrowPatch(
            tuple(begin + gap), tuple(end - gap),
            connectionstyle="arc3,rad=0.0" if both else "arc3,rad=0.14",
            arrowstyle="<|-|>" if both else "-|>", mutation_scale=6.0 if many else 9.0, color=INK,
            linewidth=0.5 if many else 0.9, alpha=alpha, shrinkA=0.0, shrinkB=0.0, zorder=2.0,
        )  # fmt: skip
        ax.add_patch(arrow)
        arrows.append(arrow)
    return tuple(arrows)
