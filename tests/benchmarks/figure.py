"""Work against precision as a figure: microseconds a sample against the largest error, a line for each peer."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as MplFigure

from tests.benchmarks.compare import TARGETS
from tests.benchmarks.peers import PEERS

MARKERS: Final = "osD^v<>PX*h"
SMALLEST: Final = 1e-9
"""Smaller errors are below what the reference itself is good for, and are drawn at it."""


def work_precision(record: Mapping[str, Any]) -> str:
    """The figure as SVG."""
    cases = record["cases"]
    figure = MplFigure(figsize=(5.4 * len(cases), 5.6), layout="constrained")
    panels = figure.subplots(1, len(cases), sharey=True, squeeze=False)[0]
    for panel, case in zip(panels, cases, strict=True):
        _draw(panel, case, record)
    panels[0].set_ylabel("µs of processor time a sample")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    written = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "mcnav", "svg.fonttype": "none"}):
        figure.savefig(written, format="svg", metadata={"Date": None})
    return written.getvalue()


def _draw(panel: Axes, case: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    colours = mpl.colormaps["tab20"].colors[::2] + mpl.colormaps["tab20"].colors[1::2]
    known = {row["peer"]: row for row in record["peers"] if row["trajectory"] == case["trajectory"]}
    for place, name in enumerate(PEERS):
        found = known.get(name, {})
        points = [each for each in found.get("settings", ()) if each.get("error") is not None]
        label = name if points else f"{name} (missing)"
        panel.plot(
            [max(each["error"], SMALLEST) for each in points],
            [each["microseconds"] for each in points],
            marker=MARKERS[place],
            color=colours[place],
            linewidth=2.2 if name == "mcnav" else 1.2,
            label=label,
        )
    for target in TARGETS:
        panel.axvline(target, color="0.7", linewidth=0.8, linestyle=":")
    panel.set(xscale="log", yscale="log", title=f"Trajectory {case['trajectory']}")
    panel.set_xlabel("largest error, share of sigma")
    panel.invert_xaxis()
    panel.grid(True, which="major", color="0.9")
