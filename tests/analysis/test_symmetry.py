"""Which dynamics have a symmetry, and what is said of those that have not."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import Region, check_flow, check_vector_field
from maneuver_automaton.groups import SE2, SE2xR, product, translations
from maneuver_automaton.models import Car, Unicycle, UserModel, equivariance_defect

PLANE = Region.of(SE2, n_controls=2)
SECOND_ORDER = Region.of(SE2, n_controls=2, reduced_names=["speed"])
SPACE = Region.of(SE2xR, n_controls=3)
TRANSLATIONS = ("translation in x", "translation in y")


def unicycle(x, u):
    return np.array([u[0] * np.cos(x[2]), u[0] * np.sin(x[2]), u[1]])


def with_wind(x, u):
    return np.add(unicycle(x, u), [0.3, 0.0, 0.0])


def in_a_river(x, u):
    """A current along x that grows towards the middle of the river, at y = 0."""
    return np.add(unicycle(x, u), [1.0 / (1.0 + x[1] ** 2), 0.0, 0.0])


def in_a_whirl(x, u):
    return np.add(unicycle(x, u), [-0.1 * x[1], 0.1 * x[0], 0.0])


def with_a_compass(x, u):
    return np.add(unicycle(x, u), [0.0, 0.0, -np.sin(x[2])])


def second_order(x, u):
    return np.array([x[3] * np.cos(x[2]), x[3] * np.sin(x[2]), u[1], u[0]])


def on_a_slope(x, u):
    """Downhill is along -x: gravity pulls on the speed."""
    return np.add(second_order(x, u), [0.0, 0.0, 0.0, -1.2 * np.cos(x[2])])


def on_ice(x, u):
    """Friction fades away along x."""
    return np.subtract(second_order(x, u), [0.0, 0.0, 0.0, 0.5 * x[3] * (1.0 + np.tanh(x[0]))])


def helicopter(x, u):
    return np.array([u[0] * np.cos(x[2]), u[0] * np.sin(x[2]), u[1], u[2]])


def in_thin_air(x, u):
    return helicopter(x, u) * [1.0, 1.0, 1.0, np.exp(-0.1 * x[3])]


HELICOPTER = UserModel(
    name="helicopter",
    group=SE2xR,
    control_names=("speed", "turn_rate", "climb"),
    velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
)
INVARIANT = [
    (Unicycle(), None),
    (Car(wheelbase=2.0, max_steering=0.6, max_speed=3.0), None),
    (HELICOPTER, None),
    (unicycle, PLANE),
    (second_order, SECOND_ORDER),
    (helicopter, SPACE),
]


def name_of(value):
    return getattr(value, "name", getattr(value, "__name__", ""))


@pytest.mark.parametrize(("dynamics", "region"), INVARIANT, ids=name_of)
def test_invariant_dynamics_pass_both_checks(dynamics, region):
    field = check_vector_field(dynamics, region=region)
    assert field.holds, field
    assert field.worst_violation < 1e-12
    assert field.broken == field.components == ()
    assert {*TRANSLATIONS, "rotation"} <= set(field.intact)
    assert "vector field is invariant under rotation" in str(field)
    flow = check_flow(dynamics, region=region, samples=2)
    assert flow.holds, flow


def test_wind_breaks_rotation_only():
    report = check_vector_field(with_wind, region=PLANE)
    assert not report.holds
    assert (report.broken, report.intact) == (("rotation",), TRANSLATIONS)
    assert report.components[0] in ("x rate", "y rate")
    assert 0.3 < report.worst_violation <= 0.6
    assert report.message.startswith("vector field is not invariant under rotation: ")
    assert " m/s at x = (" in report.message
    assert "; still invariant under translation; " in report.message
    assert report.message.endswith("a direction of the world, as in a steady wind or current")


def test_the_worst_place_can_be_looked_up():
    report = check_vector_field(with_wind, region=PLANE)
    again = equivariance_defect(
        with_wind, report.group_element, state=report.state, control=report.control
    )
    assert np.abs(again).max() == report.worst_violation
    assert f"changes by {report.worst_violation:.4g} m/s" in report.message


def test_gravity_on_a_slope_breaks_rotation_only():
    report = check_vector_field(on_a_slope, region=SECOND_ORDER)
    assert (report.broken, report.intact) == (("rotation",), TRANSLATIONS)
    assert report.components == ("speed rate",)
    assert 1.2 < report.worst_violation <= 2.4
    assert "under rotation: speed rate changes by " in report.message
    assert "under gravity on a slope" in report.message


def test_friction_that_changes_from_place_to_place():
    report = check_vector_field(on_ice, region=SECOND_ORDER)
    assert set(report.broken) == {"translation in x", "rotation"}
    assert report.intact == ("translation in y",)
    assert report.components == ("speed rate",)
    assert "still invariant under translation in y;" in report.message
    assert "depends on the place, as with ground or friction" in report.message


def test_a_river_is_the_same_all_along():
    report = check_vector_field(in_a_river, region=PLANE)
    assert set(report.broken) == {"translation in y", "rotation"}
    assert report.intact == ("translation in x",)
    assert "as with currents or a map" in report.message


def test_a_whirl_is_the_same_all_around():
    report = check_vector_field(in_a_whirl, region=PLANE)
    assert set(report.broken) == set(TRANSLATIONS)
    assert report.intact == ("rotation",)
    assert "not invariant under translation: " in report.message
    assert "still invariant under rotation;" in report.message


def test_a_compass_needle_breaks_rotation():
    report = check_vector_field(with_a_compass, region=PLANE)
    assert (report.broken, report.components) == (("rotation",), ("heading rate",))
    assert " rad/s at " in report.message
    assert "as with a compass needle" in report.message


def test_thin_air_breaks_climb_only():
    report = check_vector_field(in_thin_air, region=SPACE)
    assert report.broken == ("climb",)
    assert report.components == ("z rate",)
    assert report.intact == (*TRANSLATIONS, "rotation")
    assert "still invariant under rotation and translation" in report.message
    assert "depends on the height" in report.message


def test_a_steady_updraft_breaks_nothing():
    assert check_vector_field(
        lambda x, u: np.add(helicopter(x, u), [0, 0, 0, 0.4]), region=SPACE
    ).holds


@pytest.mark.parametrize(
    ("dynamics", "region"),
    [
        (with_wind, PLANE),
        (in_a_river, PLANE),
        (on_a_slope, SECOND_ORDER),
        (on_ice, SECOND_ORDER),
        (in_thin_air, SPACE),
    ],
    ids=name_of,
)
def test_flow_and_vector_field_agree_on_what_is_broken(dynamics, region):
    field, flow = check_vector_field(dynamics, region=region), check_flow(dynamics, region=region)
    assert set(flow.broken) == set(field.broken)
    assert flow.message.startswith("flow is not invariant under ")
    assert " after 2 s changes by " in flow.message
    assert flow.control.shape == (3, len(region.controls))


def test_the_group_can_be_smaller_than_the_plane():
    def boat(x, u):
        return [u[0] + 0.3, u[1]]

    report = check_vector_field(boat, region=Region.of(translations(2), n_controls=2))
    assert report.holds
    assert report.intact == TRANSLATIONS


def test_two_robots_that_feel_each_other():
    pair = product(SE2, SE2)
    region = Region.of(pair, n_controls=4)

    def follower(x, u):  # the second keeps its distance from the first
        pull = np.append(x[0:2] - x[3:5], 0.0)
        return np.concatenate([unicycle(x[:3], u[:2]), unicycle(x[3:], u[2:]) + pull])

    report = check_vector_field(follower, region=region)
    assert "translation in x of part 1" in report.broken
    assert set(report.components) <= {"x_2 rate", "y_2 rate"}


def test_another_source_of_samples_may_be_given():
    first = check_vector_field(with_wind, region=PLANE, rng=np.random.default_rng(1))
    second = check_vector_field(with_wind, region=PLANE, rng=np.random.default_rng(2))
    assert first.broken == second.broken
    assert first.state.tolist() != second.state.tolist()
    assert check_vector_field(with_wind, region=PLANE, rng=np.random.default_rng(1)).message == (
        first.message
    )


def test_a_looser_tolerance_admits_a_breeze():
    assert not check_vector_field(with_wind, region=PLANE, tolerance=0.01).holds
    assert check_vector_field(with_wind, region=PLANE, tolerance=1.0).holds


def test_samples_stay_in_the_region():
    region = Region(group=SE2, states=[[1, 2], [3, 4], [0, 0]], controls=[[5, 6], [7, 8]])
    seen = []

    def field(x, u):
        seen.append((x, u))
        return unicycle(x, u)

    check_vector_field(field, region=region, samples=3)
    controls = np.array([u for _, u in seen])
    assert controls[:, 0].min() >= 5.0
    assert controls[:, 0].max() <= 6.0
    assert any(1.0 <= x[0] <= 2.0 and 3.0 <= x[1] <= 4.0 and x[2] == 0.0 for x, _ in seen)


def test_wrong_input_is_named():
    with pytest.raises(ValueError, match=r"unicycle: a plain function needs a region"):
        check_vector_field(unicycle)
    with pytest.raises(ValueError, match=r"f\(x, u\): got shape \(3,\), need 4 components last"):
        check_vector_field(unicycle, region=SECOND_ORDER)
    with pytest.raises(ValueError, match="samples must be at least 1, got 0"):
        check_vector_field(Unicycle(), samples=0)
    with pytest.raises(ValueError, match=r"tolerance must be positive, got 0\.0"):
        check_vector_field(Unicycle(), tolerance=0.0)
    with pytest.raises(ValueError, match=r"piece_durations: got \(\), need positive times"):
        check_flow(Unicycle(), piece_durations=())
