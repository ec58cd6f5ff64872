"""Random boxes of campaigns beside brute grids: is the worst ever below a grid's, and equal where it is monotone?

``python -m tests.calibration.box_trials FILE [FIRST] [COUNT]`` (`make calibrate CALIBRATE="--alone boxes"`) draws boxes
of campaigns 15, 19 and 24 in turn; the flights of 15 and 19 are cut to a minute, so that a linear answer takes a
twentieth of a second. A box has two to ten sizes, some of two axes alone, and every second one of a flight a
correlation time, the begin of an outage or a lever arm besides. A grid has all upper and
all lower ends, random corners and inner points; the engine answers each as a campaign of its own.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.arrays.types import Array
from mcnav.config.data_sheet import DataSheetNumber, data_sheet_numbers
from mcnav.config.documents import Document, document_of
from mcnav.config.overrides import Value, override, parse_document
from mcnav.execution.threads import one_thread
from mcnav.physics.units import multiplied
from mcnav.studies.box import answer_box
from mcnav.studies.boxed_campaign import BoxedCampaign
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.shared_derivatives import SharedDerivatives

CSV: Final = "boxes.csv"

CAMPAIGNS: Final = Path(__file__).parents[2] / "campaigns"

NAMES: Final = ("15_flight_navigation_grade", "19_flight_with_gnss", "24_rendezvous")

QUANTILE: Final = {"output": "position_east", "probability": 0.95, "below": "100 m"}
R95: Final = {"outputs": ["position_north", "position_east"], "below": "20 m", "during": "outages"}

SHORT: Final[Mapping[str, Mapping[str, Value]]] = {
    NAMES[0]: {"scenario.end": "60 s", "accept": {"quantile": [QUANTILE]}},
    NAMES[1]: {
        "scenario.end": "60 s",
        "aiding.gnss.interval": "2 s",
        "aiding.gnss.outages": [["30 s", "50 s"]],
        "accept": {"r95": [R95]},
    },
    NAMES[2]: {},
}
"""What makes the campaigns short, and gives them a requirement."""

BOXES: Final = 200

EXACT: Final = 1e-6
"""Relative difference up to which extremes of a monotone box are those of its ends."""

ROUNDING: Final = 1e-9

CORNERS: Final = 3
INNER: Final = 3
"""Random corners, and inner points, of a grid besides all ends."""

MOST: Final = 10
MOST_SEARCHED: Final = 4
"""Sizes with ranges; where they are correlated, or other ranges are searched besides."""

SEVERAL: Final = 0.2
"""Share of boxes with several ranges that are no sizes."""

BY_AXIS: Final = 0.3
"""Share of sizes of which the first and the third axis have the range, and the second does not."""


@dataclass(frozen=True)
class Row:
    """A box beside its grid.

    ``above`` is the largest relative amount by which the grid is worse than the box's worst, or better than its best.
    ``apart`` is that by which they differ. Both are of sigmas and requirements, the first of the filter's ratio, too.
    """

    campaign: str
    seed: int
    ranges: int
    exact: bool
    systems: int
    settings: int
    points: int
    above: float
    apart: float


def boxes(seeds: Iterable[int]) -> Iterator[Row]:
    """Try the boxes of some seeds."""
    documents = [_short(document_of(CAMPAIGNS / f"{name}.toml"), SHORT[name]) for name in NAMES]
    sheets = [
        data_sheet_numbers(document.content, parse_document(document, {}).scenario.sources) for document in documents
    ]
    for seed in seeds:
        place, random = seed % len(NAMES), np.random.default_rng([59, seed])
        ranges = drawn(random, sheets[place], documents[place], seed // len(NAMES) % 2 == 1)
        with one_thread():
            yield tried(random, documents[place], ranges, NAMES[place], seed)


def _short(document: Document, changes: Mapping[str, Value]) -> Document:
    return replace(document, content=override(document.content, changes, document.file))


def drawn(
    random: np.random.Generator, sheet: list[DataSheetNumber], document: Document, searched: bool
) -> dict[str, Value]:
    """Draw ranges by path: sizes over factors of up to ten; where asked for, numbers that are searched besides."""
    ranges = dict[str, Value]()
    sized = [number for number in sheet if isinstance(number.entry, str) or "sigma" in number.entry]  # type: ignore[operator]
    most = MOST_SEARCHED if searched or "correlations" in document.content else MOST
    for k in random.permutation(len(sized))[: random.integers(2, most + 1)]:
        number = sized[k]
        high = float(10.0 ** random.uniform(-0.3, 0.5))
        low = high * float(10.0 ** random.uniform(-1.0, -0.1))
        entry = _ranged(number.entry, low, high)
        by_axis = isinstance(entry, str) and number.path.endswith((".bias", ".scale_factor", ".position", ".velocity"))
        ranges[number.path] = [entry, number.entry, entry] if by_axis and random.random() < BY_AXIS else entry
    processes = [number for number in sized if isinstance(number.entry, dict) and "correlation_time" in number.entry]
    several = random.random() < SEVERAL
    if searched and processes and (several or random.random() < 0.5 or not document.content.get("aiding")):
        number = processes[int(random.integers(len(processes)))]
        entry: Any = number.entry
        time = f"{multiplied(entry['correlation_time'], 0.2)}..{multiplied(entry['correlation_time'], 3.0)}"
        ranges[number.path] = {**entry, "correlation_time": time}
        searched = several
    if searched and document.content.get("aiding"):
        ranges |= {"aiding.gnss.outages": [["20..40 s", "50 s"]]} if random.random() < 0.5 else {
            "aiding.gnss.lever_arm": ["0..3 m", "1 m", "0 m"]
        }  # fmt: skip
    return ranges


def _ranged(entry: Any, low: float, high: float) -> Any:
    """Return an entry of a data sheet whose size is a range, between two multiples of it."""
    if isinstance(entry, str):
        return f"{multiplied(entry, low)}..{multiplied(entry, high)}"
    return {**entry, "sigma": _ranged(entry["sigma"], low, high)}


def tried(random: np.random.Generator, document: Document, ranges: dict[str, Value], name: str, seed: int) -> Row:
    """Answer a box and a grid of it."""
    ranged = Document(override(document.content, ranges, document.file), document.file, document.stem)
    boxed = BoxedCampaign(replace(parse_document(ranged, {}), ranges=ranged.ranges), ranged)
    box = answer_box(boxed.nominal, answer_linearly(boxed.nominal), boxed)
    spreads, axes = [*box.outputs, *box.requirements], len(boxed.ranges)
    shares = [np.ones(axes), np.zeros(axes), *random.integers(0, 2, (CORNERS, axes)), *random.random((INNER, axes))]
    derivatives = SharedDerivatives()
    grid = [
        answer_linearly(derivatives.along(boxed.at(boxed.setting([
            spec.span.at(float(share)) for spec, share in zip(boxed.ranges, row, strict=True)
        ]))))
        for row in shares
    ]  # fmt: skip
    rows = np.array([measures(answer) for answer in grid])
    least = np.maximum(np.abs(rows).max(axis=0), 1e-300)
    worst = np.array([spread.worst.value for spread in spreads])
    best = np.array([spread.best.value for spread in spreads])
    over, under = (rows.max(axis=0) - worst) / least, (best - rows.min(axis=0)) / least
    above = max(float(np.nanmax(over)), float(np.nanmax(under)))
    if box.filter is not None:
        above = max(above, max(map(ratio, grid)) / box.filter.ratio.worst.value - 1.0)
    apart = max(float(np.nanmax(np.abs(over))), float(np.nanmax(np.abs(under))))
    return Row(name, seed, axes, box.exact, box.systems, box.settings, len(grid), above, apart)


def measures(answer: LinearAnswer) -> Array:
    """Return sigmas and values of requirements."""
    return np.array([*answer.sigma, *(row.value for row in answer.requirements)])


def ratio(answer: LinearAnswer) -> float:
    """Return the largest ratio of true to computed sigma."""
    assert answer.filter is not None
    return float(np.nanmax(np.column_stack([answer.filter.ratios, *answer.filter.groups.values()])))


def write_boxes(path: Path, first: int = 0, count: int = BOXES) -> None:
    """Write a row for each box as it is known, and print the rates."""
    rows = list[Row]()
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow([field.name for field in fields(Row)])
        for row in boxes(range(first, first + count)):
            rows.append(row)
            table.writerow([f"{value:.3g}" if isinstance(value, float) else value for value in astuple(row)])
            file.flush()
    exact, searched = ([row for row in rows if row.exact is wanted] for wanted in (True, False))
    never, equal = sum(row.above <= ROUNDING for row in searched), sum(row.apart <= EXACT for row in exact)
    print(f"{never} of {len(searched)} that are searched are never below their grid")
    print(f"{equal} of {len(exact)} that are monotone equal their ends to {EXACT:g}")


if __name__ == "__main__":
    write_boxes(Path(sys.argv[1]), *map(int, sys.argv[2:4]))
