"""Chunks of a campaign that keeps summaries: sums over all samples, and the rows of the first ones.

The file is a part like any other, with fewer rows: those of the first `KEPT` samples of the campaign, from which come
scatter plots, histograms and tests that need every sample. The sums are marks in it, under its checksum.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq

from mcnav.lincov.block_sums import BlockSums
from mcnav.scenarios.failure import Failure, Reason, without_numbers
from mcnav.store.parts import Part

SUMMARY: Final = "summary"
"""What a campaign's ``store`` says when samples are not to be kept."""

KEPT: Final = 100_000
"""Samples whose rows a summary keeps."""

CHUNK: Final = 1 << 18
CHUNKS: Final = 4_096
"""A summary's chunk has so many samples, and more when there would be more chunks than that."""

SLOW: Final = 1_024
"""An engine with smaller chunks is slow: a summary's chunk is then so many samples."""

MARK: Final = "mcnav.summary"

MOST_REASONS: Final = 1_000
"""Reasons of failures that a summary tells apart; beyond it numbers in them are left out, then the rest is one."""

FIRST: Final = 8
"""Indices that a summary keeps of the samples that failed for a reason."""

OTHERS: Final = Failure.of(Reason.OTHERS).status


def summary_chunk(engine_chunk: int, samples: int) -> int:
    """Return the samples of a summary's chunk: whole chunks of the engine.

    >>> summary_chunk(8_192, 1_000_000) // 8_192, summary_chunk(32, 1_000_000), summary_chunk(8_192, 10**12)
    (32, 1024, 268435456)
    """
    wanted = SLOW if engine_chunk < SLOW else max(CHUNK, 1 << (-(-samples // CHUNKS) - 1).bit_length())
    return -(-wanted // engine_chunk) * engine_chunk


@dataclass(frozen=True)
class FailureCount:
    """How many samples failed for one reason, and the first of them."""

    samples: int
    first: tuple[int, ...]

    def __add__(self, other: FailureCount) -> FailureCount:
        return FailureCount(self.samples + other.samples, (*self.first, *other.first)[:FIRST])


def _together(counts: Iterable[tuple[str, FailureCount]]) -> dict[str, FailureCount]:
    """Add failures of equal status, given in order of index; no more than `MOST_REASONS`."""
    known = _added(counts)
    if len(known) > MOST_REASONS:
        known = _added((without_numbers(reason), failure) for reason, failure in known.items())
    if len(known) > MOST_REASONS:
        kept = set(sorted(known, key=lambda reason: (-known[reason].samples, reason))[: MOST_REASONS - 1])
        known = _added((reason if reason in kept else OTHERS, failure) for reason, failure in known.items())
    return known


def _added(counts: Iterable[tuple[str, FailureCount]]) -> dict[str, FailureCount]:
    known: dict[str, FailureCount] = {}
    for reason, failure in counts:
        known[reason] = known[reason] + failure if reason in known else failure
    return known


@dataclass(frozen=True)
class Summary:
    """Sums and failures of all samples of a chunk.

    Attributes
    ----------
    sums : BlockSums
    samples : int
    failures : mapping of str to FailureCount
        By status.
    """

    sums: BlockSums
    samples: int
    failures: Mapping[str, FailureCount]

    @classmethod
    def of(cls, sums: BlockSums, samples: int, failed: Mapping[int, str]) -> Summary:
        """Summarize a chunk with the status of its failed samples by index, rising."""
        return cls(sums, samples, _together((status, FailureCount(1, (index,))) for index, status in failed.items()))

    def __add__(self, other: Summary) -> Summary:
        failures = _together(chain(self.failures.items(), other.failures.items()))
        return Summary(self.sums + other.sums, self.samples + other.samples, failures)

    def as_mark(self) -> str:
        """Return the summary as text for a file."""
        sums = self.sums
        arrays = (sums.blocks, sums.errors, sums.squares, sums.within, sums.lost, sums.lost_squares)
        numbers = np.concatenate([array.ravel() for array in arrays]).astype("<f8")
        failures = [[reason, failure.samples, failure.first] for reason, failure in self.failures.items()]
        described = {"first": self.sums.first, "samples": self.samples, "failures": failures}
        return json.dumps(
            {
                **described,
                "shapes": [array.shape for array in arrays],
                "numbers": base64.b64encode(numbers.tobytes()).decode(),
            }
        )

    @classmethod
    def from_mark(cls, text: str) -> Summary:
        """Read the text of a file; ValueError or KeyError when it is not that."""
        known: dict[str, Any] = json.loads(text)
        numbers = np.frombuffer(base64.b64decode(known["numbers"]), dtype="<f8").astype(float)
        shapes = [tuple(shape) for shape in known["shapes"]]
        cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        arrays = [part.reshape(shape) for part, shape in zip(np.split(numbers, cuts), shapes, strict=True)]
        failures = {reason: FailureCount(int(samples), tuple(first)) for reason, samples, first in known["failures"]}
        return cls(BlockSums(int(known["first"]), *arrays), int(known["samples"]), failures)


def summary_from_bytes(content: bytes) -> Summary:
    """Read the summary in the bytes of a part; ValueError, KeyError or pyarrow's exceptions when they do not."""
    return Summary.from_mark((pq.read_schema(io.BytesIO(content)).metadata or {})[MARK.encode()].decode())


def collect_summary(folder: Path, parts: Sequence[Part]) -> Summary:
    """Add up the summaries of all parts in order of index."""
    found = [summary_from_bytes((folder / part.file).read_bytes()) for part in parts]
    while len(found) > 1:  # neighbours first: the blocks are copied a few times, not once for each part
        found = [one if other is None else one + other for one, other in zip_longest(found[::2], found[1::2])]
    return found[0]
