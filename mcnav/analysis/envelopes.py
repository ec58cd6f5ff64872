"""Dispersion over time: linear and simulated sigma, and percentiles of the stored samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcnav._types import Array


@dataclass(frozen=True)
class Envelopes:
    """Errors at m epochs, SI.

    Attributes
    ----------
    label : str
        Meaning of the times, as ``name [unit]``.
    times : ndarray, shape (m,)
    events : mapping of str to float
        Named instants, in the unit of the times.
    mean, sigma, linear_mean, linear_sigma : ndarray, shape (m, outputs)
    percentiles : mapping of str to ndarray, shape (m, outputs)
        Keyed by the level in per cent.
    samples, stored : int
        Numbers of samples behind mean and sigma, and behind the percentiles.
    """

    label: str
    times: Array
    events: Mapping[str, float]
    mean: Array
    sigma: Array
    linear_mean: Array
    linear_sigma: Array
    percentiles: Mapping[str, Array]
    samples: int
    stored: int


def envelopes_from(
    columns: Mapping[str, Array], described: Mapping[str, Any], outputs: Sequence[Mapping[str, str]]
) -> Envelopes:
    """Build envelopes from the columns of ``epochs.parquet`` and its description; `KeyError` names a missing column."""

    def block(kind: str) -> Array:
        return np.column_stack([columns[f"{kind} {entry['name']} [{entry['unit']}]"] for entry in outputs])

    label = next(iter(columns))
    levels = dict.fromkeys(name.split()[1] for name in columns if name.startswith("percentile "))
    mean, sigma, linear_mean, linear_sigma = map(block, ("mean", "sigma", "linear mean", "linear sigma"))
    percentiles = {level: block(f"percentile {level}") for level in levels}
    samples, stored = int(described["samples"]), int(described["stored"])
    return Envelopes(
        label, columns[label], described["events"], mean, sigma, linear_mean, linear_sigma, percentiles, samples, stored
    )
