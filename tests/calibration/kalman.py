"""A Kalman filter in closed loop, many samples at once, and its linear analysis.

Along each of three axes a position, a velocity and a constant bias of the acceleration, which is noisy; a fix of the
position each second. The filter estimates the bias, considers it (Schmidt), or neglects it. Errors of consecutive
epochs are correlated as those of a navigation are, and its gains are the same in every sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.quantities import Output
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.statistics.filter_sums import FilterMeans, FilterSums

AXES: Final = "xyz"
EPOCHS: Final = 20
"""Epochs after the start."""

UPDATES: Final = 3
"""Fixes between two epochs."""

INITIAL: Final = np.array([3.0, 0.5])
"""Initial sigmas of position, m, and velocity, m/s."""

ACCELERATION: Final = 0.1
"""Noise of the acceleration, m/s^2 in each second."""

FIX: Final = 3.0
"""Noise of a fix, m."""

STEP: Final = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
"""Transition of position, velocity and bias over a second."""

DRIVEN: Final = np.array([0.5, 1.0, 0.0])
"""Effect of the acceleration's noise in a second."""

OUTPUTS: Final = tuple(
    Output(f"{group}_{axis}", unit, unit) for group, unit in (("position", "m"), ("velocity", "m/s")) for axis in AXES
)


