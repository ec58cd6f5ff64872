"""The size of a normal vector against closed forms, other quadratures, and samples."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from scipy import special, stats

from mcnav.arrays.types import Array
from mcnav.errors import NumericalError
from mcnav.statistics import generalized_chi_square
from mcnav.statistics.normal_size import NormalSize, size_quantile, size_quantiles

# The burn of nasa/condor's rendezvous: mean, and a covariance with the same sigmas.
BURN = np.array([1.45222327, 0.0, 0.30311604])


def turned(variances: Array, seed: int) -> Array:
    """A covariance with these variances along random axes."""
    axes = np.linalg.qr(np.random.default_rng(seed).standard_normal((len(variances), len(variances))))[0]
    return np.asarray(axes @ np.diag(variances) @ axes.T)


@pytest.mark.parametrize("dimension", [2, 3, 5])
@pytest.mark.parametrize("noncentrality", [1e-6, 1.0, 2_000.0, 1e6])
def test_equal_sigmas_are_noncentral_chi_square(dimension: int, noncentrality: float) -> None:
    mean = np.zeros(dimension)
    mean[-1] = np.sqrt(noncentrality)
    law = NormalSize.of(mean, np.eye(dimension))
    middle, spread = dimension + noncentrality, np.sqrt(2.0 * (dimension + 2.0 * noncentrality))
    for multiple in (-3.0, -0.5, 0.0, 1.0, 4.0):
        square = max(middle + multiple * spread, 0.02 * middle)
        expected = stats.ncx2.cdf(square, dimension, noncentrality)
        assert law.probability(float(np.sqrt(square))) == pytest.approx(expected, abs=1e-12)


def two_axes(sigmas: Array, centres: Array, radius: float) -> tuple[float, float]:
    """Probabilities within and beyond a radius, by polar angle: the narrower axis by its density, the other by its law.

    Gauss and Legendre's rule of 24 nodes between angles at which either variable is a multiple of its sigma from its
    mean, and near the ends: good to 1e-12 of both.
    """
    order = np.argsort(sigmas)
    (narrow, wide), (near, far) = sigmas[order], centres[order]
    multiples = np.concatenate([np.geomspace(0.02, 14.0, 14), [0.0], -np.geomspace(0.02, 14.0, 14)])
    sines = (near + multiples * narrow) / radius
    cosines = (abs(far) + multiples * wide) / radius
    right = np.arccos(cosines[(cosines > 0.0) & (cosines < 1.0)])
    ends = 0.5 * np.pi - np.append(np.geomspace(1e-9, 1.0, 10), 0.0)
    edges = np.unique(np.concatenate([np.arcsin(sines[np.abs(sines) < 1.0]), right, -right, ends, -ends]))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle = 0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * nodes
    x, half = radius * np.sin(angle), radius * np.cos(angle)
    density = stats.norm.pdf((x - near) / narrow) / narrow * half * 0.5 * np.diff(edges)[:, None] * weights
    above, below = (half - far) / wide, (-half - far) / wide
    mirrored = below > 0.0
    inside = np.where(mirrored, special.ndtr(-below) - special.ndtr(-above), special.ndtr(above) - special.ndtr(below))
    outside = special.ndtr(-above) + special.ndtr(below)
    tails = special.ndtr((-radius - near) / narrow) + special.ndtr((near - radius) / narrow)
    return float(np.sum(density * inside)), float(tails + np.sum(density * outside))


@pytest.mark.parametrize(
    ("ratio", "offset", "turn"),
    [
        *product([0.3, 0.1, 1e-2, 1e-3], [1e-3, 0.5, 2.0, 5.0, 30.0, 1e3], [0.0, 0.5, 1e-3, 0.5 * np.pi]),
        *product([0.3, 0.1, 1e-2, 1e-3], [0.0], [0.0]),  # without an offset there is none to turn
        *product([1.0], [0.0, 1e-3, 0.5, 2.0, 5.0, 30.0, 1e3], [0.5]),  # a circle is the same in each direction
    ],
)
def test_two_axes_of_every_shape(ratio: float, offset: float, turn: float) -> None:
    """Quantiles from 1e-9 to 1 - 1e-9, with offsets along the narrow axis, the wide one, and between.

    Rounding of squares leaves 1e-15 of the size over the narrow sigma, in sigmas, and ten times that of a tail.
    """
    sigmas, centres = np.array([ratio, 1.0]), offset * np.array([np.cos(turn), np.sin(turn)])
    law = NormalSize.of(centres, np.diag(sigmas**2))
    largest = 0.0
    for probability in (1e-9, 1e-4, 0.05, 0.5, 0.95, 0.9973, 0.9999, 1.0 - 1e-9):
        size = law.quantile(probability)
        assert size > largest
        largest = size
        within, beyond = two_axes(sigmas, centres, size)
        # a quantile is known to 1e-13 of its first bracket, of 15 wide sigmas at most; probabilities rise with its
        # square at most
        tolerance = 1e-8 + 3e-12 / size + 1e-14 * (1.0 + offset) / ratio
        assert within == pytest.approx(probability, rel=tolerance, abs=0.0)
        assert beyond == pytest.approx(1.0 - probability, rel=tolerance, abs=0.0)
        assert law.probability(size) == pytest.approx(within, rel=tolerance, abs=0.0)
        assert law.beyond(size) == pytest.approx(beyond, rel=tolerance, abs=0.0)


def test_the_burn_along_its_narrow_axis() -> None:
    """Digits computed elsewhere: 5 m/s with 0.1 along, 1 across and 0.01 in both; 100 m/s with 1 along, 5 across."""
    burn = NormalSize.of(np.array([0.0, 5.0]), np.diag([1.0001, 0.0101]))
    assert [burn.quantile(0.5), burn.quantile(0.9973)] == pytest.approx([5.0737, 5.8562], abs=5e-5)
    three = NormalSize.of(np.array([100.0, 0.0, 0.0]), np.diag([1.0, 25.0, 25.0]))
    # by scipy's quad over the axis along, of exp(-(r^2 - (100 + z)^2) / 50) across
    assert [three.quantile(0.95), three.quantile(0.9973)] == pytest.approx([101.946589420, 103.148719187], abs=1e-9)


@pytest.mark.parametrize("ratio", [0.9, 0.1, 1e-3, 1e-5])
@pytest.mark.parametrize("probability", [1e-9, 1e-3, 0.5, 0.9973, 1.0 - 1e-9])
def test_two_pairs_of_equal_axes_are_a_sum_of_exponentials(ratio: float, probability: float) -> None:
    """``P(Q > q) = (a exp(-q / 2a) - b exp(-q / 2b)) / (a - b)`` with the variances a and b."""
    narrow = ratio**2
    law = NormalSize.of(np.zeros(4), np.diag([1.0, narrow, 1.0, narrow]))
    square = law.quantile(probability) ** 2
    beyond = (np.exp(-0.5 * square) - narrow * np.exp(-0.5 * square / narrow)) / (1.0 - narrow)
    within = (-np.expm1(-0.5 * square) + narrow * np.expm1(-0.5 * square / narrow)) / (1.0 - narrow)
    # two terms of the size of q, at most, cancel in what is within
    assert within == pytest.approx(probability, rel=1e-8 + 1e-15 * square / within / (1.0 - narrow), abs=0.0)
    assert beyond == pytest.approx(1.0 - probability, rel=1e-8, abs=0.0)


@pytest.mark.parametrize("seed", range(2))
def test_three_axes_are_an_integral_over_the_narrowest(seed: int) -> None:
    """Gauss and Legendre's rule over the narrowest axis, of the law of the other two by polar angle.

    12 nodes in intervals of up to 2 sigmas, halved towards the ends where the circle shrinks to a point.
    """
    random = np.random.default_rng(seed)
    sigmas = np.sort(10.0 ** random.uniform(-3.0, 0.0, 3))
    centres = sigmas * random.choice([0.0, 1.0, 10.0], 3) * random.standard_normal(3)
    law = NormalSize.of(centres, np.diag(sigmas**2))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    for probability in (1e-6, 0.5, 0.9973):
        radius = law.quantile(probability)
        low, high = np.clip((np.array([-1.0, 1.0]) * radius - centres[0]) / sigmas[0], -9.0, 9.0)
        halves = 0.5 * (high - low) * 0.5 ** np.arange(1, 20)
        edges, within = np.unique(np.concatenate([np.linspace(low, high, 10), low + halves, high - halves])), 0.0
        for begin, end in pairwise(edges):
            z = 0.5 * (begin + end) + 0.5 * (end - begin) * nodes
            circles = np.sqrt(np.maximum(radius**2 - (centres[0] + sigmas[0] * z) ** 2, 1e-300))
            inside = [two_axes(sigmas[1:], centres[1:], circle)[0] for circle in circles]
            within += 0.5 * (end - begin) * float(weights @ (stats.norm.pdf(z) * inside))
        assert within == pytest.approx(probability, rel=1e-7)


def test_the_law_rises_and_its_mean_lies_between_for_shapes_at_random() -> None:
    """One to six axes, sigmas that differ by up to 1e7, offsets up to 1e9 sigmas, axes without variance."""
    random = np.random.default_rng(12)
    for _ in range(20):
        axes = int(random.integers(1, 7))
        sigmas = 10.0 ** random.uniform(-7.0, 0.0, axes) * random.choice([0.0, 1.0, 1.0, 1.0], axes)
        centres = sigmas * 10.0 ** random.uniform(-6.0, 9.0, axes) * random.choice([0.0, 1.0], axes)
        centres[0] += random.choice([0.0, 1.0])
        law = NormalSize.of(centres, np.diag(sigmas**2))
        sizes = [law.quantile(p) for p in (1e-9, 1e-3, 0.5, 0.9973, 1.0 - 1e-9)]
        assert sizes == sorted(sizes)
        assert sizes[0] * (1.0 - 1e-15) <= law.mean <= sizes[-1] * (1.0 + 1e-15)
        for size in (0.0, sizes[0], law.mean, sizes[-1]):
            assert law.probability(size) + law.beyond(size) == pytest.approx(1.0, abs=1e-15)


def test_routes_that_disagree_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a second route of two nodes in each unit, no probability and no quantile is stated."""
    monkeypatch.setattr(generalized_chi_square, "PATHS", (generalized_chi_square.PATHS[0], (0.3, 2)))
    law = NormalSize.of(np.array([0.0, 5.5]), np.diag([1.0, 0.02]))
    generalized_chi_square._hyperbola.cache_clear()
    with pytest.raises(NumericalError, match="two ways to compute the probability of 5"):
        law.probability(5.0)
    with pytest.raises(NumericalError, match=r"two ways to compute the size at the probability 0\.9973"):
        law.quantile(0.9973)
    turned_up, flat = np.array([[0.0, 5.5], [1.0, 0.0]]), np.array([np.diag([1.0, 0.02]), np.diag([0.0, 1.0])])
    assert size_quantiles(turned_up, flat, 0.9973, instead=np.inf)[0] == np.inf
    with pytest.raises(NumericalError, match=r"two ways to compute the size at the probability 0\.9973"):
        size_quantiles(turned_up, flat, 0.9973)
    generalized_chi_square._hyperbola.cache_clear()


