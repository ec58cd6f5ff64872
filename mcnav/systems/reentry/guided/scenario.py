"""The guided reentry as a scenario: each sample flies where its lift law, fed by its navigator, leads it."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs, History, Panel
from mcnav.contract.linear import LinearSystem
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import PlainScenario, ScenarioError
from mcnav.linear.engine.propagate import propagate
from mcnav.numerics.power_sums import sum_powers
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.histories import with_errors
from mcnav.systems.reentry.engines import HISTORY_TIME
from mcnav.systems.reentry.guided.description import TRUTH_SOURCES, Ending, Guidance, GuidedNavigation
from mcnav.systems.reentry.guided.ensemble.kernel import SOURCES, simulate_flights, simulate_steps
from mcnav.systems.reentry.guided.following import Following, NoMargin, follow
from mcnav.systems.reentry.guided.linear import LinearFlight, NoLinearSystem, fly_linear
from mcnav.systems.reentry.guided.outputs import origin_of, outputs_of, read_flights, read_nominal
from mcnav.systems.reentry.guided.reference import GuidedReferenceEngine
from mcnav.systems.reentry.guided.remarks import departures_of, doubtful_end, draw_flights, limited_lift, rival_maxima
from mcnav.systems.reentry.guided.timeline import fly_timeline, partials_before_reentry
from mcnav.systems.reentry.outputs import FurtherOutput
from mcnav.systems.reentry.scenario import SOURCES as OF_NAVIGATION
from mcnav.systems.reentry.scenario import Flight, Reentry
from mcnav.systems.variations import ROUNDING, check_span

ENSEMBLE_CHUNK: Final = 2_048
REVISION: Final = 1
ACCURACY: Final = (
    "truth and navigator of each sample by Taylor series of order 22 in cartesian axes, which end at the "
    "kinks of its own flight; rounding alone"
)


def nominal_flight(navigation: GuidedNavigation) -> GuidedNavigation:
    """Return the flight by the vehicle's own lift law fed with the truth: without errors it is the nominal one."""
    return replace(navigation, guidance=Guidance("true", "true", "truth"))


@dataclass(frozen=True)
class GuidedEngine:
    """Taylor series, sample by sample.

    Attributes
    ----------
    epochs : Epochs
        The last is the end of each sample. Before it, a sample that has ended stays at its end, and its dispersion is
        from the nominal flight of the time.
    """

    navigation: GuidedNavigation
    epochs: Epochs
    accuracy: str = ACCURACY
    parallel: str = "threads"
    chunk: int = ENSEMBLE_CHUNK
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        flights = simulate_flights(self.navigation, batch.errors)
        values = read_flights(self.navigation, flights, self._nominal_end)[:, -1]
        failed = np.flatnonzero(flights.endings != Ending.ARRIVED)
        values[failed] = np.nan
        failures = {int(row): self.navigation.failure(Ending(int(flights.endings[row]))) for row in failed}
        return SimulationResult(values, failures)

    @cached_property
    def _times(self) -> Array:
        """Epochs but the last, s from the start of navigation."""
        reentry, start = self.navigation.trajectory.reentry_time, self.navigation.start
        return np.asarray(np.maximum(self.epochs.times[:-1] * 60.0 + reentry - start, 0.0))

    @cached_property
    def _nominal(self) -> Array:
        """Nominal polar states at the epochs, flown as the samples are, shape (m, 4)."""
        none = np.zeros((1, SOURCES))
        return np.asarray(simulate_flights(nominal_flight(self.navigation), none, self._times).actual[0])

    @cached_property
    def _nominal_end(self) -> Array:
        """Nominal polar state at the end, flown as the samples are, shape (1, 4)."""
        return np.asarray(simulate_flights(nominal_flight(self.navigation), np.zeros((1, SOURCES))).actual[0])

    def histories(self, errors: Array) -> Array:
        """Simulate samples, shape (n, sources): their outputs at every epoch, shape (n, m, outputs)."""
        flights = simulate_flights(self.navigation, errors, self._times)
        histories = read_flights(self.navigation, flights, self._nominal)
        histories[flights.endings != Ending.ARRIVED] = np.nan
        return histories

    def history_sums(self, errors: Array) -> PowerSums:
        """Add up power sums of samples' outputs, shape (n, sources), at every epoch."""
        histories = self.histories(errors)
        return sum_powers(histories[np.isfinite(histories).all(axis=(1, 2))], self._without_errors)

    @cached_property
    def _without_errors(self) -> Array:
        return np.asarray(self.histories(np.zeros((1, SOURCES)))[0])


