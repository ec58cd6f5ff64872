"""Measured error rates of ``mcnav judge``: simulated flights, recorded and judged like any other.

Each flight is a sample of the reference engine: its true motion, readings and measurements are nonlinear and its own.
The campaign's filter goes through each record, and its statistics are those of the linear system along this record.
They are compared with simulated records of every `TOGETHER`-th flight, as one flight's own take longer. Flights have
the campaign's numbers, or one that differs.

``python -m tests.calibration.judge_trials CAMPAIGN FLIGHTS [FIRST]`` prints the documentation's table, of so
many flights from a number on.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from scipy.stats import chi2

from mcnav.arrays.types import Array
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import FilteredRecord
from mcnav.contract.scenario import can_be_recorded
from mcnav.execution.threads import one_thread
from mcnav.judgement.assessment import LEVEL, Assessment, assess
from mcnav.judgement.likelihood import estimate_factor
from mcnav.judgement.simulation import recorded
from mcnav.runner.draws import DrawPlan

SIMULATED: Final = 1000

TOGETHER: Final = 50
"""Flights that are compared with the same simulated records."""

EVERY: Final = 5
"""Flights of which one has its interval computed; and the share of flights with something wrong."""

INTERVAL: Final = 0.02
"""Interval of the readings, s."""

WRONG: Final[Mapping[str, tuple[str, str, str, tuple[float, ...]]]] = {
    "nothing": ("", "", "gyro_angle_random_walk", (1.0,)),
    "GNSS position 1.5 times worse": ('position = "1 m"', 'position = "1.5 m"', "gnss_position_noise", (1.5,)),
    "angle random walk 3 times larger": ("0.3 deg/sqrt(h)", "0.9 deg/sqrt(h)", "gyro_angle_random_walk", (3.0,)),
    "an arm of 1 m neglected": (
        'interval = "1 s"', 'interval = "1 s"\nlever_arm = ["0.8 m", "-0.36 m", "-0.48 m"]', "gnss_lever_arm",
        (-0.8, 0.36, 0.48),
    ),
}  # fmt: skip
"""Mistakes: a text of the campaign, what it is in flight, the candidate to be named, and its factor or error.

An error of the lever arm is the used one less the true one.
"""


@dataclass(frozen=True)
class Flight:
    """Statistics of a flight: of its filter, gains of the candidates, and whether an interval holds the true value."""

    direct: Array
    gains: Array
    held: bool | None


@dataclass(frozen=True)
class Rates:
    """Shares of flights with an alarm, with the right name, and whose interval holds the true value."""

    flights: int
    alarms: float
    named: float
    held: float


def record_of(text: str, changed: str, index: int) -> FilteredRecord:
    """Simulate a flight of a changed campaign and take the campaign's filter through its record."""
    campaign, flown = _read(text), _read(changed)
    if not can_be_recorded(campaign.scenario) or not can_be_recorded(flown.scenario):
        raise TypeError(f"{campaign.name} cannot be recorded")
    draws = DrawPlan(flown.errors, flown.design, flown.seed, 1_000_000)
    errors = draws.batch(index, index + 1).errors[0]
    recording = flown.scenario.simulate_recording(errors, flown.seed, index, INTERVAL)
    mean = np.asarray(campaign.errors.mean)
    return campaign.scenario.filter_recording(recording, mean, campaign.errors.covariance)


_CAMPAIGNS: dict[str, Campaign] = {}


def _read(text: str) -> Campaign:
    """Read a campaign once in a process."""
    if text not in _CAMPAIGNS:
        _CAMPAIGNS[text] = campaign_from(tomllib.loads(text))
    return _CAMPAIGNS[text]


def compared(text: str, changed: str, first: int) -> Assessment:
    """Return an assessment with simulated records, of the flight that is the first of some."""
    record = record_of(text, changed, first)
    return assess(record, recorded(record), SIMULATED, 1, first)


def fly(text: str, changed: str, name: str, values: tuple[float, ...], index: int) -> Flight:
    """Compute the statistics of a flight by the linear system along its own record."""
    record = record_of(text, changed, index)
    own = assess(record, recorded(record), 1, 1, index)
    held = _held(record, own, name, values) if index % EVERY == 0 else None
    return Flight(own.direct[:, 0], own.gains[:, 0], held)


def _held(record: FilteredRecord, own: Assessment, name: str, values: tuple[float, ...]) -> bool:
    """Return whether the interval of a factor, or the 95 % ellipsoid of an error, holds the true value."""
    causes = [cause.name for cause in record.causes]
    if name in causes:
        estimate = estimate_factor(record, recorded(record), causes.index(name))
        return estimate.low <= values[0] <= estimate.high
    offsets = [offset.name for offset in record.offsets]
    estimates, covariance = own.offsets[offsets.index(name)]
    apart = estimates[:, 0] - values
    return bool(apart @ np.linalg.solve(covariance, apart) <= chi2.ppf(0.95, len(values)))


def rates(text: str, wrong: str, flights: range, processes: int = 1) -> Rates:
    """Measure the rates with one thing wrong, in flights of some numbers."""
    before, after, name, values = WRONG[wrong]
    changed = text.replace(before, after) if before else text
    alarms, named, held = 0, 0, list[bool]()
    with one_thread(), ProcessPoolExecutor(processes) as pool:
        for first in flights[::TOGETHER]:
            indices = range(first, min(first + TOGETHER, flights.stop))
            simulated = pool.submit(compared, text, changed, first)
            done = list(pool.map(partial(fly, text, changed, name, values), indices))
            against = simulated.result()
            number = against.names[-against.candidates :].index(name)
            for flight in done:
                direct = np.abs(flight.direct - against.centres)
                scores = np.concatenate([direct, np.sqrt(2.0 * flight.gains)]) / against.limits
                alarm = bool(against.probability(scores.max()) <= LEVEL)
                alarms += alarm
                named += alarm and int(np.argmax(flight.gains - against.freedom)) == number
                held += [] if flight.held is None else [flight.held]
            told = f"{wrong}: flights to {indices[-1]}, {alarms} alarms, {named} named"
            print(f"{told}, {sum(held)} of {len(held)} intervals hold", file=sys.stderr, flush=True)
    return Rates(len(flights), alarms / len(flights), named / len(flights), float(np.mean(held)))


def main(campaign: Path, flights: int, first: int = 0) -> None:
    """Print the rates of all that may be wrong."""
    text = campaign.read_text(encoding="utf-8")
    print("| wrong in flight | flights | alarms | named | interval holds |\n| --- | --- | --- | --- | --- |")
    for wrong in WRONG:
        count = flights if wrong == "nothing" else flights // EVERY
        measured = rates(text, wrong, range(first, first + count), processes=2)
        shares = (f"{100.0 * each:.1f} %" for each in (measured.alarms, measured.named, measured.held))
        print(f"| {wrong} | {measured.flights:,} | " + " | ".join(shares) + " |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:4]))
