from __future__ import annotations

import pytest

from maneuver_automaton.plotting import figure_shift, figure_symmetry
from tests.plotting.cases import assert_picture


@pytest.mark.parametrize("figure", [figure_symmetry, figure_shift])
def test_the_pictures_of_the_paper_are_written(figure, tmp_path):
    figure(tmp_path / "figure.png")
    assert_picture(tmp_path / "figure.png")
