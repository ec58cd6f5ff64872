"""Running ratios: they end where the comparison is, at every size they are what a comparison of that part gives."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.comparison import Criterion, compare_reduced, reduce_stored
from mcnav.analysis.model import Model
from mcnav.analysis.running_ratios import convergence
from mcnav.sampler.designs import SamplingDesign

MODEL = Model(np.array([[1.0, 2.0], [0.0, 0.0]]), np.zeros(2), np.zeros(2), np.eye(2))


@pytest.mark.parametrize(("length", "fewest"), [(1, 100), (2, 100), (50, 16)])
def test_it_ends_at_the_comparison(length: int, fewest: int) -> None:
    count = 3_001
    errors = np.random.default_rng(4).standard_normal((count, 2))
    outcomes = errors @ MODEL.partials.T + 0.1 * errors**2
    outcomes[:, 1] = 0.0
    design = SamplingDesign(length, fewest)
    samples = reduce_stored(MODEL, errors, outcomes, design.blocks(np.arange(count)))
    comparison = compare_reduced(MODEL, samples, Criterion(), design)
    found = convergence(samples.moments, comparison, design)
    assert found is not None
    assert found.sizes[-1] == count
    assert found.sizes[0] >= fewest
    assert np.all(np.diff(found.sizes) > 0)
    assert len(found.sizes) <= 40
    for run, judged in ((found.plain, comparison.outputs[0].plain), (found.paired, comparison.outputs[0].paired)):
        assert run.ratio[-1, 0] == pytest.approx(judged.ratio, rel=1e-9)
        assert judged.interval is not None
        assert (run.low[-1, 0], run.high[-1, 0]) == pytest.approx(judged.interval, rel=1e-9)
        assert np.isnan(run.ratio[:, 1]).all()
        assert np.all(run.low[:, 0] <= run.ratio[:, 0])


def test_too_little_to_show() -> None:
    errors = np.random.default_rng(4).standard_normal((150, 2))
    outcomes = errors @ MODEL.partials.T
    for count, fewest in ((150, 100.0), (150, np.inf), (1, 1.0)):
        design = SamplingDesign(1, fewest)
        samples = reduce_stored(MODEL, errors[:count], outcomes[:count], np.arange(count))
        comparison = compare_reduced(MODEL, samples, Criterion(), design)
        assert convergence(samples.moments, comparison, design) is None
