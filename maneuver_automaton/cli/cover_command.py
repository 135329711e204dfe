"""`cover`: a field worked in swaths, as one plan."""

from __future__ import annotations

from types import SimpleNamespace

from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import make_folder, user_model, writing
from maneuver_automaton.cli.pictures import ready_to_draw
from maneuver_automaton.cli.result_commands import origin_of
from maneuver_automaton.cli.terminal import announced, print_result, waiting
from maneuver_automaton.field.covering import FieldResult, cover
from maneuver_automaton.field.files import load_field, save_field_geojson
from maneuver_automaton.formats.plan_json import save_plan
from maneuver_automaton.recording import Fact


def cover_file(given: SimpleNamespace) -> int:
    """Cover a field as the command line says; write plan, picture and GeoJSON; the exit code."""
    file, out, quiet = given.file, given.out, given.quiet
    place = None if given.origin is None else origin_of(given.origin)
    own = None if given.model is None else user_model(given.model)
    stated = {"width_m": given.width, "headland_m": given.headland}
    with announced(quiet=quiet):
        field = load_field(file, beside=given.beside, origin=place, model=own, **stated)
    make_folder(out)
    limit = given.time_limit
    with waiting("planning swaths and turns", quiet=quiet):
        covered = cover(field.problem, time_limit=limit or field.time_limit_s, jobs=given.jobs)
    result = covered.result
    with writing(out):
        save_plan(result, out / "plan.json", name=field.name)
        save_field_geojson(covered, out / "field.geojson", name=field.name, origin=field.origin)
        (out / "field.png").unlink(missing_ok=True)
        if given.plot:
            ready_to_draw()
            from maneuver_automaton.field.picture import save_field_picture

            save_field_picture(covered, out / "field.png", name=field.name)
    if not quiet and result.plan is not None:
        print_result(field.name, [], (*_facts(covered), Fact(label="written to", value=str(out))))
    if result.plan is None:
        complain(f"{file}: {result.status.value}: {result.reason}")
    return NO_PLAN if result.plan is None else FOUND


def _facts(covered: FieldResult) -> list[Fact]:
    worked, turned = covered.lengths
    result, problem = covered.result, covered.problem
    assert result.plan is not None
    share = f"{100.0 * covered.covered:.4g} % inside the headland of {problem.headland:g} m"
    return [
        Fact(label="swaths", value=f"{len(covered.swaths)}, {worked:.6g} m"),
        Fact(label="worked", value=share),
        Fact(label="turns", value=f"{turned:.6g} m"),
        Fact(label="cost of turns", value=covered.turns_cost or 0.0, bound=covered.order_bound,
             note=", of all orders"),
        Fact(label="cost", value=result.cost or 0.0),
        Fact(label="duration", value=result.plan.duration, unit="s"),
        Fact(label="clearance", value=result.clearance_m or 0.0, unit="m", digits=3),
    ]  # fmt: skip
