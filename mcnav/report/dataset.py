"""Results of a run as an xarray data set, whose dimensions have names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.report.arrays import arrays
from mcnav.report.model import RunAnalysis
from mcnav.report.result_table import ResultTable, Units, in_units
from mcnav.report.tables_over_time import tables_over_time

if TYPE_CHECKING:
    import xarray as xr

MISSING: Final = "to_xarray needs xarray: pip install 'mcnav[xarray]'"

OUTPUTS: Final = ("output", "other_output")
"""Dimensions of a covariance matrix."""

MATRICES: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = {
    "P": ("partials", ("output", "source")),
    "S": ("covariance_sources", ("source", "other_source")),
    "Q": ("covariance_noise", ("process", *OUTPUTS)),
    "C_linear": ("covariance_linear", OUTPUTS),
    "C_plain": ("covariance_plain", OUTPUTS),
    "C_paired": ("covariance_paired", OUTPUTS),
    "C_filter": ("covariance_filter", OUTPUTS),
    "C_plain_t": ("covariance_plain_over_time", ("time", *OUTPUTS)),
    "C_filter_t": ("covariance_filter_linear_over_time", ("time", *OUTPUTS)),
    "P_t": ("partials_over_time", ("time_of_partials", "output", "source")),
    "C_linear_t": ("covariance_linear_over_time", ("time_of_partials", *OUTPUTS)),
    "Q_variance_t": ("variance_noise_over_time", ("process", "time_of_partials", "output")),
}
"""Variable and dimensions of each array of `mcnav.report.arrays`."""

PREFIXES: Final = {"epochs": "", "nees": "", "nis": "", "filter_states": "state_"}
"""Tables over time that the data set holds, and what precedes the names of their columns."""

PLAIN: Final = {"nees": {"ratio": "nees_ratio", "ratio_from": "nees_ratio_from", "ratio_to": "nees_ratio_to",
                         "ratio_linear": "nees_ratio_linear"}}  # fmt: skip
"""Columns that have other names in the data set, where tables share them."""


def dataset(content: RunAnalysis, units: Units = "SI") -> xr.Dataset:
    """Return moments over time, matrices and what is known of a filter, by output, source, process and time.

    Units are in the coordinates ``output_unit``, ``source_unit`` and ``state_unit``; a matrix has their products.

    Raises
    ------
    ImportError
        Where xarray is not installed.
    """
    try:
        import xarray as xr
    except ImportError:
        raise ImportError(MISSING) from None
    record, summary = content.manifest.model, content.summary
    scales, coordinates = {}, dict[str, Any]()
    for kind, variables in (("output", record.outputs), ("source", record.sources)):
        shown = [in_units(each.unit, each.shown_in, units) for each in variables]
        scales[kind] = scales[f"other_{kind}"] = np.array([factor for factor, _ in shown])
        names = [each.name for each in variables]
        coordinates |= {kind: names, f"other_{kind}": names, f"{kind}_unit": (kind, [unit for _, unit in shown])}
    coordinates["process"] = np.array(list(content.model.processes), dtype=str)
    result = arrays(content)
    for name, dimension in (("t", "time"), ("t_P", "time_of_partials")):
        if name in result:
            coordinates[dimension] = (dimension, result[name], {"units": str(result[f"{name}_unit"])})
    values: dict[str, Any] = {}
    for name, (variable, dimensions) in MATRICES.items():
        if name in result:
            values[variable] = dimensions, _rescaled(result[name], name, dimensions, scales)
    for table in tables_over_time(content, units).values():
        if table.name in PREFIXES:
            columns, further = _over_time(table)
            values, coordinates = values | columns, coordinates | further
    attributes = {key: getattr(summary, key) for key in ("campaign", "samples", "seed", "engine", "verdict")}
    return xr.Dataset(values, coordinates, {**attributes, "units": units})


def _rescaled(array: Any, name: str, dimensions: tuple[str, ...], scales: Mapping[str, Any]) -> Any:
    """Convert an array from SI: a partial derivative is divided by the unit of its source, a variance has it twice."""
    for axis, dimension in enumerate(dimensions):
        if dimension in scales:
            power = 2 if name == "Q_variance_t" else -1 if dimension == "source" and name in ("P", "P_t") else 1
            array = array * (scales[dimension] ** power).reshape(-1, *(1,) * (len(dimensions) - axis - 1))
    return array


def _over_time(table: ResultTable) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the columns of a table over time as variables by time and name, and the coordinates of the names."""
    (label, times), (kind, names), *columns = table.columns.items()
    count = len(dict.fromkeys(names))
    shape, prefix = (len(times) // count, count), PREFIXES[table.name]
    unit = label.rpartition("[")[2].removesuffix("]")
    coordinates: dict[str, Any] = {kind: list(names[:count])}
    coordinates["time"] = ("time", np.asarray(times)[::count], {"units": unit})
    values = {}
    for name, column in columns:
        variable = PLAIN.get(table.name, {}).get(name, f"{prefix}{name}")
        if name in ("unit", "states", "components"):
            coordinates[f"{kind}_{name}"] = (kind, list(column[:count]))
        else:
            values[variable] = (("time", kind), np.asarray(column, dtype=float).reshape(shape))
    return values, coordinates
