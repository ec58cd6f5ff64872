"""Commands to start with: a demonstration, a new campaign, its check, its run, the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mcnav.cli import next_command
from mcnav.cli import shell_completion as completion
from mcnav.cli.options import (
    CampaignFile,
    Engine,
    FormatOption,
    Into,
    Name,
    NamedColumns,
    Platform,
    Scheduler,
    TemplateType,
    columns_of,
    options_in_messages,
    run_folder,
)
from mcnav.cli.output_place import output_file, output_folder
from mcnav.cli.printing import (
    Format,
    err,
    open_page,
    out,
    print_line,
    print_next,
    print_notes,
    print_rows,
    print_written,
)
from mcnav.cli.program import CHECK_FAILED, SOME_FAILED, command, failure, new
from mcnav.docs.pages import PAGES, page_text

if TYPE_CHECKING:
    from mcnav.analysis.remedies import Remedies
    from mcnav.config.read import Campaign
    from mcnav.report.results.model import RunAnalysis
    from mcnav.workflow.run import Run


@command(resumes=True)
def run(
    campaign: CampaignFile,
    folder: Annotated[Path | None, typer.Option("--out", "-o", help="Run folder [default: reports/NAME].")] = None,
    engine: Engine = None,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Parallel jobs [default: 2].")] = None,
    dask: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Simulate in N processes of a local dask cluster.")
    ] = None,
    scheduler: Scheduler = None,
    samples: Annotated[
        int | None, typer.Option("--samples", "-n", min=2, help="Number of samples [default: the file's].")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed [default: the file's].")] = None,
    at: Annotated[
        Literal["worst", "nominal"] | None,
        typer.Option(help="Of ranges: the worst setting, or all upper ends [default: worst]."),
    ] = None,
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
    known_ways: Annotated[
        bool,
        typer.Option("--known-ways", help="With --check, also accept what is met only for the known ways to fail."),
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

    Exit status: 0 success, 1 a requirement is not met or undecided (with --check), 2 bad input.
    3 some samples failed, 4 folder in use, 130 interrupted.

    Example: mcnav run campaigns/11_cruise.toml --samples 1000
    """
    from mcnav.config.read import read_campaign
    from mcnav.physics.units import UnitError, quantity
    from mcnav.report.terminal import progress
    from mcnav.runner.executors import open_executor
    from mcnav.workflow.run import engine_of, run_campaign

    try:
        quantity(timeout or "1 s", "s")
    except UnitError as wrong:
        raise failure(f"--timeout: {wrong}") from None
    options = {"samples": samples, "seed": seed, "sample_timeout": timeout, "store": store}
    given = {key: value for key, value in options.items() if value is not None}
    content = read_campaign(campaign, given)
    if content.ranges or at is not None:
        from mcnav.studies.boxed_run import campaign_to_run

        content = campaign_to_run(content, at, given)
    print_notes(content.remarks)
    if check and not content.requirements:
        raise failure(f"{campaign}: accept: is missing; --check needs requirements")
    if known_ways and not check:
        raise failure("--known-ways: belongs to --check; add --check")
    if show and no_report:
        raise failure("--open: shows the report; leave out --no-report")
    target = output_folder(folder, run_folder(campaign))
    chosen = engine or engine_of(target, campaign)
    with open_executor(scheduler, dask, jobs) as (executor, workers, notes), progress.shown(err) as shown:
        done = run_campaign(
            content, target, chosen, workers, fresh, shown, max_failures, executor, force, not no_report, _advise
        )
    print_notes((*notes, *done.notices))
    _print_run(content.name, done, target, form, with_report=not no_report)
    if show:
        open_page(target / "report.html")
    if form == "table":
        print_next(next_command.after_run(campaign, target, done.results, not no_report, show))
    accepted = ("met", "met for the known ways") if known_ways else ("met",)
    if check and any(entry.finding not in accepted for entry in done.results.requirements):
        raise typer.Exit(CHECK_FAILED)
    if done.results.failed:
        raise typer.Exit(SOME_FAILED)


def _advise(campaign: Campaign, content: RunAnalysis) -> Remedies | None:
    """Find what would help a run in which something fails; no other run needs the modules."""
    from mcnav.studies.run_remedies import advise_run

    return advise_run(campaign, content)


