"""Errors throughout the flight: moments that add up to the same bits, and what they must agree with."""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest

from mcnav.contract.engine import has_histories
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.run import run_campaign
from tests.conftest import SIZES, campaign, reentry
from tests.runs import simulate

OUTPUTS = ("altitude [m]", "range [m]", "altitude_rate [m/s]", "range_rate [m/s]")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same two chunks by one worker, and by two after the first chunk was lost."""
    one, two = (tmp_path_factory.mktemp("epochs") / name for name in ("one", "two"))
    run_campaign(campaign(4, samples=9_000), one, "ensemble", 1)
    with patch("mcnav.report.pages.run.page.render", return_value=""):
        run_campaign(campaign(4, samples=9_000), two, "ensemble", 2)
        (two / "samples" / "part-00000.parquet").unlink()
        (two / "epochs.parquet").unlink()
        run_campaign(campaign(4, samples=9_000), two, "ensemble", 2)
    return one, two


def test_bits_do_not_depend_on_jobs_or_on_breaks(runs: tuple[Path, Path]) -> None:
    for name in ("epochs.parquet", "histories.parquet"):
        assert (runs[0] / name).read_bytes() == (runs[1] / name).read_bytes()


def test_the_last_epoch_holds_the_final_errors(runs: tuple[Path, Path]) -> None:
    """Mean, sigma and the higher moments of all samples; histories were flown on other nodes: 1e-5 of sigma."""
    flown = pd.read_parquet(runs[0] / "samples")
    known = pd.read_parquet(runs[0] / "epochs.parquet").iloc[-1]
    for output in OUTPUTS:
        name, _, unit = output.partition(" ")
        values = flown[f"output {output}"].to_numpy()
        sigma = values.std(ddof=1)
        assert known[f"mean {output}"] == pytest.approx(values.mean(), abs=1e-5 * sigma)
        assert known[f"sigma {output}"] == pytest.approx(sigma, rel=1e-5)
        for power, key in ((3, "third"), (4, "fourth")):
            moment = np.mean((values - values.mean()) ** power)
            assert known[f"{key} {name} [({unit.strip('[]')})^{power}]"] == pytest.approx(
                moment, abs=1e-4 * sigma**power
            )


def test_linear_sigmas_end_in_those_of_the_variational_path(runs: tuple[Path, Path]) -> None:
    """Central differences of histories against the equations of variation, 1e-5 of sigma."""
    summary, known = RunFolder(runs[0]).summary(), pd.read_parquet(runs[0] / "epochs.parquet")
    ends = [known[f"linear sigma {output}"].iloc[-1] for output in OUTPUTS]
    np.testing.assert_allclose(ends, summary["sigma_linear"], rtol=1e-5)


def test_stored_histories(runs: tuple[Path, Path]) -> None:
    """The first two thousand samples at sixty epochs; percentiles are theirs."""
    stored, known = (pd.read_parquet(runs[0] / name) for name in ("histories.parquet", "epochs.parquet"))
    assert len(known) == 60
    assert len(stored) == 2_000 * 60
    values = stored["range [m]"].to_numpy().reshape(2_000, 60)
    np.testing.assert_allclose(known["percentile 99 range [m]"], np.percentile(values, 99.0, axis=0), rtol=1e-12)
    final = pd.read_parquet(runs[0] / "samples")["output range [m]"].to_numpy()
    assert np.abs(values[:, -1] - final[:2_000]).max() < 1e-5 * final.std()


def test_the_report_shows_envelopes(runs: tuple[Path, Path]) -> None:
    page = (runs[0] / "report.html").read_text()
    assert 'id="throughout"' in page
    assert re.search(r"1 % to 99 % of 2,000 samples", page)


def test_a_map_has_those_of_the_flights_it_was_fitted_to(tmp_path: Path) -> None:
    simulate(campaign(1, samples=3_000), tmp_path / "run", "map", 1)
    _, described = RunFolder(tmp_path / "run").epochs() or ({}, {})
    assert described["samples"] == described["stored"] == 2_000


def test_samples_that_leave_the_kernel_are_left_out() -> None:
    """Their histories are NaN, the sums are those of the others."""
    errors = np.zeros((3, len(SIZES)))
    errors[1, 0] = 1e9
    engine = reentry(4).engine("ensemble", np.zeros((2, len(SIZES))))
    assert has_histories(engine)
    histories = engine.histories(errors)
    assert np.isnan(histories[1]).all()
    assert np.isfinite(histories[[0, 2]]).all()
    assert engine.history_sums(errors).count == 2
