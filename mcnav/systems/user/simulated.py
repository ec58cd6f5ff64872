"""Results that ``fly`` of a user's class may return besides errors: covariance and innovations of its own filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import BY_SENSOR, FilterSchema
from mcnav.contract.history import Epochs
from mcnav.systems.sample_loop import SampleFailed
from mcnav.systems.user.returned import numbers_of
from mcnav.systems.user.settings import NAME

ALL: Final = "all"
"""Group of all outputs."""

INDEFINITE: Final = 1e-9
"""Share of a unit eigenvalue by which rounding may make that of a correlation matrix negative."""

SAME_TIME: Final = 1e-9
"""Share of the time between first and last epoch by which an update may be later than an epoch and belong to it: times
that were computed in two ways differ by rounding, some 1e-13 of it."""


@dataclass(frozen=True)
class Innovations:
    """Innovations of one sensor in one simulation; those of scalar measurements may leave out axes of length 1.

    Attributes
    ----------
    times : array_like, shape (k,)
        Instants of the updates in the unit of the epochs, not falling, and none after the last epoch.
    values : array_like, shape (k, size)
        Measured less predicted, or predicted less measured, in any unit.
    covariance : array_like, shape (k, size, size)
        Covariance that the filter expects of them, in the square of that unit.
    accepted : array_like of bool, shape (k,), optional
        Whether the filter used the update, a number without unit; all unless given.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> range_ = mc.Innovations(times=[1.0, 2.0], values=[0.3, -0.1], covariance=[0.04, 0.04])
    >>> np.shape(range_.values)
    (2,)
    """

    times: Any
    values: Any
    covariance: Any
    accepted: Any = None


@dataclass(frozen=True)
class Simulated:
    """One simulation with a filter.

    Attributes
    ----------
    errors : array_like, shape (m, outputs)
        At every epoch, SI.
    covariance : array_like, shape (m, k, k), optional
        Covariance by the filter, SI, of the outputs that it knows: those of the class's ``filter_outputs``, by default
        all navigation errors.
    innovations : mapping of str to Innovations
        By the name of the sensor; always the same sensors.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> errors = np.array([[0.1], [0.2]])  # two epochs, one output
    >>> flight = mc.Simulated(errors, covariance=np.array([[[0.04]], [[0.05]]]))
    >>> flight.covariance.shape
    (2, 1, 1)
    """

    errors: Any
    covariance: Any = None
    innovations: Mapping[str, Innovations] = field(default_factory=dict)


def schema_of(
    simulated: Simulated,
    outputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
    known: Sequence[str],
) -> FilterSchema | None:
    """Derive the columns of the records from one simulation; none without a filter.

    Parameters
    ----------
    outputs : sequence of str
        Names of the outputs.
    groups : mapping of str to sequence of str
        Groups of outputs whose NEES is recorded besides that of all.
    known : sequence of str
        Outputs of which the filter states a covariance.

    Raises
    ------
    ValueError
        When names or shapes are wrong.
    """
    if simulated.covariance is None:
        if simulated.innovations or groups:
            raise ValueError("innovations and groups need the filter's covariance: Simulated(errors, covariance, ...)")
        return None
    for name in (*groups, *simulated.innovations):
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a name of letters, digits and _")
    for name, members in groups.items():
        if name == ALL or isinstance(members, str) or not members or not set(members) <= set(known):
            message = f"groups: {name!r} must list outputs that the filter knows and cannot be called {ALL!r}"
            raise ValueError(f"{message}; got {members!r:.80}")
        named = {output for output in known if output.startswith(name)}  # the analysis takes them for the group's
        if named and named != set(members):
            raise ValueError(f"groups: {name!r} must list the outputs whose names begin with it, or have another name")
    sizes = {name: _columns(name, innovation)[1].shape[1] for name, innovation in simulated.innovations.items()}
    return FilterSchema(
        groups={ALL: len(known)} | {name: len(members) for name, members in groups.items()},
        outputs=len(outputs),
        sensors=sizes,
        own_outputs=() if len(known) == len(outputs) else tuple(list(outputs).index(name) for name in known),
    )


def record_of(
    simulated: Simulated,
    schema: FilterSchema,
    epochs: Epochs,
    outputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
) -> Array:
    """Compute the records of one simulation at all epochs, shape (m, width).

    Raises
    ------
    SampleFailed
        When errors are not finite, or a covariance is indefinite.
    ValueError
        When shapes or sensors are wrong.
    """
    errors = numbers_of(simulated.errors, "fly")
    known = list(schema.known)
    count, size = len(errors), len(known)
    if simulated.covariance is None:
        raise ValueError("fly returned no covariance; it did without errors and noise")
    covariance = numbers_of(simulated.covariance, "covariance of fly")
    if covariance.shape != (count, size, size):
        raise ValueError(f"the filter's covariance must have shape {(count, size, size)}; got {covariance.shape}")
    if dict(schema.sensors).keys() != simulated.innovations.keys():
        listed = ", ".join(schema.sensors) or "no sensor"
        raise ValueError(f"innovations must always be of {listed}; got {', '.join(simulated.innovations) or 'none'}")
    _check_finite(errors, epochs, "errors")
    _check_finite(covariance, epochs, "the filter's covariance")
    records, places = np.zeros((count, schema.width)), schema.places
    names = [outputs[number] for number in known]
    for column, members in enumerate((names, *groups.values())):
        chosen = [names.index(name) for name in members]
        of_group = errors[:, [known[name] for name in chosen]]
        records[:, places["nees"].start + column] = _nees(of_group, covariance[:, chosen][:, :, chosen], epochs)
    covariance = spread_out(covariance, known, len(outputs))
    rows, columns = np.tril_indices(len(outputs))
    records[:, places["covariance"]] = covariance[:, rows, columns]
    sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    records[:, places["within_1"]] = np.abs(errors) <= sigmas
    records[:, places["within_3"]] = np.abs(errors) <= 3.0 * sigmas
    for name, innovations in simulated.innovations.items():
        records[:, places[f"sensor:{name}"]] = _counted(name, innovations, schema.sensors[name], epochs)
    return records


def spread_out(covariance: Array, known: Sequence[int], outputs: int) -> Array:
    """Return a covariance of some outputs, shape (m, k, k), as one of all, NaN for the others."""
    if len(known) == outputs:
        return covariance
    whole = np.full((len(covariance), outputs, outputs), np.nan)
    whole[:, np.array(known)[:, None], known] = covariance
    return whole


def _check_finite(values: Array, epochs: Epochs, what: str) -> None:
    finite = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not finite.all():
        time = epochs.times[np.argmin(finite)]
        raise SampleFailed(Failure(Reason.STATED, f"{what}: not finite at {epochs.label} = {time:g}"))


def _nees(errors: Array, covariance: Array, epochs: Epochs) -> Array:
    """Compute the NEES at every epoch, shape (m,); NaN where the covariance is singular.

    Raises `SampleFailed` where it is indefinite: a variance is negative, or an eigenvalue of the correlation matrix.
    """
    size = errors.shape[1]
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = covariance * scale[:, :, None] * scale[:, None, :]
    lowest = np.linalg.eigvalsh(correlation)[:, 0]
    negative = (variance < 0.0).any(axis=1) | (lowest < -INDEFINITE * size)
    if negative.any():
        time = epochs.times[np.argmax(negative)]
        raise SampleFailed(
            Failure(Reason.STATED, f"the filter's covariance is not positive definite at {epochs.label} = {time:g}")
        )
    regular = (variance > 0.0).all(axis=1) & (lowest > size * np.finfo(float).eps)
    correlation[~regular] = np.eye(size)
    deviations = (errors * scale)[:, :, None]
    squares = np.sum(deviations * np.linalg.solve(correlation, deviations), axis=(1, 2))
    return np.asarray(np.where(regular, squares, np.nan))


def _factors(matrices: Array, times: Array, name: str, label: str) -> Array:
    """Factor the innovation covariances of a sensor, shape (k, size, size)."""
    try:
        return np.asarray(np.linalg.cholesky(matrices))
    except np.linalg.LinAlgError:
        time = times[np.argmax(np.linalg.eigvalsh(matrices).min(axis=1) <= 0.0)]
        message = f"the filter's innovation covariance of {name} is not positive definite at {label} = {time:g}"
        raise SampleFailed(Failure(Reason.STATED, message)) from None


def _columns(name: str, innovations: Innovations) -> tuple[Array, Array, Array, Array]:
    """Return times (k,), values (k, size), covariances (k, size, size) and accepted (k,); `ValueError` when wrong."""
    if not isinstance(innovations, Innovations):
        raise ValueError(f"innovations of {name!r} must be Innovations of mcnav; got {type(innovations).__name__}")
    times = numbers_of(innovations.times, "times of innovations")
    values = numbers_of(innovations.values, "values of innovations")
    covariance = numbers_of(innovations.covariance, "covariance of innovations")
    values = values[:, None] if values.ndim == 1 else values
    covariance = covariance[:, None, None] if covariance.ndim == 1 else covariance
    accepted = innovations.accepted
    used = np.ones(times.shape) if accepted is None else np.array(accepted, dtype=float)
    count, size = (len(values), values.shape[1]) if values.ndim == 2 else (-1, -1)
    if (times.shape, covariance.shape, used.shape) != ((count,), (count, size, size), (count,)) or size < 1:
        shapes = f"{times.shape}, {values.shape}, {covariance.shape}"
        raise ValueError(f"innovations of {name!r} need shapes (k,), (k, size) and (k, size, size); got {shapes}")
    return times, values, covariance, used


def _counted(name: str, innovations: Innovations, size: int, epochs: Epochs) -> Array:
    """Sum over the updates since the epoch before, shape (m, 5); see `BY_SENSOR`."""
    times, values, covariance, accepted = _columns(name, innovations)
    if values.shape[1] != size:
        raise ValueError(f"innovations of {name!r} must always have size {size}; got {values.shape[1]}")
    place = np.searchsorted(epochs.times, times - SAME_TIME * (epochs.times[-1] - epochs.times[0]))
    if not np.isfinite(times).all() or np.any(np.diff(times) < 0.0) or np.any(place >= len(epochs.times)):
        raise ValueError(f"innovations of {name!r}: times must not fall, nor lie after the last epoch")
    if not np.isfinite(values).all() or not np.isfinite(covariance).all():
        raise SampleFailed(Failure(Reason.STATED, f"innovations of {name}: not finite"))
    factors = _factors(covariance, times, name, epochs.label)
    white = np.linalg.solve(factors, values[:, :, None])[:, :, 0]
    along = np.append(0.0, np.sum(white[1:] * white[:-1], axis=1) / size)[: len(white)]
    later = (np.arange(len(white)) > 0).astype(float)
    sums = {
        "nis": np.sum(white**2, axis=1), "accepted": accepted, "rejected": 1.0 - accepted, "lag": along, "lags": later,
    }  # fmt: skip
    return np.stack([np.bincount(place, sums[key], len(epochs.times)) for key in BY_SENSOR], axis=1)
