"""What is shown of numbers: no width shortens one, estimates that belong together stand together, colour is earned."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import mcnav
from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.tails import tails
from mcnav.analysis.verdict import Verdict, judge
from mcnav.contract.quantities import Output, Source
from mcnav.report.columns.output_columns import output_rows
from mcnav.report.document.fitted_table import TALLEST, Column, FittedTable, OpenConsole
from mcnav.report.exports.export import partial_rows
from mcnav.report.figures.matrices import certain_differences
from mcnav.report.statements import details
from mcnav.report.statements.words import more_samples
from mcnav.report.terminal import terminal
from mcnav.statistics.power import SMALLEST_STEP, sensible_step
from mcnav.workflow.stored_summary import stored_summary
from tests.commands import in_process

WIDTHS = (20, 40, 60, 80, 100, 200)

NINE = '''
import numpy as np

from mcnav import Output, Source

OUTPUTS = ("x", "y", "z", "x_rate", "y_rate", "z_rate", "roll_misalignment", "pitch_misalignment", "still")


class Nine:
    """Nine outputs of three errors, one bent, one that nothing disturbs."""

    sources = tuple(Source(name, "m", "km", 1000.0) for name in ("first", "second_of_them", "third"))
    outputs = tuple(Output(name, "m", "km") for name in OUTPUTS)

    def propagate(self, errors):
        a, b, c = errors.T
        return np.column_stack(
            [a, b, c, a - 123.4 * b, 1e-3 * c + a**2 / 5e4, -b, a + b + c, 7.0 * c - 0.1 * b, 0.0 * a + 4.0]
        )
'''

NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*\.?\d*(?:e[+-]\d+)?(?![\w.])")


@pytest.fixture(scope="module")
def nine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of a scenario with nine outputs, its campaign beside it."""
    place = tmp_path_factory.mktemp("nine")
    (place / "nine.py").write_text(NINE)
    errors = "\n".join(f'{name} = "1 km"' for name in ("first", "second_of_them", "third"))
    (place / "nine.toml").write_text(
        f'name = "nine"\nsamples = 400\nseed = 5\n\n[scenario]\ntype = "nine.py:Nine"\n\n[errors]\n{errors}\n'
    )
    mcnav.run(place / "nine.toml", place / "run")
    mcnav.run(place / "nine.toml", place / "other", seed=6)
    return place


def printed(renderable: object, width: int, pipe: bool = False) -> str:
    """What a terminal of a width, or a pipe, shows."""
    console = OpenConsole(
        file=io.StringIO(), force_terminal=not pipe, color_system=None, width=width, highlight=False, soft_wrap=True
    )
    console.print(renderable)
    shown = console.file.getvalue()
    assert "…" not in shown
    if not pipe:
        assert max(map(len, shown.splitlines())) <= width
    return shown


def left_out(shown: str) -> str:
    """Columns that a table says that it leaves out."""
    found = re.search(r"not shown at this width: (.*?); see report.html or --format csv", " ".join(shown.split()))
    return found[1] if found else ""


@pytest.mark.parametrize("width", WIDTHS)
def test_no_width_shortens_a_number_of_the_comparison(nine: Path, width: int) -> None:
    """Every number of its rows stands in the table to the digits shown, or its column is named as left out."""
    summary = stored_summary(nine / "run")
    rows = output_rows({"nine": summary})
    shown = printed(terminal.comparison({"nine": summary}), width)
    numbers, gone = set(NUMBER.findall(shown)), left_out(shown)
    for row in rows:
        for kind in ("linear", "paired", "plain"):
            if kind != "plain" or "plain σ" not in gone:
                assert f"{row[f'sigma_{kind}']:.5g}" in numbers
        for kind in ("paired", "plain"):
            if row[f"ratio_{kind}"] is None:
                continue
            if f"{kind} ratio" not in gone:
                assert f"{row[f'ratio_{kind}']:.4f}" in numbers
            if f"{kind} interval" not in gone:
                assert f"{row[f'ratio_{kind}_from']:.4f} to {row[f'ratio_{kind}_to']:.4f}" in shown
    assert "paired" not in gone
    assert "linear" not in gone


