"""Commands that show runs: their results, reports, figures, and a live page."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from mcnav.cli import next_command
from mcnav.cli import shell_completion as completion
from mcnav.cli.options import (
    CampaignFile,
    Folder,
    Folders,
    FormatOption,
    PerhapsFolders,
    UnitsOption,
    out_folder,
)
from mcnav.cli.output_place import output_file, output_folder
from mcnav.cli.printing import (
    err,
    open_page,
    opened_in_secret,
    out,
    print_line,
    print_next,
    print_notes,
    print_rows,
    print_written,
    write_data,
)
from mcnav.cli.program import CHECK_FAILED, command, failure


@command()
def report(
    folders: PerhapsFolders = None,
    index: Annotated[
        Path | None,
        typer.Option("--index", metavar="FOLDER", help="List all runs of this folder and below it on its index.html."),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the pages in the browser.")] = False,
    remedies: Annotated[
        bool, typer.Option("--remedies", help="Compute every remedy where something fails; simulate the best.")
    ] = False,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="Of --remedies: campaign file, needed for code of your own.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Of --remedies: parallel jobs.")] = 2,
) -> None:
    """Analyse finished runs again, write their reports, or list runs.

    Nothing is simulated unless --remedies is given.

    Example: mcnav report reports/11_cruise --open
    """
    from mcnav.report.terminal import progress
    from mcnav.workflow.analyse import report_run

    if not folders and index is None:
        raise failure("mcnav report needs a run folder, or --index with a folder of runs")
    for folder in folders or ():
        if remedies:
            from mcnav.studies.run_remedies import add_remedies

            with progress.shown(err) as shown:
                add_remedies(folder, campaign, jobs, shown)
        else:
            report_run(folder)
        written = folder / "report.html"
        print_line(f"report: {written}")
        if show:
            open_page(written)
    if index is not None:
        _list_runs(index, show)
    elif folders:
        print_next(next_command.written("compare" if len(folders) > 1 else "show", *folders))


def _list_runs(folder: Path, show: bool) -> None:
    """Write the list of all runs of a folder; open it."""
    from mcnav.workflow.index import write_index

    page, count, foremost = write_index(folder)
    print_line(f"{count} runs\n\nwritten: {page}")
    if show:
        open_page(page)
    print_next(next_command.after_index(foremost))


@command()
def show(
    folder: Folder,
    table: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only this table, such as outputs, budget or requirements.")
    ] = None,
    units: UnitsOption = "shown",
    form: FormatOption = "table",
) -> None:
    """Show verdicts, sigmas, budget and requirements of a run.

    All numbers are read from the run folder's summary, those of a filter too. Nothing is simulated.

    Example: mcnav show reports/mine --table budget --format csv
    """
    from mcnav.workflow.show import show_run

    text, shown = show_run(folder, table, units, form)
    write_data(text, form)
    if shown is not None:
        out.print(shown, soft_wrap=False)
        print_next(next_command.after_show(folder, table))


@command()
def export(
    folder: Folder,
    into: Annotated[
        Path | None, typer.Option("--out", "-o", help="Output folder [default: RUN_export]; of --figure, a file.")
    ] = None,
    units: UnitsOption = "shown",
    figure: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Draw only this figure of the report, such as scatter, as .pdf, .svg or .png.",
            autocompletion=completion.for_words(completion.figures),
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Of --figure: width and height, such as 88x60mm [default: the page's]."),
    ] = None,
    width: Annotated[float | None, typer.Option(min=2.0, max=100.0, help="Of --figure: width alone, cm.")] = None,
    font_scale: Annotated[
        float, typer.Option(min=0.2, max=5.0, help="Of --figure: size of text over the page's.")
    ] = 1.0,
    panel: Annotated[
        list[str] | None, typer.Option(metavar="TITLE", help="Of --figure: only this panel, such as altitude; repeat.")
    ] = None,
    columns: Annotated[int | None, typer.Option(min=1, max=10, help="Of --figure: panels side by side.")] = None,
    flight: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write only the flight with its covariance, as .czml or .mcap."),
    ] = None,
) -> None:
    """Write a run as CSV, one figure for a paper, or its flight.

    The tables come with the matrices for numpy and MATLAB. With --figure, one figure is drawn at the size that a paper
    needs. With --flight, true and navigated positions and their covariance are written for Cesium (.czml) or for
    Foxglove and PlotJuggler (.mcap).

    Example: mcnav export reports/mine --figure scatter --size 88x60mm --out scatter.pdf
    """
    if figure is not None:
        _draw(folder, figure, into or Path(), PaperSize(size, width, font_scale, columns), panel or ())
        return
    from mcnav.report.exports.viewers import WRITERS
    from mcnav.workflow.export import default_folder, export_flight, export_run

    if flight is not None:
        try:
            print_written([export_flight(folder, output_file(flight, "flight.mcap", tuple(WRITERS), "--flight"))])
        except ImportError as missing:
            raise failure(str(missing)) from None
        return
    print_written(export_run(folder, output_folder(into, default_folder(folder)), units))
    print_next(next_command.written("docs", "howto-export"))


@dataclass(frozen=True)
class PaperSize:
    """Size of a drawn figure: ``WxH`` or a width in cm, text relative to the page's, panels side by side."""

    size: str | None
    width: float | None
    font_scale: float
    columns: int | None


