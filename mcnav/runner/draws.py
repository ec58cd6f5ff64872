"""The samples of a campaign, drawn by index."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.sampler.error_model import ErrorModel

PROBES: Final = 64
"""Samples on which an engine's accuracy is determined: the first of the campaign itself."""


@dataclass(frozen=True)
class DrawPlan:
    """The samples of a campaign; see `ErrorModel.draw`."""

    errors: ErrorModel
    design: str
    seed: int
    samples: int

    def draw(self, begin: int, end: int) -> Array:
        """Draw samples [begin, end), or fewer at the campaign's end, shape (n, sources)."""
        return self.errors.draw(self.design, self.seed, self.samples, begin, min(end, self.samples))

    def batch(self, begin: int, end: int) -> Batch:
        """Draw samples [begin, end), or fewer at the campaign's end, with what their noise depends on."""
        errors = self.draw(begin, end)
        return Batch(np.arange(begin, begin + len(errors)), errors, self.seed)

    def probes(self) -> Array:
        """Draw the samples on which an engine's accuracy is determined, shape (n, sources)."""
        return self.draw(0, PROBES)
