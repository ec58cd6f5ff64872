"""States of a reference between its instants, and the errors of a navigator against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedTrack
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.reference.mechanization import matrices
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, navigation_errors

LONGEST_GAP: Final = 2.0
"""Longest time between two instants of a reference that is bridged, s."""


@dataclass(frozen=True)
class ReferenceStates:
    """A reference, interpolated: cubic splines of the position and the velocity, and turns at constant rates.

    Attributes
    ----------
    position, velocity : callable
        Earth-fixed, of time; velocity none where the reference has none.
    attitude : callable or None
        From the body's to local axes.
    """

    earth: Earth
    track: RecordedTrack
    position: Any
    velocity: Any
    attitude: Any

    @classmethod
    def of(cls, earth: Earth, track: RecordedTrack | None) -> ReferenceStates | None:
        """Prepare a reference; none without one."""
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation, Slerp

        if track is None or len(track.times) < 4:
            return None
        position = CubicSpline(track.times, earth.from_geodetic(*track.position.T))
        velocity = None if track.velocity is None else CubicSpline(track.times, track.velocity)
        attitude = None
        if track.attitude is not None:
            attitude = Slerp(track.times, Rotation.from_euler("ZYX", track.attitude[:, ::-1]))
        return cls(earth, track, position, velocity, attitude)

    def compare(self, time: float, state: Array) -> tuple[Array, Array] | None:
        """Compute the errors of a navigator's state, shape (9,), NaN for what the reference lacks, and its variances.

        None where the reference does not reach, or has a gap.
        """
        times = self.track.times
        after = int(np.searchsorted(times, time))
        if after < len(times) and abs(times[after] - time) <= 1e-6:
            after += after == 0
        if not 0 < after < len(times) or times[after] - times[after - 1] > LONGEST_GAP:
            return None
        position = np.asarray(self.position(time))
        latitude, longitude, _ = self.earth.to_geodetic(position[None])[0]
        level = local_axes(latitude, longitude)
        axes = matrices(state[None, :4])
        velocity = np.zeros(3) if self.velocity is None else level @ self.velocity(time)
        true_axes = axes[0] if self.attitude is None else level @ self.attitude(time).as_matrix()
        true = EarthFixedStates(position[None], velocity[None], true_axes[None])
        indicated = EarthFixedStates(state[None, 7:], state[None, 4:7], axes)
        errors = navigation_errors(self.earth, true, indicated)[0]
        errors[3:6] = np.nan if self.velocity is None else errors[3:6]
        errors[6:9] = np.nan if self.attitude is None else errors[6:9]
        return errors, self._variances(time)

    def _variances(self, time: float) -> Array:
        """Interpolate the reference's variances, shape (9,); none are stated of its attitude."""
        variances = np.zeros(9)
        for place, sigma in ((slice(0, 3), self.track.position_sigma), (slice(3, 6), self.track.velocity_sigma)):
            if sigma is not None:
                variances[place] = [np.interp(time, self.track.times, column**2) for column in sigma.T]
        return variances