def _print_run(name: str, done: Run, target: Path, form: Format, with_report: bool) -> None:
    """Print the results of a run, and where they are."""
    from mcnav.report.columns import output_columns, requirements
    from mcnav.report.exports import export
    from mcnav.report.terminal import terminal

    summary, runs = done.results, {name: done.results}
    console = out if form == "table" else err
    if form != "table":
        rows, asked = output_columns.output_rows(runs), requirements.requirements_table(summary)
        print_rows(form, rows, {"runs": export.run_rows(runs), "outputs": rows, "requirements": asked.rows})
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


@command(resumes=True)
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

    Its run folder is in reports/ of the current folder.

    Example: mcnav demo 14
    """
    from mcnav.entries.examples import copy_examples, example, examples

    if listed:
        for each, question in examples().items():
            print_line(f"{each}\n    {question}")
        print_next(next_command.written("demo", next(iter(examples()))))
    elif copy is not None:
        print_line(f"{len(copy_examples(copy))} files\n\nwritten: {copy}")
        print_next(next_command.written("run", copy / f"{next(iter(examples()))}.toml"))
    else:
        _run_example(example(name))


def _run_example(campaign: Path) -> None:
    """Run an example into its usual folder, and print its answer on one screen."""
    from mcnav.config.read import read_campaign
    from mcnav.report.terminal import answer_screen, progress
    from mcnav.runner.executors import open_executor
    from mcnav.store.run_folder import RunFolder
    from mcnav.workflow.run import engine_of, run_campaign

    content = read_campaign(campaign, {})
    target = output_folder(None, run_folder(campaign))
    with open_executor(None, None, None) as (executor, workers, notes), progress.shown(err) as shown:
        done = run_campaign(
            content, target, engine_of(target, campaign), workers, progress=shown, executor=executor, advise=_advise
        )
    print_notes((*notes, *done.notices))
    stored, program = RunFolder(target), next_command.program()
    execution, epochs = stored.finished_manifest().execution, stored.epochs()
    closing = (f"Report:   {target / 'report.html'}", f"Look:     {program} report {target} --open",
               f"Your own: {program} new ins NAME")  # fmt: skip
    seconds = execution.seconds if execution is not None and done.simulated else None
    out.print(answer_screen.screen(done.results, {} if epochs is None else epochs[0], seconds, closing))
    if done.results.failed:
        raise typer.Exit(SOME_FAILED)


@command("check")
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
    trajectory: Annotated[
        bool, typer.Option("--trajectory", help="Describe the trajectory of FILE: rows, ranges, forces, turn rates.")
    ] = False,
    page: Annotated[
        Path | None, typer.Option("--out", "-o", help="Of --trajectory: also write a page, a folder or .html file.")
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Check a campaign, the code of a scenario, or a trajectory.

    Of campaigns and scenarios it checks shapes, units and linearity near zero; of code of your own determinism and
    partials against differences as well. Of a trajectory it checks whether it can be flown, and its heading against its
    track. For a class of your own it says how long a run takes. It writes nothing, but keeps a measured covariance of
    noise. --trajectory describes a trajectory file, a track, or the trajectory of a campaign of type ins instead.

    Exit status: 0 all checks passed, 1 a check failed, 2 bad input.

    Example: mcnav check campaigns/14_polar.toml
    """
    if trajectory:
        _describe_trajectory(file, columns_of(column), page, form)
        return
    if page is not None or form != "table":
        raise failure(f"--{'format' if page is None else 'out'}: belongs to --trajectory; leave it out")
    from mcnav.execution.progress import Phase
    from mcnav.report.terminal import progress, terminal
    from mcnav.workflow.check import check_any

    with progress.shown(err) as shown:
        shown.phase(Phase.CHECKING)
        checked = check_any(file, columns_of(column))
    for place, subject in enumerate(checked):
        if place:
            out.print()
        out.print(terminal.checks(subject.title, [(check.name, check.passed, check.told) for check in subject.checks]))
    passed = all(check.passed for subject in checked for check in subject.checks)
    print_next(next_command.after_check(file, checked[0].campaign, passed))
    if not passed:
        raise typer.Exit(CHECK_FAILED)