@pytest.mark.parametrize("width", WIDTHS)
def test_no_width_shortens_a_partial_derivative(width: int) -> None:
    """Nine outputs by ten sources of any size."""
    sources = tuple(Source(f"source_{j}", "m", "m", 1.0) for j in "abcdefghij")
    outputs = tuple(Output(f"output_named_{i}", "m", "km") for i in "abcdefghi")
    matrix = np.random.default_rng(1).standard_normal((9, 10)) * 10.0 ** np.arange(-12, 15, 3)[:, None]
    numbers = NUMBER.findall(printed(terminal.partials(sources, outputs, matrix), width))
    expected = [f"{row['partial']:.7g}" for row in partial_rows(sources, outputs, matrix)]
    assert sorted(numbers) == sorted(expected)
    for share in terminal.agreement(outputs, {"runs": np.abs(matrix[:, 0])}).rows[0][1:]:
        assert share.plain in printed(terminal.agreement(outputs, {"runs": np.abs(matrix[:, 0])}), width).split()


def test_into_a_pipe_the_width_is_unlimited(nine: Path) -> None:
    """One line for each output, with every column, whatever the width said to be."""
    summary = stored_summary(nine / "run")
    shown = printed(terminal.comparison({"nine": summary}), 30, pipe=True)
    assert len(shown.splitlines()) == 2 + 9
    assert "plain interval" in shown
    assert left_out(shown) == ""
    done = in_process("compare", nine / "run", columns=30)
    assert shown.splitlines()[2] in done.stdout
    assert details.explanation(summary) in done.stdout


def test_a_table_of_texts_is_folded_between_words() -> None:
    table = FittedTable("", [Column("found", text=True), Column("requirement", text=True)], keys=2)
    table.add("undecided", "|altitude| below 12.3456789 km in 99.73 % of samples")
    for width in WIDTHS:
        assert {"undecided", "12.3456789", "99.73"} <= set(printed(table, width).split())


def test_no_text_of_a_table_is_taller_than_the_limit() -> None:
    """A long text beside others becomes a record's line; one that fits within the limit stays in its column."""
    for words, in_columns in ((5 * TALLEST, True), (20 * TALLEST, False)):
        table = FittedTable("", [Column("requirement", text=True), Column("causes", text=True)])
        table.add("position " * 4, "gyro " * words)
        shown = printed(table, 80)
        assert ("causes: gyro" not in shown) == in_columns
        assert shown.count("gyro") == words
    texts = [Column(name, text=True) for name in ("requirement", "finding", "causes")]
    for words in range(1, 200, 7):
        table = FittedTable("", texts)
        table.add("position north", "met", "gyro " * words)
        lines = printed(table, 80).splitlines()
        assert len(lines) <= 1 + TALLEST or any("causes: " in line for line in lines)


def test_each_cause_has_a_line() -> None:
    """Where a list of shares does not fit beside the others; in a pipe it stays on one line."""
    table = FittedTable("", [Column("output", text=True), Column("sigma"), Column("causes", text=True)])
    causes = "gyro angle random walk y 27.1 %, gnss position noise east 11 %"
    table.add("position north", "0.44", causes)
    assert causes in printed(table, 30, pipe=True)
    lines = printed(table, 60).splitlines()
    assert [line[line.index("g", 20) :].strip() for line in lines[1:]] == causes.replace(" %, ", " %\n").split("\n")


