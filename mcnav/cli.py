"""Command line: parse options, run a use case of `mcnav.workflow` or `mcnav.studies`, print the results."""

from __future__ import annotations

import atexit
import gc
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, ParamSpec, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_name

from mcnav import next_command
from mcnav import shell_completion as completion
from mcnav._interrupts import RESUMES, interruptible, interrupts
from mcnav.output_place import output_file, output_folder
from mcnav.pages import Page, page_text
from mcnav.report.fitted_table import OpenConsole
from mcnav.systems.templates import templates

if TYPE_CHECKING:
    from mcnav.workflow.run import Run

CHECK_FAILED, BAD_INPUT, SOME_FAILED, BUSY = 1, 2, 3, 4
"""Exit statuses; 0 is success, and those of interrupts are in `mcnav._interrupts`."""

UNKNOWN_CHOICE = re.compile(r"(?:Value error, )?'(?P<name>.*)' is not one of (?P<known>'.*')\.?", re.DOTALL)
"""Message of typer about an unknown choice."""

LONGEST_CHOICE = 60
"""Characters of an unknown choice that are shown."""

GARBAGE_THRESHOLD = 50_000
"""New objects after which Python looks for cycles to free."""

GROUPS: Final = {
    "Start": ("demo", "new", "check", "run", "docs"),
    "Analyse": ("lincov", "sweep", "allocate", "linearity", "start-times", "identify", "judge", "filters"),
    "Look": ("show", "live", "report", "brief", "compare", "index", "figure", "export", "replay", "trajectory", "imu"),
    "Advanced": ("partials", "record", "schema", "compile", "reproduce", "calibrate"),
}
"""Commands in the order and under the headings of ``mcnav --help``."""


EARLIER: Final = {"check-scenario": "check"}
"""Former names of commands, which still work."""


class _Groups(TyperGroup):
    """Commands under the headings of `GROUPS`, one line each."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by its name or a former one."""
        return super().get_command(ctx, EARLIER.get(cmd_name, cmd_name))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands into the help."""
        wide = max(map(len, self.commands))
        for heading, names in GROUPS.items():
            with formatter.section(heading):
                limit = formatter.width - 6 - wide
                formatter.write_dl(
                    [(f"{name:{wide}}", self.commands[name].get_short_help_str(limit)) for name in names]
                )


app = typer.Typer(
    cls=_Groups, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None, add_completion=True
)
new = typer.Typer(no_args_is_help=True, help="Write a new campaign or scenario, ready to run.")
out, err = OpenConsole(highlight=False, soft_wrap=True), OpenConsole(stderr=True, highlight=False, soft_wrap=True)

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
Format = Literal["table", "csv", "json"]
Axes = Literal["start", "trajectory"]
TemplateType = Literal[tuple(templates())]  # type: ignore[valid-type]
Platform = Literal["strapdown", "inertial", "level"]
CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file (TOML).", autocompletion=completion.campaigns)
]
Folder = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", autocompletion=completion.runs)]
Folders = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.", autocompletion=completion.runs)]
FormatOption = Annotated[
    Format, typer.Option("--format", help="Print a table, or only CSV or JSON in full precision on stdout.")
]
UnitsOption = Annotated[Literal["shown", "SI"], typer.Option(help="Units: those shown in reports, or SI.")]
Count = Annotated[int | None, typer.Option("--count", min=2, max=100_000, help="Number of start times [default: 241].")]
OutFolder = Annotated[
    Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_start_times or NAME_linearity].")
]
ChosenAxes = Annotated[Axes | None, typer.Option(help="Where the reference axes are aligned [default: start].")]
Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the files: letters, digits and _.")]
Into = Annotated[Path, typer.Option("--out", "--in", metavar="FOLDER", help="Output folder.")]
Engine = Annotated[
    str | None,
    typer.Option(
        help="Simulation engine: ensemble, reference or map [default: the scenario's first].",
        autocompletion=completion.engines,
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Simulate on a dask cluster, such as tcp://host:8786; see mcnav docs scaling."
    ),
]
NamedColumns = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=COLUMN", help="Column of a trajectory file, such as 'lat=latitude [rad]'; repeat."),
]


def _fail(message: str, status: int = BAD_INPUT) -> typer.Exit:
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False)
    return typer.Exit(status)


@contextmanager
def _reported_errors(file: Path | None, given: Path | None) -> Iterator[None]:
    """Turn errors that the user can fix into messages and an exit status.

    Those of scenarios name the campaign file, and where memory is short what was given.
    """
    from mcnav.contract.errors import ScenarioError, SimulationFailed
    from mcnav.errors import CampaignError, ClusterError, Problem, RunFolderBusy, RunFolderError, TooManyFailures

    try:
        yield
    except RunFolderBusy as problem:
        raise _fail(str(problem), BUSY) from None
    except TooManyFailures as problem:
        raise _fail(f"{problem}; {RESUMES.format(' without --max-failures')}", SOME_FAILED) from None
    except MemoryError:
        place = f"{given}: " if given else ""
        remedy = f"; {RESUMES.format('')} (fewer --jobs need less)" if interrupts.resumes else ""
        raise _fail(f"{place}not enough memory{remedy}") from None
    except ScenarioError as problem:
        raise _fail(str(Problem(str(file or ""), f"scenario.{problem.key}", str(problem)))) from None
    except SimulationFailed as problem:
        raise _fail(str(Problem(str(file or ""), "scenario", str(problem)))) from None
    except (CampaignError, ClusterError, RunFolderError) as problem:
        raise _fail(str(problem)) from None
    except OSError as problem:
        raise _fail(f"{problem.filename or 'a file'}: {problem.strerror or problem}") from None


class _Command(TyperCommand):
    """A command that suggests the choice that an unknown one was meant for, and the closest of a long list."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as wrong:
            wrong.message = _with_suggestion(str(wrong.message))
            raise


def _with_suggestion(message: str) -> str:
    """Shorten the message about an unknown choice, and suggest a near one; others are left.

    >>> _with_suggestion("Value error, 'tnd1772' is not one of 'tn-d1772', 'textbook'.")
    "'tnd1772' is unknown; did you mean 'tn-d1772'? It is one of tn-d1772, textbook"
    """
    parts = UNKNOWN_CHOICE.fullmatch(message)
    if parts is None:
        return message
    from mcnav.errors import suggestion
    from mcnav.units import printable

    name, known = parts["name"], re.findall(r"'([^']*)'", parts["known"])
    return f"'{printable(name, LONGEST_CHOICE)}' is unknown{suggestion(name, known)}"


