"""The commands."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from mcnav.report.fitted_table import OpenConsole

NOT_KEPT, BAD_INPUT, SOME_FAILED, BUSY, INTERRUPTED, TERMINATED = 1, 2, 3, 4, 130, 143
"""Exit statuses; 0 is success."""

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=True,
)
out, err = OpenConsole(highlight=False, soft_wrap=True), OpenConsole(stderr=True, highlight=False, soft_wrap=True)

CampaignFile = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file (TOML).")]
Folders = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")]


class Method(StrEnum):
    """How partial derivatives are found."""

    ALL = "all"
    VARIATIONAL = "variational"
    DIFFERENCES = "differences"
    RUNS = "runs"


class Store(StrEnum):
    """What a run keeps."""

    SAMPLES = "samples"
    SUMMARY = "summary"


class Format(StrEnum):
    """How results are printed."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"


class Axes(StrEnum):
    """Where the reference axes are aligned."""

    START = "start"
    TRAJECTORY = "trajectory"


AsFormat = Annotated[
    Format, typer.Option("--format", help="A table to read, or csv or json in full precision, alone on stdout.")
]


_asked_to_end: list[int] = []
"""Signals that ended the command."""


def _end(number: int, frame: object) -> None:
    """Break off in order; when asked again, at once: files are whole or not there, workers end with this process."""
    _asked_to_end.append(number)
    if len(_asked_to_end) > 1:
        os._exit(_status_when_ended())
    raise KeyboardInterrupt


def _status_when_ended() -> int:
    return TERMINATED if _asked_to_end[:1] == [signal.SIGTERM] else INTERRUPTED


def _fail(message: str, status: int) -> typer.Exit:
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False, soft_wrap=True)
    return typer.Exit(status)


@contextmanager
def _errors_told(file: Path | None = None) -> Iterator[None]:
    """Turn what the user can mend into lines and an exit status; a scenario's own errors are those of the file."""
    from mcnav.errors import CampaignError, ClusterError, Problem, RunFolderBusy, RunFolderError, TooManyFailures
    from mcnav.lincov.partials import SimulationFailed
    from mcnav.scenarios.protocol import ScenarioError

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    try:
        yield
    except RunFolderBusy as problem:
        raise _fail(str(problem), BUSY) from None
    except TooManyFailures as problem:
        message = f"{problem}; what is stored is kept, and the same command without --max-failures goes on from there"
        raise _fail(message, SOME_FAILED) from None
    except MemoryError:
        message = "not enough memory; what is stored is kept, and the same command goes on from there"
        raise _fail(f"{f'{file}: ' if file else ''}{message} (fewer --jobs need less)", BAD_INPUT) from None
    except ScenarioError as problem:
        raise _fail(str(Problem(str(file or ""), f"scenario.{problem.key}", str(problem))), BAD_INPUT) from None
    except SimulationFailed as problem:
        raise _fail(str(Problem(str(file or ""), "scenario", str(problem))), BAD_INPUT) from None
    except (CampaignError, ClusterError, RunFolderError) as problem:
        raise _fail(str(problem), BAD_INPUT) from None
    except OSError as problem:
        raise _fail(f"{problem.filename or 'a file'}: {problem.strerror or problem}", BAD_INPUT) from None
    except KeyboardInterrupt:
        message = "interrupted; what is stored is kept, and the same command goes on from there"
        raise _fail(message, _status_when_ended()) from None


def _export(chosen: Format, rows: Sequence[Mapping[str, Any]], tables: Mapping[str, Any]) -> None:
    """Print rows as CSV, or tables by name as JSON."""
    from mcnav.report import export

    sys.stdout.write(export.as_csv(rows) if chosen is Format.CSV else export.as_json(tables))


def run_folder(campaign: Path) -> Path:
    """Where results go: ``reports/`` and the campaign file's stem; a run folder's own file goes on in that folder."""
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
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show it.")] = False,
) -> None:
    """May the linear covariance analysis of this inertial navigation system be trusted? Monte Carlo answers."""


