"""Gates of a filter: laws of innovations, by which a scenario says what they stop, of faults and else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class GateQuestion:
    """Question that is asked of gates: errors of which size they stop.

    Attributes
    ----------
    probability : float
        With which a spike or a ramp is to be stopped.
    ramp : float
        Duration of ramps, s.
    """

    probability: float = 0.95
    ramp: float = 60.0


USUAL: Final = GateQuestion()
"""Question that is asked unless a campaign says something else."""


@dataclass(frozen=True)
class GateLaw:
    """The gate of a sensor at one of its measurements, of M components, for s outputs of the scenario; SI.

    Attributes
    ----------
    sensor : str
    time : float
        Of the measurement, in the scenario's own time, s.
    components : tuple of (str, str, str)
        Names of what is measured, their SI units, and the units in which they are shown.
    limit : float
        Normalized innovation squared up to which it is accepted.
    root : ndarray, shape (M, M)
        Cholesky factor of the innovation's covariance as the filter believes it.
    mean, covariance : ndarray, shapes (M,), (M, M)
        True ones of the innovation without a fault.
    cross : ndarray, shape (M, s)
        Covariance of the innovation with the errors after an accepted measurement.
    mean_errors, errors : ndarray, shapes (s,), (s, s)
        Mean and covariance of these errors.
    responses : ndarray, shape (s, M)
        Of these errors to an error of the measurement.
    duration : float
        Of a ramp that ends with the measurement, s.
    ramps : ndarray, shape (u, M, M)
        What a ramp of one unit a second in each component (last axis) adds to the innovations of the sensor's
        measurements in it, whitened by what the filter believes.
    ramp_errors : ndarray, shape (s, M)
        What it adds to the errors after the last one.
    """

    sensor: str
    time: float
    components: tuple[tuple[str, str, str], ...]
    limit: float
    root: Array
    mean: Array
    covariance: Array
    cross: Array
    mean_errors: Array
    errors: Array
    responses: Array
    duration: float
    ramps: Array
    ramp_errors: Array


@dataclass(frozen=True)
class FaultLaw:
    """A fault of a sensor, and the innovations of its measurements during it, u of them with M components.

    Attributes
    ----------
    sensor, kind, component, unit, shown_in : str
        SI unit of the size, and the unit in which it is shown.
    begin, end : float
        In the scenario's own time, s.
    size : float
    first, last : float
        Times of the first and of the last measurement during the fault, s.
    before : float
        Time of the sensor's measurement before the fault, or of the start.
    limit : float
        Normalized innovation squared up to which a measurement is accepted; infinite without a gate.
    means, covariances : ndarray, shapes (u, M), (u, M, M)
        Of the innovations, whitened by what the filter believes, as if all before were accepted.
    """

    sensor: str
    kind: str
    component: str
    unit: str
    shown_in: str
    begin: float
    end: float
    size: float
    first: float
    last: float
    before: float
    limit: float
    means: Array
    covariances: Array


@dataclass(frozen=True)
class RejectedErrors:
    """Errors of s outputs at a reading, of flights in which the first of u measurements so far is rejected; SI.

    After the innovation w, whitened by what the filter believes, the error is ``responses w`` plus one that is
    independent of w. The filter's variance is ``variances + excess``, which is that of the error too if w is normal.

    Attributes
    ----------
    excess : ndarray, shape (u, s)
    responses : ndarray, shape (u, s, M)
    """

    excess: Array
    responses: Array


@dataclass(frozen=True)
class RejectionReading:
    """Errors at a reading with and without rejections.

    Attributes
    ----------
    time : float
        In the scenario's own time, s.
    variances : ndarray, shape (s,)
        Where all measurements are accepted.
    once, never : RejectedErrors
        Where measurement k is rejected and all later ones are accepted, and where no sensor with a gate is accepted
        from k on.
    """

    time: float
    variances: Array
    once: RejectedErrors
    never: RejectedErrors


@dataclass(frozen=True)
class RejectionLaws:
    """Rejections of good measurements by gates, u measurements in the order in which the filter has them.

    Attributes
    ----------
    doubt : str
        Why the innovations are not independent with the covariance that the filter believes: ``faults``,
        ``considers`` or ``inconsistent``; ``planned`` where the gains are, ``steered`` where corrections move the
        truth. Then all else is empty. Empty where linear analysis knows what rejections do.
    sensors : tuple of str
    times : ndarray, shape (u,)
        In the scenario's own time, s.
    probabilities : ndarray, shape (u,)
        With which a good one is rejected: alpha.
    limits : ndarray, shape (u,)
        Normalized innovations squared up to which they are accepted.
    sizes : ndarray of int, shape (u,)
        Components of each.
    correlations : ndarray, shape (u, M)
        Canonical ones of the innovation with the next of the same sensor after a rejection; NaN where there is none,
        and zero beyond the measurement's own components.
    readings : tuple of RejectionReading
        The end last.
    fly : callable, optional
        From a number of flights that begin with a first rejection to what rejections add to the mean squares of the
        outputs at the readings, and the standard error of that, shapes (r, s).
    """

    doubt: str
    sensors: tuple[str, ...]
    times: Array
    probabilities: Array
    limits: Array
    sizes: IndexArray
    correlations: Array
    readings: tuple[RejectionReading, ...]
    fly: Callable[[int], tuple[Array, Array]] | None = None
