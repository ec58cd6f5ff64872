"""Chunks of a campaign that stores a summary: sums over all samples, and the rows of the first ones.

The file is that of any chunk with fewer rows: those of the first `STORED_ROWS` samples of the campaign, from which come
scatter plots, histograms and tests that need every sample. The sums are in its metadata, under its checksum.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason, without_numbers
from mcnav.linear.block_sums import BlockSums
from mcnav.store.chunk_files import ChunkFile, rewrite_marks

SUMMARY: Final = "summary"
"""The ``store`` of a campaign whose samples are not stored."""

STORED_ROWS: Final = 100_000
"""Samples whose rows are stored with a summary."""

CHUNK: Final = 1 << 18
CHUNKS: Final = 4_096
"""A summary's chunk has so many samples, and more when there would be more chunks than that."""

SLOW: Final = 1_024
"""An engine with smaller chunks is slow: a summary's chunk is then so many samples."""

MARK: Final = "mcnav.summary"

MOST_REASONS: Final = 1_000
"""Reasons of failures that a summary distinguishes; beyond it numbers in them are left out, then the rest is one."""

FIRST: Final = 8
"""Indices that a summary has of the samples that failed for a reason."""

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
    """Number of samples that failed for one reason, and the first of them."""

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
        named = set(sorted(known, key=lambda reason: (-known[reason].samples, reason))[: MOST_REASONS - 1])
        known = _added((reason if reason in named else OTHERS, failure) for reason, failure in known.items())
    return known


def _added(counts: Iterable[tuple[str, FailureCount]]) -> dict[str, FailureCount]:
    known: dict[str, FailureCount] = {}
    for reason, failure in counts:
        known[reason] = known[reason] + failure if reason in known else failure
    return known


@dataclass(frozen=True)
class Summary:
    """Sums of all samples of a chunk, and their failures by status."""

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

    def followed_by(self, blocks: Array) -> Summary:
        """Append blocks whose samples are counted already."""
        return replace(self, sums=self.sums.followed_by(blocks))

    def marks(self, begin: int) -> dict[str, str]:
        """Encode the summary of samples from an index on as metadata of their chunk's file."""
        sums = self.sums
        arrays = (sums.blocks, sums.errors, sums.squares, sums.within, sums.lost, sums.lost_squares)
        numbers = np.concatenate([array.ravel() for array in arrays]).astype("<f8")
        described = {
            "first": sums.first,
            "samples": self.samples,
            "failures": [[reason, failure.samples, failure.first] for reason, failure in self.failures.items()],
            "shapes": [array.shape for array in arrays],
            "numbers": base64.b64encode(numbers.tobytes()).decode(),
        }
        counts = {"begin": begin, "samples": self.samples, "failed": self.failed}
        return {MARK: json.dumps(described)} | {f"mcnav.{key}": str(count) for key, count in counts.items()}

    def doubled(self) -> Summary:
        """Return the summary in blocks twice as long."""
        return replace(self, sums=self.sums.doubled())

    @property
    def failed(self) -> int:
        """Number of samples that failed."""
        return sum(count.samples for count in self.failures.values())

    @classmethod
    def from_mark(cls, text: str | bytes) -> Summary:
        """Read the metadata of a file; ValueError or KeyError when it is not that."""
        known: dict[str, Any] = json.loads(text)
        numbers = np.frombuffer(base64.b64decode(known["numbers"]), dtype="<f8").astype(float)
        shapes = [tuple(shape) for shape in known["shapes"]]
        cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        arrays = [piece.reshape(shape) for piece, shape in zip(np.split(numbers, cuts), shapes, strict=True)]
        failures = {reason: FailureCount(int(samples), tuple(first)) for reason, samples, first in known["failures"]}
        return cls(BlockSums(int(known["first"]), *arrays), int(known["samples"]), failures)


def double_blocks(folder: Path, file: ChunkFile, identity: str, times: int) -> ChunkFile:
    """Write a verified chunk again as that of a run whose blocks are 2^times as long: the same bits as if simulated."""

    def doubled(marks: dict[str, str]) -> dict[str, str]:
        summary = Summary.from_mark(marks[MARK])
        for _ in range(times):
            summary = summary.doubled()
        return marks | {"mcnav.identity": identity} | summary.marks(file.begin)

    return rewrite_marks(folder, file, doubled)


def collect_summary(folder: Path, chunks: Sequence[ChunkFile]) -> Summary:
    """Add up the summaries of all chunks in order of index."""
    schemas = (pq.read_schema(folder / chunk.file) for chunk in chunks)
    marks = [Summary.from_mark((schema.metadata or {})[MARK.encode()]) for schema in schemas]
    while len(marks) > 1:  # neighbours first: the blocks are copied a few times, not once for each chunk
        marks = [one if other is None else one + other for one, other in zip_longest(marks[::2], marks[1::2])]
    return marks[0]
