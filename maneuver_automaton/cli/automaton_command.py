"""`automaton build`, `show`, `draw`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, save_library
from maneuver_automaton.automaton.validation import AutomatonReport, validate
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import automaton_of, make_folder, not_written, target
from maneuver_automaton.cli.progress import progress_bar
from maneuver_automaton.cli.tables import console, table
from maneuver_automaton.errors import InvalidScenario, ManeuverAutomatonError


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The options of `automaton build`."""

    jobs: int = 1
    scheduler: str | None = None
    quiet: bool = False


MOST_ROWS = 200  # trims that `show` lists


def build(file: Path, out: Path, *, settings: Settings) -> int:
    """Write the library of a scenario, or of a build file."""
    from maneuver_automaton.scenario.build_file import is_build_file

    path = target(out, "library.json")
    if is_build_file(file):
        return _build_maneuvers(file, path, settings)
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

    asked = build_file.load_build_file(file)
    make_folder(path.parent)
    done = 0
    with progress_bar("maneuvers", len(asked.pairs()), quiet=settings.quiet) as advance:

        def count(n: int, _total: int) -> None:
            nonlocal done
            advance(n - done)
            done = n

        try:
            built = build_file.build(
                asked, path, jobs=settings.jobs, scheduler=settings.scheduler, progress=count
            )
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


def show(file: Path) -> int:
    """List trims and what they can do."""
    automaton = automaton_of(file)
    model, out = automaton.model, console()
    columns = ["", "trim", *model.control_names, *_velocity_names(model.group.dof)]
    rows = [
        [str(k + 1), trim.name, *(f"{v + 0.0:.6g}" for v in (*trim.control, *trim.body_velocity))]
        for k, trim in enumerate(automaton.trims[:MOST_ROWS])
    ]
    numbers = (0, *range(2, len(columns)))
    out.print(table(automaton.name or file.stem, columns, rows, numbers=numbers))
    if len(automaton) > MOST_ROWS:
        out.print(f"  ... and {len(automaton) - MOST_ROWS} more")
    out.print(f"  {model.name}, {_count(automaton)}")
    for line in report_lines(validate(automaton)):
        out.print(f"  {line}", soft_wrap=True)
    out.print(f"  hash {automaton_hash(automaton)}", soft_wrap=True)
    return FOUND


def draw(file: Path, out: Path) -> int:
    """Draw the trims."""
    automaton = automaton_of(file)
    path = target(out, "automaton.png")
    make_folder(path.parent)
    from maneuver_automaton import plotting

    try:
        plotting.save_automaton_figure(automaton, path)
    except OSError as error:
        raise not_written(path, error) from error
    console().print(str(path), soft_wrap=True)
    return FOUND


def report_lines(report: AutomatonReport) -> list[str]:
    """What validation found, in words."""
    lines = ["every pose can be reached" if report.controllable else report.reason]
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


def _velocity_names(dof: int) -> list[str]:
    return ["v_x [m/s]", "v_y [m/s]", "turn rate [rad/s]", "v_z [m/s]"][:dof]
