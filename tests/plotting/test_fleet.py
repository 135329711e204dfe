"""Pictures and films of fleets."""

import numpy as np
import pytest
import shapely
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting import animate_fleet, draw_fleet, save_fleet_figure
from maneuver_automaton.plotting.colors import fleet_colors
from maneuver_automaton.plotting.fleet_animation import OUTLINED, TRAIL_S, fleet_film
from maneuver_automaton.plotting.fleet_cast import cast_of
from maneuver_automaton.plotting.fleet_distances import (
    STEP_S,
    distance_times,
    nearest_others,
    thinned,
)
from maneuver_automaton.plotting.fleet_plane import draw_fleet_plane
from maneuver_automaton.plotting.fleet_time import draw_bars, draw_fleet_distances
from maneuver_automaton.plotting.look import Look
from tests.plotting.cases import assert_picture, plan_of
from tests.plotting.fleets import answer, crossing, fleet_of, no_answer, row_of


def plane_of(result, **options):
    ax = Figure().add_subplot()
    return ax, draw_fleet_plane(ax, cast_of(result), **options)


def legend_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def corners(collection, k):
    return collection.get_paths()[k].vertices[:4]


def test_paths_bodies_and_ends_are_where_the_plans_are():
    result = crossing()
    ax, artists = plane_of(result)
    assert ax.get_aspect() == 1.0
    there, back = result.plans["there"], result.plans["back"]
    lines = artists.paths.get_segments()
    assert len(lines) == 2
    for line, plan in zip(lines, (there, back), strict=True):
        np.testing.assert_allclose(line[[0, -1]], [plan.start[:2], plan.end[:2]], atol=1e-9)
    expected = SE2(there.end).act(Box([0.6, 0.4]).corners)
    np.testing.assert_allclose(corners(artists.goals, 0), expected, atol=1e-9)
    expected = SE2(there.start).act(Box([0.6, 0.4]).corners)
    np.testing.assert_allclose(corners(artists.starts, 0), expected, atol=1e-9)
    assert not artists.starts.get_facecolor().size
    assert (artists.goals.get_facecolor()[:, 3] == 1.0).all()
    times = cast_of(result).scene.times
    middles = [path.vertices[:-1].mean(axis=0) for path in artists.bodies.get_paths()]
    expected = [there.pose_at(t)[:2] for t in times if 0.0 < t < 4.0]
    expected += [back.pose_at(t)[:2] for t in times if 0.5 < t < 5.5]
    np.testing.assert_allclose(middles, expected, atol=1e-9)


def test_one_without_a_plan_is_hatched_at_its_start():
    result = crossing()
    _, artists = plane_of(result)
    np.testing.assert_allclose(corners(artists.missing, 0).mean(axis=0), [5.0, 3.0], atol=1e-9)
    assert artists.missing.get_hatch()
    np.testing.assert_allclose(corners(artists.wanted, 0).mean(axis=0), [0.0, 3.0], atol=1e-9)
    said = [text.get_text() for text in draw_fleet(result).texts]
    assert "stuck: walls enclose the start" in said
    alone = fleet_of([no_answer([0, 0, 0], [1, 0, 0])], names=["a"])
    assert "a: too narrow" in [text.get_text() for text in draw_fleet(alone).texts]
    many = fleet_of([no_answer([0, k, 0], [1, k, 0]) for k in range(7)], names=list("abcdefg"))
    said = [text.get_text() for text in draw_fleet(many).texts]
    assert "a, b, c, d and 3 more: too narrow" in said


def test_points_are_marks():
    ahead = plan_of(["straight"], [2.0])
    lost = no_answer([0, 5, 0], [3, 5, 0])
    _, artists = plane_of(fleet_of([answer(ahead), lost], names=["a", "b"]))
    starts, goals = (marks.get_offsets().tolist() for marks in artists.marks)
    assert (starts, goals) == ([ahead.start[:2].tolist()], [ahead.end[:2].tolist()])
    assert not artists.marks[0].get_facecolor().size
    assert artists.missing_marks.get_offsets().tolist() == [[0.0, 5.0]]
    assert artists.wanted_marks.get_offsets().tolist() == [[3.0, 5.0]]
    assert artists.starts.get_paths() == artists.missing.get_paths() == []


