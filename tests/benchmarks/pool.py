"""Draws shared among cores: by threads, by processes (joblib), or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from tests.benchmarks.peer import Fly, Peer


@contextmanager
def shared(peer: Peer, fly: Fly, cores: int) -> Iterator[Fly]:
    """A peer's flights in chunks, over some cores."""

    def chunks(draws: np.ndarray) -> list[np.ndarray]:
        return [draws[begin : begin + peer.chunk] for begin in range(0, len(draws), peer.chunk)]

    if cores == 1 or peer.workers == "own":
        yield lambda draws: np.concatenate([fly(chunk) for chunk in chunks(draws)])
    elif peer.workers == "threads":
        with ThreadPoolExecutor(cores) as pool:
            yield lambda draws: np.concatenate(list(pool.map(fly, chunks(draws))))
    else:
        from joblib import Parallel, delayed

        with Parallel(n_jobs=cores) as pool:
            yield lambda draws: np.concatenate(pool(delayed(fly)(chunk) for chunk in chunks(draws)))
