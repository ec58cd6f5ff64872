"""Sizes of errors as Python has them: SI floats, text with units, pint quantities, distributions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcnav.physics.units import parted, quantity, si_unit
from mcnav.sampler.distributions import Distribution, Fixed, Normal, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.sampler.scipy_and_tables import (
    EmpiricalDistribution,
    ScipyDistribution,
    continuous_distributions,
    shape_names,
)


@dataclass(frozen=True)
class ErrorSize:
    """An error source's distribution in SI, its SI unit, and its entry of ``[errors]`` in a campaign file.

    The unit is empty where only floats were given. The entry is none for values that are in no file.
    """

    distribution: Distribution
    unit: str
    entry: Any


def in_si(value: Any) -> tuple[float, str]:
    """Return a value in SI and its SI unit, which is empty for a number.

    Raises `ValueError` for what is no size.

    >>> in_si("5 km"), in_si(2e-4), in_si("5 %")
    ((5000.0, 'm'), (0.0002, ''), (0.05, '1'))
    """
    if hasattr(value, "to_base_units"):  # a quantity of pint, in its owner's registry
        base = value.to_base_units()
        written = f"{base.units:~C}".replace("**", "^")
        return in_si(f"{float(base.magnitude)!r} {written}" if written else f"{float(base.magnitude)!r} 1")
    if isinstance(value, str):
        unit = parted(value)[1]
        if not unit:
            return quantity(value, "1"), "1"
        target = si_unit(unit)
        return quantity(value, target), target
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ValueError(
            f"got {value!r:.80}; expected an SI number, text with a unit such as '5 km', or a distribution"
        )
    if not np.isfinite(value):
        raise ValueError(f"got {value!r}; expected a finite number")
    return float(value), ""


def _written(value: Any) -> Any:
    """Return a value as a campaign file has it: text as it is, numbers in SI."""
    return value if isinstance(value, str) else _text_of(*in_si(value))


def _text_of(value: float, unit: str) -> Any:
    return f"{value!r} {unit}" if unit not in ("", "1") else value


def size_of(given: Any) -> ErrorSize:
    """Convert what `mcnav.Errors` takes to a size; `ValueError` for what is none."""
    if isinstance(given, ErrorSize):
        return given
    if hasattr(given, "dist") and hasattr(given, "kwds"):
        return _frozen(given)
    return normal(given)


def _make(kind: str, make: Any, pure: Mapping[str, float], **given: Any) -> ErrorSize:
    """Make a distribution of parameters that have one unit, and of ``pure`` numbers."""
    values = {name: in_si(value) for name, value in given.items()}
    units = {unit for _, unit in values.values()} - {""}
    if len(units) > 1:
        raise ValueError(f"{' and '.join(given)} must have one unit; got {' and '.join(map(str, given.values()))}")
    distribution = make(*(value for value, _ in values.values()), **pure)
    entry = {"distribution": kind, **{name: _written(value) for name, value in given.items()}, **pure}
    return ErrorSize(distribution, units.pop() if units else "", entry)


def normal(sigma: Any, mean: Any = 0.0) -> ErrorSize:
    """Return a normal error.

    Parameters
    ----------
    sigma, mean : float, str or quantity
        Standard deviation, and a mean of the same unit; a float is SI.

    Raises
    ------
    ValueError
        When one is no size, or sigma is negative.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Errors({"altitude": mc.normal("5 km")}).standard_deviations["altitude"]
    np.float64(5000.0)
    >>> mc.normal("20 ms", mean="110 ms").entry
    {'distribution': 'normal', 'sigma': '20 ms', 'mean': '110 ms'}
    """
    made = _make("normal", Normal, {}, sigma=sigma, mean=mean)
    return made if made.distribution.mean else replace(made, entry=made.entry["sigma"])


def uniform(half_width: Any) -> ErrorSize:
    """Return an error that is uniform on -half_width to half_width; its sigma is half_width / sqrt(3).

    Parameters
    ----------
    half_width : float, str or quantity
        A float is SI.

    Raises
    ------
    ValueError
        When it is no size, or not positive.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Errors({"tilt": mc.uniform("3 mrad")}).standard_deviations.round(6)["tilt"]
    np.float64(0.001732)
    """
    return _make("uniform", Uniform, {}, half_width=half_width)


def triangular(half_width: Any) -> ErrorSize:
    """Return a symmetric triangular error on -half_width to half_width; its sigma is half_width / sqrt(6).

    Raises `ValueError` when it is no size, or not positive.

    >>> triangular("6 m").unit
    'm'
    """
    return _make("triangular", Triangular, {}, half_width=half_width)


def truncated_normal(sigma: Any, limit: Any) -> ErrorSize:
    """Return a normal error of parameter sigma that is truncated at -limit and limit, both of one unit.

    Raises `ValueError` when one is no size, or not positive.

    >>> round(truncated_normal("1 km", "2 km").distribution.standard_deviation, 1)
    879.6
    """
    return _make("truncated-normal", TruncatedNormal, {}, sigma=sigma, limit=limit)


def student_t(sigma: Any, degrees_of_freedom: float) -> ErrorSize:
    """Return an error of Student's t distribution.

    Parameters
    ----------
    sigma : float, str or quantity
        Standard deviation, not the scale; a float is SI.
    degrees_of_freedom : float
        Above 2, where the variance is finite.

    Raises
    ------
    ValueError
        When sigma is no size, or the variance is not finite.

    Examples
    --------
    >>> student_t("1 deg/h", 5).unit
    'rad/s'
    """
    return _make("student-t", StudentT, {"degrees_of_freedom": float(degrees_of_freedom)}, sigma=sigma)


def fixed(value: Any) -> ErrorSize:
    """Return an error that is known: it has the mean ``value``, SI as a float, and no spread.

    Raises `ValueError` when it is no size.

    Examples
    --------
    >>> fixed("50 ms").distribution.mean
    0.05
    """
    return _make("fixed", Fixed, {}, value=value)


def table(values: Any, column: str = "", unit: str = "") -> ErrorSize:
    """Return an error whose values were measured: each is equally likely.

    Parameters
    ----------
    values : sequence of float, str or path
        Values, or a CSV or parquet file that has them in a column.
    column : str
        Column of the file.
    unit : str
        Unit of the values; SI where it is empty.

    Raises
    ------
    ValueError
        When fewer than two values differ, one is not finite, or the unit is not known.

    Examples
    --------
    >>> round(table([1.0, 2.0, 3.0, 6.0], unit="deg/h").distribution.mean * 206264.8, 3)
    3.0
    """
    scale, target = (1.0, "") if not unit else in_si(f"1 {unit}")
    if isinstance(values, str) or hasattr(values, "__fspath__"):
        return _table_in_file(str(values), column, unit or "1", scale, target)
    try:
        measured = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"got {values!r:.80}; expected numbers, or a file and its column") from None
    return ErrorSize(EmpiricalDistribution(scale * measured.ravel()), target, None)


def _table_in_file(file: str, column: str, unit: str, scale: float, target: str) -> ErrorSize:
    import pandas as pd

    try:
        frame = pd.read_parquet(file) if file.endswith(".parquet") else pd.read_csv(file)
    except (OSError, ValueError) as failure:  # among the second are those of pandas and of pyarrow
        reason = failure.strerror if isinstance(failure, OSError) and failure.strerror else str(failure)
        raise ValueError(f"{file}: cannot be read as a table: {reason}") from None
    if column not in frame:
        raise ValueError(f"{file} has no column {column!r}; it has {', '.join(map(str, frame.columns))}")
    entry = {"distribution": "table", "file": file, "column": column, "unit": unit}
    return ErrorSize(EmpiricalDistribution(scale * frame[column].to_numpy(float)), target, entry)


def _frozen(given: Any) -> ErrorSize:
    """Convert a frozen distribution of scipy.stats, whose location and scale are SI."""
    name = given.dist.name
    if name not in continuous_distributions():
        raise ValueError(f"got scipy.stats.{name}; expected a continuous distribution")
    names: Sequence[str] = (*shape_names(name), "loc", "scale")
    stated = dict(zip(names, given.args, strict=False)) | dict(given.kwds)
    values = {key: stated.get(key, 1.0 if key == "scale" else 0.0) for key in names}
    for key, value in values.items():
        if np.ndim(value) != 0:
            raise ValueError(f"got scipy.stats.{name} with {np.size(value)} values of {key}; expected one")
    values = {key: float(value) for key, value in values.items()}
    shapes = tuple((key, values[key]) for key in names[:-2])
    distribution = ScipyDistribution(name, shapes, values["loc"], values["scale"])
    return ErrorSize(distribution, "", {"distribution": f"scipy.{name}", **values})