def test_each_has_its_colour_everywhere():
    result = crossing()
    colors = fleet_colors(3)
    _, artists = plane_of(result)
    bars = draw_bars(Figure().add_subplot(), cast_of(result))
    for drawn in (artists.paths.get_colors(), artists.goals.get_facecolor()):
        np.testing.assert_allclose(drawn[:, :3], colors[:2], atol=1e-3)
    np.testing.assert_allclose(to_rgb(bars.bars.get_facecolor()[0]), colors[0], atol=1e-3)
    assert len(set(fleet_colors(70))) == 70


def test_few_are_named_and_many_are_numbered():
    names = legend_of(draw_fleet(row_of(12)))
    assert names[:12] == [f"robot {k}" for k in range(12)]
    names = legend_of(draw_fleet(row_of(13)))
    assert not any(name.startswith("robot") for name in names)
    _, artists = plane_of(row_of(13))
    assert [text.get_text() for text in artists.numbers] == [str(k + 1) for k in range(13)]
    _, artists = plane_of(row_of(12))
    assert artists.numbers == ()


def test_bodies_are_numbered_on_request():
    result = crossing()
    _, artists = plane_of(result, numbered=True)
    assert len(artists.steps) == len(artists.bodies.get_paths())
    times = cast_of(result).scene.times
    at = times[int(artists.steps[0].get_text())]
    place = result.plans["there"].pose_at(at)[:2]
    np.testing.assert_allclose(artists.steps[0].get_position(), place, atol=1e-9)


def test_bars_last_as_long_as_the_plans_and_rests_are_light():
    bars = draw_bars(Figure().add_subplot(), cast_of(crossing())).bars
    spans = [path.vertices[:4, 0][[0, 1]].tolist() for path in bars.get_paths()]
    assert spans == [[0.0, 4.0], [0.5, 1.5], [1.5, 5.5]]
    light = bars.get_facecolor()[:, :3].sum(axis=1)
    assert light[1] > light[2] + 0.5


def test_the_least_distance_is_that_of_any_two_bodies():
    result = crossing()
    cast = cast_of(result)
    times = distance_times(cast)
    assert np.diff(times).max() <= STEP_S + 1e-12
    nearest = nearest_others(cast.members, times)
    for k in range(0, len(times), 7):
        at = {
            one.name: shapely.unary_union([shapely.Polygon(ring) for ring in bodies])
            for one in cast.members
            if (bodies := one.bodies_at(times[k]))
        }
        for column, one in enumerate(cast.members):
            others = [body for name, body in at.items() if name != one.name]
            expected = min(at[one.name].distance(body) for body in others) if one.name in at else 9
            if np.isfinite(nearest[k, column]):
                assert nearest[k, column] == pytest.approx(expected, abs=2e-3)
    assert nearest[:, :2].min() == pytest.approx(1.0, abs=1e-9)
    ax = Figure().add_subplot()
    drawn = draw_fleet_distances(ax, cast, times, nearest.min(axis=1))
    assert drawn.margin.get_ydata()[0] == 0.05
    assert drawn.least.get_ydata().min() == nearest.min()


def test_one_that_leaves_is_near_nobody_once_it_is_gone():
    cast = cast_of(crossing())
    nearest = nearest_others(cast.members[:2], np.array([5.4, 5.6]))
    assert np.isfinite(nearest[0]).all()
    assert np.isinf(nearest[1]).all()
    assert cast.members[1].bodies_at(5.6) == []


@pytest.mark.parametrize("seed", range(3))
def test_no_pair_that_is_nearest_is_left_out(seed):
    rng = np.random.default_rng(seed)
    plans = [
        plan_of(["straight"], [3.0], start=(*rng.uniform(-4.0, 4.0, 2), rng.uniform(-3.0, 3.0)))
        for _ in range(9)
    ]
    answers = [answer(plan, footprint=Box([0.9, 0.3], [0.2, 0.1])) for plan in plans]
    cast = cast_of(fleet_of(answers, names=[str(k) for k in range(9)]))
    times = np.linspace(0.0, 3.0, 31)
    for time, row in zip(times, nearest_others(cast.members, times), strict=True):
        bodies = [shapely.Polygon(one.bodies_at(time)[0]) for one in cast.members]
        apart = shapely.distance(np.array(bodies)[:, None], np.array(bodies))
        np.fill_diagonal(apart, np.inf)
        np.testing.assert_allclose(row, apart.min(axis=1), atol=1e-12)


