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
from mcnav.scenarios.reasons import without_numbers
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

OTHERS: Final = "failed: other reasons"


def summary_chunk(engine_chunk: int, samples: int) -> int:
    """Samples of a summary's chunk: whole chunks of the engine.

    >>> chunk_of(8_192, 1_000_000) // 8_192, chunk_of(32, 1_000_000), chunk_of(8_192, 10**12)
    (32, 1024, 268435456)
    """
    wanted = SLOW if engine_chunk < SLOW else max(CHUNK, 1 << (-(-samples // CHUNKS) - 1).bit_length())
    return -(-wanted // engine_chunk) * engine_chunk


@dataclass(frozen=True)
class Failure:
    """Samples that failed for one reason: how many, and the first of them."""

    samples: int
    first: tuple[int, ...]

    def __add__(self, other: Failure) -> Failure:
        return Failure(self.samples + other.samples, (*self.first, *other.first)[:FIRST])


def _together(found: Iterable[tuple[str, Failure]]) -> dict[str, Failure]:
    """Failures by reason, no more than `MOST_REASONS`; given in order of index."""
    known = _added(found)
    if len(known) > MOST_REASONS:
        known = _added((without_numbers(reason), failure) for reason, failure in known.items())
    if len(known) > MOST_REASONS:
        kept = set(sorted(known, key=lambda reason: (-known[reason].samples, reason))[: MOST_REASONS - 1])
        known = _added((reason if reason in kept else OTHERS, failure) for reason, failure in known.items())
    return known


def _added(found: Iterable[tuple[str, Failure]]) -> dict[str, Failure]:
    known: dict[str, Failure] = {}
    for reason, failure in found:
        known[reason] = known[reason] + failure if reason in known else failure
    return known


@dataclass(frozen=True)
class Summary:
    """What a chunk says of all its samples.

    Attributes
    ----------
    sums : BlockSums
    samples : int
    failures : mapping of str to Failure
        By reason.
    """

    sums: BlockSums
    samples: int
    failures: Mapping[str, Failure]

    @classmethod
    def of(cls, sums: BlockSums, samples: int, reasons: Mapping[int, str]) -> Summary:
        """With the reasons of failed samples by their index, rising."""
        return cls(sums, samples, _together((reason, Failure(1, (index,))) for index, reason in reasons.items()))

    def __add__(self, other: Summary) -> Summary:
        failures = _together(chain(self.failures.items(), other.failures.items()))
        return Summary(self.sums + other.sums, self.samples + other.samples, failures)

    def as_mark(self) -> str:
        """As text for a file."""
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
        """From the text of a file; ValueError or KeyError when it is not that."""
        known: dict[str, Any] = json.loads(text)
        numbers = np.frombuffer(base64.b64decode(known["numbers"]), dtype="<f8").astype(float)
        shapes = [tuple(shape) for shape in known["shapes"]]
        cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        arrays = [part.reshape(shape) for part, shape in zip(np.split(numbers, cuts), shapes, strict=True)]
        failures = {reason: Failure(int(samples), tuple(first)) for reason, samples, first in known["failures"]}
        return cls(BlockSums(int(known["first"]), *arrays), int(known["samples"]), failures)


def summary_from_bytes(content: bytes) -> Summary:
    """The summary that the bytes of a part hold; ValueError, KeyError or pyarrow's exceptions when they do not."""
    return Summary.from_mark((pq.read_schema(io.BytesIO(content)).metadata or {})[MARK.encode()].decode())


def collect_summary(folder: Path, parts: Sequence[Part]) -> Summary:
    """Add up the summaries of all parts in order of index."""
    found = [summary_from_bytes((folder / part.file).read_bytes()) for part in parts]
    while len(found) > 1:  # neighbours first: the blocks are copied a few times, not once for each part
        found = [one if other is None else one + other for one, other in zip_longest(found[::2], found[1::2])]
    return found[0]
