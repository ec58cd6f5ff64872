"""What every peer is given: one truth in stretches with smooth equations, draws, and reference errors.

Peers fly in canonical units, lengths in earth's radii and times in sqrt(r_E^3 / mu), so that every component of a
state is of the order of one and a single tolerance means the same for all of them. Range angles are counted from the
reference axes, times from the start of navigation. Draws and final errors are SI, as everywhere in mcnav.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

LENGTH: Final = 6_378_140.0
"""Unit of length, the earth's radius, m."""

TIME: Final = float(np.sqrt(LENGTH**3 / 3.986135e14))
"""Unit of time, s: the earth's radius and gravitational parameter are one."""

SPEED, ACCELERATION = LENGTH / TIME, LENGTH / TIME**2

ERROR_UNITS: Final = np.array([LENGTH, LENGTH, SPEED, SPEED, 1.0, 1.0 / TIME, ACCELERATION, ACCELERATION, 1.0, 1.0])
"""Of a draw, in the order of `mcnav.systems.reentry.table_i.ERROR_SIZES`."""

OUTPUT_UNITS: Final = np.array([LENGTH, LENGTH, SPEED, SPEED])
"""Of a polar state: the angle is range at the earth's radius."""

SEED: Final = 1772

Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """A truth, canonical unless said otherwise, with m stretches.

    Attributes
    ----------
    number : int
        Of the trajectory in Table I.
    first_point : ndarray, shape (4,)
        Polar state at the start of navigation, SI, range angle as in the report.
    begins, ends : ndarray, shape (m,)
    truths : ndarray, shape (m, 4)
        State at the begin of each stretch.
    phases : ndarray, shape (m, 8)
        Constants of each stretch, see `tests.benchmarks.equations`.
    one_sigma : ndarray, shape (10,)
        Of the draws, SI.
    sigma : ndarray, shape (4,)
        Linear dispersion of the final errors, SI.
    reference : ndarray, shape (n, 4)
        Final errors of the first n draws, SI.
    """

    number: int
    first_point: Array
    begins: Array
    ends: Array
    truths: Array
    phases: Array
    one_sigma: Array
    sigma: Array
    reference: Array

    def save(self, path: Path) -> None:
        """Write to a file for `load`."""
        np.savez(path, **asdict(self))

    def draws(self, count: int) -> Array:
        """The first draws, shape (count, 10), SI: more of them begin with the same ones."""
        drawn = np.random.default_rng(SEED).standard_normal((count, 10))
        drawn *= self.one_sigma
        return drawn

    def error(self, outcomes: Array) -> float:
        """Largest error of the first final errors, share of each output's sigma; infinite when one is not finite."""
        largest = (np.abs(outcomes - self.reference[: len(outcomes)]) / self.sigma).max()
        return float(largest) if np.isfinite(largest) else float("inf")

    def started(self, draws: Array) -> tuple[Array, Array]:
        """Indicated states at the start, shape (4, n), and canonical equipment errors, shape (6, n), of draws."""
        errors = np.ascontiguousarray((draws / ERROR_UNITS).T)
        errors[[1, 3]] /= self.truths[0, 0]  # arc lengths at the start radius, NASA TN D-1772, eq. (10)
        return self.truths[0][:, None] + errors[:4], errors[4:]

    def onto_truth(self, stretch: int, actual: Array, indicated: Array) -> tuple[Array, Array]:
        """Both states moved as one, so that the actual one is the truth where a stretch begins.

        Components come first, samples last; the actual state may be one for all. A skip magnifies an integrator's own
        drift off the truth, though not the difference that is wanted.
        """
        drift = self.truths[stretch].reshape((4,) + (1,) * (np.ndim(actual) - 1)) - actual
        moved = drift if np.ndim(drift) == np.ndim(indicated) else drift.reshape((4,) + (1,) * (np.ndim(indicated) - 1))
        return actual + drift, indicated + moved


def load(path: Path) -> Case:
    """A case from its file."""
    with np.load(path) as stored:
        known: dict[str, Any] = dict(stored)
    return Case(**known | {"number": int(known["number"])})


def outcomes(actual: Array, indicated: Array) -> Array:
    """Final navigation errors, shape (n, 4), SI, from canonical states whose components come first."""
    actual = actual.reshape((4,) + (1,) * (np.ndim(indicated) - np.ndim(actual)) + actual.shape[1:])
    return np.ascontiguousarray((indicated - actual).T * OUTPUT_UNITS)
