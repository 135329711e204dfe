"""The commands and their options. Nothing heavy is imported before a command runs."""

from __future__ import annotations

import contextlib
import inspect
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple, TypeAlias

import typer

from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain, exits
from maneuver_automaton.cli.help_texts import ending
from maneuver_automaton.cli.streams import safe_streams
from maneuver_automaton.errors import InvalidScenario

PRINTED = (["schema"],)  # commands that do nothing but print
KINDS: dict[str, Any] = {  # of values, by what stands for them; of others a text
    **dict.fromkeys(("DIR", "FILE", "FIELD", "LOG", "IN", "OUT", "PLAN.json"), Path),
    **dict.fromkeys(("S", "M", "R", "T", "HZ", "SHARE"), float),
    **dict.fromkeys(("N", "K"), int),
    "": bool,
}
NEEDED = inspect.Parameter.empty


class OptionEntry(NamedTuple):
    """An argument or option of commands: its flags, what stands for its value, what it is."""

    flags: str  # none: an argument
    stands: str  # empty: the option itself says it
    said: str
    default: Any  # None: it may be left out
    more: Mapping[str, Any]

    def parameter(self, name: str) -> inspect.Parameter:
        """What Typer makes an argument or an option of."""
        make: Callable[..., Any] = typer.Option if self.flags else typer.Argument
        told = {"metavar": self.stands or None, "help": self.said or None, **self.more}
        kind = KINDS.get(self.stands, str)
        return inspect.Parameter(
            name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=self.default,
            annotation=Annotated[
                kind | None if self.default is None else kind, make(*self.flags.split(), **told)
            ],
        )


def option(flags: str, stands: str, said: str, default: Any = None, **more: Any) -> OptionEntry:
    """An option with a value."""
    return OptionEntry(flags, stands, said, default, more)


def argument(stands: str, said: str = "", default: Any = NEEDED) -> OptionEntry:
    """An argument."""
    return OptionEntry("", stands, said, default, {})


def flag(flags: str, said: str, *, default: bool = False) -> OptionEntry:
    """An option without a value."""
    return OptionEntry(flags, "", said, default, {})


