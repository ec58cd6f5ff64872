"""The linear system of a guided reentry: variational equations of truth and navigator along the flight without errors.

With X the polar states of truth and navigator, shape (8,), and errors d, the sensitivities S = dX/dd obey

    S' = (dF/dX) S + dF/dd

phase by phase, where the rates F(t, X, d) of NASA TN D-1772, eqs. (1)-(9), are smooth; the derivatives of F are taken
by complex steps, ``dF = Im F(X + i eps e) / eps``, which have no cancellation. Instants of the phases are those of
the flight without errors (`simulate_steps`).

Where the instant t_k of a kink psi(X) = 0 moves with the errors, ``dt_k = -(psi_X / psi') dX``. F is continuous at the
bounds of the layers and at the limit of the lift law, so that S passes; at the accelerometers' switch it jumps, and at
a knot of the lift law by little: ``S+ = S- + (F- - F+) dt_k``. Outputs at the sample's own end have ``dX + X' dt``. The
largest specific force changes by ``df + f' dt_k`` where it is at such a kink or at the end, else by ``df`` alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.numerics.integration import integrate
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.atmosphere import GEOPOTENTIAL_RADIUS, HYDROSTATIC_GRADIENT
from mcnav.systems.reentry.guided.description import Ending, GuidedError, GuidedNavigation
from mcnav.systems.reentry.guided.ensemble.kernel import SOURCES, Steps, simulate_steps
from mcnav.systems.reentry.guided.ensemble.steps import (
    ABOVE,
    BAND,
    BELOW,
    EVENT,
    FINAL_INDICATED,
    KNOT,
    LEVEL,
    NEXT_KNOT,
    NONE,
    REGIME,
)
from mcnav.systems.reentry.guided.ensemble.tables import FOLLOWING, PROPORTIONAL, tables_of
from mcnav.systems.reentry.instruments import Error

ON: Final = 13
"""Place of the accelerometers' switch among the constants of a phase; see `_constants`."""

Numbers: TypeAlias = NDArray[np.complex128]
"""States or errors with a complex step."""

TOLERANCES: Final = (1e-11, 1e-13)
STEP: Final = 1e-30
"""Complex step, as a share of one SI unit."""

EQUIPMENT: Final = np.array([*range(4, 12), GuidedError.DENSITY, GuidedError.LIFT_TO_DRAG, GuidedError.DRAG])
"""Sources that act during the flight; the others act at its start."""

PROBES: Final = 16
"""Points of an integrator's step between which the largest force is sought."""


@compiled
def command(state: Numbers, angle: complex, numbers: Array, polynomials: Array) -> complex:
    """Compute L/D before the limit, of a polar state whose range angle since the last knot is given."""
    law, gain, fixed = numbers[9], numbers[10], numbers[11]
    if law == PROPORTIONAL:
        return complex(gain * state[2])
    if law != FOLLOWING:
        return complex(fixed)
    value: complex = 0.0 * angle
    factors = (1.0 + 0.0 * angle, state[0], state[2], EARTH_RADIUS * state[3])
    for one in range(4):
        share = 0.0 * angle
        for power in range(polynomials.shape[1] - 1, -1, -1):
            share = share * angle + polynomials[one, power]
        value += share * factors[one]
    return value


@compiled
def force(state: Numbers, errors: Numbers, numbers: Array, polynomials: Array) -> tuple[complex, complex]:
    """Compute the specific force along the true horizontal and vertical (down), m/s^2, of truth and navigator."""
    base, temperature, lapse, density, ballistic, regime = numbers[:6]
    limit, indicated_input, knot = numbers[6], numbers[7], numbers[8]
    radius, radius_rate, angle_rate = state[0], state[2], state[3]
    # ARDC 1959, its layer's temperature linear in the geopotential altitude
    altitude = radius - EARTH_RADIUS
    rise = GEOPOTENTIAL_RADIUS * altitude / (GEOPOTENTIAL_RADIUS + altitude) - base
    if lapse == 0.0:
        air = density * np.exp(-HYDROSTATIC_GRADIENT * rise / temperature)
    else:
        air = density * np.exp(-(1.0 + HYDROSTATIC_GRADIENT / lapse) * np.log(1.0 + lapse * rise / temperature))
    air = air * (1.0 + errors[GuidedError.DENSITY]) * (1.0 + errors[GuidedError.DRAG])
    used = state[4:] if indicated_input > 0.0 else state[:4]
    lift = regime * limit if regime != 0.0 else command(used, used[1] - knot, numbers, polynomials)
    lift = lift * (1.0 + errors[GuidedError.LIFT_TO_DRAG])
    eastward = radius * (angle_rate - EARTH_RATE)
    half = 0.5 * air * ballistic * np.sqrt(radius_rate * radius_rate + eastward * eastward)
    return -half * (eastward + lift * radius_rate), half * (radius_rate - lift * eastward)


