"""Linear covariance analysis on labelled frames: the partial-derivative matrix P, and P S P'."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.contract.errors import SimulationFailed
from mcnav.contract.quantities import Output
from mcnav.contract.scenario import ScenarioError
from mcnav.execution.threads import one_thread
from mcnav.frames.given import remedy_for
from mcnav.frames.systems import Simulatable, system_of
from mcnav.linear.covariance import propagated_covariance
from mcnav.sampler.errors import Errors, as_errors

MEAN: Final = "mean"
"""Key of ``attrs`` of a propagated covariance under which the linear mean of each output is."""

ROUNDING: Final = 1e-9
"""Share of the sigmas' product by which rounding may move an entry of a covariance."""

DOUBTFUL: Final = 0.01
"""Error of P, as a share of the largest contribution of one sigma, from which a warning tells of it: a fifth of the
tolerance of comparisons."""

WITHOUT: Final = "noise left out"
"""Key of its ``attrs`` that lists the processes of noise of the system, which P S P' does not have."""


def partials(
    system: Simulatable, errors: Errors | Mapping[str, Any], outputs: str | Sequence[str | Output] = ()
) -> pd.DataFrame:
    """Compute the partial-derivative matrix P about no errors: TN D-1772, eq. (13).

    A built-in scenario, a closed loop, and a class with ``partials`` have equations of their own. Others are
    differenced centrally, each source with the step, between 1e-4 and 0.3 of its sigma, that its neighbours confirm.

    Parameters
    ----------
    system
        As in `mcnav.simulate`.
    errors : Errors or mapping
        Error sources, the columns of P in this order; their sigmas scale the steps.
    outputs : str, or sequence of str or Output, optional
        As in `mcnav.simulate`.

    Returns
    -------
    DataFrame, shape (outputs, sources)
        SI unit of the row over that of the column. ``attrs`` has ``error``, an estimate of P's own error: the largest
        difference from other steps, or of the equations from differences, as a share of the largest contribution of
        one sigma in a row; ``nominal``, the outputs without errors; ``noise``, by process of noise the variance that
        it adds to each output; and ``units``.

    Raises
    ------
    TypeError, ValueError, CampaignError
        When it is no system, has no such source, or a simulation that the differences need fails.

    Examples
    --------
    >>> import mcnav as mc
    >>> P = mc.partials(lambda e: np.column_stack([e[:, 0] + 2.0 * e[:, 1], np.sin(e[:, 0])]), {"a": 0.1, "b": 1.0})
    >>> P.round(6)
          a    b
    y1  1.0  2.0
    y2  1.0  0.0
    >>> P.attrs["error"] < 1e-6
    True
    """
    known = as_errors(errors)
    sizes = np.maximum(known.model.standard_deviations, np.abs(known.model.mean))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    prepared = system_of(system, known.units, np.diag(sizes), outputs, known)
    places = [prepared.sources.index(name) for name in known.names]
    placed = np.zeros(len(prepared.sources))
    placed[places] = sizes
    try:
        with one_thread():
            linearized = prepared.linearize(placed)
    except (ScenarioError, SimulationFailed) as failure:
        raise ValueError(f"{failure}{remedy_for(system)}") from None
    if linearized.error > DOUBTFUL:
        warnings.warn(
            f"P is doubtful: its steps differ by {linearized.error:.1%} of the largest contribution of a sigma. The "
            "system has a kink or a jump about no errors, or is noisy",
            stacklevel=2,
        )
    names = [output.name for output in prepared.outputs]
    table = pd.DataFrame(linearized.model.partials[:, places], index=names, columns=known.names)
    table.attrs = {
        "error": linearized.error,
        "nominal": dict(zip(names, linearized.model.nominal.tolist(), strict=True)),
        "noise": {
            process: dict(zip(names, np.diag(covariance).tolist(), strict=True))
            for process, covariance in linearized.processes.items()
        },
        "units": {output.name: output.unit for output in prepared.outputs},
    }
    return table


