"""Measured and nominal rates as a table."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Final

from scipy.stats import chi2

from mcnav.analysis import linear_samples as doubts
from mcnav.identification.choice import PENALTY
from mcnav.judgement.chance import FALSE_ALARM as FALSE_ALARM_OF_FILES
from mcnav.sampler.distributions import tail_weight
from mcnav.sampler.error_model import HEAVY_TAILS, LONG_TAILS
from mcnav.statistics.power import USUAL_POWER
from mcnav.statistics.proportions import probability_interval
from tests.calibration.cells import LEVEL, Cell, Tally
from tests.calibration.identification_trials import ABSENT
from tests.calibration.named_trials import CHECKS, NO_FAULT
from tests.calibration.noise_trials import DETECTABLE, DOUBTED
from tests.calibration.trials import SOURCES

if TYPE_CHECKING:
    import pandas as pd

NOMINAL: Final = {"coverage": LEVEL, "false alarm": 1.0 - LEVEL}
"""Nominal rates by kind."""

NOMINAL_OF: Final = {
    ("false alarm", DOUBTED): doubts.FALSE_ALARM,
    ("power", DETECTABLE): USUAL_POWER,
    ("false alarm", ABSENT): 0.5 * float(chi2.sf(PENALTY, 1)),
    ("false alarm", NO_FAULT): CHECKS * FALSE_ALARM_OF_FILES,
}
"""Nominal rates by kind and statement, where they are others."""

FALSE_ALARM: Final = 1e-3
"""Probability that a correct rate is marked as off, for one row."""

SLACK: Final = 0.01
"""Deviation beyond the binomial interval that is tolerated: intervals from finite samples are asymptotic."""


def rates(counted: Tally) -> pd.DataFrame:
    """Tabulate the measured rate of each cell, its exact binomial interval at 95 %, and the finding.

    ``finding``: ``withheld`` where the program does not report the statement because of heavy tails; ``as stated`` when
    the nominal rate is within the binomial interval at 99.9 %; ``safe`` when the rate is outside on the conservative
    side (higher coverage or power, fewer false alarms); ``remarked`` when it is not, but the program warns of such
    campaigns; ``nearly`` when outside by less than `SLACK`; else ``off``. Most powers have no nominal rate and no
    finding.
    """
    import pandas as pd

    rows = []
    for cell in sorted(counted.made):
        count, hit = counted.made[cell], counted.hits[cell]
        nominal = NOMINAL_OF.get((cell.kind, cell.statement), NOMINAL.get(cell.kind))
        low, high = probability_interval(hit, count, 0.95)
        finding = "" if nominal is None else _finding(cell, nominal, hit, count)
        rates = {"nominal": nominal, "measured": hit / count, "low": low, "high": high, "finding": finding}
        rows.append(asdict(cell) | {"campaigns": count} | rates)
    return pd.DataFrame(rows)


def _finding(cell: Cell, nominal: float, hit: int, count: int) -> str:
    weight = tail_weight(SOURCES[cell.sources][0])
    if weight > HEAVY_TAILS[cell.design]:
        return "withheld"
    low, high = probability_interval(hit, count, 1.0 - FALSE_ALARM)
    if low <= nominal <= high:
        return "as stated"
    if (low > nominal) == (cell.kind != "false alarm"):
        return "safe"
    if weight > LONG_TAILS:
        return "remarked"
    return "nearly" if low - SLACK <= nominal <= high + SLACK else "off"
