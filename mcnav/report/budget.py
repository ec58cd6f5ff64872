"""The error budget by two routes, a table for each output."""

from __future__ import annotations

from typing import Any

import numpy as np

from mcnav.report.format import share
from mcnav.report.model import RunAnalysis
from mcnav.statistics.estimates import Estimate


def two_routes(content: RunAnalysis) -> dict[str, Any] | None:
    """Linear and flown shares of each source; none where no flights were made for it."""
    flown = content.manifest.model.budget
    if not flown or not content.dispersed:
        return None
    alone, sobol = flown["alone"], flown["sobol"]
    if "failed" in alone:
        return {"failed": alone["failed"], "tables": []}
    variances = np.diag(content.comparison.covariance_linear)
    active = np.flatnonzero(np.diag(content.model.covariance) > 0.0)
    return {
        "failed": None,
        "samples": alone["samples"],
        "no_sobol": sobol.get("failed"),
        "interactions": bool("failed" not in sobol and _interacts(sobol)),
        "tables": [
            {
                "name": content.output_names[i],
                "rows": [_row(content, i, int(j), float(variances[i]), alone, sobol) for j in active],
            }
            for i in map(int, np.flatnonzero(variances > 0.0))
        ],
    }


def _interacts(sobol: dict[str, Any]) -> bool:
    """Whether some total index is certainly larger than the first-order one by more than a hundredth."""
    excess = np.array(sobol["total"], dtype=float) - np.array(sobol["first_order"], dtype=float)
    error = np.hypot(
        np.array(sobol["total_standard_error"], dtype=float), np.array(sobol["first_order_standard_error"], dtype=float)
    )
    return bool(np.any(excess > 0.01 + 4.0 * error))


def _row(
    content: RunAnalysis, i: int, j: int, variance: float, alone: dict[str, Any], sobol: dict[str, Any]
) -> dict[str, str]:
    confidence = content.criterion.confidence

    def flown(key: str) -> str:
        error = alone[key]["standard_error"][i][j]
        found = Estimate(
            alone[key]["variance"][i][j] / variance,
            float("inf") if error is None else error / variance,
            alone["degrees_of_freedom"],
        )
        return f"{share(found.value)} ± {share(found.half_width(confidence))}"

    def index(key: str) -> str:
        if "failed" in sobol or sobol[key][i][j] is None:
            return "–"
        found = Estimate(sobol[key][i][j], sobol[f"{key}_standard_error"][i][j], sobol["replicates"] - 1.0)
        return f"{share(found.value)} ± {share(found.half_width(confidence))}"

    return {
        "name": content.source_names[j],
        "alone": share(float(content.budget.shares[i, j])),
        "alone_flown": flown("alone"),
        "without": share(1.0 - float(content.budget.saved[i, j])),
        "without_flown": flown("without"),
        "first_order": index("first_order"),
        "total": index("total"),
    }
