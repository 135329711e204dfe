"""The package as a whole: quick to import, and every name is where it is said to be."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest

import maneuver_automaton as ma
from maneuver_automaton.cli.entry import compile_methods_later
from tests.test_house import imports_of, trees

HEAVY = ("numba", "scipy", "networkx", "matplotlib", "fcl", "casadi", "pydantic", "shapely", "yaml")


ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SAYS_EXTRA = {  # where an extra is asked for by its name
    "distributed": "_parallel.py",
    "pandas": "automaton/plan.py",
    "commonroad": "exports/commonroad_solution.py",
    "rerun": "exports/rerun_log.py",
    "ros": "exports/ros.py",
}
DISTRIBUTIONS = {  # of modules that are called otherwise
    "PIL": "pillow",
    "commonroad": "commonroad-io",
    "fcl": "python-fcl",
    "mpl_toolkits": "matplotlib",
    "rerun": "rerun-sdk",
    "yaml": "pyyaml",
}


def modules_after(code):
    """Names of the modules that a fresh Python process has after running some code."""
    show = "\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code + show], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "code",
    [
        "import maneuver_automaton",
        "import maneuver_automaton; dir(maneuver_automaton)",
        "from maneuver_automaton import SE2, Automaton, Bounds, Car, Cost, Goal, Horizon, Plan, "
        "Problem, Trim, Unicycle",
    ],
)
def test_importing_is_light(code):
    loaded = {name.partition(".")[0] for name in modules_after(code)}
    assert loaded.isdisjoint(HEAVY)


@pytest.mark.parametrize("name", ma.__all__)
def test_every_name_is_there(name):
    assert getattr(ma, name) is not None
    assert name in dir(ma)


def test_nothing_but_public_names_is_listed():
    assert set(dir(ma)) == {*ma.__all__, "__version__"}


def test_a_star_brings_every_name_once():
    assert len(set(ma.__all__)) == len(ma.__all__)
    namespace = {}
    exec("from maneuver_automaton import *", namespace)
    assert set(ma.__all__) <= set(namespace)


def test_a_program_runs_no_module_that_it_asks_for_nothing():
    code = """
import sys
from maneuver_automaton._lazy import LaterFinder
sys.meta_path.insert(0, LaterFinder)
import maneuver_automaton.planning.plan  # which must not hide the function of this name
from maneuver_automaton import planning, receding_horizon
from maneuver_automaton.planning import plan, plans, result
assert plan.__module__ == plans.__module__ == "maneuver_automaton.planning.plan"
assert planning.plan is plan is vars(sys.modules[plan.__module__])["plan"]
waits = [name for name, one in sys.modules.items() if type(one).__name__ == "LaterModule"]
assert "maneuver_automaton.receding_horizon" in waits and result.__name__ not in waits
for name in "planning.unheard", "planning.plan.unheard", "receding_horizon.unheard":
    try:
        __import__("operator").attrgetter(name)(maneuver_automaton)
    except AttributeError as error:
        assert "has no attribute 'unheard'" in str(error), error
    else:
        raise AssertionError(name)
assert receding_horizon.Step.__module__ == "maneuver_automaton.receding_horizon.log"
from PIL import ExifTags, Image  # which asks for a tag of photographs alone
assert type(ExifTags).__name__ == "LaterModule" and Image.ExifTags.Base.Make == 271
"""
    assert "maneuver_automaton.planning.plan" in modules_after(code)


@pytest.mark.skipif(sys.version_info >= (3, 13), reason="compiles the methods of a class at once")
def test_methods_of_a_value_are_compiled_when_they_are_called(monkeypatch):
    monkeypatch.setitem(vars(dataclasses), "_create_fn", vars(dataclasses)["_create_fn"])
    compile_methods_later()
    home = {"__module__": "maneuver_automaton"}
    options = {"frozen": True, "slots": True, "order": True}
    fields = [("left", int), ("right", int, dataclasses.field(default=2))]
    pair = dataclasses.make_dataclass("Pair", fields, namespace=home, **options)
    wider = dataclasses.make_dataclass("Wider", ["last"], bases=(object,), namespace=home)
    given = vars(pair)["__init__"]
    with pytest.raises(TypeError, match=r"^Pair\.__init__\(\) missing 1 .* argument: 'left'$"):
        pair()
    assert vars(pair)["__init__"] is not given
    assert pair(1) == pair(left=1, right=2) < pair(2) != wider(2)
    assert {pair(1), pair(1, 2)} == {pair(1)}
    assert repr(pair(1)) == "Pair(left=1, right=2)"
    for change in (lambda: setattr(pair(1), "left", 3), lambda: delattr(pair(1), "left")):
        with pytest.raises(dataclasses.FrozenInstanceError, match="field 'left'"):
            change()


def test_values_are_those_of_their_rooms():
    from maneuver_automaton.groups import SE2
    from maneuver_automaton.planning import plan

    assert ma.SE2 is SE2
    assert ma.plan is plan


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError) as error:
        _ = ma.Problme
    assert str(error.value) == "module 'maneuver_automaton' has no attribute 'Problme'"
    with pytest.raises(ImportError, match="cannot import name 'Problme'"):
        from maneuver_automaton import Problme  # noqa: F401


def test_the_version_is_that_of_the_distribution():
    assert ma.__version__ == importlib.metadata.version("maneuver-automaton")


def distributions_of(requirements: Iterable[str]) -> set[str]:
    """The names in a list of requirements."""
    return {re.match(r"[\w-]+", one)[0].lower() for one in requirements}


def imported() -> set[str]:
    """Distributions of all modules that the package imports, wherever in its files."""
    names = set()
    for tree in trees().values():
        names |= {name.partition(".")[0] for name, _ in imports_of(tree)}
    outside = names - set(sys.stdlib_module_names) - {"maneuver_automaton"}
    return {DISTRIBUTIONS.get(name, name.replace("_", "-")) for name in outside}


def test_all_that_is_imported_is_declared():
    always = distributions_of(PROJECT["dependencies"])
    extras = {distributions_of(PROJECT["optional-dependencies"][name]).pop() for name in SAYS_EXTRA}
    assert imported() == always | extras


@pytest.mark.parametrize("extra", SAYS_EXTRA)
def test_an_extra_is_asked_for_by_its_name(extra):
    text = (ROOT / "maneuver_automaton" / SAYS_EXTRA[extra]).read_text(encoding="utf-8")
    message = re.sub(r'"\s+f?"', "", text)  # of strings on several lines
    assert f"pip install 'maneuver-automaton[{extra}]'" in message
