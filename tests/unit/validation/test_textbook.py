"""Published numbers and the judgement of their agreement; closed forms in their limits."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.validation.reproduce.textbook import closed_forms
from mcnav.validation.reproduce.textbook.numbers import Agreement, Number


def number(
    printed: str, linear: float, simulated: float | None = None, interval: tuple[float, float] | None = None
) -> Number:
    return Number("chapter", "quantity", "m", "closed", printed, "x", linear, simulated, interval)


@pytest.mark.parametrize(
    ("printed", "linear", "expected"),
    [
        ("84.4", 84.3501, Agreement.AGREES),
        ("84.4", 84.3499, Agreement.DIFFERS),
        ("28", 27.51, Agreement.AGREES),
        ("-0.0024", -0.00244, Agreement.AGREES),
        ("-0.0024", 0.0024, Agreement.DIFFERS),
        ("1.75e-3", 1.7549e-3, Agreement.AGREES),
        ("1.75e-3", 1.7551e-3, Agreement.DIFFERS),
    ],
)
def test_the_linear_number_must_have_the_digits(printed: str, linear: float, expected: Agreement) -> None:
    assert number(printed, linear).agreement is expected


def test_single_simulations_must_have_the_digits_as_well() -> None:
    assert number("84.4", 84.4, 84.41).agreement is Agreement.AGREES
    assert number("84.4", 84.4, 84.5).agreement is Agreement.DIFFERS


def test_an_interval_must_contain_the_size_of_the_number() -> None:
    """Half a digit of the printed number included; a sigma has no sign."""
    assert number("-2.0", -2.0, 2.2, (1.9, 2.5)).agreement is Agreement.AGREES
    assert number("2.0", 2.0, 2.2, (2.049, 2.5)).agreement is Agreement.AGREES
    assert number("2.0", 2.0, 2.2, (2.051, 2.5)).agreement is Agreement.DIFFERS
    assert number("2.0", 2.0, 1.8, (1.6, 1.949)).agreement is Agreement.DIFFERS


@pytest.mark.parametrize("source", ["bias", "tilt", "velocity", "drift"])
def test_a_channel_begins_as_the_flat_earth_has_it(source: str) -> None:
    """The first neglected term is at most (w t)^2 / 6."""
    rate, time, gravity = 1.24e-3, 10.0, 9.8
    flat = closed_forms.growth(source, 2.0, gravity, time)
    assert closed_forms.channel(source, 2.0, gravity, rate, time) == pytest.approx(flat, rel=(rate * time) ** 2 / 6.0)


def test_after_a_schuler_period_a_gyro_alone_has_left_an_error() -> None:
    """To rounding: R times its angle, and nothing of the others."""
    gravity, radius = 9.8, 6.4e6
    rate = closed_forms.schuler_rate(gravity, radius)
    period = 2.0 * np.pi / rate
    assert closed_forms.channel("drift", 1e-8, gravity, rate, period) == pytest.approx(
        radius * 1e-8 * period, rel=1e-12
    )
    for source, half in (("bias", 2.0 / rate**2), ("tilt", 2.0 * radius)):
        assert closed_forms.channel(source, 1.0, gravity, rate, period) == pytest.approx(0.0, abs=1e-12 * half)
        assert closed_forms.channel(source, 1.0, gravity, rate, 0.5 * period) == pytest.approx(half, rel=1e-12)


@pytest.mark.parametrize("integrations", [1, 2, 3, 4])
def test_integrated_walks_are_the_sum_of_their_impulses(integrations: int) -> None:
    """The variance is the integral of the squared response (t - s)^(n-1) / (n-1)!, here by Gauss's rule, exactly."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    time = 7.0
    since = 0.5 * time * (nodes + 1.0)
    response = since ** (integrations - 1) / np.prod(np.arange(1.0, integrations))
    expected = 3.0 * np.sqrt(0.5 * time * weights @ response**2)
    assert closed_forms.integrated_walk(3.0, integrations, time) == pytest.approx(expected, rel=1e-12)


def test_an_integrated_markov_process_between_its_limits() -> None:
    """A constant at first, white noise of density sigma sqrt(2 tau) at last: the neglected terms are x/3 and 1/x."""
    assert closed_forms.integrated_markov(2.0, 100.0, 0.1) == pytest.approx(0.2, rel=1e-3 / 3.0)
    late = 2.0 * np.sqrt(2.0 * 100.0 * 1e5)
    assert closed_forms.integrated_markov(2.0, 100.0, 1e5) == pytest.approx(late, rel=1e-3)


def test_repeated_fixes_without_knowledge_are_their_mean() -> None:
    assert closed_forms.repeated_fixes(1e9, 5.0, 25) == pytest.approx(1.0, rel=1e-12)


def test_the_plane_of_a_pendulum_at_the_pole_turns_with_the_day() -> None:
    assert closed_forms.foucault_period(2.0 * np.pi / 86_164.0, 0.5 * np.pi) == pytest.approx(86_164.0, rel=1e-12)