@app.command()
def run(
    campaign: CampaignFile,
    folder: Annotated[
        Path | None, typer.Option("--out", help="Run folder [default: reports/ and the file's name without .toml].")
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="How samples are flown: ensemble, reference or map [default: the scenario's first]."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Workers [default: 2].")] = None,
    dask: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Fly in N worker processes of a dask cluster made for it.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Fly on a dask cluster, such as tcp://host:8786; see mcnav docs scaling."),
    ] = None,
    samples: Annotated[int | None, typer.Option(min=2, help="Samples, in place of the file's.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed, in place of the file's.")] = None,
    store: Annotated[
        Store | None, typer.Option(help="Keep every sample, or a summary of any number of them [default: the file's].")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace an earlier run in the folder.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Go on where partial derivatives are not settled; the results say so.")
    ] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit 1 unless every requirement of [accept] is met.")] = False,
    timeout: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time that a sample may take, such as '10 s'.")
    ] = None,
    max_failures: Annotated[int | None, typer.Option(min=0, help="Break off when more samples fail.")] = None,
    shown: AsFormat = Format.TABLE,
) -> None:
    """Fly a campaign, compare linear with Monte Carlo, write the report.

    Exit status: 0 done, 1 a requirement is not met or not decided (with --check), 2 bad input,
    3 some samples failed, 4 folder in use, 130 interrupted.
    """
    with _errors_told(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.execution.dask_cluster import open_executor
        from mcnav.report import export, progress, terminal
        from mcnav.workflow.run import engine_of, run_campaign

        options = {
            "samples": samples,
            "seed": seed,
            "sample_timeout": timeout,
            "store": store.value if store else None,
        }
        given = {key: value for key, value in options.items() if value is not None}
        described = read_campaign(campaign, given)
        if check and not described.requirements:
            raise _fail(f"{campaign}: accept: is missing; --check has nothing to check", BAD_INPUT)
        target = folder or run_folder(campaign)
        chosen = engine or engine_of(target, campaign)
        with open_executor(scheduler, dask, jobs) as (flyers, workers, known), progress.shown(err) as told:
            done = run_campaign(described, target, chosen, workers, fresh, told, max_failures, flyers, force)
        for notice in (*known, *done.notices):
            err.print(f"note: {notice}", markup=False)
        runs = {described.name: done.summary}
        if shown is not Format.TABLE:
            rows, requirements = export.output_rows(runs), export.requirement_rows(done.summary)
            tables = {"runs": export.run_rows(runs), "outputs": rows, "requirements": requirements}
            _export(shown, rows, tables)
        said = out if shown is Format.TABLE else err
        if (warned := terminal.warnings(runs)) is not None:
            said.print(warned)
        if shown is Format.TABLE:
            said.print(terminal.comparison(runs))
            said.print()
        said.print(terminal.verdict(done.summary), soft_wrap=False)
        if done.summary["requirements"]:
            said.print()
            said.print(terminal.requirements(done.summary))
        if done.flown < done.summary["samples"]:
            said.print(
                f"\n{done.summary['samples'] - done.flown:,} samples were stored already, {done.flown:,} flown now"
            )
        said.print(f"\nreport: {target / 'report.html'}", markup=False)
        if check and any(entry["finding"] != "met" for entry in done.summary["requirements"]):
            raise typer.Exit(NOT_KEPT)
        if done.summary["failed"]:
            raise typer.Exit(SOME_FAILED)


@app.command()
def report(folders: Folders) -> None:
    """Analyse finished run folders again and write their reports."""
    with _errors_told():
        from mcnav.workflow.analyse import report_run

        for folder in folders:
            report_run(folder)
            out.print(f"report: {folder / 'report.html'}", markup=False, soft_wrap=True)


@app.command()
def figure(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="A figure of the report, such as scatter or budget.")],
    into: Annotated[Path, typer.Option("--out", help="File to write: .pdf, .svg or .png.")],
    width: Annotated[float | None, typer.Option(min=2.0, max=100.0, help="Width, cm [default: the page's].")] = None,
    font_scale: Annotated[float, typer.Option(min=0.2, max=5.0, help="Size of text over the page's.")] = 1.0,
) -> None:
    """Draw a figure of a run's report by itself, for a paper."""
    with _errors_told():
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
    html: Annotated[Path | None, typer.Option("--html", help="Write the comparison as a page, too.")] = None,
    shown: AsFormat = Format.TABLE,
) -> None:
    """Show linear beside Monte Carlo for one or several run folders.

    With several: what was changed in the campaigns since the first, and what has become of each output, with intervals;
    on common draws where seeds allow.
    """
    with _errors_told():
        from mcnav.errors import reading_file
        from mcnav.files import write_whole
        from mcnav.report import export, terminal
        from mcnav.workflow.analyse import summary_of
        from mcnav.workflow.compare import compare_runs

        runs: dict[str, dict[str, Any]] = {str(folder): summary_of(folder) for folder in folders}
        told = []
        for name, summary in runs.items():
            with reading_file(Path(name) / "summary.json"):
                terminal.comparison({name: summary})
                told.append((f"\n{name}: {summary['campaign']}", terminal.verdict(summary)))
        several = len(folders) > 1
        found = compare_runs(folders) if several or html is not None else None
        said = out if shown is Format.TABLE else err
        if (warned := terminal.warnings(runs)) is not None:
            said.print(warned)
        if shown is not Format.TABLE:
            rows = export.output_rows(runs)
            if found is not None and several:
                rows = export.with_changes(rows, list(runs), found.rows)
            tables: dict[str, Any] = {"runs": export.run_rows(runs), "outputs": rows}
            if found is not None and several:
                changed = found.inputs.set_axis(list(runs), axis="columns")
                tables["inputs"] = [{"key": key, **dict(values)} for key, values in changed.iterrows()]
            _export(shown, rows, tables)
        else:
            said.print(terminal.comparison(runs))
            for heading, verdict in told:
                said.print(heading, markup=False, style="bold")
                said.print(verdict, soft_wrap=False)
            if found is not None:
                said.print()
                said.print(terminal.inputs(found.inputs))
                said.print()
                said.print(terminal.changes(found.titles[0], found.outputs))
        if html is not None and found is not None:
            html.parent.mkdir(parents=True, exist_ok=True)
            write_whole(html, found.page.encode())
            said.print(f"\nwritten: {html}", markup=False)