@pytest.mark.parametrize("command", ["run", "compare", "two", "partials"])
def test_machine_readable(nine: Path, command: str) -> None:
    """CSV and JSON stand alone on stdout, hold the same rows in full precision, and use the keys of campaign files."""
    run, campaign = str(nine / "run"), str(nine / "nine.toml")
    arguments = {
        "run": ["run", campaign, "--out", run],
        "compare": ["compare", run],
        "two": ["compare", run, str(nine / "other")],
        "partials": ["partials", campaign, "--method", "differences"],
    }[command]
    written = {form: in_process(*arguments, "--format", form) for form in ("csv", "json")}
    assert [done.exit_code for done in written.values()] == [0, 0]
    from_csv = list(csv.DictReader(io.StringIO(written["csv"].stdout)))
    tables = json.loads(written["json"].stdout)
    rows = tables["partials" if command == "partials" else "outputs"]
    assert len(from_csv) == len(rows) == {"partials": 27, "two": 18}.get(command, 9)
    for row, text in zip(rows, from_csv, strict=True):
        assert {key: "" if row.get(key) is None else str(row[key]) for key in text} == text
    assert rows[-1]["output"] == "still"
    assert {row["output"] for row in rows} >= {"x_rate", "roll_misalignment"}
    if command == "run":
        assert "report: " in written["csv"].stderr
    if command == "partials":
        assert {row["source"] for row in rows} == {"first", "second_of_them", "third"}
        assert rows[9]["unit"] == "km per km"
        return
    summary = json.loads((nine / "run" / "summary.json").read_text())
    for kind, sigma, ratio in (
        ("paired", "sigma_paired", "sigma_ratio_paired"),
        ("plain", "sigma_sample", "sigma_ratio"),
    ):
        assert [row[f"sigma_{kind}"] for row in rows[:: len(rows) // 9]] == [value * 1e-3 for value in summary[sigma]]
        assert [row[f"ratio_{kind}"] for row in rows[:: len(rows) // 9]] == summary[ratio]
    if command == "two":
        assert ["change" in row for row in rows] == [False, True] * 9
        assert rows[1]["change_ratio_from"] <= rows[1]["change_ratio"] <= rows[1]["change_ratio_to"]
        assert [entry["key"] for entry in tables["inputs"]] == ["seed"]


def test_partials_of_every_start_time_are_files(nine: Path) -> None:
    done = in_process("sweep", nine / "nine.toml", "--vary", "start", "--format", "csv")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: --format: does not go with --vary start")


def test_paired_sigma_stands_with_the_paired_ratio(nine: Path) -> None:
    """Sigmas and ratio of one line belong together: paired over linear is the ratio shown, to the digits shown."""
    summary = stored_summary(nine / "run")
    table = terminal.comparison({"nine": summary})
    headings = [column.heading for column in table.columns]
    outputs = mcnav.open_run(nine / "run").outputs
    for row, (_, found) in zip(table.rows[:-1], outputs.iloc[:-1].iterrows(), strict=True):
        told = dict(zip(headings, (cell.plain for cell in row), strict=True))
        for kind in ("paired", "plain"):
            ratio = float(told[f"{kind} σ"]) / float(told["linear σ"])
            assert ratio == pytest.approx(float(told[f"{kind} ratio"]), abs=1e-4 * ratio + 5e-5)  # sigmas of 5 digits
            assert found[f"sigma_{kind}"] / found["sigma_linear"] == pytest.approx(found[f"ratio_{kind}"], rel=1e-12)
        assert found["ratio_paired_from"] <= found["ratio_paired"] <= found["ratio_paired_to"]
    assert not np.allclose(outputs["sigma_paired"][:-1], outputs["sigma_plain"][:-1], rtol=1e-3)
    page = (nine / "run" / "report.html").read_text()
    assert re.findall(r'<th scope="col">((?:Linear|Paired|Plain|Monte Carlo) (?:σ|ratio))</th>', page) == [
        "Linear σ", "Paired σ", "Paired ratio", "Plain σ", "Plain ratio",
    ]  # fmt: skip


def test_what_nothing_disturbs_does_not_agree(nine: Path) -> None:
    """It is said in the terminal, the report, the notebook and the comparison; the summary keeps its verdict."""
    words = "no error source acts on it"
    summary = stored_summary(nine / "run")
    assert summary.verdicts[-1] == "agrees"
    assert output_rows({"nine": summary})[-1]["verdict"] == words
    run = mcnav.open_run(nine / "run")
    assert run.outputs["verdict"].iloc[-1] == words
    page = (nine / "run" / "report.html").read_text()
    assert page.count(words) == 2  # card and table
    done = in_process("compare", nine / "run", nine / "other")
    assert done.stdout.count(words) == 3, done.stdout  # twice as a verdict, once as a change
    agreeing = summary.model_copy(update={"verdict": "agrees", "verdicts": ["agrees"] * 9})
    assert "Every other sigma" in details.explanation(agreeing)
    assert details.explanation(agreeing).endswith("No error source acts on still.")


@pytest.mark.parametrize("count", [1, 99, 100, 1_000, 12_345, 1_000_000])
def test_more_samples_are_a_sensible_step_more(count: int) -> None:
    """From a quarter more on, two digits, never less than what is needed, and hardly more."""
    for needed in (1, count + 1, 1.3 * count, 7.777 * count, 123 * count):
        advised = sensible_step(needed, count)
        assert advised >= max(needed, SMALLEST_STEP * count)
        assert advised <= 1.1 * max(needed, SMALLEST_STEP * count) + 1
        assert len(str(advised).rstrip("0")) <= 2
    narrow = judge(1.0401, (1.030, 1.0501), 0.05, 1000)
    assert (narrow.verdict, narrow.samples_needed) == (Verdict.UNDECIDED, 2813)
    assert more_samples(narrow.samples_needed or 0, 1000) == "about 2,900 samples"


RUNS, SAMPLES, FALSE_ALARMS = 200, 1_000, 1e-6


def test_colour_is_not_sampling_error() -> None:
    """Linear systems with normal sources: runs with any red percentile are rare.

    Stated is a false alarm in at most 5 % of runs. Of 200 runs a binomial law of 5 % exceeds the bound here with a
    probability of one in a million.
    """
    partials = np.array([[1.0, 0.5, 0.0], [0.2, -1.0, 0.3], [0.0, 0.4, 2.0], [0.7, 0.7, 0.7]])
    model = Model(partials, np.zeros(4), np.zeros(3), np.eye(3))
    most, red = stats.binom.isf(FALSE_ALARMS, RUNS, 0.05), {0.05: 0, 1e-9: 0}  # with no tolerance to hide behind, too
    for seed in range(RUNS):
        outcomes = np.random.default_rng(seed).standard_normal((SAMPLES, 3)) @ partials.T
        for tolerance in red:
            found = tails(model, outcomes, np.arange(SAMPLES), ["m"] * 4, Criterion(tolerance, 0.95))
            red[tolerance] += any(entry.verdict == Verdict.DIFFERS for entry in found)
    assert max(red.values()) <= most


def test_coloured_differences_are_certain() -> None:
    """Flights with a noise of their own, whose covariance is what linear analysis takes for it: colours are rare."""
    partials = np.array([[1.0, 0.5], [0.2, -1.0], [0.4, 2.0]])
    model = Model(partials, np.zeros(3), np.zeros(2), np.eye(2))
    coloured = 0
    for seed in range(RUNS):
        draws = np.random.default_rng(seed).standard_normal((2, SAMPLES, 2))
        outcomes = (0.8 * draws[0] + 0.6 * draws[1]) @ partials.T  # the same covariance, other draws
        found = compare(model, draws[0], outcomes, Criterion())
        covariance, correlation = certain_differences(found, 0.95)
        coloured += bool(correlation.any())
        assert not np.diag(correlation).any()
        assert np.array_equal(covariance, covariance.T)
    assert coloured <= stats.binom.isf(FALSE_ALARMS, RUNS, 0.05)


def test_what_rounding_leaves_of_a_correlation_is_no_difference() -> None:
    """Of linear flights with the errors of linear analysis, differences are of some 1e-16, without an interval."""
    partials = np.array([[1.0, 0.5], [0.2, -1.0], [0.4, 2.0]])
    draws = np.random.default_rng(5).standard_normal((SAMPLES, 2))
    outcomes = draws @ partials.T * (1.0 + 1e-15)
    found = compare(Model(partials, np.zeros(3), np.zeros(2), np.eye(2)), draws, outcomes, Criterion())
    assert not any(each.any() for each in certain_differences(found, 0.95))


def test_a_percentile_far_off_is_red() -> None:
    """Twice the linear dispersion differs in every row, and a sample too small for bounds is not judged."""
    model = Model(np.eye(2), np.zeros(2), np.zeros(2), np.eye(2))
    outcomes = 2.0 * np.random.default_rng(3).standard_normal((20_000, 2))
    found = tails(model, outcomes, np.arange(20_000), ["m", "m"], Criterion())
    assert {entry.verdict for entry in found} == {Verdict.DIFFERS}
    few = tails(model, 0.5 * outcomes[:30], np.arange(30), ["m", "m"], Criterion())
    assert {entry.verdict for entry in few} == {Verdict.UNDECIDED}
