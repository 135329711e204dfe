from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from PIL import Image

from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import DPI
from maneuver_automaton.plotting.plan_figures import plan_figure, save_plan_figure
from tests.plotting.cases import assert_picture, parking_plan, result_of


@pytest.mark.slow
@pytest.mark.parametrize(
    ("look", "size"),
    [
        (Look(size=(3.5, None), style="paper"), (3.5, None)),
        (Look(size=(7.16, 4.0), style="paper"), (7.16, 4.0)),
        (Look(size=(12.0, 6.0), title="Parking"), (12.0, 6.0)),
        (Look(size=(9.0, 2.6)), (9.0, 2.6)),  # nothing has room but the plane
        (Look(), (9.6, None)),
    ],
)
def test_a_page_has_the_size_asked_for_and_axes_side_by_side(look, size, tmp_path):
    save_plan_figure(result_of(parking_plan()), tmp_path / "plan.png", look=look)
    assert_picture(tmp_path / "plan.png")
    with Image.open(tmp_path / "plan.png") as image:
        wide, high = image.size
    assert wide == pytest.approx(DPI * size[0], abs=1.0)
    if size[1] is not None:
        assert high == pytest.approx(DPI * size[1], abs=1.0)
    figure = plan_figure(result_of(parking_plan()), look=look)
    boxes = [ax.get_position() for ax in figure.axes]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(np.min([box.x0, box.y0, 1 - box.x1, 1 - box.y1]) > 0.0 for box in boxes)


def test_the_title_comes_first_and_stands_alone_in_a_paper():
    def said(look):
        return [text.get_text() for text in plan_figure(result_of(parking_plan()), look=look).texts]

    assert said(Look(title="Parking"))[0] == "Parking"
    assert said(Look(title="Parking"))[1].startswith("cost 9.75")
    assert said(Look(title="Parking", style="paper")) == ["Parking"]
    assert said(Look(style="paper")) == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"style": "poster"}, "need one of screen, paper"),
        ({"size": (0.5, None)}, "size: got 0.5 in, need from 2.5 to 40 in"),
        ({"size": (5.0, float("nan"))}, "size: got nan in"),
    ],
)
def test_a_look_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Look(**wrong)
