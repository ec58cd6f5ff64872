"""Unscented transform (filterpy): a covariance from a few samples."""

from __future__ import annotations

import builtins
from functools import cache
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from mcnav._types import Array
from mcnav.linear.higher_order import principal_directions
from mcnav.linear.partials import Propagate, SimulationFailed, simulate_or_raise


def _import(name: str, *options: Any) -> Any:
    return SimpleNamespace(pretty_str=str) if name == "filterpy.common" else __import__(name, *options)


@cache
def _filterpy(name: str) -> Any:
    """Load a module of ``filterpy.kalman`` without the package, whose filters import `scipy.stats` (half a second).

    The one name that it takes from the rest of the package formats its ``repr``.
    """
    package = find_spec("filterpy")
    assert package is not None
    assert package.origin is not None
    spec = spec_from_file_location(f"{__name__}.{name}", Path(package.origin).parent / "kalman" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    vars(module)["__builtins__"] = vars(builtins) | {"__import__": _import}
    spec.loader.exec_module(module)
    return module


def unscented_covariance(propagate: Propagate, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Compute mean and covariance of the final errors by the scaled unscented transform.

    Sigma points at ``sqrt(n)`` standard deviations (alpha 1, beta 2, kappa 0) over the sources that have a dispersion,
    in units of their standard deviations. The mean is right to second order. The covariance is exact for a linear
    system; quadratic terms enter with up to n/2 times their share, a conservative error. Means have shape (sources,)
    and (outputs,), covariances (sources, sources) and (outputs, outputs), SI. Raises `SimulationFailed` when a sigma
    point fails.
    """
    directions = principal_directions(covariance)  # of the range: sigma points need a definite matrix
    rank = directions.shape[1]
    if rank == 0:
        value = simulate_or_raise(propagate, mean[None, :])[0]
        return value, np.zeros((len(value), len(value)))
    points = _filterpy("sigma_points").MerweScaledSigmaPoints(rank, alpha=1.0, beta=2.0, kappa=0.0)
    errors = mean + points.sigma_points(np.zeros(rank), np.eye(rank)) @ directions.T
    try:
        unscented_transform = _filterpy("unscented_transform").unscented_transform(
            simulate_or_raise(propagate, errors), points.Wm, points.Wc
        )
    except np.linalg.LinAlgError as failure:
        raise SimulationFailed(f"the sigma points have no covariance: {failure}") from None
    return np.asarray(unscented_transform[0]), np.asarray(unscented_transform[1])
