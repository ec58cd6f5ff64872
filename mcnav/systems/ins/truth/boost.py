"""A ballistic boost: vertical rise, pitch-over, gravity turn, and free flight after the last stage.

A point moves in inertial axes under gravitation and thrust; there is no air. Thrust acts along the body. The body rises
vertically, pitches over by a kick, keeps that pitch until its velocity over the earth has come down to it, and then
follows the velocity (gravity turn), after the last stage as well. The azimuth of rise and kick is that of launch.

With constant thrust and mass flow the acceleration a of a stage rises from its first to its last value as
``1 / a = (1 - s) / a_first + s / a_last`` with s the share of its burning time. It sets in and ends within `RAMP`. On
the pad it grows out of the force that supports the vehicle, so that the specific force has no jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Final, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.numerics.integration import integrate
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.truth.quintic import LONGEST_STEP, earth_fixed_quintic, row_times
from mcnav.systems.ins.truth.segments import blend
from mcnav.systems.ins.truth.trajectory import Truth

RAMP: Final = 1.0
"""Time in which thrust sets in and ends, s; within it the force between rows is right to 1e-3 m/s^2."""

POWERED_STEP: Final = 1.0
"""Longest step between rows while a stage burns, s: where the gravity turn sets in, the body departs from the thrust by
half a milliradian between rows, and elsewhere by less than a hundredth of that."""

TOLERANCES: Final = (1e-12, np.array([1e-5, 1e-5, 1e-5, 1e-8, 1e-8, 1e-8]))
"""Relative, and absolute for inertial position and velocity: m, m/s."""

LONGEST_INTEGRATION: Final = 4.0
"""Longest step of the integration, s: within longer ones its interpolation of the velocity would show in the force."""

Law = Literal["pitch", "velocity"]
"""Guidance of the body: the pitch program, or its velocity over the earth."""


class BoostError(ValueError):
    """A boost that cannot be flown; ``key`` names the entry that would have to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


@dataclass(frozen=True)
class Stage:
    """A stage: thrust acceleration at its beginning and end, m/s^2, burning time and the pause before it, s."""

    first: float
    last: float
    burn: float
    pause: float = 0.0


@dataclass(frozen=True)
class Boost:
    """A launch.

    Attributes
    ----------
    latitude, longitude, azimuth : float
        rad.
    altitude : float
        m.
    stages : tuple of Stage
    rise : float
        Duration of the vertical rise, s.
    kick : float
        Angle of the pitch-over, rad.
    kick_time : float
        Its duration, s.
    coast : float
        Free flight after the last stage, s; it ends earlier where the vehicle would fall below its launch site.
    """

    latitude: float
    longitude: float
    azimuth: float
    stages: tuple[Stage, ...]
    altitude: float = 0.0
    rise: float = 10.0
    kick: float = float(np.radians(3.0))
    kick_time: float = 10.0
    coast: float = 0.0

    @property
    def ignitions(self) -> list[float]:
        """Instants of ignition, s from launch."""
        ignitions, time = [], 0.0
        for stage in self.stages:
            ignitions.append(time + stage.pause)
            time = ignitions[-1] + stage.burn
        return ignitions

    @property
    def cutoff(self) -> float:
        """End of the last stage, s from launch."""
        return self.ignitions[-1] + self.stages[-1].burn

    def thrust(self, time: float, support: float) -> float:
        """Compute the thrust acceleration, m/s^2; ``support`` is the specific force on the pad."""
        for number, (stage, ignition) in enumerate(zip(self.stages, self.ignitions, strict=True)):
            elapsed = time - ignition
            if 0.0 <= elapsed <= stage.burn:
                share = elapsed / stage.burn
                size = 1.0 / ((1.0 - share) / stage.first + share / stage.last)
                before = support if number == 0 else 0.0
                onset, end = (
                    float(blend(np.array(min(duration / RAMP, 1.0)))) for duration in (elapsed, stage.burn - elapsed)
                )
                return (before + (size - before) * onset) * end
        return 0.0

    def pitch(self, time: float) -> float:
        """Compute the pitch of the program, rad."""
        share = np.clip((time - self.rise) / self.kick_time, 0.0, 1.0)
        return float(np.pi / 2.0 - self.kick * blend(share))

    def breaks(self) -> list[float]:
        """Return the instants at which the derivative of the force may jump, s from launch."""
        times = {0.0, self.rise, self.rise + self.kick_time, self.cutoff + self.coast}
        for stage, ignition in zip(self.stages, self.ignitions, strict=True):
            times |= {ignition, ignition + RAMP, ignition + stage.burn - RAMP, ignition + stage.burn}
        return sorted(times)


