"""`cover`: a field worked in swaths, as one plan."""

from __future__ import annotations

from pathlib import Path

from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import make_folder, printed, user_model, writing
from maneuver_automaton.cli.pictures import ready_to_draw
from maneuver_automaton.cli.result_commands import origin_of
from maneuver_automaton.cli.terminal import announced, print_result, waiting
from maneuver_automaton.field.covering import FieldResult, cover
from maneuver_automaton.field.files import FieldScenario, load_field, save_field_geojson
from maneuver_automaton.formats.plan_json import save_plan
from maneuver_automaton.recording import Fact


def cover_file(
    *, file: Path, out: Path, beside: Path | None, width_m: float | None, headland_m: float | None,
    origin: str | None, time_limit: float | None, plot: bool, quiet: bool, jobs: int,
    model: str | None, as_json: bool,
) -> int:  # fmt: skip
    """Cover a field as the command line says; write plan, picture and GeoJSON; the exit code."""
    place = None if origin is None else origin_of(origin)
    own = None if model is None else user_model(model)
    sizes = {"width_m": width_m, "headland_m": headland_m}
    with printed(out / "plan.json", file, as_json=as_json):
        with announced(quiet=quiet):
            field = load_field(file, beside=beside, origin=place, model=own, **sizes)
        make_folder(out)
        limit = time_limit or field.time_limit_s
        with waiting("planning swaths and turns", quiet=quiet):
            covered = cover(field.problem, time_limit=limit, jobs=jobs)
        _write(covered, field, out, plot=plot)
        result = covered.result
        if not quiet and result.plan is not None:
            facts = (*_facts(covered), Fact(label="written to", value=str(out)))
            print_result(field.name, [], facts)
    if result.plan is None:
        complain(f"{file}: {result.status.value}: {result.reason}")
    return NO_PLAN if result.plan is None else FOUND


def _write(covered: FieldResult, field: FieldScenario, out: Path, *, plot: bool) -> None:
    with writing(out):
        save_plan(covered.result, out / "plan.json", name=field.name)
        save_field_geojson(covered, out / "field.geojson", name=field.name, origin=field.origin)
        (out / "field.png").unlink(missing_ok=True)
        if plot:
            ready_to_draw()
            from maneuver_automaton.field.picture import save_field_picture

            save_field_picture(covered, out / "field.png", name=field.name)


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
