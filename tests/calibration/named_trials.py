"""Measured error rates of what ``mcnav judge`` says, on records that nothing of mcnav made (`own_records`).

`judge, NAME`
    Records with one wrong thing each. A fault of the files must be named before any filter. Of the others the shares
    are counted in which the first verdict is the wrong thing, alone or with others that are not told apart; in which
    its interval holds the true value; and in which a second judgement has nothing against the campaign once the
    printed TOML is pasted.
`judge, nothing`
    Records of the campaign itself: false alarms, and intervals of all its numbers and of constant errors that it lacks.

Every record is a row of a CSV file, which is continued. Alarms are against simulated records of one flight for all,
those after pasting against simulated ones of the record itself. ``python -m tests.calibration.named_trials CSV RECORDS
[SECONDS [WORDS]]`` measures records of which the name has the words until the time is over.
"""

from __future__ import annotations

import csv
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import FilteredRecord, RecordedMeasurements, RecordedTrack, Recording
from mcnav.contract.scenario import can_be_recorded
from mcnav.execution.threads import one_thread
from mcnav.judgement.assessment import LEVEL, Assessment, assess
from mcnav.judgement.findings import CauseVerdict, Changes, Finding, OffsetVerdict, find_first
from mcnav.judgement.naming import CLOCK, Naming
from mcnav.judgement.numbers import list_numbers, with_intervals
from mcnav.judgement.plain_files import find_fault
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import recorded
from mcnav.report.pages.judged import to_paste
from mcnav.studies.recordings import moved_back
from tests.calibration.cells import Cell, Tally
from tests.calibration.own_records import CAMPAIGN, FILE_FAULTS, READING, WRONG, Files, Flown, fly

JUDGE: Final = "judge"
"""Beginning of the names of the systems."""

NOTHING: Final = "nothing"
"""Records without a wrong thing."""

CSV: Final = "judged_records.csv"

NO_FAULT: Final = "a fault of the files that is none"

CHECKS: Final = 10
"""Checks of files that noise may set off, at most."""

SIMULATED: Final = 4000
"""Simulated records by which alarms are raised."""

AFTERWARDS: Final = 300
"""Simulated records by which a changed campaign is judged."""

CLEAN: Final = 5
"""Records without a wrong thing for each record of another sort."""

TOGETHER: Final[Mapping[int, float]] = {1: 1.959964, 3: 2.387739}
"""Sigmas within which so many independent estimates are, all of them, with 95 %."""

POSITION, VELOCITY = ("latitude", "longitude", "altitude"), ("velocity_north", "velocity_east", "velocity_down")


@cache
def content() -> dict[str, Any]:
    return tomllib.loads(CAMPAIGN)


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


@cache
def own_campaign() -> Campaign:
    return campaign_from(content())


def filtered(
    recording: Recording, delays: Mapping[str, tuple[float, float]] | None = None, campaign: Campaign | None = None
) -> FilteredRecord:
    """Take a campaign's filter through a recording, the stamps of its sensors moved back by delays."""
    campaign = campaign or own_campaign()
    scenario = campaign.scenario
    assert can_be_recorded(scenario)
    errors = campaign.errors
    return scenario.filter_recording(moved_back(recording, delays or {}), np.asarray(errors.mean), errors.covariance)


def fault_named(recording: Recording, words: str) -> bool:
    """Return whether the files alone are refused with some words; none where they are not to be refused."""
    fault = find_fault(recording, 3.0, 0.02)
    return fault is None if not words else fault is not None and words in fault.message


@cache
def simulated() -> Assessment:
    """Return an assessment with simulated records of one flight."""
    record = filtered(recording_of(fly(10_000_000)))
    of_campaign = with_causes(record, present(record))
    return assess(of_campaign, recorded(of_campaign), SIMULATED, 1, 0)


def pasted(finding: Finding) -> Campaign:
    """Return the campaign with the printed TOML of a finding pasted: each entry in its table, a sensor's in its own."""
    content = tomllib.loads(CAMPAIGN)
    for table, entries in tomllib.loads(to_paste(SimpleNamespace(findings=[finding], explained=True))).items():  # type: ignore[arg-type]
        _paste(content, table, entries)
    return campaign_from(content)


def _paste(content: dict[str, Any], key: str, value: Any) -> None:
    if isinstance(value, Mapping) and isinstance(content.get(key), Mapping):
        for inner, changed in value.items():
            _paste(content[key], inner, changed)
    elif key == "aiding":
        content[key][0] |= value[0]
    else:
        content[key] = value


