"""A recorded flight, and what a scenario's own filter makes of it: innovations, and the linear system that they obey.

The errors of the navigator on a record of n stages, and its filter's estimates a, obey ::

    s  <- F s - [B a; 0] + w          a <- D a
    nu  = H s - E a + noise
    s  <- s - [K_n nu; 0]             a <- a + K_a nu

with the errors s of navigation and of instruments and sensors, as they truly are, and the innovations nu. The gains K
are those that the filter used on this record. The covariances of the start, of w and of the noise are sums over causes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class RecordedMeasurements:
    """Measurements of one sensor.

    Attributes
    ----------
    times : ndarray, shape (u,)
        Rising, s after the start of the record.
    values : mapping of str to ndarray, shape (u, a)
        By quantity, along its axes, SI. A position is latitude, longitude and altitude; an attitude is roll, pitch and
        heading.

    sigmas : mapping of str to ndarray, shape (u, a)
        Of each measurement, of the quantities of which they are recorded.
    """

    times: Array
    values: Mapping[str, Array]
    sigmas: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class MeasurementFile:
    """File with the measurements of a sensor.

    Attributes
    ----------
    path : Path
    columns, units : mapping of str to str
        As `mcnav.read_track` takes them.
    factor : float
        Of the sigmas that the file states.
    """

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    factor: float = 1.0


@dataclass(frozen=True)
class RecordedTrack:
    """States over time, such as those of a reference.

    Attributes
    ----------
    times : ndarray, shape (m,)
        Rising, s after the start of the record.
    position : ndarray, shape (m, 3)
        Latitude, longitude, altitude: rad, rad, m.
    velocity : ndarray, shape (m, 3), optional
        North, east, down, m/s.
    attitude : ndarray, shape (m, 3), optional
        Roll, pitch, heading, rad.
    position_sigma, velocity_sigma : ndarray, shape (m, 3), optional
        North, east, down; none for zero.
    """

    times: Array
    position: Array
    velocity: Array | None = None
    attitude: Array | None = None
    position_sigma: Array | None = None
    velocity_sigma: Array | None = None


@dataclass(frozen=True)
class Recording:
    """A recorded flight.

    Attributes
    ----------
    ends : ndarray, shape (n,)
        Ends of the intervals over which the readings are means, rising, s; the first begins at zero.
    gyro, accelerometer : ndarray, shape (n, 3)
        rad/s and m/s^2.
    measurements : mapping of str to RecordedMeasurements
        By the names of the sensors.
    start : RecordedTrack, optional
        With one row, where navigation starts: velocity and attitude included. By default the scenario's own.
    reference : RecordedTrack, optional
        The truth, up to its sigmas.
    """

    ends: Array
    gyro: Array
    accelerometer: Array
    measurements: Mapping[str, RecordedMeasurements]
    start: RecordedTrack | None = None
    reference: RecordedTrack | None = None


@dataclass(frozen=True)
class Cause:
    """A random error, or process, whose size is a number of the campaign.

    Attributes
    ----------
    name : str
        Kind of errors: ``gnss_position_noise``, ``gyro_angle_random_walk``, …
    size : float
        The largest over its axes, SI.
    unit, shown_in : str
    key : str
        Where the campaign has it, such as ``[imu.gyro] angle_random_walk``.
    log_factor : float, optional
        Factor of the sigmas of a log, whose root mean square is the size; the key is that of the factor.
    absent : bool
        Whether the campaign does not have it: the size is one from which it is looked for.
    correlation_time : float
        Of a Gauss-Markov process that the campaign does not have, s; zero of others.
    """

    name: str
    size: float
    unit: str
    shown_in: str
    key: str
    log_factor: float | None = None
    absent: bool = False
    correlation_time: float = 0.0


@dataclass(frozen=True)
class Offset:
    """A constant error that the campaign does not have.

    Attributes
    ----------
    name : str
        Kind of errors: ``gnss_lever_arm``, ``gyro_bias``, …
    axes : tuple of str
    states : ndarray of int, shape (a,)
        Its places among the errors s.
    unit, shown_in : str
    key : str
        Where a campaign has it.
    used : ndarray, shape (a,), optional
        Of a lever arm: that which the filter uses. The error is the used one less the true one.
    """

    name: str
    axes: tuple[str, ...]
    states: IndexArray
    unit: str
    shown_in: str
    key: str
    used: Array | None = None


@dataclass(frozen=True)
class Part:
    """A covariance of some of the errors, from one cause.

    Attributes
    ----------
    cause : int
    places : ndarray of int, shape (k,)
    covariance : ndarray, shape (k, k)
    """

    cause: int
    places: IndexArray
    covariance: Array

    @cached_property
    def block(self) -> tuple[IndexArray, IndexArray]:
        """Rows and columns of its part of a covariance of all errors, shapes (k, 1), (1, k)."""
        return self.places[:, None], self.places[None]


@dataclass(frozen=True)
class ReadOut:
    """Comparison with a reference after a measurement.

    Attributes
    ----------
    errors : ndarray, shape (9,)
        Navigation errors: position, velocity, attitude; NaN where the reference does not have them.
    to_outputs : ndarray, shape (9, 9)
        From the first errors s to navigation errors.
    covariance : ndarray, shape (9, 9)
        The filter's, of the navigation errors.
    reference : ndarray, shape (9,)
        Variances of the reference.
    """

    errors: Array
    to_outputs: Array
    covariance: Array
    reference: Array


@dataclass(frozen=True)
class Stage:
    """The time up to a measurement, and the measurement of c components.

    Attributes
    ----------
    time : float
        s after the start of the record.
    sensor : int
        Number of the sensor.
    innovation : ndarray, shape (c,)
        Predicted less measured.
    covariance : ndarray, shape (c, c)
        Of the innovation, as the filter believes.
    accepted : bool
    transition : ndarray, shape (e, e), optional
        F; none where no time passes, so that F and D are ones and B is zero.
    feedback : ndarray, shape (9, q)
        B.
    decay : ndarray, shape (q,)
        D.
    response : ndarray, shape (c, e)
        H.
    own_response : ndarray, shape (c, q)
        E.
    gain : ndarray, shape (9 + q, c)
        K; zero where the measurement was rejected.
    processes : tuple of Part
        Covariance of w.
    noise : tuple of Part
        Covariance of the measurement's noise; places are components.
    read_out : ReadOut, optional
    """

    time: float
    sensor: int
    innovation: Array
    covariance: Array
    accepted: bool
    transition: Array | None
    feedback: Array
    decay: Array
    response: Array
    own_response: Array
    gain: Array
    processes: tuple[Part, ...]
    noise: tuple[Part, ...]
    read_out: ReadOut | None = None


@dataclass(frozen=True)
class RecordedSensor:
    """A sensor of a record: its name, and names and units of its components."""

    name: str
    components: tuple[str, ...]
    units: tuple[tuple[str, str], ...]
    gate: float | None


@dataclass(frozen=True)
class FilteredRecord:
    """A record as a filter went through it.

    Attributes
    ----------
    sensors : tuple of RecordedSensor
    stages : tuple of Stage
    causes : tuple of Cause
    offsets : tuple of Offset
    mean : ndarray, shape (e,)
        Of the errors s at the start.
    initial : ndarray, shape (e, e)
        Covariance at the start of the sources that the errors are, before `to_states`.
    initial_causes : ndarray of int, shape (e,)
        Cause of each of these; -1 for none.
    to_states : ndarray, shape (e, e)
        From sources to the errors s.
    duration : float
        Of the record, s.
    notes : tuple of str
        What was left out, a line each.
    """

    sensors: tuple[RecordedSensor, ...]
    stages: tuple[Stage, ...]
    causes: tuple[Cause, ...]
    offsets: tuple[Offset, ...]
    mean: Array
    initial: Array
    initial_causes: IndexArray
    to_states: Array
    duration: float
    notes: tuple[str, ...] = ()


GROUPS: Final = ("position", "velocity", "attitude")
"""Navigation errors, three by three."""


class RecordingError(ValueError):
    """A recorded flight that a filter cannot go through; the message says why."""
