"""The reproduction of NASA TN D-1772 counts every printed number, and knows why some do not agree."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcnav.validation.reproduce.tn_d1772 import page
from mcnav.validation.reproduce.tn_d1772.printed import CORRECTIONS, NAMES, SUMS, final_errors, sums
from mcnav.validation.reproduce.tn_d1772.tables import (
    CASES,
    CONTRADICTIONS,
    SUM_NAMES,
    Case,
    Cell,
    Mark,
    table_i_scenario,
    tolerance_in_words,
)
from tests.conftest import ROOT
from tests.reproduction import Reproduction
from tests.sentences import too_long
from tests.tables import assert_same_tables


@pytest.fixture(scope="module")
def cells(reproduction: Reproduction) -> list[Cell]:
    return reproduction.cells


@pytest.fixture(scope="module")
def folder(reproduction: Reproduction) -> Path:
    return reproduction.folder


def _chapter(title: str) -> str:
    committed = (ROOT / "mcnav" / "validation" / "reproduce" / "tn_d1772" / "TN_D1772.md").read_text(encoding="utf-8")
    return committed.partition(f"## {title}\n")[2].partition("\n## ")[0]


def test_the_command_counts_what_it_writes(reproduction: Reproduction) -> None:
    assert f"{len(pd.read_csv(reproduction.folder / 'tables.csv'))} printed numbers" in reproduction.printed
    assert f"written: {Path(reproduction.folder.name) / page.PAGE}" in reproduction.printed


def test_every_printed_number_has_a_computed_one(cells: list[Cell]) -> None:
    """Table I: 7 x 7; III: 7 x 6; the others: their runs and four sums, four columns each."""
    runs = sum(len(final_errors(case.table)) + len(SUMS) for case in CASES)
    assert len(cells) == 7 * 7 + 7 * 6 + 4 * runs
    assert all(np.isfinite(cell.computed) for cell in cells)


def test_what_does_not_agree_has_a_reason(cells: list[Cell]) -> None:
    for cell in cells:
        if cell.mark in (Mark.INCONSISTENT, Mark.DIFFERS):
            assert cell.reason, cell


def test_no_reason_is_given_for_what_agrees(cells: list[Cell]) -> None:
    """A listed contradiction is one that the numbers show."""
    listed = [cell for cell in cells if cell.contradicted]
    assert len(listed) == len(CONTRADICTIONS) + len(WRONG_SUMS)
    assert all(cell.mark == Mark.INCONSISTENT for cell in listed)


WRONG_SUMS = {
    ("II(a)", "equipment", 3): 11.80,
    ("II(a)", "all", 3): 15.44,
    ("IV(b)", "algebraic", 1): -358.86,
    ("IV(b)", "all", 1): 728.88,
    ("V(b)", "algebraic", 2): 51.47,
}
"""Printed sums that are not those of their printed runs: what the runs add up to, by hand."""

SUMMED = {"algebraic": slice(0, 10), "ic": slice(0, 4), "equipment": slice(4, 10), "all": slice(0, 10)}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.table)
def test_printed_sums_against_their_printed_runs(case: Case, cells: list[Cell]) -> None:
    """No computation of ours is needed: a sum of n rounded runs is wrong by n + 1 halves of a digit at most.

    Each that is wrong by more counts as contradicted, also where the computed number is near it.
    """
    runs = np.array(final_errors(case.table), dtype=float)[:10]
    for name, texts in sums(case.table).items():
        members = runs[SUMMED[name]]
        totals = members.sum(axis=0) if name == "algebraic" else np.abs(members).sum(axis=0)
        for column, text in enumerate(texts):
            half = 0.5 * 10.0 ** -len(text.partition(".")[2]) + 0.005 * len(members)
            wrong = abs(float(text) - totals[column]) > half + 1e-9
            assert wrong == ((case.table, name, column) in WRONG_SUMS)
            (cell,) = (
                cell
                for cell in cells
                if (cell.table, cell.row, cell.column) == (case.table, SUM_NAMES[name], NAMES[column])
            )
            if wrong:
                assert totals[column] == pytest.approx(WRONG_SUMS[case.table, name, column], abs=0.005)
                assert cell.mark == Mark.INCONSISTENT
                assert f"{totals[column]:.2f}" in cell.reason


def test_numbers_that_zero_would_meet_are_counted_apart(cells: list[Cell]) -> None:
    small = [cell for cell in cells if cell.mark == Mark.SMALL]
    assert len(small) == 102
    assert all(abs(float(cell.printed)) <= cell.tolerance for cell in small)
    assert sum(cell.wrong_sign for cell in small) == 4
    others = [cell for cell in cells if cell.mark in (Mark.DIGITS, Mark.TOLERANCE)]
    assert all(abs(float(cell.printed)) > cell.tolerance and not cell.wrong_sign for cell in others)


def test_the_reentry_angle_is_an_exception(cells: list[Cell]) -> None:
    """Printed -6.4795 deg and computed -6.4933 deg are 140 units of the last printed digit apart."""
    angles = [cell for cell in cells if cell.column == "reentry angle"]
    assert len(angles) == 7
    assert all(cell.mark == Mark.DIFFERS for cell in angles)


def test_corrections_are_needed_by_the_printed_sums() -> None:
    """With the scanned signs the runs of Table II(b) miss both algebraic sums by twice the entry."""
    for correction in CORRECTIONS:
        column, run = NAMES.index(correction.column), int(correction.row.partition(":")[0]) - 1
        runs = np.array(final_errors(correction.table), dtype=float)[:10, column]
        assert runs[run] == float(correction.used)
        printed = float(sums(correction.table)["algebraic"][column])
        assert abs(runs.sum() - printed) < 0.055
        assert abs(runs.sum() - runs[run] + float(correction.scanned) - printed) > 0.5


def test_every_table_states_its_tolerance(folder: Path) -> None:
    text = (folder / page.PAGE).read_text(encoding="utf-8")
    for case in CASES:
        assert tolerance_in_words(case.table).replace("'", "&#39;") in text
    assert "Tolerance: 2.5 %" in tolerance_in_words("V(a)")


def test_page_and_tables(cells: list[Cell], folder: Path) -> None:
    text = (folder / page.PAGE).read_text(encoding="utf-8")
    assert text.count('class="digits"') + text.count('class="tolerance"') > 700
    assert text.count("<figure") == 16
    assert len(pd.read_csv(folder / "tables.csv")) == len(cells)
    for name in SUM_NAMES.values():
        assert name in text
    for number in range(1, 17):
        frame = pd.read_csv(folder / f"figure_{number:02}.csv")
        assert len(frame) > 10
        assert f'href="figure_{number:02}.csv"' in text


def test_two_engines_where_errors_are_large(cells: list[Cell]) -> None:
    """The engines differ by less than a hundredth of a tolerance that is 0.2 % of a column's largest entry or more."""
    for cell in cells:
        if cell.table not in ("I", "III"):
            assert abs(cell.second - cell.computed) < 0.01 * cell.tolerance


