"""The commands."""

from __future__ import annotations

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

BAD_INPUT, SOME_FAILED, BUSY, INTERRUPTED = 2, 3, 4, 130
"""Exit statuses; 0 is success."""

QUIET_SECONDS = 1.0
"""A progress bar appears when a run takes longer."""

app = typer.Typer(
    help="May the linear covariance analysis of this inertial navigation system be trusted? Monte Carlo answers.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=True,
)
out, err = Console(highlight=False), Console(stderr=True, highlight=False)

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


def _fail(message: str, status: int) -> typer.Exit:
    for line in message.splitlines():
        err.print(f"error: {line}", markup=False, soft_wrap=True)
    return typer.Exit(status)


@contextmanager
def _errors_told() -> Iterator[None]:
    """Turn what the user can mend into lines and an exit status."""
    from mcnav.campaign.problems import CampaignError, RunFolderBusy, RunFolderError
    from mcnav.linear.partials import FlightFailed

    try:
        yield
    except RunFolderBusy as problem:
        raise _fail(str(problem), BUSY) from None
    except (CampaignError, RunFolderError, FlightFailed) as problem:
        raise _fail(str(problem), BAD_INPUT) from None
    except KeyboardInterrupt:
        raise _fail(
            "interrupted; what is stored is kept, and the same command goes on from there", INTERRUPTED
        ) from None


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
    """Where a campaign file's results go: ``reports/NAME``; a run folder's own file goes on in that folder."""
    if campaign.name == "campaign.toml" and (campaign.parent / "manifest.json").exists():
        return campaign.parent
    return Path("reports") / campaign.stem


@app.command()
def run(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", help="Run folder [default: reports/NAME].")] = None,
    engine: Annotated[Engine, typer.Option(help="How samples are flown.")] = Engine.ENSEMBLE,
    jobs: Annotated[int, typer.Option(min=1, help="Workers.")] = 2,
    samples: Annotated[int | None, typer.Option(help="Samples, in place of the file's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed, in place of the file's.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace an earlier run in the folder.")] = False,
) -> None:
    """Fly a campaign, compare linear with Monte Carlo, write the report.

    Exit status: 0 done, 2 bad input, 3 some samples failed, 4 folder in use, 130 interrupted.
    """
    with _errors_told():
        from mcnav.campaign.file import read_campaign
        from mcnav.report import terminal
        from mcnav.study import run_campaign

        given = {key: value for key, value in (("samples", samples), ("seed", seed)) if value is not None}
        described = read_campaign(campaign, given)
        target = folder or run_folder(campaign)
        with _progress(described.samples) as told:
            summary = run_campaign(described, target, engine.value, jobs, fresh, told)
        out.print(terminal.comparison(summary))
        out.print()
        out.print(terminal.verdict(summary))
        out.print(f"\nreport: {target / 'report.html'}", markup=False, soft_wrap=True)
        if summary["failed"]:
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

        summaries: list[dict[str, Any]] = [summary_of(folder) for folder in folders]
        for summary in summaries:
            out.print(terminal.comparison(summary))
            out.print(terminal.verdict(summary))
            out.print()


@app.command()
def partials(
    campaign: CampaignFile,
    method: Annotated[Method, typer.Option(help="How they are found.")] = Method.ALL,
) -> None:
    """Show the partial derivatives of the final errors, and how well three methods agree on them."""
    with _errors_told():
        from mcnav.campaign.file import read_campaign
        from mcnav.linear.agreement import compared_partials
        from mcnav.report import terminal

        described = read_campaign(campaign)
        sources, outputs = described.scenario.sources, described.scenario.outputs
        methods = [each for each in Method if each != Method.ALL] if method == Method.ALL else [method]
        shown, differences = compared_partials(described.scenario, [each.value for each in methods])
        out.print(terminal.partials(sources, outputs, shown))
        if differences:
            out.print()
            out.print(terminal.agreement(outputs, differences))


def main() -> None:
    """Entry point of ``mcnav``."""
    app(prog_name="mcnav")
