"""Setup that all samples of a loop share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.gates import SampleGates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import Plan
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.sizes import Sizes


@dataclass(frozen=True)
class Setup:
    """All that samples of a loop share.

    Attributes
    ----------
    states, judged : FilterStates, optional
        Of the filter; and those of which it, or an update of the user's own, states a covariance.
    start : ndarray, shape (size,)
    steps : ndarray, shape (size,)
        Steps of differences.
    epochs : mapping of int to int
        Epochs by the number of their instant; the last is the end.
    schema : FilterSchema, optional
    floor : ndarray, shape (outputs,)
        Deviations of outputs below which they are rounding; see `Readout.floor`.
    """

    maps: Maps
    schedule: tuple[Instant, ...]
    plan: Plan
    states: FilterStates | None
    judged: FilterStates | None
    true: Sizes
    believed: Sizes
    start: Array
    steps: Array
    epochs: Mapping[int, int]
    readout: Readout
    schema: FilterSchema | None
    floor: Array
    gates: SampleGates