def afterwards(recording: Recording, finding: Finding) -> float:
    """Return the probability of a record as unusual with a finding pasted, or a clock corrected."""
    if finding.number.name.endswith(CLOCK):
        assert isinstance(finding.number, OffsetVerdict)
        fast = finding.number.estimate[0]
        moves = {finding.number.name.removesuffix(CLOCK): (finding.number.at_start, fast / (1.0 + fast))}
        recording = moved_back(recording, moves)
    record = filtered(recording, campaign=pasted(finding))
    of_campaign = with_causes(record, present(record))
    result = assess(of_campaign, recorded(of_campaign), AFTERWARDS, 1, 0)
    return float(result.probability(result.scores.max(axis=0))[0])


@dataclass(frozen=True)
class Row:
    """What is said of one record.

    Attributes
    ----------
    fault : bool
        Whether the files are said to have the fault that they have, or none where they have none.
    probability : float
        Of a record as unusual in the campaign; NaN where the files have a fault.
    named, rivals : str
        The first verdict, and what is not told apart from it, with blanks between.
    right, holds : bool
        Whether the wrong thing is among them, and whether an interval of theirs holds the true value.
    shown : bool
        Whether the wrong thing stands: its likelihood passes the tests without which nothing is named.
    left : float
        Probability of a record as unusual once the first verdict is pasted; NaN where it was not judged again.
    stated, excluded : str
        Numbers of which an interval is stated beside the first verdict, and those whose interval excludes the truth.
    """

    wrong: str
    seed: int
    fault: bool
    probability: float = np.nan
    named: str = ""
    rivals: str = ""
    right: bool = False
    shown: bool = False
    holds: bool = False
    left: float = np.nan
    stated: str = ""
    excluded: str = ""


def trial(wrong: str, seed: int) -> Row:
    """Judge a record with one wrong thing."""
    if wrong in FILE_FAULTS:
        change, expected = FILE_FAULTS[wrong]
        return Row(wrong, seed, fault_named(recording_of(change(fly(seed))), expected))
    flown, expected = WRONG[wrong]
    recording = recording_of(fly(seed, flown))
    record = filtered(recording)
    of_campaign = with_causes(record, present(record))
    own, against = assess(of_campaign, recorded(of_campaign), 1, 1, 0), simulated()
    scores = np.concatenate([np.abs(own.direct[:, 0] - against.centres), np.sqrt(2.0 * own.gains[:, 0])])
    probability = float(against.probability((scores / against.limits).max()))
    first = find_first(record, lambda delays: filtered(recording, delays)) if probability <= LEVEL else None
    finding, changes = (None, Changes(record)) if first is None else first
    drops = dict(zip(present(record), against.drops.tolist(), strict=True))
    numbers = with_intervals(*list_numbers(of_campaign, own), () if finding is None else (finding,), changes, drops)
    names = [number.name for number in (*numbers[0], *numbers[1])]
    # what is named for certain is counted apart
    certain = finding.number.name if finding is not None and not finding.rivals else ""
    others = [number for number in (*numbers[0], *numbers[1]) if number.name != certain]
    excluded = [number.name for number in others if not holds(number, flown)]
    fault = fault_named(recording, "")
    if finding is None:
        shown = wrong != NOTHING and stands(record, expected)
        return Row(
            wrong, seed, fault, probability, shown=shown, stated=" ".join(names), excluded=" ".join(excluded)
        )  # fmt: skip
    first, *rivals = (number.name for number in finding.alternatives)
    right = expected in (first, *rivals)
    shown = right or (wrong != NOTHING and stands(record, expected))
    return Row(
        wrong, seed, fault, probability, first, " ".join(rivals), right, shown,
        any(holds(number, flown) for number in finding.alternatives), afterwards(recording, finding),
        " ".join(number.name for number in others), " ".join(excluded),
    )  # fmt: skip


def stands(record: FilteredRecord, name: str) -> bool:
    """Return whether a record shows something: what is named always stands, and what stands may be less likely."""
    return next(candidate.stands for candidate in Naming(record).candidates if candidate.name == name)


def holds(number: CauseVerdict | OffsetVerdict, flown: Flown) -> bool:
    """Return whether the interval of a number holds the true value; of several axes all of them."""
    if isinstance(number, CauseVerdict):
        true = {
            "gnss_jitter": flown.jitter, "gyro_bias_instability": flown.instability,
            "gnss_position_correlated": flown.correlated, "gnss_position_noise": flown.position,
            "gnss_velocity_noise": flown.velocity, "gyro_angle_random_walk": flown.walk,
            "accelerometer_bias_instability": 0.0, "gnss_velocity_correlated": 0.0,
        }.get(number.name, number.size)  # fmt: skip
        factor = number.factor
        assert factor is not None
        return bool(factor.low * number.size <= true <= factor.high * number.size)
    true_errors = {
        "gnss_delay": [flown.late - flown.imu_late], "gnss_clock_rate": [flown.clock - flown.imu_clock],
        "gnss_lever_arm": [-part for part in flown.arm],
    }  # fmt: skip
    wanted = np.array(true_errors.get(number.name, np.zeros(len(number.estimate))))
    apart = np.abs(np.array(number.estimate) - wanted) / np.array(number.sigma)
    return bool(np.all(apart <= TOGETHER[len(apart)]))


