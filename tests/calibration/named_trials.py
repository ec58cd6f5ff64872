"""Measured error rates of what ``mcnav judge`` names, on records that nothing of mcnav made (`own_records`).

Each record has at most one wrong thing. Faults of files must be named before any filter; of the others the share is
counted in which the first verdict is the wrong thing, alone or with others that are not told apart, and in which the
interval of what is named holds the true value. Alarms are against simulated records of one flight for all.

``python -m tests.calibration.named_trials COUNT [FIRST [WORDS]]`` prints the table, of those whose name has the words.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import FilteredRecord, RecordedMeasurements, RecordedTrack, Recording
from mcnav.contract.scenario import can_be_recorded
from mcnav.execution.threads import one_thread
from mcnav.judgement.assessment import LEVEL, Assessment, assess
from mcnav.judgement.findings import CauseVerdict, Finding, find_first
from mcnav.judgement.plain_files import find_fault
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import recorded
from mcnav.studies.recordings import moved_back
from tests.calibration.own_records import CAMPAIGN, FILE_FAULTS, READING, WRONG, Files, Flown, fly

SIMULATED: Final = 1000

POSITION, VELOCITY = ("latitude", "longitude", "altitude"), ("velocity_north", "velocity_east", "velocity_down")


@cache
def campaign() -> Campaign:
    return campaign_from(tomllib.loads(CAMPAIGN))


def recording_of(files: Files) -> Recording:
    """Return the files of a flight as a recording."""
    zero = files.imu["time"][0] - READING

    def stacked(table: Mapping[str, Array], names: tuple[str, ...]) -> Array:
        return np.stack([table[name] for name in names], axis=1)

    gyro, force = (stacked(files.imu, tuple(f"{name}_{axis}" for axis in "xyz")) for name in ("gyro", "accelerometer"))
    position = stacked(files.gnss, POSITION)
    values = {"position": position, "altitude": position[:, 2:], "velocity": stacked(files.gnss, VELOCITY)}
    gnss = RecordedMeasurements(files.gnss["time"] - zero, values)
    start = RecordedTrack(
        np.zeros(1), stacked(files.start, POSITION), stacked(files.start, VELOCITY),
        stacked(files.start, ("roll", "pitch", "heading")),
    )  # fmt: skip
    return Recording(files.imu["time"] - zero, gyro, force, {"gnss": gnss}, start)


def filtered(recording: Recording, delays: Mapping[str, float] | None = None) -> FilteredRecord:
    """Take the campaign's filter through a recording, the stamps of its sensors moved back by delays."""
    scenario = campaign().scenario
    assert can_be_recorded(scenario)
    errors = campaign().errors
    return scenario.filter_recording(moved_back(recording, delays or {}), np.asarray(errors.mean), errors.covariance)


def fault_named(recording: Recording, words: str) -> bool:
    """Return whether the files alone are refused with some words; none where they are not to be refused."""
    fault = find_fault(recording, 3.0, 0.02)
    return fault is None if not words else fault is not None and words in fault.message


@dataclass(frozen=True)
class Verdict:
    """Of one record: whether it is an alarm, and what is named first."""

    alarm: bool
    first: Finding | None


@cache
def simulated() -> Assessment:
    """Return an assessment with simulated records of one flight."""
    record = filtered(recording_of(fly(10_000_000)))
    of_campaign = with_causes(record, present(record))
    return assess(of_campaign, recorded(of_campaign), SIMULATED, 1, 0)


def judged(recording: Recording) -> Verdict:
    """Judge a record, against the simulated records of one flight."""
    record = filtered(recording)
    of_campaign = with_causes(record, present(record))
    own, against = assess(of_campaign, recorded(of_campaign), 1, 1, 0), simulated()
    scores = np.concatenate([np.abs(own.direct[:, 0] - against.centres), np.sqrt(2.0 * own.gains[:, 0])])
    alarm = bool(against.probability((scores / against.limits).max()) <= LEVEL)
    return Verdict(alarm, find_first(record, lambda delays: filtered(recording, delays)) if alarm else None)


def holds(finding: Finding, flown: Flown) -> bool:
    """Return whether the interval of what is named holds the true value."""
    number = finding.number
    if isinstance(number, CauseVerdict):
        true = {
            "gnss_jitter": flown.jitter, "gyro_bias_instability": flown.instability,
            "gnss_position_correlated": flown.correlated, "gnss_position_noise": flown.position,
            "gnss_velocity_noise": flown.velocity, "gyro_angle_random_walk": flown.walk,
        }.get(number.name)  # fmt: skip
        factor = number.factor
        assert factor is not None
        return true is None or factor.low * number.size <= true <= factor.high * number.size
    true_errors = {"gnss_delay": [flown.late - flown.imu_late], "gnss_lever_arm": [-part for part in flown.arm]}
    wanted = np.array(true_errors.get(number.name, np.zeros(len(number.estimate))))
    apart = np.abs(np.array(number.estimate) - wanted) / np.array(number.sigma)
    return bool(np.all(apart <= {1: 1.96, 3: 2.388}[len(apart)]))  # 95 % together


def main(count: int, first: int, words: str) -> None:
    """Print the rates of each wrong thing."""
    print("| wrong | records | alarms | named first | named, with others | interval holds |", flush=True)
    seeds = range(first, first + count)
    for name, (change, expected) in FILE_FAULTS.items():
        if words in name:
            named = sum(fault_named(recording_of(change(fly(seed))), expected) for seed in seeds)
            print(f"| {name} | {count} | {named} | {named} | | |", flush=True)
    for name, (flown, expected) in WRONG.items():
        if words not in name:
            continue
        with one_thread():
            verdicts = [judged(recording_of(fly(seed, flown))) for seed in seeds]
        found = [verdict.first for verdict in verdicts if verdict.first is not None]
        alone = sum(each.number.name == expected for each in found)
        right = [each for each in found if expected in (each.number.name, *each.rivals)]
        held = [holds(each, flown) for each in found if each.number.name == expected]
        others = sorted({each.number.name for each in found} - {expected})
        print(
            f"| {name} | {count} | {sum(each.alarm for each in verdicts)} | {alone} | {len(right)} | "
            f"{sum(held)} of {len(held)} | {', '.join(others)}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]), int((sys.argv[2:3] or ["0"])[0]), (sys.argv[3:4] or [""])[0])
