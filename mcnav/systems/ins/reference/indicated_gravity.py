"""Gravity disturbances as a navigator's filter has them: along its indicated trajectory, in earth-fixed axes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel, FilterSteps, GravityStates
from mcnav.systems.ins.reference.normal_field import normal_gravitation_at


@dataclass(frozen=True)
class IndicatedGravity:
    """Gravity disturbances that are states of a filter, g of them, over n steps of the navigator.

    Attributes
    ----------
    states : GravityStates
    pulls : ndarray, shape (n, 3, g)
        Responses of dv' in the middles of the steps: ``g`` north for xi, ``g`` east for eta, -1 down for the anomaly.
    speed : ndarray, shape (n,)
        Indicated speed over the earth, m/s.
    durations : ndarray, shape (n,)
        s.
    """

    states: GravityStates
    pulls: Array
    speed: Array
    durations: Array

    @classmethod
    def along(
        cls, earth: Earth, gravitation: Array, states: GravityStates, indicated: Array, durations: Array
    ) -> IndicatedGravity:
        """Evaluate indicated states, shape (n + 1, 10), at the ends of the steps, with constants of the gravitation."""
        position = 0.5 * (indicated[1:, 7:] + indicated[:-1, 7:])
        gravity = normal_gravitation_at(gravitation, position)
        gravity[:, :2] += earth.rotation_rate**2 * position[:, :2]
        size = np.linalg.norm(gravity, axis=1)
        latitude, longitude, _ = earth.to_geodetic(position).T
        level = local_axes(latitude, longitude)
        pulls = np.stack([size[:, None] * level[:, :, 0], size[:, None] * level[:, :, 1], -level[:, :, 2]], axis=-1)
        ends = np.linalg.norm(indicated[:, 4:7], axis=1)
        return cls(states, pulls[:, :, states.disturbances], 0.5 * (ends[1:] + ends[:-1]), durations)

    def taken_by(self, steps: FilterSteps, model: ErrorModel) -> FilterSteps:
        """Return the filter's steps with the rates of decay at the indicated speed."""
        return replace(steps, rates=model.rates_at(steps.mean(self.speed)))

    def push(self, estimates: Array) -> Array:
        """Compute what estimates of all the filter's states at the beginning say of dv', shape (n, 3)."""
        after = np.cumsum(self.speed * self.durations)
        middles = after - 0.5 * self.speed * self.durations
        left = estimates[self.states.places] * np.exp(-middles[:, None] / self.states.lengths)
        return np.asarray(np.einsum("nig,ng->ni", self.pulls, left))
