"""Flexure of the structure between the unit and a sensor: second-order Gauss-Markov angles about the body's axes.

The sensor, at the end of the lever arm L, is turned by the small rotation vector q of the flexure, and so is the arm:
it measures the attitude of axes turned by q, and the velocity of a place ``q x L`` away. Each angle is stationary from
the start of navigation and obeys ::

    q'' + 2 z w q' + w^2 q = white noise        E[q(t) q(t + s)] = sigma^2 e^(-a s) (cos(b s) + a sin(b s) / b)

with the natural frequency w, the damping ratio z of at most 1, ``a = z w`` and ``b = w sqrt(1 - z^2)``; the rate q' has
the sigma ``w sigma`` and is independent of the angle of the same instant. With z = 1 the correlation is 1/e after
2.146 / w (Gelb 1974, *Applied Optimal Estimation*, table 2.2-1).

Beside the natural states (q, q'), recursions have states s that only decay ::

    q = e1 . B(t) s      (q' + a q) / w = e2 . B(t) s        B(t) = [[cos bt, w sin(bt) / b], [-b sin(bt) / w, cos bt]]

where t is the time since the start: over a duration T they keep ``e^(-a T)`` of their values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.instruments import AXES

OF_CRITICAL_DAMPING: Final = 2.146193220620583
"""Product of frequency and correlation time with a damping of 1: ``(1 + x) e^-x = 1/e``."""

MOST_TURNS: Final = 1e3
"""Largest element of B(t): rounding grows by its square. With 250 it is 6e-11 of a variance of navigation."""


@dataclass(frozen=True)
class Flexure:
    """Flexure of the structure between the unit and a sensor.

    Attributes
    ----------
    sigma : tuple of float
        Of the angles about the body's x, y and z axes, rad; zero for none.
    frequency : float
        Natural frequency w, rad/s.
    damping : float
        Damping ratio, above zero and at most 1.
    """

    sigma: tuple[float, float, float]
    frequency: float
    damping: float

    @property
    def axes(self) -> tuple[int, ...]:
        """Numbers of the axes about which it bends."""
        return tuple(axis for axis, size in enumerate(self.sigma) if size > 0.0)

    @property
    def decay_rate(self) -> float:
        """The rate a, 1/s."""
        return self.damping * self.frequency

    @property
    def _turning(self) -> float:
        """The frequency b, rad/s."""
        return self.frequency * float(np.sqrt((1.0 - self.damping) * (1.0 + self.damping)))

    def most_turns(self, duration: float) -> float:
        """Return the largest element of B(t) up to a duration, s: `MOST_TURNS` at most can be handled."""
        turning = self._turning
        return self.frequency * min(duration, 1.0 / turning if turning > 0.0 else np.inf)

    def natural(self, times: Array) -> Array:
        """Compute the angle and its rate from s, at times since the start: shape (n, 2, 2)."""
        b = self._basis(times)
        b[:, 1] = self.frequency * b[:, 1] - self.decay_rate * b[:, 0]
        return b

    def _basis(self, times: Array) -> Array:
        """Compute B(t), shape (n, 2, 2)."""
        turning = self._turning
        cosine, sine = np.cos(turning * times), times * np.sinc(turning * times / np.pi)
        across = np.stack([self.frequency * sine, -(turning**2) * sine / self.frequency])
        return np.moveaxis(np.array([[cosine, across[0]], [across[1], cosine]]), -1, 0)

    def covariance(self, times: Array) -> Array:
        """Compute the covariance of s for sigma one, at times since the start: shape (n, 2, 2)."""
        inverse = self._basis(-times)
        return np.asarray(inverse @ self._stationary @ inverse.swapaxes(1, 2))

    @property
    def _stationary(self) -> Array:
        """Covariance of q and (q' + a q) / w for sigma one."""
        z = self.damping
        return np.array([[1.0, z], [z, 1.0 + z**2]])

    def decay(self, durations: Array) -> Array:
        """Compute what is left of s after durations, s."""
        return np.asarray(np.exp(-self.decay_rate * durations))

    def noise(self, times: Array) -> Array:
        """Compute the covariance that is added to s for sigma one, from time to time: shape (n - 1, 2, 2)."""
        covariance = self.covariance(times)
        return np.asarray(covariance[1:] - (self.decay(np.diff(times)) ** 2)[:, None, None] * covariance[:-1])

    def transitions(self, durations: Array) -> Array:
        """Compute the transitions of the angle and its rate over durations, shape (n, 2, 2)."""
        start = np.linalg.inv(self.natural(np.zeros(1)))
        return np.asarray(self.decay(durations)[:, None, None] * self.natural(durations) @ start)

    def added(self, durations: Array) -> Array:
        """Compute the covariance that durations add to the angle and its rate for sigma one, shape (n, 2, 2)."""
        stationary, over = np.diag([1.0, self.frequency**2]), self.transitions(durations)
        return np.asarray(stationary - over @ stationary @ over.swapaxes(1, 2))

    def draw(self, times: Array, variates: Array) -> Array:
        """Compute angles and rates about the three axes at rising instants from standard normals.

        Parameters
        ----------
        times : ndarray, shape (n,)
            s; the process is stationary at the first.
        variates : ndarray, shape (n, ..., 3, 2)

        Returns
        -------
        ndarray, shape (n, ..., 3, 2)
            rad and rad/s.
        """
        over, roots = self.drawn_steps(times)
        drawn = np.empty_like(variates)
        drawn[:1] = variates[:1]
        for step in range(len(times) - 1):
            drawn[step + 1] = drawn[step] @ over[step].T + variates[step + 1] @ roots[step].T
        return np.asarray(drawn * self.sizes)

    @property
    def sizes(self) -> Array:
        """Sigmas of angles and rates about the three axes, shape (3, 2)."""
        return np.outer(self.sigma, [1.0, self.frequency])

    def drawn_steps(self, times: Array) -> tuple[Array, Array]:
        """Return transitions, and roots of what is added, of angles and rates in their sigmas: shapes (n - 1, 2, 2)."""
        scale, durations = np.array([1.0, self.frequency]), np.diff(times)
        over = self.transitions(durations) * scale / scale[:, None]
        values, vectors = np.linalg.eigh(self.added(durations) / np.outer(scale, scale))
        return over, vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]


@dataclass(frozen=True)
class FlexureState:
    """A state of a filter that is an angle of a flexure, or its rate, about one axis."""

    sensor: str
    flexure: Flexure
    axis: int
    rate: bool

    @property
    def process(self) -> str:
        """Name of the process that it is a state of."""
        return flexure_process(self.sensor, self.axis)

    @property
    def name(self) -> str:
        """Name of the state."""
        return f"{self.sensor}_flexure_rate_{AXES[self.axis]}" if self.rate else self.process

    @property
    def sigma(self) -> float:
        """Stationary standard deviation, rad or rad/s."""
        return self.flexure.sigma[self.axis] * (self.flexure.frequency if self.rate else 1.0)


def flexure_process(sensor: str, axis: int) -> str:
    """Return the name of the process of a sensor about an axis.

    >>> flexure_process("master", 2)
    'master_flexure_z'
    """
    return f"{sensor}_flexure_{AXES[axis]}"
