"""The first screen of a report: a tile for each verdict, the worst first, with the number farthest off."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest

from mcnav.analysis.summary import Summary
from mcnav.report.document.parts import Tile
from mcnav.report.pages.run.tiles import headline, tiles, worst_requirement
from mcnav.report.results.filter_summary import filter_entries
from mcnav.report.statements import details, verdicts
from tests import summaries
from tests.filters import consistency

SECTIONS = {"requirements", "filter", "linear"}


def run(linear: str = "agrees", factor: float = 0.0, *requirements: dict[str, Any], **keys: Any) -> Summary:
    """Return a summary of two outputs; without a factor there is no filter."""
    pair: dict[str, Any] = {"outputs": [{"name": "x", "unit": "m"}, {"name": "y_rate", "unit": "m"}]}
    ratio = {"agrees": 0.99987, "undecided": 1.08, "differs": 1.3}[linear]
    filtered = filter_entries(consistency(factor)) if factor else {}
    compared = {
        "verdict": linear, "sigma_linear": [1.0, 1.0], "verdicts": ["agrees", linear],
        "sigma_ratio_paired": [1.0, ratio], "sigma_ratio_paired_interval": [[0.99, 1.01], [0.9 * ratio, 1.1 * ratio]],
        "samples_needed": [None, None],
    }  # fmt: skip
    return summaries.summary(**pair, **(compared | keys), requirements=list(requirements), **filtered)


def requirement(finding: str, **keys: Any) -> dict[str, Any]:
    return summaries.requirement(finding, **({"outputs": ["x", "y_rate"]} | keys))


def tiles_of(summary: Summary) -> list[Tile]:
    return tiles(summary, verdicts.statements(summary), SECTIONS, "min")


@pytest.mark.parametrize(
    ("linear", "finding", "factor"), list(product(("agrees", "undecided", "differs"), ("met", "not met"), (1.0, 10.0)))
)
def test_nothing_green_stands_before_what_fails(linear: str, finding: str, factor: float) -> None:
    """The window's title begins with the worst verdict."""
    made = tiles_of(run(linear, factor, requirement(finding)))
    tones = {
        "Requirements": "agrees" if finding == "met" else "differs",
        "Filter": "agrees" if factor == 1.0 else "differs",
        "Linear analysis": linear,
    }
    assert {each.subject: each.tone for each in made} == tones
    order = ("differs", "partly", "undecided", "agrees")
    assert [each.subject for each in made] == sorted(tones, key=lambda each: order.index(tones[each]))
    statuses = {"met": "met", "not met": "not met", "agrees": "holds", "undecided": "undecided",
                "differs": "does not hold"}  # fmt: skip
    expected = {
        "Requirements": statuses[finding], "Filter": "consistent" if factor == 1.0 else "optimistic",
        "Linear analysis": statuses[linear],
    }  # fmt: skip
    assert {each.subject: each.status for each in made} == expected
    assert headline(made[0]) == f"{made[0].subject} {expected[made[0].subject]}"


def test_tiles_are_only_of_what_there_is() -> None:
    (only,) = tiles_of(run())
    assert (only.subject, only.link) == ("Linear analysis", "linear")
    (unlinked,) = tiles(run(), verdicts.statements(run()), set())
    assert unlinked.link == ""


def test_tiles_lead_to_what_one_asks_next() -> None:
    """Only to sections that the page has."""
    summary = run("agrees", 10.0, requirement("met"))
    made = tiles(summary, verdicts.statements(summary), {"filter", "linear", "budget", "remedies", "what-if"})
    sections = {each.subject: [section for _, section in each.further] for each in made}
    assert sections == {
        "Filter": ["what-if"],
        "Requirements": ["budget", "remedies", "what-if"],
        "Linear analysis": ["budget", "remedies"],
    }
    assert not any(each.further for each in tiles_of(summary))


def test_the_ratio_farthest_from_one_in_three_digits() -> None:
    """Of what decides the verdict: y is undecided, x agrees."""
    (tile,) = tiles_of(run("undecided"))
    assert (tile.value, tile.of) == ("1.08", "Monte Carlo σ / linear σ of y rate (0.972 to 1.19)")
    assert tiles_of(run())[0].value == "1.00"
    unforeseen = run("differs", sigma_ratio_paired=[1.0, None], sigma_ratio_paired_interval=[[0.99, 1.01], None],
                     sigma_linear=[1.0, 0.0], sigma_sample=[1.0, 2.0], start_covariance=[[1.0]],
                     partials=[[1.0], [0.0]], sources=[{"name": "s", "unit": "m"}])  # fmt: skip
    assert tiles_of(unforeseen)[0].value == ""


