"""Why flown and linear variances differ, as a table and a sentence."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from mcnav.analysis.variance_breakdown import TERMS
from mcnav.report.format import signed, with_error
from mcnav.report.model import RunAnalysis

NAMES: Final = {
    "sampled_sigmas": "sampling: sigmas of the draws",
    "sampled_correlations": "sampling: correlations of the draws",
    "partials": "partials: differences, not variational",
    "second_order": "curvature, ½ tr(HSHS)",
    "third_order": "third derivatives",
    "rest": "what is left",
}


def causes(content: RunAnalysis) -> dict[str, Any] | None:
    """Rows of the table, in per cent of each output's linear variance; none where nothing was compared."""
    found = content.causes
    linear = np.diag(content.comparison.covariance_linear)
    if found is None or not (linear > 0.0).any():
        return None
    per_cent = np.divide(100.0, linear, out=np.full_like(linear, np.nan), where=linear > 0.0)
    shares = {name: [signed(value) for value in found.terms[name] * per_cent] for name in TERMS}
    rest = zip(found.terms["rest"] * per_cent, found.standard_error * per_cent, strict=True)
    shares["rest"] = [with_error(value, error, sign=True) for value, error in rest]
    return {
        "rows": [{"name": NAMES[name], "shares": shares[name]} for name in TERMS],
        "total": [signed(value) for value in found.total * per_cent],
        "paired": [signed(value) for value in found.paired * per_cent],
        "unscented": [signed(value) for value in found.unscented * per_cent],
        "sentence": _sentence(content, per_cent),
        "normal_only": not content.manifest.normal,
    }


def _sentence(content: RunAnalysis, per_cent: Any) -> str:
    """What explains the largest paired difference."""
    found = content.causes
    if found is None:
        return ""
    paired = np.nan_to_num(found.paired * per_cent)
    at = int(np.argmax(np.abs(paired)))
    name, size, error = content.output_names[at], paired[at], float(found.standard_error[at] * per_cent[at])
    predicted = float((found.terms["second_order"] + found.terms["third_order"])[at] * per_cent[at])
    rest = float(found.terms["rest"][at] * per_cent[at])
    if not np.isfinite(error) or not np.isfinite(predicted):
        return ""
    told = f"Freed of sampling error, the variance of {name} differs by {signed(size)} % (± {signed(error, 2)[1:]} %)"
    if abs(size) <= 2.0 * error:
        return f"{told}: no more than chance."
    if abs(rest) <= 2.0 * error:
        return f"{told}; second and third derivatives of the flight predict {signed(predicted)} %, which explains it."
    return (
        f"{told}; second and third derivatives predict {signed(predicted)} %. What is left is more than chance, and "
        "belongs to higher orders."
    )
