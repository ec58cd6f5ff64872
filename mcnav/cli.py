"""The commands."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

if TYPE_CHECKING:
    from mcnav.campaign.runner import Progress as Told

BAD_INPUT, SOME_FAILED, BUSY, INTERRUPTED, TERMINATED = 2, 3, 4, 130, 143
"""Exit statuses; 0 is success."""

QUIET_SECONDS = 1.0
"""A progress bar appears when a run takes longer."""

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=True,
)
out, err = Console(highlight=False, soft_wrap=True), Console(stderr=True, highlight=False, soft_wrap=True)

CampaignFile = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file (TOML).")]
Folders = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")]


class Engine(StrEnum):
    """How samples are flown."""

    ENSEMBLE = "ensemble"
    REFERENCE = "reference"


class Method(StrEnum):
    """How partial derivatives are found."""

    ALL = "all"
    VARIATIONAL = "variational"
    DIFFERENCES = "differences"
    RUNS = "runs"


class Axes(StrEnum):
    """Where the reference axes are alined."""

    START = "start"
    TRAJECTORY = "trajectory"


_asked_to_end: list[int] = []
"""Signals that ended the command, of those that are treated as Ctrl-C."""


def _end(number: int, frame: object) -> None:
    _asked_to_end.append(number)
    raise KeyboardInterrupt


def _fail(message: str, status: int) -> typer.Exit:
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False, soft_wrap=True)
    return typer.Exit(status)


@contextmanager
def _errors_told() -> Iterator[None]:
    """Turn what the user can mend into lines and an exit status."""
    from mcnav.campaign.problems import CampaignError, RunFolderBusy, RunFolderError
    from mcnav.linear.partials import FlightFailed

    signal.signal(signal.SIGTERM, _end)
    try:
        yield
    except RunFolderBusy as problem:
        raise _fail(str(problem), BUSY) from None
    except (CampaignError, RunFolderError, FlightFailed) as problem:
        raise _fail(str(problem), BAD_INPUT) from None
    except OSError as problem:
        raise _fail(f"{problem.filename or 'a file'}: {problem.strerror or problem}", BAD_INPUT) from None
    except KeyboardInterrupt:
        status = TERMINATED if _asked_to_end else INTERRUPTED
        raise _fail("interrupted; what is stored is kept, and the same command goes on from there", status) from None


@contextmanager
def _progress(samples: int) -> Iterator[Told]:
    """A bar with rate and time left, on a terminal, once a run has taken a second."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("flying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]} samples/s"),
        TimeRemainingColumn(),
        console=err,
        transient=True,
    )
    task = bar.add_task("flying", total=samples, rate="")
    began, shown = time.perf_counter(), False

    def told(more: int) -> None:
        nonlocal shown
        elapsed = time.perf_counter() - began
        bar.advance(task, more)
        bar.update(task, rate=f"{bar.tasks[0].completed / elapsed:,.0f}")
        if err.is_terminal and not shown and elapsed > QUIET_SECONDS:
            bar.start()
            shown = True

    try:
        yield told
    finally:
        if shown:
            bar.stop()


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
    engine: Annotated[Engine | None, typer.Option(help="How samples are flown [default: ensemble].")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Workers.")] = 2,
    samples: Annotated[int | None, typer.Option(min=2, help="Samples, in place of the file's.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed, in place of the file's.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace an earlier run in the folder.")] = False,
) -> None:
    """Fly a campaign, compare linear with Monte Carlo, write the report.

    Exit status: 0 done, 2 bad input, 3 some samples failed, 4 folder in use, 130 interrupted.
    """
    with _errors_told():
        from mcnav.campaign.file import read_campaign
        from mcnav.report import terminal
        from mcnav.study import engine_of, run_campaign

        given = {key: value for key, value in (("samples", samples), ("seed", seed)) if value is not None}
        described = read_campaign(campaign, given)
        target = folder or run_folder(campaign)
        chosen = engine.value if engine else engine_of(target, campaign) or Engine.ENSEMBLE.value
        with _progress(described.samples) as told:
            done = run_campaign(described, target, chosen, jobs, fresh, told)
        out.print(terminal.comparison({described.name: done.summary}))
        out.print()
        out.print(terminal.verdict(done.summary), soft_wrap=False)
        if done.flown < described.samples:
            out.print(f"\n{described.samples - done.flown:,} samples were stored already, {done.flown:,} flown now")
        out.print(f"\nreport: {target / 'report.html'}", markup=False)
        if done.summary["failed"]:
            raise typer.Exit(SOME_FAILED)