@dataclass(frozen=True)
class Flown:
    """A phase of the integrated motion with one law."""

    law: Law
    start: float
    end: float
    solution: Any


@dataclass(frozen=True)
class Launch:
    """A boost on an earth."""

    boost: Boost
    earth: Earth

    @property
    def site(self) -> Array:
        """Earth-fixed position of the launch site, shape (3,)."""
        boost = self.boost
        place = (np.array(coordinate) for coordinate in (boost.latitude, boost.longitude, boost.altitude))
        return self.earth.from_geodetic(*place)

    @property
    def spin(self) -> Array:
        """Rotation of the earth, rad/s, shape (3,)."""
        return np.array([0.0, 0.0, self.earth.rotation_rate])

    @property
    def support(self) -> float:
        """Specific force on the pad, m/s^2."""
        return float(np.linalg.norm(self._weight(self.site)))

    def _weight(self, position: Array) -> Array:
        carried = np.cross(self.spin, np.cross(self.spin, position))
        return np.asarray(self.earth.gravitation(position[None])[0] - carried)

    def body(self, time: float, state: Array, law: Law) -> Array:
        """Compute the direction of the body in inertial axes, shape (3,)."""
        if law == "velocity":
            relative = state[3:] - np.cross(self.spin, state[:3])
            return np.asarray(relative / np.linalg.norm(relative))
        north, east, down = self._local(time, state[:3]).T
        pitch, azimuth = self.boost.pitch(time), self.boost.azimuth
        level = np.cos(azimuth) * north + np.sin(azimuth) * east
        return np.asarray(np.cos(pitch) * level - np.sin(pitch) * down)

    def _local(self, time: float, position: Array) -> Array:
        """Compute the matrix from north, east, down to inertial axes at an inertial position."""
        turned = self.earth.turned(np.array(time))
        latitude, longitude, _ = self.earth.to_geodetic((turned.T @ position)[None])[0]
        return np.asarray(turned @ local_axes(latitude, longitude))

    def rates(self, time: float, state: Array, law: Law) -> Array:
        """Compute the rates of inertial position and velocity, shape (6,)."""
        size = self.boost.thrust(time, self.support)
        acceleration = self.earth.gravitation(state[None, :3])[0]
        if size > 0.0:
            acceleration = acceleration + size * self.body(time, state, law)
        return np.concatenate([state[3:], acceleration])

    def above_pitch(self, time: float, state: Array, law: Law) -> float:
        """Compute the sine of the velocity's angle above the horizon less that of the pitch."""
        relative = state[3:] - np.cross(self.spin, state[:3])
        up = -self._local(time, state[:3])[:, 2]
        return float(relative @ up / max(float(np.linalg.norm(relative)), 1e-9) - np.sin(self.boost.pitch(time)))

    def below_site(self, time: float, state: Array, law: Law) -> float:
        """Compute the height above the launch site, m."""
        return float(self.earth.to_geodetic(state[None, :3])[0, 2]) - self.boost.altitude

    def fly(self) -> list[Flown]:
        """Integrate the motion from launch to its end.

        Raises
        ------
        BoostError
            When the vehicle does not lift off, or does not begin its gravity turn before the last stage ends.
        """
        boost, state = self.boost, np.concatenate([self.site, np.cross(self.spin, self.site)])
        if boost.stages[0].first <= self.support:
            raise BoostError("stages #1.acceleration", f"is too small to lift off; gravity is {self.support:.4g} m/s^2")
        turning, phases = boost.rise + boost.kick_time, list[Flown]()
        law: Law = "pitch"
        for begin, end in pairwise(boost.breaks()):
            while begin < end:
                kicked = law == "pitch" and begin >= turning
                integrated = self._integrated(law, begin, end, state, kicked)
                time = float(integrated.t[-1])
                phases.append(Flown(law, begin, time, integrated.sol))
                state = np.asarray(integrated.sol(time))
                if integrated.status == 1 and not kicked:
                    return phases  # down again
                law, begin = "velocity" if integrated.status == 1 else law, time
            if law == "pitch" and end >= boost.cutoff:
                message = "the velocity does not come down to the pitch before the last stage ends; kick less"
                raise BoostError("kick", message)
        return phases

    def _integrated(self, law: Law, begin: float, end: float, state: Array, kicked: bool) -> Any:
        """Integrate a phase, until the velocity has come down to the pitch or the vehicle to its launch site."""

        def event(time: float, state: Array, law: Law) -> float:
            return self.above_pitch(time, state, law) if kicked else self.below_site(time, state, law)

        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -1.0  # type: ignore[attr-defined]
        if kicked and event(begin, state, law) <= 0.0:
            raise BoostError("kick", "the velocity is below the pitch after it; kick faster")
        options: dict[str, Any] = {"dense_output": True, "max_step": LONGEST_INTEGRATION}
        options["events"] = event if begin > 0.0 else None  # at launch it stands on the site
        return integrate(self.rates, (begin, end), state, TOLERANCES, (law,), **options)

    def motion(self, phase: Flown, time: float) -> Array:
        """Compute inertial position, velocity and acceleration in a phase, shape (3, 3)."""
        state = np.asarray(phase.solution(time), dtype=float)
        return np.stack([state[:3], state[3:], self.rates(time, state, phase.law)[3:]])