class GuidedReentry(PlainScenario):
    """The scenario.

    Raises `ScenarioError` when the nominal flight never comes down, navigation would start outside it, or a law that
    follows it has no margin.
    """

    sources = (*OF_NAVIGATION, *TRUTH_SOURCES)
    engines = ("ensemble", "reference")
    revision = REVISION
    can, parts, start_clock = Reentry.can, Reentry.parts, Reentry.start_clock

    def __init__(
        self,
        flight: Flight,
        guidance: Guidance,
        following: Following | None = None,
        further: tuple[FurtherOutput, ...] = (),
    ) -> None:
        self._unguided = Reentry(flight, further)
        along = self._unguided.navigation
        if following is not None:
            try:
                guidance = replace(guidance, law=follow(along.trajectory, following))
            except NoMargin as wrong:
                raise ScenarioError("guidance.law.limit", str(wrong)) from None
        self.navigation = GuidedNavigation(
            along.trajectory, flight.vehicle, flight.final_altitude, flight.accelerometers_off_above, along.start,
            along.theta_axes, guidance, further,
        )  # fmt: skip

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Navigation errors, dispersion of the truth, time and largest deceleration."""
        return outputs_of(self.navigation)

    @cached_property
    def _flight(self) -> LinearFlight:
        try:
            return fly_linear(self.navigation)
        except NoLinearSystem as failure:
            raise ScenarioError("guidance", f"the flight without any error fails: {failure}") from None

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Compute partial derivatives at times (s from reentry), by default at the end.

        They are along the flight without errors; those of its last time are of each sample's own end.
        """
        if times is None:
            return self._readings(np.array([self._flight.final_time]))
        since, final = self.navigation.start - self.navigation.trajectory.reentry_time, self._flight.final_time
        check_span(times, since, since + final, " from reentry")
        return self._readings(np.where(times - since > final - ROUNDING, final, np.maximum(times - since, 0.0)))

    @property
    def reading_times(self) -> Array:
        """The epochs, s from reentry; the last is the end of each sample."""
        return self._unguided.reading_times

    def with_epochs(self, times: tuple[float, ...]) -> Self:
        """Return the same with further epochs, s from reentry."""
        other = copy(self)
        other._unguided, other.further_epochs = self._unguided.with_epochs(times), times
        return other

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Compute the partial derivatives at the epochs, whatever the count."""
        return self.linear(self.reading_times)

    def _readings(self, times: Array) -> LinearSystem:
        """Read the linear system at times, s from the start of navigation; the end is that of each sample."""
        navigation, flight = self.navigation, self._flight
        timeline, final = fly_timeline(flight, times), flight.final_time
        readings = [flight.at(float(time)) if time < final else flight.end for time in times]
        flown = simulate_flights(nominal_flight(navigation), np.zeros((1, SOURCES)), times[times < final]).actual[0]
        states = np.concatenate([flown[:-1], np.repeat(flown[-1:], int((times >= final).sum()), axis=0)])
        since = navigation.start - navigation.trajectory.reentry_time
        return LinearSystem(
            (times + since) / 60.0,
            propagate(timeline, None, timeline.positions(times)).partials[:, :, :-1],
            np.array([read_nominal(flight, *pair) for pair in zip(readings, states, strict=True)]),
            label=HISTORY_TIME,
            origin=origin_of(navigation, states),
        )

    def started_at(self, time: float, axes: str) -> GuidedReentry:
        """Start navigation of the same nominal flight at another time (s from reentry).

        Raises `ScenarioError` when the time is not on the trajectory.
        """
        other = object.__new__(GuidedReentry)
        other._unguided = self._unguided.started_at(time, axes)
        along = other._unguided.navigation
        other.navigation = replace(self.navigation, start=along.start, theta_axes=along.theta_axes)
        return other

    def check_start_axes(self, axes: str) -> None:
        """Accept both conventions of the reference axes."""

    def start_times(self, count: int) -> Array:
        """Space start times from the first point of the truth towards its end, shape (count,), s from reentry."""
        trajectory = self.navigation.trajectory
        return np.linspace(0.0, trajectory.final_time, count, endpoint=False) - trajectory.reentry_time

    @cached_property
    def _from_first_point(self) -> GuidedReentry:
        return self.started_at(-self.navigation.trajectory.reentry_time, "trajectory")

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives for navigation started at each time (s from reentry).

        Of shape (n, outputs, sources): up to reentry from one flight, later ones from a flight each. ``axes`` as in
        `Flight`.
        """
        reentry, before = self.navigation.trajectory.reentry_time, times <= 0.0
        result = np.empty((len(times), len(self.outputs), len(self.sources)))
        if before.any():
            flight = self._from_first_point._flight
            result[before] = partials_before_reentry(flight, times[before] + reentry, axes)
        for place in np.flatnonzero(~before):
            result[place] = self.started_at(float(times[place]), axes).linear().end.partials
        return result

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one of `engines`."""
        if engine == "reference":
            return GuidedReferenceEngine(self.navigation, len(self.outputs))
        return GuidedEngine(self.navigation, Epochs(HISTORY_TIME, self.reading_times / 60.0, self.nominal().events))

    def remarks_on(self, mean: Array, covariance: Array) -> tuple[str, ...]:
        """Say how flights with drawn errors depart from linear analysis, and whether the lift reaches its limit."""
        batch = draw_flights(mean, covariance)
        departing = departures_of(
            batch, self.engine("ensemble", batch.errors), self.linear().end, covariance, self.outputs
        )
        flight = self._flight
        told = (limited_lift, doubtful_end, rival_maxima)
        return (*departing, *(words for remark in told for words in remark(flight, covariance)))

    def nominal(self) -> History:
        """Tabulate the nominal flight against time from reentry."""
        return self._unguided.nominal()

    def simulate_one(self, errors: Array) -> History:
        """Simulate one sample, shape (sources,): true, indicated and nominal flight, and its outputs over time."""
        navigation, trajectory = self.navigation, self.navigation.trajectory
        flight = simulate_steps(navigation, errors).flight
        since = navigation.start - trajectory.reentry_time
        moments = np.minimum(flight.times[0] + navigation.start, trajectory.final_time)
        nominal = trajectory.states(moments)
        columns = {HISTORY_TIME: (flight.times[0] + since) / 60.0}
        whose = {"true": flight.actual[0], "indicated": flight.indicated[0], "nominal": nominal}
        for name, states in whose.items():
            columns[f"{name} altitude [km]"] = (states[:, 0] - EARTH_RADIUS) / 1e3
            columns[f"{name} range [km]"] = EARTH_RADIUS * states[:, 1] / 1e3
        panels = tuple(
            Panel(
                f"{quantity.capitalize()}: true, indicated and nominal",
                HISTORY_TIME,
                tuple(f"{name} {quantity} [km]" for name in whose),
                tuple(whose),
                f"{quantity} [km]",
            )
            for quantity in ("altitude", "range")
        )
        # at its own end the sample's dispersion is from the nominal end
        compared = np.concatenate([nominal[:-1], [navigation.nominal_final]])
        over_time = read_flights(navigation, flight, compared)[0]
        return with_errors(History(columns, {}, panels), over_time, self.outputs)
