"""Figures of a judged record: innovations over time, their correlation and histogram, errors against a reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.simulation import recorded
from mcnav.judgement.statistics import sensor_statistics
from mcnav.judgement.verdict import Judgement
from mcnav.physics.units import conversion
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Band, Line, Mark, Panel, Points, Rule, Series, Steps
from mcnav.report.drawing.palette import AREA, BAND, FILTER, FLOWN, LINEAR, POINT
from mcnav.report.names import humanize

TIME: Final = "time [s]"
ACROSS: Final = Axis("time", "s", margin=0.02, link="time")
MULTIPLE: Final = 3.0
ERRORS: Final = (
    *((f"position {axis}", "m") for axis in ("north", "east", "down")),
    *((f"velocity {axis}", "m/s") for axis in ("north", "east", "down")),
    *((name, "mrad") for name in ("tilt north", "tilt east", "heading")),
)  # fmt: skip
"""Navigation errors and their units."""

STATED: Final = Series("stated", f"filter, ±{MULTIPLE:g}σ", BAND, "area")
ACCEPTED, REJECTED = Series("accepted", "accepted", LINEAR, "dot"), Series("rejected", "rejected", FLOWN, "ring")
CORRELATION: Final = Series("correlation", "autocorrelation", LINEAR)
WHITE: Final = Series("white", "95 % of white noise", BAND, "area")
COUNTED: Final = Series("counted", "innovations", AREA, "area")
NORMAL: Final = Series("normal", "normal distribution", FILTER)
ERROR: Final = Series("error", "error against the reference", POINT)
OWN: Final = Series("filter", f"filter, ±{MULTIPLE:g}σ", FILTER)
PREDICTED: Final = Series("linear", f"simulated records, ±{MULTIPLE:g}σ", LINEAR)


def innovations(record: FilteredRecord) -> Figure:
    """Draw the innovations of each component with the filter's bounds."""
    panels, columns = [], dict[str, Sequence[Any] | NDArray[Any]]()
    rejected = any(not stage.accepted for stage in record.stages)
    longest = 0
    for number, sensor in enumerate(record.sensors):
        stages = [stage for stage in record.stages if stage.sensor == number]
        times, good = np.array([stage.time for stage in stages]), np.array([stage.accepted for stage in stages])
        longest = max(longest, len(stages))
        for place, (name, (unit, shown_in)) in enumerate(zip(sensor.components, sensor.units, strict=True)):
            scale = conversion(unit, shown_in)
            values = scale * np.array([stage.innovation[place] for stage in stages])
            bound = MULTIPLE * scale * np.sqrt([stage.covariance[place, place] for stage in stages])
            marks: list[Mark] = [Band(STATED, times, -bound, bound), Points(ACCEPTED, times[good], values[good], 3.5)]
            if rejected:
                marks.append(Points(REJECTED, times[~good], values[~good], 5.0))
            panels.append(Panel(humanize(name), ACROSS, Axis("innovation", shown_in), marks))
            columns[f"{humanize(name)}, time [s]"], columns[f"{humanize(name)} [{shown_in}]"] = times, values
    columns = {name: _filled(values, longest) for name, values in columns.items()}
    return Figure(
        "innovations", "Innovations over time",
        "Innovations of each component, predicted less measured, with the bounds that the filter states.", panels,
        [STATED, ACCEPTED, *([REJECTED] if rejected else [])], columns, side_by_side(len(panels)),
        "Predicted less measured. 99.7 % of a consistent filter's innovations are within the bounds.",
    )  # fmt: skip


def _filled(values: Sequence[Any] | NDArray[Any], count: int) -> Array:
    array = np.asarray(values, dtype=float)
    return np.concatenate([array, np.full(count - len(array), np.nan)])


def whiteness(record: FilteredRecord) -> Figure:
    """Draw autocorrelation and histogram of the whitened innovations of each sensor."""
    panels = []
    columns = dict[str, Array]()
    for sensor, sensor_statistic in zip(record.sensors, sensor_statistics(record, recorded(record)), strict=True):
        name, correlations = humanize(sensor.name), sensor_statistic.autocorrelations[:, 0]
        lags = np.arange(1, len(correlations) + 1)
        limit = np.full(
            len(lags), 1.96 / np.sqrt(sensor_statistic.whitened.shape[0] * sensor_statistic.whitened.shape[1])
        )
        marks: list[Mark] = [Band(WHITE, lags, -limit, limit), Line(CORRELATION, lags, correlations), Rule(0.0, True)]
        panels.append(Panel(f"{name}: autocorrelation", Axis("lag"), Axis("autocorrelation"), marks))
        values = sensor_statistic.whitened[:, :, 0].ravel()
        edges = np.linspace(-5.0, 5.0, 41)
        counts, _ = np.histogram(np.clip(values, -4.999, 4.999), edges, density=True)
        curve = np.linspace(-5.0, 5.0, 201)
        normal = np.exp(-0.5 * curve**2) / np.sqrt(2.0 * np.pi)
        bars: list[Mark] = [Steps(COUNTED, edges, counts), Line(NORMAL, curve, normal)]
        panels.append(Panel(f"{name}: histogram", Axis("innovation in sigmas"), Axis("density", low=0.0), bars))
        columns[f"{name}, autocorrelation"] = correlations
    longest = max(map(len, columns.values()))
    table = {"lag": np.arange(1.0, longest + 1.0)} | {
        name: _filled(column, longest) for name, column in columns.items()
    }
    return Figure(
        "whiteness", "Whiteness and distribution",
        "Autocorrelation of the whitened innovations of each sensor by lag, and their histogram.", panels,
        [CORRELATION, WHITE, COUNTED, NORMAL], table, side_by_side(len(panels)),
        "Innovations whitened by what the filter states; those beyond 5 sigmas are in the last bins.",
    )  # fmt: skip


def reference_errors(record: FilteredRecord, judgement: Judgement) -> Figure | None:
    """Draw the errors against the reference with the filter's and the simulated records' sigmas."""
    stages = [stage for stage in record.stages if stage.read_out is not None]
    if not stages:
        return None
    times = np.array([stage.time for stage in stages])
    read = [stage.read_out for stage in stages if stage.read_out is not None]
    errors = np.array([readings.errors for readings in read])
    own = np.sqrt([np.diag(readings.covariance) + readings.reference for readings in read])
    panels, columns = [], {TIME: times}
    for place, (name, shown_in) in enumerate(ERRORS):
        if not np.isfinite(errors[:, place]).any():
            continue
        scale = 1e3 if shown_in == "mrad" else 1.0
        marks: list[Mark] = [Line(ERROR, times, scale * errors[:, place], 1.2)]
        for series, sigmas in ((OWN, own[:, place]), (PREDICTED, judgement.predicted[:, place])):
            marks += [Line(series, times, sign * MULTIPLE * scale * sigmas, 1.7) for sign in (-1.0, 1.0)]
        panels.append(Panel(name, ACROSS, Axis("error", shown_in), marks))
        columns[f"{name} [{shown_in}]"] = scale * errors[:, place]
        columns[f"{name}, filter σ [{shown_in}]"] = scale * own[:, place]
    return Figure(
        "reference", "Errors against the reference",
        "Navigation errors against the reference over time, with the filter's sigmas and those of simulated records.",
        panels, [ERROR, OWN, PREDICTED], columns, side_by_side(len(panels)),
        "Indicated less reference, after each measurement. The reference's variances are added to the filter's.",
    )  # fmt: skip
