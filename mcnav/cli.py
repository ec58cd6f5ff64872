"""Command line: parse options, run a use case of `mcnav.workflow` or `mcnav.studies`, print the results."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from mcnav.report.fitted_table import OpenConsole

CHECK_FAILED, BAD_INPUT, SOME_FAILED, BUSY, INTERRUPTED, TERMINATED = 1, 2, 3, 4, 130, 143
"""Exit statuses; 0 is success."""

GARBAGE_THRESHOLD = 50_000
"""New objects after which Python looks for cycles to free."""

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None, add_completion=True)
out, err = OpenConsole(highlight=False, soft_wrap=True), OpenConsole(stderr=True, highlight=False, soft_wrap=True)


class Method(StrEnum):
    """Method used to compute partial derivatives."""

    ALL = "all"
    VARIATIONAL = "variational"
    DIFFERENCES = "differences"
    RUNS = "runs"


class Store(StrEnum):
    """Results that a run stores."""

    SAMPLES = "samples"
    SUMMARY = "summary"


class Format(StrEnum):
    """Format of printed results."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"


class Axes(StrEnum):
    """Point at which the reference axes are aligned."""

    START = "start"
    TRAJECTORY = "trajectory"


CampaignFile = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file (TOML).")]
Folders = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")]
FormatOption = Annotated[
    Format, typer.Option("--format", help="Print a table, or only CSV or JSON in full precision on stdout.")
]
Count = Annotated[int | None, typer.Option("--count", min=2, max=100_000, help="Number of start times [default: 241].")]
OutFolder = Annotated[
    Path | None, typer.Option("--out", help="Output folder [default: reports/NAME_start_times or NAME_linearity].")
]
ChosenAxes = Annotated[Axes | None, typer.Option(help="Where the reference axes are aligned [default: start].")]

_signals: list[int] = []
"""Signals received that end the command."""


def _end(number: int, frame: object) -> None:
    """Interrupt the command; exit at once on a second signal, as files are written whole and workers end with it."""
    _signals.append(number)
    if len(_signals) > 1:
        os._exit(_signal_status())
    raise KeyboardInterrupt


def _signal_status() -> int:
    return TERMINATED if _signals[:1] == [signal.SIGTERM] else INTERRUPTED


def _fail(message: str, status: int) -> typer.Exit:
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False, soft_wrap=True)
    return typer.Exit(status)


@contextmanager
def _reported_errors(file: Path | None = None) -> Iterator[None]:
    """Turn errors that the user can fix into messages and an exit status; scenario errors name the campaign file."""
    from mcnav.errors import CampaignError, ClusterError, Problem, RunFolderBusy, RunFolderError, TooManyFailures
    from mcnav.lincov.partials import SimulationFailed
    from mcnav.scenarios.protocol import ScenarioError

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    resumes = "stored samples are kept, and the same command{} resumes the run"
    try:
        yield
    except RunFolderBusy as problem:
        raise _fail(str(problem), BUSY) from None
    except TooManyFailures as problem:
        raise _fail(f"{problem}; {resumes.format(' without --max-failures')}", SOME_FAILED) from None
    except MemoryError:
        place = f"{file}: " if file else ""
        raise _fail(f"{place}not enough memory; {resumes.format('')} (fewer --jobs need less)", BAD_INPUT) from None
    except ScenarioError as problem:
        raise _fail(str(Problem(str(file or ""), f"scenario.{problem.key}", str(problem))), BAD_INPUT) from None
    except SimulationFailed as problem:
        raise _fail(str(Problem(str(file or ""), "scenario", str(problem))), BAD_INPUT) from None
    except (CampaignError, ClusterError, RunFolderError) as problem:
        raise _fail(str(problem), BAD_INPUT) from None
    except OSError as problem:
        raise _fail(f"{problem.filename or 'a file'}: {problem.strerror or problem}", BAD_INPUT) from None
    except KeyboardInterrupt:
        raise _fail(f"interrupted; {resumes.format('')}", _signal_status()) from None


def _export(chosen: Format, rows: Sequence[Mapping[str, Any]], tables: Mapping[str, Any]) -> None:
    """Print rows as CSV, or tables by name as JSON."""
    from mcnav.report import export

    sys.stdout.write(export.as_csv(rows) if chosen is Format.CSV else export.as_json(tables))


def _print_written(paths: Iterable[Path]) -> None:
    for path in paths:
        out.print(f"written: {path}", markup=False)