def _command(
    name: str | None = None, group: typer.Typer = app, resumes: bool = False
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Add a command whose errors are reported; its parameter ``campaign``, if any, is the file that they name.

    One that ``resumes`` stores samples, and continues where it was interrupted.
    """

    def add(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        @wraps(function)
        def command(*arguments: Parameters.args, **options: Parameters.kwargs) -> Result:
            interrupts.resumes = resumes
            file, folder = (
                each if isinstance(each := options.get(name), Path) else None for name in ("campaign", "folder")
            )
            with _reported_errors(file, file or folder):
                return function(*arguments, **options)

        group.command(name, cls=_Command)(command)
        return command

    return add


def _print(text: str) -> None:
    out.print(text, markup=False)


def _print_notes(notes: Iterable[str]) -> None:
    for note in notes:
        err.print(f"note: {note}", markup=False)


def _print_written(paths: Iterable[Path]) -> None:
    for path in paths:
        _print(f"written: {path}")


def _print_next(command: str) -> None:
    """Print the command that one would type next, below what is read by people."""
    _print(f"\nnext: {command}")


def _open(page: Path) -> None:
    """Show a page in the browser."""
    _open_address(page.resolve().as_uri())


def _open_address(address: str, what: str = "file") -> None:
    import webbrowser

    if not webbrowser.open(address):
        _print_notes([f"no browser is found; open the {what} yourself"])


def _export(chosen: Format, rows: Sequence[Mapping[str, Any]], tables: Mapping[str, Any]) -> None:
    """Print rows as CSV, or tables by name as JSON."""
    from mcnav.report import export

    sys.stdout.write(export.as_csv(rows) if chosen == "csv" else export.as_json(tables))


def run_folder(campaign: Path) -> Path:
    """Return ``reports/`` with the campaign file's stem; for the copy in a run folder, that folder."""
    if campaign.name == "campaign.toml" and (campaign.parent / "manifest.json").exists():
        return campaign.parent
    return Path("reports") / campaign.stem


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        try:
            _print(f"mcnav {version('mcnav')}")
        except PackageNotFoundError:
            raise _fail("mcnav is not installed here, so that its version is not known") from None
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Test the linear covariance analysis of an inertial navigation system by Monte Carlo simulation."""


@_command(resumes=True)
def run(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder [default: reports/NAME].")] = None,
    engine: Engine = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Parallel jobs [default: 2].")] = None,
    dask: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Simulate in N processes of a local dask cluster.")
    ] = None,
    scheduler: Scheduler = None,
    samples: Annotated[int | None, typer.Option(min=2, help="Number of samples [default: the file's].")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed [default: the file's].")] = None,
    store: Annotated[
        Literal["samples", "summary"] | None,
        typer.Option(help="Store every sample, or only a summary [default: the file's]."),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace an earlier run in the folder.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Run even if partial derivatives do not converge; results show a warning.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Exit with status 1 unless every requirement of [accept] is met.")
    ] = False,
    timeout: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time limit of one sample, such as '10 s'.")
    ] = None,
    max_failures: Annotated[int | None, typer.Option(min=0, help="Stop when more samples fail.")] = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Write only the summary; mcnav report writes the report later.")
    ] = False,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
    form: FormatOption = "table",
) -> None:
    """Simulate a campaign, compare with linear analysis, report.

    Exit status: 0 success, 1 a requirement is not met or undecided (with --check), 2 bad input,
    3 some samples failed, 4 folder in use, 130 interrupted.

    Example: mcnav run campaigns/11_cruise.toml --samples 1000
    """
    from mcnav.config.read import read_campaign
    from mcnav.execution.executors import open_executor
    from mcnav.report import progress
    from mcnav.workflow.run import engine_of, run_campaign

    options = {"samples": samples, "seed": seed, "sample_timeout": timeout, "store": store}
    content = read_campaign(campaign, {key: value for key, value in options.items() if value is not None})
    if check and not content.requirements:
        raise _fail(f"{campaign}: accept: is missing; --check needs requirements")
    if show and no_report:
        raise _fail("--open: shows the report; leave out --no-report")
    target = output_folder(folder, run_folder(campaign))
    chosen = engine or engine_of(target, campaign)
    with open_executor(scheduler, dask, jobs) as (executor, workers, notes), progress.shown(err) as shown:
        done = run_campaign(
            content, target, chosen, workers, fresh, shown, max_failures, executor, force, not no_report
        )
    _print_notes((*notes, *done.notices))
    _print_run(content.name, done, target, form, with_report=not no_report)
    if show:
        _open(target / "report.html")
    if form == "table":
        _print_next(next_command.after_run(campaign, target, done.results, not no_report, show))
    if check and any(entry.finding != "met" for entry in done.results.requirements):
        raise typer.Exit(CHECK_FAILED)
    if done.results.failed:
        raise typer.Exit(SOME_FAILED)


def _print_run(name: str, done: Run, target: Path, form: Format, with_report: bool) -> None:
    """Print the results of a run, and where they are."""
    from mcnav.report import export, output_columns, requirements, terminal

    summary, runs = done.results, {name: done.results}
    console = out if form == "table" else err
    if form != "table":
        rows, asked = output_columns.output_rows(runs), requirements.requirements_table(summary)
        _export(form, rows, {"runs": export.run_rows(runs), "outputs": rows, "requirements": asked.rows})
    if (warning := terminal.warnings(runs)) is not None:
        console.print(warning)
    if form == "table":
        console.print(terminal.comparison(runs))
        console.print()
    console.print(terminal.verdict(summary), soft_wrap=False)
    if summary.requirements:
        console.print()
        console.print(terminal.requirements(summary))
    stored = summary.samples - done.simulated
    if stored > 0:
        console.print(f"\n{stored:,} samples were stored, {done.simulated:,} simulated now")
    result = ("report", "report.html") if with_report else ("summary", "summary.json")
    console.print(f"\n{result[0]}: {target / result[1]}", markup=False)


@_command(resumes=True)
def demo(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="Name or number of the example, such as 19.", autocompletion=completion.examples
        ),
    ] = "01_tn_d1772_trajectory_4",
    listed: Annotated[bool, typer.Option("--list", help="List the examples and their questions.")] = False,
    copy: Annotated[
        Path | None, typer.Option("--copy", metavar="FOLDER", help="Copy the examples into a folder.")
    ] = None,
) -> None:
    """Run an example campaign that comes with mcnav.

    It is run into reports/ of the current folder.

    Example: mcnav demo 14
    """
    from mcnav.entries.examples import copy_examples, example, examples

    if listed:
        for each, question in examples().items():
            _print(f"{each}\n    {question}")
        _print_next(next_command.written("demo", next(iter(examples()))))
    elif copy is not None:
        _print(f"{len(copy_examples(copy))} files\n\nwritten: {copy}")
        _print_next(next_command.written("run", copy / f"{next(iter(examples()))}.toml"))
    else:
        run(campaign=example(name))


@_command()
def report(
    folders: Folders,
    show: Annotated[bool, typer.Option("--open", help="Open the reports in the browser.")] = False,
) -> None:
    """Analyse finished runs again and write their reports.

    Example: mcnav report reports/11_cruise --open
    """
    from mcnav.workflow.analyse import report_run

    for folder in folders:
        report_run(folder)
        written = folder / "report.html"
        _print(f"report: {written}")
        if show:
            _open(written)
    _print_next(next_command.written("compare" if len(folders) > 1 else "show", *folders))


@_command()
def show(
    folder: Folder,
    table: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only this table, such as outputs, budget or requirements.")
    ] = None,
    units: UnitsOption = "shown",
    form: FormatOption = "table",
) -> None:
    """Show verdicts, sigmas, budget and requirements of a run.

    They, and the consistency of a filter, are read from the run folder's summary; nothing is simulated.

    Example: mcnav show reports/mine --table budget --format csv
    """
    from mcnav.workflow.show import show_run

    text, shown = show_run(folder, table, units, form)
    sys.stdout.write(text)
    if shown is not None:
        out.print(shown, soft_wrap=False)
        _print_next(next_command.after_show(folder, table))


@_command()
def export(
    folder: Folder,
    into: Annotated[Path | None, typer.Option("--out", help="Output folder [default: RUN_export].")] = None,
    units: UnitsOption = "shown",
) -> None:
    """Write all tables of a run as CSV, and its matrices.

    The matrices are for numpy and MATLAB.

    Example: mcnav export reports/mine --units SI --out mine_in_si
    """
    from mcnav.workflow.export import default_folder, export_run

    _print_written(export_run(folder, output_folder(into, default_folder(folder)), units))
    _print_next(next_command.written("docs", "howto-export"))


@_command()
def figure(
    folder: Folder,
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A figure of the report, such as scatter or budget.",
            autocompletion=completion.for_words(completion.figures),
        ),
    ],
    into: Annotated[Path, typer.Option("--out", help="File to write, .pdf, .svg or .png; or a folder, for NAME.pdf.")],
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Width and height, such as 88x60mm [default: the page's].")
    ] = None,
    width: Annotated[float | None, typer.Option(min=2.0, max=100.0, help="Width alone, cm.")] = None,
    font_scale: Annotated[float, typer.Option(min=0.2, max=5.0, help="Size of text over the page's.")] = 1.0,
    panel: Annotated[
        list[str] | None, typer.Option(metavar="TITLE", help="Only this panel, such as 'altitude'; repeat.")
    ] = None,
    columns: Annotated[int | None, typer.Option(min=1, max=10, help="Panels side by side.")] = None,
) -> None:
    """Draw a figure of a run's report for a paper.

    Example: mcnav figure reports/mine scatter --size 88x60mm --font-scale 0.8 --out scatter.pdf
    """
    from mcnav.report.figures.paper import read_size
    from mcnav.workflow.figure import ENDINGS, draw_figure

    try:
        wide, high = (width, None) if size is None else read_size(size)
    except ValueError as wrong:
        raise _fail(f"--size: {wrong}") from None
    file = output_file(into, f"{name}.pdf", ENDINGS)
    _print_notes(draw_figure(folder, name, file, wide, high, font_scale, panel or (), columns))
    _print_written([file])
    _print_next(next_command.written("export", folder))


@_command()
def brief(
    folder: Folder,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="The run's campaign file; needed for advice on code of your own.")
    ] = None,
    into: Annotated[Path | None, typer.Option("--out", help="Output folder [default: RUN_brief].")] = None,
) -> None:
    """Write a run on one sheet for a review board.

    A page and a PDF: verdicts, requirements with margins, the worst case, its causes, and what would help by linear
    analysis.

    Example: mcnav brief reports/mine
    """
    from mcnav.report import progress
    from mcnav.studies.brief import default_folder, write_brief

    target = output_folder(into, default_folder(folder))
    with progress.shown(err) as shown:
        written = write_brief(folder, target, campaign, shown)
    _print_written(written)
    _print_next(next_command.written("report", folder, "--open"))


@_command()
def compare(
    folders: Folders,
    html: Annotated[
        Path | None, typer.Option("--out", "--html", help="Also write a page: a folder, or a file ending in .html.")
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Compare runs: inputs, sigmas, verdicts, error budgets.

    With several runs, show the inputs that differ and the change of each output from the first run, with intervals.
    Runs with the same seed, design and sources are compared on common draws.

    Example: mcnav compare reports/11_cruise reports/other --out reports
    """
    from mcnav.analysis.summary import Summary
    from mcnav.errors import reading_file
    from mcnav.files import write_whole
    from mcnav.report import comparison, export, terminal
    from mcnav.report.output_columns import output_rows
    from mcnav.report.show import escaped
    from mcnav.report.terminal_parts import printed
    from mcnav.workflow.compare import compare_runs, compared_summary, page_name

    page = None if html is None else output_file(html, page_name(folders), [".html"])
    runs, verdicts = dict[str, Summary](), []
    for name, summary in {str(folder): compared_summary(folder) for folder in folders}.items():
        with reading_file(Path(name) / "summary.json"):
            runs[name] = shown = Summary.of(escaped(summary))
            terminal.comparison({name: shown})
            verdicts.append((f"\n{name}: {shown.campaign}", terminal.verdict(shown)))
    several = len(folders) > 1
    result = compare_runs(folders) if several or page is not None else None
    console = out if form == "table" else err
    if (warning := terminal.warnings(runs)) is not None:
        console.print(warning)
    if form != "table":
        rows = output_rows(runs)
        tables: dict[str, Any] = {"runs": export.run_rows(runs), "outputs": rows}
        if result is not None and several:
            tables["outputs"] = rows = export.with_changes(rows, list(runs), result.rows)
            changed = result.inputs.set_axis(list(runs), axis="columns")
            tables["inputs"] = [{"key": key, **dict(values)} for key, values in changed.iterrows()]
        _export(form, rows, tables)
    else:
        console.print(terminal.comparison(runs))
        for heading, verdict in verdicts:
            console.print(heading, markup=False, style="bold")
            console.print(verdict, soft_wrap=False)
        if result is not None:
            console.print()
            parts = comparison.terminal(result.titles, result.manifests, result.rows, result.confidence)
            console.print(printed(parts))
    if page is not None and result is not None:
        page.parent.mkdir(parents=True, exist_ok=True)
        write_whole(page, result.page.encode())
        console.print(f"\nwritten: {page}", markup=False)
    if form == "table":
        _print_next(next_command.after_comparison(folders, page))


@_command()
def replay(
    folder: Folder,
    index: Annotated[int | None, typer.Argument(metavar="INDEX", min=0, help="Sample index.")] = None,
    fail: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="In place of a sample, the most likely way to fail requirement N, at its limit."
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            help="Campaign file of the run; needed for a scenario in your own code.",
            autocompletion=completion.campaigns,
        ),
    ] = None,
    into: Annotated[Path | None, typer.Option("--out", help="Output folder [default: the run folder].")] = None,
) -> None:
    """Simulate one sample of a run again, with its history.

    Its errors, its outcome and its history are written as a page and a CSV file. With --fail it is no sample, but the
    flight by which a requirement beyond counting fails most likely.

    Exit status: 0 the outcome is as stored, 1 it is different, 2 bad input.

    Example: mcnav replay reports/11_cruise 12
    """
    from mcnav.report.replay import terminal
    from mcnav.report.terminal_parts import printed
    from mcnav.workflow import replay as replaying

    if (index is None) == (fail is None):
        raise _fail("mcnav replay needs the index of a sample or --fail with the number of a requirement, one of them")
    if fail is None:
        result = replaying.replay(folder, index or 0, campaign)
    else:
        result = replaying.replay_failure(folder, fail, campaign)
    _print_notes(result.notes)
    out.print(printed(terminal(result)))
    out.print()
    _print_written(replaying.write_replay(result, output_folder(into, folder)))
    _print_next(next_command.written("show", folder))
    if not replaying.as_stored(result):
        raise _fail(f"the outcome of sample {index} differs from the stored one", CHECK_FAILED)


