"""What is identified from simulated records of the catalogue's grades: rates, within binomial bounds of 1e-4."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.stats import binom

from mcnav.identification.choice import PENALTY
from mcnav.identification.identify import identify_noise
from tests.calibration.identification_trials import (
    ABSENT,
    DISTURBANCES,
    FIT,
    GRADES,
    INSTRUMENTS,
    INTERVAL,
    _noticed,
    run_identification_trials,
    simulate,
    truth,
)
from tests.calibration.slow_trials import FALSE, run_slow_trials
from tests.calibration.static_records import TrueNoise, simulate_record
from tests.calibration.table import rates

FALSE_ALARM = 1e-4
TRIALS = 1


@pytest.mark.slow
def test_rates_of_the_grades_are_as_stated() -> None:
    """Coverage 95 %, false alarms of the test of fit 5 % and of quantization 2.3 %, over all grades."""
    counted, hits, made = run_identification_trials(TRIALS, 1), Counter[str](), Counter[str]()
    for cell, number in counted.made.items():
        name = cell.kind if cell.kind == "coverage" else cell.statement
        hits[name] += counted.hits[cell]
        made[name] += number
    assert made[FIT] == TRIALS * len(GRADES) * len(INSTRUMENTS)
    assert hits["coverage"] >= binom.ppf(FALSE_ALARM, made["coverage"], 0.95)
    assert hits[FIT] <= binom.ppf(1.0 - FALSE_ALARM, made[FIT], 0.05)
    assert hits[ABSENT] <= binom.ppf(1.0 - FALSE_ALARM, made[ABSENT], 0.5 * float(np.exp(-0.5 * PENALTY)))
    assert set(rates(counted)["finding"]) <= {"", "as stated", "safe"}


def test_what_is_said_of_slow_processes_is_right() -> None:
    """One record of each case: coverage as a binomial of 95 % has it, and few certain processes that are not there."""
    counted, hits, made = run_slow_trials(1, 1), Counter[str](), Counter[str]()
    for cell, number in counted.made.items():
        name = cell.kind if cell.kind == "coverage" else cell.statement
        hits[name] += counted.hits[cell]
        made[name] += number
    assert made["coverage"] > 15
    assert hits["coverage"] >= binom.ppf(FALSE_ALARM, made["coverage"], 0.95)
    assert hits[FALSE] <= 2


@pytest.mark.parametrize("name", DISTURBANCES)
def test_what_no_grade_has_is_noticed(name: str) -> None:
    true, bias = truth("tactical", "gyro")
    disturbed = DISTURBANCES[name](simulate("tactical", "gyro", 0), true, bias)
    assert _noticed(name, identify_noise(disturbed, INTERVAL))


def test_simulated_records_have_the_stated_variances() -> None:
    """Of the first reading, and of the sum of two, over 20,000 records: within 4.5 standard errors."""
    rng, trials = np.random.default_rng(1), 20_000
    true, interval = TrueNoise(1.0, 2.0, 1.5, 0.7, 0.3), 0.5
    readings = np.array([simulate_record(rng, 2, interval, true) for _ in range(trials)])
    a = interval / 1.5
    markov = 4.0 * 2.0 * (a - 1.0 + np.exp(-a)) / a**2
    first = 1.0 / interval + markov + 0.49 * interval / 3.0 + 2.0 * 0.09 / interval**2
    # the mean of two is that over twice the interval; quantization telescopes
    twice = 2.0 * a
    both = 1.0 / (2.0 * interval) + 8.0 * (twice - 1.0 + np.exp(-twice)) / twice**2
    both += 0.49 * 2.0 * interval / 3.0 + 2.0 * 0.09 / (2.0 * interval) ** 2
    error = 4.5 * np.sqrt(2.0 / trials)
    assert readings[:, 0].var() == pytest.approx(first, rel=error)
    assert readings.mean(axis=1).var() == pytest.approx(both, rel=error)
