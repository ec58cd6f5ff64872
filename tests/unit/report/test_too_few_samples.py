"""A run of too few samples for any verdict says how many it takes."""

from __future__ import annotations

import pytest

from mcnav.report.statements.details import explanation
from mcnav.sampler.designs import FEWEST_BLOCKS, SamplingDesign, fewest_samples
from tests.summaries import summary


def told(samples: int, design: str, failed: int = 0) -> str:
    unit = [[1.0]]
    return explanation(
        summary(
            samples=samples, failed=failed, design=design, verdict="undecided", verdicts=["undecided"],
            outputs=[{"name": "y", "unit": "m"}], sources=[{"name": "x", "unit": "m"}], partials=unit,
            start_mean=[0.0], start_covariance=unit, mean_linear=[0.0], mean_sample=[0.0], covariance_linear=unit,
            covariance_sample=unit, covariance_paired=unit, sigma_linear=[1.0], sigma_ratio_paired=[1.0],
            sigma_ratio_paired_interval=[[0.0, None]], samples_needed=[None],
        )
    )  # fmt: skip


@pytest.mark.parametrize(("design", "needed"), [("random", "100"), ("antithetic", "2,000"), ("sobol", "16")])
def test_the_number_that_would_do_is_computed(design: str, needed: str) -> None:
    assert told(10, design) == f"10 samples are too few for a verdict: run at least {needed}."
    count = fewest_samples(design)
    assert count // SamplingDesign.of(design, count).block_length >= FEWEST_BLOCKS[design]
    assert (count - 1) // SamplingDesign.of(design, count - 1).block_length < FEWEST_BLOCKS[design]


def test_of_samples_that_fail_it_takes_more() -> None:
    """Of 60 samples 12 failed, so that 125 leave 100."""
    assert told(60, "random", 12) == "48 samples are too few for a verdict: run at least 125."
