"""Pictures and films of a fleet's closed loop, and its page."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from maneuver_automaton.fleet import FleetProblem, simulate_fleet
from maneuver_automaton.plotting import (
    animate_fleet_loop,
    draw_fleet_loop,
    player_of,
    save_fleet_loop_figure,
)
from maneuver_automaton.plotting.fleet_distances import distance_times, nearest_others
from maneuver_automaton.plotting.fleet_loop_animation import fleet_loop_film
from maneuver_automaton.plotting.fleet_loop_cast import (
    fleet_costs,
    fleet_values,
    held_tracks,
    jumps_of,
    loop_cast_of,
    vehicle_values,
)
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.notebooks import picture_of
from maneuver_automaton.receding_horizon import Disturbance
from tests.fleet.robots import crossing
from tests.plotting.cases import assert_picture

NOISE = Disturbance(position_m=0.01, heading_rad=0.01)


def loop_of(**more):
    return simulate_fleet(
        crossing(tolerance=0.1, margin=0.2), step=0.5, steps=40, first_time_limit=1.0, **more
    )


@pytest.fixture(scope="module")
def calm():
    return loop_of()


@pytest.fixture(scope="module")
def noisy():
    return loop_of(disturbance=NOISE)


@pytest.fixture(scope="module")
def broken():
    return loop_of(breaks_s={"a": 2.0}, joins_s={"b": 1.0})


def legend_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_members_are_where_they_were(noisy):
    cast = loop_cast_of(noisy)
    for one in cast.members:
        for piece in noisy.driven[one.name]:
            if piece.start_time >= one.arrival:
                break
            at = one.parts[0].motion.pose_at(piece.start_time)
            np.testing.assert_allclose(at, piece.start, atol=1e-12)
        last = noisy.driven[one.name][-1]
        np.testing.assert_allclose(one.track.pose[-1, :2], last.end[:2], atol=0.05)
        assert one.arrival == noisy.arrived_s[one.name]
        assert all(end <= one.arrival for _, end, _ in one.spans)


def test_distances_are_those_of_the_log(noisy):
    cast = loop_cast_of(noisy)
    sampled = nearest_others(cast.members, distance_times(cast)).min()
    assert noisy.distance_m - 1e-9 <= sampled <= noisy.distance_m + 0.05


def test_values_fall_by_what_is_spent(calm):
    values, costs = fleet_values(calm), fleet_costs(calm)
    total = values + costs
    assert (np.diff(total) <= 1e-6).all()
    assert values[-1] == 0.0
    assert costs[-1] == pytest.approx(calm.cost)
    each = sum(vehicle_values(calm, name) for name in calm.problem.names)
    np.testing.assert_allclose(each, values, atol=1e-9)


def test_disturbances_are_jumps(calm, noisy):
    assert not any(jumps_of(calm, name) for name in calm.problem.names)
    rows = jumps_of(noisy, "a")
    times = [time for time, _ in rows]
    assert times == sorted(times)
    assert 0.0 < max(np.hypot(*(line[1] - line[0])) for _, line in rows) < 0.1


def test_who_joins_is_not_there_before(broken):
    a, b = loop_cast_of(broken).members
    assert not b.is_there(0.5)
    assert b.is_there(1.0)
    assert b.bodies_at(0.5) == []
    assert (a.arrives, a.reason) == (False, "it broke down")
    assert np.isfinite(fleet_values(broken)).all()


def test_the_picture(calm, noisy, broken, tmp_path):
    for log in (calm, noisy, broken):
        save_fleet_loop_figure(log, tmp_path / "x.png", look=Look(title="A crossing"))
        assert_picture(tmp_path / "x.png")
    figure = draw_fleet_loop(broken)
    assert len(figure.axes) == 4
    names = legend_of(figure)
    assert {"a", "b", "not arrived", "plan held", "left to pay", "spent", "sum"} <= set(names)
    assert "disturbance" not in names
    assert "disturbance" in legend_of(draw_fleet_loop(noisy))
    texts = [text.get_text() for text in figure.texts]
    assert texts[0].startswith("1 of 2 arrived · ")
    assert "a: it broke down" in texts


def test_narrow_and_stated_sizes(noisy, tmp_path):
    for size in ((3.5, None), (7.16, 4.0)):
        save_fleet_loop_figure(noisy, tmp_path / "x.pdf", look=Look(size=size))
        assert (tmp_path / "x.pdf").stat().st_size > 5_000


def test_the_film(noisy, tmp_path):
    film = fleet_loop_film(noisy)
    film.show(0.7)
    assert film.moving[-1].get_text().startswith("0.70 s · step 1 · V = ")
    ahead = film.moving[1]
    ends = [line[-1] for line in ahead.get_segments()]
    goals = [problem.goals[0].pose[:2] for problem in noisy.problem.problems]
    for goal in goals:
        assert min(np.hypot(*(end - goal)) for end in ends) < 0.2
    film.show(100.0)
    assert film.moving[-1].get_text().endswith("reached")
    assert not ahead.get_segments()
    animate_fleet_loop(noisy, tmp_path / "x.gif")
    with Image.open(tmp_path / "x.gif") as pictures:
        assert pictures.n_frames > 10
    with pytest.raises(ValueError, match="gif"):
        animate_fleet_loop(noisy, tmp_path / "x.avi")


def test_the_page(broken):
    content = player_of(broken, title="A crossing").content
    a, b = content["motions"]
    assert (a["joins"], b["joins"]) == (False, True)
    assert a["reason"] == "it broke down"
    held = held_tracks(broken, "b")
    assert [one["t"] for one in b["held"]] == [time for time, _ in held]
    assert len(content["fleet"]["steps"]) == len(broken.steps)
    assert content["fleet"]["value"]["v"][-1] == 0.0
    assert any(curve["label"] == "value" for curve in b["curves"])
    assert dict(content["facts"])["vehicles"] == "1 of 2 arrived"


def test_notebooks_show_it(noisy):
    assert picture_of(noisy)[1:4] == b"PNG"
    assert "<iframe" in noisy._repr_html_()


def test_nobody_comes_in():
    """One that never appears is hatched at its start."""
    log = loop_of(joins_s={"b": 1e6})
    cast = loop_cast_of(log)
    assert cast.members[1].course is None
    assert "it was never let in" in cast.members[1].reason
    draw_fleet_loop(log)


def test_a_single_vehicle_has_no_distances():
    fleet = crossing(tolerance=0.1)
    log = simulate_fleet(FleetProblem(fleet.problems[:1]), step=0.5, first_time_limit=1.0)
    assert len(draw_fleet_loop(log).axes) == 3
