"""The flight deck: planes that scenarios have, ellipses, rings, and what is said of an instant."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import SensorConsistency
from mcnav.report.figures.deck import _track, ellipse_of, ring_radii, series_of
from mcnav.report.figures.dispersion import MOST, NOTABLE, ordered_pairs
from mcnav.report.pages.run.deck import RADII, Deck, Dispersion, Kind, Place, Route
from mcnav.report.pages.run.deck_lanes import Interval, Lane, Rejection, rejections
from mcnav.report.results.model import RunAnalysis

COVARIANCE = np.array([[9.0, 4.0], [4.0, 4.0]])


def dispersion(kind: Kind = "error", route: Route = "Monte Carlo", scale: float = 1.0) -> Dispersion:
    return Dispersion(kind, route, np.zeros((3, 2)), scale * np.stack([COVARIANCE, 4.0 * COVARIANCE, COVARIANCE]))


def of(*dispersions: Dispersion) -> Deck:
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    place = Place("plane", "position_x", "position_z", line, line, np.tile(np.eye(2), (3, 1, 1)))
    lane = Lane("gnss", (Interval("outage", 5.0, 12.0, ""),), (Rejection(20.0, 0.25),))
    times = np.array([0.0, 10.0, 20.0])
    return Deck("time [s]", times, times, None, place, dispersions, (lane,), {}, (), np.empty((3, 0)), "")


def test_an_ellipse_holds_the_moments() -> None:
    """The mean product of its points is half the covariance times the square of its reach."""
    points = ellipse_of(dispersion(), 1)[1:]
    np.testing.assert_allclose(points.T @ points / len(points), 0.5 * RADII**2 * 4.0 * COVARIANCE, rtol=1e-12)
    assert dispersion().axes_at(0) == pytest.approx(RADII * np.sqrt(np.linalg.eigvalsh(COVARIANCE)[::-1]))
    assert 1.0 - np.exp(-0.5 * RADII**2) == pytest.approx(0.95)


def test_of_one_direction_alone_it_is_the_interval() -> None:
    alone = Dispersion("true", "linear", np.zeros((1, 2)), np.array([[[4.0, 0.0], [0.0, 0.0]]]), single=True)
    assert alone.axes_at(0) == pytest.approx((2.0 * 1.959964, 0.0))
    np.testing.assert_allclose(np.abs(ellipse_of(alone, 0)).max(axis=0), [2.0 * 1.959964, 0.0], rtol=1e-6)


def test_rings_are_round_numbers_that_enclose() -> None:
    """The longest ellipse reaches 7.9 m and 15.8 m from the nominal; rings of 10 m and 20 m enclose it."""
    np.testing.assert_array_equal(ring_radii(of(dispersion())), [10.0, 20.0, 10.0])


def test_ellipses_on_the_track_are_within_its_axes() -> None:
    """Those at start and end are as large as that in the middle, and the track ends there."""
    alike = replace(dispersion(), covariance=np.tile(1e4 * COVARIANCE, (3, 1, 1)))
    known = of(alike)
    panel, factor = _track(known, [series_of(alike, truth=False)])
    for k in range(3):
        x, y = (known.place.at[k] + factor / 1e3 * ellipse_of(alike, k)).T
        assert panel.x.low is not None
        assert panel.x.high is not None
        assert panel.x.low <= x.min() < x.max() <= panel.x.high
        assert panel.y.low is not None
        assert panel.y.high is not None
        assert panel.y.low <= y.min() < y.max() <= panel.y.high


def test_what_is_said_of_an_instant() -> None:
    known = of(dispersion(), dispersion(route="filter", scale=0.25))
    assert known.worst == 1
    assert known.words_at(1) == (
        "95 % ellipse of the navigation error at 10 s: ±16.4 m × ±6.54 m (Monte Carlo), ±8.20 m × ±3.27 m (filter). "
        "Then: gnss outage."
    )
    assert known.words_at(2).endswith("Then: gnss with 25 % of its updates rejected.")
    assert "Then" not in known.words_at(0)


def test_of_many_outputs_the_most_correlated_pairs_are_drawn() -> None:
    """Of 12 outputs those whose correlation is largest, and before them the notable ones."""
    square = np.random.default_rng(5).standard_normal((12, 20))
    covariance = square @ square.T
    comparison = SimpleNamespace(covariance_linear=covariance, covariance_paired=covariance)
    pairs = ordered_pairs(cast("RunAnalysis", SimpleNamespace(moving=range(12), comparison=comparison)))
    sigmas = np.sqrt(np.diag(covariance))
    sizes = np.abs(covariance / np.outer(sigmas, sigmas))
    assert len(set(pairs)) == len(pairs) == MOST
    left = {(i, j) for i in range(12) for j in range(i)[::-1] if (j, i) not in pairs}
    assert min(sizes[pair] for pair in pairs[NOTABLE:]) > max(sizes[pair] for pair in left)


def test_rejections_beyond_those_of_every_interval() -> None:
    """Those of a gate all along are not told, those of a fault are; without updates there are none."""
    rejected = np.array([0.0, 0.6, 0.6, 30.0, 0.6])
    sensor = SimpleNamespace(accepted=np.array([0.0, 59.4, 59.4, 30.0, 59.4]), rejected=rejected)
    told = rejections(cast("SensorConsistency", sensor), np.arange(5.0))
    assert told == (Rejection(3.0, 0.5),)
