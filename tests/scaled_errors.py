"""Error models whose constant errors are multiplied."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcnav.sampler.distributions import Distribution, Fixed, Normal
from mcnav.sampler.error_model import Correlation, ErrorModel


def scaled_errors(errors: ErrorModel, factor: float) -> ErrorModel:
    """Multiply the sizes of normal and fixed sources; correlations stay as they are."""

    def scaled(distribution: Distribution) -> Distribution:
        if isinstance(distribution, Fixed):
            return Fixed(factor * distribution.mean)
        assert isinstance(distribution, Normal)
        return replace(distribution, sigma=factor * distribution.sigma)

    sizes = {name: scaled(own) for name, own in zip(errors.names, errors.distributions, strict=True)}
    spread = errors.standard_deviations
    coefficients = errors.covariance / np.outer(*[np.where(spread > 0.0, spread, 1.0)] * 2)
    return ErrorModel(
        errors.names, sizes,
        [
            Correlation((errors.names[i], errors.names[j]), float(coefficients[i, j]))
            for i in range(len(errors.names)) for j in range(i) if coefficients[i, j] != 0.0
        ],
    )  # fmt: skip