OUT, RESULT = Path("out"), "Of plan, or a closed_loop.json of mpc."
TABLE = {
    "file": argument("FILE", "Scenario (YAML), or another format."),
    "field": argument("FIELD", "A scenario with `field` (YAML), or GeoJSON."),
    "library": argument("FILE", "Scenario or library file."),
    "build_file": argument("FILE", "Build file with design, or library."),
    "result": argument("PLAN.json", RESULT),
    "source": argument("IN"),
    "target": argument("OUT"),
    "name": argument("NAME", "Of a scenario; left out, all are listed.", default=None),
    "out": option("--out -o", "DIR", "Folder for the results.", default=OUT),
    "picture": option("--out", "FILE", "The picture."),
    "exported": option("--out -o", "FILE", "The file, or the folder of a bag."),
    "copy": option("--out -o", "FILE", "File or folder (default: NAME.yaml)."),
    "time_limit": option("--time-limit", "S", "Upper bound for search and refinement [s]."),
    "turn_limit": option("--time-limit", "S", "For each turn [s]; left out: 1."),
    "gap": option(
        "--gap",
        "SHARE",
        "Stop once no plan is proven to be cheaper by more than this share (0.05: 5 %).",
    ),
    "alternatives": option(
        "--alternatives", "K", "Costlier plans to list as well.", default=0, min=0
    ),
    "steps": option("--steps", "N", "Steps at most (default: the scenario's).", min=1),
    "seed": option("--seed", "N", "Seed of the disturbance.", min=0),
    "seeds": option("--seeds", "K", "Statistics over K seeds instead of one loop.", min=1),
    "resume": option("--resume", "LOG", "Go on from a closed_loop.json."),
    "leave": flag("--leave", "Leave a start in contact first, by the shortest coast."),
    "leaves": flag("--leave", "The plan of one vehicle leaves a start in contact."),
    "plot": flag("--plot/--no-plot", "Draw the plan.", default=True),
    "factor": flag("--plot", "Draw the factor over the goals, with --max-trims."),
    "title": option("--title", "TEXT", "Of the pictures (default: scenario's name)."),
    "size": option("--size", "WxH", "Of the main picture [in]: 7x4, or 3.5."),
    "style": option("--style", "NAME", "screen, or paper: no numbers above.", default="screen"),
    "animate": flag("--animate", "Animate it as well (plan: GIF; mpc: GIF and HTML)."),
    "html": flag("--html", "Write a page that plays it: one file, no network."),
    "quiet": flag("--quiet", "Print nothing but errors."),
    "as_json": flag("--json", "Print what is written, as JSON; the table goes to stderr."),
    "jobs": option(
        "--jobs",
        "N",
        "Files (of a folder), seeds, or searches for a fleet at a time.",
        default=1,
        min=1,
    ),
    "turns": option("--jobs", "N", "Turns that are planned at a time.", default=1, min=1),
    "solved": option("--jobs", "N", "Maneuvers solved at a time.", default=1, min=1),
    "processes": option("--jobs", "N", "Processes; by default one a core, 2 GB each.", min=1),
    "dask": option("--dask", "ADDRESS", "Dask scheduler for files, seeds or a fleet, or local."),
    "dask_build": option("--dask", "ADDRESS", "Dask scheduler for them, or local."),
    "beside": option("--with", "FILE", "Scenario for what FILE leaves out, such as the vehicle."),
    "world": option("--with", "FILE", "Scenario: its body, obstacles and goals."),
    "driven_in": option("--with", "FILE", "Scenario that was planned or driven."),
    "model": option(
        "--model", "MODULE:OBJECT", "Your own vehicle, for files that cannot state it."
    ),
    "case": option("--case", "N", "Which problem of FILE, from 0.", min=0),
    "width": option("--width", "M", "Working width [m]."),
    "headland": option("--headland", "M", "Of the strip to turn in [m]."),
    "corner": option("--origin", "LAT,LON", "Of the point 0, 0 [deg], for the GeoJSON written."),
    "origin": option(
        "--origin",
        "LAT,LON",
        "Of the point 0, 0 [deg]: longitudes and latitudes as well (csv), or instead of metres "
        "(geojson); x is east.",
    ),
    "within": option("--within", "T", "Factor that words may be costlier.", min=1.0),
    "most": option("--most", "N", "Trims (or maneuvers) of it.", min=1),
    "max_trims": option("--max-trims", "N", "Trims of a word.", min=3),
    "radius": option("--radius", "R", "Of the disc of goals [m]."),
    "coverage": flag("--coverage", "How well its words cover the poses around, by samples."),
    "to": option(
        "--to", "FORMAT", "commonroad, csv, geojson, rerun or ros2 (a bag).", default=NEEDED
    ),
    "step": option("--step", "S", "Time between rows [s] (csv, rerun, ros2)."),
    "rate": option("--rate", "HZ", "Rows per second, instead of --step."),
    "document": option(
        "--document",
        "KIND",
        "Of a result file: plan, loop, statistics, fleet, fleet-loop, road-plan, drive, road-fleet "
        "or road-fleet-drive.",
    ),
}
LOOK = "title size style"

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Exact motion planning with symmetry: trims, maneuvers, and the words that join them.",
    epilog=ending(""),
)
GROUPS = {"": app}
for group, said in {
    "automaton": "Make, list or draw a library of trims.",
    "cache": "List or clear what is kept on disk.",
}.items():
    GROUPS[group] = typer.Typer(
        no_args_is_help=True, rich_markup_mode=None, help=said, epilog=ending(group)
    )
    app.add_typer(GROUPS[group], name=group)

Given: TypeAlias = SimpleNamespace  # arguments and options of a command, by their names
Work: TypeAlias = Callable[[Given], int]


def command(name: str, known: str = "") -> Callable[[Work], Work]:
    """Register the command that follows, with those entries of the table that it has.

    An entry that the command knows by another name is `name:entry`.
    """

    def register(work: Work) -> Work:
        words = (word.partition(":") for word in known.split())
        parameters = [TABLE[entry or word].parameter(word) for word, _, entry in words]

        @exits
        def run(**given: Any) -> int:
            return work(Given(**given))

        run.__doc__ = work.__doc__
        vars(run)["__signature__"] = inspect.Signature(parameters)
        run.__annotations__ = {one.name: one.annotation for one in parameters}
        group, _, last = name.rpartition(" ")
        GROUPS[group].command(last, epilog=ending(name))(run)
        return work

    return register


def run(argv: list[str]) -> int:
    """Run the command line with the arguments `argv`, and return the exit code."""
    with safe_streams() as (out, _):
        try:
            app(args=argv, prog_name="maneuver-automaton")
            code = 0
        except SystemExit as done:
            code = done.code if isinstance(done.code, int) else int(done.code is not None)
        out.flush()
        if out.failure is not None and not isinstance(out.failure, BrokenPipeError):
            complain(f"standard output: cannot be written: {out.failure.strerror or out.failure}")
            if code == FOUND and argv[:1] in PRINTED:
                code = BAD_INPUT  # there is no other output
    return code


