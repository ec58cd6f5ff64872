"""Noise of samples of a user-defined scenario: generators by counter, and generators whose variates are scaled down.

A sample's generator is keyed by the campaign's seed and the sample's index, so that its noise is the same in any
worker, chunk, retry, replay and resumed run. Scaled generators give the linear response to the same noise by
differences; at a scale of zero there is no noise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array

SAMPLES: Final = 0
"""Stream of a campaign's samples: the highest word of the counter."""

MEASURED: Final = 1
"""Stream of the simulations from which a covariance of noise is measured."""

CHECKED: Final = 2
"""Stream of the checks before a run."""

NORMALS: Final = 3
"""Stream of the standard normals of samples whose noise is under conditions."""

UNIFORM_SIGMA: Final = float(np.sqrt(1.0 / 12.0))
"""Sigma of a uniform variate between 0 and 1."""


def _bits(seed: int, index: int, stream: int) -> np.random.Philox:
    words = np.array([0, 0, 0, stream], dtype=np.uint64)
    return np.random.Philox(counter=words, key=np.array([seed, index], dtype=np.uint64))


def sample_noise(seed: int, index: int, stream: int = SAMPLES) -> np.random.Generator:
    """Return the generator of a sample's noise.

    >>> float(sample_noise(1, 7).standard_normal()) == float(sample_noise(1, 7).standard_normal())
    True
    """
    return np.random.Generator(_bits(seed, index, stream))


class ScaledNoise(np.random.Generator):
    """The generator of a sample's noise, with the deviation of each variate from its mean multiplied by a scale.

    Normal and uniform variates can be scaled. Every other method raises `TypeError`, because its distribution has no
    scale, or none that a linear model knows.
    """

    def __init__(self, seed: int, index: int, scale: float, stream: int = SAMPLES) -> None:
        bits = _bits(seed, index, stream)
        super().__init__(bits)
        self._full = np.random.Generator(bits)
        self._scale = scale

    def _about(self, mean: Any, variates: Any, out: Any = None) -> Any:
        scaled = mean + self._scale * (variates - mean)
        if out is None:
            return scaled
        out[...] = scaled
        return out

    def standard_normal(self, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
        """Draw as `numpy.random.Generator.standard_normal`, scaled."""
        return self._about(0.0, self._full.standard_normal(size, dtype, out), out)

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> Any:
        """Draw as `numpy.random.Generator.normal`, scaled about ``loc``."""
        return self._about(np.asarray(loc)[()], self._full.normal(loc, scale, size))

    def multivariate_normal(self, mean: Any, cov: Any, size: Any = None, *options: Any, **named: Any) -> Any:
        """Draw as `numpy.random.Generator.multivariate_normal`, scaled about the mean."""
        return self._about(np.asarray(mean), self._full.multivariate_normal(mean, cov, size, *options, **named))

    def random(self, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
        """Draw as `numpy.random.Generator.random`, scaled about a half."""
        return self._about(0.5, self._full.random(size, dtype, out), out)

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> Any:
        """Draw as `numpy.random.Generator.uniform`, scaled about the middle."""
        return self._about(0.5 * (np.asarray(low) + np.asarray(high))[()], self._full.uniform(low, high, size))


class ProbedNoise(ScaledNoise):
    """A generator whose variates deviate from their means by given multiples of their sigmas, in the order of drawing.

    Further variates do not deviate. ``used`` counts normal and uniform variates.

    Parameters
    ----------
    deviations : ndarray, shape (variates,)
    """

    def __init__(self, deviations: Array) -> None:
        super().__init__(0, 0, 0.0)
        self._deviations, self.used = deviations, 0

    def _next(self, size: Any) -> Array:
        shape = () if size is None else size
        count = int(np.prod(shape))
        given = self._deviations[self.used : self.used + count]
        self.used += count
        return np.concatenate([given, np.zeros(count - len(given))]).reshape(shape)

    def standard_normal(self, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
        """Return the next deviations."""
        normals = self._next(np.shape(out) if size is None and out is not None else size).astype(dtype)
        if out is None:
            return normals[()]
        out[...] = normals
        return out

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> Any:
        """Return ``loc`` and the next deviations times ``scale``."""
        shape = np.broadcast_shapes(np.shape(loc), np.shape(scale)) if size is None else size
        return loc + np.multiply(scale, self._next(shape or None))

    def multivariate_normal(self, mean: Any, cov: Any, size: Any = None, *options: Any, **named: Any) -> Any:
        """Transform the next deviations as `numpy.random.Generator.multivariate_normal` transforms normals."""
        return np.random.Generator.multivariate_normal(self, mean, cov, size, *options, **named)

    def random(self, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
        """Return a half and the next deviations times the sigma of a uniform variate."""
        about = 0.5 + UNIFORM_SIGMA * self.standard_normal(size, dtype, out)
        if out is None:
            return about
        out[...] = about
        return out

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> Any:
        """Return the middle and the next deviations times the sigma of a uniform variate."""
        shape = np.broadcast_shapes(np.shape(low), np.shape(high)) if size is None else size
        return low + np.subtract(high, low) * self.random(shape or None)


class GivenNoise(np.random.Generator):
    """The generator of a sample's noise whose first standard normals are given, in the order in which they are drawn.

    Those of `numpy.random.Generator.normal` and of `multivariate_normal`, which draws by `standard_normal`, are among
    them. Further normals, times ``size``, and all other variates are drawn. ``used`` counts the normals.
    """

    def __init__(self, seed: int, index: int, given: Array, size: float = 1.0) -> None:
        bits = _bits(seed, index, SAMPLES)
        super().__init__(bits)
        self._drawn, self._given, self._size, self.used = np.random.Generator(bits), given, size, 0

    def standard_normal(self, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
        """Draw as `numpy.random.Generator.standard_normal`."""
        shape = np.shape(out) if size is None and out is not None else () if size is None else size
        count = int(np.prod(shape))
        given = self._given[self.used : self.used + count]
        self.used += count
        further = self._size * self._drawn.standard_normal(count - len(given))
        normals = np.concatenate([given, further]).astype(dtype).reshape(shape)
        if out is None:
            return normals if normals.shape else normals[()]
        out[...] = normals
        return out

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> Any:
        """Draw as `numpy.random.Generator.normal`."""
        shape = np.broadcast_shapes(np.shape(loc), np.shape(scale)) if size is None else size
        return loc + np.multiply(scale, self.standard_normal(shape or None))


def _unscalable(name: str) -> Callable[..., Any]:
    def method(self: ScaledNoise, *arguments: Any, **named: Any) -> Any:
        raise TypeError(
            f"noise.{name} has no linear response; draw noise with standard_normal, normal, multivariate_normal, "
            "random or uniform"
        )

    return method


for _name in dir(np.random.Generator):
    if not _name.startswith("_") and _name != "bit_generator" and _name not in vars(ScaledNoise):
        setattr(ScaledNoise, _name, _unscalable(_name))