def boost_truth(boost: Boost, earth: Earth) -> Truth:
    """Fly a boost.

    Positions are quintic between rows, which include every instant at which the derivative of the force jumps. The
    body's right axis is horizontal, so that a vertical body has its belly towards the azimuth.

    Raises
    ------
    BoostError
        When it cannot be flown.
    """
    from scipy.spatial.transform import Rotation, RotationSpline

    launch = Launch(boost, earth)
    phases = launch.fly()
    rows = [(phases[0], phases[0].start)]
    for phase in phases:
        longest = LONGEST_STEP if phase.start >= boost.cutoff else POWERED_STEP
        ends = row_times(partial(launch.motion, phase), phase.start, phase.end, longest)
        rows += [(phase, time) for time in ends]
    times = np.array([time for _, time in rows])
    motions = np.array([launch.motion(phase, time) for phase, time in rows])
    bodies = [
        launch.body(time, np.concatenate(motion[:2]), phase.law)
        for (phase, time), motion in zip(rows, motions, strict=True)
    ]
    to_inertial = earth.turned(times)
    quintic = earth_fixed_quintic(earth, times, motions)
    forward = np.einsum("nji,nj->ni", to_inertial, np.array(bodies))
    places = earth.to_geodetic(quintic(times))
    north, east, down = local_axes(places[:, 0], places[:, 1]).transpose(2, 0, 1)
    ahead = np.cos(boost.azimuth) * north + np.sin(boost.azimuth) * east
    # right of the azimuth where the body is vertical, and nearly so everywhere: both are horizontal
    upright = np.abs(np.einsum("ni,ni->n", forward, down)) > 1.0 - 1e-12
    right = np.cross(down, np.where(upright[:, None], ahead, forward))
    right /= np.linalg.norm(right, axis=1)[:, None]
    axes = np.stack([forward, right, np.cross(forward, right)], axis=2)
    return Truth(earth, times, quintic, RotationSpline(times, Rotation.from_matrix(axes)))