def test_figure_3_ends_in_run_11(folder: Path) -> None:
    """Error histories with all errors at once end where Table II(d) prints: within the table's own tolerance."""
    last = pd.read_csv(folder / "figure_03.csv").iloc[-1]
    for column, printed in zip(last.index[1:5], map(float, final_errors("II(d)")[10]), strict=True):
        assert last[column] == pytest.approx(printed, abs=0.005 * 75.0)


def test_figure_4_passes_through_the_printed_points(folder: Path) -> None:
    """Sums by P against Table III: 0.5 % of the largest entry for each of ten contributions."""
    frame = pd.read_csv(folder / "figure_04.csv")
    printed, computed = (frame[frame["source"] == kind].set_index("trajectory") for kind in ("printed", "computed"))
    for column in frame.columns[frame.columns.str.contains(",")]:
        difference = np.abs(computed[column] - printed[column])
        assert (difference < 0.01 * np.maximum(printed[column], printed[column].max())).all(), column


def test_partials_are_one_and_zero_at_the_end(folder: Path) -> None:
    """As the report says of figures 6 to 9: each final quantity with respect to itself, and all others."""
    for output, number in enumerate((6, 7, 8, 9)):
        last = pd.read_csv(folder / f"figure_{number:02}.csv").iloc[-1, 1:5].to_numpy()
        own = 1.0 if output in (0, 2) else 6378.14 / (6378.14 + 26.75)
        np.testing.assert_allclose(last, np.where(np.arange(4) == output, own, 0.0), atol=1e-6)


