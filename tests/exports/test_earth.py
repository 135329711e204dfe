"""Longitude and latitude about an origin, in files and against other formulas."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import shapely
from scipy.integrate import quad
from shapely.geometry import shape

import maneuver_automaton as ma
from maneuver_automaton.cli.app import run
from maneuver_automaton.exports.earth import degrees_of, metres_of
from tests.exports.cases import VALUES, slalom
from tests.plotting.cases import parking_plan

ORIGINS = [(52.1, 13.4), (-33.9, 18.4), (0.0, 0.0), (69.0, -179.999), (-88.0, 100.0)]
A, F = 6378137.0, 1.0 / 298.257223563
E2 = F * (2.0 - F)


@pytest.mark.parametrize("origin", ORIGINS)
def test_there_and_back(origin):
    rng = np.random.default_rng(3)
    places = rng.uniform(-20e3, 20e3, size=(200, 2))
    back = metres_of(degrees_of(places, origin=origin), origin=origin)
    np.testing.assert_allclose(back, places, atol=1e-7)
    assert (np.abs(degrees_of(places, origin=origin)[:, 0]) <= 180.0).all()


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("distance", [100.0, 1e3, 10e3])
def test_distances_on_the_ground_are_longer_by_no_more_than_stated(origin, distance):
    """Along the meridian: an integral of its radius of curvature."""
    far = np.radians(degrees_of([0.0, distance], origin=origin)[1])

    def radius(latitude):
        return A * (1.0 - E2) / (1.0 - E2 * np.sin(latitude) ** 2) ** 1.5

    ground = quad(radius, np.radians(origin[0]), far, epsabs=1e-9, epsrel=1e-14)[0]
    assert ground - distance == pytest.approx(distance**3 / 6.0 / A**2, rel=0.05, abs=2e-8)


@pytest.mark.parametrize("origin", ORIGINS)
def test_east_is_east(origin):
    """Across it: the radius of the parallel."""
    latitude = np.radians(origin[0])
    parallel = A * np.cos(latitude) / np.sqrt(1.0 - E2 * np.sin(latitude) ** 2)
    lon, lat = degrees_of([10.0, 0.0], origin=origin)
    turned = np.radians((lon - origin[1] + 180.0) % 360.0 - 180.0)
    assert turned * parallel == pytest.approx(10.0, abs=1e-6)
    assert abs(lat - origin[0]) * 111e3 < 1e-3


@pytest.mark.parametrize("origin", ORIGINS)
def test_pyproj_agrees(origin):
    pyproj = pytest.importorskip("pyproj")
    there = pyproj.Proj(proj="ortho", lat_0=origin[0], lon_0=origin[1], ellps="WGS84")
    places = np.random.default_rng(5).uniform(-5e3, 5e3, size=(50, 2))
    np.testing.assert_allclose(
        np.stack(there(*places.T, inverse=True), axis=-1),
        degrees_of(places, origin=origin),
        atol=1e-10,
    )


@pytest.mark.parametrize("name", ["among obstacles", "flight", "pushed loop"])
def test_what_is_written_in_degrees_is_what_is_written_in_metres(name, tmp_path):
    value, origin = VALUES[name](), ORIGINS[0]
    ma.save_geojson(value, tmp_path / "metres.geojson")
    ma.save_geojson(value, tmp_path / "degrees.geojson", origin=origin)
    here, there = (
        json.loads((tmp_path / f"{unit}.geojson").read_text()) for unit in ("metres", "degrees")
    )
    assert (there["units"], there["origin"]) == (
        "degree", {"longitude": origin[1], "latitude": origin[0]},
    )  # fmt: skip
    assert "crs" not in there  # RFC 7946 has no other than longitude and latitude
    for one, other in zip(here["features"], there["features"], strict=True):
        assert one["properties"] == other["properties"]
        metres, degrees = shape(one["geometry"]), shape(other["geometry"])
        assert metres.geom_type == degrees.geom_type
        assert metres.has_z == degrees.has_z
        back = metres_of(shapely.get_coordinates(degrees), origin=origin)
        box = np.concatenate([back.min(axis=0), back.max(axis=0)])
        np.testing.assert_allclose(box, metres.bounds, atol=1e-7)


def test_columns_of_csv_are_added_and_no_other_changes(tmp_path):
    ma.save_csv(slalom(), tmp_path / "plain.csv", step=0.5)
    ma.save_csv(slalom(), tmp_path / "plan.csv", step=0.5, origin=(52.1, 13.4))
    plain, plan = (
        list(csv.DictReader((tmp_path / name).read_text().splitlines()))
        for name in ("plain.csv", "plan.csv")
    )
    assert list(plan[0])[-3:] == ["longitude_deg", "latitude_deg", "primitive"]
    added = [[float(row.pop("longitude_deg")), float(row.pop("latitude_deg"))] for row in plan]
    assert plan == plain
    places = [[float(row["x_m"]), float(row["y_m"])] for row in plain]
    np.testing.assert_allclose(metres_of(added, origin=(52.1, 13.4)), places, atol=1e-7)


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ((91.0, 0.0), "got 91,0, need a latitude within 89 degrees and a longitude within 180"),
        ((0.0, np.nan), "origin: got nan, need finite numbers"),
    ],
)
def test_an_origin_that_is_none_is_told(origin, said, tmp_path):
    with pytest.raises(ValueError, match=said):
        ma.save_csv(parking_plan(), tmp_path / "plan.csv", origin=origin)


def test_places_too_far_are_told():
    with pytest.raises(ValueError, match="origin: positions are up to 200 km from it, need at m"):
        degrees_of([0.0, 200e3], origin=(0.0, 0.0))
    with pytest.raises(ValueError, match="need at most 100 km"):
        metres_of([13.0, 52.0], origin=(0.0, 0.0))


def test_export_takes_an_origin(tmp_path, capsys):
    ma.save_plan(slalom(), tmp_path / "plan.json")
    asked = ["export", str(tmp_path / "plan.json"), "--to"]
    assert run([*asked, "geojson", "--origin", "-33.9,18.4"]) == 0
    assert '"latitude": -33.9' in (tmp_path / "plan.geojson").read_text()
    assert run([*asked, "csv", "--origin", "52.1,13.4"]) == 0
    assert "longitude_deg" in (tmp_path / "plan.csv").read_text()
    capsys.readouterr()
    for origin, form, said in (
        ("52.1", "csv", "--origin: got '52.1'; need LAT,LON in degrees, as 52.1,13.4\n"),
        ("95,0", "csv", "--origin: got 95,0, need a latitude within 89 degrees and a longitude "
         "within 180; need LAT,LON in degrees, as 52.1,13.4\n"),
        ("52,13", "rerun", "--origin: rerun has no longitudes; leave it out\n"),
    ):  # fmt: skip
        assert run([*asked, form, "--origin", origin]) == 2
        assert capsys.readouterr().err == said
