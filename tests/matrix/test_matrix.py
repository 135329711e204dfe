"""The matrix: every feature for every vehicle, and each check shown to be able to fail."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from tests.matrix.cells import cells
from tests.matrix.expected import EXPECTED, LONG, QUICK, SLOW_MUTANTS
from tests.matrix.features import FEATURES
from tests.matrix.vehicles import VEHICLES
from tests.search.cases import compiled_only

pytestmark = compiled_only


def _parameters() -> Iterator[object]:
    for feature, vehicle in cells():
        marks = [] if (feature, vehicle) in QUICK else [pytest.mark.slow]
        if (feature, vehicle) not in QUICK | LONG:
            marks.append(pytest.mark.exhaustive)
        fault = EXPECTED.get((feature, vehicle))
        if fault is not None:
            marks.append(pytest.mark.xfail(strict=True, reason=fault))
        yield pytest.param(feature, vehicle, id=f"{feature}-{vehicle}", marks=marks)


@pytest.mark.parametrize(("feature", "vehicle"), list(_parameters()))
def test_a_feature_works_for_a_vehicle(feature, vehicle):
    FEATURES[feature](VEHICLES[vehicle])


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=SLOW_MUTANTS.get(name, ())) for name in FEATURES],
)
def test_a_check_fails_where_its_feature_is_ignored(name):
    feature = FEATURES[name]
    with pytest.raises(AssertionError, match=re.escape(feature.says)):
        feature(VEHICLES[feature.mutant_vehicle], feature.mutant)


def test_the_expectations_name_cells():
    every = set(cells())
    assert set(EXPECTED) <= every
    assert every >= QUICK