@_command()
def index(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder that contains run folders.")] = Path(
        "reports"
    ),
) -> None:
    """List all runs of a folder and below it on a page.

    The page is index.html in that folder.

    Example: mcnav index reports
    """
    from mcnav.workflow.index import write_index

    written, count, latest = write_index(folder)
    _print(f"{count} runs\n\nwritten: {written}")
    _print_next(next_command.after_index(latest))


@_command()
def partials(
    campaign: CampaignFile,
    method: Annotated[
        Literal["all", "variational", "differences", "runs"], typer.Option(help="Method used to compute P.")
    ] = "all",
    start_times: Annotated[
        bool, typer.Option("--start-times", help="Compute P for all start times of the flight, as a table and curves.")
    ] = False,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: OutFolder = None,
    form: FormatOption = "table",
) -> None:
    """Show the partial derivatives P of the final errors.

    They are computed by three methods, whose differences are shown. With --start-times, write P and the linear
    dispersion as functions of the start of navigation.

    Example: mcnav partials campaigns/11_cruise.toml --method variational
    """
    from mcnav.config.read import read_campaign
    from mcnav.lincov.partials import compare_partials
    from mcnav.report import export, terminal

    if start_times:
        if form != "table":
            raise _fail("--format: cannot be used with --start-times, which writes CSV; omit one")
        _start_times(campaign, folder, axes, count, checks=False)
        return
    scenario = read_campaign(campaign).scenario
    methods = ["variational", "differences", "runs"] if method == "all" else [method]
    matrix, differences = compare_partials(scenario, methods)
    if form != "table":
        rows = export.partial_rows(scenario.sources, scenario.outputs, matrix)
        shares = [
            {"method": name, "output": output.name, "largest_difference": float(values[i])}
            for name, values in differences.items()
            for i, output in enumerate(scenario.outputs)
        ]
        _export(form, rows, {"method": methods[0], "partials": rows, "differences": shares})
    else:
        out.print(terminal.partials(scenario.sources, scenario.outputs, matrix))
    if differences:
        console = out if form == "table" else err
        console.print()
        console.print(terminal.agreement(scenario.outputs, differences))
    if form == "table":
        _print_next(next_command.written("lincov", campaign))


