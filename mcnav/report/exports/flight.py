"""The flight of a run in space: the true and one navigated position over time, and the covariance of its error.

Positions are in earth-fixed axes. Runs with latitude and longitude are placed by WGS 84. Others have axes of their own,
which are placed at latitude and longitude zero: north, east and down of a loop, range (eastwards) and altitude of a
plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.errors import RunFolderError
from mcnav.physics.units import conversion
from mcnav.store.run_folder import RunFolder

AXIS, FLATTENING = 6_378_137.0, 1.0 / 298.257223563
"""WGS 84: equatorial radius, m, and flattening."""

GEODETIC: Final = ("latitude", "longitude", "altitude")
LOCAL: Final = ("position_north", "position_east", "position_down")
PLANE: Final = ("range", "altitude")
"""Positions that a flight may have; errors of the first are along `LOCAL`."""


@dataclass(frozen=True)
class Flight:
    """True and navigated positions.

    Attributes
    ----------
    name : str
        Of the campaign.
    times : ndarray, shape (n,)
        s.
    true : ndarray, shape (n, 3)
        Nominal position in earth-fixed axes, m.
    error : ndarray, shape (n, 3)
        Navigated less true position of sample ``sample``, m.
    covariance : ndarray, shape (n, 3, 3)
        Of the position errors of all stored samples, Monte Carlo, m².
    axes : ndarray, shape (3, 3)
        Rows: east, north and up at the first position.
    sample, samples : int
        Number of the navigated sample, and of those that the covariance is of.
    """

    name: str
    times: Array
    true: Array
    error: Array
    covariance: Array
    axes: Array
    sample: int
    samples: int

    @property
    def navigated(self) -> Array:
        """Navigated position in earth-fixed axes, m, shape (n, 3)."""
        return self.true + self.error

    def local(self, vectors: Array) -> Array:
        """Return earth-fixed vectors, shape (..., 3), along east, north and up at the first position."""
        return np.asarray(vectors @ self.axes.T)

    @property
    def ellipsoids(self) -> tuple[Array, Array]:
        """Semi-axes at one sigma, m, shape (n, 3), and their directions as columns, shape (n, 3, 3), without jumps.

        Eigenvectors are matched with those of the time before, so that a viewer may interpolate.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        for k in range(len(values)):
            if k:
                likeness = vectors[k - 1].T @ vectors[k]
                order = _matched(np.abs(likeness))
                signs = np.where(likeness[range(3), order] < 0.0, -1.0, 1.0)
                values[k], vectors[k] = values[k, order], vectors[k][:, order] * signs
            if np.linalg.det(vectors[k]) < 0.0:
                vectors[k][:, 2] *= -1.0
        return np.sqrt(np.maximum(values, 0.0)), vectors


def _matched(likeness: Array) -> list[int]:
    """Return for each earlier axis the present one that is most like it, each once, the surest first."""
    order, left = [0, 0, 0], likeness.copy()
    for _ in range(3):
        earlier, present = np.unravel_index(int(np.argmax(left)), left.shape)
        order[int(earlier)] = int(present)
        left[earlier, :] = left[:, present] = -1.0
    return order


