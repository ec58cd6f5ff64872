"""Errors over the flight: linear and Monte Carlo, as mean and multiples of sigma, and percentiles of samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.envelopes import Envelopes
from mcnav.contract.quantities import COMMANDS, NAVIGATION_DISPERSION, TIMES, TRUE_DISPERSION
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Band, Line, Panel, Rule, Series, axis
from mcnav.report.drawing.palette import AREA, FLOWN, LINEAR
from mcnav.report.figures.filter_errors import errors_and_sigmas
from mcnav.report.results.model import RunAnalysis

OWN: Final = ("vectorised", "single")
"""Engines of classes of the user's, which have no other one to hand samples over to."""


def envelopes(content: RunAnalysis) -> Figure | None:
    """Draw every output that moves; none where errors throughout the flight are not known.

    Lines and band stand for the same probability: the lines are where a normal distribution of that mean and sigma has
    the percentiles of the band. With a filter, `mcnav.report.figures.filter_errors` draws the errors.
    """
    if content.filter is not None:
        return errors_and_sigmas(content, content.filter)
    known = content.envelopes
    if known is None:
        return None
    moving = [i for i in content.moving if np.any(known.linear_sigma[:, i] > 0.0)]
    if not moving:
        return None
    names, units, scale = content.output_names, content.output_units, content.output_scale
    low, *_, high = known.percentiles
    reach = float(special.ndtri(float(high) / 100.0))
    series = {
        "linear": Series("linear", f"linear, mean ± {reach:.2f}σ", LINEAR),
        "flown": Series("flown", f"Monte Carlo, mean ± {reach:.2f}σ", FLOWN),
        "band": Series("percentiles", f"{low} % to {high} % of {known.stored:,} samples", AREA, "area"),
    }
    columns = {known.label: known.times}
    for i in moving:
        moments = {"linear mean": known.linear_mean, "linear sigma": known.linear_sigma, "mean": known.mean,
                   "sigma": known.sigma}  # fmt: skip
        columns |= {f"{names[i]}, {words} [{units[i]}]": moment[:, i] * scale[i] for words, moment in moments.items()}
    about = ""
    if content.summary.engine not in OWN:
        about = (
            "Output ranges are arcs on the earth's surface; initial ranges are arcs at the radius of the start. "
            if "range" in names
            else ""
        )
        about += "Samples outside the fast engine's range of validity are not included. "
    return Figure(
        name="envelopes",
        title="Errors and dispersions over the flight" if content.several_kinds else "Errors over the flight",
        description=f"Range from {low} % to {high} % of each output by linear analysis and Monte Carlo, and "
        "percentiles of stored samples.",
        panels=[
            _envelope((names[i], label_of(content.kinds[i])), known, i, float(scale[i]), units[i], series, reach)
            for i in moving
        ],
        key=tuple(series.values()),
        columns=columns,
        size=side_by_side(len(moving)),
        caption=f"{about}Lines at ± {reach:.2f}σ: {low} % and {high} % of a normal distribution.",
    )


def label_of(kind: str) -> str:
    """Return the label of the axis of an output of a kind."""
    return {TRUE_DISPERSION: "dispersion", NAVIGATION_DISPERSION: "dispersion", COMMANDS: "value", TIMES: "time"}.get(
        kind, "error"
    )


def _envelope(
    named: tuple[str, str],
    known: Envelopes,
    output: int,
    scale: float,
    unit: str,
    series: Mapping[str, Series],
    reach: float,
) -> Panel:
    name, upward = named
    low, *_, high = (values[:, output] * scale for values in known.percentiles.values())
    linear = [(known.linear_mean + sign * reach * known.linear_sigma)[:, output] * scale for sign in (-1.0, 1.0)]
    flown = [(known.mean + sign * reach * known.sigma)[:, output] * scale for sign in (-1.0, 1.0)]
    shown_events = [(place, event) for event, place in known.events.items() if known.times[0] < place < known.times[-1]]
    return Panel(
        name,
        axis(known.label, margin=0.0, link=True),
        Axis(upward, unit),
        [
            Band(series["band"], known.times, low, high),
            *(Line(series["linear"], known.times, each, 3.2) for each in linear),
            *(Line(series["flown"], known.times, flight) for flight in flown),
            Line(series["flown"], known.times, known.mean[:, output] * scale, 1.1, "line"),
            *(Rule(place, name=event) for place, event in shown_events),
        ],
    )