@_command("start-times")
def start_times(
    campaign: CampaignFile,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: OutFolder = None,
) -> None:
    """Find the best start of navigation.

    It shows linear dispersion by start time, with Monte Carlo checks. The campaign's optional table [start_times]
    sets errors that vary with the start time, weights of the outputs, and the start times to check.

    Example: mcnav start-times campaigns/09_start_times.toml
    """
    _start_times(campaign, folder, axes, count, checks=True)


def _start_times(campaign: Path, folder: Path | None, axes: Axes | None, count: int | None, checks: bool) -> None:
    from mcnav.config.read import read_campaign
    from mcnav.report import progress, terminal
    from mcnav.studies.start_times import write_start_times

    content = read_campaign(campaign)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_start_times")
    with progress.shown(err) as shown:
        times, files = write_start_times(content, target, axes, count, checks, shown)
    out.print(terminal.best_starts(times.study, times.checks, times.own_sigma, content.scenario.outputs))
    out.print()
    _print_written(files)
    _print_next(next_command.written("lincov", campaign))


@_command()
def linearity(
    campaign: CampaignFile,
    tolerance: Annotated[
        float | None, typer.Option(min=1e-4, max=1.0, help="Allowed relative difference [default: the campaign's].")
    ] = None,
    samples: Annotated[int, typer.Option(min=200, max=1_000_000, help="Samples at each multiple.")] = 2_000,
    largest: Annotated[float, typer.Option(min=0.2, max=1_000.0, help="Largest multiple of all errors.")] = 50.0,
    folder: OutFolder = None,
) -> None:
    """Find the size of errors at which linear analysis fails.

    It is a multiple of the campaign's errors, for each source alone and for all together.

    Example: mcnav linearity campaigns/14_polar.toml --samples 500
    """
    from mcnav.config.read import read_campaign
    from mcnav.report import progress
    from mcnav.report.linearity import remarks, terminal
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.linearity import write_linearity

    content = read_campaign(campaign)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_linearity")
    with progress.shown(err) as shown:
        study, files = write_linearity(content, target, tolerance, samples, largest, shown)
    out.print(printed(terminal(content.scenario.outputs, study.together, study.tolerance)))
    for sentence in remarks(content.scenario.outputs, study.noise, study.sizes_alone):
        out.print(sentence)
    out.print()
    _print_written(files)
    _print_next(next_command.written("run", campaign))