def run_folder(campaign: Path) -> Path:
    """Return ``reports/`` with the campaign file's stem; for the copy in a run folder, that folder."""
    if campaign.name == "campaign.toml" and (campaign.parent / "manifest.json").exists():
        return campaign.parent
    return Path("reports") / campaign.stem


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        out.print(f"mcnav {version('mcnav')}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Test the linear covariance analysis of an inertial navigation system by Monte Carlo simulation."""


@app.command()
def run(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder [default: reports/NAME].")] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="Simulation engine: ensemble, reference or map [default: the scenario's first]."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Parallel jobs [default: 2].")] = None,
    dask: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Simulate in N processes of a local dask cluster.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Simulate on a dask cluster, such as tcp://host:8786; see mcnav docs scaling."
        ),
    ] = None,
    samples: Annotated[int | None, typer.Option(min=2, help="Number of samples [default: the file's].")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed [default: the file's].")] = None,
    store: Annotated[
        Store | None, typer.Option(help="Store every sample, or only a summary [default: the file's].")
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
    form: FormatOption = Format.TABLE,
) -> None:
    """Run a campaign: simulate, compare with linear analysis, write the report.

    Exit status: 0 success, 1 a requirement is not met or undecided (with --check), 2 bad input,
    3 some samples failed, 4 folder in use, 130 interrupted.
    """
    with _reported_errors(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.execution.dask_cluster import open_executor
        from mcnav.report import export, progress, requirements, terminal
        from mcnav.workflow.run import engine_of, run_campaign

        options = {"samples": samples, "seed": seed, "sample_timeout": timeout, "store": store.value if store else None}
        content = read_campaign(campaign, {key: value for key, value in options.items() if value is not None})
        if check and not content.requirements:
            raise _fail(f"{campaign}: accept: is missing; --check needs requirements", BAD_INPUT)
        target = folder or run_folder(campaign)
        chosen = engine or engine_of(target, campaign)
        with open_executor(scheduler, dask, jobs) as (executor, workers, notes), progress.shown(err) as shown:
            done = run_campaign(
                content, target, chosen, workers, fresh, shown, max_failures, executor, force, not no_report
            )
        for note in (*notes, *done.notices):
            err.print(f"note: {note}", markup=False)
        summary, runs = done.summary, {content.name: done.summary}
        console = out if form is Format.TABLE else err
        if form is not Format.TABLE:
            rows, asked = export.output_rows(runs), requirements.requirement_rows(summary)
            _export(form, rows, {"runs": export.run_rows(runs), "outputs": rows, "requirements": asked})
        if (warning := terminal.warnings(runs)) is not None:
            console.print(warning)
        if form is Format.TABLE:
            console.print(terminal.comparison(runs))
            console.print()
        console.print(terminal.verdict(summary), soft_wrap=False)
        if summary["requirements"]:
            console.print()
            console.print(terminal.requirements(summary))
        if done.flown < summary["samples"]:
            console.print(f"\n{summary['samples'] - done.flown:,} samples were stored, {done.flown:,} simulated now")
        if no_report:
            console.print(f"\nsummary: {target / 'summary.json'}", markup=False)
        else:
            console.print(f"\nreport: {target / 'report.html'}", markup=False)
        if check and any(entry["finding"] != "met" for entry in summary["requirements"]):
            raise typer.Exit(CHECK_FAILED)
        if summary["failed"]:
            raise typer.Exit(SOME_FAILED)


@app.command()
def report(
    folders: Folders,
    show: Annotated[bool, typer.Option("--open", help="Open the reports in the browser.")] = False,
) -> None:
    """Analyse finished runs again and write their reports."""
    with _reported_errors():
        import webbrowser

        from mcnav.workflow.analyse import report_run

        for folder in folders:
            report_run(folder)
            written = folder / "report.html"
            out.print(f"report: {written}", markup=False, soft_wrap=True)
            if show and not webbrowser.open(written.resolve().as_uri()):
                err.print("note: no browser is found; open the file yourself", markup=False)


@app.command()
def figure(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="A figure of the report, such as scatter or budget.")],
    into: Annotated[Path, typer.Option("--out", help="File to write: .pdf, .svg or .png.")],
    width: Annotated[float | None, typer.Option(min=2.0, max=100.0, help="Width, cm [default: the page's].")] = None,
    font_scale: Annotated[float, typer.Option(min=0.2, max=5.0, help="Size of text over the page's.")] = 1.0,
) -> None:
    """Draw a figure of a run's report by itself, for a paper."""
    with _reported_errors():
        from mcnav.notebook import open_run

        if into.suffix.lower() not in (".pdf", ".svg", ".png"):
            raise _fail(f"{into}: must end in .pdf, .svg or .png", BAD_INPUT)
        figures = open_run(folder).drawings
        if name not in figures:
            raise _fail(f"NAME: must be one of {', '.join(figures)}; got {name}", BAD_INPUT)
        figures[name].save(into, width, font_scale)
        out.print(f"written: {into}", markup=False)


@app.command()
def compare(
    folders: Folders,
    html: Annotated[Path | None, typer.Option("--html", help="Also write the comparison as an HTML page.")] = None,
    form: FormatOption = Format.TABLE,
) -> None:
    """Show linear and Monte Carlo results of one or several runs.

    With several runs, show the inputs that differ and the change of each output from the first run, with intervals.
    Runs with the same seed, design and sources are compared on common draws.
    """
    with _reported_errors():
        from mcnav.errors import reading_file
        from mcnav.files import write_whole
        from mcnav.report import export, terminal
        from mcnav.workflow.analyse import summary_of
        from mcnav.workflow.compare import compare_runs

        runs: dict[str, dict[str, Any]] = {str(folder): summary_of(folder) for folder in folders}
        verdicts = []
        for name, summary in runs.items():
            with reading_file(Path(name) / "summary.json"):
                terminal.comparison({name: summary})
                verdicts.append((f"\n{name}: {summary['campaign']}", terminal.verdict(summary)))
        several = len(folders) > 1
        found = compare_runs(folders) if several or html is not None else None
        console = out if form is Format.TABLE else err
        if (warning := terminal.warnings(runs)) is not None:
            console.print(warning)
        if form is not Format.TABLE:
            rows = export.output_rows(runs)
            tables: dict[str, Any] = {"runs": export.run_rows(runs), "outputs": rows}
            if found is not None and several:
                tables["outputs"] = rows = export.with_changes(rows, list(runs), found.rows)
                changed = found.inputs.set_axis(list(runs), axis="columns")
                tables["inputs"] = [{"key": key, **dict(values)} for key, values in changed.iterrows()]
            _export(form, rows, tables)
        else:
            console.print(terminal.comparison(runs))
            for heading, verdict in verdicts:
                console.print(heading, markup=False, style="bold")
                console.print(verdict, soft_wrap=False)
            if found is not None:
                console.print()
                console.print(terminal.inputs(found.inputs))
                console.print()
                console.print(terminal.changes(found.titles[0], found.outputs))
        if html is not None and found is not None:
            html.parent.mkdir(parents=True, exist_ok=True)
            write_whole(html, found.page.encode())
            console.print(f"\nwritten: {html}", markup=False)


@app.command()
def replay(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    index: Annotated[int, typer.Argument(metavar="INDEX", min=0, help="Sample index.")],
    campaign: Annotated[
        Path | None, typer.Option(help="Campaign file of the run; needed for a scenario in your own code.")
    ] = None,
    into: Annotated[Path | None, typer.Option("--out", help="Output folder [default: the run folder].")] = None,
) -> None:
    """Simulate one sample of a run again; write its errors, outcome and time history as a page and a CSV file.

    Exit status: 0 the outcome is as stored, 1 it is different, 2 bad input.
    """
    with _reported_errors():
        from mcnav.report.replay import lines
        from mcnav.workflow import replay as replaying

        found = replaying.replay(folder, index, campaign)
        for note in found.notes:
            err.print(f"note: {note}", markup=False)
        out.print(lines(found))
        out.print()
        _print_written(replaying.write_replay(found, into or folder))
        if not replaying.as_stored(found):
            raise _fail(f"the outcome of sample {index} differs from the stored one", CHECK_FAILED)


@app.command()
def index(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder that contains run folders.")] = Path(
        "reports"
    ),
) -> None:
    """Write index.html, a list of all runs in a folder and its subfolders."""
    with _reported_errors():
        from mcnav.workflow.index import write_index

        written, count = write_index(folder)
        out.print(f"{count} runs\n\nwritten: {written}", markup=False)


@app.command()
def partials(
    campaign: CampaignFile,
    method: Annotated[Method, typer.Option(help="Method used to compute P.")] = Method.ALL,
    start_times: Annotated[
        bool, typer.Option("--start-times", help="Compute P for all start times of the flight, as a table and curves.")
    ] = False,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: OutFolder = None,
    form: FormatOption = Format.TABLE,
) -> None:
    """Show the partial derivatives P of the final errors, and the differences between three methods.

    With --start-times, write P and the linear dispersion as functions of the start of navigation.
    """
    with _reported_errors(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.lincov.partials import compare_partials
        from mcnav.report import export, terminal

        if start_times:
            if form is not Format.TABLE:
                raise _fail("--format: cannot be used with --start-times, which writes CSV; omit one", BAD_INPUT)
            _start_times(campaign, folder, axes, count, checks=False)
            return
        scenario = read_campaign(campaign).scenario
        methods = [each for each in Method if each != Method.ALL] if method == Method.ALL else [method]
        matrix, differences = compare_partials(scenario, [each.value for each in methods])
        if form is not Format.TABLE:
            rows = export.partial_rows(scenario.sources, scenario.outputs, matrix)
            shares = [
                {"method": name, "output": output.name, "largest_difference": float(values[i])}
                for name, values in differences.items()
                for i, output in enumerate(scenario.outputs)
            ]
            _export(form, rows, {"method": methods[0].value, "partials": rows, "differences": shares})
        else:
            out.print(terminal.partials(scenario.sources, scenario.outputs, matrix))
        if differences:
            console = out if form is Format.TABLE else err
            console.print()
            console.print(terminal.agreement(scenario.outputs, differences))


@app.command("start-times")
def start_times(
    campaign: CampaignFile,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: OutFolder = None,
) -> None:
    """Find the best start of navigation: linear dispersion by start time, with Monte Carlo checks.

    The campaign's optional table [start_times] sets errors that vary with the start time, weights of the outputs, and
    the start times to check.
    """
    with _reported_errors(campaign):
        _start_times(campaign, folder, axes, count, checks=True)


def _start_times(campaign: Path, folder: Path | None, axes: Axes | None, count: int | None, checks: bool) -> None:
    from mcnav.config.read import read_campaign
    from mcnav.report import progress, terminal
    from mcnav.studies.start_times import write_start_times

    target = folder or Path("reports") / f"{campaign.stem}_start_times"
    content = read_campaign(campaign)
    with progress.shown(err) as shown:
        found, files = write_start_times(content, target, axes.value if axes else None, count, checks, shown)
    out.print(terminal.best_starts(found.study, found.checks, found.own_sigma, content.scenario.outputs))
    out.print()
    _print_written(files)


@app.command()
def linearity(
    campaign: CampaignFile,
    tolerance: Annotated[
        float | None, typer.Option(min=1e-4, max=1.0, help="Allowed relative difference [default: the campaign's].")
    ] = None,
    samples: Annotated[int, typer.Option(min=200, max=1_000_000, help="Samples at each multiple.")] = 2_000,
    largest: Annotated[float, typer.Option(min=0.2, max=1_000.0, help="Largest multiple of all errors.")] = 50.0,
    folder: OutFolder = None,
) -> None:
    """Find the multiples of the errors at which linear analysis fails, for each source alone and all together."""
    with _reported_errors(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.report import progress, terminal
        from mcnav.studies.linearity import write_linearity

        content = read_campaign(campaign)
        target = folder or Path("reports") / f"{campaign.stem}_linearity"
        with progress.shown(err) as shown:
            study, files = write_linearity(content, target, tolerance, samples, largest, shown)
        out.print(terminal.linearity(content.scenario.outputs, study.together, study.tolerance))
        out.print()
        _print_written(files)


@app.command("check-scenario")
def check_scenario(campaign: CampaignFile) -> None:
    """Check a campaign's scenario: determinism, shapes, units, linearity near zero, partials against differences.

    Exit status: 0 all checks passed, 1 a check failed, 2 bad input.
    """
    with _reported_errors(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.report import terminal
        from mcnav.workflow.run import check_scenario

        checks = check_scenario(read_campaign(campaign))
        out.print(terminal.checks([(check.name, check.passed, check.told) for check in checks]))
        if not all(check.passed for check in checks):
            raise typer.Exit(CHECK_FAILED)


new = typer.Typer(no_args_is_help=True, help="Write a new campaign, or a new scenario with its test, ready to run.")
app.add_typer(new, name="new")

Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the files: letters, digits and _.")]
Into = Annotated[Path, typer.Option("--in", help="Output folder.")]


class CampaignTemplate(StrEnum):
    """Scenario of a new campaign."""

    REENTRY = "reentry"
    CRUISE = "cruise"
    HOVER = "hover"


@new.command("campaign")
def new_campaign(
    name: Name,
    kind: Annotated[CampaignTemplate, typer.Option("--type", help="Scenario.")] = CampaignTemplate.REENTRY,
    into: Into = Path(),
) -> None:
    """Write a campaign file."""
    with _reported_errors():
        from mcnav.config.templates import new_campaign

        (written,) = new_campaign(name, into, kind.value)
        out.print(f"written: {written}\n\nnext: mcnav run {written}", markup=False)


@new.command("scenario")
def new_scenario(name: Name, into: Into = Path()) -> None:
    """Write a scenario class, a campaign that uses it, and its test."""
    with _reported_errors():
        from mcnav.config.templates import new_scenario

        code, campaign, test = new_scenario(name, into)
        _print_written((code, campaign, test))
        out.print(f"\nnext: mcnav run {campaign}, then change propagate in {code}", markup=False)


class Page(StrEnum):
    """Pages of the documentation."""

    GUIDE = "guide"
    CAMPAIGNS = "campaigns"
    SCENARIOS = "scenarios"
    COMMANDS = "commands"
    REPORT = "report"
    NOTEBOOK = "notebook"
    SCALING = "scaling"
    NOTATION = "notation"
    ARCHITECTURE = "architecture"
    TN_D1772 = "tn-d1772"
    STORY = "story"


FILES = {
    Page.TN_D1772: "reproduce/tn_d1772/TN_D1772.md",
    Page.STORY: "reproduce/story_of_84_minutes/STORY_OF_84_MINUTES.md",
}
"""Files of pages that are not named like the page."""


@app.command()
def docs(page: Annotated[Page, typer.Argument(metavar="PAGE", help="Page to show.")] = Page.GUIDE) -> None:
    """Show a page of the documentation."""
    from importlib.resources import files

    text = files("mcnav").joinpath(FILES.get(page, f"{page.value.upper()}.md")).read_text(encoding="utf-8")
    if out.is_terminal:
        from rich.markdown import Markdown

        with out.pager(styles=True):
            out.print(Markdown(text))
    else:
        out.print(text, markup=False, soft_wrap=True)


class Document(StrEnum):
    """Documents that can be reproduced."""

    TN_D1772 = "tn-d1772"
    STORY = "story-of-84-minutes"


@app.command()
def reproduce(
    document: Annotated[
        Document, typer.Argument(metavar="DOCUMENT", help="tn-d1772 (NASA TN D-1772) or story-of-84-minutes.")
    ],
    folder: Annotated[Path | None, typer.Option("--out", help="Output folder [default: reports/DOCUMENT].")] = None,
) -> None:
    """Recompute the numbers and figures of a published document; write a page and CSV files."""
    with _reported_errors():
        from collections import Counter

        from mcnav.reproduce.story_of_84_minutes import page as story_page
        from mcnav.reproduce.tn_d1772 import page

        target = folder or Path("reports") / document.value
        if document is Document.STORY:
            _print_written(story_page.write(target))
            return
        cells, files = page.write_reproduction(target)
        out.print(f"{len(cells)} printed numbers")
        for mark, count in Counter(cell.mark for cell in cells).most_common():
            out.print(f"{count:6} {page.PHRASES[mark]}")
        out.print(f"\nwritten: {files[0]}", markup=False)
        out.print(f"and {len(files) - 1} CSV files in the same folder", markup=False)


@app.command()
def calibrate(
    trials: Annotated[int, typer.Option(min=2, help="Synthetic campaigns of each kind.")] = 100,
    jobs: Annotated[int, typer.Option(min=1, help="Parallel processes.")] = 2,
    folder: Annotated[Path, typer.Option("--out", help="Output folder.")] = Path("reports/calibration"),
) -> None:
    """Validate the statistics: coverage of intervals, false alarms and power; write a page and a CSV file.

    The campaigns are synthetic and their moments known. Every measured rate has its binomial interval.
    """
    with _reported_errors():
        from mcnav.calibration import page
        from mcnav.calibration.table import rates
        from mcnav.calibration.trials import run_trials
        from mcnav.files import write_texts
        from mcnav.sampling.designs import DESIGNS

        table = rates(*run_trials(trials, jobs, DESIGNS))
        texts = {"calibration.html": page.render(table, trials)}
        texts["calibration.csv"] = table.to_csv(index=False, float_format="%.4f")
        files = write_texts(folder, texts)
        for finding, count in table[table["finding"] != ""]["finding"].value_counts().items():
            out.print(f"{count:6} rates {finding}")
        out.print()
        _print_written(files)


def _prepare_process() -> None:
    """Prepare a process that runs one command, before numerical libraries are loaded.

    Their sums use one thread; idle threads of their pools would use processor time. A command ends before collecting
    its many lasting objects would free memory.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    gc.set_threshold(GARBAGE_THRESHOLD, 50, 50)


def main() -> None:
    """Run the command line; after a signal, exit without waiting for threads that still simulate or import."""
    _prepare_process()
    try:
        app(prog_name="mcnav")
    finally:
        if _signals:
            atexit._run_exitfuncs()  # removes temporary folders and semaphores; threads are joined later
            with suppress(OSError):  # the reader of the output may have ended
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(_signal_status())
