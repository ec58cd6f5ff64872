"""Matrices of a run as arrays with names and units, for numpy (``.npz``), MATLAB (``.mat``) and xarray; all in SI.

`MATRICES` lists them. ``outputs``, ``sources`` and ``processes`` are their names, ``output_units`` and ``source_units``
their SI units. What a run does not know is left out. In MATLAB the first index of a stack of matrices is its last:
``Q(:, :, 1)``.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.report.results.model import RunAnalysis

HEADER: Final = 116
"""Bytes of text at the beginning of a MATLAB file."""

OUTPUTS: Final = ("output", "other_output")
"""Dimensions of a covariance matrix."""

AT_EPOCHS: Final = ("time", *OUTPUTS)
AT_PARTIALS: Final = ("time_of_partials", *OUTPUTS)


@dataclass(frozen=True)
class Matrix:
    """An array of a run.

    Attributes
    ----------
    name : str
        In ``.npz`` and ``.mat`` files.
    meaning : str
        What it is.
    dimensions : tuple of str
        In a data set.
    value : callable
        Returns it, SI; none where a run does not know it.
    variable : str
        Name in a data set; empty: it is not there, or in a table over time.
    powers : mapping of str to int
        Powers of the units of dimensions, where they are not one.
    """

    name: str
    meaning: str
    dimensions: tuple[str, ...]
    value: Callable[[RunAnalysis], Array | None]
    variable: str = ""
    powers: Mapping[str, int] = field(default_factory=dict)

    @property
    def stack(self) -> bool:
        """Return whether it is a stack of matrices."""
        return len(self.dimensions) == 3 and self.dimensions[1] == "output"


def _process_covariances(content: RunAnalysis) -> Array:
    return _stacked(content.model.processes, content.model.partials.shape[:1] * 2)


def _filter_covariance(content: RunAnalysis) -> Array | None:
    return None if content.filter is None else content.filter.covariance


def _filter_sigmas(content: RunAnalysis) -> Array | None:
    known, filtered = content.envelopes, content.filter
    if known is None or filtered is None or len(filtered.times) != len(known.times) or not filtered.outputs:
        return None
    return np.column_stack([output.filter for output in filtered.outputs])


def filter_covariances(content: RunAnalysis) -> Array | None:
    """Return the covariances of the outputs that linear analysis has the filter state at the epochs; none without."""
    known, record = content.envelopes, content.manifest.model.filter
    prediction = None if record is None else record.prediction
    if known is None or prediction is None or len(prediction.covariance) != len(known.times):
        return None
    return prediction.covariance


def linear_covariances(content: RunAnalysis) -> Array | None:
    """Return the linear covariances of the outputs over time; none where they are not known."""
    history, development = content.development, content.manifest.model.development
    if history is None:
        return None
    covariance = None if development is None else development.covariance
    if covariance is None and not history.processes:
        return transform(history.partials, content.model.covariance)
    return covariance


def _process_variances(content: RunAnalysis) -> Array | None:
    history = content.development
    return None if history is None else _stacked(history.processes, history.partials.shape[:2])


MATRICES: Final = (
    Matrix("P", "partial derivatives of the final errors", ("output", "source"),
           lambda run: run.model.partials, "partials", {"source": -1}),
    Matrix("S", "covariance of the sources", ("source", "other_source"),
           lambda run: run.model.covariance, "covariance_sources"),
    Matrix("Q", "covariance that each process of noise adds to the final errors", ("process", *OUTPUTS),
           _process_covariances, "covariance_noise"),
    Matrix("C_linear", "linear covariance of the final errors, P S P' + sum Q", OUTPUTS,
           lambda run: run.comparison.covariance_linear, "covariance_linear"),
    Matrix("C_plain", "Monte Carlo covariance, of all samples", OUTPUTS,
           lambda run: run.comparison.covariance_sample, "covariance_plain"),
    Matrix("C_paired", "Monte Carlo covariance, paired estimate", OUTPUTS,
           lambda run: run.comparison.covariance_paired, "covariance_paired"),
    Matrix("C_filter", "mean of what the samples' filters state at the end", OUTPUTS,
           _filter_covariance, "covariance_filter"),
    Matrix("mean_sources", "means of the sources", ("source",), lambda run: run.model.mean),
    Matrix("mean_linear", "linear mean of the final errors", ("output",), lambda run: run.model.outcome_mean),
    Matrix("mean_plain", "Monte Carlo mean", ("output",), lambda run: np.asarray(run.comparison.mean_sample)),
    Matrix("t", "epochs, in t_unit", ("time",), lambda run: None if run.envelopes is None else run.envelopes.times),
    Matrix("C_plain_t", "Monte Carlo covariance at each epoch", AT_EPOCHS,
           lambda run: None if run.envelopes is None else run.envelopes.covariance, "covariance_plain_over_time"),
    Matrix("C_filter_t", "covariance of the filter of linear analysis at each epoch", AT_EPOCHS,
           filter_covariances, "covariance_filter_linear_over_time"),
    Matrix("sigma_linear_t", "linear sigmas at each epoch", ("time", "output"),
           lambda run: None if run.envelopes is None else run.envelopes.linear_sigma),
    Matrix("sigma_plain_t", "Monte Carlo sigmas at each epoch", ("time", "output"),
           lambda run: None if run.envelopes is None else run.envelopes.sigma),
    Matrix("sigma_filter_t", "root of the mean variance that the samples' filters state", ("time", "output"),
           _filter_sigmas),
    Matrix("t_P", "times of the partial derivatives, in t_P_unit", ("time_of_partials",),
           lambda run: None if run.development is None else run.development.times),
    Matrix("P_t", "partial derivatives of the errors at each of them", ("time_of_partials", "output", "source"),
           lambda run: None if run.development is None else run.development.partials, "partials_over_time",
           {"source": -1}),
    Matrix("C_linear_t", "linear covariance", AT_PARTIALS, linear_covariances, "covariance_linear_over_time"),
    Matrix("Q_variance_t", "variance that each process of noise has added",
           ("process", "time_of_partials", "output"), _process_variances, "variance_noise_over_time", {"output": 2}),
)  # fmt: skip
"""All arrays but those of texts."""


def arrays(content: RunAnalysis) -> dict[str, NDArray[Any]]:
    """Return the matrices of a run by name; texts are arrays of strings."""
    record = content.manifest.model
    result: dict[str, NDArray[Any]] = {
        "outputs": _texts([output.name for output in record.outputs]),
        "output_units": _texts([output.unit for output in record.outputs]),
        "sources": _texts([source.name for source in record.sources]),
        "source_units": _texts([source.unit for source in record.sources]),
        "processes": _texts(list(content.model.processes)),
    }
    result |= {matrix.name: value for matrix in MATRICES if (value := matrix.value(content)) is not None}
    for name, known in (("t_unit", content.envelopes), ("t_P_unit", content.development)):
        result |= {} if known is None else {name: _unit(known.label)}
    return {name: result[name] for name in sorted(result)}


def _texts(texts: Sequence[str]) -> NDArray[np.str_]:
    return np.array(texts, dtype=str)


def _unit(label: str) -> NDArray[np.str_]:
    """Return the unit of a label, as ``name [unit]``."""
    return np.array(label.rpartition("[")[2].removesuffix("]"), dtype=str)


def _stacked(by_name: Mapping[str, NDArray[np.float64]], shape: tuple[int, ...]) -> NDArray[np.float64]:
    return np.stack(list(by_name.values())) if by_name else np.zeros((0, *shape))


def as_npz(npz: Mapping[str, NDArray[Any]]) -> bytes:
    """Encode arrays as ``.npz``, which ``numpy.load`` reads without pickles; the same bytes every time."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **dict[str, Any](npz))
    return buffer.getvalue()


def as_mat(mat: Mapping[str, NDArray[Any]], title: str = "mcnav") -> bytes:
    """Encode arrays as a MATLAB file of level 5: lists of texts become cells; the same bytes every time.

    Raises `ValueError` when an array is larger than such a file holds, 2 GB.
    """
    from scipy.io import savemat

    variables, stacks = dict[str, Any](), {matrix.name for matrix in MATRICES if matrix.stack}
    for name, array in mat.items():
        if array.dtype.kind == "U":
            variables[name] = str(array) if array.ndim == 0 else array.astype(object)
        else:
            variables[name] = np.moveaxis(array, 0, -1) if name in stacks else array
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=True, oned_as="column")
    text = f"MATLAB 5.0 MAT-file, {title}".encode("ascii", "replace")[:HEADER].ljust(HEADER)
    return text + buffer.getvalue()[HEADER:]  # scipy's text has the time
