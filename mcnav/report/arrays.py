"""Matrices of a run as arrays with names and units, for numpy (``.npz``) and MATLAB (``.mat``); all numbers in SI.

With k outputs, n sources, p processes of noise and m epochs:

==================  =============  =====================================================================================
``P``               (k, n)         partial derivatives of the final errors
``S``               (n, n)         covariance of the sources
``Q``               (p, k, k)      covariance that each process adds to the final errors
``C_linear``        (k, k)         linear covariance of the final errors, ``P S P' + sum Q``
``C_plain``         (k, k)         Monte Carlo, of all samples
``C_paired``        (k, k)         Monte Carlo, paired estimate
``C_filter``        (k, k)         mean of what the samples' filters state at the end
``mean_sources``    (n,)           means of the sources
``mean_linear``     (k,)           linear mean of the final errors
``mean_plain``      (k,)           Monte Carlo mean
``t``               (m,)           epochs, in ``t_unit``
``C_plain_t``       (m, k, k)      Monte Carlo covariance at each epoch
``C_filter_t``      (m, k, k)      of the filter of linear analysis
``sigma_linear_t``  (m, k)         linear sigmas
``sigma_plain_t``   (m, k)         Monte Carlo
``sigma_filter_t``  (m, k)         root of the mean variance that the samples' filters state
``t_P``             (m',)          times of the partial derivatives, in ``t_P_unit``
``P_t``             (m', k, n)     partial derivatives of the errors at each of them
``C_linear_t``      (m', k, k)     linear covariance
``Q_variance_t``    (p, m', k)     variance that each process has added
==================  =============  =====================================================================================

``outputs``, ``sources`` and ``processes`` are their names, ``output_units`` and ``source_units`` their SI units. What a
run does not know is left out. In MATLAB the first index of a stack of matrices is its last: ``Q(:, :, 1)``.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.report.model import RunAnalysis

HEADER: Final = 116
"""Bytes of text at the beginning of a MATLAB file."""

STACKS: Final = ("Q", "C_linear_t", "C_plain_t", "C_filter_t", "P_t")
"""Stacks of matrices."""


def arrays(content: RunAnalysis) -> dict[str, NDArray[Any]]:
    """Return the matrices of a run by the names of this module's table; texts are arrays of strings."""
    model, comparison, record = content.model, content.comparison, content.manifest.model
    result: dict[str, NDArray[Any]] = {
        "outputs": _texts([output.name for output in record.outputs]),
        "output_units": _texts([output.unit for output in record.outputs]),
        "sources": _texts([source.name for source in record.sources]),
        "source_units": _texts([source.unit for source in record.sources]),
        "processes": _texts(list(model.processes)),
        "P": model.partials,
        "S": model.covariance,
        "Q": _stacked(model.processes, model.partials.shape[:1] * 2),
        "C_linear": comparison.covariance_linear,
        "C_plain": comparison.covariance_sample,
        "C_paired": comparison.covariance_paired,
        "mean_sources": model.mean,
        "mean_linear": model.outcome_mean,
        "mean_plain": np.asarray(comparison.mean_sample),
    }
    filtered, prediction = content.filter, None if record.filter is None else record.filter.prediction
    if filtered is not None and filtered.covariance is not None:
        result["C_filter"] = filtered.covariance
    if (known := content.envelopes) is not None:
        result |= {"t": known.times, "t_unit": _unit(known.label), "C_plain_t": known.covariance}
        result |= {"sigma_linear_t": known.linear_sigma, "sigma_plain_t": known.sigma}
        if filtered is not None and len(filtered.times) == len(known.times) and filtered.outputs:
            result["sigma_filter_t"] = np.column_stack([output.filter for output in filtered.outputs])
        if prediction is not None and len(prediction.covariance) == len(known.times):
            result["C_filter_t"] = prediction.covariance
    if (history := content.development) is not None:
        noise = _stacked(history.processes, history.partials.shape[:2])
        result |= {"t_P": history.times, "t_P_unit": _unit(history.label), "P_t": history.partials}
        result["Q_variance_t"] = noise
        development = record.development
        covariance = None if development is None else development.covariance
        if covariance is None and not history.processes:
            covariance = history.partials @ model.covariance @ history.partials.swapaxes(1, 2)
        if covariance is not None:
            result["C_linear_t"] = covariance
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

    variables: dict[str, Any] = {}
    for name, array in mat.items():
        if array.dtype.kind == "U":
            variables[name] = str(array) if array.ndim == 0 else array.astype(object)
        else:
            variables[name] = np.moveaxis(array, 0, -1) if name in STACKS else array
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=True, oned_as="column")
    text = f"MATLAB 5.0 MAT-file, {title}".encode("ascii", "replace")[:HEADER].ljust(HEADER)
    return text + buffer.getvalue()[HEADER:]  # scipy's text has the time
