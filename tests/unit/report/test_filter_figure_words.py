"""What figures of a filter show, in sentences that claim what the numbers do: an outage from 20 to 25 min."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import FilterConsistency, Finding, Honesty
from mcnav.report.figures import filter_captions as words
from tests.filters import consistency


def departing(found: FilterConsistency, *begins: int) -> FilterConsistency:
    """Return the filter with findings of certain departures of its first outputs at some epochs."""
    certain = [
        replace(each, finding=Finding(Honesty.OPTIMISTIC, 3.0, (2.0, 4.0), begin + 1, begin, begin + 4))
        for begin, each in zip(begins, found.outputs, strict=False)
    ]
    return replace(found, outputs=(*certain, *found.outputs[len(begins) :]))


def test_ratios_are_within_the_band_leave_it_or_are_certain_to() -> None:
    """The factor of the test's filter is 3.3 in the outage; a wave of 1 % stays within 5 %."""
    assert words.sigma_history(consistency()) == "All ratios stay within the band of ±5 %."
    uncertain = words.sigma_history(consistency(3.3))
    assert (
        uncertain == "The estimate of position north leaves the band of ±5 % at 20 min; no ratio is certain to do so."
    )
    two = words.sigma_history(departing(consistency(3.3), 22, 21))
    assert two == "Position east certainly leaves the band of ±5 % at 21 min; 2 of 9 outputs do."
    one = words.sigma_history(departing(consistency(3.3), 20))
    assert one == "Position north certainly leaves the band of ±5 % at 20 min; it alone does."
    assert words.sigma_history(replace(consistency(), outputs=())) == ""


def test_means_leave_their_bounds_where_the_figure_says_so() -> None:
    assert words.nees_history(consistency()) == "The mean NEES of every group stays within its bounds."
    left = words.nees_history(consistency(3.3))
    assert left.startswith("The mean NEES of ")
    assert left.endswith(" leaves its bounds at 20 min (6 of 6 leave them).")
    (first, *_) = consistency(3.3).groups
    (alone,) = [words.nees_history(replace(consistency(3.3), groups=(first,)))]
    assert alone == "The mean NEES of all states leaves its bounds at 20 min."
    assert words.nees_history(replace(consistency(), groups=())) == ""


def test_shares_and_innovations() -> None:
    """In the outage no sensor updates: nothing is known there, and nothing leaves its bounds."""
    assert (
        words.within_history(consistency()) == "The share of every output within ±1σ and ±3σ stays within its bounds."
    )
    assert " leaves its bounds at 20 min (18 of 18 leave them)." in words.within_history(consistency(3.3))
    found = consistency()
    outside = np.where(np.arange(len(found.times)) == 7, 99.0, found.sensors[1].bounds.mean(axis=1))
    noticed = replace(found.sensors[1], nis=replace(found.sensors[1].nis, value=outside))
    inside = replace(found.sensors[0], nis=replace(found.sensors[0].nis, value=found.sensors[0].bounds.mean(axis=1)))
    assert words.nis_history(replace(found, sensors=(inside, noticed))) == (
        "The mean NIS of altimeter leaves its bounds at 7 min (1 of 2 leave them)."
    )


def test_sigmas_where_they_are_largest() -> None:
    """The true sigma grows until 24 min; there the filter's is smaller by the factor and the wave of 1 %."""
    told = words.errors(consistency(3.3))
    found = consistency(3.3).outputs[0]
    assert told.startswith("1σ of ")
    assert " is largest at 24 min: " in told
    assert found.true[24] / found.filter[24] == pytest.approx(3.3, rel=0.011)


def test_the_state_that_gains_most() -> None:
    found = consistency()
    first = replace(found.states[0], true=np.linspace(4.0, 1.0, len(found.times)))
    others = [replace(each, true=np.ones(len(found.times))) for each in found.states[1:]]
    told = words.estimation(replace(found, states=(first, *others)))
    assert told == "From start to end the sigma of gyro bias x falls most, to 25 % by Monte Carlo."
    assert words.estimation(replace(found, states=tuple(others))) == (
        "No sigma by Monte Carlo is smaller at the end than at the start."
    )
    assert words.estimation(replace(found, states=())) == ""