def test_thinned_samples_keep_the_least():
    values = np.random.default_rng(1).uniform(1.0, 2.0, 5000)
    values[2711] = 0.25
    times, kept = thinned(np.arange(5000.0), values, most=300)
    assert len(times) <= 302
    assert kept.min() == 0.25
    assert times[kept.argmin()] == 2711.0


def test_the_picture_has_the_plane_the_bars_and_the_distances():
    figure = draw_fleet(crossing(), look=Look(title="Crossing"))
    plane, bars, distances = figure.axes
    assert plane.get_xlabel() == "x [m]"
    assert [text.get_text() for text in bars.get_yticklabels()] == ["there", "back", "stuck"]
    assert bars.get_xlim() == distances.get_xlim()
    assert "shapely every 0.05 s" in distances.get_title(loc="left")
    assert figure.texts[0].get_text() == "Crossing"
    names = legend_of(figure)
    for name in ("there", "start", "goal", "no plan", "obstacle", "margin, 0.05 m"):
        assert name in names
    assert "not there at that time" in names
    assert len(draw_fleet(row_of(1)).axes) == 2


def test_obstacles_that_several_share_are_drawn_once():
    _, artists = plane_of(crossing())
    assert len(artists.obstacles.static.get_paths()) == 1
    times = cast_of(crossing()).scene.times
    assert len(artists.obstacles.moving.get_paths()) == 2 * len(times)


@pytest.mark.parametrize("size", [None, (3.5, None), (7.0, 4.0), (9.0, 3.0)])
def test_pictures_fit_their_page(tmp_path, size):
    save_fleet_figure(crossing(), tmp_path / "fleet.png", look=Look(size=size))
    assert_picture(tmp_path / "fleet.png")
    if size is not None and size[1] is not None:
        with Image.open(tmp_path / "fleet.png") as image:
            assert image.height == pytest.approx(130 * size[1], abs=2)


NOBODY = fleet_of([no_answer([0, 0, 0], [1, 0, 0])], names=["a"])


@pytest.mark.parametrize("result", [row_of(30), NOBODY])
def test_any_number_is_drawn(tmp_path, result):
    save_fleet_figure(result, tmp_path / "fleet.png")
    assert_picture(tmp_path / "fleet.png")


def test_a_moved_fleet_has_the_moved_picture():
    by = SE2([3.0, -2.0, 0.7])
    result = row_of(3)
    plans = result.plans.values()
    moved = [plan_of(p.word, p.durations, start=(by @ SE2(p.start)).pose) for p in plans]
    answers = [answer(plan, footprint=Box([0.6, 0.4])) for plan in moved]
    _, here = plane_of(result)
    _, there = plane_of(fleet_of(answers, names=["a", "b", "c"]))
    for one, other in zip(here.bodies.get_paths(), there.bodies.get_paths(), strict=True):
        np.testing.assert_allclose(by.act(one.vertices), other.vertices, atol=1e-9)


def test_the_film_shows_where_all_are():
    result = crossing()
    film = fleet_film(result)
    traffic, trails, bodies, _, clock = film.moving
    assert (film.times[0], film.times[-1]) == (0.0, 5.5)
    film.show(3.0)
    assert clock.get_text() == "3.00 s"
    assert len(bodies.get_paths()) == 2
    middle = bodies.get_paths()[0].vertices[:4].mean(axis=0)
    np.testing.assert_allclose(middle, result.plans["there"].pose_at(3.0)[:2], atol=1e-9)
    begin, end = trails.get_segments()[0][[0, -1]]
    np.testing.assert_allclose(end - begin, [1.5 * TRAIL_S, 0.0], atol=1e-9)
    film.show(5.6)
    assert len(bodies.get_paths()) == 1  # the other has left
    cart, door = traffic.get_facecolor()[:, 3]
    assert door < 0.2 < cart


def test_many_have_no_outlines():
    few, many = (fleet_film(row_of(count)).moving[2] for count in (OUTLINED, OUTLINED + 1))
    assert few.get_linewidth()[0] > 0.0
    assert many.get_linewidth()[0] == 0.0


@pytest.mark.slow
def test_films_are_written(tmp_path):
    animate_fleet(crossing(), tmp_path / "fleet.gif")
    with Image.open(tmp_path / "fleet.gif") as film:
        assert film.n_frames > 50
    with pytest.raises(ValueError, match=r"got the file name fleet\.png, need one ending in \.gif"):
        animate_fleet(crossing(), tmp_path / "fleet.png")


def test_notebooks_show_the_picture():
    assert crossing()._repr_png_()[1:4] == b"PNG"
