"""`automaton build`, `show`, `draw`."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from maneuver_automaton._arrays import vector_text
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, save_library
from maneuver_automaton.automaton.validation import AutomatonReport, validate
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import (
    automaton_of,
    make_folder,
    named_automaton,
    not_written,
    target,
)
from maneuver_automaton.cli.plan_settings import LookOptions
from maneuver_automaton.cli.progress import Advance, progress_bar, waiting
from maneuver_automaton.cli.tables import console, table
from maneuver_automaton.errors import InvalidScenario, ManeuverAutomatonError


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The options of `automaton build`."""

    jobs: int = 1
    scheduler: str | None = None
    quiet: bool = False


MOST_ROWS = 200  # trims, and maneuvers, that `show` lists
EVERY_POSE = "every pose can be reached in free space, by words of any length"


def build(file: Path, out: Path, *, settings: Settings) -> int:
    """Write the library of a scenario, or of a build file."""
    from maneuver_automaton.scenario.build_file import is_build_file

    path = target(out, "library.json")
    if is_build_file(file):
        return _build_maneuvers(file, path, settings)
    with waiting("making the library", quiet=settings.quiet):
        automaton = automaton_of(file)
    make_folder(path.parent)
    try:
        save_library(automaton, path)
    except OSError as error:
        raise not_written(path, error) from error
    _print_library(path, automaton, settings)
    return FOUND


def _build_maneuvers(file: Path, path: Path, settings: Settings) -> int:
    """Trims of a build file and their maneuvers, with a bar; trims and pairs without are listed."""
    from maneuver_automaton.scenario import build_file

    with waiting("finding the trims", quiet=settings.quiet):
        asked = build_file.load_build_file(file)
        pairs = asked.pairs()
    make_folder(path.parent)
    done = 0
    shown: contextlib.AbstractContextManager[Advance | None] = (
        progress_bar("maneuvers", len(pairs), quiet=settings.quiet)
        if pairs
        else waiting("joining the trims", quiet=settings.quiet)
    )
    with shown as advance:

        def count(n: int, _total: int) -> None:
            nonlocal done
            if advance is not None:
                advance(n - done)
            done = n

        try:
            built = build_file.build(
                asked, path, jobs=settings.jobs, scheduler=settings.scheduler, progress=count
            )
        except KeyboardInterrupt:
            complain(f"{file}: interrupted: called again, the build goes on after what is done")
            raise
        except OSError as error:
            raise not_written(Path(error.filename or path), error) from error
        except ManeuverAutomatonError:
            raise
        except ValueError as error:
            raise InvalidScenario(f"{file}: {error}") from error
    for missing in asked.missing:
        complain(f"{file}: no trim at {missing.name}: {missing.reason}")
    for failure in built.failures:
        complain(f"{file}: no maneuver from {failure.source} to {failure.target}: {failure.reason}")
    _print_library(path, built.automaton, settings)
    if built.build is not None and not settings.quiet:
        one = built.build
        console().print(
            f"  {one.solved} solved, {one.resumed} from the journal of a build before, "
            f"{one.mirrored} mirror images in {one.build_s:.1f} s; driven again they end "
            f"{one.worst_defect:.1e} off at most",
            soft_wrap=True,
        )
    return NO_PLAN if built.failures else FOUND


def _print_library(path: Path, automaton: Automaton, settings: Settings) -> None:
    if not settings.quiet:
        said = f"{path}: {_count(automaton)}, hash {automaton_hash(automaton)}"
        console().print(said, soft_wrap=True)


def show(file: Path, *, coverage: bool = False, model_text: str | None = None) -> int:
    """List trims, maneuvers and what they can do."""
    automaton = automaton_of(file, model_text)
    model, out = automaton.model, console()
    columns = ["", "trim", *model.reduced_names, *model.control_names]
    columns += ["v_x [m/s]", "v_y [m/s]", "turn rate [rad/s]", "v_z [m/s]"][: model.group.dof]
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
    out.print(f"  {model.name}, {_count(automaton)}")
    for line in report_lines(validate(automaton)):
        out.print(f"  {line}", soft_wrap=True)
    if coverage:
        with waiting("sampling what it covers", quiet=False):
            lines = coverage_lines(automaton)
        for line in lines:
            out.print(f"  {line}", soft_wrap=True)
    out.print(f"  hash {automaton_hash(automaton)}", soft_wrap=True)
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


def draw(file: Path, out: Path, *, look: LookOptions, model_text: str | None = None) -> int:
    """Draw the trims, and beside them the maneuvers."""
    automaton, name = named_automaton(file, model_text)
    path = target(out, "automaton.png")
    make_folder(path.parent)
    from maneuver_automaton import plotting
    from maneuver_automaton.cli.pictures import skip_documentation

    skip_documentation()

    try:
        plotting.save_automaton_figure(automaton, path, look=look.look(name))
        console().print(str(path), soft_wrap=True)
        if automaton.maneuvers:
            path = path.with_name(f"{path.stem}_maneuvers{path.suffix}")
            plotting.save_maneuvers_figure(automaton, path, look=look.look(name))
            console().print(str(path), soft_wrap=True)
    except OSError as error:
        raise not_written(path, error) from error
    return FOUND


def _maneuver_table(automaton: Automaton) -> Table:
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
            lines.append(f"{what}: {few(names)}")
    lines += [f"equal twists: {few(names)}" for names in report.duplicates[:10]]
    return lines


def few(names: tuple[str, ...]) -> str:
    """Names in a row, the first eight."""
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def _count(automaton: Automaton) -> str:
    counts = {"trim": len(automaton), "maneuver": len(automaton.maneuvers)}
    return ", ".join(f"{n} {what}{'' if n == 1 else 's'}" for what, n in counts.items())
