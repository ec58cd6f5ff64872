"""A sweep as a table of pandas, as ``sweep.json``, and as a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav._types import Array
from mcnav.analysis.accuracy_measures import DRMS, SIGMA
from mcnav.analysis.curve_refinement import BEND
from mcnav.analysis.sweep import Confirmation, Sweep
from mcnav.files import to_json
from mcnav.report import sentences
from mcnav.report.figures import sweep as drawn
from mcnav.report.format import interval, number
from mcnav.report.html import filled
from mcnav.report.model import humanize
from mcnav.report.requirements import TONES
from mcnav.report.sweep_words import (
    confirmation_rows,
    confirmed_words,
    disagreements,
    headline,
    met_words,
    point_words,
    remarks,
    shown,
    title_of,
    tone_of,
    verdict_at,
)

VERDICTS: Final = ("agrees", "differs", "undecided")

NO_ANSWER: Final = "–"


def frame(sweep: Sweep) -> pd.DataFrame:
    """Tabulate a sweep: a row for each point, in the units of the columns' names.

    ``attrs`` has ``units`` by column, and ``just_met``: the values at which each limit is just met.
    """
    shape, columns, units = sweep.shape, dict[str, Any](), dict[str, str]()
    points = np.array(list(product(*(variable.values for variable in sweep.variables))))
    for number_of, variable in enumerate(sweep.variables):
        columns[variable.label], units[variable.label] = points[:, number_of], variable.unit
    for index, (measure, scale) in enumerate(zip(sweep.measures, drawn.scales(sweep), strict=True)):
        for suffix, values in (("", sweep.values), (", filter", sweep.own), (", Monte Carlo", _checked(sweep))):
            result = values[..., index].reshape(-1) * scale
            if not suffix or np.isfinite(result).any():
                name = f"{measure.name}{suffix} [{measure.shown_in}]"
                columns[name], units[name] = result, measure.shown_in
        if np.isfinite(sweep.margins[..., index]).any():
            columns[f"{measure.name}, met"] = (sweep.margins[..., index] <= 0.0).reshape(-1)
    table = pd.DataFrame(columns)
    assert len(table) == int(np.prod(shape))
    table.attrs = {"units": units, "just_met": just_met_rows(sweep)}
    return table


def _checked(sweep: Sweep) -> Array:
    """Return the Monte Carlo values at the points of the grid, NaN where there are none."""
    checked = np.full_like(sweep.values, np.nan)
    for each in sweep.confirmations:
        checked[each.place] = each.values
    return checked


def just_met_rows(sweep: Sweep) -> list[dict[str, Any]]:
    """List the values at which limits are just met, in the units of the variables."""
    *first, last = sweep.variables
    return [
        {
            "measure": sweep.measures[each.measure].name,
            "variable": last.path,
            "unit": last.unit,
            **({first[0].path: each.fixed} if first else {}),
            "just_met": list(each.values),
            "met": [list(span) for span in each.met],
            "looked_at": each.looked_at,
            "closest": None if each.closest is None else each.closest[0],
            "finding": met_words(each, last),
        }
        for each in sweep.just_met
    ]


def table(sweep: Sweep) -> Mapping[str, Any]:
    """Arrange a sweep as ``sweep.json`` has it: values of measures in SI."""
    result = {
        "campaign": sweep.campaign,
        "variables": [
            {"path": each.path, "unit": each.unit, "values": each.values, "logarithmic": each.log}
            for each in sweep.variables
        ],
        "measures": [
            {
                "name": each.name,
                "kind": each.kind,
                "outputs": [sweep.outputs[number].name for number in each.outputs],
                "unit": each.unit,
                "limits": each.limits,
                "probability": None if each.kind in (SIGMA, DRMS) else each.probability,
                "requirement": each.requirement,
                "time": time,
                "present": present,
            }
            for each, time, present in zip(sweep.measures, sweep.times, sweep.present.tolist(), strict=True)
        ],
        "values": sweep.values,
        "filter": sweep.own if np.isfinite(sweep.own).any() else None,
        "added": [{"point": list(point), "values": values} for point, values in sweep.added],
        "just_met": just_met_rows(sweep),
        "monte_carlo": [
            {
                "point": dict(zip((v.path for v in sweep.variables), each.point, strict=True)),
                "folder": str(each.folder),
                "verdict": verdict_at(sweep, each),
                "samples": each.summary["samples"],
                "values": each.values,
            }
            for each in sweep.confirmations
        ],
    }
    plain: Mapping[str, Any] = to_json(result)
    return plain


def requirement_rows(sweep: Sweep, confirmation: Confirmation) -> list[dict[str, Any]]:
    """List the requirements by linear analysis and by Monte Carlo."""
    rows = []
    for index, measure in enumerate(sweep.measures):
        if measure.requirement is None:
            continue
        entry = confirmation.summary["requirements"][measure.requirement]
        (scale,) = drawn.scales_of([measure])
        linear = sweep.values[(*confirmation.place, index)] * scale
        met = "met" if sweep.margins[(*confirmation.place, index)] <= 0.0 else "not met"
        estimate = None if entry["estimate"] is None else entry["estimate"] * scale
        rows.append({
            "requirement": title_of(measure, sweep, True),
            "linear": f"{number(linear)} {measure.shown_in}", "linear_finding": met, "linear_tone": TONES[met],
            "estimate": f"{number(estimate)} {measure.shown_in}", "finding": entry["finding"],
            "tone": TONES[entry["finding"]],
        })  # fmt: skip
    return rows


def render(sweep: Sweep) -> str:
    """Render the HTML page."""
    words, tone = headline(sweep)
    *first, last = sweep.variables
    data = frame(sweep)
    scale = drawn.scales(sweep)
    return filled(
        "sweep.html",
        campaign=sweep.campaign,
        headline=words,
        tone=tone,
        remarks=remarks(sweep),
        variables=[
            (each.path, f"{shown(each, each.values[0])} to {shown(each, each.values[-1])}", len(each.values))
            for each in sweep.variables
        ],
        figure=drawn.figure(
            sweep, [title_of(each, sweep) for each in sweep.measures], {name: data[name].to_numpy() for name in data}
        ),
        contours=bool(first),
        filtered=bool(np.isfinite(sweep.own).any()),
        fixed=first[0].path if first else "",
        varied=last.path,
        added=len(sweep.added),
        bend=f"{100.0 * BEND:g} %",
        limits=_limits(sweep),
        present=[
            (title_of(measure, sweep), f"{number(value * factor)} {measure.shown_in}")
            for measure, value, factor in zip(sweep.measures, sweep.present, scale, strict=True)
        ],
        confirmed=confirmed_words(sweep) if sweep.confirmations else None,
        checks=[
            {
                "point": point_words(sweep, each, True),
                "folder": each.folder.relative_to(each.folder.parent.parent).as_posix(),
                "headline": sentences.headline(each.summary),
                "tone": verdict_at(sweep, each),
                "samples": each.summary["samples"],
                "outputs": [
                    {
                        "name": humanize(row["output"]), "unit": row["unit"], "linear": row["sigma_linear"],
                        "paired": row["sigma_paired"], "ratio": row["ratio_paired"],
                        "interval": interval(row["ratio_paired_from"], row["ratio_paired_to"]),
                        "verdict": row["verdict"] or NO_ANSWER,
                        "tone": row["verdict"] if row["verdict"] in VERDICTS else "",
                    }
                    for row in confirmation_rows(sweep, each)
                ],
                "requirements": requirement_rows(sweep, each),
                "disagreements": disagreements(sweep, each),
            }
            for each in sweep.confirmations
        ],
        confidence=_criterion(sweep.confirmations),
    )  # fmt: skip


def _criterion(confirmations: Sequence[Confirmation]) -> str:
    """State tolerance and confidence of the runs."""
    if not confirmations:
        return ""
    summary = confirmations[0].summary
    return f"{100.0 * summary['tolerance']:g} % at {100.0 * summary['confidence']:g} % confidence"


def _limits(sweep: Sweep) -> list[dict[str, Any]]:
    """List the limits with the tone and words on each, one for each value at which the first variable is fixed."""
    *first, last = sweep.variables
    rows: dict[int, dict[str, Any]] = {}
    for each in sweep.just_met:
        row = rows.setdefault(each.measure, {"limit": title_of(sweep.measures[each.measure], sweep, True), "cells": []})
        fixed = "" if each.fixed is None else shown(first[0], each.fixed)
        row["cells"].append((fixed, met_words(each, last), tone_of(each)))
    return list(rows.values())
