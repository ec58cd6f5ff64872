"""Sigmas of kinds of filters: what stands under horizontal position is its DRMS, as elsewhere."""

from __future__ import annotations

import pytest

from mcnav.analysis.filter_kinds import HEADING, HORIZONTAL, KindComparison, KindResult
from mcnav.report.pages.filter_kinds import kind_table
from tests.summaries import summary


def test_horizontal_position_is_the_root_of_the_sum_of_two_variances() -> None:
    ratio = {"ratio": 1.0, "ratio_interval": [0.9, 1.1], "verdict": "consistent", "factor": 1.0,
             "factor_interval": None, "begin": None, "end": None, "worst": None, "samples_needed": None}  # fmt: skip
    sizes = {"position_north": (3.0, 6.0), "position_east": (4.0, 8.0), "heading": (0.1, 0.2)}
    outputs = {name: ratio | {"sigma_true": true, "sigma_filter": own} for name, (true, own) in sizes.items()}
    result = KindResult("ekf", None, "ekf", summary(filter={"verdict": "consistent", "outputs": outputs}), 1.0)
    assert result.sigmas(HORIZONTAL) == pytest.approx((5.0, 10.0))
    assert result.sigmas((HEADING,)) == pytest.approx((0.1, 0.2))
    table = kind_table(KindComparison("some", ("ekf",), None, (result,)))
    assert any("DRMS" in (column.brief or column.heading) for column in table.columns)
    assert not any((column.brief or column.heading) == "position" for column in table.columns)
