"""Pictures, films and players of any result.

`save_picture(result, path)` and `save_film(result, path)` write files, whose ending says the
format; `draw_plane(ax, result)` draws on axes of Matplotlib; `player_of(result)` is a page. ``dir``
lists them, and what draws automata and studies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.plotting.automata import draw_automaton as draw_automaton
    from maneuver_automaton.plotting.automata import draw_maneuvers as draw_maneuvers
    from maneuver_automaton.plotting.automata import draw_motions as draw_motions
    from maneuver_automaton.plotting.automata import save_automaton_figure as save_automaton_figure
    from maneuver_automaton.plotting.automata import save_maneuvers_figure as save_maneuvers_figure
    from maneuver_automaton.plotting.colors import trim_colors as trim_colors
    from maneuver_automaton.plotting.films import film_of as film_of
    from maneuver_automaton.plotting.films import save_film as save_film
    from maneuver_automaton.plotting.look import Look as Look
    from maneuver_automaton.plotting.obstacles import draw_obstacles as draw_obstacles
    from maneuver_automaton.plotting.pictures import draw_plane as draw_plane
    from maneuver_automaton.plotting.pictures import figure_of as figure_of
    from maneuver_automaton.plotting.pictures import save_picture as save_picture
    from maneuver_automaton.plotting.player import Player as Player
    from maneuver_automaton.plotting.player import player_of as player_of
    from maneuver_automaton.plotting.player import player_of_file as player_of_file
    from maneuver_automaton.plotting.searches import draw_factor as draw_factor
    from maneuver_automaton.plotting.searches import draw_progress as draw_progress
    from maneuver_automaton.plotting.searches import save_factor_figure as save_factor_figure
    from maneuver_automaton.plotting.searches import save_progress_figure as save_progress_figure
    from maneuver_automaton.plotting.space import flies_among_heights as flies_among_heights

__getattr__, __dir__ = lazily(__name__)