@_command()
def lincov(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_lincov].")] = None,
    at: Annotated[
        str | None, typer.Option(metavar="TIMES", help="Times of the trajectory, such as '600 s, 1500 s'.")
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Compute the linear covariance, its causes, and requirements.

    They are of the end and over time; nothing is simulated. With aiding, it is that of the closed loop: true sigmas
    and those that the filter states, twice where an update falls on a time.

    Example: mcnav lincov campaigns/19_flight_with_gnss.toml --at "1800 s"
    """
    from mcnav.config.read import read_campaign
    from mcnav.report.lincov import exported
    from mcnav.report.lincov_page import terminal
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.lincov import read_times, write_lincov

    times = None if at is None else read_times(at)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_lincov")
    result, files = write_lincov(read_campaign(campaign), target, times)
    if form != "table":
        tables = exported(result)
        _export(form, tables["sigmas"], tables)
        return
    out.print(printed(terminal(result)))
    out.print()
    _print_written(files)
    _print_next(next_command.after_lincov(campaign, result))


@_command()
def live(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Folder of runs [default: reports/NAME_live].")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page [default: a free one].")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel jobs of a run.")] = 2,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Show a campaign on a page that answers while it is changed.

    The page is that of mcnav lincov. It follows the campaign's file, tunes the filter anew for what its sliders say,
    keeps the last settings side by side, and confirms them by Monte Carlo. Its server listens on this machine alone, at
    an address that nobody guesses. Ctrl-C ends it.

    Example: mcnav live campaigns/19_flight_with_gnss.toml --open
    """
    from mcnav._interrupts import until_interrupted
    from mcnav.studies.live import LiveCampaign
    from mcnav.studies.live_server import LiveServer, answer_requests

    target = output_folder(folder, Path("reports") / f"{campaign.stem}_live")
    with LiveServer(port) as server, until_interrupted():
        content = LiveCampaign(campaign, target, jobs)
        _print(f"page: {server.address}\nCtrl-C ends it")
        if show:
            _open_address(server.address, "address")
        answer_requests(content, server)
    _print_next(next_command.written("run", campaign))


@_command()
def record(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_record].")] = None,
    sample: Annotated[int, typer.Option(help="Number of the sample.")] = 0,
    rate: Annotated[float, typer.Option(min=1.0, max=1000.0, help="Readings per second.")] = 50.0,
) -> None:
    """Write what the instruments of one sample read, as a flight.

    The files of instruments and sensors are like those of a recorded flight.

    Example: mcnav record flight.toml --sample 3 --out log
    """
    from mcnav.config.read import read_campaign
    from mcnav.studies.recordings import write_recording

    target = output_folder(folder, Path("reports") / f"{campaign.stem}_record")
    files = write_recording(read_campaign(campaign), sample, 1.0 / rate, target)
    _print_written(files)
    _print_next(next_command.after_recording(campaign, files))


@_command()
def judge(
    campaign: Annotated[
        Path | None,
        typer.Argument(metavar="[CAMPAIGN]", help="Campaign file (TOML).", autocompletion=completion.campaigns),
    ] = None,
    imu: Annotated[Path | None, typer.Option(metavar="FILE", help="Recorded gyros and accelerometers.")] = None,
    measurements: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FILE",
            help="Measurements of a sensor, such as gnss=gnss.pos; repeat [default: the campaign's logs].",
        ),
    ] = None,
    reference: Annotated[Path | None, typer.Option(metavar="FILE", help="Track to compare with.")] = None,
    start: Annotated[
        Path | None, typer.Option(metavar="FILE", help="State at the start [default: that of the trajectory].")
    ] = None,
    errors: Annotated[
        Path | None, typer.Option(metavar="TABLE", help="Errors and sigmas of any filter, in place of a campaign.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option("--column", metavar="NAME=COLUMN", help="Column of the readings, such as gyro_x=wx; repeat."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option("--unit", metavar="NAME=UNIT", help="Unit of the readings, such as gyro=deg/s; repeat."),
    ] = None,
    records: Annotated[int, typer.Option(min=200, max=100_000, help="Simulated records to compare with.")] = 1000,
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_judge].")] = None,
) -> None:
    """Judge the filter of a campaign by a recorded flight.

    It says which number is wrong, by how much, and what the record could have shown.

    Example: mcnav judge flight.toml --imu imu.csv --measurements gnss=gnss.csv --reference truth.csv
    """
    from mcnav.report import judged, judged_errors
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.judge import write_error_judgement, write_judgement
    from mcnav.studies.recordings import RecordingFiles

    if errors is not None:
        if campaign is not None or imu is not None:
            raise _fail("--errors: is judged alone, without a campaign; leave one of them out", BAD_INPUT)
        target = output_folder(folder, Path("reports") / f"{errors.stem}_judge")
        verdicts, files = write_error_judgement(errors, target)
        out.print(printed(judged_errors.terminal(verdicts)))
    else:
        if campaign is None or imu is None:
            raise _fail("expected CAMPAIGN and --imu FILE, or --errors TABLE", BAD_INPUT)
        from mcnav.config.read import read_campaign

        given = {name: Path(file) for name, file in _pairs(measurements, "measurements", "gnss=gnss.pos").items()}
        columns, units = _pairs(column, "column", "gyro_x=wx"), _pairs(unit, "unit", "gyro=deg/s")
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_judge")
        described = RecordingFiles(imu, given, reference, start, columns, units)
        judgement, files = write_judgement(read_campaign(campaign), described, target, records)
        out.print(printed(judged.terminal(judgement)))
    out.print()
    _print_written(files)
    _print_next(next_command.after_judgement(campaign))


def _pairs(given: Sequence[str] | None, option: str, example: str) -> dict[str, str]:
    """Read options of the form NAME=VALUE."""
    pairs = dict[str, str]()
    for each in given or []:
        name, equals, value = each.partition("=")
        if not equals or not value:
            raise _fail(f"--{option}: got {each!r}; expected NAME=VALUE such as {example}", BAD_INPUT)
        pairs[name.strip()] = value.strip()
    return pairs


