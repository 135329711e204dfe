"""The commands and their options. Nothing heavy is imported before a command runs."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain, exits
from maneuver_automaton.cli.help_texts import ending
from maneuver_automaton.cli.streams import safe_streams
from maneuver_automaton.errors import InvalidScenario

PRINTED = (["schema"],)  # commands that do nothing but print

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Exact motion planning with symmetry: trims, maneuvers, and the words that join them.",
    epilog=ending(""),
)
automaton_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Make, list or draw a library of trims.",
    epilog=ending("automaton"),
)
app.add_typer(automaton_app, name="automaton")
cache_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="List or clear what is kept on disk.",
    epilog=ending("cache"),
)
app.add_typer(cache_app, name="cache")

File = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario (YAML), or another format.")]
Library = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario or library file.")]
Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")]
TimeLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="S", help="Upper bound for search and refinement [s]."),
]
Gap = Annotated[
    float | None,
    typer.Option(
        "--gap",
        metavar="SHARE",
        help="Stop once no plan is proven to be cheaper by more than this share (0.05: 5 %).",
    ),
]
Alternatives = Annotated[
    int, typer.Option("--alternatives", min=0, metavar="K", help="Costlier plans to list as well.")
]
Plot = Annotated[bool, typer.Option("--plot/--no-plot", help="Draw the plan.")]
Title = Annotated[
    str | None,
    typer.Option("--title", metavar="TEXT", help="Of the pictures (default: scenario's name)."),
]
Size = Annotated[
    str | None,
    typer.Option("--size", metavar="WxH", help="Of the main picture [in]: 7x4, or 3.5."),
]
Style = Annotated[
    str, typer.Option("--style", metavar="NAME", help="screen, or paper: no numbers above.")
]
Animate = Annotated[
    bool, typer.Option("--animate", help="Animate it as well (plan: GIF; mpc: GIF and HTML).")
]
Html = Annotated[
    bool, typer.Option("--html", help="Write a page that plays it: one file, no network.")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")]
Json = Annotated[
    bool,
    typer.Option("--json", help="Print what is written, as JSON; the table goes to stderr."),
]
Jobs = Annotated[
    int,
    typer.Option(
        "--jobs",
        min=1,
        metavar="N",
        help="Files (of a folder), seeds, or searches for a fleet at a time.",
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask", metavar="ADDRESS", help="Dask scheduler for files, seeds or a fleet, or local."
    ),
]
With = Annotated[
    Path | None,
    typer.Option(
        "--with", metavar="FILE", help="Scenario for what FILE leaves out, such as the vehicle."
    ),
]
OwnModel = Annotated[
    str | None,
    typer.Option(
        "--model", metavar="MODULE:OBJECT", help="Your own vehicle, for files that cannot state it."
    ),
]
Case = Annotated[
    int | None,
    typer.Option("--case", min=0, metavar="N", help="Which problem of FILE, from 0."),
]


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


@cache_app.command("show", epilog=ending("cache show"))
@exits
def cache_show() -> int:
    """List what is kept on disk to be quicker the next time: compiled kernels, tables."""
    from maneuver_automaton.cli import cache_command

    return cache_command.show()


@cache_app.command("clear", epilog=ending("cache clear"))
@exits
def cache_clear() -> int:
    """Remove it; it is made again when it is needed."""
    from maneuver_automaton.cli import cache_command

    return cache_command.clear()


@app.command("compile", epilog=ending("compile"))
@exits
def compile_all(
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", min=1, metavar="N", help="Processes; by default one a core, 2 GB each."
        ),
    ] = None,
) -> int:
    """Compile all kernels now; an installation that is not editable brings them."""
    from maneuver_automaton.cli import cache_command

    return cache_command.compile_all(jobs=jobs)


@contextlib.contextmanager
def _document(written: Path, file: Path, *, asked: bool) -> Iterator[None]:
    """Where --json is asked for, print a file once it is written, and nothing else to stdout."""
    if not asked:
        yield
        return
    if file.is_dir():
        raise InvalidScenario(f"--json: prints the document of one file, and {file} is a folder")
    with contextlib.redirect_stdout(sys.stderr):
        yield
    sys.stdout.write(written.read_text(encoding="utf-8"))


@app.command(epilog=ending("plan"))
@exits
def plan(
    file: File,
    out: Out = Path("out"),
    time_limit: TimeLimit = None,
    alternatives: Alternatives = 0,
    plot: Plot = True,
    animate: Animate = False,
    quiet: Quiet = False,
    jobs: Jobs = 1,
    with_file: With = None,
    case: Case = None,
    model: OwnModel = None,
    gap: Gap = None,
    title: Title = None,
    size: Size = None,
    style: Style = "screen",
    html: Html = False,
    dask: Dask = None,
    leave: Annotated[
        bool,
        typer.Option("--leave", help="Leave a start in contact first, by the shortest coast."),
    ] = False,
    as_json: Json = False,
) -> int:
    """Plan the problem of a file, or of every file of a folder.

    A folder that was interrupted goes on where it was when the same command is called again.
    """
    from maneuver_automaton.cli.inputs import Parts
    from maneuver_automaton.cli.jobs import run_jobs
    from maneuver_automaton.cli.options import Budgets, LookOptions, Options

    options = Options(
        budgets=Budgets(time_limit=time_limit, gap=gap, alternatives=alternatives),
        plot=plot,
        animate=animate,
        html=html,
        look=LookOptions(title=title, size=size, style=style),
        quiet=quiet,
        leave=leave,
        jobs=jobs,
        scheduler=dask,
    )
    parts = Parts(beside=with_file, case=case, model=model)
    with _document(out / "plan.json", file, asked=as_json):
        return run_jobs("plan", file, out, options, parts)


@app.command(epilog=ending("cover"))
@exits
def cover(
    file: Annotated[
        Path,
        typer.Argument(metavar="FIELD", help="A scenario with `field` (YAML), or GeoJSON."),
    ],
    out: Out = Path("out"),
    with_file: With = None,
    width: Annotated[
        float | None, typer.Option("--width", metavar="M", help="Working width [m].")
    ] = None,
    headland: Annotated[
        float | None, typer.Option("--headland", metavar="M", help="Of the strip to turn in [m].")
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin", metavar="LAT,LON", help="Of the point 0, 0 [deg], for the GeoJSON written."
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", metavar="S", help="For each turn [s]; left out: 1."),
    ] = None,
    plot: Plot = True,
    quiet: Quiet = False,
    jobs: Annotated[
        int, typer.Option("--jobs", min=1, metavar="N", help="Turns that are planned at a time.")
    ] = 1,
    model: OwnModel = None,
    as_json: Json = False,
) -> int:
    """Cover a field in swaths, with turns inside its headland, as one plan.

    Writes plan.json, field.png and field.geojson.
    """
    from maneuver_automaton.cli.cover_command import cover_file

    with _document(out / "plan.json", file, asked=as_json):
        return cover_file(
            file,
            out,
            beside=with_file,
            origin=origin,
            model=model,
            time_limit=time_limit,
            jobs=jobs,
            plot=plot,
            quiet=quiet,
            width_m=width,
            headland_m=headland,
        )


@app.command(epilog=ending("mpc"))
@exits
def mpc(
    file: File,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps", min=1, metavar="N", help="Steps at most (default: the scenario's)."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, metavar="N", help="Seed of the disturbance."),
    ] = None,
    out: Out = Path("out"),
    time_limit: TimeLimit = None,
    gap: Gap = None,
    alternatives: Alternatives = 0,
    plot: Plot = True,
    animate: Animate = False,
    quiet: Quiet = False,
    jobs: Jobs = 1,
    with_file: With = None,
    case: Case = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds", min=1, metavar="K", help="Statistics over K seeds instead of one loop."
        ),
    ] = None,
    dask: Dask = None,
    resume: Annotated[
        Path | None,
        typer.Option("--resume", metavar="LOG", help="Go on from a closed_loop.json."),
    ] = None,
    model: OwnModel = None,
    title: Title = None,
    size: Size = None,
    style: Style = "screen",
    html: Html = False,
    as_json: Json = False,
) -> int:
    """Drive a scenario, or every one of a folder, in closed loop: plan, drive a step, plan again.

    A folder that was interrupted goes on where it was when the same command is called again.
    """
    from maneuver_automaton.cli.inputs import Parts
    from maneuver_automaton.cli.jobs import run_jobs
    from maneuver_automaton.cli.options import Budgets, LookOptions, Options

    budgets = Budgets(time_limit=time_limit, gap=gap, steps=steps)
    if alternatives:
        raise InvalidScenario(
            f"--alternatives: got {alternatives}, but a closed loop keeps one plan a step; "
            "leave it out, or ask plan for them"
        )
    options = Options(
        budgets=budgets,
        plot=plot,
        animate=animate,
        html=html,
        look=LookOptions(title=title, size=size, style=style),
        quiet=quiet,
        seed=seed,
        seeds=seeds,
        resume=resume,
        jobs=jobs,
        scheduler=dask,
    )
    parts = Parts(beside=with_file, case=case, model=model)
    written = out / ("closed_loop.json" if seeds is None else "statistics.json")
    with _document(written, file, asked=as_json):
        return run_jobs("mpc", file, out, options, parts)


@app.command(epilog=ending("check"))
@exits
def check(
    file: File,
    with_file: With = None,
    case: Case = None,
    model: OwnModel = None,
    leave: Annotated[
        bool, typer.Option("--leave", help="The plan of one vehicle leaves a start in contact.")
    ] = False,
) -> int:
    """Report symmetry, consistency and feasibility, without a plan.

    FILE may be a plan.json: its plans are proven again, in the world of the file that they were
    planned from, which is that of --with or, of several vehicles, the one that they name. So is
    what was driven in a closed_loop.json, of one vehicle or several, on roads too.
    """
    from maneuver_automaton.cli import check_command
    from maneuver_automaton.cli.inputs import Parts

    parts = Parts(beside=with_file, case=case, model=model)
    return check_command.check_file(file, parts=parts, leave=leave)


@automaton_app.command("build", epilog=ending("automaton build"))
@exits
def automaton_build(
    file: Library,
    out: Out = Path("out"),
    quiet: Quiet = False,
    jobs: Annotated[
        int, typer.Option("--jobs", min=1, metavar="N", help="Maneuvers solved at a time.")
    ] = 1,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="Dask scheduler for them, or local."),
    ] = None,
) -> int:
    """Write the library of a scenario, or of a build file, as a file.

    It is DIR/library.json, or DIR itself if it ends in .json. A build that was killed goes on
    where it was when it is called again.
    """
    from maneuver_automaton.cli import automaton_command

    return automaton_command.build(file, out, jobs=jobs, scheduler=dask, quiet=quiet)


@automaton_app.command("design", epilog=ending("automaton design"))
@exits
def automaton_design(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Build file with design, or library.")
    ],
    out: Out = Path("out"),
    quiet: Quiet = False,
    plot: Annotated[
        bool, typer.Option("--plot", help="Draw the factor over the goals, with --max-trims.")
    ] = False,
    within: Annotated[
        float | None,
        typer.Option("--within", min=1.0, metavar="T", help="Factor that words may be costlier."),
    ] = None,
    most: Annotated[
        int | None, typer.Option("--most", min=1, metavar="N", help="Trims (or maneuvers) of it.")
    ] = None,
    max_trims: Annotated[
        int | None, typer.Option("--max-trims", min=3, metavar="N", help="Trims of a word.")
    ] = None,
    radius: Annotated[
        float | None, typer.Option("--radius", metavar="R", help="Of the disc of goals [m].")
    ] = None,
) -> int:
    """Write the smallest library whose words lose no more than a factor, which is proven.

    It is DIR/library.json, or DIR itself if it ends in .json. The options hold instead of what the
    file says. Of a library with maneuvers, the --most are kept whose ends are spread best.
    """
    from maneuver_automaton.cli import automaton_command

    given = {"within": within, "most": most, "max_trims": max_trims, "radius_m": radius}
    instead = {key: value for key, value in given.items() if value is not None}
    return automaton_command.design(file, out, instead=instead, quiet=quiet, plot=plot)


@automaton_app.command("show", epilog=ending("automaton show"))
@exits
def automaton_show(
    file: Library,
    coverage: Annotated[
        bool,
        typer.Option("--coverage", help="How well its words cover the poses around, by samples."),
    ] = False,
    model: OwnModel = None,
) -> int:
    """List the trims and maneuvers of a scenario, a library or another file of primitives."""
    from maneuver_automaton.cli import automaton_command

    return automaton_command.show(file, coverage=coverage, model_text=model)


@automaton_app.command("draw", epilog=ending("automaton draw"))
@exits
def automaton_draw(
    file: Library,
    out: Out = Path("out"),
    model: OwnModel = None,
    title: Title = None,
    size: Size = None,
    style: Style = "screen",
) -> int:
    """Draw the trims and maneuvers of a scenario, a library or another file of primitives.

    The picture is DIR/automaton.png, or DIR itself if it ends in .png, .pdf or .svg; that of the
    maneuvers stands beside it, its name ending in _maneuvers.
    """
    from maneuver_automaton.cli import automaton_command
    from maneuver_automaton.cli.options import LookOptions

    look = LookOptions(title=title, size=size, style=style)
    return automaton_command.draw(file, out, look=look, model_text=model)


@app.command(epilog=ending("convert"))
@exits
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN")],
    target: Annotated[Path, typer.Argument(metavar="OUT")],
    with_file: With = None,
    case: Case = None,
) -> int:
    """Write a problem as a scenario, its trims listed, or a map or primitives in another format.

    OUT ends in .yaml or .yml, or, for a map, in .map (MovingAI). A map without --with becomes
    a Nav2 map: OUT and an image beside it. Primitives end in .json (a library), .nav2.json
    (Nav2), .mprim (SBPL) or .xml (CommonRoad); IN is one of these, a scenario, or a folder or
    .zip exported by AROC.
    """
    from maneuver_automaton.cli import convert_command
    from maneuver_automaton.cli.inputs import Parts

    return convert_command.convert(source, target, parts=Parts(beside=with_file, case=case))


@app.command(epilog=ending("example"))
@exits
def example(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Of a scenario; left out, all are listed.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="File or folder (default: NAME.yaml)."),
    ] = None,
) -> int:
    """Write one of the scenarios that come with the package, with its maps, or list them."""
    from maneuver_automaton.cli import example_command

    if name is None:
        return example_command.show()
    return example_command.write(name, out)


@app.command(epilog=ending("plot"))
@exits
def plot(
    file: Annotated[
        Path,
        typer.Argument(metavar="PLAN.json", help="Of plan, or a closed_loop.json of mpc."),
    ],
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="The picture.")] = None,
    animate: Animate = False,
    title: Title = None,
    size: Size = None,
    style: Style = "screen",
    html: Html = False,
    with_file: Annotated[
        Path | None,
        typer.Option("--with", metavar="FILE", help="Scenario: its body, obstacles and goals."),
    ] = None,
) -> int:
    """Draw a plan.json, or a closed_loop.json, again: PLAN.png beside it, or the file given.

    With --animate it is an animation, PLAN.gif; with --html a page that plays it, PLAN.html. These
    files state neither body nor obstacles: --with its scenario, all is drawn as plan and mpc do. A
    closed loop alone is drawn as an arc from step to step.
    """
    from maneuver_automaton.cli import result_commands
    from maneuver_automaton.cli.options import LookOptions

    look = LookOptions(title=title, size=size, style=style)
    return result_commands.plot(file, out, animate=animate, html=html, look=look, beside=with_file)


@app.command(epilog=ending("export"))
@exits
def export(
    file: Annotated[
        Path,
        typer.Argument(metavar="PLAN.json", help="Of plan, or a closed_loop.json of mpc."),
    ],
    to: Annotated[
        str,
        typer.Option(
            "--to", metavar="FORMAT", help="commonroad, csv, geojson, rerun or ros2 (a bag)."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="The file, or the folder of a bag."),
    ] = None,
    with_file: Annotated[
        Path | None,
        typer.Option("--with", metavar="FILE", help="Scenario that was planned or driven."),
    ] = None,
    case: Case = None,
    model: OwnModel = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Time between rows [s] (csv, rerun, ros2)."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Rows per second, instead of --step."),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin",
            metavar="LAT,LON",
            help="Of the point 0, 0 [deg]: longitudes and latitudes as well (csv), or instead of "
            "metres (geojson); x is east.",
        ),
    ] = None,
) -> int:
    """Write a plan.json, or a closed_loop.json, for another program.

    It goes to PLAN.csv, PLAN.geojson, PLAN.rrd, PLAN_ros2 or PLAN_commonroad.xml beside it, or to
    the file given. --with its scenario it holds the body and what is around it; a closed loop and a
    solution for CommonRoad need that.
    """
    from maneuver_automaton.cli import result_commands
    from maneuver_automaton.cli.inputs import Parts

    parts = Parts(beside=with_file, case=case, model=model)
    if rate is not None:
        if step is not None or not 0.0 < rate < math.inf:
            raise InvalidScenario(f"--rate: got {rate}, need a positive number, and no --step")
        step = 1.0 / rate
    return result_commands.export(file, to, out, parts=parts, step=step, origin=origin)


@app.command(epilog=ending("schema"))
@exits
def schema(
    document: Annotated[
        str | None,
        typer.Option(
            "--document",
            metavar="KIND",
            help="Of a result file: plan, loop, statistics, fleet, fleet-loop, road-plan, drive, "
            "road-fleet or road-fleet-drive.",
        ),
    ] = None,
) -> int:
    """Print the JSON Schema of scenario files, for editors, or of a file that is written."""
    from maneuver_automaton.cli import convert_command

    return convert_command.print_schema(document)
