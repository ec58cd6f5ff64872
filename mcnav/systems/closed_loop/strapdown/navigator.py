"""`Strapdown`: instruments with their errors, and the mechanization of their compensated readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import suggestion
from mcnav.systems.closed_loop.declarations import Attitude, GaussMarkov, Unit, White
from mcnav.systems.closed_loop.quantities import Values
from mcnav.systems.closed_loop.strapdown.planet_axes import PlanetAxes, turned
from mcnav.systems.ins import earth
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES
from mcnav.systems.ins.imu.readings import CROSS_PLACES, compensate, reading_errors
from mcnav.systems.ins.tables.imu import CONSTANTS
from mcnav.systems.ins.tables.imu_catalogue import units_of_values

MOON: Final = replace(earth.MOON, j2=None)
"""The moon as a sphere whose field is central."""

PLANETS: Final[Mapping[str, Earth]] = {"earth": WGS84, "moon": MOON}

WALKS: Final = {"gyro": "angle_random_walk", "accelerometer": "velocity_random_walk"}
INSTABILITY: Final = "bias_instability"


def constants_of(instrument: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return the kinds of constant errors of an instrument in their order, with units and axes.

    >>> list(constants_of("gyro"))[:2]
    ['gyro_bias', 'gyro_scale_factor']
    """
    units = units_of_values()[instrument]
    return {
        f"{instrument}_{key}": (units[key], CROSS_AXES if key == "misalignment" else AXES)
        for key in CONSTANTS
        if key in units
    }


INSTRUMENTS: Final = {instrument: constants_of(instrument) for instrument in WALKS}
ERRORS: Final = {name: unit for kinds in INSTRUMENTS.values() for name, unit in kinds.items()}
"""Kinds of constant errors, with units and axes."""

PROCESSES: Final[Mapping[str, White | GaussMarkov]] = {
    **{f"{each}_{walk}": White(units_of_values()[each][walk], AXES) for each, walk in WALKS.items()},
    **{f"{walk}_{INSTABILITY}": GaussMarkov(units_of_values()[walk]["bias"], AXES) for walk in WALKS},
}


