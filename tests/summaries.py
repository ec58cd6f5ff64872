"""Summaries with the keys that a test is about."""

from __future__ import annotations

from typing import Any, Final

from mcnav.analysis.summary import Summary

SMALLEST: Final[dict[str, Any]] = {
    "campaign": "some", "verdict": "agrees", "samples": 100, "failed": 0, "engine": "ensemble", "seed": 1,
    "design": "random", "tolerance": 0.05, "confidence": 0.95, "sources": [], "outputs": [], "partials": [],
    "start_mean": [], "start_covariance": [], "mean_linear": [], "mean_sample": [], "covariance_linear": [],
    "covariance_sample": [], "covariance_paired": [], "sigma_linear": [],
    "budget": {"shares": [], "cross_terms": [], "contributions": [], "saved": []},
}  # fmt: skip
"""All that a summary must have."""


def summary(**keys: Any) -> Summary:
    """Return a summary with some keys, the others as small as they may be."""
    return Summary.of(SMALLEST | keys)


def requirement(finding: str, **keys: Any) -> dict[str, Any]:
    """Return an entry of ``requirements``, of the CEP of two outputs."""
    return {
        "kind": "cep", "outputs": ["x", "y"], "limits": [1.0], "probability": 0.5, "finding": finding, "estimate": 1.0,
        "interval": [0.9, 1.1], "linear": 1.0, "linear_meets": True, "samples_needed": None, "largest_sigmas": None,
    } | keys  # fmt: skip
