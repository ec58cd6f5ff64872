"""The runner: chunks of samples over the cores, each stored by the worker that flew it.

The chunk belongs to the engine, a sample's errors to the campaign and its index. Neither knows of workers, so that the
files come out the same, bit for bit, however many there are. Numerical libraries are held to one thread everywhere:
their sums would depend on it.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor
from threadpoolctl import threadpool_limits

from mcnav.campaign.folder import RunFolder
from mcnav.campaign.parts import Layout, Part, verified_part, write_part
from mcnav.sampling.errors import ErrorModel
from mcnav.scenarios.protocol import Prepared

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Draws:
    """Which samples to draw; see `ErrorModel.draw`."""

    model: ErrorModel
    design: str
    seed: int
    samples: int


@dataclass(frozen=True)
class Work:
    """What a worker needs to fly any chunk of a run."""

    draws: Draws
    prepared: Prepared
    folder: RunFolder
    identity: str
    layout: Layout


def _end_with_parent(parent: int) -> None:
    """Let a worker process end within a second of its parent, also when that was killed and could not say so."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _fly_chunk(work: Work, number: int, begin: int, end: int) -> Part:
    with threadpool_limits(1):
        draws = work.draws
        errors = draws.model.draw(draws.design, draws.seed, draws.samples, begin, end)
        outcomes = work.prepared.propagate(errors)
        return write_part(work.folder.parts, number, begin, work.identity, work.layout, errors, outcomes)


def fly(work: Work, jobs: int, progress: Progress) -> tuple[list[Part], int]:
    """Fly every chunk that is not already stored whole.

    Parameters
    ----------
    work : Work
    jobs : int
        Workers: threads for an engine that runs free of the interpreter lock, else processes.
    progress : callable
        Told how many samples have become ready, each time some do.

    Returns
    -------
    parts : list of Part
        All parts of the run, in the order in which they became ready.
    flown : int
        Samples that were not stored already.
    """
    samples, chunk = work.draws.samples, work.prepared.chunk
    parts, missing = [], []
    for number, begin in enumerate(range(0, samples, chunk)):
        end = min(begin + chunk, samples)
        stored = verified_part(work.folder.parts, number, begin, end, work.identity)
        if stored is None:
            missing.append((number, begin, end))
        else:
            parts.append(stored)
            progress(end - begin)
    workers: dict[str, Any] = {"backend": "threading"}
    if work.prepared.parallel == "processes":
        workers = {"backend": "loky", "initializer": _end_with_parent, "initargs": (os.getpid(),)}
    flights = Parallel(n_jobs=min(jobs, max(1, len(missing))), return_as="generator_unordered", **workers)
    try:
        for part in flights(delayed(_fly_chunk)(work, *place) for place in missing):
            parts.append(part)
            progress(part.end - part.begin)
    finally:
        if work.prepared.parallel == "processes":
            get_reusable_executor().shutdown(wait=True, kill_workers=True)
    return parts, sum(end - begin for _, begin, end in missing)