@dataclass(frozen=True)
class Strapdown:
    """Strapdown inertial navigator of a `ClosedLoop`, its ``navigator``; ``[imu]`` of the campaign sizes its errors.

    It brings position, velocity and attitude to truth and estimate, the errors of the instruments to parameters and
    processes, what they read, and the mechanization. The class states what acts on the body: a method ``motion`` that
    returns ``force``, the specific force, and ``rate``, the inertial angular rate, both in body axes, shape (n, 3).

    Attributes
    ----------
    planet : str or Earth
        ``earth`` (WGS-84), ``moon``, or a figure with its field.
    site : tuple of float, optional
        Latitude and longitude, rad, and altitude, m, of an origin with the axes north, east and down. Without one, the
        origin is the planet's centre, and z its axis.
    axes : str
        ``fixed`` to the turning planet, or ``inertial``.
    estimates : sequence of str
        Errors of the instruments that the filter estimates besides position, velocity and attitude, such as
        ``gyro_bias`` (the constant one) and ``gyro_bias_instability``; what is estimated is compensated.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Strapdown("moon", estimates=("gyro_bias",)).axes
    'fixed'
    """

    planet: str | Earth = "earth"
    site: tuple[float, ...] | None = None
    axes: Literal["fixed", "inertial"] = "fixed"
    estimates: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Refuse what is unknown."""
        known = [*ERRORS, *(name for name, process in PROCESSES.items() if isinstance(process, GaussMarkov))]
        if not isinstance(self.planet, Earth) and self.planet not in PLANETS:
            raise ScenarioError(
                "type", f"navigator: planet {self.planet!r:.40}{suggestion(str(self.planet), list(PLANETS))}"
            )
        if self.axes not in ("fixed", "inertial"):
            raise ScenarioError("type", f"navigator: axes are 'fixed' or 'inertial'; got {self.axes!r:.40}")
        if isinstance(self.estimates, str):
            raise ScenarioError("type", f"navigator: estimates are several names; got {self.estimates!r:.40}")
        for name in self.estimates:
            if name not in known:
                raise ScenarioError("type", f"navigator: estimates {name!r:.60}{suggestion(str(name), known)}")
        if self.site is not None and (len(self.site) not in (2, 3) or not np.isfinite(self.site).all()):
            raise ScenarioError("type", f"navigator: site is latitude and longitude in rad; got {self.site!r:.60}")

    @cached_property
    def frame(self) -> PlanetAxes:
        """Axes of position and velocity."""
        planet = self.planet if isinstance(self.planet, Earth) else PLANETS[self.planet]
        site = None if self.site is None else (*map(float, self.site), 0.0)[:3]
        return PlanetAxes(planet, site, self.axes)  # type: ignore[arg-type]

    @cached_property
    def truth(self) -> dict[str, Unit]:
        """States that it brings to the truth."""
        names = self.frame.names
        return {"position": ("m", names), "velocity": ("m/s", names), "attitude": Attitude(axes=names)}

    @cached_property
    def estimate(self) -> dict[str, Unit]:
        """States that it brings to the estimate."""
        units = {**ERRORS, **{name: (process.unit, process.axes) for name, process in PROCESSES.items()}}
        return {**self.truth, **{name: units[name] for name in self.estimates}}

    @property
    def parameters(self) -> dict[str, Unit]:
        """Constant errors of the instruments."""
        return dict(ERRORS)

    @property
    def processes(self) -> dict[str, White | GaussMarkov]:
        """Noise of the instruments."""
        return dict(PROCESSES)

    def altitude(self, position: Array) -> Array:
        """Compute the altitude above the planet's figure, m, shape (n,), of ``position``, m, shape (n, 3)."""
        return self.frame.altitude(position)

    def fall(self, position: Array, velocity: Array) -> Array:
        """Compute gravity and Coriolis, m/s^2, of ``position``, m, and ``velocity``, m/s; shape (n, 3) each."""
        return self.frame.fall(position, velocity)

    @staticmethod
    def to_body(attitude: Array, vectors: Array) -> Array:
        """Turn ``vectors``, shape (n, 3), any unit, into body axes: ``C^T v`` of ``attitude``, shape (n, 3, 3)."""
        return turned(attitude.swapaxes(-1, -2), vectors)

    @staticmethod
    def from_body(attitude: Array, vectors: Array) -> Array:
        """Turn ``vectors``, shape (n, 3), any unit, from body axes: ``C v`` of ``attitude``, shape (n, 3, 3)."""
        return turned(attitude, vectors)

    def rates(self, truth: Any, force: Array, rate: Array) -> dict[str, Array]:
        """Compute the true rates, SI, of ``force``, m/s^2, and ``rate``, rad/s, in body axes, shape (n, 3) each.

        They are those of position and velocity, shape (n, 3), and of attitude, in its own form.
        """
        return self.frame.move(truth.position, truth.velocity, truth.attitude, force, rate)

    def sense(self, force: Array, rate: Array, parameters: Any, noise: Any) -> dict[str, Array]:
        """Compute what is read of the true ``force``, m/s^2, and ``rate``, rad/s, in body axes, shape (n, 3)."""
        gyro, accelerometer = self._responses_of(parameters, len(force))
        drift = noise.gyro_angle_random_walk + noise.gyro_bias_instability
        push = noise.accelerometer_velocity_random_walk + noise.accelerometer_bias_instability
        return {
            "rate": rate + reading_errors(rate[:, None], force[:, None], gyro)[:, 0] + drift,
            "force": force + reading_errors(force[:, None], (force**2)[:, None], accelerometer)[:, 0] + push,
        }

    def _responses_of(self, parameters: Any, count: int) -> tuple[Array, Array]:
        """Arrange the true constant errors, once for all derivatives of a step, whose parameters are the same object.

        A loop's cannot be changed.
        """
        if self._last and self._last[0] is parameters:
            known: tuple[Array, Array] = self._last[1]
            return known
        responses = _responses({name: getattr(parameters, name) for name in ERRORS}, count)
        self._last[:] = [parameters, responses] if isinstance(parameters, Values) else []
        return responses

    @cached_property
    def _last(self) -> list[Any]:
        return []

    def navigate(self, estimate: Any, sensed: Any) -> dict[str, Array]:
        """Compute the indicated rates, SI, from readings of shape (n, 3), compensated for what is estimated."""
        force, rate = sensed.force, sensed.rate
        if self.estimates:
            estimated = {name: getattr(estimate, name) for name in self.estimates}
            gyro, accelerometer = _responses(estimated, len(force))
            drift, push = (estimated.get(f"{walk}_{INSTABILITY}", np.zeros(3))[..., None, :] for walk in WALKS)
            rates, forces = compensate(rate[:, None], force[:, None], gyro, accelerometer, drift, push)
            force, rate = forces[:, 0], rates[:, 0]
        return self.frame.move(estimate.position, estimate.velocity, estimate.attitude, force, rate)


_PLACES: Final[Mapping[str, tuple[tuple[int, ...], int | tuple[int, ...]]]] = {
    "bias": ((0, 1, 2), 3), "scale_factor": ((0, 1, 2), (0, 1, 2)), "misalignment": CROSS_PLACES,
}  # fmt: skip
"""Places of kinds of constant errors in an instrument's response; those of its law are the last column."""


def _responses(errors: Mapping[str, Array], count: int) -> tuple[Array, Array]:
    """Arrange constant errors of gyros and accelerometers, shape (count, 3, 5) each; those not given are zero."""
    matrices = []
    for instrument, kinds in INSTRUMENTS.items():
        response = np.zeros((count, 3, 5))
        for name in kinds:
            if name in errors:
                rows, columns = _PLACES.get(name.removeprefix(f"{instrument}_"), ((0, 1, 2), 4))
                response[:, rows, columns] = errors[name]
        matrices.append(response)
    return matrices[0], matrices[1]