@compiled
def rates_of(time: float, state: Numbers, errors: Numbers, numbers: Array, polynomials: Array, rates: Numbers) -> None:
    """Write the rates of the polar states of truth and navigator."""
    theta_axes, on = numbers[12], numbers[13]
    force_x, force_z = force(state, errors, numbers, polynomials)
    # along the axes of the platform, at the time since the start of navigation
    turn = theta_axes - state[1] + errors[Error.MISALIGNMENT] + errors[Error.GYRO_DRIFT] * time
    along_x = force_x * np.cos(turn) + force_z * np.sin(turn)
    along_z = force_z * np.cos(turn) - force_x * np.sin(turn)
    measured_x = (along_x + errors[Error.BIAS_X]) * (1.0 + errors[Error.SCALE_FACTOR_X])
    measured_x = on * (measured_x + errors[Error.CROSS_AXIS_X] * along_z)
    measured_z = (along_z + errors[Error.BIAS_Z]) * (1.0 + errors[Error.SCALE_FACTOR_Z])
    measured_z = on * (measured_z + errors[Error.CROSS_AXIS_Z] * along_x)
    turn = state[5] - theta_axes
    indicated_x = measured_x * np.cos(turn) + measured_z * np.sin(turn)
    indicated_z = measured_z * np.cos(turn) - measured_x * np.sin(turn)
    for begin, x, z in ((0, force_x, force_z), (4, indicated_x, indicated_z)):
        radius, radius_rate, angle_rate = state[begin], state[begin + 2], state[begin + 3]
        rates[begin], rates[begin + 1] = radius_rate, angle_rate
        rates[begin + 2] = radius * angle_rate * angle_rate - z - GRAVITATIONAL_PARAMETER / (radius * radius)
        rates[begin + 3] = (x - 2.0 * radius_rate * angle_rate) / radius


@compiled
def variational_rates(time: float, joint: Array, numbers: Array, polynomials: Array, equipment: Array) -> Array:
    """Compute the rates of X and of its sensitivities, shape (8 + 8 x sources,)."""
    sources = (joint.size - 8) // 8
    state, errors, changed = np.zeros(8, np.complex128), np.zeros(sources, np.complex128), np.zeros(8, np.complex128)
    for i in range(8):
        state[i] = joint[i]
    rates = np.zeros(joint.size)
    rates_of(time, state, errors, numbers, polynomials, changed)
    for i in range(8):
        rates[i] = changed[i].real
    for k in range(8):
        state[k] += 1j * STEP
        rates_of(time, state, errors, numbers, polynomials, changed)
        state[k] = joint[k]
        for i in range(8):
            slope = changed[i].imag / STEP
            if slope != 0.0:
                for source in range(sources):
                    rates[8 + i * sources + source] += slope * joint[8 + k * sources + source]
    for source in equipment:
        errors[source] = 1j * STEP
        rates_of(time, state, errors, numbers, polynomials, changed)
        errors[source] = 0.0
        for i in range(8):
            rates[8 + i * sources + source] += changed[i].imag / STEP
    return rates


@compiled
def force_partials(joint: Array, numbers: Array, polynomials: Array, equipment: Array) -> tuple[float, Array]:
    """Compute the size of the specific force, m/s^2, and its partial derivatives by the sources at a fixed time."""
    sources = (joint.size - 8) // 8
    state, errors = np.zeros(8, np.complex128), np.zeros(sources, np.complex128)
    partials = np.zeros(sources)
    for i in range(8):
        state[i] = joint[i]
    x, z = force(state, errors, numbers, polynomials)
    size = np.sqrt(x * x + z * z).real
    for k in range(8):
        state[k] += 1j * STEP
        x, z = force(state, errors, numbers, polynomials)
        state[k] = joint[k]
        slope = np.sqrt(x * x + z * z).imag / STEP
        for source in range(sources):
            partials[source] += slope * joint[8 + k * sources + source]
    for source in equipment:
        errors[source] = 1j * STEP
        x, z = force(state, errors, numbers, polynomials)
        errors[source] = 0.0
        partials[source] += np.sqrt(x * x + z * z).imag / STEP
    return size, partials


