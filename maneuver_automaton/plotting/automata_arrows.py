"""Arrows of the graph of an automaton: how its trims move, and between which they switch."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import FancyArrowPatch

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.plotting.colors import GREY, INK
from maneuver_automaton.plotting.paths import ARC_POINTS
from maneuver_automaton.primitives import Trim

MOST_HEADED = 60  # free switches, or maneuvers, that have an arrow head at each end
LEAST_ALPHA = 0.16  # of arrows where they are very many
SHOWN_S = 1.0  # how long each trim is shown [s]
SPIN_SIZE = 0.45  # of a node, for turns on the spot


def motion(trim: Trim) -> Array:
    """Poses (n, dof) during the time that is shown."""
    plan = Plan(np.zeros(trim.body_velocity.size), (trim,), durations=np.array([SHOWN_S]))
    return plan.pose_at(np.linspace(0.0, SHOWN_S, ARC_POINTS))


def disc() -> Array:
    """Corners (48, 2) of a circle of radius 1 about the origin."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def trim_pictures(automaton: Automaton, radius: float) -> tuple[list[Array], list[Array]]:
    """Paths (n, 2) of all trims to one scale, about the centre of their node, and arrow heads.

    Seen with the vehicle heading up. A turn on the spot is an arc, rest a dot.
    """
    poses = [motion(trim) for trim in automaton.trims]
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
        heads.append(arrow_head(picture, radius))
    return pictures, heads


def arrow_head(picture: Array, radius: float) -> Array:
    """Arrow head at the end of a picture; a dot for one that does not move."""
    step = picture[-1] - picture[-2]
    length = float(np.linalg.norm(step))
    if length == 0.0:
        return 0.12 * radius * disc()
    along = step / length
    aside = np.array([-along[1], along[0]])
    tip = picture[-1] + 0.2 * radius * along
    return np.array([tip, picture[-1] + 0.13 * radius * aside, picture[-1] - 0.13 * radius * aside])


def draw_switch_heads(ax: Axes, switches: list[Array], radius: float) -> None:
    """Arrow heads at both ends of lines (2, 2) between nodes: trims that switch at will."""
    heads = [
        _tip(there, (there - here) / np.linalg.norm(there - here), radius)
        for line in switches
        for here, there in (line, line[::-1])
        if np.linalg.norm(there - here) > 2.6 * radius  # there is room between the nodes
    ]
    ax.add_collection(PolyCollection(heads, facecolors=[GREY], linewidths=0.0, zorder=2.0))


def _tip(centre: Array, along: Array, radius: float) -> Array:
    """An arrow head (3, 2) that comes `along` (2,) and touches the node at `centre`."""
    size = min(0.045, 0.3 * radius)
    aside = np.array([-along[1], along[0]])
    tip = centre - 1.03 * radius * along
    foot = tip - size * along
    return np.array([tip, foot + 0.4 * size * aside, foot - 0.4 * size * aside])


def draw_maneuver_arrows(
    ax: Axes, automaton: Automaton, centres: Array, radius: float
) -> tuple[FancyArrowPatch, ...]:
    """One curved arrow for each ordered pair of trims that a maneuver joins.

    Where they are many they are thin and pale, and one line with two heads joins trims that are
    joined both ways.
    """
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
