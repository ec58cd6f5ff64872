"""Linear covariance over time as tables for the terminal, and as rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.model import humanize, scale_of
from mcnav.scenarios.protocol import Output

MOST_ROWS: Final = 14
"""Times that a table shows when no times are asked for."""

LARGEST: Final = 5
"""Contributors listed for each output."""

COARSEST_SHARE: Final = 0.001
"""Smallest share of a variance that is listed."""


def sigma_rows(found: LinearCovariance, outputs: Sequence[Output]) -> list[dict[str, Any]]:
    """List the sigmas at all readings, a row for each reading and output, in the units shown."""
    scale = scale_of(outputs)
    return [
        {
            "time": float(time),
            "update": found.readings.updates[number] or "",
            "output": output.name,
            "unit": output.shown_in,
            "sigma": float(found.sigma[number, i] * scale[i]),
            "sigma_filter": None if found.sigma_filter is None else float(found.sigma_filter[number, i] * scale[i]),
        }
        for number, time in enumerate(found.readings.times)
        for i, output in enumerate(outputs)
    ]


def sigma_table(found: LinearCovariance, outputs: Sequence[Output], everything: bool) -> FittedTable:
    """Tabulate sigmas: true ones and, below them, those that the filter states.

    Parameters
    ----------
    everything : bool
        Whether to show all readings, or some from the first to the last.
    """
    readings, scale = found.readings, scale_of(outputs)
    count = len(readings.times)
    chosen = np.arange(count) if everything or count <= MOST_ROWS else _spread(found)
    own = found.sigma_filter
    columns = [*numbers("time [s]"), *texts("update", *(["σ"] if own is not None else []))]
    columns += numbers(*(f"{humanize(output.name)} [{output.shown_in}]" for output in outputs))
    table = FittedTable("Linear covariance, 1σ", columns, keys=2 if own is None else 3)
    for number in chosen:
        when = (f"{readings.times[number]:g}", readings.updates[number] or "–")
        true = [f"{value:.4g}" for value in found.sigma[number] * scale]
        table.add(*when, *(["true"] if own is not None else []), *true)
        if own is not None:
            table.add("", "", "filter's", *(f"{value:.4g}" for value in own[number] * scale))
    return table


def _spread(found: LinearCovariance) -> list[int]:
    """Choose readings evenly in time, after updates, with those at which a sigma is largest."""
    readings = found.readings
    after = [number for number, update in enumerate(readings.updates) if update != "before"]
    even = np.unique(np.linspace(0, len(after) - 1, MOST_ROWS - 2).round().astype(int))
    worst = int(np.argmax(found.sigma[:, :3].sum(axis=1)))
    return sorted({*(after[place] for place in even), worst})


def contributor_rows(found: LinearCovariance, outputs: Sequence[Output], number: int) -> list[dict[str, Any]]:
    """List the contributions of all causes to the sigmas at a reading, largest first."""
    scale = scale_of(outputs)
    rows = []
    for i, output in enumerate(outputs):
        total = found.sigma[number, i] ** 2
        if total <= 0.0:
            continue
        causes = sorted(found.variances.items(), key=lambda item: -item[1][number, i])
        for name, variance in causes:
            share = float(variance[number, i] / total)
            if share >= COARSEST_SHARE:
                sigma = float(np.sqrt(variance[number, i]) * scale[i])
                rows.append(
                    {"output": output.name, "cause": name, "share": share, "sigma": sigma, "unit": output.shown_in}
                )
    return rows


def contributor_table(found: LinearCovariance, outputs: Sequence[Output], number: int) -> FittedTable:
    """Tabulate the largest contributors to each sigma at a reading."""
    time = found.readings.times[number]
    table = FittedTable(f"Largest contributors at {time:g} s", texts("output", "causes, share of the variance"))
    rows = contributor_rows(found, outputs, number)
    for output in outputs:
        own = [row for row in rows if row["output"] == output.name][:LARGEST]
        listed = ", ".join(f"{humanize(row['cause'])} {100.0 * row['share']:.3g} %" for row in own)
        table.add(humanize(output.name), listed or "–")
    return table
