"""Cruise and hover: the systems of "The Story of 84 Minutes" as scenarios.

A vehicle keeps its height and speed along a great circle of an earth that does not turn, with the instruments and the
navigator of NASA TN D-1772. With its altitude slaved to an outside altimeter the navigator is a Schuler pendulum; with
an altitude of its own it diverges upwards.

Two engines simulate it. ``ensemble`` integrates deviations in cartesian axes in a compiled kernel; ``reference``
integrates spherical coordinates, sample by sample, with DOP853.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.failure import Failure
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs, History, Panel, StartClock
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source, source_labels
from mcnav.contract.questions import TimelineParts
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Capability, PlainScenario, ScenarioError
from mcnav.numerics.integration import Diverged
from mcnav.numerics.refinement import refined_steps
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.histories import with_errors
from mcnav.systems.sample_loop import simulate_each
from mcnav.systems.steady.ensemble import ORDER, highest_rate, simulate_histories
from mcnav.systems.steady.linearized import linearize
from mcnav.systems.steady.navigator import simulate_indicated
from mcnav.systems.steady.truth import SteadyFlight, navigation_error
from mcnav.systems.variations import check_span

LARGEST_GROWTH: Final = 230.0
"""Logarithm of the factor, 1e100, by which an error of an inertial altitude may grow in a flight."""

DEGREE: Final = np.pi / 180.0

SOURCES: Final = (
    Source("altitude", "m", "m", 100.0),
    Source("range", "m", "m", 100.0),
    Source("cross_range", "m", "m", 100.0),
    Source("altitude_rate", "m/s", "m/s", 0.3048),
    Source("range_rate", "m/s", "m/s", 0.3048),
    Source("cross_range_rate", "m/s", "m/s", 0.3048),
    Source("misalignment", "rad", "arcsec", 0.01 * DEGREE),
    Source("roll_misalignment", "rad", "arcsec", 0.01 * DEGREE),
    Source("azimuth_misalignment", "rad", "arcsec", 0.01 * DEGREE),
    Source("gyro_drift", "rad/s", "deg/h", 0.01 * DEGREE / 3600.0),
    Source("roll_drift", "rad/s", "deg/h", 0.01 * DEGREE / 3600.0),
    Source("azimuth_drift", "rad/s", "deg/h", 0.01 * DEGREE / 3600.0),
    Source("bias_x", "m/s^2", "ug", 1e-4 * STANDARD_GRAVITY),
    Source("bias_y", "m/s^2", "ug", 1e-4 * STANDARD_GRAVITY),
    Source("bias_z", "m/s^2", "ug", 1e-4 * STANDARD_GRAVITY),
    Source("scale_factor_x", "1", "ppm", 1e-4),
    Source("scale_factor_y", "1", "ppm", 1e-4),
    Source("scale_factor_z", "1", "ppm", 1e-4),
)
"""Initial-condition and equipment errors in the order of `mcnav.systems.steady.truth.Error`; the sizes are the
seed's."""

OUTPUTS: Final = (
    Output("altitude", "m", "km"),
    Output("range", "m", "km"),
    Output("cross_range", "m", "km"),
    Output("altitude_rate", "m/s", "m/s"),
    Output("range_rate", "m/s", "m/s"),
    Output("cross_range_rate", "m/s", "m/s"),
)
"""Final navigation errors."""

LARGEST_ALTITUDE: Final = 0.5
"""Altitude error, as a share of the radius, beyond which a linear one has no meaning: within two sigmas the indicated
position reaches the earth's centre."""

VERTICAL: Final = ("altitude", "altitude_rate")
"""Neither errors nor outputs of a navigator whose altitude is slaved."""

ENSEMBLE_CHUNK: Final = 8_192
REFERENCE_CHUNK: Final = 32
HISTORY_POINTS: Final = 121
HISTORY_TIME: Final = "time [min]"
RESPONSES: Final = "Errors left by one error alone"
"""Title of the diagrams: the flight itself is steady, and shows nothing."""

SHARES: Final = np.linspace(0.0, 1.0, 60)
"""Instants at which the errors of all samples are read out, as shares of the flight."""

TOLERANCE: Final = 1e-7
"""Largest numerical error of any probe, as a share of the probes' standard deviation in that output."""

FEWEST_STEPS: Final = 12
MOST_STEPS: Final = 4_096