def propagate_covariance(
    partials: pd.DataFrame | Array, covariance: pd.DataFrame | Array | Errors | Mapping[str, Any]
) -> pd.DataFrame | Array:
    """Propagate the covariance of the errors, P S P': TN D-1772, eq. (17).

    Parameters
    ----------
    partials : DataFrame or ndarray, shape (outputs, sources)
        P, SI unit of the output over that of the source.
    covariance : DataFrame, ndarray, shape (sources, sources), Errors or mapping of sizes
        S, SI. A frame is put into the order of the columns of P by its names.

    Returns
    -------
    DataFrame or ndarray, shape (outputs, outputs)
        Symmetric to the last bit, SI; a frame where P is one.

    Raises
    ------
    ValueError
        When both do not list the same sources, a value is not finite, or S is not a covariance.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.propagate_covariance(np.array([[1.0, 2.0]]), np.diag([9.0, 4.0]))
    array([[25.]])
    >>> P = pd.DataFrame([[1.0, 2.0]], index=["range"], columns=["altitude", "tilt"])
    >>> mc.propagate_covariance(P, mc.Errors({"tilt": 2.0, "altitude": 3.0}))
           range
    range   25.0
    """
    errors = as_errors(covariance) if isinstance(covariance, (Errors, Mapping)) else None
    known = covariance if errors is None else errors.covariance
    if isinstance(partials, pd.DataFrame) and isinstance(known, pd.DataFrame):
        if set(known.index) != set(known.columns) or set(known.columns) != set(partials.columns):
            raise ValueError(
                "partials and covariance, in this order, must list the same sources; got "
                f"{', '.join(map(str, partials.columns))} and {', '.join(map(str, known.columns))}, whose rows are "
                f"{', '.join(map(str, known.index))}"
            )
        known = known.loc[list(partials.columns), list(partials.columns)]
    first, second = _matrix(partials, "partials"), _matrix(known, "covariance")
    _check_covariance(second)
    result = propagated_covariance(first, second)
    if not isinstance(partials, pd.DataFrame):
        return result
    table = pd.DataFrame(result, index=partials.index, columns=partials.index)
    table.attrs["units"] = partials.attrs.get("units", {})
    if noise := [name for name, added in partials.attrs.get("noise", {}).items() if any(added.values())]:
        table.attrs[WITHOUT] = noise
    if errors is not None and "nominal" in partials.attrs:
        table.attrs[MEAN] = dict(_mean(partials, errors))
    return table


def _matrix(given: Any, name: str) -> Array:
    """Return a matrix; `ValueError` when it is none, or not finite."""
    try:
        matrix = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a frame or a matrix of numbers; got {type(given).__name__}") from None
    if matrix.ndim != 2 or not np.isfinite(matrix).all():
        raise ValueError(f"{name} must be finite, and a matrix; got shape {matrix.shape}")
    return matrix


def _check_covariance(matrix: Array) -> None:
    """Raise `ValueError` unless a matrix is symmetric and positive semidefinite, but for rounding."""
    scale = np.sqrt(np.abs(np.diag(matrix))) if matrix.shape[0] == matrix.shape[1] else np.ones(0)
    scale = np.outer(scale, scale)
    if not len(scale):
        return
    if np.any(np.abs(matrix - matrix.T) > ROUNDING * scale):
        raise ValueError("covariance must be symmetric")
    lowest = np.linalg.eigvalsh(matrix / np.where(scale > 0.0, scale, 1.0))[0]
    if lowest < -ROUNDING * len(matrix):
        raise ValueError(f"covariance must be positive semidefinite; its correlations have the eigenvalue {lowest:.3g}")


def _mean(partials: pd.DataFrame, errors: Errors) -> pd.Series:
    """Return the linear mean of the outputs: nominal + P mean."""
    return pd.Series(partials.attrs["nominal"]) + partials @ errors.mean[list(partials.columns)]