def _describe_trajectory(file: Path, columns: dict[str, str], page: Path | None, form: Format) -> None:
    """Describe the trajectory of a file or of a campaign, and how well its velocities agree with its positions."""
    from mcnav.files.whole import write_texts
    from mcnav.report.document.html import page_html
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages import trajectory as described
    from mcnav.workflow.trajectory import describe_campaign, describe_file

    if file.suffix == ".toml" and columns:
        raise failure("--column: belongs to a trajectory file; the campaign names its columns itself")
    target = None if page is None else output_file(page, f"{file.stem}_trajectory.html", [".html"])
    if file.suffix == ".toml":
        result = describe_campaign(file)
    else:
        with options_in_messages():
            result = describe_file(file, columns)
    if form != "table":
        rows = [vars(row) for row in described.fact_rows(result)]
        print_rows(form, rows, {"trajectory": rows})
    else:
        out.print(printed(described.terminal(result)), soft_wrap=False)
    if target is not None:
        print_written(write_texts(target.parent, {target.name: page_html(described.page(result))}))
    if form == "table":
        print_next(next_command.after_trajectory(file))


@command("campaign", new)
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
    print_written((written, *write_schema(written.parent)))
    print_next(next_command.written("run", written))


@command("ins", new)
def new_ins(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name or path of the file; .toml may be left out.")],
    unit: Annotated[
        str,
        typer.Option(
            "--imu",
            metavar="UNIT",
            help="Grade or unit of the catalogue; mcnav docs imu lists them.",
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
    platform: Annotated[Platform, typer.Option(help="Mounting of the instruments.")] = "strapdown",
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

    wanted = NewIns(unit, tuple(aid or ()), platform, trajectory, columns_of(column))
    with options_in_messages():
        (written,) = new_ins(name, into, wanted)
    print_written((written, *write_schema(written.parent)))
    print_next(next_command.written("run", written))


@command("scenario", new)
def new_scenario(
    name: Name,
    stochastic: Annotated[bool, typer.Option("--stochastic", help="With noise and errors over time.")] = False,
    closed_loop: Annotated[
        bool, typer.Option("--closed-loop", help="A vehicle that steers by its own navigation.")
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
    print_written((code, campaign, test, *write_schema(code.parent)))
    print_next(f"{next_command.written('run', campaign)}, then change {method} in {code}")


@command()
def docs(
    page: Annotated[
        str,
        typer.Argument(
            metavar="PAGE",
            help="Page to show; the guide lists all, imu is the catalogue of units.",
            autocompletion=lambda incomplete: [name for name in (*PAGES, "imu") if name.startswith(incomplete)],
        ),
    ] = "guide",
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Of imu: a grade or unit, such as navigation or STIM300 [default: all].",
            autocompletion=completion.for_words(completion.units_of_page),
        ),
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Show a page of the documentation, or the catalogue of units.

    The page imu lists the catalogue of inertial measurement units; with NAME, the values of one with their sources. A
    campaign takes a unit with grade = "NAME" in [imu].

    Example: mcnav docs imu navigation
    """
    if page == "imu":
        _show_units(name, form)
        return
    if name is not None or form != "table":
        raise failure(f"{name or '--format'}: belongs to the page imu; leave it out")
    if page not in PAGES:
        from mcnav.errors import did_you_mean, near_names
        from mcnav.physics.units import printable

        near = did_you_mean(near_names(page, [*PAGES, "imu"])) or ";"
        raise failure(f"PAGE: {printable(page)!r} is unknown{near} mcnav docs lists all")
    text = page_text(page)
    if out.is_terminal:
        from rich.markdown import Markdown

        with out.pager(styles=True):
            out.print(Markdown(text))
    else:
        print_line(text)


def _show_units(name: str | None, form: Format) -> None:
    """List the catalogue of inertial measurement units, or the values of one with their sources."""
    from mcnav.errors import suggestion
    from mcnav.report.document.terminal_parts import fitted
    from mcnav.report.terminal import instruments
    from mcnav.systems.ins.tables.imu_catalogue import catalogue_units

    units = {unit.name: unit for unit in catalogue_units()}
    if name is not None and name not in units:
        raise failure(f"NAME: no grade or unit {name!r}{suggestion(name, list(units))}")
    values = [
        instruments.value_row(unit.name, value.instrument, value.key, value.text, value.unit, value.source)
        for unit in (units.values() if name is None else [units[name]])
        for value in unit.values
    ]
    if form != "table":
        rows = [vars(value) for value in values]
        print_rows(form, rows, {"values": rows})
    elif name is None:
        out.print(fitted(instruments.catalogue({unit.name: unit.title for unit in units.values()}, values)))
        print_next(next_command.written("docs", "imu", next(iter(units))))
    else:
        out.print(fitted(instruments.values(units[name].title, values)))
        print_next(next_command.written("new", "ins", "mine", "--imu", name))