def _draw(folder: Path, name: str, into: Path, paper: PaperSize, panels: Sequence[str]) -> None:
    """Draw a figure of a run's report into a file, or as NAME.pdf into a folder."""
    from mcnav.report.drawing.paper import read_size
    from mcnav.workflow.figure import ENDINGS, draw_figure

    try:
        wide, high = (paper.width, None) if paper.size is None else read_size(paper.size)
    except ValueError as wrong:
        raise failure(f"--size: {wrong}") from None
    file = output_file(into, f"{name}.pdf", ENDINGS)
    file.parent.mkdir(parents=True, exist_ok=True)
    print_notes(draw_figure(folder, name, file, wide, high, paper.font_scale, panels, paper.columns))
    print_written([file])
    print_next(next_command.written("export", folder))


@command()
def brief(
    folder: Folder,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="The run's campaign file; needed for advice on code of your own.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel jobs.")] = 2,
    into: Annotated[Path | None, out_folder("RUN_brief")] = None,
) -> None:
    """Write a run on one slide and one sheet for a review board.

    A page and two PDF files: requirements with margin and confidence first, then the worst case and causes. Where
    something fails they say what would help, the best of it simulated.

    Example: mcnav brief reports/mine
    """
    from mcnav.report.terminal import progress
    from mcnav.studies.brief import default_folder, write_brief

    target = output_folder(into, default_folder(folder))
    with progress.shown(err) as shown:
        written = write_brief(folder, target, campaign, shown, jobs)
    print_written(written)
    print_next(next_command.written("report", folder, "--open"))


