"""Samples shared among cores: by threads, by processes (joblib), or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from tests.benchmarks.inertial.case import Samples
from tests.benchmarks.inertial.peer import Peer, Simulate


@contextmanager
def shared(peer: Peer, simulate: Simulate, cores: int) -> Iterator[Simulate]:
    """Simulate a peer's samples in chunks, over some cores; seeds of chunks are a thousand apart."""

    def chunks(samples: Samples) -> list[Samples]:
        # no larger than a core's share, so that none is idle
        size = max(1, min(peer.chunk, -(-len(samples) // cores)))
        size = peer.chunk if peer.workers == "own" else size
        return [samples[begin : begin + size] for begin in range(0, len(samples), size)]

    def seeds(count: int, seed: int) -> list[int]:
        return [1_000_000 * seed + 1_000 * number for number in range(count)]

    if cores == 1 or peer.workers == "own":
        yield lambda samples, seed: np.concatenate(
            [simulate(*each) for each in zip(chunks(samples), seeds(len(samples), seed), strict=False)]
        )
    elif peer.workers == "threads":
        with ThreadPoolExecutor(cores) as pool:
            yield lambda samples, seed: np.concatenate(
                list(pool.map(simulate, chunks(samples), seeds(len(samples), seed)))
            )
    else:
        from joblib import Parallel, delayed

        with Parallel(n_jobs=cores) as parallel:
            yield lambda samples, seed: np.concatenate(
                parallel(
                    delayed(simulate)(*each) for each in zip(chunks(samples), seeds(len(samples), seed), strict=False)
                )
            )
