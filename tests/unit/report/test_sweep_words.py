"""A sweep in words: limits met in a range, several of them together, filters, Monte Carlo that disagrees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.analysis.accuracy_measures import read_measure, requirement_measures
from mcnav.analysis.requirements import Requirement
from mcnav.analysis.sweep import Confirmation, JustMet, Span, Sweep, Variable
from mcnav.contract.quantities import Output
from mcnav.report.document.parts import Beside, Findings
from mcnav.report.figures.sweep import boundary_table, contour_levels, contour_lines
from mcnav.report.pages.sweep import frame
from mcnav.report.pages.sweep_page import page
from mcnav.report.statements.sweep import NOT_SIMULATED, common_spans, confirmed_words, headline, met_words, remarks
from tests.summaries import requirement, summary

OUTPUTS = (Output("range", "m", "km"), Output("altitude", "m", "km"))
KEY = Variable("errors.range", np.array([1.0, 2.0, 3.0]), "km", False)
MEASURES = (
    read_measure("range < 2 km", OUTPUTS),
    *requirement_measures([Requirement("quantile", (1,), (5e3,), 0.95)], OUTPUTS),
)
VALUES = np.array([[1e3, 4e3], [2e3, 4e3], [3e3, 4e3]])
BOUNDS = np.array([[2e3, 5e3]] * 3)
SWEEP = Sweep(
    "some", OUTPUTS, (KEY,), MEASURES, (None, None), VALUES, VALUES, BOUNDS, np.log(VALUES / BOUNDS), VALUES[0],
    (JustMet(0, None, (2.0,), ((None, 2.0),)), JustMet(1, None, (), ((None, None),))),
)  # fmt: skip


def confirmed(verdicts: tuple[str, str], finding: str, joint: str = "agrees") -> Sweep:
    """Return the sweep with a run at its last point."""
    rows: dict[str, Any] = {
        "outputs": [{"name": each.name, "unit": each.unit} for each in OUTPUTS],
        "shown_in": {"outputs": ["km", "km"]},
        "requirements": [requirement(finding)],
        "verdicts": list(verdicts),
        "verdict_matrix": joint,
        "unsettled": None,
        "samples": 100,
    }
    pairs = ("sigma_ratio_interval", "sigma_ratio_paired_interval")
    for name in ("sigma_linear", "sigma_sample", "sigma_paired", "sigma_ratio", "sigma_ratio_paired"):
        rows[name] = [1.0, 1.0]
    rows |= {name: [[0.9, 1.1], [0.9, 1.1]] for name in pairs}
    rows |= {name: [0.0, 0.0] for name in ("mean_linear", "mean_sample", "bias", "bias_standard_error")}
    run = Confirmation((2,), (3.0,), Path("a/confirm/03"), summary(**rows), np.full(2, np.nan))
    return replace(SWEEP, confirmations=(run,))


@pytest.mark.parametrize(
    ("spans", "words"),
    [
        (((None, None),), "met at every value looked at"),
        ((), "not met at any value looked at"),
        (((None, 2.0),), "met up to 2 km"),
        (((2.0, None),), "met from 2 km on"),
        (((1.5, 2.5),), "met from 1.5 km to 2.5 km"),
        (((None, 1.5), (2.5, None)), "met up to 1.5 km and from 2.5 km on"),
    ],
)
def test_where_a_limit_is_met(spans: tuple[Span, ...], words: str) -> None:
    assert met_words(JustMet(0, None, (), spans), KEY) == words


@pytest.mark.parametrize(
    ("spans", "closest", "words"),
    [
        (((None, None),), (3.0, np.log(0.8)),
         "met at all 17 values looked at; closest at 3 km, with a factor of 1.25 to spare"),
        ((), (2.5, np.log(1.1)),
         "not met at any of the 17 values looked at; closest at 2.5 km, off by a factor of 1.1"),
    ],
)  # fmt: skip
def test_a_limit_that_is_not_crossed_says_what_was_looked_at(
    spans: tuple[Span, ...], closest: tuple[float, float], words: str
) -> None:
    assert met_words(JustMet(0, None, (), spans, 17, closest), KEY) == words


def test_limits_together() -> None:
    assert headline(SWEEP) == ("By linear analysis: all limits together are met up to 2 km: errors.range", "partly")
    assert headline(replace(SWEEP, just_met=SWEEP.just_met[1:]))[0].startswith(
        "By linear analysis: 95 % of |altitude|, at most 5 km: met at every value looked at"
    )
    below = JustMet(1, None, (1.5,), ((None, 1.5),))
    above = JustMet(1, None, (2.5,), ((2.5, None),))
    inner = replace(SWEEP, just_met=(SWEEP.just_met[0], below))
    assert common_spans(inner) == ((None, 1.5),)
    apart = replace(SWEEP, just_met=(SWEEP.just_met[0], above))
    assert common_spans(apart) == ()
    words = "By linear analysis: all limits together are not met at any value looked at: errors.range"
    assert headline(apart) == (words, "differs")


def test_a_linear_headline_is_taken_back_where_monte_carlo_disagrees() -> None:
    refuted, borne_out = (replace(confirmed(("agrees", "agrees"), finding), just_met=SWEEP.just_met)
                          for finding in ("not met", "met"))  # fmt: skip
    assert headline(refuted)[1] == "undecided"
    assert headline(borne_out)[1] == headline(SWEEP)[1]
    assert NOT_SIMULATED in remarks(SWEEP)
    assert NOT_SIMULATED not in remarks(refuted)


@pytest.mark.parametrize(
    ("verdicts", "finding", "joint", "words", "tone"),
    [
        (("agrees", "agrees"), "met", "agrees", "agrees with linear analysis at all 1 points", "agrees"),
        (("agrees", "agrees"), "undecided", "agrees", "agrees with linear analysis", "agrees"),
        (("agrees", "agrees"), "not met", "agrees", "disagrees with linear analysis at 1 of 1 points", "differs"),
        (("differs", "agrees"), "met", "agrees", "do not rely on the linear numbers there", "differs"),
        (("agrees", "undecided"), "met", "agrees", "does not decide at 1 of 1 points", "undecided"),
        (("agrees", "agrees"), "met", "differs", "The full covariance matrix differs", "partly"),
    ],
)
def test_monte_carlo(verdicts: tuple[str, str], finding: str, joint: str, words: str, tone: str) -> None:
    stated, colour = confirmed_words(confirmed(verdicts, finding, joint))
    assert words in stated
    assert colour == tone


def test_a_run_that_an_index_calls_different_is_not_said_to_agree() -> None:
    """Its outputs that a sweep does not look at differ."""
    known = confirmed(("agrees", "agrees"), "met")
    run = replace(
        known.confirmations[0], summary=known.confirmations[0].summary.model_copy(update={"verdict": "differs"})
    )
    stated, tone = confirmed_words(replace(known, confirmations=(run,)))
    assert stated.endswith("Other outputs differ at 1 of them")
    assert tone == "partly"


def test_remarks() -> None:
    assert remarks(SWEEP) == [
        NOT_SIMULATED,
        "At every point the filter's own values are the true ones.",
        "At all values of errors.range that were looked at 95 % of |altitude| is the same.",
    ]
    between = ((2.0e3,), np.array([2e3, 3e3]))
    assert not any("is the same" in each for each in remarks(replace(SWEEP, added=(between,))))
    beyond = VALUES.copy()
    beyond[-1] = np.inf
    assert remarks(replace(SWEEP, values=beyond, own=np.full_like(VALUES, np.nan))) == [
        NOT_SIMULATED,
        "At 1 point errors are beyond the range of linear analysis: no value there, and no limit met.",
        "At all values of errors.range that were looked at 95 % of |altitude| is the same.",
    ]
    optimistic = remarks(replace(SWEEP, own=np.array([[1e3, 4e3], [1e3, 4e3], [1e3, 4e3]])))
    assert optimistic[1] == "The filter is optimistic by a factor of up to 3: range, 1σ, at errors.range = 3 km."
    missing = VALUES.copy()
    missing[0] = np.nan
    assert remarks(replace(SWEEP, values=missing, own=np.full_like(VALUES, np.nan)))[1].startswith(
        "1 point has no linear"
    )


def test_the_frame_has_units_and_limits() -> None:
    table = frame(SWEEP)
    assert table["range < 2 km [km]"].tolist() == [1.0, 2.0, 3.0]
    assert table["range < 2 km, met"].tolist() == [True, True, False]
    assert table.attrs["units"]["errors.range [km]"] == "km"
    assert table.attrs["just_met"][0]["just_met"] == [2.0]


def test_contours_of_a_product_are_straight_on_logarithmic_axes() -> None:
    """Of xy the logarithm is linear, so that contours are exact; over linear axes to the curvature between points."""
    variables = [Variable(name, np.geomspace(1.0, 100.0, 7), "m", True) for name in ("a", "b")]
    values = variables[0].values[:, None] * variables[1].values[None, :] ** 2
    ((x, y),) = contour_lines(variables[0], variables[1], values, 500.0)
    np.testing.assert_allclose(x * y**2, 500.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (1.0, 1.0, []), (0.1, 0.45, [0.15, 0.2, 0.3]), (1e-3, 1e6, [10.0**k for k in range(-2, 6)]),
        (9.0, 10.2, [9.2, 9.4, 9.6, 9.8, 10.0]),
    ],
)  # fmt: skip
def test_levels_of_contours_are_round(low: float, high: float, expected: list[float]) -> None:
    assert contour_levels(np.array([low, high])) == pytest.approx(expected)


@pytest.mark.parametrize("log", [False, True])
def test_the_line_of_a_limit_passes_through_the_points_at_which_it_is_just_met(log: bool) -> None:
    """A sigma of hypot(x, y²) over a coarse grid: along each x the limit of 5 is just met at y = (25 - x²)^¼.

    Straight lines between the points of the grid have it up to 12 % elsewhere.
    """
    x, y = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.5, 1.5, 3.0])
    values = np.hypot(x[:, None], y**2)[..., None]
    just_met = tuple(
        JustMet(0, float(each), (z,), ((None, z),)) for each in x for z in [float((25.0 - each**2) ** 0.25)]
    )
    pair = Variable("a", x, "m", False), Variable("b", y, "m", log)
    swept = replace(SWEEP, variables=pair, measures=MEASURES[:1], margins=np.log(values / 5.0), just_met=just_met)
    up, margins = boundary_table(swept, 0)
    lines = contour_lines(pair[0], up, margins, 0.0, False)
    through = np.vstack([np.column_stack(line) for line in lines])
    for each in just_met:
        assert np.abs(through - (each.fixed, each.values[0])).max(axis=1).min() < 1e-9


@pytest.mark.parametrize(
    ("limits", "tightest"),
    [
        ((JustMet(0, None, (), ((None, None),), 3, (3.0, -2.0)), JustMet(1, None, (), ((None, None),), 3, (1.0, -0.2))),
         ("met", "agrees", "95 % of |altitude|, at most 5 km: closest at 1 km, with a factor of 1.22 to spare")),
        ((JustMet(0, None, (2.0,), ((None, 2.0),)), JustMet(1, None, (), ((None, None),), 3, (1.0, -0.2))),
         ("in part", "partly", "range, 1σ, at most 2 km: met up to 2 km")),
        ((JustMet(0, None, (2.0,), ((None, 2.0),)), JustMet(1, None, (), (), 3, (3.0, 0.5))),
         ("not met", "differs", "95 % of |altitude|, at most 5 km: closest at 3 km, off by a factor of 1.65")),
    ],
)  # fmt: skip
def test_the_first_screen_has_the_tightest_limit(limits: tuple[JustMet, ...], tightest: tuple[str, str, str]) -> None:
    """In words and drawn, whichever of the limits it is."""
    (beside,) = (part for part in page(replace(SWEEP, just_met=limits)).head if isinstance(part, Beside))
    (figure,), (findings,) = beside.figures, [part for part in beside.parts if isinstance(part, Findings)]
    assert list(findings.entries) == [tightest]
    assert "and 1 more" in findings.further
    assert tightest[2].startswith(figure.panels[0].title)
