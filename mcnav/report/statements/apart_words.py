"""Outputs that a verdict sets apart, in words: differences below the floor, and heavy tails."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from mcnav.report.format import number
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements.joint_words import joined

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

DIGITS: Final = 2
"""Significant digits of a floor."""


def negligible(summary: Summary) -> str:
    """Name the outputs whose differences are too small to count, with their floors; empty without any."""
    units = shown_units(summary)
    named = [
        f"{humanize(name)} (up to {number(floor * units[name][0], DIGITS)} {units[name][1]})"
        for name, floor in zip(summary.names, summary.floors, strict=False)
        if floor is not None
    ]
    return f"Differences too small to matter count as agreement: {joined(named)}." if named else ""


def not_joint(summary: Summary) -> str:
    """Name the outputs that the joint verdict leaves out, and why; empty where it is on all."""
    withheld = without_verdict(summary)
    heavy = [humanize(name) for name in summary.not_joint if name in withheld]
    small = [humanize(name) for name in summary.not_joint if name not in withheld]
    reasons = [f"{joined(small)} (hardly any dispersion)"] if small else []
    reasons += [f"{joined(heavy)} (heavy tails)"] if heavy else []
    return f"The joint verdict leaves out {' and '.join(reasons)}." if reasons else ""


def without_verdict(summary: Summary) -> tuple[str, ...]:
    """Return the outputs, by name, that have no verdict because of heavy tails: all in a run of an earlier version."""
    if not summary.heavy_tailed:
        return ()
    return tuple(summary.names if summary.withheld is None else summary.withheld)
