"""Moments over time from the table of epochs, and intervals of sigmas."""

from __future__ import annotations

import io

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from mcnav.analysis.envelopes import Envelopes, envelopes_from
from mcnav.analysis.filter_evidence import independent_share
from mcnav.arrays.types import Array
from mcnav.contract.history import Epochs
from mcnav.contract.quantities import Output
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.sampler.designs import SamplingDesign
from mcnav.store.histories import epochs_table

OUTPUTS = (Output("x", "m", "km"), Output("y", "rad", "mrad"))
CONFIDENCE = 0.95


def envelopes(histories: Array) -> Envelopes:
    """Write and read the table of histories, shape (n, m, 2)."""
    count, instants, outputs = histories.shape
    epochs = Epochs("time [s]", np.arange(float(instants)), {})
    linear = np.zeros((instants, outputs)), np.tile(np.eye(outputs), (instants, 1, 1))
    table = pq.read_table(
        io.BytesIO(epochs_table(epochs, OUTPUTS, sum_powers_about_zero(histories), linear, histories))
    )
    described = {"events": {}, "samples": count, "stored": count}
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    return envelopes_from(columns, described, [{"name": each.name, "unit": each.unit} for each in OUTPUTS])


def test_the_table_holds_all_second_moments() -> None:
    """To the rounding of sums of 500 terms, 500 times 1e-16."""
    histories = np.random.default_rng(1).standard_normal((500, 3, 2)) @ np.array([[1.0, 0.5], [0.0, 2.0]])
    found = envelopes(histories)
    for epoch in range(3):
        np.testing.assert_allclose(found.covariance[epoch], np.cov(histories[:, epoch].T), rtol=5e-14)
    centred = histories - histories.mean(axis=0)
    np.testing.assert_allclose(found.fourth, (centred**4).mean(axis=0), rtol=5e-13)


def test_intervals_of_sigmas_are_those_of_chi_square() -> None:
    """Errors of two values vary less than normal ones: then the interval is that of a normal variance."""
    signs = np.where(np.arange(200) % 2, 1.0, -1.0)[:, None, None] * np.array([3.0, 0.5])
    found = envelopes(np.broadcast_to(signs, (200, 4, 2)))
    for share, freedom in ((1.0, 199.0), (0.5, 99.0)):
        low, high = stats.chi2.ppf([0.5 + 0.5 * CONFIDENCE, 0.5 - 0.5 * CONFIDENCE], freedom)
        expected = found.sigma[:, :, None] * np.sqrt(freedom / np.array([low, high]))
        np.testing.assert_allclose(found.sigma_intervals(share, CONFIDENCE), expected, rtol=1e-12)


def test_heavy_tails_widen_the_interval() -> None:
    errors = stats.t(5).rvs((400, 2, 2), random_state=2)
    low, high = np.moveaxis(envelopes(errors).sigma_intervals(1.0, CONFIDENCE), 2, 0)
    normal = stats.chi2.ppf([0.975, 0.025], 399.0)
    assert ((high / low) > np.sqrt(normal[0] / normal[1])).all()


@pytest.mark.parametrize(
    ("design", "share"), [("random", 1.0), ("antithetic", 0.5), ("latin-hypercube", 15.0 / 16.0), ("sobol", 0.0)]
)
def test_samples_that_depend_on_each_other_count_for_less(design: str, share: float) -> None:
    sampling = SamplingDesign.of(design, 256)
    assert independent_share(design, sampling) == share
    assert independent_share(design, SamplingDesign.of(design, 256, heavy_tailed=True)) == 0.0


def test_without_independent_samples_there_is_no_interval() -> None:
    found = envelopes(np.random.default_rng(3).standard_normal((256, 2, 2)))
    intervals = found.sigma_intervals(0.0, CONFIDENCE)
    assert (intervals[:, :, 0] == 0.0).all()
    assert np.isinf(intervals[:, :, 1]).all()