@_command()
def allocate(
    campaign: CampaignFile,
    folder: Annotated[
        Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_allocate].")
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Find the data-sheet numbers that just meet requirements.

    It uses linear analysis. Each number is changed alone, all are changed together, and for type ins numbers are
    moved by one grade of the catalogue. Where the requirements are met, numbers are loosened.

    Example: mcnav allocate campaigns/19_flight_with_gnss.toml
    """
    from mcnav.report import allocate as tables
    from mcnav.report import progress
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.allocate import write_allocation

    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_allocate")
        result, files = write_allocation(campaign, target, shown)
    if form != "table":
        _export(form, [vars(row) for row in tables.change_rows(result)], tables.table(result))
        return
    out.print(printed(tables.terminal(result)))
    out.print()
    _print_written(files)
    _print_next(next_command.after_allocation(campaign, result))


@_command(resumes=True)
def sweep(
    campaign: CampaignFile,
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=VALUES",
            help="""A key and its values, such as imu.gyro.bias="0.001..1 deg/h".""",
            autocompletion=completion.for_words(completion.keys),
        ),
    ],
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MEASURE",
            help="What is looked at, such as position_horizontal [default: requirements].",
            autocompletion=completion.for_words(completion.outputs),
        ),
    ] = None,
    points: Annotated[int, typer.Option(min=2, help="Values of each range.")] = 20,
    confirm: Annotated[
        int | None, typer.Option(metavar="N", help="Run Monte Carlo at so many points, corners first.")
    ] = None,
    at: Annotated[
        str | None, typer.Option("--at", "--epoch", metavar="TIMES", help="Times of the trajectory [default: the end].")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel jobs.")] = 2,
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_sweep].")] = None,
    form: FormatOption = "table",
) -> None:
    """Vary one or two keys of a campaign by linear analysis.

    It finds the values at which requirements are just met. VALUES is a range ("0.001..1 deg/h", logarithmic from a
    decade on) or a list ("1, 2, 5 deg/h"). A MEASURE is an output, position_horizontal, velocity_horizontal, or drms,
    cep, r95, sep of outputs; a limit may follow.

    Example: mcnav sweep campaigns/19_flight_with_gnss.toml --vary imu.gyro.bias="0.001..1 deg/h"
    --against "position_horizontal < 20 m"
    """
    from mcnav.config.sweep_values import split_varied
    from mcnav.report import progress
    from mcnav.report import sweep as tables
    from mcnav.report.sweep_page import terminal
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.lincov import read_times
    from mcnav.studies.sweep import SweepPlan, write_sweep

    times = () if at is None else tuple(read_times(at).tolist())
    plan = SweepPlan(split_varied(vary), against or (), points, times, jobs)
    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_sweep")
        result, files = write_sweep(campaign, plan, target, confirm, shown)
    if form != "table":
        _export(form, tables.frame(result).to_dict("records"), {"sweep": tables.table(result)})
        return
    out.print(printed(terminal(result)))
    out.print()
    _print_written(files)
    _print_next(next_command.after_sweep(campaign, target, vary, against or (), confirm))


@_command("filters", resumes=True)
def filters(
    campaign: CampaignFile,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND",
            help="ekf, iterated, left-invariant, right-invariant or ukf; repeat [default: all].",
            autocompletion=completion.filter_kinds,
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES",
            help="""A key and its values, such as errors.heading="1, 10, 30 deg".""",
            autocompletion=completion.for_words(completion.keys),
        ),
    ] = None,
    samples: Annotated[int | None, typer.Option(min=1, help="Of each run [default: the campaign's].")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel jobs.")] = 2,
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_filters].")] = None,
    form: FormatOption = "table",
) -> None:
    """Compare kinds of filters by Monte Carlo.

    Each kind has the same samples and noise, by the reference engine; the verdict on each, its NEES, sigmas and cost
    are a table. With --vary it is asked from which value on each is optimistic.

    Example: mcnav filters campaigns/32_alignment_in_motion.toml --vary errors.heading="3, 10, 30 deg"
    """
    from mcnav.config.sweep_values import split_varied
    from mcnav.report import filter_kinds as tables
    from mcnav.report import progress
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.compare_filters import FilterPlan, compare_filters

    plan = FilterPlan(kind or (), split_varied(vary or ()), samples, jobs)
    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_filters")
        result, files = compare_filters(campaign, plan, target, shown)
    if form != "table":
        _export(form, tables.frame(result).to_dict("records"), {"filters": tables.table(result)})
        return
    out.print(printed(tables.terminal(result)))
    out.print()
    _print_written(files)
    _print_next(next_command.written("show", target / result.results[-1].folder))


@_command("check")
def check_file(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Campaign (.toml), code of scenarios (.py), or trajectory (.csv, .parquet, .pos, …).",
            autocompletion=completion.checkable,
        ),
    ],
    column: NamedColumns = None,
) -> None:
    """Check a campaign, the code of a scenario, or a trajectory.

    Of campaigns and scenarios it checks determinism, shapes, units, linearity near zero, and partials against
    differences; of a trajectory whether it can be flown, and its heading against its track. Nothing is written.

    Exit status: 0 all checks passed, 1 a check failed, 2 bad input.

    Example: mcnav check campaigns/14_polar.toml
    """
    from mcnav.report import terminal
    from mcnav.workflow.check import check_any

    checked = check_any(file, _named_columns(column))
    for place, each in enumerate(checked):
        if place:
            out.print()
        out.print(terminal.checks(each.title, [(check.name, check.passed, check.told) for check in each.checks]))
    passed = all(check.passed for each in checked for check in each.checks)
    _print_next(next_command.after_check(file, checked[0].campaign, passed))
    if not passed:
        raise typer.Exit(CHECK_FAILED)


def _named_columns(
    named: Sequence[str] | None, option: str = "--column", expected: str = "NAME=COLUMN such as 'lat=latitude [rad]'"
) -> dict[str, str]:
    columns = dict[str, str]()
    for each in named or []:
        name, equals, written = each.partition("=")
        if not equals:
            raise _fail(f"{option}: got {each!r}; expected {expected}", BAD_INPUT)
        columns[name.strip()] = written.strip()
    return columns


@_command()
def trajectory(
    campaign: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Trajectory file or track (CSV, parquet, .pos, …), or a campaign of type ins (TOML).",
            autocompletion=completion.campaigns_and_trajectories,
        ),
    ],
    page: Annotated[
        Path | None, typer.Option("--out", help="Also write a page: a folder, or a file ending in .html.")
    ] = None,
    column: NamedColumns = None,
    form: FormatOption = "table",
) -> None:
    """Describe a trajectory: rows, ranges, forces, turn rates.

    It also shows how well velocities agree with positions.

    Example: mcnav trajectory campaigns/flight.csv --out flight.html
    """
    from mcnav.files import write_texts
    from mcnav.report import trajectory as described
    from mcnav.report.html import page_html
    from mcnav.report.terminal_parts import printed
    from mcnav.workflow.trajectory import describe_campaign, describe_file

    columns = _named_columns(column)
    if campaign.suffix == ".toml" and columns:
        raise _fail("--column: belongs to a trajectory file; the campaign names its columns itself", BAD_INPUT)
    result = describe_campaign(campaign) if campaign.suffix == ".toml" else describe_file(campaign, columns)
    if form != "table":
        rows = [vars(row) for row in described.fact_rows(result)]
        _export(form, rows, {"trajectory": rows})
    else:
        out.print(printed(described.terminal(result)))
    if page is not None:
        file = output_file(page, f"{campaign.stem}_trajectory.html", [".html"])
        _print_written(write_texts(file.parent, {file.name: page_html(described.page(result))}))
    if form == "table":
        _print_next(next_command.after_trajectory(campaign))


@_command()
def identify(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="Records of a unit at rest.", autocompletion=completion.logs),
    ],
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column", "--columns", metavar="NAME=COLUMN", help="Column of a log, such as gyro_x=wx; repeat."
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option("--unit", "--units", metavar="NAME=UNIT", help="Unit of a column, such as gyro=deg/s; repeat."),
    ] = None,
    interval: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Interval between readings, such as '0.01 s', in place of a column of time."),
    ] = None,
    begin: Annotated[
        str | None, typer.Option("--from", metavar="TIME", help="Begin of what is used, from the first reading.")
    ] = None,
    end: Annotated[
        str | None, typer.Option("--to", metavar="TIME", help="End of what is used, from the first reading.")
    ] = None,
    below: Annotated[
        str | None,
        typer.Option(metavar="FREQUENCY", help="Upper end of the frequencies that are used, such as '10 Hz'."),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            help="Campaign of type ins whose errors are computed with the result.", autocompletion=completion.campaigns
        ),
    ] = None,
    folder: Annotated[
        Path | None, typer.Option("--out", help="Also write a page, identify.json and imu.toml into a folder.")
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Identify the noise of an inertial unit from logs at rest.

    Every value has an interval, and the model a test of fit. Several logs of one unit give its noise in common, and
    the bias from one turn-on to the next.

    Example: mcnav identify static.csv --unit gyro=deg/s --out reports/unit
    """
    from mcnav.files import write_texts
    from mcnav.report.identify import terminal
    from mcnav.report.terminal_parts import printed
    from mcnav.studies.identify import files_of, identification_table, identify_logs, read_plan

    columns = _named_columns(column, "--column", "NAME=COLUMN such as gyro_x=wx")
    units = _named_columns(unit, "--unit", "NAME=UNIT such as gyro=deg/s")
    report = identify_logs(logs, read_plan(columns, units, interval, begin, end, below, campaign))
    if form == "table":
        out.print(printed(terminal(report)))
    else:
        _export(form, [vars(row) for row in report.parameters], identification_table(report))
    if folder is not None:
        out.print()
        _print_written(write_texts(output_folder(folder, folder), files_of(report)))
    if form == "table":
        _print_next(next_command.after_identification(logs, folder, campaign))


@_command()
def imu(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="A grade or unit, such as navigation or STIM300 [default: all].",
            autocompletion=completion.units,
        ),
    ] = None,
    form: FormatOption = "table",
) -> None:
    """List the catalogue of inertial measurement units.

    With NAME, list the values of one with their sources. A campaign takes one with grade = "NAME" in [imu].

    Example: mcnav imu navigation
    """
    from mcnav.errors import suggestion
    from mcnav.report import instruments
    from mcnav.report.terminal_parts import fitted
    from mcnav.systems.ins.tables.imu_catalogue import catalogue_units

    units = {unit.name: unit for unit in catalogue_units()}
    if name is not None and name not in units:
        raise _fail(f"NAME: no grade or unit {name!r}{suggestion(name, list(units))}", BAD_INPUT)
    values = [
        instruments.value_row(unit.name, value.instrument, value.key, value.text, value.unit, value.source)
        for unit in (units.values() if name is None else [units[name]])
        for value in unit.values
    ]
    if form != "table":
        rows = [vars(value) for value in values]
        _export(form, rows, {"values": rows})
    elif name is None:
        out.print(fitted(instruments.catalogue({unit.name: unit.title for unit in units.values()}, values)))
        _print_next(next_command.written("imu", next(iter(units))))
    else:
        out.print(fitted(instruments.values(units[name].title, values)))
        _print_next(next_command.written("new", "ins", "mine", "--imu", name))