def measure(path: Path, records: int, seconds: float = np.inf, words: str = "") -> list[Row]:
    """Judge so many records of each sort, those that a file does not have, and return all."""
    rows = read_rows(path)
    done, began = Counter(row.wrong for row in rows), time.monotonic()
    seeds = {(row.wrong, row.seed) for row in rows}
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        if not rows:
            writer.writeheader()
        for wrong, seed in _wanted(records):
            enough = done[wrong] >= (records * CLEAN if wrong == NOTHING else records)
            if enough or (wrong, seed) in seeds or words not in wrong:
                continue
            if time.monotonic() - began > seconds:
                break
            with one_thread():
                rows.append(trial(wrong, seed))
            done[wrong] += 1
            writer.writerow(asdict(rows[-1]))
            file.flush()
    return rows


def _wanted(records: int) -> Iterator[tuple[str, int]]:
    """Yield sorts and seeds, one record of each sort after the other; no two sorts have the same noise."""
    sorts = (*FILE_FAULTS, *WRONG)
    for record in range(records * CLEAN):
        for place, wrong in enumerate(sorts):
            if record < records or wrong == NOTHING:
                yield wrong, len(sorts) * record + place


def read_rows(path: Path) -> list[Row]:
    """Read the rows of a file; none where there is none."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Row(
                row["wrong"], int(row["seed"]), row["fault"] == "True", float(row["probability"]), row["named"],
                row["rivals"], row["right"] == "True", row["shown"] == "True", row["holds"] == "True",
                float(row["left"]), row["stated"], row["excluded"],
            )
            for row in csv.DictReader(file)
        ]  # fmt: skip


def count(rows: Sequence[Row]) -> Tally:
    """Count the statements of records."""
    result = Tally()

    def add(kind: str, row: Row, statement: str, hit: bool) -> None:
        result.add(Cell(kind, f"{JUDGE}, {row.wrong}", statement, "normal", "random", 1), hit)

    for row in rows:
        if row.wrong in FILE_FAULTS:
            add("power", row, "the fault of the files is named", row.fault)
            continue
        add("false alarm", row, NO_FAULT, not row.fault)
        excluded = row.excluded.split()
        for name in row.stated.split():
            add(
                "coverage",
                replace(row, wrong="all records"),
                f"interval of {name}",
                name not in excluded,
            )
        if row.wrong == NOTHING:
            add("false alarm", row, "alarm", row.probability <= LEVEL)
            continue
        add("power", row, "alarm", row.probability <= LEVEL)
        add("power", row, "named first, or with what is not told apart", row.right)
        if row.shown:
            add("power", row, "the same where the record shows it", row.right)
        if row.right:
            add("coverage", row, "interval of what is wrong", row.holds)
        if row.right and not np.isnan(row.left):
            add("power", row, "nothing left once it is pasted", row.left > LEVEL)
    return result


def rate_lines(rows: Sequence[Row]) -> list[str]:
    """Return a table: how often each wrong thing is named, its interval holds, and pasting it leaves nothing."""
    lines = [
        "| wrong | records | alarms | named first | or with others | where it shows | interval holds "
        "| pasted: nothing left |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for wrong in (*FILE_FAULTS, *WRONG):
        own = [row for row in rows if row.wrong == wrong]
        if wrong in FILE_FAULTS:
            named = sum(row.fault for row in own)
            lines.append(f"| {wrong} | {len(own)} | | {named} | {named} | | | |")
            continue
        alarms = sum(row.probability <= LEVEL for row in own)
        if wrong == NOTHING:
            lines.append(f"| {wrong} | {len(own)} | {alarms} | | | | | |")
            continue
        right = [row for row in own if row.right]
        first = sum(row.named == WRONG[wrong][1] for row in own)
        held, again = sum(row.holds for row in right), [row.left for row in right if not np.isnan(row.left)]
        named, shown = len(right), sum(row.shown for row in own)
        counts = f"{alarms} | {first} | {named} | {named} of {shown} | {held} of {named}"
        quiet = f"{sum(left > LEVEL for left in again)} of {len(again)}"
        lines.append(f"| {wrong} | {len(own)} | {counts} | {quiet} |")
    return lines


if __name__ == "__main__":
    limit = float((sys.argv[3:4] or ["inf"])[0])
    print(*rate_lines(measure(Path(sys.argv[1]), int(sys.argv[2]), limit, (sys.argv[4:5] or [""])[0])), sep="\n")
