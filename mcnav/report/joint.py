"""The tests of all outputs together, as rows of the report's tables."""

from __future__ import annotations

import math
from typing import Any, Final

from mcnav.report.format import fixed, number, with_error
from mcnav.report.model import RunAnalysis
from mcnav.statistics.hypothesis_test import HypothesisTest

SMALLEST: Final = 1e-4
"""Probabilities below this are told as being below it."""


def probability(value: float) -> str:
    """A p-value.

    >>> probability(0.04321), probability(3e-9), probability(1e-4)
    ('0.043', '<0.0001', '0.0001')
    """
    if value < SMALLEST:
        return f"<{SMALLEST:.4f}"
    return f"{value:.2g}" if value < 0.995 else "1.0"


def _degrees(test: HypothesisTest) -> str:
    return ", ".join(f"{value:,.0f}" for value in test.degrees_of_freedom)


def _row(name: str, question: str, statistic: str, test: HypothesisTest | None) -> dict[str, str]:
    if test is None:
        return {"name": name, "question": question, "statistic": "–", "degrees": "", "p": "–"}
    shown = "∞" if math.isinf(test.statistic) else number(test.statistic)
    cell = f"{statistic} = {shown}"
    return {
        "name": name, "question": question, "statistic": cell, "degrees": _degrees(test), "p": probability(test.p_value)
    }  # fmt: skip


def _predicted(content: RunAnalysis, i: int) -> dict[str, str]:
    """Mean, skewness and excess kurtosis of an output in closed form, and its flown mean, where they are known."""
    higher, scale = content.higher_order, float(content.output_scale[i])
    if higher is None:
        return {}
    skewness, kurtosis = higher["skewness"][i], higher["kurtosis"][i]
    return {
        "mean": number(float(content.comparison.mean_sample[i]) * scale, 4),
        "predicted_mean": number(higher["mean"][i] * scale, 4),
        "predicted_skewness": "–" if skewness is None else fixed(skewness, 3),
        "predicted_kurtosis": "–" if kurtosis is None else fixed(kurtosis - 3.0, 3),
    }


def joint(content: RunAnalysis) -> dict[str, Any] | None:
    """Tests, ellipsoids, correlations and shapes; none when nothing has a dispersion."""
    found = content.comparison.joint
    if found is None:
        return None
    normality = found.normality
    names = content.output_names
    confidence = content.comparison.confidence_each
    ellipsoid = content.comparison.ellipsoid
    return {
        "tests": [
            _row("Covariance, paired", "Is cov(y) that of P·s?", "F", found.covariance_paired),
            _row("Covariance, likelihood ratio", "Is the sample's covariance P·S·Pᵀ?", "χ²", found.covariance),
            _row("Bias, paired T²", "Do flown and linear errors have the same mean?", "F", found.bias_paired),
            _row("Bias, Hotelling's T²", "Is the sample's mean the linear one?", "F", found.bias),
            _row("NEES, Kolmogorov-Smirnov", "Is NEES distributed as χ²?", "D", found.nees),
            _row("Mardia's skewness", "Are the outputs symmetric as normal ones?", "χ²",
                 normality.skewness_test if normality else None),
            _row("Mardia's kurtosis", "Are their tails those of normal ones?", "z",
                 normality.kurtosis_test if normality else None),
        ],
        "nees_expected": None
        if found.nees_expected is None
        else " to ".join(number(bound, 4) for bound in found.nees_expected),
        "only_random": found.covariance is None,
        "contained": [
            {
                "level": f"{100.0 * entry.level:g} %",
                "share": f"{100.0 * entry.share:.2f} %",
                "interval": f"{100.0 * entry.interval[0]:.2f} to {100.0 * entry.interval[1]:.2f} %",
            }
            for entry in found.contained
        ],
        "correlations": [
            {
                "name": " and ".join(names[i] for i in pair.between),
                "linear": fixed(pair.linear, 5),
                "paired": fixed(pair.paired, 5),
                "difference": with_error(pair.difference.value, pair.difference.reach(confidence), sign=True),
            }
            for pair in found.correlations
        ],
        "shapes": [
            {
                "name": names[i],
                "skewness": with_error(skewed.value, skewed.reach(confidence), sign=True),
                "kurtosis": with_error(tailed.value, tailed.reach(confidence), sign=True),
                **_predicted(content, i),
            }
            for i, (skewed, tailed) in enumerate(zip(found.skewness, found.excess_kurtosis, strict=True))
        ],
        "predicted": content.higher_order is not None,
        "directions": [
            {"ratio": number(float(ratio), 5), "weights": [fixed(float(weight), 3) for weight in weights]}
            for ratio, weights in zip(ellipsoid.direction_ratios, ellipsoid.directions, strict=True)
        ]
        if ellipsoid
        else [],
    }  # fmt: skip
