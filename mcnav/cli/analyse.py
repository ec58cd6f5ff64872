"""Commands that analyse: linear covariance, budgets of errors, recorded flights, kinds of filters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mcnav.cli import next_command
from mcnav.cli import shell_completion as completion
from mcnav.cli.options import (
    CampaignFile,
    Examine,
    FormatOption,
    Jobs,
    columns_of,
    options_in_messages,
    out_folder,
    pairs_of,
)
from mcnav.cli.output_place import output_folder
from mcnav.cli.printing import (
    Format,
    err,
    out,
    print_next,
    print_notes,
    print_rows,
    print_written,
)
from mcnav.cli.program import BAD_INPUT, command, failure


@command()
def lincov(
    campaign: CampaignFile,
    folder: Annotated[Path | None, out_folder("reports/NAME_lincov")] = None,
    at: Annotated[
        str | None, typer.Option(metavar="TIMES", help="Times of the trajectory, such as '600 s, 1500 s'.")
    ] = None,
    partials: Annotated[
        bool, typer.Option("--partials", help="Show the partial derivatives P of the final errors instead.")
    ] = False,
    method: Annotated[
        Literal["all", "variational", "differences", "runs"] | None,
        typer.Option(help="Of --partials: how P is computed [default: all]."),
    ] = None,
    remedies: Annotated[
        bool, typer.Option("--remedies", help="Compute every remedy where something fails, for the page.")
    ] = False,
    examine: Examine = None,
    gates: Annotated[
        bool | None,
        typer.Option(
            "--gates/--no-gates",
            help="Simulate flights that begin with a rejection by a gate [default: where rejections are rare].",
        ),
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Compute the linear covariance, and examine where it holds.

    It shows requirements, sigmas and their causes, at the end and over time. It simulates some flights to see where
    linear analysis holds. With aiding, true sigmas stand beside filter sigmas, before and after an update. --partials
    shows P by three methods, with their differences.

    Example: mcnav lincov campaigns/19_flight_with_gnss.toml --at "1800 s"
    """
    if partials:
        if folder is not None or at is not None:
            raise failure(f"--{'out' if at is None else 'at'}: does not go with --partials; leave it out")
        _show_partials(campaign, method or "all", form)
        return
    if method is not None:
        raise failure("--method: belongs to --partials; add it")
    from mcnav.config.read import read_campaign
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages.lincov import exported
    from mcnav.report.pages.lincov_page import terminal
    from mcnav.studies.lincov import write_lincov
    from mcnav.studies.linear_answers import read_times

    times = None if at is None else read_times(at)
    target = output_folder(folder, Path("reports") / f"{campaign.stem}_lincov")
    result, files = write_lincov(read_campaign(campaign), target, times, remedies, examine=examine, gates=gates)
    if form != "table":
        tables = exported(result)
        print_rows(form, tables["sigmas"], tables)
        return
    out.print(printed(terminal(result)), soft_wrap=False)
    out.print()
    print_written(files)
    print_next(next_command.after_lincov(campaign, result))


def _show_partials(campaign: Path, method: str, form: Format) -> None:
    """Show the partial derivatives P of the final errors, and how far the methods that compute it agree."""
    from mcnav.config.read import read_campaign
    from mcnav.linear.partials import compare_partials
    from mcnav.report.exports import export
    from mcnav.report.terminal import terminal

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
        print_rows(form, rows, {"method": methods[0], "partials": rows, "differences": shares})
    else:
        out.print(terminal.partials(scenario.sources, scenario.outputs, matrix))
    if differences:
        console = out if form == "table" else err
        console.print()
        console.print(terminal.agreement(scenario.outputs, differences))
    if form == "table":
        print_next(next_command.written("lincov", campaign))