app.add_typer(new, name="new")


@_command("campaign", new)
def new_campaign(
    name: Name,
    kind: Annotated[TemplateType, typer.Option("--type", help="Scenario.")] = "reentry",  # type: ignore[valid-type]
    into: Into = Path(),
) -> None:
    """Write a campaign file, and its schema for editors.

    Example: mcnav new campaign mine --type cruise
    """
    from mcnav.config.json_schema.files import write_schema
    from mcnav.config.templates import new_campaign

    (written,) = new_campaign(name, into, kind)
    _print_written((written, *write_schema(written.parent)))
    _print_next(next_command.written("run", written))


@_command("ins", new)
def new_ins(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name or path of the file; .toml may be left out.")],
    unit: Annotated[
        str,
        typer.Option(
            "--imu",
            metavar="UNIT",
            help="Grade or unit of the catalogue; mcnav imu lists them.",
            autocompletion=completion.units,
        ),
    ] = "navigation",
    trajectory: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Trajectory in the campaign's folder or below it [default: some segments].",
            autocompletion=completion.trajectories,
        ),
    ] = None,
    aid: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TYPE",
            help="Type of a sensor that aids the navigation, such as gnss; repeat.",
            autocompletion=completion.aids,
        ),
    ] = None,
    platform: Annotated[Platform, typer.Option(help="Carrier of the instruments.")] = "strapdown",
    column: NamedColumns = None,
    into: Into = Path(),
) -> None:
    """Write a campaign of an inertial navigation, with comments.

    It is in three dimensions; the schema for editors stands beside it. --aid repeats; --trajectory FILE takes a
    flight of your own.

    Example: mcnav new ins mine --imu tactical --aid gnss --aid altimeter
    """
    from mcnav.config.json_schema.files import write_schema
    from mcnav.config.templates.ins import NewIns, new_ins

    wanted = NewIns(unit, tuple(aid or ()), platform, trajectory, _named_columns(column))
    (written,) = new_ins(name, into, wanted)
    _print_written((written, *write_schema(written.parent)))
    _print_next(next_command.written("run", written))


@_command("scenario", new)
def new_scenario(
    name: Name,
    stochastic: Annotated[bool, typer.Option("--stochastic", help="With noise and errors over time.")] = False,
    closed_loop: Annotated[
        bool, typer.Option("--closed-loop", help="A vehicle that is steered by what it navigates.")
    ] = False,
    into: Into = Path(),
) -> None:
    """Write a scenario class, a campaign that uses it, its test.

    Example: mcnav new scenario my_system
    """
    from mcnav.config.json_schema.files import write_schema
    from mcnav.config.templates import new_scenario

    code, campaign, test = new_scenario(name, into, stochastic, closed_loop)
    method = "rates and guide" if closed_loop else "fly" if stochastic else "propagate"
    _print_written((code, campaign, test, *write_schema(code.parent)))
    _print_next(f"{next_command.written('run', campaign)}, then change {method} in {code}")


