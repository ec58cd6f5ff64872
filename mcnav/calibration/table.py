"""Measured rates beside nominal ones, as a table."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

from mcnav.calibration.trials import LEVEL, SOURCES, Cell
from mcnav.sampling.distributions import tail_weight
from mcnav.sampling.error_model import HEAVY_TAILS, LONG_TAILS
from mcnav.statistics.proportions import probability_interval

if TYPE_CHECKING:
    import pandas as pd

NOMINAL: Final = {"coverage": LEVEL, "false alarm": 1.0 - LEVEL}
FALSE_ALARM: Final = 1e-3
"""Probability with which a rate that is right is marked as off, for one row."""

SLACK: Final = 0.01
"""A rate that is off by less than this beyond its binomial error is called nearly right: intervals from finitely many
samples are asymptotic."""


def rates(hits: Counter[Cell], made: Counter[Cell]) -> pd.DataFrame:
    """One row for each cell: measured rate, its exact binomial interval at 95 %, and whether it is as stated.

    ``finding``: ``withheld`` where the program does not give the statement, because of tails; ``as stated`` when the
    nominal rate lies within the binomial interval at 99.9 %; ``safe`` when the rate is on the careful side of that (an
    interval that covers more often, a test that rejects less often); ``remarked`` where it is not, but the program says
    of such campaigns that their intervals are only nearly right; ``nearly`` when within a hundredth of it; else
    ``off``. Powers have no nominal rate, and no finding.
    """
    import pandas as pd

    rows = []
    for cell in sorted(made, key=lambda c: (c.kind, c.system, c.statement, c.sources, c.design, c.samples)):
        count, hit = made[cell], hits[cell]
        nominal = NOMINAL.get(cell.kind)
        low, high = probability_interval(hit, count, 0.95)
        rows.append(
            {
                "kind": cell.kind,
                "system": cell.system,
                "statement": cell.statement,
                "sources": cell.sources,
                "design": cell.design,
                "samples": cell.samples,
                "campaigns": count,
                "nominal": nominal,
                "measured": hit / count,
                "low": low,
                "high": high,
                "finding": "" if nominal is None else _finding(cell, nominal, hit, count),
            }
        )
    return pd.DataFrame(rows)


def _finding(cell: Cell, nominal: float, hit: int, count: int) -> str:
    weight = tail_weight(SOURCES[cell.sources][0])
    if weight > HEAVY_TAILS[cell.design]:
        return "withheld"
    low, high = probability_interval(hit, count, 1.0 - FALSE_ALARM)
    if low <= nominal <= high:
        return "as stated"
    if (low > nominal) == (cell.kind == "coverage"):
        return "safe"
    if weight > LONG_TAILS:
        return "remarked"
    return "nearly" if low - SLACK <= nominal <= high + SLACK else "off"
