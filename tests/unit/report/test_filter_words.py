"""What the report says of a filter in sentences and tables; nothing of it is a number that is not one."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from mcnav.analysis.filter_consistency import FilterConsistency, Finding, Honesty, NeglectedError, Whiteness
from mcnav.analysis.summary import Summary
from mcnav.report.columns import filter_tables
from mcnav.report.columns.filter_columns import foremost_neglected, group_rows, groups_table, sensors_table, sigmas_of
from mcnav.report.columns.filter_tables import FilterAnswer, WorstSigmas
from mcnav.report.columns.output_columns import entries_of
from mcnav.report.document.table import Cell, Table
from mcnav.report.drawing.strip import Strip
from mcnav.report.format import number, rounded
from mcnav.report.results.filter_summary import filter_entries
from mcnav.report.statements import details
from mcnav.report.terminal import terminal
from tests import summaries
from tests.filters import OUTPUTS, TIMES, consistency

NEGLECTED = [NeglectedError("gyro_scale_factor_z", 9e2, 0.0, 0.7), NeglectedError("initial_tilt", 4e2, 1e2, 0.296),
             NeglectedError("gnss_noise", 5e-1, 4e-1, 0.004)]  # fmt: skip


def summary(found: FilterConsistency | None) -> Summary:
    """Return a summary with the outputs of a filter, whose sources are two of the errors that it neglects."""
    outputs = [{"name": name, "unit": unit} for name, (unit, *_) in OUTPUTS.items()]
    shown_in = {"outputs": [shown for _, (_, shown, _) in OUTPUTS.items()]}
    sources = [{"name": "initial_tilt", "unit": "rad"}, {"name": "gyro_scale_factor_z", "unit": ""}]
    entries = {} if found is None else filter_entries(found)
    return summaries.summary(outputs=outputs, shown_in=shown_in, sources=sources, **entries)


def page(table: Table[Any] | None) -> list[dict[str, Cell]]:
    """Return the cells of a page by their headings, row by row."""
    assert table is not None
    headings = [column.heading for column in table.columns_in("page")]
    return [dict(zip(headings, row, strict=True)) for row in table.cells_in("page")]


def rows(found: FilterConsistency | None, sigma: float | None = 2.0) -> list[FilterAnswer]:
    """Rows of the table of answers, with the paired sigma of every output, in SI."""
    known = summary(None).model_copy(update={"sigma_paired": [] if sigma is None else [sigma] * len(OUTPUTS)})
    content: Any = SimpleNamespace(filter=found)
    return filter_tables.filter_answers(content, entries_of({"": known}, "SI"))


def test_no_filter() -> None:
    assert summary(None).filter_verdict == details.explanation_of_filter(summary(None)) == ""
    assert rows(None) == []


def test_an_optimistic_filter_and_what_it_neglects() -> None:
    """The verdict names the largest error; the explanation all that matter, and what the sigmas are."""
    found = consistency(3.3, neglected=NEGLECTED)
    assert summary(found).filter_verdict == (
        "The filter is optimistic by a factor of 3.30 in position as a group from 20 to 24 min. In position north the "
        "factor is 3.27 (2.94 to 3.60). Largest unmodelled error: gyro scale factor z (70 %)."
    )
    assert details.explanation_of_filter(summary(found)) == (
        "Unmodelled errors: gyro scale factor z 70 %, initial tilt 30 %."
    )
    worst = found.outputs[0]
    assert filter_tables.at_worst(found) == (
        f"At 24 min 1σ of position north is {worst.true[24]:.1f} m; the filter computes {worst.filter[24]:.1f} m "
        "(3.27 times)."
    )
    neglected = [[cell.text for cell in row.values()] for row in page(foremost_neglected(summary(found)))]
    assert neglected == [
        ["gyro scale factor z", "30.00 m", "0 m", "70.0 %"],
        ["initial tilt", "20.00 m", "10.00 m", "29.6 %"],
        ["gnss noise", "0.7071 m", "0.6325 m", "0.40 %"],
    ]
    small = consistency(3.3, neglected=[*NEGLECTED, NeglectedError("lever_arm", 12.0, 3.6, 0.002)])
    last = page(foremost_neglected(summary(small)))[-1]
    assert [cell.text for cell in last.values()] == ["2 others", "3.536 m", "2.000 m", "0.60 %"]  # √12.5 and 2


def test_the_ratio_farthest_from_one_of_a_consistent_filter() -> None:
    found = replace(consistency(), factor=1.02149, worst=6.5, group="all", output="velocity_east")
    assert filter_tables.at_worst(found) == (
        "The ratio farthest from one is that of all states as a group: 1.02, at 6.5 min."
    )
    alone = replace(found, group="", verdict=Honesty.UNDECIDED)
    assert filter_tables.at_worst(alone) == (
        "The most samples are needed for velocity east: its ratio farthest from one is 1.02, at 6.5 min."
    )
    assert filter_tables.at_worst(replace(found, worst=None)) == ""


def test_a_single_neglected_error_is_named_once() -> None:
    assert details.explanation_of_filter(summary(consistency(3.3, neglected=NEGLECTED[:1]))) == ""


def test_a_remark_that_is_the_verdict_is_not_repeated() -> None:
    """Where nothing could be decided the verdict is the first remark."""
    remarks = ("Every sample failed.", "Gnss never updated the filter.")
    found = replace(consistency(), verdict=Honesty.UNDECIDED, factor=None, remarks=remarks)
    assert summary(found).filter_verdict == "Undecided: every sample failed."
    assert details.explanation_of_filter(summary(found)) == remarks[1]


@pytest.mark.parametrize(("factor", "word"), [(1.0, "consistent"), (3.3, "optimistic"), (0.5, "pessimistic")])
def test_the_terminal_has_the_verdict(factor: float, word: str) -> None:
    console = Console(file=StringIO(), width=200)
    console.print(terminal.verdict(summary(consistency(factor))))
    assert isinstance(console.file, StringIO)
    assert f"The filter is {word}" in console.file.getvalue()


def test_answers_at_the_end_and_where_the_sigma_is_largest() -> None:
    found = consistency(3.3)
    row = rows(found)[0]
    output = found.outputs[0]
    assert row.sigma == output.filter[-1]
    factor = output.finding.factor
    assert row.ratio == Cell(rounded(factor), strip=Strip.of(factor, None, 0.05))
    place = 1 + int(np.argmax(output.true[1:]))
    assert row.worst == WorstSigmas(
        time=TIMES[place], when="24 min", linear=output.true[place], flown=output.true[place],
        filter=output.filter[place],
    )  # fmt: skip
    largest = output.true[place]
    assert row.sigmas(2.0, "flown") == Cell("2.000", below=number(largest), value=2.0, value_below=largest)
    tilt = rows(found)[list(OUTPUTS).index("tilt_north")]
    assert tilt.sigma == pytest.approx(1e3 * found.outputs[6].filter[-1], rel=1e-15)  # mrad


def test_answers_without_what_they_need() -> None:
    """No paired sigma, no filter sigma, and no epoch at which a sigma is known."""
    found = consistency()
    zero = replace(found.outputs[0], filter=np.zeros(len(TIMES)), true_linear=None)
    unknown = replace(zero, true=np.full(len(TIMES), np.nan))
    none = replace(zero, finding=Finding(Honesty.UNDECIDED))
    assert rows(replace(found, outputs=(none, *found.outputs[1:])))[0].ratio == Cell("–")
    judged = Finding(Honesty.OPTIMISTIC, 1.7, (1.5, 1.9), worst=22)
    cell = rows(replace(found, outputs=(replace(zero, finding=judged), *found.outputs[1:])))[0].ratio
    assert cell == Cell("1.70", below="22\N{NO-BREAK SPACE}min", strip=Strip(1.7, 1.5, 1.9, 0.05))
    assert rows(replace(found, outputs=(unknown, *found.outputs[1:])))[0].worst is None
    assert rows(replace(found, outputs=found.outputs[1:])) == []
    growing = replace(found.outputs[0], true=TIMES, true_linear=None)
    assert rows(replace(found, outputs=(growing, *found.outputs[1:])), None)[0].worst is None  # it is the end


def test_the_interval_that_a_verdict_rests_on() -> None:
    """Of a consistent ratio that of its epoch, of others that of all epochs together."""
    each = consistency().outputs[0].ratio.each
    together, at = (0.8, 1.3), 7
    rests = {
        verdict: filter_tables.deciding_interval(Finding(verdict, 1.0, together, worst=at), each) for verdict in Honesty
    }
    assert rests.pop(Honesty.CONSISTENT) == tuple(each[at])
    assert set(rests.values()) == {together}


def test_findings() -> None:
    found = consistency()
    departed = Finding(Honesty.OPTIMISTIC, 1.7, worst=22, begin=20, end=24)
    few = Finding(Honesty.UNDECIDED, 1.04, worst=3, samples_needed=1_234)
    groups = (
        replace(found.groups[0], finding=departed),
        replace(found.groups[1], finding=few),
        replace(found.groups[2], finding=departed),
    )
    first, second, third = page(groups_table(summary(replace(found, groups=groups))).read)[:3]
    assert [first[heading].text for heading in ("Errors", "States", "At", "Certain")] == [
        "all estimated states", "15", "22 min", "20 to 24 min",
    ]  # fmt: skip
    assert (first["Verdict"].tone, first["Verdict"].below) == (None, "does not decide")  # where navigation is a group
    assert third["Verdict"].tone == "differs"
    assert (second["Certain"].text, second["Verdict"].below) == ("–", "about 1,300 samples")
    listed = [page(sigmas_of(summary(found), kind)) for kind in ("output", "state")]
    assert list(map(len, listed)) == [len(found.outputs), len(found.states)]
    assert [row.decides for row in group_rows(summary(found))] == [False, True, True, True, True, False]


def test_sensors() -> None:
    """One that rejects, one that never updates the filter."""
    found = consistency(rejected=6.0)
    never = replace(found.sensors[1], accepted=0.0 * TIMES, rejected=0.0 * TIMES, nis_whole=None,
                    whiteness=Whiteness(None, (np.nan, np.nan), np.nan, beyond=False))  # fmt: skip
    first, second = page(sensors_table(summary(replace(found, sensors=(found.sensors[0], never)))).read)
    assert (first["Rejected"].text, first["Rejected"].below) == ("330", "10 %")  # 6 of 60 between 55 pairs of epochs
    assert (first["NIS"].tone, first["Innovations"].text) == ("agrees", "white")
    assert {second[heading].text for heading in ("Mean NIS", "Bounds", "Correlation", "Innovations")} == {"–"}
    assert second["NIS"].text == "no updates"
