"""Protocol of a system that is simulated from Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult


@dataclass(frozen=True)
class Linearized:
    """Partials and nominal outputs, an estimate of the partials' error, covariances that processes of noise add.

    The error is the largest difference from other steps, or from another method, as a share of the largest
    contribution of one sigma in its row.
    """

    model: LinearModel
    error: float
    processes: Mapping[str, Array]


class System(Protocol):
    """A system with named sources and outputs."""

    @property
    def sources(self) -> tuple[str, ...]:
        """Error sources, in the order of the columns of errors."""

    @property
    def chunk(self) -> int:
        """Samples that are simulated at once: part of the system, never of the number of workers."""

    @property
    def backend(self) -> str:
        """Workers of joblib that it needs: ``loky`` for processes, ``threading`` for threads."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Outputs, in the order of the columns of results."""

    def simulate(self, batch: Batch) -> SimulationResult:
        """Simulate samples whose errors have the order of `sources`, SI."""

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of each source, where it is known."""

    def linearize(self, sizes: Array) -> Linearized:
        """Linearize about no errors, with one sigma of each source, shape (sources,), SI."""