@command()
def compare(
    folders: Folders,
    html: Annotated[
        Path | None,
        typer.Option("--out", "-o", "--html", help="Also write a page: a folder, or a file ending in .html."),
    ] = None,
    form: FormatOption = "table",
) -> None:
    """Compare runs: inputs, sigmas, verdicts, error budgets.

    It shows the inputs that differ and the change of each output from the first run, with intervals. Runs with the
    same seed, design and sources are compared on common draws.

    Example: mcnav compare reports/11_cruise reports/other --out reports
    """
    from mcnav.analysis.summary import Summary
    from mcnav.errors import reading_file
    from mcnav.files.whole import write_whole
    from mcnav.report.columns.output_columns import output_rows
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.exports import export
    from mcnav.report.pages import comparison
    from mcnav.report.terminal import terminal
    from mcnav.report.terminal.show import escaped
    from mcnav.workflow.compare import compare_runs, compared_summary, page_name

    page = None if html is None else output_file(html, page_name(folders), [".html"])
    runs, verdicts = dict[str, Summary](), []
    for name, summary in {str(folder): compared_summary(folder) for folder in folders}.items():
        with reading_file(Path(name) / "summary.json"):
            runs[name] = shown = Summary.of(escaped(summary))
            terminal.comparison({name: shown})
            verdicts.append((f"\n{name}: {shown.campaign}", terminal.verdict(shown)))
    result = compare_runs(folders)
    console = out if form == "table" else err
    if (warning := terminal.warnings(runs)) is not None:
        console.print(warning)
    if form != "table":
        rows = output_rows(runs)
        tables: dict[str, Any] = {"runs": export.run_rows(runs), "outputs": rows}
        tables["outputs"] = rows = export.with_changes(rows, list(runs), result.rows)
        changed = result.inputs.set_axis(list(runs), axis="columns")
        tables["inputs"] = [{"key": key, **dict(values)} for key, values in changed.iterrows()]
        print_rows(form, rows, tables)
    else:
        console.print(terminal.comparison(runs))
        for heading, verdict in verdicts:
            console.print(heading, markup=False, style="bold")
            console.print(verdict, soft_wrap=False)
        console.print()
        parts = comparison.terminal(result.titles, result.manifests, result.rows, result.confidence)
        console.print(printed(parts), soft_wrap=False)
    if page is not None:
        page.parent.mkdir(parents=True, exist_ok=True)
        write_whole(page, result.page.encode())
        console.print(f"\nwritten: {page}", markup=False)
    if form == "table":
        print_next(next_command.after_comparison(folders, page))


@command()
def replay(
    folder: Folder,
    index: Annotated[int | None, typer.Argument(metavar="INDEX", min=0, help="Sample index.")] = None,
    fail: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Instead of a sample, simulate the likeliest failure of requirement N, at its limit.",
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            help="Campaign file of the run; needed for a scenario in your own code.",
            autocompletion=completion.campaigns,
        ),
    ] = None,
    into: Annotated[Path | None, out_folder("the run folder")] = None,
) -> None:
    """Simulate one sample of a run again, with its history.

    It writes errors, outcome and history as a page and a CSV file. --fail N simulates the likeliest failure of
    requirement N, where the requirement is beyond counting.

    Exit status: 0 the outcome is as stored, 1 it is different, 2 bad input.

    Example: mcnav replay reports/11_cruise 12
    """
    from mcnav.report.document.terminal_parts import printed
    from mcnav.report.pages.replay import terminal
    from mcnav.workflow import replay as replaying

    if (index is None) == (fail is None):
        raise failure("mcnav replay needs the index of a sample, or --fail with the number of a requirement")
    if fail is None:
        result = replaying.replay(folder, index or 0, campaign)
    else:
        result = replaying.replay_failure(folder, fail, campaign)
    print_notes(result.notes)
    out.print(printed(terminal(result)), soft_wrap=False)
    out.print()
    print_written(replaying.write_replay(result, output_folder(into, folder)))
    print_next(next_command.written("show", folder))
    if not replaying.as_stored(result):
        raise failure(f"the outcome of sample {index} differs from the stored one", CHECK_FAILED)


@command()
def live(
    campaign: CampaignFile,
    folder: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder of runs [default: reports/NAME_live].")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page [default: a free one].")] = 0,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel jobs of a run.")] = 2,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Show a campaign on a page that answers while it is changed.

    It is the page of mcnav lincov with sliders. It follows the campaign's file and re-tunes the filter when a slider is
    released. It keeps the last settings side by side, and confirms them by Monte Carlo. Its server listens on this
    machine alone, at a secret address. Ctrl-C ends it.

    Example: mcnav live campaigns/19_flight_with_gnss.toml --open
    """
    from mcnav.execution.interrupts import until_interrupted
    from mcnav.studies.live import LiveCampaign
    from mcnav.studies.live_server import LiveServer, answer_requests

    target = output_folder(folder, Path("reports") / f"{campaign.stem}_live")
    with LiveServer(port) as server, until_interrupted():
        content = LiveCampaign(campaign, target, jobs)
        print_line(f"page: {server.address}\nCtrl-C ends it")
        with opened_in_secret(server.address, target) if show else nullcontext():
            answer_requests(content, server)
    print_next(next_command.written("run", campaign))
