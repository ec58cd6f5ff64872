"""Results of a run as an xarray data set, whose dimensions have names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.report.columns.result_table import Units, in_units
from mcnav.report.columns.tables_over_time import over_time
from mcnav.report.exports import arrays as matrices
from mcnav.report.exports.arrays import Matrix
from mcnav.report.results.model import RunAnalysis

if TYPE_CHECKING:
    import xarray as xr

MISSING: Final = "to_xarray needs xarray: pip install 'mcnav[xarray]'"


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
        shown = [in_units(variable.unit, variable.shown_in, units) for variable in variables]
        scales[kind] = scales[f"other_{kind}"] = np.array([factor for factor, _ in shown])
        names = [variable.name for variable in variables]
        coordinates |= {kind: names, f"other_{kind}": names, f"{kind}_unit": (kind, [unit for _, unit in shown])}
    coordinates["process"] = np.array(list(content.model.processes), dtype=str)
    result = matrices.arrays(content)
    for name, dimension in (("t", "time"), ("t_P", "time_of_partials")):
        if name in result:
            coordinates[dimension] = (dimension, result[name], {"units": str(result[f"{name}_unit"])})
    values: dict[str, Any] = {}
    for matrix in matrices.MATRICES:
        if matrix.variable and matrix.name in result:
            array = _rescaled(result[matrix.name], matrix, scales)
            values[matrix.variable] = matrix.dimensions, array, {"long_name": matrix.meaning}
    for over_flight in over_time(content, units):
        if over_flight.variables:
            ((kind, labels),) = over_flight.names.items()
            unit = over_flight.label.rpartition("[")[2].removesuffix("]")
            coordinates |= {kind: list(labels), "time": ("time", over_flight.times, {"units": unit})}
            coordinates |= {f"{kind}_{name}": (kind, list(fixed)) for name, fixed in over_flight.fixed.items()}
            values |= {name: (("time", kind), over_flight.columns[column].astype(float))
                       for name, column in over_flight.variables.items()}  # fmt: skip
    attributes = {key: getattr(summary, key) for key in ("campaign", "samples", "seed", "engine", "verdict")}
    return xr.Dataset(values, coordinates, {**attributes, "units": units})


def _rescaled(array: Array, matrix: Matrix, scales: Mapping[str, Array]) -> Array:
    """Convert an array from SI."""
    for axis, dimension in enumerate(matrix.dimensions):
        if dimension in scales:
            factors = scales[dimension] ** matrix.powers.get(dimension, 1)
            array = array * factors.reshape(-1, *(1,) * (array.ndim - axis - 1))
    return array