def flight_of(folder: RunFolder, sample: int = 0) -> Flight:
    """Read the flight of a run.

    Parameters
    ----------
    sample : int
        Row of the stored histories that is the navigated flight.

    Raises
    ------
    RunFolderError
        When the run has no histories, or no position in space.
    """
    stored, history = folder.histories(1_000_000_000), folder.history()
    if stored is None or not history.columns:
        raise RunFolderError(f'{folder.path}: has no histories of samples; run it with store = "samples"')
    label, times, errors = stored
    seconds = times * conversion(label.rpartition("[")[2].removesuffix("]"), "s")
    nominal = _columns(history.columns, times)
    own = {name.partition(" [")[0]: values for name, values in errors.items()}
    if set(GEODETIC) <= nominal.keys() and set(LOCAL) <= own.keys():
        latitude, longitude, altitude = (nominal[name] for name in GEODETIC)
        true, axes = _earth_fixed(latitude, longitude, altitude), _axes(latitude, longitude)
        local = np.stack([own["position_east"], own["position_north"], -own["position_down"]], axis=-1)
    elif set(LOCAL) <= nominal.keys() and set(LOCAL) <= own.keys():
        axes = np.broadcast_to(_axes(np.zeros(1), np.zeros(1)), (len(times), 3, 3))
        offsets = np.stack([nominal["position_east"], nominal["position_north"], -nominal["position_down"]], axis=-1)
        true = _earth_fixed(*np.zeros((3, 1))) + offsets @ axes[0]
        local = np.stack([own["position_east"], own["position_north"], -own["position_down"]], axis=-1)
    elif set(PLANE) <= nominal.keys() and set(PLANE) <= own.keys():
        longitude, still = nominal["range"] / AXIS, np.zeros(len(times))
        true, axes = _earth_fixed(still, longitude, nominal["altitude"]), _axes(still, longitude)
        local = np.stack([own["range"], np.zeros_like(own["range"]), own["altitude"]], axis=-1)
    else:
        raise RunFolderError(
            f"{folder.path}: has no position in space; expected latitude and longitude, position north, east and "
            "down, or range and altitude, with their errors"
        )
    known = np.asarray(np.isfinite(local).all(axis=(1, 2)))
    if not known[sample : sample + 1].any():
        raise RunFolderError(f"{folder.path}: sample {sample} failed or is not stored; choose another one")
    turned = np.einsum("nij,sni->snj", axes, local[known])
    centred = turned - turned.mean(axis=0)
    covariance = np.einsum("sni,snj->nij", centred, centred) / max(len(turned) - 1, 1)
    error = np.einsum("nij,ni->nj", axes, local[sample])
    return Flight(str(folder.summary()["campaign"]), seconds, true, error, covariance, axes[0], sample, len(turned))


def _columns(columns: Mapping[str, Array], times: Array) -> dict[str, Array]:
    """Interpolate the columns of a history to other times, SI, by names as outputs have them."""
    (_, own), *others = columns.items()
    return {
        name.partition(" [")[0].replace(" ", "_"): np.interp(times, own, values) * _si(name)
        for name, values in others
    }  # fmt: skip


def _si(column: str) -> float:
    unit = column.rpartition("[")[2].removesuffix("]").replace("^2", "²")
    return {"km": 1e3, "deg": np.pi / 180.0}.get(unit, 1.0)


def _earth_fixed(latitude: Array, longitude: Array, altitude: Array) -> Array:
    """Return earth-fixed positions on WGS 84, shape (n, 3)."""
    square = FLATTENING * (2.0 - FLATTENING)
    normal = AXIS / np.sqrt(1.0 - square * np.sin(latitude) ** 2)
    across = (normal + altitude) * np.cos(latitude)
    up = (normal * (1.0 - square) + altitude) * np.sin(latitude)
    return np.stack([across * np.cos(longitude), across * np.sin(longitude), up], axis=-1)


def _axes(latitude: Array, longitude: Array) -> Array:
    """Return east, north and up as rows, shape (n, 3, 3)."""
    sin_b, cos_b, sin_l, cos_l = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    zero = np.zeros_like(sin_b)
    rows = (
        (-sin_l, cos_l, zero),
        (-sin_b * cos_l, -sin_b * sin_l, cos_b),
        (cos_b * cos_l, cos_b * sin_l, sin_b),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions(directions: Array) -> Array:
    """Return the rotations whose columns are the axes of ellipsoids as quaternions, scalar last, without jumps."""
    from scipy.spatial.transform import Rotation  # slow to import

    found: Array = np.asarray(Rotation.from_matrix(directions).as_quat())
    for k in range(1, len(found)):
        if found[k] @ found[k - 1] < 0.0:
            found[k] *= -1.0
    return found


def timed(times: Array, values: Array) -> list[float]:
    """Return rows of time and values below each other, as CZML has them."""
    return [float(f"{value:.15g}") for value in np.column_stack([times, values]).ravel()]
