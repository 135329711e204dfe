from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.library_size_figure import (
    LibrarySizes,
    draw_library_sizes,
    save_library_size_figure,
)
from tests.plotting.cases import assert_picture

TRIMS = [5, 9, 25, 81, 289, 1089, 1681, 4225]


def sizes(trims=TRIMS, *, costs=None):
    n = np.asarray(trims, dtype=float)
    return LibrarySizes(
        trims=n,
        costs=3.0 + 8.0 / n if costs is None else costs,
        medians_s=1e-4 * n**0.5,
        slowest_s=3e-4 * n**0.6,
    )


@pytest.mark.parametrize("count", [1, 2, 8])
def test_a_picture(count, tmp_path):
    save_library_size_figure(sizes(TRIMS[:count]), tmp_path / "sizes.png", title="parking")
    assert_picture(tmp_path / "sizes.png")


@pytest.mark.parametrize("costs", [None, 10.0 ** np.arange(8), np.full(8, 2.5)])
def test_all_numbers_are_inside_logarithmic_axes(costs):
    left, right = Figure().subplots(1, 2)
    artists = draw_library_sizes(left, right, sizes(costs=costs))
    for ax, lines in ((left, [artists.costs]), (right, [artists.medians, artists.slowest])):
        assert ax.get_xscale() == ax.get_yscale() == "log"
        low, high = ax.get_ylim()
        for line in lines:
            assert line.get_xdata().tolist() == TRIMS
            assert (np.asarray(line.get_ydata()) > low).all()
            assert (np.asarray(line.get_ydata()) < high).all()
    ticks = left.get_yticks()
    assert np.count_nonzero((ticks >= left.get_ylim()[0]) & (ticks <= left.get_ylim()[1])) >= 2


def test_numbers_of_trims_leave_room_for_each_other():
    left, right = Figure().subplots(1, 2)
    draw_library_sizes(left, right, sizes())
    assert left.get_xticks().tolist() == [5, 25, 81, 289, 1089, 4225]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("costs", [1.0], "library sizes: got costs of shape (1,), need one number for each"),
        ("medians_s", [0.0, 1.0], "library sizes: medians_s must be positive for a logarithm"),
        ("trims", [9, 5], "library sizes: trims must increase, got 9, 5"),
    ],
)
def test_wrong_arrays_are_named(name, value, message):
    arrays = {"trims": [5, 9], "costs": [2, 1], "medians_s": [1, 2], "slowest_s": [2, 3]}
    with pytest.raises(ValueError) as error:
        LibrarySizes(**{**arrays, name: value})
    assert str(error.value).startswith(message)