@app.command()
def report(folders: Folders) -> None:
    """Analyse finished run folders again and write their reports."""
    with _errors_told():
        from mcnav.study import report_run

        for folder in folders:
            report_run(folder)
            out.print(f"report: {folder / 'report.html'}", markup=False, soft_wrap=True)


@app.command()
def compare(folders: Folders) -> None:
    """Show linear beside Monte Carlo for one or several run folders."""
    with _errors_told():
        from mcnav.report import terminal
        from mcnav.study import summary_of

        runs: dict[str, dict[str, Any]] = {str(folder): summary_of(folder) for folder in folders}
        out.print(terminal.comparison(runs))
        for folder, summary in runs.items():
            out.print(f"\n{folder}: {summary['campaign']}", markup=False, style="bold")
            out.print(terminal.verdict(summary), soft_wrap=False)


@app.command()
def partials(
    campaign: CampaignFile,
    method: Annotated[Method, typer.Option(help="How they are found.")] = Method.ALL,
    start_times: Annotated[
        int | None, typer.Option("--start-times", min=2, help="For so many start times over the flight instead.")
    ] = None,
    axes: Annotated[Axes, typer.Option(help="Reference axes, with --start-times.")] = Axes.START,
    folder: Annotated[
        Path | None, typer.Option("--out", help="With --start-times [default: reports/ and NAME_start_times].")
    ] = None,
) -> None:
    """Show the partial derivatives of the final errors, and how well three methods agree on them.

    With --start-times, write them and the dispersion against the start of navigation as a table and a page.
    """
    with _errors_told():
        from mcnav.campaign.file import read_campaign
        from mcnav.linear.agreement import compared_partials
        from mcnav.report import terminal
        from mcnav.study import write_start_times

        described = read_campaign(campaign)
        if start_times is not None:
            target = folder or Path("reports") / f"{campaign.stem}_start_times"
            for written in write_start_times(described, target, axes.value, start_times):
                out.print(f"written: {written}", markup=False)
            return
        sources, outputs = described.scenario.sources, described.scenario.outputs
        methods = [each for each in Method if each != Method.ALL] if method == Method.ALL else [method]
        shown, differences = compared_partials(described.scenario, [each.value for each in methods])
        out.print(terminal.partials(sources, outputs, shown))
        if differences:
            out.print()
            out.print(terminal.agreement(outputs, differences))


class Seed(StrEnum):
    """What can be reproduced."""

    TN_D1772 = "tn-d1772"


@app.command()
def reproduce(
    seed: Annotated[Seed, typer.Argument(metavar="SEED", help="tn-d1772: Tables I to VI of NASA TN D-1772.")],
    folder: Annotated[Path | None, typer.Option("--out", help="Folder [default: reports/SEED].")] = None,
) -> None:
    """Recompute a seed document's tables, every printed number beside the computed one, as a page and a CSV file."""
    with _errors_told():
        from collections import Counter

        from mcnav.campaign.files import write_whole
        from mcnav.reproduce import page
        from mcnav.reproduce.tn_d1772 import all_cells

        cells = all_cells()
        target = folder or Path("reports") / seed.value
        target.mkdir(parents=True, exist_ok=True)
        write_whole(target / "tables.csv", page.table(cells).to_csv(index=False).encode())
        write_whole(target / "tables.html", page.render("NASA TN D-1772, Tables I to VI", cells).encode())
        out.print(f"{len(cells)} printed numbers")
        for mark, count in Counter(cell.mark for cell in cells).most_common():
            out.print(f"{count:6} {page.PHRASES[mark]}")
        out.print(f"\nwritten: {target / 'tables.html'}\nwritten: {target / 'tables.csv'}", markup=False)


def main() -> None:
    """Entry point of ``mcnav``."""
    app(prog_name="mcnav")