@compiled
def growths(states: Array, times: Array, numbers: Array, polynomials: Array) -> Array:
    """Compute the rate of the size of the specific force at states X, shape (n, 8), and times: m/s^3, shape (n,)."""
    state, rates = np.zeros(8, np.complex128), np.zeros(8, np.complex128)
    errors, growth = np.zeros(SOURCES, np.complex128), np.zeros(len(times))
    for row in range(len(times)):
        for i in range(8):
            state[i] = states[row, i]
        rates_of(times[row], state, errors, numbers, polynomials, rates)
        for i in range(8):
            state[i] += 1j * STEP * rates[i].real
        x, z = force(state, errors, numbers, polynomials)
        growth[row] = np.sqrt(x * x + z * z).imag / STEP
    return growth


@dataclass(frozen=True)
class _Phase:
    """A stretch with smooth equations: begin, end (s from the start of navigation), constants, and what ends it."""

    begin: float
    end: float
    numbers: Array
    polynomials: Array
    event: int
    solution: Any

    @property
    def accelerometers_on(self) -> bool:
        """True where the accelerometers' outputs are used."""
        return bool(self.numbers[ON])

    def rates(self, time: float, joint: Array) -> Array:
        """Compute the rates of X and its sensitivities."""
        return variational_rates(time, joint, self.numbers, self.polynomials, EQUIPMENT)

    def force(self, joint: Array) -> tuple[float, Array]:
        """Compute the size of the specific force and its partial derivatives."""
        return force_partials(joint, self.numbers, self.polynomials, EQUIPMENT)

    def command(self, used: Array) -> tuple[float, Array]:
        """Compute L/D before its limit for the polar state that the law is fed with, shape (4,), and its gradient."""
        value, gradient = 0.0, np.zeros(4)
        for k in range(4):
            state = used.astype(complex)
            state[k] += 1j * STEP
            lift = command(state, state[1] - self.numbers[8], self.numbers, self.polynomials)
            value, gradient[k] = lift.real, lift.imag / STEP
        return value, gradient

    @property
    def limited(self) -> bool:
        """True where L/D is at its limit without errors."""
        return bool(self.numbers[5])

    def growth(self, time: float) -> float:
        """Compute the rate of the size of the specific force, m/s^3."""
        state = self.solution(time)[None, :8].copy()
        return float(growths(state, np.array([time]), self.numbers, self.polynomials)[0])


@dataclass(frozen=True)
class Peak:
    """A local maximum of the specific force: when, its size, and its partial derivatives, shape (sources,)."""

    time: float
    size: float
    partials: Array


@dataclass(frozen=True)
class Reading:
    """The linear system at an instant.

    Attributes
    ----------
    actual, indicated : ndarray, shape (4,)
        Polar states without errors.
    by_source : ndarray, shape (8, sources)
        Sensitivities of the two.
    time, peak : float
        s from the start of navigation; largest specific force so far, m/s^2.
    time_by_source, peak_by_source : ndarray, shape (sources,)
    """

    actual: Array
    indicated: Array
    by_source: Array
    time: float
    time_by_source: Array
    peak: float
    peak_by_source: Array


class NoLinearSystem(ArithmeticError):
    """The flight without errors does not end as it should; the message says how."""