def test_findings(folder: Path) -> None:
    """What the page says of the report's advice and of Table V rests on the figures."""
    found = pd.read_csv(folder / "findings.csv")
    assert set(found["verdict"]) <= {"holds", "in part", "does not hold", "not tested", "settled"}
    assert not found["found"].str.contains("nan|inf ").any()
    assert [sentence for text in (*found["said"], *found["found"]) for sentence in too_long(text)] == []
    twelve = pd.read_csv(folder / "figure_12.csv")
    early = twelve[twelve.iloc[:, 0] <= -10.0]
    best = early.iloc[int(early["altitude, sum of |all| [km]"].argmin()), 0]
    assert -30.0 < best < -20.0
    advice = found[found["said"].str.contains("between 20 and 30 minutes")].iloc[0]
    assert f"{best:.1f}".replace("-", "−") in advice["found"]
    assert found[found["said"].str.contains("insufficient accuracy")].iloc[0]["verdict"] == "does not hold"


def test_three_dimensions_beside_the_plane(reproduction: Reproduction) -> None:
    """Linear numbers of both navigators agree to what the truth's spline leaves of its force, 1e-5 of the largest.

    With accelerometers off the planar navigator also misses the drag above, and may differ by what that does to it.
    Samples are the same errors; they depart by second-order terms of what the navigators define otherwise, an initial
    altitude error of 5 km over a radius of 25,000 km: 2e-4.
    """
    frame = pd.read_csv(reproduction.folder / "three_dimensions.csv")
    flown = frame[frame["planar"].notna() & (frame["part"] != "update")]
    assert len(flown) == 2 * (5 + 2 * 3)
    largest = flown.groupby(["part", "result"])["planar"].transform(lambda values: values.abs().max())
    missed = np.abs(table_i_scenario(4, accelerometers_off_above=121_920.0).linear().end.nominal[:2]).min() / 1e3
    assert missed < 0.02
    off = flown["case"].str.endswith("off")
    assert ((flown["linear"] - flown["planar"]).abs() < np.where(off, missed, 1e-5 * largest)).all()
    assert ((flown["simulated"] - flown["planar_simulated"]).abs() < 5e-4 * largest).all()


def test_samples_contain_every_sigma_of_three_dimensions(reproduction: Reproduction) -> None:
    """Errors of 40 km are 0.6 % of the radius: so much, at most, second-order terms may change of a sigma."""
    frame = pd.read_csv(reproduction.folder / "three_dimensions.csv")
    sampled = frame[frame["low"].notna()]
    assert len(sampled) == 3 * (5 + 2 + 7) + 7
    assert ((sampled["low"] <= sampled["linear"]) & (sampled["linear"] <= sampled["high"])).all()
    assert sampled["departure"].abs().max() < 0.006
    stated = frame[frame["own"].notna()]
    np.testing.assert_allclose(stated["own"], stated["linear"], rtol=1e-9)


def test_the_chapter_on_three_dimensions_is_what_the_command_writes(reproduction: Reproduction) -> None:
    computed = (reproduction.folder / "three_dimensions.md").read_text(encoding="utf-8")
    assert_same_tables(computed, _chapter("In three dimensions"))


def test_the_findings_in_three_dimensions_are_those_of_the_chapter(reproduction: Reproduction) -> None:
    """Every number of kilometres and percent that the chapter states stands in the findings, or in its table."""
    found = pd.read_csv(reproduction.folder / "findings.csv")
    found = found[found["kind"] == "three dimensions"]
    assert list(found["verdict"]) == ["in part", "does not hold", "holds", "in part"]
    said = " ".join(line for line in _chapter("In three dimensions").splitlines() if not line.startswith("|"))
    computed = set(re.findall(r"[\d.]+", " ".join(found["found"])))
    stated = re.findall(r"(\d+\.\d+|\d+(?= %))", said.partition("**Start 20")[2])
    assert len(stated) > 12
    assert set(stated) <= computed


