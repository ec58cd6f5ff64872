"""The command that varies a campaign: keys of its file, the size of all its errors, or the start of its navigation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from mcnav.cli import next_command
from mcnav.cli import shell_completion as completion
from mcnav.cli.options import CampaignFile, ChosenAxes, Examine, FormatOption, Jobs, out_folder
from mcnav.cli.output_place import output_folder
from mcnav.cli.printing import Format, err, out, print_next, print_rows, print_written
from mcnav.cli.program import command, failure, set_resumes

START: Final = "start"
"""Word after ``--vary``, in place of a key and its values, that varies the start of navigation."""

BELONGING: Final = {
    "tolerance": "--scale",
    "samples": "--scale",
    "largest": "--scale",
    "axes": f"--vary {START}",
}
"""Options that one way of varying has, by the option that asks for it."""


@command(resumes=True)
def sweep(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES",
            help="""A key and its values, such as imu.gyro.bias="0.001..1 deg/h"; or start.""",
            autocompletion=completion.for_words(completion.keys),
        ),
    ] = None,
    scale: Annotated[
        bool, typer.Option("--scale", help="Vary the size of all errors until linear analysis fails.")
    ] = False,
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MEASURE",
            help="Result to compute at each value, such as position_horizontal [default: requirements].",
            autocompletion=completion.for_words(completion.outputs),
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option(
            "--points", "--count", min=2, max=100_000, help="Values of each range [default: 20; starts: 241]."
        ),
    ] = None,
    confirm: Annotated[
        int | None,
        typer.Option(metavar="N", min=0, help="Run Monte Carlo at N points, corners first; starts: 0 or all."),
    ] = None,
    at: Annotated[
        str | None, typer.Option("--at", "--epoch", metavar="TIMES", help="Times of the trajectory [default: the end].")
    ] = None,
    axes: ChosenAxes = None,
    tolerance: Annotated[
        float | None,
        typer.Option(min=1e-4, max=1.0, help="Of --scale: allowed relative difference [default: the campaign's]."),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(
            "--samples", "-n", min=200, max=1_000_000, help="Of --scale: samples at each size [default: 2000]."
        ),
    ] = None,
    largest: Annotated[
        float | None,
        typer.Option(min=0.2, max=1_000.0, help="Of --scale: largest multiple of all errors [default: 50]."),
    ] = None,
    examine: Examine = None,
    jobs: Jobs = 2,
    folder: Annotated[
        Path | None,
        out_folder("reports/NAME_sweep, _linearity or _start_times"),
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Vary keys, the size of all errors, or the start of navigation.

    --vary KEY=VALUES finds by linear analysis the values at which requirements are just met. VALUES is a range
    ("0.001..1 deg/h", logarithmic from a decade on) or a list ("1, 2, 5 deg/h"). A MEASURE is an output,
    position_horizontal, velocity_horizontal, or drms, cep, r95, sep of outputs; a limit may follow.

    --vary start finds the best start of navigation, checked by Monte Carlo. --scale multiplies the campaign's errors,
    each source alone and all together, and finds where linear analysis fails.

    Example: mcnav sweep campaigns/19_flight_with_gnss.toml --vary imu.gyro.bias="0.001..1 deg/h"
    --against "position_horizontal < 20 m"
    """
    starts = vary == [START]
    if scale + bool(vary) != 1:
        raise failure(f"mcnav sweep needs --vary KEY=VALUES, --vary {START} or --scale, and only one of them")
    way = "--scale" if scale else f"--vary {START}" if starts else ""
    for option, value in {"tolerance": tolerance, "samples": samples, "largest": largest, "axes": axes}.items():
        if value is not None and BELONGING[option] != way:
            raise failure(f"--{option}: belongs to {BELONGING[option]}; leave it out")
    if way:
        set_resumes(False)  # only points of keys are stored
        others = {"against": against, "at": at, "examine": examine, "format": form if form != "table" else None}
        for option, given in others.items():
            if given:
                raise failure(f"--{option}: does not go with {way}; leave it out")
    if scale:
        _show_linearity(campaign, folder, tolerance, samples or 2_000, largest or 50.0)
    elif starts:
        _show_start_times(campaign, folder, axes, points, checks=confirm != 0)
    else:
        _show_sweep(campaign, vary or [], against or [], points or 20, confirm, at, examine, jobs, folder, form)


def _show_sweep(
    campaign: Path, vary: list[str], against: list[str], points: int, confirm: int | None, at: str | None,
    examine: bool | None, jobs: int, folder: Path | None, form: Format,
) -> None:  # fmt: skip
    """Vary keys of a campaign, write and print what follows."""
    from mcnav.config.sweep_values import split_varied
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import sweep as tables
    from mcnav.report.pages.sweep_page import terminal
    from mcnav.report.terminal import progress
    from mcnav.studies.linear_answers import read_times
    from mcnav.studies.sweep import SweepPlan, write_sweep

    times = () if at is None else tuple(read_times(at).tolist())
    plan = SweepPlan(split_varied(vary), against, points, times, jobs, examine)
    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_sweep")
        result, files = write_sweep(campaign, plan, target, confirm, shown)
    if form != "table":
        print_rows(form, tables.frame(result).to_dict("records"), {"sweep": tables.table(result)})
        return
    out.print(printed(terminal(result)), soft_wrap=False)
    out.print()
    print_written(files)
    print_next(next_command.after_sweep(campaign, target, vary, against, confirm))


def _show_linearity(campaign: Path, folder: Path | None, tolerance: float | None, samples: int, largest: float) -> None:
    """Find the multiple of all errors at which linear analysis fails; write and print it."""
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages.linearity import remarks, terminal
    from mcnav.report.terminal import progress
    from mcnav.studies.boxed_run import campaign_at_worst
    from mcnav.studies.linearity import write_linearity

    content = campaign_at_worst(campaign)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_linearity")
    with progress.shown(err) as shown:
        study, files = write_linearity(content, target, tolerance, samples, largest, shown)
    out.print(printed(terminal(content.scenario.outputs, study.together, study.tolerance)), soft_wrap=False)
    for sentence in remarks(content.scenario.outputs, study.noise, study.sizes_alone):
        out.print(sentence)
    out.print()
    print_written(files)
    print_next(next_command.written("run", campaign))


def _show_start_times(campaign: Path, folder: Path | None, axes: str | None, count: int | None, checks: bool) -> None:
    """Find the best start of navigation, with Monte Carlo checks or without; write and print it.

    The campaign's optional table [start_times] sets errors that vary with the start, weights of the outputs, and the
    start times to check.
    """
    from mcnav.report.terminal import progress, terminal
    from mcnav.studies.boxed_run import campaign_at_worst
    from mcnav.studies.start_times import write_start_times

    content = campaign_at_worst(campaign)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_start_times")
    with progress.shown(err) as shown:
        times, files = write_start_times(content, target, axes, count, checks, shown)
    out.print(terminal.best_starts(times.study, times.checks, times.own_rms, content.scenario.outputs))
    out.print()
    print_written(files)
    print_next(next_command.written("lincov", campaign))