@command()
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
    begin: Annotated[
        float | None,
        typer.Option("--from", metavar="S", help="Begin of the judged part, s after the first reading."),
    ] = None,
    end: Annotated[
        float | None, typer.Option("--to", metavar="S", help="End of the judged part, s after the first reading.")
    ] = None,
    records: Annotated[int, typer.Option(min=200, max=100_000, help="Simulated records to compare with.")] = 1000,
    record: Annotated[
        bool,
        typer.Option("--record", help="Write the readings of a simulated flight, to try mcnav judge."),
    ] = False,
    sample: Annotated[int | None, typer.Option(min=0, help="Of --record: number of the sample [default: 0].")] = None,
    rate: Annotated[
        float | None, typer.Option(min=1.0, max=1000.0, help="Of --record: readings per second [default: 50].")
    ] = None,
    folder: Annotated[Path | None, out_folder("reports/NAME_judge")] = None,
) -> None:
    """Judge the filter of a campaign by a recorded flight.

    It says which number is wrong, by how much, and what the record could have shown. --record writes one sample of the
    campaign as files of a recorded flight.

    Example: mcnav judge flight.toml --imu imu.csv --measurements gnss=gnss.csv --reference truth.csv
    """
    if record:
        if campaign is None or imu is not None or errors is not None:
            raise failure("--record: takes a campaign alone, whose flight it simulates", BAD_INPUT)
        _write_record(campaign, folder, sample or 0, rate or 50.0)
        return
    if sample is not None or rate is not None:
        raise failure(f"--{'rate' if sample is None else 'sample'}: belongs to --record; add it", BAD_INPUT)
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import judged, judged_errors
    from mcnav.studies.judge import write_error_judgement, write_judgement
    from mcnav.studies.recordings import RecordingFiles

    if errors is not None:
        if campaign is not None or imu is not None:
            raise failure("--errors: does not go with a campaign; leave one of them out", BAD_INPUT)
        target = output_folder(folder, Path("reports") / f"{errors.stem}_judge")
        verdicts, files = write_error_judgement(errors, target)
        out.print(printed(judged_errors.terminal(verdicts)), soft_wrap=False)
    else:
        if campaign is None or imu is None:
            raise failure("mcnav judge needs CAMPAIGN and --imu FILE, or --errors TABLE", BAD_INPUT)
        from mcnav.config.read import read_campaign

        given = {name: Path(file) for name, file in pairs_of(measurements, "measurements", "gnss=gnss.pos").items()}
        columns, units = pairs_of(column, "column", "gyro_x=wx"), pairs_of(unit, "unit", "gyro=deg/s")
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_judge")
        described = RecordingFiles(imu, given, reference, start, columns, units, begin, end)
        content = read_campaign(campaign)
        if content.ranges:
            print_notes(["judge compares the upper ends of ranges with the record: a smaller size may lie within them"])
        with options_in_messages():
            judgement, files = write_judgement(content, described, target, records)
        out.print(printed(judged.terminal(judgement)), soft_wrap=False)
    out.print()
    print_written(files)
    print_next(next_command.after_judgement(campaign))


def _write_record(campaign: Path, folder: Path | None, sample: int, rate: float) -> None:
    """Write what the instruments and sensors of a sample read, in files like those of a recorded flight."""
    from mcnav.config.read import read_campaign
    from mcnav.studies.recordings import write_recording

    target = output_folder(folder, Path("reports") / f"{campaign.stem}_record")
    files = write_recording(read_campaign(campaign), sample, 1.0 / rate, target)
    print_written(files)
    print_next(next_command.after_recording(campaign, files))


@command()
def allocate(
    campaign: CampaignFile,
    confirm: Annotated[
        int, typer.Option(metavar="N", min=0, help="Simulate the N smallest changes; 0: linear analysis alone.")
    ] = 3,
    examine: Examine = None,
    jobs: Jobs = 2,
    folder: Annotated[Path | None, out_folder("reports/NAME_allocate")] = None,
    form: FormatOption = "table",
) -> None:
    """Find the data-sheet numbers that just meet requirements.

    It changes each number alone, all numbers together and, for type ins, numbers by one grade of the catalogue. Where
    the requirements are met, it shows how much larger numbers may be. Linear answers are scaled by a simulation of the
    campaign. The smallest changes are simulated.

    Example: mcnav allocate campaigns/19_flight_with_gnss.toml
    """
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import allocate as tables
    from mcnav.report.terminal import progress
    from mcnav.studies.allocate import write_allocation

    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_allocate")
        result, files = write_allocation(campaign, target, shown, confirm, jobs, examine)
    if form != "table":
        print_rows(form, [vars(row) for row in tables.change_rows(result)], tables.table(result))
        return
    out.print(printed(tables.terminal(result)), soft_wrap=False)
    out.print()
    print_written(files)
    print_next(next_command.after_allocation(campaign, result))


