"""Sums over the numbers of a data sheet against the linear covariance of the campaign with these numbers changed.

The two add the same terms in another order, in double precision: 1e-9 of a sigma. The derivatives of a loop are
differences whose steps follow the sizes; of a linear one they are good to 1e-8.
"""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

from mcnav.analysis.improvements import improvements, largest_shares, shares_used
from mcnav.analysis.what_if import WhatIf
from mcnav.config.documents import document_of
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.studies.linear_answers import answer_linearly
from mcnav.workflow.what_if import what_if_of_answer
from tests.conftest import ROOT, campaign

CAMPAIGNS = ROOT / "campaigns"

AIDED = {
    "scenario": {"type": "ins", "start": "300 s", "end": "600 s", "trajectory": "flight.csv"},
    "imu": {"grade": "tactical", "gyro": {"scale_factor": ["3000 ppm", "2000 ppm", "1000 ppm"]}},
    "errors": {
        "position": "10 m", "velocity": "0.1 m/s", "tilt": "0.5 mrad", "heading": "3 mrad",
        "gnss_position_bias_north": {"distribution": "uniform", "half_width": "2 m"},
    },
    "correlations": [{"between": ["position_north", "velocity_north"], "coefficient": -0.6}],
    "aiding": [
        {"type": "gnss", "interval": "5 s", "position": "3 m", "lever_arm": ["1 m", "0 m", "-1 m"],
         "lever_arm_error": "5 cm", "position_correlated": {"sigma": "2 m", "correlation_time": "60 s"},
         "delay": "20 ms", "jitter": "5 ms"},
        {"type": "altimeter", "name": "radio", "interval": "30 s", "altitude": "5 m", "bias": "10 m"},
    ],
    "filter": {
        "estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias", "radio_bias"],
        "considers": ["gnss_lever_arm"],
        "believes": {
            "imu": {"gyro": {"bias": {"x": "2 deg/h"}}},
            "errors": {"heading": "4 mrad", "accelerometer_bias_y": "2 mg"},
            "aiding": {"radio": {"altitude": "6 m"}},
        },
    },
    "accept": {"r95": [{"outputs": ["position_north", "position_east"], "below": "20 m", "after": "400 s"}]},
}  # fmt: skip
"""Correlated errors, sizes by axis, a distribution, and beliefs of some axes, with which a filter neglects others."""


def changed(content: dict[str, Any], file: str, seed: int) -> tuple[WhatIf, list[float], Any]:
    """Return what a page would have, factors of the numbers, and the linear answer to the file with these."""
    answer = answer_linearly(parse_campaign(content, file, "what if"))
    found = what_if_of_answer(answer, content, "beside it")
    assert found is not None
    rng = np.random.default_rng(seed)
    count = len(found.campaign.sliders)
    factors = np.where(rng.random(count) < 0.7, 10.0 ** rng.uniform(-1, 1, count), 1.0).round(3).tolist()
    text = found.campaign.written(factors)
    return found, factors, answer_linearly(parse_campaign(tomllib.loads(text), file, "what if"))


def differences(found: WhatIf, factors: list[float], answer: Any) -> tuple[float, float]:
    """Return the largest differences of sigmas over time, relative, and of the filter's own."""
    history, sigma = answer.history, found.covariance.sigma(factors)
    expected = np.concatenate([history.sigma, answer.sigma[None]])
    size = np.maximum(expected, 1e-6 * expected.max(axis=0))
    own = 0.0
    if found.covariance.own is not None:
        own = float(np.nanmax(np.abs(found.covariance.own[:-1] / history.sigma_filter - 1.0)))
    mean = np.concatenate([history.mean, answer.mean[None]])
    assert np.abs(found.covariance.mean(factors) - mean).max() <= 1e-12 * (np.abs(mean).max() + 1.0)
    return float((np.abs(sigma - expected) / np.where(size > 0.0, size, 1.0)).max()), own


