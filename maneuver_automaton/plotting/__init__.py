"""Pictures: draw on the axes given and return the artists, or write a whole figure to a file.

`draw_plan(ax, plan)` and others that begin with ``draw_`` draw on axes of Matplotlib; those with
``save_`` and ``figure_`` write a file, whose ending says the format. `draw_fleet` makes a whole
figure, `animate_fleet` writes a film. ``dir`` lists them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.plotting.alternatives import draw_alternatives as draw_alternatives
    from maneuver_automaton.plotting.alternatives_figure import (
        save_alternatives_figure as save_alternatives_figure,
    )
    from maneuver_automaton.plotting.animation import save_plan_animation as save_plan_animation
    from maneuver_automaton.plotting.automata import draw_automaton as draw_automaton
    from maneuver_automaton.plotting.automata import draw_motions as draw_motions
    from maneuver_automaton.plotting.automata import save_automaton_figure as save_automaton_figure
    from maneuver_automaton.plotting.closed_loop import (
        save_closed_loop_figure as save_closed_loop_figure,
    )
    from maneuver_automaton.plotting.closed_loop_animation import (
        save_closed_loop_animation as save_closed_loop_animation,
    )
    from maneuver_automaton.plotting.closed_loop_plane import draw_closed_loop as draw_closed_loop
    from maneuver_automaton.plotting.closed_loop_time import draw_solve_times as draw_solve_times
    from maneuver_automaton.plotting.closed_loop_time import draw_value as draw_value
    from maneuver_automaton.plotting.colors import trim_colors as trim_colors
    from maneuver_automaton.plotting.controls import draw_altitude as draw_altitude
    from maneuver_automaton.plotting.controls import draw_controls as draw_controls
    from maneuver_automaton.plotting.factors import draw_factor as draw_factor
    from maneuver_automaton.plotting.factors import save_factor_figure as save_factor_figure
    from maneuver_automaton.plotting.fleet import draw_fleet as draw_fleet
    from maneuver_automaton.plotting.fleet import save_fleet_figure as save_fleet_figure
    from maneuver_automaton.plotting.fleet_animation import animate_fleet as animate_fleet
    from maneuver_automaton.plotting.fleet_loop import draw_fleet_loop as draw_fleet_loop
    from maneuver_automaton.plotting.fleet_loop import (
        save_fleet_loop_figure as save_fleet_loop_figure,
    )
    from maneuver_automaton.plotting.fleet_loop_animation import (
        animate_fleet_loop as animate_fleet_loop,
    )
    from maneuver_automaton.plotting.footprint import footprint_polygons as footprint_polygons
    from maneuver_automaton.plotting.labels import control_labels as control_labels
    from maneuver_automaton.plotting.look import Look as Look
    from maneuver_automaton.plotting.maneuvers import draw_maneuvers as draw_maneuvers
    from maneuver_automaton.plotting.maneuvers import save_maneuvers_figure as save_maneuvers_figure
    from maneuver_automaton.plotting.motions import track_colors as track_colors
    from maneuver_automaton.plotting.nodes import draw_nodes as draw_nodes
    from maneuver_automaton.plotting.obstacles import draw_obstacles as draw_obstacles
    from maneuver_automaton.plotting.paths import draw_plan as draw_plan
    from maneuver_automaton.plotting.plan_figures import save_plan_figure as save_plan_figure
    from maneuver_automaton.plotting.plan_figures import (
        save_plan_file_figure as save_plan_file_figure,
    )
    from maneuver_automaton.plotting.player import Player as Player
    from maneuver_automaton.plotting.player import player_of as player_of
    from maneuver_automaton.plotting.player import player_of_file as player_of_file
    from maneuver_automaton.plotting.progress import draw_progress as draw_progress
    from maneuver_automaton.plotting.progress import save_progress_figure as save_progress_figure
    from maneuver_automaton.plotting.road_fleets import (
        save_road_fleet_animation as save_road_fleet_animation,
    )
    from maneuver_automaton.plotting.road_fleets import (
        save_road_fleet_figure as save_road_fleet_figure,
    )
    from maneuver_automaton.plotting.roads import draw_road as draw_road
    from maneuver_automaton.plotting.roads import save_road_animation as save_road_animation
    from maneuver_automaton.plotting.roads import save_road_figure as save_road_figure
    from maneuver_automaton.plotting.space import SpaceArtists as SpaceArtists
    from maneuver_automaton.plotting.space import draw_space as draw_space
    from maneuver_automaton.plotting.space import flies_among_heights as flies_among_heights
    from maneuver_automaton.plotting.space import save_space_figure as save_space_figure

_HOMES = {
    "draw_alternatives": "alternatives",
    "save_alternatives_figure": "alternatives_figure",
    "save_plan_animation": "animation",
    "draw_automaton": "automata",
    "draw_motions": "automata",
    "save_automaton_figure": "automata",
    "save_closed_loop_figure": "closed_loop",
    "save_closed_loop_animation": "closed_loop_animation",
    "draw_closed_loop": "closed_loop_plane",
    "draw_solve_times": "closed_loop_time",
    "draw_value": "closed_loop_time",
    "trim_colors": "colors",
    "draw_altitude": "controls",
    "draw_controls": "controls",
    "draw_factor": "factors",
    "save_factor_figure": "factors",
    "draw_fleet": "fleet",
    "save_fleet_figure": "fleet",
    "animate_fleet": "fleet_animation",
    "draw_fleet_loop": "fleet_loop",
    "save_fleet_loop_figure": "fleet_loop",
    "animate_fleet_loop": "fleet_loop_animation",
    "footprint_polygons": "footprint",
    "control_labels": "labels",
    "Look": "look",
    "draw_maneuvers": "maneuvers",
    "save_maneuvers_figure": "maneuvers",
    "track_colors": "motions",
    "draw_nodes": "nodes",
    "draw_obstacles": "obstacles",
    "draw_plan": "paths",
    "save_plan_figure": "plan_figures",
    "save_plan_file_figure": "plan_figures",
    "Player": "player",
    "player_of": "player",
    "player_of_file": "player",
    "draw_progress": "progress",
    "save_progress_figure": "progress",
    "save_road_fleet_animation": "road_fleets",
    "save_road_fleet_figure": "road_fleets",
    "draw_road": "roads",
    "save_road_animation": "roads",
    "save_road_figure": "roads",
    "SpaceArtists": "space",
    "draw_space": "space",
    "flies_among_heights": "space",
    "save_space_figure": "space",
}
__getattr__, __dir__ = lazily(__name__, _HOMES)
