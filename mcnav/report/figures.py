"""The report's figures, each an inline SVG with its own namespace of ids."""

from __future__ import annotations

from itertools import combinations
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from numpy.typing import NDArray
from scipy import special

from mcnav.analysis.comparison import correlations
from mcnav.report.content import Content
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED, SOURCE_COLOURS, STYLE, new, svg

Array = NDArray[np.float64]

SCATTERED: Final = 3_000
"""Points in a scatter plot; statistics always use every sample."""


def _on(colour: str) -> str:
    """Black or white, whichever reads better on a colour (relative luminance, WCAG 2)."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return INK if 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] > 0.25 else "white"


def flight(content: Content) -> str:
    """Altitude against range, and speed and force against time."""
    columns, events = content.history.columns, content.history.events
    time = columns["time from reentry [min]"]
    force = np.hypot(columns["horizontal force [m/s^2]"], columns["vertical force, down [m/s^2]"]) / 9.80665
    with mpl.rc_context(STYLE):
        figure, ((profile, air), (speed, load)) = new(9.0, 5.6, 2, 2)
        profile.plot(columns["range [km]"] / 1e3, columns["altitude [km]"], color=LINEAR)
        profile.set_yscale("log")
        profile.yaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")  # the default one writes mathematics
        profile.set(xlabel="range (1000 km)", ylabel="altitude (km)", title="The whole flight")
        inside = time >= min(0.0, time[-1])
        air.plot(columns["range [km]"][inside], columns["altitude [km]"][inside], color=LINEAR)
        air.set(xlabel="range (km)", ylabel="altitude (km)", title="From reentry on", ylim=(0.0, None))
        speed.plot(time, columns["airspeed [km/s]"], color=LINEAR)
        speed.set(xlabel="time from reentry (min)", ylabel="airspeed (km/s)", title="Speed")
        load.plot(time[inside], force[inside], color=LINEAR)
        load.set(xlabel="time from reentry (min)", ylabel="force per unit mass (g)", title="Aerodynamic force")
        load.set_ylim(bottom=0.0)
        for axes in (profile, speed):
            axes.margins(x=0.02)
        start = events["start of navigation"]
        speed.axvline(start, color=FLOWN, linewidth=1.0, linestyle="--")
        speed.annotate(" navigation starts", (start, 0.02), xycoords=("data", "axes fraction"), color=FLOWN, fontsize=8)
        peak = f"{force.max():.2f} g"
        return svg(
            figure,
            "flight",
            "What was flown",
            f"Altitude against range, airspeed and aerodynamic force against time; the peak force is {peak}.",
        )


def sigma_ratios(content: Content) -> str:
    """Forest plot of the sigma ratios, paired and plain, against the tolerance."""
    names, outputs = content.output_names, content.comparison.outputs
    tolerance = content.criterion.tolerance
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 0.9 + 0.55 * len(names))
        axes: Axes = axes_array[0, 0]
        axes.axvspan(1.0 - tolerance, 1.0 + tolerance, color="#e4eef7", zorder=0)
        axes.axvline(1.0, color=LINEAR, linewidth=1.2)
        for row, output in enumerate(outputs):
            for judgement, shift, colour, marker, label in (
                (output.paired, -0.14, FLOWN, "o", "paired estimate"),
                (output.plain, 0.16, MUTED, "s", "plain sample"),
            ):
                if judgement.ratio is None or judgement.interval is None:
                    continue
                low, high = judgement.interval
                axes.plot([low, high], [row + shift] * 2, color=colour, linewidth=2.0, solid_capstyle="butt")
                axes.plot(
                    judgement.ratio, row + shift, marker, color=colour, markersize=6, label=label if row == 0 else None
                )
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("Monte Carlo sigma / linear sigma (shaded: tolerance)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return svg(
            figure,
            "ratios",
            "Sigma ratios",
            "For each output the ratio of Monte Carlo to linear sigma with its interval, and the tolerance around one.",
        )


def budget(content: Content) -> str:
    """Stacked shares of each source in each output's linear variance."""
    names, shares = content.output_names, content.budget.shares
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 1.3 + 0.5 * len(names))
        axes: Axes = axes_array[0, 0]
        left = np.zeros(len(names))
        for number, source in enumerate(content.source_names):
            width = np.nan_to_num(shares[:, number])
            if not (width > 0.0).any():
                continue
            colour = SOURCE_COLOURS[number % len(SOURCE_COLOURS)]
            axes.barh(np.arange(len(names)), 100 * width, left=100 * left, color=colour, label=source, height=0.62,
                      edgecolor="white", linewidth=0.6)  # fmt: skip
            for row in range(len(names)):
                if width[row] >= 0.08:
                    place = 100 * (left[row] + 0.5 * width[row])
                    axes.text(
                        place, row, f"{100 * width[row]:.0f}", ha="center", va="center", color=_on(colour), fontsize=8
                    )
            left += width
        axes.axvline(100.0, color=INK, linewidth=0.8)
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("share of the linear variance (%)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.03))
        return svg(
            figure, "budget", "Error budget", "Share of each error source in the linear variance of each output."
        )


def correlation_maps(content: Content) -> str:
    """Linear and sample correlation matrices and their difference."""
    comparison, names = content.comparison, content.output_names
    linear, sample = correlations(comparison.covariance_linear), correlations(comparison.covariance_sample)
    panels = [("linear, P·S·Pᵀ", linear, 1.0), ("Monte Carlo", sample, 1.0)]
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure, axes_array = new(9.0, 3.9, 1, 2)
        for axes, (title, matrix, limit) in zip(axes_array[0], panels, strict=True):
            axes.imshow(matrix, cmap="RdBu_r", vmin=-limit, vmax=limit)
            axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
            axes.set_yticks(range(len(names)), names)
            axes.set_title(title)
            axes.spines[:].set_visible(False)
            for (row, column), value in np.ndenumerate(matrix):
                if np.isfinite(value):
                    colour = "white" if abs(value) > 0.6 else INK
                    axes.text(column, row, f"{value:+.3f}", ha="center", va="center", color=colour, fontsize=8.5)
        return svg(
            figure,
            "correlation",
            "Correlations of the final errors",
            "Correlation matrices of the outputs, by linear analysis and from the flown samples.",
        )


def _ellipse(axes: Axes, centre: Array, covariance: Array, colour: str, style: str, label: str | None) -> None:
    """Ellipses of one and three sigma."""
    values, vectors = np.linalg.eigh(covariance)
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    for sigma in (1.0, 3.0):
        height, width = 2.0 * sigma * np.sqrt(np.maximum(values, 0.0))
        axes.add_patch(
            Ellipse(
                (float(centre[0]), float(centre[1])),
                width,
                height,
                angle=angle,
                fill=False,
                edgecolor=colour,
                linestyle=style,
                linewidth=1.5,
                label=label if sigma == 1.0 else None,
            )
        )


def scatter(content: Content) -> str:
    """Flown final errors of each pair of outputs with the linear and the sample ellipses."""
    names, units, scale = content.output_names, content.output_units, content.output_scale
    flown = content.flown
    points = flown[:: max(1, len(flown) // SCATTERED)]
    comparison = content.comparison
    square = np.outer(scale, scale)
    linear, sample = comparison.covariance_linear * square, comparison.covariance_sample * square
    centre, mean = content.model.outcome_mean * scale, comparison.mean_sample * scale
    pairs = list(combinations(range(len(names)), 2))
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.9 * rows + 0.3, rows, columns)
        for axes, (i, j) in zip(axes_array.flat, pairs, strict=False):
            axes.plot(points[:, i], points[:, j], ".", color="#9aa5b1", markersize=2.0, alpha=0.55, rasterized=True,
                      markeredgewidth=0.0)  # fmt: skip
            pick = np.ix_([i, j], [i, j])
            first = (i, j) == pairs[0]
            _ellipse(axes, centre[[i, j]], linear[pick], LINEAR, "-", "linear, 1 and 3 sigma" if first else None)
            _ellipse(axes, mean[[i, j]], sample[pick], FLOWN, "--", "Monte Carlo, 1 and 3 sigma" if first else None)
            axes.locator_params(nbins=5)
            axes.set_xlabel(f"{names[i]} ({units[i]})")
            axes.set_ylabel(f"{names[j]} ({units[j]})")
        figure.legend(loc="outside upper left", ncols=2)
        return svg(
            figure,
            "scatter",
            "Final errors, pair by pair",
            f"{len(points)} of {len(flown)} flown samples with linear and Monte Carlo ellipses of one and three sigma.",
        )


def histograms(content: Content) -> str:
    """Distribution of each output against the linear Gaussian."""
    names, units, scale = content.output_names, content.output_units, content.output_scale
    flown = content.flown
    sigma = np.sqrt(np.diag(content.comparison.covariance_linear)) * scale
    centre = content.model.outcome_mean * scale
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.5 * -(-len(names) // 2) + 0.3, -(-len(names) // 2), 2)
        for i, axes in zip(range(len(names)), axes_array.flat, strict=False):
            reach = 4.5 * sigma[i] if sigma[i] > 0.0 else np.ptp(flown[:, i]) + 1.0
            edges = np.linspace(centre[i] - reach, centre[i] + reach, 64)
            counts, _ = np.histogram(flown[:, i], edges)
            density = counts / (len(flown) * np.diff(edges))
            axes.stairs(density, edges, fill=True, color="#f3c9a8", label="Monte Carlo" if i == 0 else None)
            if sigma[i] > 0.0:
                x = np.linspace(edges[0], edges[-1], 200)
                bell = np.exp(-0.5 * ((x - centre[i]) / sigma[i]) ** 2) / (sigma[i] * np.sqrt(2.0 * np.pi))
                axes.plot(x, bell, color=LINEAR, linewidth=1.6, label="linear Gaussian" if i == 0 else None)
            axes.set_xlabel(f"{names[i]} ({units[i]})")
            axes.locator_params(axis="x", nbins=7)
            axes.set_yticks([])
            axes.set_ylim(bottom=0.0)
            outside = len(flown) - int(counts.sum())
            if outside:
                axes.set_title(f"{outside:,} beyond the picture", fontsize=8)
        figure.legend(loc="outside upper left", ncols=2)
        return svg(
            figure,
            "histograms",
            "Distribution of each output",
            "Histograms of the flown final errors with the normal density of linear analysis.",
        )


def nees(content: Content) -> str:
    """Histogram of NEES against the chi-square density that linear analysis expects."""
    comparison = content.comparison
    if comparison.ellipsoid is None:
        return ""
    dimension, values = comparison.ellipsoid.dimension, comparison.ellipsoid.values
    expected = float(special.chdtri(dimension, 5e-4))
    top = min(max(expected, float(np.quantile(values, 0.98))), 10.0 * expected)
    edges = np.linspace(0.0, top, 80)
    counts, _ = np.histogram(values, edges)
    outside = len(values) - int(counts.sum())
    with mpl.rc_context(STYLE):
        figure, axes_array = new(9.0, 2.7)
        axes: Axes = axes_array[0, 0]
        axes.stairs(counts / (len(values) * np.diff(edges)), edges, fill=True, color="#f3c9a8", label="Monte Carlo")
        x = np.linspace(1e-6, top, 300)
        density = np.exp(special.xlogy(0.5 * dimension - 1.0, x) - 0.5 * x - special.gammaln(0.5 * dimension))
        density /= 2.0 ** (0.5 * dimension)
        axes.plot(x, density, color=LINEAR, linewidth=1.6, label=f"chi-square, {dimension} degrees")
        axes.set(xlabel="NEES against the linear covariance", yticks=[], ylim=(0.0, None))
        axes.legend(loc="upper right")
        if outside:
            axes.set_title(f"{outside:,} of {len(values):,} beyond the picture", fontsize=8)
        return svg(
            figure,
            "nees",
            "NEES of the flown errors",
            f"Histogram of the normalised error squared with the chi-square density of {dimension} degrees of freedom.",
        )