def _version(asked: bool) -> None:
    if asked:
        from maneuver_automaton import __version__

        typer.echo(f"maneuver-automaton {__version__}")
        raise typer.Exit


@app.callback()
def every_command(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Options before the name of a command."""


def _parts(given: Given) -> Any:
    from maneuver_automaton.cli.inputs import Parts

    return Parts(beside=given.beside, case=given.case, model=getattr(given, "model", None))


def _look(given: Given) -> Any:
    from maneuver_automaton.cli.inputs import LookOptions

    return LookOptions(title=given.title, size=given.size, style=given.style)


@command("cache show")
def cache_show(_: Given) -> int:
    """List what is kept on disk to be quicker the next time: compiled kernels, tables."""
    from maneuver_automaton.cli import file_commands

    return file_commands.show_cache()


@command("cache clear")
def cache_clear(_: Given) -> int:
    """Remove it; it is made again when it is needed."""
    from maneuver_automaton.cli import file_commands

    return file_commands.clear_cache()


@command("compile", "jobs:processes")
def compile_all(given: Given) -> int:
    """Compile all kernels now; an installation that is not editable brings those of first plans."""
    from maneuver_automaton.cli import file_commands

    return file_commands.compile_all(jobs=given.jobs)


@contextlib.contextmanager
def _document(written: Path, given: Given) -> Iterator[None]:
    """Where --json is asked for, print a file once it is written, and nothing else to stdout."""
    if not given.as_json:
        yield
        return
    if given.file.is_dir():
        raise InvalidScenario(
            f"--json: prints the document of one file, and {given.file} is a folder"
        )
    with contextlib.redirect_stdout(sys.stderr):
        yield
    sys.stdout.write(written.read_text(encoding="utf-8"))


def _run_jobs(name: str, document: str, given: Given) -> int:
    from maneuver_automaton.cli.inputs import Budgets, Options
    from maneuver_automaton.cli.jobs import run_jobs

    def stated(*names: str) -> dict[str, Any]:
        return {name: getattr(given, name) for name in names if hasattr(given, name)}

    if name == "mpc" and given.alternatives:
        raise InvalidScenario(
            f"--alternatives: got {given.alternatives}, but a closed loop keeps one plan a step; "
            "leave it out, or ask plan for them"
        )
    options = Options(
        budgets=Budgets(**stated("time_limit", "gap", "alternatives", "steps")),
        look=_look(given),
        scheduler=given.dask,
        **stated("plot", "animate", "html", "quiet", "leave", "jobs", "seed", "seeds", "resume"),
    )
    with _document(given.out / document, given):
        return run_jobs(name, given.file, given.out, options, _parts(given))


@command(
    "plan",
    "file out time_limit alternatives plot animate quiet jobs beside case model gap "
    f"{LOOK} html dask leave as_json",
)
def plan(given: Given) -> int:
    """Plan the problem of a file, or of every file of a folder.

    A folder that was interrupted goes on where it was when the same command is called again.
    """
    return _run_jobs("plan", "plan.json", given)


@command(
    "cover",
    "file:field out beside width headland origin:corner time_limit:turn_limit plot quiet "
    "jobs:turns model as_json",
)
def cover(given: Given) -> int:
    """Cover a field in swaths, with turns inside its headland, as one plan.

    Writes plan.json, field.png and field.geojson.
    """
    from maneuver_automaton.cli.cover_command import cover_file

    with _document(given.out / "plan.json", given):
        return cover_file(given)


@command(
    "mpc",
    "file steps seed out time_limit gap alternatives plot animate quiet jobs beside case seeds "
    f"dask resume model {LOOK} html as_json",
)
def mpc(given: Given) -> int:
    """Drive a scenario, or every one of a folder, in closed loop: plan, drive a step, plan again.

    A folder that was interrupted goes on where it was when the same command is called again.
    """
    document = "closed_loop.json" if given.seeds is None else "statistics.json"
    return _run_jobs("mpc", document, given)


@command("check", "file beside case model leave:leaves")
def check(given: Given) -> int:
    """Report symmetry, consistency and feasibility, without a plan.

    FILE may be a plan.json: its plans are proven again, in the world of the file that they were
    planned from, which is that of --with or, of several vehicles, the one that they name. So is
    what was driven in a closed_loop.json, of one vehicle or several, on roads too.
    """
    from maneuver_automaton.cli import check_command

    return check_command.check_file(given.file, parts=_parts(given), leave=given.leave)


@command("automaton build", "file:library out quiet jobs:solved dask:dask_build")
def automaton_build(given: Given) -> int:
    """Write the library of a scenario, or of a build file, as a file.

    It is DIR/library.json, or DIR itself if it ends in .json. A build that was killed goes on
    where it was when it is called again.
    """
    from maneuver_automaton.cli import automaton_command

    return automaton_command.build(
        given.file, given.out, jobs=given.jobs, scheduler=given.dask, quiet=given.quiet
    )


@command("automaton design", "file:build_file out quiet plot:factor within most max_trims radius")
def automaton_design(given: Given) -> int:
    """Write the smallest library whose words lose no more than a factor, which is proven.

    It is DIR/library.json, or DIR itself if it ends in .json. The options hold instead of what the
    file says. Of a library with maneuvers, the --most are kept whose ends are spread best.
    """
    from maneuver_automaton.cli import automaton_command

    stated = {key: getattr(given, key) for key in ("within", "most", "max_trims")}
    stated["radius_m"] = given.radius
    instead = {key: value for key, value in stated.items() if value is not None}
    return automaton_command.design(
        given.file, given.out, instead=instead, quiet=given.quiet, plot=given.plot
    )


@command("automaton show", "file:library coverage model")
def automaton_show(given: Given) -> int:
    """List the trims and maneuvers of a scenario, a library or another file of primitives."""
    from maneuver_automaton.cli import automaton_command

    return automaton_command.show(given.file, coverage=given.coverage, model_text=given.model)


@command("automaton draw", f"file:library out model {LOOK}")
def automaton_draw(given: Given) -> int:
    """Draw the trims and maneuvers of a scenario, a library or another file of primitives.

    The picture is DIR/automaton.png, or DIR itself if it ends in .png, .pdf or .svg; that of the
    maneuvers stands beside it, its name ending in _maneuvers.
    """
    from maneuver_automaton.cli import automaton_command

    return automaton_command.draw(given.file, given.out, look=_look(given), model_text=given.model)


@command("convert", "source target beside case")
def convert(given: Given) -> int:
    """Write a problem as a scenario, its trims listed, or a map or primitives in another format.

    OUT ends in .yaml or .yml, or, for a map, in .map (MovingAI). A map without --with becomes
    a Nav2 map: OUT and an image beside it. Primitives end in .json (a library), .nav2.json
    (Nav2), .mprim (SBPL) or .xml (CommonRoad); IN is one of these, a scenario, or a folder or
    .zip exported by AROC.
    """
    from maneuver_automaton.cli import file_commands

    return file_commands.convert(given.source, given.target, parts=_parts(given))


@command("example", "name out:copy")
def example(given: Given) -> int:
    """Write one of the scenarios that come with the package, with its maps, or list them."""
    from maneuver_automaton.cli import file_commands

    if given.name is None:
        return file_commands.list_scenarios()
    return file_commands.write_scenario(given.name, given.out)


@command("plot", f"file:result out:picture animate {LOOK} html beside:world")
def plot(given: Given) -> int:
    """Draw a plan.json, or a closed_loop.json, again: PLAN.png beside it, or the file given.

    With --animate it is an animation, PLAN.gif; with --html a page that plays it, PLAN.html. These
    files state neither body nor obstacles: --with its scenario, all is drawn as plan and mpc do. A
    closed loop alone is drawn as an arc from step to step.
    """
    from maneuver_automaton.cli import result_commands

    return result_commands.plot(
        given.file,
        given.out,
        animate=given.animate,
        html=given.html,
        look=_look(given),
        beside=given.beside,
    )


@command("export", "file:result to out:exported beside:driven_in case model step rate origin")
def export(given: Given) -> int:
    """Write a plan.json, or a closed_loop.json, for another program.

    It goes to PLAN.csv, PLAN.geojson, PLAN.rrd, PLAN_ros2 or PLAN_commonroad.xml beside it, or to
    the file given. --with its scenario it holds the body and what is around it; a closed loop and a
    solution for CommonRoad need that.
    """
    from maneuver_automaton.cli import result_commands

    step, rate = given.step, given.rate
    if rate is not None:
        if step is not None or not 0.0 < rate < math.inf:
            raise InvalidScenario(f"--rate: got {rate}, need a positive number, and no --step")
        step = 1.0 / rate
    return result_commands.export(
        given.file, given.to, given.out, parts=_parts(given), step=step, origin=given.origin
    )


@command("schema", "document")
def schema(given: Given) -> int:
    """Print the JSON Schema of scenario files, for editors, or of a file that is written."""
    from maneuver_automaton.cli import file_commands

    return file_commands.print_schema(given.document)