@dataclass(frozen=True)
class LinearFlight:
    """The linear system along the flight without errors."""

    navigation: GuidedNavigation
    phases: tuple[_Phase, ...]
    peaks: tuple[Peak, ...]

    @property
    def final_time(self) -> float:
        """End of the flight without errors, s from the start of navigation."""
        return self.phases[-1].end

    @property
    def senses_all(self) -> bool:
        """Whether the navigator senses where the truth goes all the time."""
        return all(phase.accelerometers_on for phase in self.phases)

    def at(self, time: float) -> Reading:
        """Read the system at a fixed time, s from the start of navigation."""
        number = int(np.searchsorted([phase.end for phase in self.phases[:-1]], time, side="right"))
        phase = self.phases[number]
        joint = phase.solution(time)
        size, partials = phase.force(joint)
        largest = max((peak for peak in self.peaks if peak.time <= time), key=lambda peak: peak.size, default=None)
        if largest is not None and largest.size >= size:
            size, partials = largest.size, largest.partials
        return self._reading(joint, time, np.zeros(SOURCES), size, partials)

    @property
    def end(self) -> Reading:
        """The system at the sample's own end."""
        phase = self.phases[-1]
        time, joint = phase.end, phase.solution(phase.end)
        rates = phase.rates(time, joint)[:8]
        ends = 4 if self.navigation.guidance.final == "indicated" else 0
        by_source = joint[8:].reshape(8, SOURCES)
        shift = -by_source[ends] / rates[ends]
        moved = np.concatenate([joint[:8], (by_source + rates[:, None] * shift).ravel()])
        largest = max(self.peaks, key=lambda peak: peak.size)
        return self._reading(moved, time, shift, largest.size, largest.partials)

    def _reading(self, joint: Array, time: float, shift: Array, peak: float, peak_by_source: Array) -> Reading:
        by_source = joint[8:].reshape(8, SOURCES).copy()
        if self.senses_all:  # no error but rounding
            told = self.navigation.guidance.navigator_start == "truth"
            alike = slice(int(GuidedError.TRUE_ALTITUDE if told else GuidedError.DENSITY), SOURCES)
            by_source[4:, alike] = by_source[:4, alike]
        return Reading(joint[:4], joint[4:8], by_source, time, shift, peak, peak_by_source)


def _stretches(navigation: GuidedNavigation, steps: Steps) -> Iterator[tuple[float, float, int, int]]:
    """Join the steps between events: begin, end, number of the first step, and the event at the end."""
    times, events = steps.flight.times[0], steps.modes[EVENT]
    kinks = (LEVEL, ABOVE, BELOW, NEXT_KNOT, FINAL_INDICATED)
    ends = [step + 1 for step in range(len(events)) if events[step] in kinks or step == len(events) - 1]
    for first, last in pairwise([0, *ends]):
        event = int(events[last - 1])
        if times[last] > times[first]:
            yield float(times[first]), float(times[last]), first, event if event in kinks else NONE


def fly_linear(navigation: GuidedNavigation) -> LinearFlight:
    """Integrate the variational equations along the flight without errors.

    Raises `NoLinearSystem` when that flight does not end by falling through the final altitude.
    """
    steps = simulate_steps(navigation, np.zeros(SOURCES))
    ending = Ending(int(steps.flight.endings[0]))
    if ending != Ending.ARRIVED:
        raise NoLinearSystem(navigation.failure(ending).message)
    radius = navigation.nominal_start[0]
    by_source = np.zeros((8, SOURCES))
    arcs = np.diag([1.0, 1.0 / radius, 1.0, 1.0 / radius])
    by_source[4:, :4] = arcs
    true = slice(int(GuidedError.TRUE_ALTITUDE), int(GuidedError.DENSITY))
    by_source[:4, true] = arcs
    if navigation.guidance.navigator_start == "truth":
        by_source[4:, true] = arcs
    phases: list[_Phase] = []
    for begin, end, first, event in _stretches(navigation, steps):
        state = np.concatenate([steps.flight.actual[0, first], steps.flight.indicated[0, first]])
        numbers, polynomials = _constants(navigation, steps, first)
        if phases:
            by_source = _past_kink(phases[-1], navigation, numbers, polynomials, state, by_source)
        args = (numbers, polynomials, EQUIPMENT)
        joint = np.concatenate([state, by_source.ravel()])
        solution = integrate(variational_rates, (begin, end), joint, TOLERANCES, args, dense_output=True)
        if solution.status != 0:
            raise NoLinearSystem(f"the variational equations broke down at {solution.t[-1]:.1f} s: {solution.message}")
        by_source = solution.y[8:, -1].reshape(8, SOURCES)
        phases.append(_Phase(begin, end, numbers, polynomials, event, solution.sol))
    return LinearFlight(navigation, tuple(phases), tuple(_peaks(phases, navigation)))