def test_sum_with_a_filter_whose_gains_are_held() -> None:
    """The file states what the filter believes, so that its own covariance stays as it is."""
    found, factors, answer = changed(AIDED, str(CAMPAIGNS / "aided.toml"), 3)
    assert min(factors) < 1.0 < max(factors)
    assert {slider.path for slider in found.campaign.sliders} >= {
        "imu.gyro.bias", "imu.gyro.scale_factor", "errors.position", "errors.gnss_position_bias_north",
        "aiding.gnss.position", "aiding.gnss.position_correlated", "aiding.gnss.lever_arm_error", "aiding.radio.bias",
        "aiding.gnss.delay", "aiding.gnss.jitter",
    }  # fmt: skip
    assert not found.unsized
    sigma, own = differences(found, factors, answer)
    assert sigma < 1e-9
    assert own < 1e-9
    (limited,) = found.requirements
    (judged,) = answer.requirements
    assert len(limited.readings) > 5
    assert judged.time in found.covariance.times[list(limited.readings)]
    shares = largest_shares(found.covariance, found.requirements, [factors])
    assert shares == pytest.approx([judged.value / 20.0], rel=1e-7)


def test_each_number_a_grade_finer() -> None:
    """By hand: sigmas and share of the limit with one number changed; the best first."""
    answer = answer_linearly(parse_campaign(AIDED, str(CAMPAIGNS / "aided.toml"), "what if"))
    found = what_if_of_answer(answer, AIDED, "beside it")
    assert found is not None
    listed = improvements(found)
    paths = [each.path for each in found.campaign.sliders]
    by_path = {each.slider.path: each for each in listed}
    assert (by_path["imu.gyro.bias"].grade, by_path["aiding.gnss.position"].grade) == ("navigation", "")
    assert by_path["aiding.gnss.position"].factor == 0.5
    ones = [1.0] * len(paths)
    before = shares_used(found, [ones])
    assert before == largest_shares(found.covariance, found.requirements, [ones])
    for path in ("imu.gyro.bias", "aiding.gnss.position"):
        each, factors = by_path[path], [*ones]
        factors[paths.index(path)] = each.factor
        sigma = found.covariance.sigma(factors)[-1] / found.covariance.sigma(ones)[-1]
        np.testing.assert_allclose(each.sigmas, sigma, rtol=1e-12)
        assert largest_shares(found.covariance, found.requirements, [factors]) == pytest.approx([each.used], rel=1e-12)
    assert [each.used for each in listed] == sorted(each.used or 0.0 for each in listed)
    assert before is not None
    assert (listed[0].used or 1.0) < before[0]


def test_file_without_changes_states_no_further_beliefs() -> None:
    """But those of all axes, where the campaign's own are of some."""
    found, factors, _ = changed(AIDED, str(CAMPAIGNS / "aided.toml"), 3)
    text = found.campaign.written([1.0] * len(factors))
    believed = tomllib.loads(text)["filter"]["believes"]
    assert believed["imu"]["gyro"]["bias"] == {"x": "2 deg/h", "y": "1 deg/h", "z": "1 deg/h"}
    assert set(believed["imu"]) == {"gyro"}
    assert believed["errors"] == AIDED["filter"]["believes"]["errors"]  # type: ignore[index]


@pytest.mark.parametrize("number", ["08_every_option", "11_cruise", "16_flight_tactical_grade"])
def test_sum_without_a_filter(number: str) -> None:
    """With correlated sources, distributions, a mean, and processes of noise."""
    path = CAMPAIGNS / f"{number}.toml"
    document = document_of(read_campaign(path))
    content, file = document.content, document.file
    found, factors, answer = changed(content, file, 5)
    assert differences(found, factors, answer)[0] < 1e-9


def test_sum_of_a_closed_loop() -> None:
    """A loop's filter, whose beliefs of processes and measurements are stated."""
    document = document_of(CAMPAIGNS / "29_orbit_correction.toml")
    content, file = document.content, document.file
    found, factors, answer = changed(content, file, 7)
    sigma, own = differences(found, factors, answer)
    assert sigma < 1e-8
    assert own < 1e-8


def test_causes_that_no_number_sizes() -> None:
    """Columns of a table have no size."""
    rows = campaign(1, errors={"altitude": "1 km", "range": "2 km"})
    answer = answer_linearly(rows)
    found = what_if_of_answer(answer, {"scenario": {"type": "reentry"}, "errors": {"altitude": "1 km"}}, "")
    assert found is not None
    assert found.unsized == ("range",)
