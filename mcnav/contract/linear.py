"""The linear system of a scenario: at its end, over its flight, and at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mcnav._types import Array


@dataclass(frozen=True)
class LinearModel:
    """Final errors as a linear function of the errors going in, ``nominal + partials @ errors``, and of noise.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
        SI units: the matrix P of NASA TN D-1772, eq. (13).
    nominal : ndarray, shape (outputs,)
        Final errors of a system without errors.
    processes : mapping of str to ndarray, shape (outputs, outputs)
        Covariance that each process of noise adds, by name.
    """

    partials: Array
    nominal: Array
    processes: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class PartialsHistory:
    """Partial derivatives of the errors at many times of one flight.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (n,)
    partials : ndarray, shape (n, outputs, sources)
        SI.
    processes : mapping of str to ndarray, shape (n, outputs, outputs)
        Covariance that each process of noise has added, by name.
    """

    label: str
    times: Array
    partials: Array
    processes: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class LinearReadings:
    """The linear system read out at some times, r of them, before or after updates of aiding.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the scenario's own time.
    updates : tuple of str or None
        ``before`` or ``after`` where an update falls on the time.
    partials : ndarray, shape (r, outputs, sources)
    processes : mapping of str to ndarray, shape (r, outputs, outputs)
        Covariance that each process of noise has added, by name.
    own : ndarray, shape (r, outputs, outputs), optional
        Covariance that the navigator's filter states.
    label : str
        What the times are, as ``name [unit]``.
    believed : mapping of str to float
        As in `FilterPrediction`.
    """

    times: Array
    updates: tuple[Literal["before", "after"] | None, ...]
    partials: Array
    processes: Mapping[str, Array] = field(default_factory=dict)
    own: Array | None = None
    label: str = "time [s]"
    believed: Mapping[str, float] = field(default_factory=dict)


@dataclass
class SharedTables:
    """Tables of the last scenario that was read out, for the next one along the same truth; not for several threads."""

    tables: object = None


@dataclass(frozen=True)
class CovarianceReadings:
    """Mean and covariance of the errors by the linear system at some times, r of them, after updates of aiding.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the scenario's own time, s.
    mean : ndarray, shape (r, outputs)
    covariance : ndarray, shape (r, outputs, outputs)
    own : ndarray, shape (r, outputs, outputs), optional
        As the navigator's filter states it.
    """

    times: Array
    mean: Array
    covariance: Array
    own: Array | None = None