def _constants(navigation: GuidedNavigation, steps: Steps, step: int) -> tuple[Array, Array]:
    """Return the constants of the equations in a step, and the polynomials of the lift law."""
    tables, modes = tables_of(navigation), steps.modes[:, step]
    count, knot = len(tables.polynomials), int(modes[KNOT])
    polynomials, begin, law, lift = np.zeros((4, 1)), 0.0, tables.law, tables.lift
    if law == FOLLOWING:
        assert navigation.guidance.law is not None
        knots = navigation.guidance.law.knots
        if knot < 0:
            polynomials[0, 0] = lift
        elif knot < count:
            polynomials, begin = tables.polynomials[knot], float(knots[knot])
        else:
            powers = (knots[-1] - knots[-2]) ** np.arange(tables.polynomials.shape[2])
            polynomials = (tables.polynomials[-1] @ powers)[:, None]
    numbers = [
        *tables.layers[modes[BAND]], tables.ballistic, modes[REGIME], tables.limit if modes[REGIME] else 0.0,
        float(tables.input_indicated), begin, law, tables.gain, lift, navigation.theta_axes, tables.on[modes[BAND]],
    ]  # fmt: skip
    return np.array(numbers, dtype=float), np.ascontiguousarray(polynomials, dtype=float)


def _past_kink(
    before: _Phase, navigation: GuidedNavigation, numbers: Array, polynomials: Array, state: Array, by_source: Array
) -> Array:
    """Carry sensitivities past the end of a phase: ``S + (F- - F+) dt``.

    F jumps where the accelerometers are switched; at a knot of the lift law by what its polynomials leave of the
    nominal L/D, which counts where a later skip magnifies it.
    """
    joint = np.concatenate([state, by_source.ravel()])
    after = variational_rates(before.end, joint, numbers, polynomials, EQUIPMENT)[:8]
    jump = before.rates(before.end, joint)[:8] - after
    return np.asarray(by_source + np.outer(jump, _kink_shift(before, navigation, joint)))


def _kink_shift(phase: _Phase, navigation: GuidedNavigation, joint: Array) -> Array:
    """Compute the change of the instant at which a phase ends, by source, s."""
    rates, by_source = phase.rates(phase.end, joint)[:8], joint[8:].reshape(8, SOURCES)
    if phase.event == LEVEL:
        return np.asarray(-by_source[0] / rates[0])
    if phase.event == FINAL_INDICATED:
        return np.asarray(-by_source[4] / rates[4])
    if phase.event == NONE:
        return np.zeros(SOURCES)
    begin = 4 if navigation.guidance.input == "indicated" else 0
    if phase.event == NEXT_KNOT:
        return np.asarray(-by_source[begin + 1] / rates[begin + 1])
    _, gradient = phase.command(joint[begin : begin + 4])
    return np.asarray(-(gradient @ by_source[begin : begin + 4]) / (gradient @ rates[begin : begin + 4]))


def _peaks(phases: list[_Phase], navigation: GuidedNavigation) -> Iterator[Peak]:
    """Find the local maxima of the specific force: within phases, at their ends, at the start and the end."""
    first, last = phases[0], phases[-1]
    if first.growth(first.begin) <= 0.0:
        yield Peak(first.begin, *first.force(first.solution(first.begin)))
    for number, phase in enumerate(phases):
        nodes = phase.solution.ts
        times = (nodes[:-1, None] + np.arange(PROBES) / PROBES * np.diff(nodes)[:, None]).ravel()
        times = np.append(times, phase.end)
        growth = growths(phase.solution(times).T[:, :8].copy(), times, phase.numbers, phase.polynomials)
        for at in np.flatnonzero((growth[:-1] > 0.0) & (growth[1:] <= 0.0)):
            a, b = float(times[at]), float(times[at + 1])
            top = float(brentq(phase.growth, a, b, xtol=1e-13)) if growth[at + 1] < 0.0 else b
            yield Peak(top, *phase.force(phase.solution(top)))
        following = phases[number + 1] if phase is not last else None
        if growth[-1] > 0.0 and (following is None or following.growth(following.begin) <= 0.0):
            joint = phase.solution(phase.end)
            size, partials = phase.force(joint)
            yield Peak(phase.end, size, partials + growth[-1] * _kink_shift(phase, navigation, joint))
