"""Failed samples by reason: how many, and which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.contract.failure import OK, message_of, without_numbers
from mcnav.report.results.model import RunAnalysis

MOST_REASONS: Final = 20
"""Reasons beyond which those that differ in their numbers alone are told as one."""

SHOWN: Final = 8
"""Indices shown of each reason."""


Failures = Mapping[str, tuple[int, Sequence[int]]]
"""By reason: how many samples failed, and the indices of the first of them."""


def failures_in(status: Sequence[str], index: Sequence[int]) -> dict[str, tuple[int, Sequence[int]]]:
    """Group the failed samples by status, with their indices.

    >>> failures_in(["ok", "failed: fell to 3 km", "ok", "failed: fell to 3 km"], [10, 11, 12, 13])
    {'failed: fell to 3 km': (2, [11, 13])}
    """
    failures: dict[str, list[int]] = {}
    for number, reason in zip(index, status, strict=True):
        if reason != OK:
            failures.setdefault(reason, []).append(int(number))
    return grouped({reason: (len(numbers), numbers[:SHOWN]) for reason, numbers in failures.items()})


def grouped(failures: Failures) -> dict[str, tuple[int, Sequence[int]]]:
    """Sort by frequency; where there are many, join those that differ only in numbers."""
    result = dict(failures)
    if len(result) > MOST_REASONS:
        alike: dict[str, tuple[int, Sequence[int]]] = {}
        for reason, (count, first) in result.items():
            before, earlier = alike.get(without_numbers(reason), (0, ()))
            alike[without_numbers(reason)] = before + count, sorted([*earlier, *first])[:SHOWN]
        result = alike
    return dict(sorted(result.items(), key=lambda entry: (-entry[1][0], entry[0])))


@dataclass(frozen=True)
class FailureRow:
    """A reason, the number of samples that failed because of it, and the first of them."""

    reason: str
    count: int
    first: str


def failure_rows(content: RunAnalysis) -> list[FailureRow]:
    """Tabulate the reasons, those beyond `MOST_REASONS` together."""
    rows = []
    for reason, (count, result) in content.failures.items():
        first = ", ".join(str(index) for index in result[:SHOWN])
        rows.append(FailureRow(message_of(reason), count, first + (", …" if count > SHOWN else "")))
    rest = rows[MOST_REASONS:]
    others = [FailureRow(f"{len(rest):,} other reasons", sum(row.count for row in rest), "")] if rest else []
    return [*rows[:MOST_REASONS], *others]