def test_the_chapter_on_the_closed_loop_is_what_the_command_writes(reproduction: Reproduction) -> None:
    computed = (reproduction.folder / "closed_loop.md").read_text(encoding="utf-8")
    assert_same_tables(computed, _chapter("In the closed loop"))


def test_the_findings_in_the_closed_loop_are_those_of_the_chapter(reproduction: Reproduction) -> None:
    """Every number of kilometres and percent that the chapter states stands in the findings."""
    found = pd.read_csv(reproduction.folder / "findings.csv")
    found = found[found["kind"] == "closed loop"]
    assert list(found["verdict"]) == ["in part", "in part", "holds", "in part", "in part"]
    said = " ".join(line for line in _chapter("In the closed loop").splitlines() if not line.startswith("|"))
    computed = set(re.findall(r"\d[\d.,]*\d|\d", " ".join(found["found"])))
    stated = re.findall(r"(\d[\d.,]*\d|\d)(?= km| %| times| to \d|\))", said.partition("**What")[2])
    assert len(stated) > 20
    assert set(stated) <= computed


def test_samples_contain_every_sigma_of_the_closed_loop(reproduction: Reproduction) -> None:
    """Intervals of 99.9 %, of samples that the cases share; errors of the navigator are those of the report."""
    frame = pd.read_csv(reproduction.folder / "closed_loop.csv")
    moved = frame[frame["departure"].notna()]
    assert len(moved) == 5 * 10 + 2
    assert ((moved["low"] <= moved["linear"]) & (moved["linear"] <= moved["high"])).all()
    unmoved = frame[(frame["fed"] == "true") & (frame["result"] == "landing point") & (frame["part"] != "air")]
    assert (unmoved[["linear", "simulated"]] == 0.0).all(axis=None)
    errors = moved[moved["result"] != "landing point"].pivot_table("linear", ["case", "result"], "fed")
    np.testing.assert_allclose(errors["indicated"], errors["true"], rtol=1e-3)


def test_the_findings_on_all_trajectories_are_those_of_the_chapter(folder: Path) -> None:
    """Every decimal number of the paragraphs on them stands in the findings."""
    found = pd.read_csv(folder / "findings.csv")
    computed = set(re.findall(r"\d+\.\d+", " ".join(found[found["kind"] == "claim"]["found"])))
    chapter = _chapter("The claims")
    paragraphs = [
        chapter.partition(f"**{opening}")[2].partition("\n**")[0]
        for opening in (
            "The same should hold", "Other coordinates", "A start just before the atmosphere", "Altitude is the most",
            "Below circular velocity", "Errors remain small", "Zero outputs above",
        )
    ]  # fmt: skip
    assert all(paragraphs)
    stated = re.findall(r"\d+\.\d+", " ".join(paragraphs))
    assert len(stated) > 20
    assert set(stated) <= computed


def test_the_numbers_of_the_chapter_are_counted(cells: list[Cell]) -> None:
    counted = Counter(cell.mark for cell in cells)
    rows = [line.split("|")[1:3] for line in _chapter("The numbers").splitlines() if line.startswith("| ")][2:]
    assert [int(count) for count, _ in rows] == [counted[mark] for mark in Mark]


def test_the_documentation_counts_right(cells: list[Cell]) -> None:
    counted = Counter(cell.mark for cell in cells)
    agree = counted[Mark.DIGITS] + counted[Mark.TOLERANCE]
    said = (
        f"{agree} agree, {counted[Mark.SMALL]} more are no larger than the tolerance, {counted[Mark.INCONSISTENT]} are "
        f"contradicted by the report itself, {counted[Mark.DIFFERS]} differ"
    )
    text = (ROOT / "mcnav" / "docs" / "COMMANDS.md").read_text(encoding="utf-8")
    assert f"all {len(cells)} printed numbers" in text
    assert said in text
