"""The kernels that were there before: reentry and cruise, so that what is done for three dimensions does not slow them.

python -m tests.benchmarks.inertial.earlier
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.config.read import read_campaign
from mcnav.contract.engine import without_noise
from tests.benchmarks.timing import fastest

ROOT: Final = Path(__file__).parent.parent.parent.parent
KERNELS: Final = {
    "reentry, trajectory 3": ("04_tn_d1772_trajectory_3", 0.26),
    "reentry, trajectory 4": ("01_tn_d1772_trajectory_4", 0.28),
    "cruise": ("11_cruise", 17.0),
}
"""Campaigns, and microseconds of one core per sample before there was a third dimension."""

FLOWN: Final = 8_192
PROBES: Final = 64


def measure(seconds: float = 0.5, flown: int = FLOWN) -> list[dict[str, Any]]:
    """Time the ensemble of each campaign as a run prepares it."""
    rows = []
    for name, (campaign_name, before) in KERNELS.items():
        campaign = read_campaign(ROOT / "campaigns" / f"{campaign_name}.toml")
        errors = np.asarray(campaign.errors.draw(campaign.design, campaign.seed, campaign.samples, 0, flown))
        engine = campaign.scenario.engine("ensemble", errors[:PROBES])
        without_noise(engine)(errors)
        spent = 1e6 * fastest(partial(without_noise(engine), errors), seconds).processor / flown
        rows.append({"name": name, "microseconds": spent, "before": before, "accuracy": engine.accuracy})
    return rows


if __name__ == "__main__":
    for row in measure():
        print(f"{row['name']}: {row['microseconds']:.3g} us a sample, {row['before']:g} before; {row['accuracy']}")