LONGEST_STEP: Final = 400.0
"""Longest step of the time history of each error alone, s: a thirteenth of the natural period near the ground."""

REVISION: Final = 4
"""Counts the changes of the samples' last digits: 1 was a scheme of fourth order, 2 had scipy's integrator, 3 took
steps from epoch to epoch."""

HAND_OVER_SHARE: Final = 0.01
"""Share of probes beyond the kernel's validity above which the reference path does the work, in processes."""

SHORTEST: Final = 1.0
"""Shortest flight after a later start, s, or half of a flight that is itself short."""

LONGEST: Final = 10.0 * 86_400.0
"""Longest flight, s; longer ones are taken for mistakes."""


@dataclass(frozen=True)
class Navigation:
    """A flight with the errors and outputs that its navigator has, as columns of the physics' own order.

    Attributes
    ----------
    sources, outputs : tuple of int
        Rows of `SOURCES` and of `OUTPUTS`.
    further_epochs : tuple of float
        Epochs besides the usual ones, s.
    """

    flight: SteadyFlight
    sources: tuple[int, ...]
    outputs: tuple[int, ...]
    further_epochs: tuple[float, ...] = ()

    @property
    def shares(self) -> Array:
        """Epochs as shares of the flight."""
        return np.union1d(SHARES, np.array(self.further_epochs) / self.flight.duration)

    def whole(self, errors: Array) -> Array:
        """Place errors among those that the physics takes, shape (n, 18)."""
        whole = np.zeros((len(errors), len(SOURCES)))
        whole[:, self.sources] = errors
        return whole

    def by_ensemble(self, errors: Array, steps: int) -> tuple[Array, NDArray[np.bool_]]:
        """Simulate by the kernel; outcomes and whether they are valid."""
        histories, valid = self.histories(errors, steps, np.ones(1))
        return histories[:, 0], valid

    def histories(self, errors: Array, steps: int, shares: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Simulate by the kernel; errors at shares of the flight, shape (n, m, outputs), and whether they are valid."""
        return simulate_histories(self.flight, self.whole(errors), steps, shares, self.outputs)

    def simulate_reference(self, errors: Array, rows: Iterable[int], values: Array) -> dict[int, Failure]:
        """Simulate some rows of errors by the reference engine; see `simulate_each`."""
        whole, outputs = self.whole(errors), list(self.outputs)
        return simulate_each(lambda row: simulate_indicated(self.flight, whole[row])[outputs], rows, values, Diverged)

    def reference_steps(self, errors: Array) -> tuple[Array, Array]:
        """Simulate one sample, shape (sources,), by the reference engine, until it ends or leaves the model.

        Returns
        -------
        times : ndarray, shape (m,)
            Of the integrator's steps, s; empty for a sample that starts outside.
        errors : ndarray, shape (m, outputs)
        """
        seen: list[tuple[Array, Array]] = []
        with contextlib.suppress(Diverged):
            simulate_indicated(self.flight, self.whole(errors[None])[0], lambda *steps: seen.append(steps))
        if not seen:
            return np.empty(0), np.empty((0, len(self.outputs)))
        times, states = seen[0]
        flights = (replace(self.flight, duration=float(time)) for time in times)
        off = [navigation_error(flight, state) for flight, state in zip(flights, states.T, strict=True)]
        return times, np.array(off)[:, self.outputs]


def largest_linear_error(flight: SteadyFlight, output: str) -> float:
    """Return the size of an output beyond which a linear error has no meaning, SI.

    That of an altitude is `LARGEST_ALTITUDE`; of a range the radius r, over which the local axes turn by a radian; of a
    rate sqrt(g r), that of a Schuler oscillation with the amplitude r.
    """
    if output.endswith("_rate"):
        return float(np.sqrt(flight.gravity * flight.radius))
    return flight.radius * (LARGEST_ALTITUDE if output == "altitude" else 1.0)


@dataclass(frozen=True)
class ReferenceEngine:
    """Spherical coordinates, one sample at a time."""

    navigation: Navigation
    parallel: str = "processes"
    chunk: int = REFERENCE_CHUNK
    accuracy: str = "spherical coordinates, DOP853 with relative tolerance 1e-12"
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        errors = batch.errors
        values = np.empty((len(errors), len(self.navigation.outputs)))
        return SimulationResult(values, self.navigation.simulate_reference(errors, range(len(errors)), values))


@dataclass(frozen=True)
class EnsembleEngine:
    """Deviations on a shared grid; the reference engine simulates the samples beyond its validity."""

    navigation: Navigation
    steps: int
    accuracy: str
    parallel: str = "threads"
    chunk: int = ENSEMBLE_CHUNK
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples; where those with noise are asked for, their errors at every epoch as well."""
        errors = batch.errors
        shares = self.navigation.shares
        histories, valid = self.navigation.histories(errors, self.steps, shares if noise else shares[-1:])
        values = histories[:, -1].copy()
        beyond = np.flatnonzero(~valid).tolist()
        histories[beyond] = np.nan
        failures = self.navigation.simulate_reference(errors, beyond, values)
        return SimulationResult(values, failures, len(beyond), history=histories if noise else None)

    @property
    def epochs(self) -> Epochs:
        """Evenly spaced."""
        return Epochs(HISTORY_TIME, self.navigation.shares * self.navigation.flight.duration / 60.0)


class Cruise(PlainScenario):
    """The scenario: steady flight along a great circle, or standing still, and a navigator that goes along.

    Raises `ScenarioError` when nothing holds the vehicle down, at or beyond orbital speed, and when an inertial
    altitude would diverge by more than `LARGEST_GROWTH`.
    """

    engines = ("ensemble", "reference")
    revision = REVISION
    can = frozenset({Capability.REPLAY})
    parts = TimelineParts("any time")
    start_clock = StartClock("min of the flight", aligned="at the navigation's own start")

    def __init__(self, flight: SteadyFlight) -> None:
        if flight.effective_gravity <= 0.0:
            orbital = np.sqrt(flight.gravity * flight.radius)
            raise ScenarioError(
                "speed", f"{flight.speed:g} m/s is not below the {orbital:.1f} m/s of a satellite at this height"
            )
        if not flight.slaved and (growing := highest_rate(flight)) * flight.duration > LARGEST_GROWTH:
            raise ScenarioError(
                "duration",
                f"{flight.duration / 3600.0:.4g} h is too long for an inertial altitude, whose error grows e-fold "
                f"every {1.0 / growing / 60.0:.3g} min; expected at most {LARGEST_GROWTH / growing / 3600.0:.3g} h",
            )
        left_out = VERTICAL if flight.slaved else ()
        self.flight = flight
        self.sources = tuple(source for source in SOURCES if source.name not in left_out)
        self.outputs = tuple(
            replace(output, limit=largest_linear_error(flight, output.name))
            for output in OUTPUTS if output.name not in left_out
        )  # fmt: skip
        self.navigation = Navigation(
            flight,
            tuple(SOURCES.index(source) for source in self.sources),
            tuple(number for number, output in enumerate(OUTPUTS) if output.name not in left_out),
        )

    def _partials(self, times: Array) -> Array:
        rows = np.ix_(range(len(times)), self.navigation.outputs, self.navigation.sources)
        return linearize(self.flight, times)[rows]

    @cached_property
    def _end(self) -> LinearSystem:
        return self.linear(np.array([self.flight.duration]))

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Compute the partial derivatives at times, s, by default at the end, by the equations of variation."""
        if times is None:
            return self._end
        check_span(times, 0.0, self.flight.duration)
        times = np.clip(times, 0.0, self.flight.duration)
        nominal = np.zeros((len(times), len(self.outputs)))
        return LinearSystem(times / 60.0, self._partials(times), nominal, label=HISTORY_TIME)

    @property
    def reading_times(self) -> Array:
        """The epochs, s."""
        return self.navigation.shares * self.flight.duration

    def with_epochs(self, times: tuple[float, ...]) -> Self:
        """Return the same with further epochs, s."""
        other = copy(self)
        other.navigation, other.further_epochs = replace(self.navigation, further_epochs=times), times
        return other

    def check_start_axes(self, axes: str) -> None:
        """Refuse axes of another time: a steady flight is the same from each start, with axes aligned there."""
        if axes != "start":
            raise ScenarioError(
                "axes", f"got {axes!r}; axes of a steady flight are aligned at each start: leave it out"
            )

    def start_times(self, count: int) -> Array:
        """Space start times from the flight's start to just before its end, shape (count,), s."""
        return np.linspace(0.0, self.flight.duration - min(SHORTEST, self.flight.duration / 2.0), count)

    def started_at(self, time: float, axes: str) -> Cruise:
        """Start navigation at another time, s: the flight is steady, so that what is left of it is a shorter one."""
        self.check_start_axes(axes)
        last = float(self.start_times(2)[-1])
        if not 0.0 <= time <= last:
            raise ScenarioError("start", f"got {time:g} s; navigation starts from 0 s to {last:g} s")
        return Cruise(replace(self.flight, duration=self.flight.duration - time))

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives at the end for navigation started at each time, rising, s."""
        self.check_start_axes(axes)
        return self._partials(self.flight.duration - times[::-1])[::-1]

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Compute the partial derivatives at the epochs, whatever the count."""
        return self.linear(self.reading_times)

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one of the engines; the ensemble's steps are refined until the probes, (n, sources), agree."""
        if engine == "reference":
            return ReferenceEngine(self.navigation)
        steps, error = refined_steps(
            partial(self.navigation.by_ensemble, probes), FEWEST_STEPS, MOST_STEPS, ORDER, TOLERANCE
        )
        accuracy = (
            f"deviations in cartesian axes, Runge-Kutta order {ORDER}, {steps} steps; largest numerical error of "
            f"{len(probes)} probe samples {error:.1e} of an output's dispersion"
        )
        ready = EnsembleEngine(self.navigation, steps, accuracy)
        if without_noise(ready)(probes).fallback_count > HAND_OVER_SHARE * len(probes):
            return replace(ready, parallel="processes", chunk=REFERENCE_CHUNK)
        return ready

    def simulate_one(self, errors: Array) -> History:
        """Simulate one sample, shape (sources,), on the reference path: its navigation errors over the flight."""
        times, off = self.navigation.reference_steps(errors)
        return with_errors(History({HISTORY_TIME: times / 60.0}), off, self.outputs) if len(times) else History()

    def nominal(self) -> History:
        """Simulate the usual size of each error alone: its effect on the indicated position over the flight.

        The effect of an error ends (NaN) where the indicated position leaves the model.
        """
        flight, names = self.flight, [output.name for output in self.outputs]
        times, histories = self._single_errors()
        ended = times[np.maximum(np.isfinite(histories).all(axis=2).sum(axis=1), 1) - 1]
        labels = [
            label if end == flight.duration else f"{label}, until {end / 60.0:.0f} min"
            for label, end in zip(source_labels([source.name for source in self.sources], names), ended, strict=True)
        ]
        flown = histories.swapaxes(0, 1)
        columns = {HISTORY_TIME: times / 60.0, "range flown [km]": flight.speed * times / 1e3}
        panels = []
        for name in (name for name in names if not name.endswith("_rate")):
            spoken = name.replace("_", " ")
            of_output = flown[:, :, names.index(name)] / 1e3
            largest = np.nanmax(np.abs(of_output), axis=0)
            kept = [j for j in np.argsort(-largest, kind="stable") if largest[j] > 0.01 * largest.max()][:6]
            if not kept:
                continue
            drawn = {f"{spoken} by {self.sources[j].name.replace('_', ' ')} [km]": of_output[:, j] for j in kept}
            legend = tuple(labels[j] for j in kept)
            columns |= drawn
            title = f"{spoken.capitalize()} error left by one error of usual size"
            panels.append(Panel(title, HISTORY_TIME, tuple(drawn), legend, f"{spoken} error [km]"))
        return History(columns, {"end": flight.duration / 60.0}, tuple(panels), title=RESPONSES)

    def _single_errors(self) -> tuple[Array, Array]:
        """Simulate the usual size of each error alone: times, s, shape (m,), and errors, (sources, m, outputs), SI."""
        sizes = np.diag([source.nominal for source in self.sources])
        shares, intervals = np.linspace(0.0, 1.0, HISTORY_POINTS), HISTORY_POINTS - 1
        each = int(np.ceil(self.flight.duration / (intervals * LONGEST_STEP)))
        histories, valid = self.navigation.histories(sizes, each * intervals, shares)
        times = shares * self.flight.duration
        for number in np.flatnonzero(~valid).tolist():
            reached, _ = self.navigation.reference_steps(sizes[number])
            histories[number, times > reached.max(initial=0.0)] = np.nan
        return times, histories