@app.command()
def replay(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    index: Annotated[int, typer.Argument(metavar="INDEX", min=0, help="Of the sample.")],
    campaign: Annotated[
        Path | None, typer.Option(help="The run's campaign file; needed when its scenario is code of your own.")
    ] = None,
    into: Annotated[Path | None, typer.Option("--out", help="Folder [default: the run folder].")] = None,
) -> None:
    """Fly one sample of a run again, failed or not: its errors, its outcomes, its history as a page and a CSV file.

    Exit status: 0 as stored, 1 the outcome is another than the one stored, 2 bad input.
    """
    with _errors_told():
        from mcnav.report.replay import lines
        from mcnav.workflow.replay import as_stored, write_replay
        from mcnav.workflow.replay import replay as fly_again

        found = fly_again(folder, index, campaign)
        for note in found.notes:
            err.print(f"note: {note}", markup=False)
        out.print(lines(found))
        out.print()
        for written in write_replay(found, into or folder):
            out.print(f"written: {written}", markup=False)
        if not as_stored(found):
            raise _fail(f"sample {index} did not come out again as it is stored", NOT_KEPT)


@app.command()
def index(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of run folders.")] = Path("reports"),
) -> None:
    """Write index.html of all runs in a folder and below it: verdict, sigmas, date, identity."""
    with _errors_told():
        from mcnav.workflow.index import write_index

        written, count = write_index(folder)
        out.print(f"{count} runs\n\nwritten: {written}", markup=False)


Count = Annotated[int | None, typer.Option("--count", min=2, max=100_000, help="Start times [default: 241].")]
ChosenAxes = Annotated[Axes | None, typer.Option(help="Reference axes [default: start].")]