@command()
def tune(
    campaign: CampaignFile,
    cost: Annotated[
        Literal["requirement", "sigma"] | None,
        typer.Option(help="What to keep small [default: the worst requirement, else the mean filter sigma]."),
    ] = None,
    confirm: Annotated[
        bool, typer.Option("--confirm/--no-confirm", help="Simulate the setting closest to optimistic.")
    ] = True,
    samples: Annotated[
        int | None, typer.Option("--samples", "-n", min=2, help="Samples of it [default: the file's].")
    ] = None,
    examine: Examine = None,
    jobs: Jobs = 2,
    folder: Annotated[Path | None, out_folder("reports/NAME_tune")] = None,
) -> None:
    """Find filter settings that stay consistent over ranges of specs.

    With these settings the filter sigmas bound the true errors at every point of the ranges, at all times. The command
    prints the table [filter.believes] to paste, by how much each sigma is inflated, and what that costs.

    Example: mcnav tune campaigns/40_range_with_a_drift.toml --no-confirm
    """
    from mcnav.config.read import read_campaign
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import tune as tables
    from mcnav.report.terminal import progress
    from mcnav.studies.tune import tune as find_beliefs
    from mcnav.studies.tune import write_tuning

    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_tune")
        result = find_beliefs(read_campaign(campaign), cost, confirm, samples, jobs, shown, examine)
        files = write_tuning(result, target)
    out.print(printed(tables.terminal(result)), soft_wrap=False)
    if result.believes:
        out.print()
        out.print(tables.pasted(result), markup=False, highlight=False)
    out.print()
    print_written(files)
    print_next(next_command.written("lincov", campaign))


@command("filters", resumes=True)
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
    samples: Annotated[
        int | None, typer.Option("--samples", "-n", min=1, help="Samples of each run [default: the campaign's].")
    ] = None,
    jobs: Jobs = 2,
    folder: Annotated[Path | None, out_folder("reports/NAME_filters")] = None,
    form: FormatOption = "table",
) -> None:
    """Compare kinds of filters by Monte Carlo.

    All kinds have the same initial errors, sensor errors and noise. A table has the verdict on each kind, its NEES,
    sigmas and cost. --vary finds the value from which on each kind is optimistic.

    Example: mcnav filters campaigns/32_alignment_in_motion.toml --vary errors.heading="3, 10, 30 deg"
    """
    from mcnav.config.sweep_values import split_varied
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import filter_kinds as tables
    from mcnav.report.terminal import progress
    from mcnav.studies.compare_filters import FilterPlan, compare_filters

    plan = FilterPlan(kind or (), split_varied(vary or ()), samples, jobs)
    with progress.shown(err) as shown:
        target = output_folder(folder, Path("reports") / f"{campaign.stem}_filters")
        result, files = compare_filters(campaign, plan, target, shown)
    if form != "table":
        print_rows(form, tables.frame(result).to_dict("records"), {"filters": tables.table(result)})
        return
    out.print(printed(tables.terminal(result)), soft_wrap=False)
    out.print()
    print_written(files)
    print_next(next_command.written("show", target / result.results[-1].folder))


@command()
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
        str | None, typer.Option("--from", metavar="TIME", help="Begin of the part used, from the first reading.")
    ] = None,
    end: Annotated[
        str | None, typer.Option("--to", metavar="TIME", help="End of the part used, from the first reading.")
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
        Path | None, typer.Option("--out", "-o", help="Also write a page, identify.json and imu.toml into a folder.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Print intervals, tests, grades and the table [imu] as well.")
    ] = False,
    form: FormatOption = "table",
) -> None:
    """Identify the noise of an inertial unit from logs at rest.

    Every value has an interval, and the model a test of fit. Several logs of one unit give their common noise, and how
    the bias changes from one turn-on to the next.

    Example: mcnav identify static.csv --unit gyro=deg/s --out reports/unit
    """
    from mcnav.files.whole import write_texts
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages.identify import terminal
    from mcnav.studies.identify import files_of, identification_table, identify_logs, read_plan

    columns = columns_of(column, "--column", "NAME=COLUMN such as gyro_x=wx")
    units = columns_of(unit, "--unit", "NAME=UNIT such as gyro=deg/s")
    with options_in_messages():
        report = identify_logs(logs, read_plan(columns, units, interval, begin, end, below, campaign))
    if form == "table":
        out.print(printed(terminal(report, full)), soft_wrap=False)
    else:
        print_rows(form, [vars(row) for row in report.parameters], identification_table(report))
    if folder is not None:
        out.print()
        print_written(write_texts(output_folder(folder, folder), files_of(report)))
    if form == "table":
        print_next(next_command.after_identification(logs, folder, campaign))
