"""Pictures: draw on the axes given and return the artists, or write a whole figure to a file."""

from maneuver_automaton.plotting.alternatives import draw_alternatives as draw_alternatives
from maneuver_automaton.plotting.animation import save_plan_animation as save_plan_animation
from maneuver_automaton.plotting.automata import draw_automaton as draw_automaton
from maneuver_automaton.plotting.automata import draw_motions as draw_motions
from maneuver_automaton.plotting.automata import save_automaton_figure as save_automaton_figure
from maneuver_automaton.plotting.colors import trim_colors as trim_colors
from maneuver_automaton.plotting.controls import draw_altitude as draw_altitude
from maneuver_automaton.plotting.controls import draw_controls as draw_controls
from maneuver_automaton.plotting.footprint import footprint_polygons as footprint_polygons
from maneuver_automaton.plotting.labels import control_labels as control_labels
from maneuver_automaton.plotting.lessons import figure_shift as figure_shift
from maneuver_automaton.plotting.lessons import figure_symmetry as figure_symmetry
from maneuver_automaton.plotting.paths import draw_plan as draw_plan
from maneuver_automaton.plotting.plan_figures import (
    save_alternatives_figure as save_alternatives_figure,
)
from maneuver_automaton.plotting.plan_figures import save_plan_figure as save_plan_figure
from maneuver_automaton.plotting.plan_figures import save_plan_file_figure as save_plan_file_figure