def test_circles_and_spheres() -> None:
    """CEP of a circle, a line and a point; distances beyond which one of 1e18 lies."""
    assert size_quantile(np.zeros(2), 4.0 * np.eye(2), 0.5) == pytest.approx(2.0 * np.sqrt(2 * np.log(2)), rel=1e-12)
    line = np.array([[9.0, 9.0], [9.0, 9.0]])
    assert size_quantile(np.zeros(2), line, 0.5) == pytest.approx(np.sqrt(18) * stats.norm.ppf(0.75), rel=1e-12)
    assert size_quantile(np.array([3.0, 4.0]), np.zeros((2, 2)), 0.5) == 5.0
    assert size_quantile(np.zeros(2), np.zeros((2, 2)), 0.5) == 0.0
    assert size_quantile(np.zeros(3), 9.0 * np.eye(3), 0.5) == pytest.approx(3.0 * stats.chi(3).median(), rel=1e-12)
    assert np.isnan(size_quantile(np.zeros(2), np.full((2, 2), np.nan), 0.5))
    for size in (1, 2, 3):
        for radius in (3.0, 6.0, 9.0):
            beyond = NormalSize.of(np.zeros(size), 4.0 * np.eye(size)).beyond(2.0 * radius)
            assert beyond == pytest.approx(stats.chi2.sf(radius**2, size), rel=1e-12, abs=0.0)
    beyond = NormalSize.of(np.array([0.6, -0.8]), np.eye(2)).beyond(6.0)
    assert beyond == pytest.approx(stats.ncx2.sf(36.0, 2, 1.0), rel=1e-9, abs=0.0)


