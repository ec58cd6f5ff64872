"""What every peer is given: readings of perfect instruments, sizes of errors, and reference samples with their noise.

Instruments are read at 100 Hz. Noise is constant between readings, so that the same noise can be given to all: to the
reference engine as what it adds to its steps, to peers as what it adds to increments, to mcnav's ensemble as what it
adds to the deviations over a step. A peer returns states, whose navigation errors are those against its own states
without errors and noise: what its gravity and its integration leave of the truth, the same with and without errors,
does not count.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, indicated_state, navigation_errors

READING: Final = 0.01
"""Interval between readings, s."""

SEED: Final = 1963

PLACES: Final = {"position": slice(0, 3), "velocity": slice(3, 6), "axes": slice(6, 15)}
"""Numbers of a state that a peer returns: position, velocity, axes by rows, all earth-fixed."""


@dataclass(frozen=True)
class Samples:
    """Constant errors and noise of n samples.

    Attributes
    ----------
    initial : ndarray, shape (n, 9)
        Navigation errors at the start.
    biases : ndarray, shape (n, 6)
        Of gyros, rad/s, and accelerometers, m/s^2.
    increments : ndarray, shape (n, K, 6)
        What noise adds to the increments of rotation and velocity; with no rows the peer draws it.
    measurements : ndarray, shape (n, U, 6)
        Errors of position and velocity, north, east, down; with no rows the peer draws them.
    """

    initial: Array
    biases: Array
    increments: Array
    measurements: Array

    def __len__(self) -> int:
        return len(self.initial)

    def __getitem__(self, rows: slice) -> Samples:
        return Samples(self.initial[rows], self.biases[rows], self.increments[rows], self.measurements[rows])

    @property
    def given(self) -> bool:
        """Whether noise is given."""
        return bool(self.increments.shape[1])


@dataclass(frozen=True)
class Case:
    """The flight as instruments feel it.

    Attributes
    ----------
    campaign : str
        File of the campaign.
    start : float
        s.
    increments : ndarray, shape (K, 6)
        Rotation and velocity between readings of perfect instruments.
    first : ndarray, shape (15,)
        True state at the start, see `PLACES`.
    updates : ndarray of int, shape (U,)
        Numbers of readings after which there is an update.
    measured : ndarray, shape (U, 15)
        True states there.
    epochs : ndarray of int, shape (m,)
        Numbers of readings, all of them updates too, after which states are returned.
    sigma : ndarray, shape (m, 9)
        The filter's own sigmas of the navigation errors along the truth.
    initial : ndarray, shape (9,)
        Sigmas of the initial errors.
    biases, noise : ndarray, shape (6,)
        Sigmas of the biases; densities of white noise, rad/sqrt(s) and m/s/sqrt(s).
    measurement : ndarray, shape (6,)
        Sigmas of the measurements.
    reference : ndarray, shape (n, m, 9)
        Navigation errors of the first n samples on the reference engine.
    reference_initial, reference_biases, reference_increments, reference_measurements : ndarray
        These samples, as `Samples` has them.
    """

    campaign: str
    start: float
    increments: Array
    first: Array
    updates: Array
    measured: Array
    epochs: Array
    sigma: Array
    initial: Array
    biases: Array
    noise: Array
    measurement: Array
    reference: Array
    reference_initial: Array
    reference_biases: Array
    reference_increments: Array
    reference_measurements: Array

    @property
    def seconds(self) -> float:
        """Duration of the flight, s."""
        return len(self.increments) * READING

    @property
    def compared(self) -> Samples:
        """Samples of the reference engine, with their noise."""
        return Samples(
            self.reference_initial, self.reference_biases, self.reference_increments, self.reference_measurements
        )

    @property
    def quiet(self) -> Samples:
        """One sample without errors and noise."""
        increments, measurements = np.zeros((1, *self.increments.shape)), np.zeros((1, len(self.updates), 6))
        return Samples(np.zeros((1, 9)), np.zeros((1, 6)), increments, measurements)

    def drawn(self, count: int) -> Samples:
        """Draw constant errors of samples whose noise peers draw themselves."""
        generator = np.random.default_rng(SEED)
        initial = generator.standard_normal((count, 9)) * self.initial
        biases = generator.standard_normal((count, 6)) * self.biases
        return Samples(initial, biases, np.zeros((count, 0, 6)), np.zeros((count, 0, 6)))

    def started(self, samples: Samples) -> Array:
        """Return the indicated states at the start, shape (n, 15)."""
        true = unpack(np.broadcast_to(self.first, (len(samples), 15)))
        return pack(indicated_state(WGS84, true, samples.initial))

    def errors(self, states: Array, quiet: Array) -> Array:
        """Return navigation errors, shape (n, m, 9), from a peer's states with and without errors and noise."""
        return np.stack([navigation_errors(WGS84, unpack(quiet), unpack(each)) for each in states])

    def apart(self, errors: Array) -> tuple[float, float]:
        """Return the largest and the root mean square difference from the reference, in the filter's sigmas."""
        shares = (errors - self.reference[: len(errors), : errors.shape[1]]) / self.sigma[: errors.shape[1]]
        if not np.isfinite(shares).all():
            return np.inf, np.inf
        return float(np.abs(shares).max()), float(np.sqrt(np.mean(shares**2)))

    def shortened(self, seconds: float) -> Case:
        """Return the first seconds of the flight."""
        readings = round(seconds / READING)
        epochs = self.epochs[self.epochs <= readings]
        updates = int(np.sum(self.updates <= readings))
        return Case(**asdict(self) | {
            "increments": self.increments[:readings], "updates": self.updates[:updates],
            "measured": self.measured[:updates], "epochs": epochs, "sigma": self.sigma[: len(epochs)],
            "reference": self.reference[:, : len(epochs)],
            "reference_increments": self.reference_increments[:, :readings],
            "reference_measurements": self.reference_measurements[:, :updates],
        })  # fmt: skip

    def save(self, path: Path) -> None:
        """Write to a file for `load`."""
        np.savez(path, **asdict(self))


def load(path: Path) -> Case:
    """Read a case from its file."""
    with np.load(path) as stored:
        known: dict[str, Any] = {field.name: stored[field.name] for field in fields(Case)}
    return Case(**known | {"start": float(known["start"]), "campaign": str(known["campaign"])})


def unpack(states: Array) -> EarthFixedStates:
    """Arrange states, shape (n, 15), for mcnav's functions."""
    axes = states[:, PLACES["axes"]].reshape(-1, 3, 3)
    return EarthFixedStates(states[:, PLACES["position"]], states[:, PLACES["velocity"]], axes)


def pack(states: EarthFixedStates) -> Array:
    """Arrange mcnav's states in rows, shape (n, 15)."""
    return np.hstack([states.position, states.velocity, states.axes.reshape(-1, 9)])
