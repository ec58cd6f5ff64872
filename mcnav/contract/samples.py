"""Samples: what an engine is given, and what it returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.failure import Failure


@dataclass(frozen=True)
class Batch:
    """Samples to be simulated.

    Attributes
    ----------
    index : ndarray of int, shape (n,)
        Of each sample in its campaign: with the seed it is the key of the sample's noise.
    errors : ndarray, shape (n, sources)
        Constant errors, SI.
    seed : int
        Of the campaign.
    """

    index: IndexArray
    errors: Array
    seed: int

    def __getitem__(self, rows: slice | IndexArray) -> Batch:
        return Batch(self.index[rows], self.errors[rows], self.seed)


@dataclass(frozen=True)
class SimulationResult:
    """Final errors of some samples.

    Attributes
    ----------
    values : ndarray, shape (n, outputs)
        SI; a row that failed is NaN throughout.
    failures : mapping of int to Failure
        By row. A scenario of the user's own may give text in place of `Failure`.
    fallback_count : int
        Samples that left the fast engine's validity and were simulated on the reference path instead.
    linear_values : ndarray, shape (n, outputs), optional
        SI: the same samples by the linear system, with the same noise; from an engine with noise alone.
    history : ndarray, shape (n, m, outputs), optional
        Errors at every epoch, from an engine that computes them with the final ones; it may leave them out where no
        noise is asked for.
    filter_values : ndarray, shape (n, m, width), optional
        Records of the samples' filters at every epoch, from an engine with a filter alone; see `FilterSchema`.
    smoothed_history, smoother_values : ndarray, shapes (n, m, outputs), (n, m, width), optional
        Errors behind a smoother at every epoch, and its records; from an engine with a smoother alone.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> result = mc.SimulationResult(np.array([[1.0], [np.nan]]), {1: "the engine stopped"})
    >>> sorted(result.failures)
    [1]
    """

    values: Array
    failures: Mapping[int, Failure] = field(default_factory=dict)
    fallback_count: int = 0
    linear_values: Array | None = None
    history: Array | None = None
    filter_values: Array | None = None
    smoothed_history: Array | None = None
    smoother_values: Array | None = None