@pytest.mark.parametrize("offset", [1e2, 1e4, 1e6])
def test_variance_of_a_size_far_from_zero(offset: float) -> None:
    """``Var |x| = s^4 / 2 m^2`` across a mean m without other errors, to the order of ``(s / m)^2``."""
    law = NormalSize.of(np.array([offset, 0.0]), np.diag([0.0, 1.0]))
    assert law.variance == pytest.approx(0.5 / offset**2, rel=5.0 / offset**2 + 1e-8)


@pytest.mark.parametrize("mean", [BURN, 0.0 * BURN, np.array([0.01, 0.0, 0.0])])
def test_mean_agrees_with_gauss_hermite_and_quantiles_with_samples(mean: Array) -> None:
    """Shares of 200,000 samples, within 3.9 standard errors."""
    covariance = turned(np.array([0.0336119, 0.04329116, 0.09082802]) ** 2, 4)
    law, lower = NormalSize.of(mean, covariance), np.linalg.cholesky(covariance)
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights /= weights.sum()
    points = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1) @ lower.T + mean
    product = weights[:, None, None] * weights[:, None] * weights
    tolerance = 1e-12 if mean is BURN else 1e-3  # a kink at zero
    assert law.mean == pytest.approx(float(np.sum(product * np.linalg.norm(points, axis=-1))), rel=tolerance)
    sizes = np.linalg.norm(mean + np.random.default_rng(7).standard_normal((200_000, 3)) @ lower.T, axis=1)
    assert sizes.mean() == pytest.approx(law.mean, abs=3.9 * sizes.std() / np.sqrt(len(sizes)))
    for probability in (0.5, 0.9973):
        share = np.mean(sizes <= law.quantile(probability))
        assert share == pytest.approx(probability, abs=3.9 * np.sqrt(probability * (1 - probability) / len(sizes)))


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_singular_covariances(rank: int) -> None:
    """Axes without dispersion add their square; with none left the size is certain."""
    variances = np.where(np.arange(3) < rank, 0.04, 0.0)
    law = NormalSize.of(np.array([0.3, 0.4, 1.2]), np.diag(variances))
    sizes = np.linalg.norm(
        [0.3, 0.4, 1.2] + np.random.default_rng(3).standard_normal((100_000, 3)) * np.sqrt(variances), axis=1
    )
    for probability in (0.05, 0.5, 0.9973):
        size = law.quantile(probability)
        if rank == 0:
            assert size == pytest.approx(1.3, rel=1e-12)
        else:
            spread = 3.9 * np.sqrt(probability * (1 - probability) / len(sizes))
            assert np.mean(sizes <= size) == pytest.approx(probability, abs=spread)


def test_small_variances_beside_a_large_one() -> None:
    """One axis of a hundred millionth of the other's variance: that of a single axis, shifted."""
    law = NormalSize.of(np.array([1.0, 2.0]), np.diag([1.0, 1e-8]))
    alone = NormalSize.of(np.array([1.0, 2.0]), np.diag([1.0, 0.0]))
    for size in (2.05, 2.5, 4.0):
        assert law.probability(size) == pytest.approx(alone.probability(size), abs=1e-6)
    assert law.probability(1.99) < 1e-12
