"""An inertial measurement unit identified from logs at rest: the results that a page, a terminal and files show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.allan import AllanDeviation
from mcnav.identification.fit import AxisFit
from mcnav.identification.goodness import Goodness
from mcnav.identification.several import Repeatability
from mcnav.identification.stand_in import StandIn

READINGS: Final = {"gyro": "rad/s", "accelerometer": "m/s^2"}
"""SI unit of the readings of an instrument."""


@dataclass(frozen=True)
class LogFacts:
    """A log, as it was used: its name, the readings used and the interval between them, s, and what was noticed."""

    name: str
    readings: int
    interval: float
    notes: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Length that was used, s."""
        return self.readings * self.interval


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of an axis by the logs, as CSV and JSON have it: SI units, names of ``[imu]``.

    Attributes
    ----------
    instrument, axis, key : str
        Such as ``gyro``, ``x``, ``bias_instability.sigma``.
    value : float, optional
        None where the logs do not identify it.
    low, high : float
        95 % interval, or zero and the upper bound; infinite where there is none.
    hours_wanted : float, optional
        Length of a log that would identify it; infinite where none would.
    certain : bool
        False where a model without the parameter's process fits the logs nearly as well.
    shown_in : str
        Unit of pages and terminals; `factor` of them in an SI unit.
    """

    instrument: str
    axis: str
    key: str
    value: float | None
    low: float
    high: float
    unit: str
    shown_in: str
    factor: float
    hours_wanted: float | None = None
    certain: bool = True

    @property
    def stated(self) -> bool:
        """True if the logs say anything of it: an estimate, an end of an interval, or a length that would do."""
        return self.value is not None or np.isfinite(self.high) or self.low > 0.0 or self.hours_wanted is not None


@dataclass(frozen=True, eq=False)
class SpectrumPoints:
    """Spectral density of readings in bands, k of them, with 95 % intervals, and the model's; roots, two-sided."""

    frequency: Array
    density: Array
    low: Array
    high: Array
    model: Array


@dataclass(frozen=True, eq=False)
class AxisReport:
    """One axis of an instrument.

    Attributes
    ----------
    fitted : AxisFit
        Of all logs together.
    goodness : tuple of Goodness
        Test of fit of each log, each of the model that this log alone wants.
    means : ndarray, shape (logs,)
        Of the readings.
    resolution : float, optional
        Step of the lattice on which the readings lie.
    agreement : float, optional
        P-value of the hypothesis that the logs have their noise in common; none for one log.
    repeatability : Repeatability, optional
        Of the mean from log to log.
    allan : AllanDeviation
        Of the longest log.
    stand_in : StandIn, optional
        What ``[imu]`` has in place of identified flicker noise.
    limits : tuple of str
        Frequencies that the model was fitted to, where they are not all, with the reason.
    """

    instrument: str
    axis: str
    fitted: AxisFit
    goodness: tuple[Goodness, ...]
    means: Array
    resolution: float | None
    agreement: float | None
    repeatability: Repeatability | None
    parameters: tuple[ParameterRow, ...]
    allan: AllanDeviation
    spectrum: SpectrumPoints
    interval: float
    stand_in: StandIn | None = None
    limits: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """SI unit of the readings."""
        return READINGS[self.instrument]

    @property
    def name(self) -> str:
        """Instrument and axis."""
        return f"{self.instrument} {self.axis}"


@dataclass(frozen=True)
class GradeRow:
    """A value of an instrument, the mean of its axes, and the grades of the catalogue around it; shown units."""

    instrument: str
    key: str
    value: float
    unit: str
    finer: str
    coarser: str
    nearest: str


@dataclass(frozen=True)
class SigmaRow:
    """A final navigation error of a campaign, one sigma, in a shown unit.

    Attributes
    ----------
    own : float
        By the campaign's own ``[imu]``.
    sigma, low, high : float
        By what the logs identify in its place, and the 95 % interval that follows from theirs.
    bounded : float
        With what the logs only bound at its upper bounds.
    """

    output: str
    unit: str
    own: float
    sigma: float
    low: float
    high: float
    bounded: float


@dataclass(frozen=True)
class CampaignSigmas:
    """Navigation errors of a campaign with the noise that the logs identify.

    Attributes
    ----------
    replaced, kept, bounded : tuple of str
        Values that were replaced; values of the campaign that the logs do not identify; those at their bounds.
    """

    campaign: str
    rows: tuple[SigmaRow, ...]
    replaced: tuple[str, ...]
    kept: tuple[str, ...]
    bounded: tuple[str, ...]
    filtered: bool


@dataclass(frozen=True)
class IdentificationReport:
    """A unit identified from logs at rest."""

    logs: tuple[LogFacts, ...]
    axes: tuple[AxisReport, ...]
    grades: tuple[GradeRow, ...]
    notes: tuple[str, ...]
    imu: str
    sigmas: CampaignSigmas | None = None

    @property
    def instruments(self) -> Sequence[str]:
        """Instruments that the logs have."""
        return list(dict.fromkeys(axis.instrument for axis in self.axes))

    @property
    def parameters(self) -> list[ParameterRow]:
        """Parameters of all axes."""
        return [row for axis in self.axes for row in axis.parameters]
