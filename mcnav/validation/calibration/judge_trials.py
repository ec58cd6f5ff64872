"""Measured error rates of ``mcnav judge``: simulated flights, recorded and judged like any other.

Each flight is a sample of the reference engine: its true motion, readings and measurements are nonlinear and its own.
The campaign's filter goes through each record, and the innovations are judged by the campaign: right ones, and ones
whose flights had another size than the campaign says. Flights are judged by hundreds, each hundred with the linear
system of its first flight and with simulated records of its own.

``python -m mcnav.validation.calibration.judge_trials CAMPAIGN FLIGHTS`` prints the table of the documentation.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from scipy.stats import chi2

from mcnav._threads import one_thread
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import FilteredRecord
from mcnav.contract.scenario import can_be_recorded
from mcnav.execution.chunks import DrawPlan
from mcnav.judgement.assessment import Assessment, assess
from mcnav.judgement.likelihood import estimate_factor
from mcnav.judgement.simulation import Innovations, beside, recorded

HUNDRED: Final = 100
SIMULATED, TRIALS = 1000, 100

EVERY: Final = 5
"""Flights of which one has its interval computed; and the share of flights with something wrong."""

WRONG: Final[Mapping[str, tuple[str, str, str, tuple[float, ...]]]] = {
    "nothing": ("", "", "gyro_angle_random_walk", (1.0,)),
    "GNSS position 1.5 times worse": ('position = "1 m"', 'position = "1.5 m"', "gnss_position_noise", (1.5,)),
    "angle random walk 3 times larger": ("0.3 deg/sqrt(h)", "0.9 deg/sqrt(h)", "gyro_angle_random_walk", (3.0,)),
    "an arm of 1 m neglected": (
        'interval = "1 s"', 'interval = "1 s"\nlever_arm = ["0.8 m", "-0.36 m", "-0.48 m"]', "gnss_lever_arm",
        (-0.8, 0.36, 0.48),
    ),
}  # fmt: skip
"""What is wrong: a text of the campaign, what it is in flight, the candidate to be named, and its factor or error.

An error of the lever arm is the used one less the true one.
"""


@dataclass(frozen=True)
class Rates:
    """Shares of flights with an alarm, with the right name, and whose interval holds the factor; and their number."""

    flights: int
    alarms: float
    named: float
    held: float


def fly(text: str, changed: str, interval: float, index: int) -> Innovations:
    """Simulate a flight of a changed campaign and take the campaign's filter through its record."""
    return recorded(_record(text, changed, interval, index))


def _record(text: str, changed: str, interval: float, index: int) -> FilteredRecord:
    campaign, flown = _read(text), _read(changed)
    if not can_be_recorded(campaign.scenario) or not can_be_recorded(flown.scenario):
        raise TypeError(f"{campaign.name} cannot be recorded")
    draws = DrawPlan(flown.errors, flown.design, flown.seed, flown.samples)
    errors = draws.batch(index, index + 1).errors[0]
    recording = flown.scenario.simulate_recording(errors, flown.seed, index, interval)
    mean = np.asarray(campaign.errors.mean)
    return campaign.scenario.filter_recording(recording, mean, campaign.errors.covariance)


_CAMPAIGNS: dict[str, Campaign] = {}


def _read(text: str) -> Campaign:
    """Read a campaign once in a process."""
    if text not in _CAMPAIGNS:
        _CAMPAIGNS[text] = campaign_from(tomllib.loads(text))
    return _CAMPAIGNS[text]


def rates(text: str, wrong: str, flights: int, interval: float = 0.02, processes: int = 1) -> Rates:
    """Measure the rates with one thing wrong."""
    before, after, name, values = WRONG[wrong]
    changed = re.sub(r"samples = \d+", f"samples = {max(flights, 2)}", text.replace(before, after) if before else text)
    flown = partial(fly, text, changed, interval)
    alarms = named = 0
    shares = list[float]()
    with one_thread(), ProcessPoolExecutor(processes) as pool:
        for first in range(0, flights, HUNDRED):
            last = min(first + HUNDRED, flights)
            innovations = list(pool.map(flown, range(first, last), chunksize=10))
            record = _record(text, changed, interval, first)
            result = assess(record, beside(innovations), SIMULATED, TRIALS, first)
            candidates = result.names[-result.candidates :]
            alarms += int(np.sum(result.alarms))
            right = result.alarms & (result.foremost == candidates.index(name))
            named += int(np.sum(right))
            shares.append(_held(record, result, innovations, name, values))
            print(
                f"{wrong}: {last} flights, {alarms} alarms, {named} named, intervals hold in {np.mean(shares):.3f}",
                file=sys.stderr,
                flush=True,
            )
    return Rates(flights, alarms / flights, named / flights, float(np.mean(shares)))


def _held(
    record: FilteredRecord, result: Assessment, innovations: Sequence[Innovations], name: str, values: tuple[float, ...]
) -> float:
    """Return the share of flights whose 95 % interval holds the factor, or whose 95 % ellipsoid holds the error."""
    causes = [cause.name for cause in record.causes]
    if name in causes:
        number = causes.index(name)
        drop = float(result.drops[number])
        estimates = [estimate_factor(record, each, number, drop) for each in innovations[::EVERY]]
        return float(np.mean([each.low <= values[0] <= each.high for each in estimates]))
    offsets = [offset.name for offset in record.offsets]
    estimate, covariance = result.offsets[offsets.index(name)]
    apart = estimate - np.array(values)[:, None]
    squares = np.einsum("ar,ar->r", apart, np.linalg.solve(covariance, apart))
    return float(np.mean(squares <= chi2.ppf(0.95, len(values))))


def main(campaign: Path, flights: int) -> None:
    """Print the rates of all that may be wrong."""
    text = campaign.read_text(encoding="utf-8")
    print("| wrong in flight | flights | alarms | named | interval holds |\n| --- | --- | --- | --- | --- |")
    for wrong in WRONG:
        measured = rates(text, wrong, flights if wrong == "nothing" else flights // EVERY, processes=2)
        shares = (f"{100.0 * each:.1f} %" for each in (measured.alarms, measured.named, measured.held))
        print(f"| {wrong} | {measured.flights:,} | " + " | ".join(shares) + " |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