def test_the_filters_largest_certain_departure() -> None:
    """Of the test's filter the sigmas of all outputs are wrong by the same factor in the outage, about 10 %."""
    summary = run("agrees", 10.0)
    tile, judged = tiles_of(summary)[0], summary.filter
    assert judged is not None
    largest = max(each.factor or 0.0 for each in judged.departures)
    assert float(tile.value) == pytest.approx(largest, abs=0.05)
    assert tile.of.startswith("true σ / filter σ of ")
    assert " min (" in tile.of


def test_a_consistent_filter_has_the_interval_that_its_verdict_rests_on() -> None:
    """That of the epoch alone, if it is known; the one that holds at all epochs together may reach farther."""
    summary = run("agrees", 1.0)
    tile = tiles(summary, verdicts.statements(summary), SECTIONS, "min", (0.97, 1.04))[-2]
    assert (tile.subject, tile.status) == ("Filter", "consistent")
    assert tile.of.endswith(" (0.970 to 1.04)")
    assert tile.strip is not None
    assert (tile.strip.low, tile.strip.high) == (0.97, 1.04)
    assert not tiles_of(summary)[-2].of.endswith(")")


def test_the_requirement_with_the_least_margin() -> None:
    """A finding outweighs a margin; of one finding the share of the limit that the estimate uses counts."""
    near = requirement("met", estimate=1.9, limits=[2.0], interval=[1.85, 1.95])
    far = requirement("met", estimate=1.0, limits=[4.0])
    box = {"kind": "box", "outputs": ["x", "y_rate"], "limits": [1.0, 1.0], "probability": 0.9}
    missed = requirement("not met", **box, estimate=0.85, interval=[0.84, 0.86])
    ratio = requirement("undecided", kind="sigma_ratio", outputs=[], limits=[0.05], estimate=1.04,
                                  interval=[0.9, 1.2])  # fmt: skip
    assert worst_requirement(run()) is None
    for asked, value, of in (
        ([far, near], "1.90 m", "CEP (1.85 to 1.95 m); limit 2 m"),
        ([near, ratio], "1.04", "sigma ratio (0.900 to 1.20); limit ±5 %"),
        ([near, ratio, missed], "85 %", "within the limits (84 % to 86 %); at least 90 %"),
    ):
        tile = next(each for each in tiles_of(run("agrees", 0.0, *asked)) if each.subject == "Requirements")
        assert (tile.value, tile.of) == (value, of)
    assert tile.sentence.startswith(
        "Requirements: 1 of 3 met, 1 not met, 1 undecided. Least margin: within the limits of"
    )


def test_a_requirement_over_time_says_when_it_is_worst() -> None:
    asked = requirement("met", estimate=0.5, interval=[0.4, None], time=12.0, samples=90, epochs=[1, 2])
    (tile,) = (each for each in tiles_of(run("agrees", 0.0, asked)) if each.subject == "Requirements")
    assert (tile.value, tile.of) == ("0.500 m", "CEP at 12 min (above 0.400 m); limit 1 m")


def test_a_rare_event_is_shown_by_its_probability() -> None:
    beyond = {"estimate": 2.346e-7, "from": 1e-7, "to": 4e-7, "flights": 9_000, "method": "lines"}
    asked = requirement("met", kind="quantile", outputs=["x"], probability=1.0 - 1e-6, exceedance=beyond)
    (tile,) = (each for each in tiles_of(run("agrees", 0.0, asked)) if each.subject == "Requirements")
    assert (tile.value, tile.of) == ("2.35·10⁻⁷", "beyond the limit (1.00·10⁻⁷ to 4.00·10⁻⁷); allowed 1.00·10⁻⁶")


@pytest.mark.parametrize(
    ("ends", "mean", "words"),
    [
        ([0.99, 1.03], 0.0, "at least 1.8 times their size before a sigma leaves ±10 %, first that of y rate."),
        ([0.9999, 1.0], 0.0, "at least 3.1 times their size before a sigma leaves ±10 %, first that of x."),
        ([0.99, 1.09], 0.0, ""), ([None, None], 0.0, "at least 3.1 times"), ([0.99, 1.03], 0.1, ""),
    ],
)  # fmt: skip
def test_room_to_grow(ends: list[float | None], mean: float, words: str) -> None:
    """Of x the interval is 0.99 to 1.01: sqrt(0.1 / 0.01) = 3.16; sqrt(0.1 / 0.03) = 1.82."""
    summary = run(
        tolerance=0.1, sigma_ratio_paired_interval=[[0.99, 1.01], ends],
        start_mean=[mean, *([0.0] * (len(run().start_mean) - 1))],
    )  # fmt: skip
    told = details.room_to_grow(summary)
    assert words in told
    assert bool(told) == bool(words)
    assert details.room_to_grow(run("differs")) == ""