@dataclass(frozen=True)
class KalmanFilter:
    """A filter and the truth.

    Attributes
    ----------
    sigma, mean : ndarray, shape (3,)
        Of the true bias along each axis, m/s^2.
    believed : ndarray, shape (3,)
        Sigma of the bias that the filter believes in; zero neglects it.
    estimates : bool
        Whether the filter estimates the bias; if not, it considers what it believes.
    """

    sigma: Array
    mean: Array = field(default_factory=lambda: np.zeros(3))
    believed: Array = field(default_factory=lambda: np.zeros(3))
    estimates: bool = True

    @property
    def schema(self) -> FilterSchema:
        """Columns of the records."""
        considered = ("bias",) if self.believed.any() and not self.estimates else ()
        groups = {"all": 6, "navigation": 6, "position": 3, "velocity": 3}
        return FilterSchema(groups, outputs=6, sensors={"fix": 3}, considered=considered)

    def _filter(self) -> tuple[Array, Array, Array]:
        """Run the filter: covariances at the epochs, (m, 3, 3, 3), gains, (k, 3, 3), and innovation variances, (k, 3).

        The axis is the second index.
        """
        covariance = np.array([np.diag([*INITIAL**2, sigma**2]) for sigma in self.believed])
        noise = ACCELERATION**2 * np.outer(DRIVEN, DRIVEN)
        kept, gains, variances = [covariance], [], []
        for update in range(EPOCHS * UPDATES):
            covariance = STEP @ covariance @ STEP.T + noise
            variance = covariance[:, 0, 0] + FIX**2
            gain = covariance[:, :, 0] / variance[:, None]
            if not self.estimates:
                gain[:, 2] = 0.0
            left = np.eye(3) - gain[:, :, None] * np.array([1.0, 0.0, 0.0])
            covariance = left @ covariance @ left.swapaxes(1, 2) + FIX**2 * gain[:, :, None] * gain[:, None, :]
            gains.append(gain)
            variances.append(variance)
            if (update + 1) % UPDATES == 0:
                kept.append(covariance)
        return np.array(kept), np.array(gains), np.array(variances)

    def simulate(self, generator: np.random.Generator, count: int) -> FilterEvidence:
        """Simulate a campaign."""
        own, gains, variances = self._filter()
        schema = self.schema
        state = np.zeros((count, 3, 3))
        state[:, :, :2] = INITIAL * generator.standard_normal((count, 3, 2))
        state[:, :, 2] = self.mean + self.sigma * generator.standard_normal((count, 3))
        errors, records = np.empty((count, EPOCHS + 1, 6)), np.zeros((count, EPOCHS + 1, schema.width))
        inverse = np.linalg.inv(own[:, :, :2, :2])
        place, before = schema.places["sensor:fix"], np.zeros((count, 3))
        for epoch in range(EPOCHS + 1):
            for update in range((epoch - 1) * UPDATES, epoch * UPDATES) if epoch else ():
                driven = ACCELERATION * generator.standard_normal((count, 3))
                state = state @ STEP.T + driven[:, :, None] * DRIVEN
                innovation = state[:, :, 0] + FIX * generator.standard_normal((count, 3))
                state = state - gains[update] * innovation[:, :, None]
                white = innovation / np.sqrt(variances[update])
                lag = np.sum(white * before, axis=1) / 3.0
                numbers = np.stack([np.sum(white**2, axis=1), np.ones(count), np.zeros(count), lag], axis=1)
                records[:, epoch, place] += np.column_stack([numbers, np.full(count, float(update > 0))])
                before = white
            errors[:, epoch] = state[:, :, :2].swapaxes(1, 2).reshape(count, 6)
            self._record(records[:, epoch], state[:, :, :2], own[epoch, :, :2, :2], inverse[epoch])
        return FilterEvidence(
            "time [s]",
            np.arange(EPOCHS + 1.0) * UPDATES,
            OUTPUTS,
            FilterMeans.of(schema, FilterSums.of(schema, records)),
            MeanSquares.of(sum_powers_about_zero(errors)),
            failed=0,
            linear=self.linear,
        )

    def _record(self, record: Array, state: Array, own: Array, inverse: Array) -> None:
        """Write NEES, covariance and shares of one epoch, from errors, shape (n, 3, 2), and covariances by axis."""
        places = self.schema.places
        whole = np.einsum("nai,aij,naj->n", state, inverse, state)
        squares = state**2 / np.diagonal(own, axis1=1, axis2=2)
        parts = squares.sum(axis=1)
        record[:, places["nees"]] = np.column_stack([whole, whole, parts])
        record[:, places["covariance"]] = _outputs_covariance(own)[np.tril_indices(6)]
        ordered = squares.swapaxes(1, 2).reshape(len(state), 6)
        record[:, places["within_1"]], record[:, places["within_3"]] = ordered <= 1.0, ordered <= 9.0

    @property
    def linear(self) -> LinearFilter:
        """Linear analysis of filter and truth at the epochs: the same gains, the true sizes."""
        own, gains, _ = self._filter()
        about_zero = self.sigma**2 + self.mean**2
        true, partial = (
            np.array([np.diag([*INITIAL**2, each]) for each in about_zero]),
            np.tile([0.0, 0.0, 1.0], (3, 1)),
        )
        noise = ACCELERATION**2 * np.outer(DRIVEN, DRIVEN)
        kept, partials = [true], [partial]
        for update, gain in enumerate(gains):
            left = np.eye(3) - gain[:, :, None] * np.array([1.0, 0.0, 0.0])
            true = STEP @ true @ STEP.T + noise
            true = left @ true @ left.swapaxes(1, 2) + FIX**2 * gain[:, :, None] * gain[:, None, :]
            partial = (left @ STEP @ partial[:, :, None])[:, :, 0]
            if (update + 1) % UPDATES == 0:
                kept.append(true)
                partials.append(partial)
        squared = np.array(partials)[:, :, :2] ** 2
        contributions, squared_means, believed = {}, {}, {}
        for number, axis in enumerate(AXES):
            of_axis = np.zeros((len(squared), 2, 3))
            of_axis[:, :, number] = squared[:, number]
            contributions[f"bias_{axis}"] = self.sigma[number] ** 2 * of_axis.reshape(-1, 6)
            squared_means[f"bias_{axis}"] = self.mean[number] ** 2 * of_axis.reshape(-1, 6)
            believed[f"bias_{axis}"] = float(self.believed[number] ** 2 / (about_zero[number] or 1.0))
        matrices = (np.array([_outputs_covariance(each[:, :2, :2]) for each in kinds]) for kinds in (own, kept))
        filter_covariance, true_squares = matrices
        nothing = np.zeros((EPOCHS + 1, 0))
        return LinearFilter(filter_covariance, nothing, true_squares, nothing, contributions, believed, squared_means)


def _outputs_covariance(by_axis: Array) -> Array:
    """Arrange covariances of position and velocity of each axis, shape (3, 2, 2), as that of the outputs, (6, 6)."""
    outputs_covariance = np.zeros((2, 3, 2, 3))
    for axis in range(3):
        outputs_covariance[:, axis, :, axis] = by_axis[axis]
    return outputs_covariance.reshape(6, 6)
