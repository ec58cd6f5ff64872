"""Quantiles of the flown errors, as rows of a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from mcnav.analysis.verdict import Verdict
from mcnav.report.format import number
from mcnav.report.model import RunAnalysis


def tail_rows(content: RunAnalysis) -> list[dict[str, Any]]:
    """One row for each quantile, in the units shown."""
    rows = []
    for entry in content.tails:
        first = entry.outputs[0]
        scale, unit = float(content.output_scale[first]), content.output_units[first]
        names = [content.output_names[i] for i in entry.outputs]
        name = f"|{names[0]}|" if len(names) == 1 else f"{' and '.join(names)}: CEP"
        lower, upper = entry.together
        rows.append(
            {
                "name": name,
                "unit": unit,
                "probability": f"{100.0 * entry.probability:g} %",
                "estimate": number(entry.estimate * scale),
                "lower": number(lower * scale) if lower > 0.0 else "–",
                "upper": number(upper * scale) if np.isfinite(upper) else "–",
                "linear": number(entry.linear * scale),
                "verdict": entry.verdict.value,
                "tone": "" if entry.verdict == Verdict.UNDECIDED else entry.verdict.value,
            }
        )
    return rows
