"""The table of neglected errors is of the output and instant of which it has the shares."""

from __future__ import annotations

import pytest

from mcnav.report.columns.filter_columns import neglected_table
from tests.summaries import summary


def test_neglected_errors_are_in_the_unit_of_the_output_that_they_explain() -> None:
    """The group's worst output at its worst epoch is a position; the errors are split in a tilt at another epoch."""
    found = summary(
        outputs=[{"name": "position_north", "unit": "m"}, {"name": "tilt_east", "unit": "rad"}],
        shown_in={"outputs": ["m", "mrad"]},
        filter={
            "verdict": "optimistic",
            "output": "position_north",
            "neglected_output": "tilt_east",
            "neglected": [{"name": "gyro_misalignment_xz", "true": 1e-8, "believed": 0.0, "share": 0.9}],
        },
    )
    (row,) = neglected_table(found).rows
    assert (row["output"], row["unit"]) == ("tilt_east", "mrad")
    assert row["sigma_true"] == pytest.approx(0.1, rel=1e-15)