@app.command()
def partials(
    campaign: CampaignFile,
    method: Annotated[Method, typer.Option(help="How they are found.")] = Method.ALL,
    start_times: Annotated[
        bool, typer.Option("--start-times", help="For every start time of the flight instead, as table and curves.")
    ] = False,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: Annotated[
        Path | None, typer.Option("--out", help="With --start-times [default: reports/ and NAME_start_times].")
    ] = None,
    shown: AsFormat = Format.TABLE,
) -> None:
    """Show the partial derivatives of the final errors, and how well three methods agree on them.

    With --start-times, write them and the linear dispersion against the start of navigation.
    """
    with _errors_told(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.lincov.partials_agreement import compare_partials
        from mcnav.report import export, terminal

        if start_times and shown is not Format.TABLE:
            raise _fail(
                "--format: not with --start-times, which writes its table as CSV; leave one of them out", BAD_INPUT
            )
        if start_times:
            _start_times(campaign, folder, axes, count, checks=False)
            return
        described = read_campaign(campaign)
        sources, outputs = described.scenario.sources, described.scenario.outputs
        methods = [each for each in Method if each != Method.ALL] if method == Method.ALL else [method]
        matrix, differences = compare_partials(described.scenario, [each.value for each in methods])
        if shown is not Format.TABLE:
            rows = export.partial_rows(sources, outputs, matrix)
            shares = [
                {"method": name, "output": output.name, "largest_difference": float(values[i])}
                for name, values in differences.items()
                for i, output in enumerate(outputs)
            ]
            _export(shown, rows, {"method": methods[0].value, "partials": rows, "differences": shares})
        else:
            out.print(terminal.partials(sources, outputs, matrix))
        if differences:
            said = out if shown is Format.TABLE else err
            said.print()
            said.print(terminal.agreement(outputs, differences))


@app.command("start-times")
def start_times(
    campaign: CampaignFile,
    count: Count = None,
    axes: ChosenAxes = None,
    folder: Annotated[Path | None, typer.Option("--out", help="[default: reports/ and NAME_start_times].")] = None,
) -> None:
    """Find when to start navigation: dispersion against start time, linear and checked by Monte Carlo.

    The campaign's table [start_times] may say how errors change with the start time, what each output's dispersion is
    worth, and which start times to check.
    """
    with _errors_told(campaign):
        _start_times(campaign, folder, axes, count, checks=True)


def _start_times(campaign: Path, folder: Path | None, axes: Axes | None, count: int | None, checks: bool) -> None:
    from mcnav.config.read import read_campaign
    from mcnav.report import progress, terminal
    from mcnav.studies.start_times import write_start_times

    target = folder or Path("reports") / f"{campaign.stem}_start_times"
    described = read_campaign(campaign)
    with progress.shown(err) as told:
        found, files = write_start_times(described, target, axes.value if axes else None, count, checks, told)
    out.print(terminal.best_starts(found.study, found.checks, found.own_sigma, described.scenario.outputs))
    out.print()
    for written in files:
        out.print(f"written: {written}", markup=False)


@app.command()
def linearity(
    campaign: CampaignFile,
    tolerance: Annotated[
        float | None, typer.Option(min=1e-4, max=1.0, help="Departure that counts, a share [default: the campaign's].")
    ] = None,
    samples: Annotated[int, typer.Option(min=200, max=1_000_000, help="Flights at each multiple.")] = 2_000,
    largest: Annotated[float, typer.Option(min=0.2, max=1_000.0, help="Largest multiple of all errors.")] = 50.0,
    folder: Annotated[Path | None, typer.Option("--out", help="[default: reports/ and NAME_linearity].")] = None,
) -> None:
    """Find how many times larger the errors could be before linear analysis fails, source by source and together."""
    with _errors_told(campaign):
        from mcnav.config.read import read_campaign
        from mcnav.report import progress, terminal
        from mcnav.studies.linearity import write_linearity

        described = read_campaign(campaign)
        target = folder or Path("reports") / f"{campaign.stem}_linearity"
        with progress.shown(err) as told:
            study, files = write_linearity(described, target, tolerance, samples, largest, told)
        out.print(terminal.linearity(described.scenario.outputs, study.together, study.tolerance))
        out.print()
        for written in files:
            out.print(f"written: {written}", markup=False)


@app.command("check-scenario")
def check_scenario(campaign: CampaignFile) -> None:
    """Try out a campaign's scenario: determinism, shapes, units, linearity near zero, partials against differences.

    Exit status: 0 all kept, 1 something is not, 2 bad input.
    """
    with _errors_told(campaign):
        from mcnav.report import terminal
        from mcnav.workflow import run as study

        checks = study.check_scenario(campaign)
        out.print(terminal.checks([(check.name, check.passed, check.told) for check in checks]))
        if not all(check.passed for check in checks):
            raise typer.Exit(NOT_KEPT)


new = typer.Typer(no_args_is_help=True, help="Write a campaign, or a scenario with its test, that runs as it stands.")
app.add_typer(new, name="new")

Name = Annotated[str, typer.Argument(metavar="NAME", help="Of the files: letters, digits and _.")]
Into = Annotated[Path, typer.Option("--in", help="Folder.")]


class CampaignTemplate(StrEnum):
    """What a new campaign flies."""

    REENTRY = "reentry"
    CRUISE = "cruise"
    HOVER = "hover"


@new.command("campaign")
def new_campaign(
    name: Name,
    kind: Annotated[CampaignTemplate, typer.Option("--type", help="What it flies.")] = CampaignTemplate.REENTRY,
    into: Into = Path(),
) -> None:
    """Write a campaign file."""
    with _errors_told():
        from mcnav.config.templates import new_campaign

        (written,) = new_campaign(name, into, kind.value)
        out.print(f"written: {written}\n\nnext: mcnav run {written}", markup=False)


@new.command("scenario")
def new_scenario(name: Name, into: Into = Path()) -> None:
    """Write a scenario of one's own: the class, a campaign that flies it, and its test."""
    with _errors_told():
        from mcnav.config.templates import new_scenario

        code, campaign, test = new_scenario(name, into)
        out.print(f"written: {code}\nwritten: {campaign}\nwritten: {test}", markup=False)
        out.print(f"\nnext: mcnav run {campaign}, then change propagate in {code}", markup=False)


class Page(StrEnum):
    """Pages of the documentation that come with the program."""

    GUIDE = "guide"
    NOTEBOOK = "notebook"
    NOTATION = "notation"
    ARCHITECTURE = "architecture"
    TN_D1772 = "tn-d1772"
    STORY = "story"
    SCALING = "scaling"


FILES = {
    Page.TN_D1772: "reproduce/tn_d1772/TN_D1772.md",
    Page.STORY: "reproduce/story_of_84_minutes/STORY_OF_84_MINUTES.md",
}
"""Where a page is, if not under its own name."""


@app.command()
def docs(page: Annotated[Page, typer.Argument(metavar="PAGE", help="Which one.")] = Page.GUIDE) -> None:
    """Show the documentation: guide, notebook, notation, architecture, tn-d1772, story or scaling."""
    from importlib.resources import files

    text = files("mcnav").joinpath(FILES.get(page, f"{page.value.upper()}.md")).read_text(encoding="utf-8")
    if out.is_terminal:
        from rich.markdown import Markdown

        with out.pager(styles=True):
            out.print(Markdown(text))
    else:
        out.print(text, markup=False, soft_wrap=True)


class Seed(StrEnum):
    """What can be reproduced."""

    TN_D1772 = "tn-d1772"
    STORY = "story-of-84-minutes"


@app.command()
def reproduce(
    seed: Annotated[Seed, typer.Argument(metavar="SEED", help="tn-d1772 (NASA TN D-1772) or story-of-84-minutes.")],
    folder: Annotated[Path | None, typer.Option("--out", help="Folder [default: reports/SEED].")] = None,
) -> None:
    """Recompute a seed document, every printed number and figure beside the computed one, as a page and CSV files."""
    with _errors_told():
        from collections import Counter

        from mcnav.reproduce.story_of_84_minutes import page as story_page
        from mcnav.reproduce.tn_d1772 import page

        if seed is Seed.STORY:
            for path in story_page.write(folder or Path("reports") / seed.value):
                out.print(f"written: {path}", markup=False)
            return

        target = folder or Path("reports") / seed.value
        cells, files = page.write_reproduction(target)
        out.print(f"{len(cells)} printed numbers")
        for mark, count in Counter(cell.mark for cell in cells).most_common():
            out.print(f"{count:6} {page.PHRASES[mark]}")
        out.print(f"\nwritten: {files[0]}", markup=False)
        out.print(f"written: {len(files) - 1} tables beside it (CSV)", markup=False)


@app.command()
def calibrate(
    trials: Annotated[int, typer.Option(min=2, help="Campaigns of each kind.")] = 100,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    folder: Annotated[Path, typer.Option("--out", help="Folder.")] = Path("reports/calibration"),
) -> None:
    """Measure how often the program's intervals cover, its tests alarm and its verdicts find, as a page and a CSV file.

    Synthetic campaigns on systems whose truth is known; the binomial error of every rate is beside it.
    """
    with _errors_told():
        from mcnav.calibration import page
        from mcnav.calibration.table import rates
        from mcnav.calibration.trials import run_trials
        from mcnav.files import write_whole
        from mcnav.sampling.designs import DESIGNS

        table = rates(*run_trials(trials, jobs, DESIGNS))
        folder.mkdir(parents=True, exist_ok=True)
        written = table.to_csv(index=False, float_format="%.4f")
        write_whole(folder / "calibration.csv", written.encode())
        write_whole(folder / "calibration.html", page.render(table, trials).encode())
        for finding, count in table[table["finding"] != ""]["finding"].value_counts().items():
            out.print(f"{count:6} rates {finding}")
        out.print(f"\nwritten: {folder / 'calibration.html'}\nwritten: {folder / 'calibration.csv'}", markup=False)


def main() -> None:
    """Entry point of ``mcnav``.

    A command that a signal has ended leaves nothing to wait for: neither flights on the side nor libraries that a
    thread is loading.
    """
    try:
        app(prog_name="mcnav")
    finally:
        if _asked_to_end:
            atexit._run_exitfuncs()  # temporary folders and semaphores are removed here, threads joined later
            with suppress(OSError):  # a reader of the output may have ended before
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(_status_when_ended())
