"""Records of filters over a flight: sums in the chunks' files, and the tables made of their total."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.quantities import Output
from mcnav.files.parquet import arrow_table, parquet_bytes
from mcnav.statistics.filter_sums import FilterMeans, FilterSums

MARK: Final = "mcnav.filter"
SMOOTHER_MARK: Final = "mcnav.smoother"

LARGEST: Final = 100_000_000
"""Bytes of a chunk's sums, at most."""


def filter_marks(sums: FilterSums | None, mark: str = MARK) -> dict[str, str]:
    """Encode sums as metadata of a chunk's file; counts that are all the same take no room."""
    if sums is None:
        return {}
    return {mark: base64.b64encode(zlib.compress(sums.to_numbers().astype("<f8").tobytes(), 1)).decode()}


def filter_sums_in(marks: Mapping[bytes, bytes], schema: FilterSchema, mark: str = MARK) -> FilterSums | None:
    """Decode the sums in the metadata of a chunk's file; none without.

    Raises `ValueError`, `OverflowError`, `zlib.error` when they are damaged.
    """
    text = marks.get(mark.encode())
    if text is None:
        return None
    content = zlib.decompressobj().decompress(base64.b64decode(text), LARGEST)
    return FilterSums.from_numbers(schema, np.frombuffer(content, dtype="<f8").astype(float))


def filter_columns(
    outputs: Sequence[Output], means: FilterMeans, prediction: FilterPrediction | None
) -> dict[str, Array]:
    """Return columns of ``epochs.parquet``: sigmas of the filters, and of the filter of linear analysis.

    ``filter sigma`` is the root of the mean variance of all samples' filters.
    """
    variances, columns = means.variances.value[:-1], {}
    for i, output in enumerate(outputs):
        columns[f"filter sigma {output.name} [{output.unit}]"] = np.sqrt(np.maximum(variances[:, i], 0.0))
    if prediction is not None:
        for i, output in enumerate(outputs):
            own = np.sqrt(np.maximum(prediction.covariance[:, i, i], 0.0))
            columns[f"linear filter sigma {output.name} [{output.unit}]"] = own
    return columns


def filter_table(epochs: Epochs, outputs: Sequence[Output], means: FilterMeans) -> bytes:
    """Tabulate the means over all samples' filters at every epoch.

    Columns: ``nees GROUP`` and its standard error; ``within 1 sigma`` and ``within 3 sigma`` of each output, as shares;
    ``error`` (root mean square) and ``filter sigma`` of the filter's other states; for each sensor, since the epoch
    before, ``accepted`` and ``rejected`` updates of a sample, and means over updates: ``nis`` and, of consecutive
    updates, ``lag`` (product of whitened innovations by size).
    """
    schema, columns = means.schema, {epochs.label: epochs.times}
    nees = means.at("nees")
    for i, group in enumerate(schema.groups):
        columns[f"nees {group}"] = nees.value[:-1, i]
        columns[f"nees standard error {group}"] = nees.standard_error[:-1, i]
    for name in ("within_1", "within_3"):
        shares = means.at(name).value[:-1]
        for i, output in enumerate(outputs):
            columns[f"{name.replace('_', ' ')} sigma {output.name}"] = shares[:, i]
    errors, variances = means.squared_state_errors.value[:-1], means.at("state_variance").value[:-1]
    for i, (state, (unit, _)) in enumerate(zip(schema.states, schema.units, strict=True)):
        columns[f"error {state} [{unit}]"] = np.sqrt(np.maximum(errors[:, i], 0.0))
        columns[f"filter sigma {state} [{unit}]"] = np.sqrt(np.maximum(variances[:, i], 0.0))
    for sensor, _, table in means.sensors():
        accepted, rejected = table["accepted"].value[:-1], table["rejected"].value[:-1]
        columns[f"accepted {sensor}"], columns[f"rejected {sensor}"] = accepted, rejected
        columns[f"nis {sensor}"] = _over(table["nis"].value[:-1], accepted + rejected)
        columns[f"lag {sensor}"] = _over(table["lag"].value[:-1], table["lags"].value[:-1])
    return parquet_bytes(arrow_table(columns))


def _over(sums: Array, counts: Array) -> Array:
    """Divide where there is something to divide by, else NaN."""
    return np.where(counts > 0.0, sums / np.where(counts > 0.0, counts, 1.0), np.nan)
