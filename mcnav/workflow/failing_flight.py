"""The most likely way to fail of a requirement, flown to just beyond its limit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement
from mcnav.arrays.types import Array
from mcnav.contract.engine import (
    Engine,
)
from mcnav.contract.linear import LinearSystem
from mcnav.contract.samples import SimulationResult
from mcnav.sampler.error_model import ErrorModel
from mcnav.statistics.bisection import root_between
from mcnav.store.manifest import ExceedanceRecord
from mcnav.workflow.event_normals import normals_of

MOVED: Final = 0.2
"""Share of its distance by which the most likely way to fail is moved to the limit, at most."""


@dataclass(frozen=True)
class FailingFlight:
    """Flight of the most likely way to fail, just beyond the limit.

    Attributes
    ----------
    errors : ndarray, shape (sources,)
    added : ndarray, shape (m,)
        What noise adds to the linear outcomes of the requirement's ``outputs``, over time at the epoch that is farthest
        beyond the limit; empty without noise.
    epoch : int or None
        Number of that epoch; none of a requirement at the end.
    result : SimulationResult
    reached : float
        Multiple of the limit.
    """

    errors: Array
    outputs: tuple[int, ...]
    added: Array
    epoch: int | None
    result: SimulationResult
    reached: float


def fly_way_to_fail(
    engine: Engine, noisy: bool, errors: ErrorModel, seed: int, model: Model, requirement: Requirement,
    record: ExceedanceRecord, throughout: LinearSystem | None,
) -> FailingFlight:  # fmt: skip
    """Fly the most likely way to fail of a requirement, moved along its direction to just beyond the limit.

    It is moved by at most a fifth of its distance: where the limit is not crossed there, it is flown as it is. Noise
    that the condition leaves random is that of flight 0.
    """
    normals, event = normals_of(engine, noisy, errors, seed, model, requirement, record.requirement, throughout)
    point = np.array(record.point)

    def margin(multiple: float) -> float:
        value = float(event.limit.margin(normals.fly(multiple * point[None], np.zeros(1, dtype=np.int64)))[0])
        return value if math.isfinite(value) else 1.0

    (low, below), (high, beyond) = ((multiple, margin(multiple)) for multiple in (1.0 - MOVED, 1.0 + MOVED))
    crossed = below <= 0.0 < beyond
    multiple = root_between(margin, (low, below), (high, beyond), 1e-6)[1] if crossed else 1.0
    found = multiple * point[None]
    chosen = normals.errors_of(found)[0]
    number = np.zeros(1, dtype=np.int64)
    flown = normals.fly(found, number)
    place = event.worst_epoch(flown) if event.epochs else 0
    added = np.zeros(0)
    if normals.noise is not None:
        added = normals.noise.added(found[:, normals.constants :]).reshape(-1, len(event.outputs))[place]
    epoch = event.epochs[place] if event.epochs else None
    reached = float(event.limit.reached(flown)[0])
    return FailingFlight(chosen, event.outputs, added, epoch, normals.simulate(found, number), reached)
