"""Probabilities of rare events whose exact values are known, and how often their 95 % intervals hold.

``y = x_1 + a (x_1^2 + ... + x_d^2 - d)`` of d standard normals has a noncentral chi-square,

    P(y > c) = P(chi^2_d(1 / (4 a^2)) > (c + a d + 1 / (4 a)) / a).

`tests.calibration.rare_random` draws more of them at random.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from scipy import integrate, special, stats

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.estimate import estimate_probability
from mcnav.rare.limits import AnyEpoch, Distance, Limit, Sides
from mcnav.rare.weigh import Rare

SEED: Final = 50_000
"""First seed of `Coverage`."""

FLIGHTS, OVER_TIME_FLIGHTS = 1_000, 2_000
"""Flights of an event, about."""


@dataclass(frozen=True)
class RareEvent:
    """An event with its exact probability: outputs, and those of the linear model, of d standard normals.

    ``hidden`` further normals of the outputs are noise, of which the linear model sees nothing.
    """

    name: str
    outputs: Callable[[Array], Array]
    linear: Callable[[Array], Array]
    limit: Limit
    dimensions: int
    exact: float
    hidden: int = 0

    def estimate(self, seed: int, cheap: bool = True) -> Rare:
        """Estimate its probability, by tens of thousands of flights, or by few."""

        def fly(points: Array, noise: IndexArray) -> Array:
            return self.outputs(np.hstack([points, hidden_noise(self.hidden, seed, noise)]))

        most = OVER_TIME_FLIGHTS if isinstance(self.limit, AnyEpoch) else FLIGHTS
        return estimate_probability(
            fly, self.linear, self.limit, self.dimensions, seed, most=most, noisy=self.hidden > 0, cheap=cheap,
            allowed=self.exact,
        )  # fmt: skip


@dataclass(frozen=True)
class Coverage:
    """Outcome of estimates with different seeds: shares of the trials, and relative errors of those stated."""

    refused: float
    holds: float
    too_low: float
    too_high: float
    error: float
    flights: float
    most_flights: int

    @classmethod
    def of(cls, event: RareEvent, trials: int, seed: int = SEED) -> Coverage:
        """Estimate an event with so many seeds."""
        rare = [event.estimate(seed + trial) for trial in range(trials)]
        stated = [each for each in rare if not each.refusal]
        errors = [each.estimate / event.exact - 1.0 for each in stated]
        return cls(
            refused=1.0 - len(stated) / trials,
            holds=sum(each.low <= event.exact <= each.high for each in stated) / max(len(stated), 1),
            too_low=sum(each.high < event.exact for each in stated) / trials,
            too_high=sum(each.low > event.exact for each in stated) / trials,
            error=float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan"),
            flights=float(np.mean([each.flights for each in rare])),
            most_flights=max(each.flights for each in rare),
        )

    @property
    def wrong(self) -> float:
        """Share of trials with an interval that does not hold."""
        return self.too_low + self.too_high


def hidden_noise(count: int, seed: int, numbers: IndexArray) -> Array:
    """Return standard normals by number, shape (n, count)."""
    if not count:
        return np.zeros((len(numbers), 0))
    keys = (np.array((seed, number), dtype=np.uint64) for number in numbers)
    return np.array([np.random.Generator(np.random.Philox(key=key)).standard_normal(count) for key in keys])


def upper(limit: float) -> Sides:
    """Return the side above a limit of one output."""
    return Sides(np.array([-np.inf]), np.array([limit]))


def both(limit: float) -> Sides:
    """Return both sides of a limit of one output."""
    return Sides(np.array([-limit]), np.array([limit]))


def curved(dimensions: int, a: float, c: float, hidden: int = 0) -> RareEvent:
    """Return ``x_1 + a (sum x_i^2 - d) > c``, where some of the d are hidden in noise."""
    name = f"d = {dimensions}, a = {a:g}, c = {c:g}" + (f", {hidden} of them noise" if hidden else "")
    at = (c + a * dimensions + 0.25 / a) / a
    exact = float(stats.ncx2.sf(at, dimensions, 0.25 / a**2))
    return RareEvent(
        name, lambda u: u[:, :1] + a * (np.sum(u**2, axis=1) - dimensions)[:, None], first, upper(c),
        dimensions - hidden, exact, hidden,
    )  # fmt: skip


def scattered(a: float, c: float) -> RareEvent:
    """Return ``x (1 + a h) > c`` with h a normal of the noise: the gain of the output itself is random."""
    bound = 1.0 / a

    def density(h: float) -> float:
        """Return what is beyond: x above c / gain of a positive gain, below it of a negative one."""
        return float(special.ndtr(-c / abs(1.0 + a * h)) * stats.norm.pdf(h))

    exact = sum(integrate.quad(density, *ends, epsabs=0.0, epsrel=1e-10)[0] for ends in ((-bound, 5.0), (5.0, 12.0)))
    return RareEvent(
        f"x (1 + {a:g} h) > {c:g}, h noise", lambda u: u[:, :1] * (1.0 + a * u[:, -1:]), first, upper(c), 3, exact, 1
    )


def product(a: float, c: float, hidden: bool) -> RareEvent:
    """Return ``x_1 + a x_2 h > c``, where h is another error or hidden in noise.

    Of given h it is a normal with the variance ``1 + a^2 h^2``.
    """

    def density(h: float) -> float:
        return float(2.0 * special.ndtr(-c / np.sqrt(1.0 + a**2 * h**2)) * stats.norm.pdf(h))

    exact = float(integrate.quad(density, 0.0, 12.0, epsabs=0.0, epsrel=1e-10)[0])
    name = f"x_1 + {a:g} x_2 {'h' if hidden else 'x_3'} > {c:g}" + (", h noise" if hidden else "")

    def outputs(u: Array) -> Array:
        return u[:, :1] + a * u[:, 1:2] * u[:, -1:]

    return RareEvent(name, outputs, first, upper(c), 4 if hidden else 5, exact, int(hidden))


def first(u: Array) -> Array:
    """Return the first coordinate."""
    return u[:, :1]


def two_sided(dimensions: int) -> RareEvent:
    """Return ``|x + a (x^2 - 1)|`` beyond five of its sigmas, a = 0.02."""
    a, c = 0.02, 5.0 * np.sqrt(1.0 + 2.0 * 0.02**2)
    roots = [
        (-1.0 + sign * np.sqrt(1.0 + 4.0 * a * (a + side * c))) / (2.0 * a) for side in (1, -1) for sign in (-1, 1)
    ]
    outer, inner = np.sort(roots[:2]), np.sort(roots[2:])
    exact = float(special.ndtr(-outer[1]) + special.ndtr(outer[0]) + special.ndtr(inner[1]) - special.ndtr(inner[0]))
    return RareEvent(
        f"two sides, d = {dimensions}", lambda u: u[:, :1] + a * (u[:, :1] ** 2 - 1.0), first, both(c),
        dimensions, exact,
    )  # fmt: skip


def jump_of_another(dimensions: int) -> RareEvent:
    """Return a jump by 20 where ``x_2 > 4.8``, of which the linear model knows nothing."""
    exact = float(special.ndtr(-5.0) + special.ndtr(-4.8) * special.ndtr(5.0))
    return RareEvent(
        "a jump in another direction",
        lambda u: u[:, :1] + 20.0 * (u[:, 1:2] > 4.8),
        first,
        upper(5.0),
        dimensions,
        exact,
    )


def jump_with_it(dimensions: int) -> RareEvent:
    """Return a jump by 3 where ``x_2 > 4.6``: a corner, which no half-space describes."""
    exact = float(special.ndtr(-5.0) * special.ndtr(4.6) + special.ndtr(-4.6) * special.ndtr(-2.0))
    return RareEvent(
        "a jump with a corner", lambda u: u[:, :1] + 3.0 * (u[:, 1:2] > 4.6), first, upper(5.0), dimensions, exact
    )


def jump_back(dimensions: int) -> RareEvent:
    """Return a jump back by 3 where ``x_1 > 5.2``, beyond the limit."""
    exact = float(special.ndtr(-5.0) - special.ndtr(-5.2) + special.ndtr(-8.0))
    return RareEvent(
        "a jump back", lambda u: u[:, :1] - 3.0 * (u[:, :1] > 5.2), first, upper(5.0), dimensions, exact
    )  # fmt: skip


def second_region(dimensions: int) -> RareEvent:
    """Return a second half-space, nearer than that of the linear model."""
    direction = -np.arange(1.0, dimensions + 1.0) / np.linalg.norm(np.arange(1.0, dimensions + 1.0))
    cosine = float(direction[0])
    together = stats.multivariate_normal([0.0, 0.0], [[1.0, cosine], [cosine, 1.0]]).cdf([-5.0, -4.8])
    exact = float(special.ndtr(-5.0) + special.ndtr(-4.8) - together)

    def outputs(u: Array) -> Array:
        return np.asarray(np.maximum(u[:, 0], u @ direction + 0.2)[:, None])

    return RareEvent(f"a second half-space, d = {dimensions}", outputs, first, upper(5.0), dimensions, exact)


def oblique(dimensions: int, a: float, c: float) -> RareEvent:
    """Return ``|x_1 + a ((w . x)^2 - 1)| > c`` with a dense unit vector w perpendicular to the first axis.

    Of given w . x = z it is a normal beyond ``c - a (z^2 - 1)`` or below ``-c - a (z^2 - 1)``: the nearest failures are
    two, at opposite z.
    """
    direction = np.append(0.0, np.sin(1.0 + np.arange(1.0, dimensions)))
    direction /= np.linalg.norm(direction)

    def density(z: float) -> float:
        shift = a * (z**2 - 1.0)
        return float(2.0 * (special.ndtr(shift - c) + special.ndtr(-c - shift)) * stats.norm.pdf(z))

    exact = float(integrate.quad(density, 0.0, 12.0, epsabs=0.0, epsrel=1e-10, limit=400)[0])

    def outputs(u: Array) -> Array:
        return np.asarray(u[:, :1] + a * ((u @ direction) ** 2 - 1.0)[:, None])

    return RareEvent(f"oblique curvature {a:g}, d = {dimensions}", outputs, first, both(c), dimensions, exact)


def bowl(dimensions: int, square: float, c: float = 5.0) -> RareEvent:
    """Return ``x_1 + max(0, q - square) > c`` with q the sum of the other squares: mostly the outside of a ball."""
    others = dimensions - 1

    def density(q: float) -> float:
        return float(special.ndtr(q - square - c) * stats.chi2.pdf(q, others))

    ends = (square, square + c, square + c + 12.0)
    beyond = sum(integrate.quad(density, *pair, epsabs=0.0, epsrel=1e-10)[0] for pair in pairwise(ends))
    exact = float(special.ndtr(-c) * stats.chi2.cdf(square, others) + beyond + stats.chi2.sf(ends[-1], others))

    def outputs(u: Array) -> Array:
        return np.asarray(u[:, :1] + np.maximum(0.0, np.sum(u[:, 1:] ** 2, axis=1) - square)[:, None])

    return RareEvent(f"outside of a ball, d = {dimensions}", outputs, first, upper(c), dimensions, exact)


def passage(correlation: float, epochs: int, c: float, a: float = 0.0) -> RareEvent:
    """Return ``|(1 + a h) y_k| > c`` at any epoch of a stationary Gauss-Markov process, with h hidden in noise."""
    lags = np.abs(np.subtract.outer(np.arange(epochs), np.arange(epochs)))
    root = np.linalg.cholesky(correlation**lags)
    name = f"first passage within {epochs} epochs, correlation {correlation:g}" + (f", gain 1 + {a:g} h" if a else "")
    nodes, weights = np.polynomial.hermite_e.hermegauss(40 if a else 1)
    exact = sum(
        w * first_passage(correlation, epochs, c / abs(1.0 + a * h)) for h, w in zip(nodes, weights, strict=True)
    ) / np.sqrt(2.0 * np.pi)  # fmt: skip

    def linear(u: Array) -> Array:
        return np.asarray(np.einsum("nd,kd->nk", u[:, :epochs], root))

    def outputs(u: Array) -> Array:
        return linear(u) * (1.0 + a * u[:, epochs:]) if a else linear(u)

    return RareEvent(name, outputs, linear, AnyEpoch(both(c), epochs), epochs, float(exact), int(a > 0.0))


def first_passage(correlation: float, epochs: int, c: float, nodes: int = 200) -> float:
    """Integrate the density of a Gauss-Markov process within its limits, epoch by epoch, by Gauss and Legendre's rule.

    What leaves them is added up, which keeps its digits.
    """
    x, w = gauss_legendre(nodes)
    x, w, step = c * x, c * w, np.sqrt(1.0 - correlation**2)
    leaving = special.ndtr((correlation * x - c) / step) + special.ndtr((-correlation * x - c) / step)
    moved = stats.norm.pdf((x[:, None] - correlation * x) / step) / step * w
    within, passed = stats.norm.pdf(x), 2.0 * float(special.ndtr(-c))
    for _ in range(epochs - 1):
        passed += float(np.sum(w * within * leaving))
        within = moved @ within
    return passed


@cache
def gauss_legendre(nodes: int) -> tuple[Array, Array]:
    """Return the nodes and weights of the rule, which take longer than an integral by it."""
    return np.polynomial.legendre.leggauss(nodes)


def circle(radius: float, dimensions: int) -> RareEvent:
    """Return the outside of a circle in two independent outputs, whose linear model has every direction."""
    exact = float(np.exp(-0.5 * radius**2))
    return RareEvent("a circle", lambda u: u[:, :2], lambda u: u[:, :2], Distance(radius, 2), dimensions, exact)


CURVED: Final = (curved(10, 0.02, 4.0), curved(10, 0.02, 5.0), curved(10, 0.05, 5.0))
"""The linear model is right but for curvature: at 5 sigmas it misses by factors of 8 and 66."""

PRODUCTS: Final = (product(0.1, 4.5, hidden=False), product(0.2, 4.5, hidden=False))
"""Products of two errors that are not in the direction of the limit."""

NOISY: Final = (
    curved(10, 0.02, 5.0, hidden=6),
    curved(10, 0.05, 5.0, hidden=9),
    scattered(0.05, 4.5),
    product(0.1, 4.5, hidden=True),
)
"""The linear outcome is among the coordinates of the lines; other parts of the noise move the entries at random."""

SECOND_REGIONS: Final = tuple(second_region(dimensions) for dimensions in (5, 10, 20, 40))
"""A second half-space, whose finding by few flights is measured as well."""

HIDDEN: Final = (
    product(0.2, 4.5, hidden=True),
    two_sided(1),
    two_sided(5),
    jump_of_another(4),
    jump_with_it(4),
    jump_back(10),
    *SECOND_REGIONS,
    bowl(6, 28.0),
    bowl(11, 40.0),
    bowl(21, 60.0),
    bowl(41, 92.0),
)
"""The linear model does not know of a part of the event."""


OBLIQUE: Final = (oblique(5, 0.2, 5.0), oblique(10, 0.2, 5.0), oblique(20, 0.15, 5.0), oblique(40, 0.1, 5.0))
"""Curvature in a direction that is no axis: two nearest failures."""

OVER_TIME: Final = (
    passage(0.0, 24, 5.0),
    passage(0.9, 24, 5.0),
    passage(0.99, 24, 5.0),
    passage(0.9, 24, 4.5, a=0.04),
)
"""Noise over time, whose outcomes at all epochs are among the coordinates of the lines."""

EVENTS: Final = (*CURVED, *PRODUCTS, *NOISY, *HIDDEN, circle(5.0, 4), *OBLIQUE, *OVER_TIME)
