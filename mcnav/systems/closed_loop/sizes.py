"""Sizes of a loop's errors: as they are, or as its filter believes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.maps import Maps

SMALL: Final = 1e-3
"""Step of differences where nothing is known of a quantity's size: share of its nominal value, or in SI units."""


CLOCK: Final = 10.0
"""Size of times of events, s: they are copied from map to map, whose differences are the more exact the larger."""


@dataclass(frozen=True)
class Sizes:
    """One sigma of each error.

    Attributes
    ----------
    start : ndarray, shape (sources, sources)
        Covariance of the sources.
    white : ndarray, shape (white.size,)
        Densities of white noise.
    markov : ndarray, shape (markov.size,)
        Stationary sigmas of Gauss-Markov processes.
    decay : ndarray, shape (markov.size,)
        One over their correlation times, 1/s.
    measurements, corrections : tuple of ndarray
        Sigmas of the noise of each sensor, and of the execution error of each correction, by component.
    initial : ndarray, shape (markov.size,), optional
        Sigmas of Gauss-Markov processes at the start, as a filter believes them; the stationary ones unless given.
    """

    start: Array
    white: Array
    markov: Array
    decay: Array
    measurements: tuple[Array, ...]
    corrections: tuple[Array, ...]
    initial: Array | None = None

    @classmethod
    def none(cls, maps: Maps) -> Sizes:
        """Return those of a loop without errors."""
        structure = maps.structure
        sources = len(structure.sources)
        return cls(
            np.zeros((sources, sources)), np.zeros(structure.white.size), np.zeros(structure.markov.size),
            np.zeros(structure.markov.size), tuple(np.zeros(sensor.size) for sensor in maps.sensors),
            tuple(np.zeros(quantity.size) for quantity in structure.corrections.quantities),
        )  # fmt: skip

    def scaled(self, share: float) -> Sizes:
        """Return those with a share of all errors."""
        return replace(
            self, start=share**2 * self.start, white=share * self.white, markov=share * self.markov,
            measurements=tuple(share * measurement for measurement in self.measurements),
            corrections=tuple(share * correction for correction in self.corrections),
            initial=None if self.initial is None else share * self.initial,
        )  # fmt: skip

    @property
    def markov_at_start(self) -> Array:
        """Sigmas of Gauss-Markov processes at the start, shape (markov.size,)."""
        return self.markov if self.initial is None else self.initial

    @cached_property
    def inputs(self) -> Array:
        """Densities of what enters a step: white noise, and what drives Gauss-Markov processes."""
        return np.concatenate([self.white, self.markov * np.sqrt(2.0 * self.decay)])

    @cached_property
    def modes(self) -> Array:
        """The same for the two Legendre modes of a step, one after the other."""
        return np.tile(self.inputs, 2)


@dataclass(frozen=True)
class LoopSizes:
    """Sizes of all errors: as they are, and as the filter believes them."""

    true: Sizes
    believed: Sizes


def difference_steps(maps: Maps, start: Array, true: Sizes) -> Array:
    """Return steps of differences of X, shape (size,): a share of each quantity's size.

    It is the sigma of its source, else a share of its nominal value.
    """
    structure = maps.structure
    steps = np.zeros(structure.size)
    sigmas = np.sqrt(np.maximum(np.diag(true.start), 0.0))
    for source, sigma in zip(structure.sources, sigmas, strict=True):
        moved = list(source.moves)
        steps[moved] = np.maximum(steps[moved], sigma)
    steps[structure.markov.whole] = true.markov
    for block in structure.blocks:
        for quantity, place in block.places():
            size = steps[place].max(initial=0.0)
            nominal = 0.0 if quantity.turns is not None else float(np.linalg.norm(start[place]))
            fallback = size if size > 0.0 else SMALL * nominal if nominal > 0.0 else SMALL
            steps[place] = np.where(steps[place] > 0.0, steps[place], fallback)
    steps[structure.clock.whole] = CLOCK
    return steps