@_command()
def schema(
    into: Annotated[
        Path | None, typer.Option("--out", help="Write it into a folder, or a file ending in .json.")
    ] = None,
) -> None:
    """Print the JSON schema of campaign files, for editors.

    Editors complete, describe and check campaigns by it. A campaign names it in its first line: #:schema
    ./mcnav.schema.json

    Example: mcnav schema --out mcnav.schema.json
    """
    from mcnav.config.json_schema.files import SCHEMA_FILE, schema_text
    from mcnav.files import write_texts

    if into is None:
        sys.stdout.write(schema_text())
    else:
        file = output_file(into, SCHEMA_FILE, [".json"])
        _print_written(write_texts(file.parent, {file.name: schema_text()}))
        _print_next(next_command.written("docs", "campaigns"))


@_command("compile")
def compile_all(
    into: Annotated[
        Path | None,
        typer.Option("--out", "--into", metavar="FOLDER", help="Write objects there, which a wheel may hold."),
    ] = None,
    level: Annotated[
        Literal["x86-64-v3", "x86-64-v4"] | None,
        typer.Option(help="Processor that objects are for [default: the highest level of this one]."),
    ] = None,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="An example in place of all; repeat.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel processes.")] = 2,
) -> None:
    """Compile all kernels beforehand, for images and clusters.

    No later command compiles then. Every example is run with a few samples, by each engine. A line says what is done.

    Example: mcnav compile
    """
    if level is not None and into is None:
        raise _fail("--level: is for objects; give --out FOLDER")
    if into is not None:
        from mcnav.compiled.target import choose_objects

        try:
            choose_objects(into, level)
        except ValueError as wrong:
            raise _fail(f"--level: {wrong}") from None
    from mcnav.entries.examples import example
    from mcnav.studies.precompile import compile_kernels

    names = [example(name).stem for name in only or ()]
    count = compile_kernels(names, jobs, lambda line: err.print(line, highlight=False, soft_wrap=True))
    out.print(f"{count} functions compiled, all others were stored")
    _print_next(next_command.written("demo"))


@app.command(cls=_Command)
def docs(page: Annotated[Page, typer.Argument(metavar="PAGE", help="Page to show.")] = "guide") -> None:
    """Show a page of the documentation.

    Example: mcnav docs campaigns
    """
    text = page_text(page)
    if out.is_terminal:
        from rich.markdown import Markdown

        with out.pager(styles=True):
            out.print(Markdown(text))
    else:
        _print(text)


@_command()
def reproduce(
    document: Annotated[
        Literal["tn-d1772", "story-of-84-minutes", "textbook", "ukfm"],
        typer.Argument(
            metavar="DOCUMENT",
            help="tn-d1772 (NASA TN D-1772), story-of-84-minutes, textbook (closed forms), or ukfm (five filters).",
        ),
    ],
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/DOCUMENT].")] = None,
    samples: Annotated[
        int | None, typer.Option(min=2, help="Runs of each filter, of ukfm alone [default: 10000].")
    ] = None,
) -> None:
    """Recompute the numbers and figures of a publication.

    They are written as a page and CSV files.

    Example: mcnav reproduce textbook --out recomputed
    """
    from collections import Counter

    from mcnav.validation.reproduce.story_of_84_minutes import page as story_page
    from mcnav.validation.reproduce.textbook import page as textbook_page
    from mcnav.validation.reproduce.tn_d1772 import page
    from mcnav.validation.reproduce.ukfm import page as ukfm_page

    if samples is not None and document != "ukfm":
        raise _fail(f"--samples is for ukfm alone; {document} has samples of its own")
    target = output_folder(folder, Path("reports") / document)
    following = next_command.written("docs", "story" if document == "story-of-84-minutes" else document)
    if document == "story-of-84-minutes":
        _print_written(story_page.write(target))
        _print_next(following)
        return
    if document == "textbook":
        numbers, written = textbook_page.write(target)
        out.print(f"{len(numbers)} published numbers")
        for agreement, count in Counter(number.agreement for number in numbers).most_common():
            out.print(f"{count:6} {textbook_page.PHRASES[agreement]}")
        _print_written(written)
        _print_next(following)
        return
    if document == "ukfm":
        summary, written = ukfm_page.write(target, samples)
        out.print(summary)
        _print_written(written)
        _print_next(following)
        return
    cells, files = page.write_reproduction(target)
    out.print(f"{len(cells)} printed numbers")
    for mark, count in Counter(cell.mark for cell in cells).most_common():
        out.print(f"{count:6} {page.PHRASES[mark]}")
    _print(f"\nwritten: {files[0]}\nand {len(files) - 1} tables in the same folder")
    _print_next(following)


@_command()
def calibrate(
    trials: Annotated[int, typer.Option(min=2, help="Synthetic campaigns of each kind.")] = 100,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel processes.")] = 2,
    folder: Annotated[Path, typer.Option("--out", help="Output folder.")] = Path("reports/calibration"),
    rare: Annotated[
        bool,
        typer.Option("--rare", help="Measure rare events alone; other rates are those of the CSV file there."),
    ] = False,
) -> None:
    """Measure error rates of intervals, tests and verdicts.

    Coverage, false alarms and power are written as a page and a CSV file. The campaigns are synthetic and their
    moments known. Every measured rate has its binomial interval.

    Example: mcnav calibrate --trials 100
    """
    from mcnav.validation.calibration import page

    into = output_folder(folder, folder)
    if rare and not (into / page.CSV).is_file():
        raise _fail(f"{into / page.CSV}: no such file; --rare needs the other rates, which mcnav calibrate measures")
    table, files = page.write_calibration(into, trials, jobs, rare)
    for finding, count in table[table["finding"] != ""]["finding"].value_counts().items():
        out.print(f"{count:6} rates {finding}")
    out.print()
    _print_written(files)
    _print_next(next_command.written("docs", "method"))


def _prepare_process() -> None:
    """Prepare a process that runs one command, before numerical libraries are loaded.

    Their sums use one thread; idle threads of their pools would use processor time. A command ends before collecting
    its many lasting objects would free memory; at its end they are frozen, because the interpreter would look through
    all of them once more, which took a fifth of a second.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    gc.set_threshold(GARBAGE_THRESHOLD, 50, 50)
    atexit.register(gc.freeze)


def _with_the_command(name: str) -> typer.Typer:
    """Return the command line with this one of its commands: building all of them takes as long as showing a run.

    It is whole where no command has that name.
    """
    named = [
        each
        for each in app.registered_commands
        if name == (each.name or get_command_name(getattr(each.callback, "__name__", "")))
    ]
    if not named:
        return app
    alone = copy(app)
    alone.registered_commands = named
    return alone


def main() -> None:
    """Run the command line."""
    _prepare_process()
    with interruptible():
        _with_the_command("".join(sys.argv[1:2]))(prog_name="mcnav")
