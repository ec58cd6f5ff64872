"""Gates and faults of sensors: what is accepted; what a measurement has for some time that no filter believes in.

A spike is one wrong measurement, a bias a constant error between a begin and an end, a ramp an error that grows from
zero at the begin to its size at the end. After the end the sensor is right again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from mcnav.arrays.types import Array

FaultKind = Literal["spike", "ramp", "bias"]

SAME_INSTANT: Final = 1e-9
"""Times that differ by no more, s, are the same."""


@dataclass(frozen=True)
class Fault:
    """A fault of one component of a sensor.

    Attributes
    ----------
    kind : str
        ``spike``, ``ramp`` or ``bias``.
    component : int
        Number among the components of the sensor.
    begin, end : float
        In the trajectory's time, s, both included; the end of a spike is its begin.
    size : float
        Of the error, SI: of a ramp at its end.
    """

    kind: FaultKind
    component: int
    begin: float
    end: float
    size: float

    def errors(self, times: Array) -> Array:
        """Return what it adds to measurements at rising times, s, shape (u,).

        A spike is in the first measurement at or after its begin.

        >>> Fault("ramp", 0, 10.0, 20.0, 5.0).errors(np.array([9.0, 12.0, 20.0, 21.0])).tolist()
        [0.0, 1.0, 5.0, 0.0]
        >>> Fault("spike", 0, 10.0, 10.0, 5.0).errors(np.array([9.0, 12.0, 20.0])).tolist()
        [0.0, 5.0, 0.0]
        """
        errors = np.zeros(len(times))
        if self.kind == "spike":
            first = int(np.searchsorted(times, self.begin - SAME_INSTANT))
            errors[first : first + 1] = self.size
            return errors
        during = (times >= self.begin - SAME_INSTANT) & (times <= self.end + SAME_INSTANT)
        share = 1.0 if self.kind == "bias" else (times[during] - self.begin) / (self.end - self.begin)
        errors[during] = self.size * share
        return errors


def fault_errors(faults: tuple[Fault, ...], times: Array, components: int) -> Array:
    """Return what faults add to the measurements of a sensor, shape (u, components)."""
    errors = np.zeros((len(times), components))
    for fault in faults:
        errors[:, fault.component] += fault.errors(times)
    return errors


def gate_limit(gate: float, components: int) -> float:
    """Return the normalized innovation squared below which a good measurement is with a probability.

    >>> round(gate_limit(0.95, 1), 4)
    3.8415
    """
    from scipy.special import gammaincinv  # as `scipy.stats.chi2`, whose import takes a third of a second

    return 2.0 * float(gammaincinv(0.5 * components, gate))
