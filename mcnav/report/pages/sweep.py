"""A sweep as a table of pandas and as ``sweep.json``."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcnav.analysis.accuracy_measures import DRMS, SIGMA
from mcnav.analysis.sweep import Point, Sweep, Variable
from mcnav.arrays.types import Array
from mcnav.files.whole import to_json
from mcnav.report.figures import sweep as drawn
from mcnav.report.statements.sweep import doubt_of, met_words, verdict_at


def frame(sweep: Sweep) -> pd.DataFrame:
    """Tabulate a sweep: a row for each point, in the units of the columns' names.

    ``attrs`` has ``units`` by column, and ``just_met``: the values at which each limit is just met.
    """
    shape, columns, units = sweep.shape, dict[str, NDArray[Any]](), dict[str, str]()
    points = np.array(list(product(*(variable.values for variable in sweep.variables))))
    for number_of, variable in enumerate(sweep.variables):
        values = points[:, number_of]
        columns[variable.label] = np.array(variable.words)[values.astype(int)] if variable.words else values
        units[variable.label] = variable.unit
    for index, (measure, scale) in enumerate(zip(sweep.measures, drawn.scales(sweep), strict=True)):
        for suffix, values in (("", sweep.values), (", filter", sweep.own), (", Monte Carlo", _checked(sweep))):
            result = values[..., index].reshape(-1) * scale
            if not suffix or np.isfinite(result).any():
                name = f"{measure.name}{suffix} [{measure.shown_in}]"
                columns[name], units[name] = result, measure.shown_in
        if sweep.means is not None and sweep.has_mean(index):
            name = f"{measure.name}, mean error [{measure.shown_in}]"
            columns[name], units[name] = sweep.means[..., index].reshape(-1) * scale, measure.shown_in
        if np.isfinite(sweep.margins[..., index]).any():
            columns[f"{measure.name}, met"] = (sweep.margins[..., index] <= 0.0).reshape(-1)
        if sweep.exceedances is not None and sweep.rare(index):
            columns[f"{measure.name}, beyond"] = sweep.exceedances[..., index].reshape(-1)
    if sweep.doubted:
        verdicts = [sweep.verdict_at(tuple(point)) for point in points.tolist()]
        columns["linear analysis"] = np.array(["" if verdict is None else verdict.value for verdict in verdicts])
    table = pd.DataFrame(columns)
    assert len(table) == int(np.prod(shape))
    table.attrs = {"units": units, "just_met": just_met_rows(sweep)}
    return table


def _checked(sweep: Sweep) -> Array:
    """Return the Monte Carlo values at the points of the grid, NaN where there are none."""
    checked = np.full_like(sweep.values, np.nan)
    for confirmation in sweep.confirmations:
        checked[confirmation.place] = confirmation.values
    return checked


def just_met_rows(sweep: Sweep) -> list[Mapping[str, object]]:
    """List the values at which limits are just met, in the units of the variables."""
    *first, last = sweep.variables
    return [
        {
            "measure": sweep.measures[allocation.measure].name,
            "variable": last.path,
            "unit": last.unit,
            **({first[0].path: _plain(first[0], allocation.fixed)} if first else {}),
            "just_met": list(allocation.values),
            "met": [[_plain(last, end) for end in span] for span in allocation.met],
            "looked_at": allocation.looked_at,
            "closest": None if allocation.closest is None else _plain(last, allocation.closest[0]),
            "finding": met_words(allocation, last),
            **({"doubt": doubt} if (doubt := doubt_of(sweep, allocation)) else {}),
        }
        for allocation in sweep.just_met
    ]


def examined_rows(sweep: Sweep) -> Mapping[str, object]:
    """List the points at which flights have examined linear analysis, with the verdict on each measure."""
    return {
        "unexamined": sweep.unexamined or None,
        "points": [
            {
                "point": _plain_point(sweep, point),
                "flights": examined.flights,
                "verdicts": [sweep.verdict(examined, measure) for measure in range(len(sweep.measures))],
                "ratios": {output.name: row.ratio for output, row in zip(sweep.outputs, examined.outputs, strict=True)},
            }
            for point, examined in sweep.examined
        ],
    }


def _plain(variable: Variable, value: float | None) -> float | str | None:
    """Return a value of a variable as files have it: a word where it is no number."""
    return variable.words[int(value)] if variable.words and value is not None else value


def _plain_point(sweep: Sweep, point: Point) -> list[float | str | None]:
    return [_plain(variable, value) for variable, value in zip(sweep.variables, point, strict=True)]


def table(sweep: Sweep) -> Mapping[str, object]:
    """Arrange a sweep as ``sweep.json`` has it: values of measures in SI."""
    result = {
        "campaign": sweep.campaign,
        "variables": [
            {
                "path": variable.path,
                "unit": variable.unit,
                "values": variable.words or variable.values,
                "logarithmic": variable.log,
            }
            for variable in sweep.variables
        ],
        "measures": [
            {
                "name": measure.name,
                "kind": measure.kind,
                "outputs": [sweep.outputs[number].name for number in measure.outputs],
                "unit": measure.unit,
                "limits": measure.limits,
                "probability": None if measure.kind in (SIGMA, DRMS) else measure.probability,
                "requirement": measure.requirement,
                "time": time,
                "present": present,
            }
            for measure, time, present in zip(sweep.measures, sweep.times, sweep.present.tolist(), strict=True)
        ],
        "values": sweep.values,
        **({"means": sweep.means} if any(map(sweep.has_mean, range(len(sweep.measures)))) else {}),
        "filter": sweep.own if np.isfinite(sweep.own).any() else None,
        **({"exceedance": sweep.exceedances} if any(map(sweep.rare, range(len(sweep.measures)))) else {}),
        "added": [{"point": _plain_point(sweep, point), "values": values} for point, values in sweep.added],
        "just_met": just_met_rows(sweep),
        **({"remarks": list(sweep.remarks)} if sweep.remarks else {}),
        **({"linearity": examined_rows(sweep)} if sweep.examined or sweep.unexamined else {}),
        "monte_carlo": [
            {
                "point": dict(
                    zip((v.path for v in sweep.variables), _plain_point(sweep, confirmation.point), strict=True)
                ),
                "folder": str(confirmation.folder),
                "verdict": verdict_at(sweep, confirmation),
                "samples": confirmation.summary.samples,
                "values": confirmation.values,
            }
            for confirmation in sweep.confirmations
        ],
    }
    plain: Mapping[str, object] = to_json(result)
    return plain
