"""Allan deviation and spectral density of an instrument's readings, with the fitted model, a panel for each axis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array
from mcnav.physics.units import conversion
from mcnav.report.drawing.figure import THIRD, Figure
from mcnav.report.drawing.marks import Axis, Band, Line, Panel, Points, Series
from mcnav.report.drawing.palette import AREA, FLOWN, LINEAR
from mcnav.report.results.identified import AxisReport

ESTIMATE: Final = Series("flown", "of the readings, with 95 % interval", FLOWN, "dot")
WHISKER: Final = Series("flown", "", FLOWN)
MODEL: Final = Series("linear", "fitted model", LINEAR)
BAND: Final = Series("interval", "95 % band of the model", AREA, "area")

SHOWN: Final = {"gyro": ("deg/h", "deg/sqrt(h)"), "accelerometer": ("ug", "m/s/sqrt(h)")}
"""Units of an Allan deviation, and of the root of a two-sided spectral density, by instrument."""

DENSITIES: Final = {"gyro": "rad/sqrt(s)", "accelerometer": "m/s/sqrt(s)"}
"""SI units of the latter."""


def allan(instrument: str, axes: Sequence[AxisReport]) -> Figure:
    """Draw the overlapping Allan deviation of each axis with the fitted model's and its band."""
    unit = SHOWN[instrument][0]
    factor = conversion(axes[0].unit, unit)

    def panel(axis: AxisReport) -> Panel:
        shown = axis.allan
        band = Band(BAND, shown.times, factor * shown.model_low, factor * shown.model_high)
        points = _whiskers(shown.times, factor * shown.deviations, factor * shown.low, factor * shown.high)
        across = Axis("cluster time", "s", log=True, link="cluster time [s]")
        upward = Axis("Allan deviation", unit, log=True)
        return Panel(axis.name, across, upward, [band, Line(MODEL, shown.times, factor * shown.model), *points])

    def columns(axis: AxisReport) -> Mapping[str, ArrayLike]:
        shown = axis.allan
        return {
            "cluster time [s]": shown.times, "deviation": factor * shown.deviations, "from": factor * shown.low,
            "to": factor * shown.high, "model": factor * shown.model, "model from": factor * shown.model_low,
            "model to": factor * shown.model_high,
        }  # fmt: skip

    return Figure(
        name=f"allan-{instrument}",
        title=f"Allan deviation: {instrument}",
        description=f"Overlapping Allan deviation of each axis of the {instrument} against the cluster time, with "
        "95 % intervals, and that of the fitted model with its band.",
        panels=[panel(axis) for axis in axes],
        key=(ESTIMATE, MODEL, BAND),
        columns=_tabulated(axes, columns),
        size=(THIRD[0], 260.0),
        caption="Intervals by the equivalent degrees of freedom; neighbouring points are not independent. The band is "
        "that of the parameters, by the curvature of the likelihood.",
    )


def spectrum(instrument: str, axes: Sequence[AxisReport]) -> Figure:
    """Draw the root of the two-sided spectral density of each axis with the fitted model's."""
    unit = SHOWN[instrument][1]
    factor = conversion(DENSITIES[instrument], unit)

    def panel(axis: AxisReport) -> Panel:
        shown = axis.spectrum
        points = _whiskers(shown.frequency, factor * shown.density, factor * shown.low, factor * shown.high)
        across = Axis("frequency", "Hz", log=True, link="frequency [Hz]")
        upward = Axis("root of the spectral density", unit, log=True)
        return Panel(axis.name, across, upward, [*points, Line(MODEL, shown.frequency, factor * shown.model)])

    def columns(axis: AxisReport) -> Mapping[str, ArrayLike]:
        shown = axis.spectrum
        return {
            "frequency [Hz]": shown.frequency, "density": factor * shown.density, "from": factor * shown.low,
            "to": factor * shown.high, "model": factor * shown.model,
        }  # fmt: skip

    return Figure(
        name=f"spectrum-{instrument}",
        title=f"Spectral density: {instrument}",
        description=f"Root of the two-sided spectral density of each axis of the {instrument} against the frequency, "
        "with 95 % intervals, and that of the fitted model.",
        panels=[panel(axis) for axis in axes],
        key=(ESTIMATE, MODEL),
        columns=_tabulated(axes, columns),
        size=(THIRD[0], 260.0),
        caption="Two-sided, so that white noise is as high as its random walk.",
    )


def _whiskers(x: Array, y: Array, low: Array, high: Array) -> tuple[Line, Points]:
    """Return points with upright intervals."""
    across = np.stack([x, x, np.full(len(x), np.nan)], axis=1).ravel()
    upward = np.stack([low, high, np.full(len(x), np.nan)], axis=1).ravel()
    return Line(WHISKER, across, upward, 1.0, silent=True), Points(ESTIMATE, x, y, 4.5)


def _tabulated(
    axes: Sequence[AxisReport], columns: Callable[[AxisReport], Mapping[str, ArrayLike]]
) -> dict[str, Array]:
    """Put the columns of all axes below each other."""
    tables = [columns(axis) for axis in axes]
    names = np.concatenate([np.full(len(np.asarray(next(iter(own.values())))), axis.name) for axis, own in
                            zip(axes, tables, strict=True)])  # fmt: skip
    numbers = {name: np.concatenate([np.asarray(own[name]) for own in tables]) for name in tables[0]}
    return {"axis": names, **numbers}
