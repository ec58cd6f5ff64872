"""Causes of the errors that a requirement limits, at the instant at which it is judged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mcnav.analysis.causes import Cause, causes_of
from mcnav.analysis.requirements import Requirement
from mcnav.arrays.types import Array


def causes_of_requirement(
    requirement: Requirement, variances: Mapping[str, Array], means: Mapping[str, Array], covariance: Array, mean: Array
) -> tuple[Cause, ...]:
    """List the causes of the errors that a requirement limits, at one instant.

    They are shares in the sum of the outputs' mean squares; of a box each output counts in multiples of its limit. A
    sigma ratio has none.

    Parameters
    ----------
    variances, means : mapping of str to ndarray, shape (outputs,)
        As in `causes_of`.
    covariance, mean : ndarray, shapes (outputs, outputs), (outputs,)
        Of all causes together.
    """
    if requirement.kind == "sigma_ratio":
        return ()
    picked = np.array(requirement.outputs)
    units = np.array(requirement.limits) if requirement.kind == "box" else np.ones(len(picked))
    total = float(np.sum((np.diag(covariance)[picked] + mean[picked] ** 2) / units**2))
    return causes_of(
        {name: values[picked] / units**2 for name, values in variances.items()},
        {name: values[picked] / units for name, values in means.items()},
        total,
    )
