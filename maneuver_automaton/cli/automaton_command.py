"""`automaton build`, `show`, `draw`, `design`."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maneuver_automaton._arrays import vector_text
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, save_library
from maneuver_automaton.automaton.validation import AutomatonReport, validate
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import (
    automaton_of,
    make_folder,
    named_automaton,
    naming,
    target,
    writing,
)
from maneuver_automaton.cli.pictures import LookOptions, ready_to_draw
from maneuver_automaton.cli.terminal import (
    Advance,
    console,
    counted,
    progress_bar,
    say,
    table,
    waiting,
)
from maneuver_automaton.design import DesignedLibrary, disperse_library
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.recording.values import few
from maneuver_automaton.scenario import build_file

MOST_ROWS = 200  # trims, and maneuvers, that `show` lists
EVERY_POSE = "every pose can be reached in free space, by words of any length"


def build(file: Path, out: Path, *, jobs: int, scheduler: str | None, quiet: bool) -> int:
    """Write the library of a scenario, or of a build file."""
    path = target(out, "library.json")
    if build_file.is_build_file(file):
        return _build_maneuvers(file, path, jobs=jobs, scheduler=scheduler, quiet=quiet)
    with waiting("making the library", quiet=quiet):
        automaton = automaton_of(file)
    make_folder(path.parent)
    with writing(path):
        save_library(automaton, path)
    _print_library(path, automaton, quiet=quiet)
    return FOUND


def _build_maneuvers(
    file: Path, path: Path, *, jobs: int, scheduler: str | None, quiet: bool
) -> int:
    """Trims of a build file and their maneuvers, with a bar; trims and pairs without are listed."""
    with waiting("finding the trims", quiet=quiet):
        asked = build_file.load_build_file(file)
        pairs = asked.pairs()
    make_folder(path.parent)
    shown: contextlib.AbstractContextManager[Advance | None] = (
        progress_bar("maneuvers", len(pairs), quiet=quiet)
        if pairs
        else waiting("joining the trims", quiet=quiet)
    )
    with writing(path), naming(file), shown as advance:
        count = None if advance is None else counted(advance)
        try:
            automaton, one = build_file.build(
                asked, path, jobs=jobs, scheduler=scheduler, progress=count
            )
        except KeyboardInterrupt:
            complain(f"{file}: interrupted: called again, the build goes on after what is done")
            raise
    for missing in asked.missing:
        complain(f"{file}: no trim at {missing.name}: {missing.reason}")
    failures = () if one is None else one.failures
    for failure in failures:
        complain(f"{file}: no maneuver from {failure.source} to {failure.target}: {failure.reason}")
    _print_library(path, automaton, quiet=quiet)
    if one is not None and not quiet:
        say(
            f"  {one.solved} solved, {one.resumed} from the journal of a build before, "
            f"{one.mirrored} mirror images in {one.build_s:.1f} s; driven again they end "
            f"{one.worst_defect:.1e} off at most"
        )
    return NO_PLAN if failures else FOUND


def _print_library(path: Path, automaton: Automaton, *, quiet: bool) -> None:
    if not quiet:
        say(f"{path}: {_count(automaton)}, hash {automaton_hash(automaton)}")


def show(file: Path, *, coverage: bool, model: str | None) -> int:
    """List trims, maneuvers and what they can do."""
    automaton, out = automaton_of(file, model), console()
    its = automaton.model
    columns = ["", "trim", *its.reduced_names, *its.control_names]
    columns += ["v_x [m/s]", "v_y [m/s]", "turn rate [rad/s]", "v_z [m/s]"][: its.group.dof]
    rows = [
        [
            str(k + 1),
            trim.name,
            *(f"{v + 0.0:.6g}" for v in (*trim.reduced_state, *trim.control, *trim.body_velocity)),
        ]
        for k, trim in enumerate(automaton.trims[:MOST_ROWS])
    ]
    numbers = (0, *range(2, len(columns)))
    out.print(table(automaton.name or file.stem, columns, rows, numbers=numbers))
    _print_more(len(automaton))
    if automaton.maneuvers:
        out.print(_maneuver_table(automaton))
        _print_more(len(automaton.maneuvers))
    out.print(f"  {its.name}, {_count(automaton)}")
    for line in report_lines(validate(automaton)):
        say(f"  {line}")
    if coverage:
        with waiting("sampling what it covers", quiet=False):
            lines = coverage_lines(automaton)
        for line in lines:
            say(f"  {line}")
    say(f"  hash {automaton_hash(automaton)}")
    return FOUND


def coverage_lines(automaton: Automaton) -> list[str]:
    """Dispersion and stretch factor, in words, with what they depend on."""
    from maneuver_automaton.analysis import dispersion, settings_for, stretch_factor

    settings = settings_for(automaton)
    try:
        gap = dispersion(automaton, settings=settings)
        factor = stretch_factor(automaton, settings=settings)
    except ValueError as error:
        return [str(error)]
    return [
        f"dispersion {gap.largest:.3g} m, mean {gap.mean:.3g} m: of {settings.samples} poses "
        f"within {settings.radius:.3g} m (1 rad counts {settings.metres_per_radian:g} m) from the "
        f"nearest of {gap.reached} reached in at most {gap.most:.3g} s",
        f"stretch factor {factor.largest:.3g}, median {factor.median:.3g}: time of words to "
        f"{factor.pairs} poses over that of a body that drives and turns any way as fast; worst at "
        f"{vector_text(factor.pose)}",
    ]


def draw(file: Path, out: Path, *, look: LookOptions, model: str | None) -> int:
    """Draw the trims, and beside them the maneuvers."""
    automaton, name = named_automaton(file, model)
    path = target(out, "automaton.png")
    make_folder(path.parent)
    plotting = ready_to_draw()
    with writing(path):
        plotting.save_automaton_figure(automaton, path, look=look.look(name))
        say(str(path))
        if automaton.maneuvers:
            path = path.with_name(f"{path.stem}_maneuvers{path.suffix}")
            plotting.save_maneuvers_figure(automaton, path, look=look.look(name))
            say(str(path))
    return FOUND


def _maneuver_table(automaton: Automaton) -> Any:
    columns = ["", "maneuver", "source", "target", "duration [s]"]
    columns += ["x [m]", "y [m]", "heading [rad]", "z [m]"][: automaton.model.group.dof]
    rows = [
        [
            str(k + 1),
            one.name,
            one.source,
            one.target,
            *(f"{v + 0.0:.6g}" for v in (one.duration, *one.displacement)),
        ]
        for k, one in enumerate(automaton.maneuvers[:MOST_ROWS])
    ]
    return table("", columns, rows, numbers=(0, *range(4, len(columns))))


def _print_more(count: int) -> None:
    if count > MOST_ROWS:
        console().print(f"  ... and {count - MOST_ROWS} more")


def report_lines(report: AutomatonReport) -> list[str]:
    """Findings of the validation, in words."""
    lines = [EVERY_POSE if report.controllable else report.reason]
    if not report.connected:
        sizes = ", ".join(str(len(component)) for component in report.components)
        lines.append(f"{len(report.components)} groups of trims out of each other's reach: {sizes}")
    for what, names in (("dead ends", report.dead_ends), ("unused", report.unused)):
        if names:
            lines.append(f"{what}: {few(names, 8)}")
    lines += [f"equal twists: {few(names, 8)}" for names in report.duplicates[:10]]
    return lines


def _count(automaton: Automaton) -> str:
    counts = {"trim": len(automaton), "maneuver": len(automaton.maneuvers)}
    return ", ".join(f"{n} {what}{'' if n == 1 else 's'}" for what, n in counts.items())


def design(
    file: Path, out: Path, *, quiet: bool, plot: bool,
    within: float | None, most: int | None, max_trims: int | None, radius_m: float | None,
) -> int:  # fmt: skip
    """Write the smallest library that a design file asks for, and say what is proven of it."""
    path, stated = target(out, "library.json"), {"within": within, "most": most}
    stated |= {"max_trims": max_trims, "radius_m": radius_m}
    instead = {key: value for key, value in stated.items() if value is not None}
    if file.suffix == ".json":
        return _disperse(file, path, instead=instead, quiet=quiet)
    from maneuver_automaton.design.library_design import design_of_file

    make_folder(path.parent)
    with waiting("choosing trims, and proving their factor", quiet=quiet):
        designed = design_of_file(file, instead=instead)
    with writing(path):
        save_library(designed.automaton, path)
    if not quiet:
        _print_designed(path, designed)
    picture = path.with_suffix(".png")
    if plot and designed.words is None:
        complain(f"{picture}: not drawn: the factor of words of any length is one for all goals")
    elif plot:
        plotting = ready_to_draw()
        with writing(picture):
            plotting.save_factor_figure(designed.words, picture)
        if not quiet:
            say(str(picture))
    if not designed.holds:
        remedy = "allow longer words (max_trims)"
        if designed.any_length > designed.within:
            remedy = "allow more trims (most), or more candidates"
        complain(
            f"{file}: asked for a factor within {designed.within:g}, proven is "
            f"{designed.factor:.4g}: {remedy}"
        )
    return FOUND if designed.holds else NO_PLAN


def _disperse(file: Path, path: Path, *, instead: Mapping[str, float], quiet: bool) -> int:
    """The library of a library file, with fewer maneuvers."""
    if {*instead} != {"most"}:
        raise InvalidScenario(
            f"{file}: of a library with maneuvers --most says how many are kept, and nothing else; "
            "a factor is proven for the trims of a build file with the key design"
        )
    library = automaton_of(file)
    make_folder(path.parent)
    with naming(file), waiting("choosing maneuvers", quiet=quiet):
        done = disperse_library(library, most=int(instead["most"]))
    with writing(path):
        save_library(done.automaton, path)
    if not quiet:
        say(
            f"{path}: {len(done.automaton.maneuvers)} of {done.maneuvers} maneuvers, hash "
            f"{automaton_hash(done.automaton)}\n  dispersion {done.dispersion:.4g} m, at "
            f"{done.farthest}; no choice of as many has less than {done.at_least:.4g} m"
        )
    return FOUND


def _print_designed(path: Path, designed: DesignedLibrary) -> None:
    out, size = console(), len(designed.automaton)
    rows = [
        [str(trims), f"{factor:.6g}", "this one" if trims == size else ""]
        for trims, factor in designed.by_size
    ]
    columns = ["trims", "factor, words of any length", ""]
    out.print(table(designed.automaton.name, columns, rows, numbers=(0, 1)))
    chosen = [
        [str(k + 1), trim.name, vector_text(trim.body_velocity)]
        for k, trim in enumerate(designed.automaton.trims)
    ]
    out.print(table("", ["", "trim", "twist [m/s, m/s, rad/s]"], chosen, numbers=(0,)))
    for line in _proven(designed):
        say(f"  {line}")
    say(
        f"{path}: {size} of {designed.candidates} candidates, "
        f"hash {automaton_hash(designed.automaton)}"
    )


def _proven(designed: DesignedLibrary) -> list[str]:
    everywhere = f"words of any length: factor {designed.any_length:.6g}, every start and goal"
    if designed.any_length > 1.0:
        everywhere += f"; {designed.hardest} loses most"
    if (proof := designed.words) is None:
        return [everywhere]
    return [
        everywhere,
        f"words of at most {proof.max_trims} trims: factor {proof.factor:.6g} proven "
        f"on {proof.boxes} boxes of goals, {proof.sampled:.6g} met at {vector_text(proof.worst)}",
        f"goals within {proof.radius:.6g} m, at all headings, to which the shortest path is at "
        f"least {proof.least:.6g} m long",
    ]
