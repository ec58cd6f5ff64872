"""Simulated static records of the catalogue's grades, and whether what is identified from them is right.

A record has a day of readings, one a second, of white noise and a Gauss-Markov process as the grade's instrument has
them; see `tests.calibration.static_records`, which shares nothing with the estimator.

`identify, GRADE INSTRUMENT`
    Intervals of what is identified, with the model that is chosen; false alarms of the test of fit, and of
    quantization, which no grade has.
`identify, GRADE INSTRUMENT, drift`
    The temperature rises by 1 °C in an hour, and the bias by a tenth of the grade's for each °C.
`identify, GRADE INSTRUMENT, line`
    A vibration of a tenth of a hertz with an amplitude of a twentieth of the white noise's sigma in a reading.
`identify, GRADE INSTRUMENT, quantization`
    The accumulated angle or velocity is counted in steps of twice the white noise's sigma in a reading.
`identify, GRADE INSTRUMENT, stuck`
    One reading in a hundred, in one stretch, is that before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Estimate
from mcnav.identification.identify import IdentifiedNoise, identify_noise
from mcnav.systems.ins.imu.instruments import Noise
from mcnav.systems.ins.tables.imu import grade_sizes
from tests.calibration.cells import Cell, Tally, tally
from tests.calibration.static_records import TrueNoise, simulate_record

IDENTIFY: Final = "identify"
"""Beginning of the names of the systems."""

GRADES: Final = ("strategic", "navigation", "tactical", "consumer")
INSTRUMENTS: Final = ("gyro", "accelerometer")

READINGS: Final = 86_400
INTERVAL: Final = 1.0
"""Readings of a record, and between them, s."""

EVERY: Final = 10
"""Records of which one is simulated again with each disturbance."""

SHARE: Final = 3
"""Campaigns of other kinds for which there is one record of each grade in `make calibrate`."""

DRIFT: Final = 0.1
"""Change of the bias for 1 °C, as a share of the grade's bias; the temperature rises by 1 °C in an hour."""

ABSENT: Final = "quantization that is not there"
FIT: Final = "test of fit, of the whole spectrum"
IDENTIFIED: Final = "is identified"

Statement = tuple[str, str, bool]


def run_identification_trials(trials: int, jobs: int) -> Tally:
    """Simulate so many records of each instrument of each grade, with seeds 0, 1, ..."""
    return tally(trials, jobs, [(grade, instrument) for grade in GRADES for instrument in INSTRUMENTS], _count)


@cache
def truth(grade: str, instrument: str) -> tuple[TrueNoise, float]:
    """Return the noise of an axis of a grade's instrument, and its bias, SI."""
    sizes = grade_sizes(grade)
    noise: Noise = getattr(sizes.processes, instrument)
    true = TrueNoise(
        float(noise.random_walk[0]), float(noise.instability[0]), float(noise.correlation_time[0]),
        float(noise.rate_random_walk[0]), float(noise.quantization[0]),
    )  # fmt: skip
    return true, sizes.sigmas[f"{instrument}_bias_x"]


def simulate(grade: str, instrument: str, seed: int) -> Array:
    """Simulate a record, shape (`READINGS`,)."""
    key = GRADES.index(grade), INSTRUMENTS.index(instrument), 6
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))
    return simulate_record(generator, READINGS, INTERVAL, truth(grade, instrument)[0])


def _count(kind: tuple[str, str], seeds: Sequence[int], result: Tally) -> None:
    grade, instrument = kind
    true, bias = truth(grade, instrument)
    system = f"{IDENTIFY}, {grade} {instrument}"
    for seed in seeds:
        readings = simulate(grade, instrument, seed)
        for statement, sort, hit in statements(identify_noise(readings, INTERVAL), true):
            result.add(Cell(sort, system, statement, "normal", "random", READINGS), hit)
        for name, disturb in DISTURBANCES.items() if seed % EVERY == EVERY - 1 else ():
            hit = _noticed(name, identify_noise(disturb(readings, true, bias), INTERVAL))
            result.add(Cell("power", f"{system}, {name}", "is noticed", "normal", "random", READINGS), hit)


def statements(noise: IdentifiedNoise, true: TrueNoise) -> Iterator[Statement]:
    """Yield what is said of an undisturbed record, and whether it is right."""
    of: Mapping[str, Estimate] = {each.name: each for each in noise.estimates}
    for name in ("random_walk", "instability", "correlation_time"):
        known = name in of and of[name].identified
        yield f"{name.replace('_', ' ')} {IDENTIFIED}", "power", known
        if known:
            yield name.replace("_", " "), "coverage", of[name].low <= getattr(true, name) <= of[name].high
    yield ABSENT, "false alarm", "quantization" in of
    yield FIT, "false alarm", (noise.of_all or noise.goodness).rejected


def _drift(readings: Array, true: TrueNoise, bias: float) -> Array:
    hours = np.arange(len(readings)) * INTERVAL / 3600.0
    return np.asarray(readings + DRIFT * bias * hours)


def _line(readings: Array, true: TrueNoise, bias: float) -> Array:
    amplitude = 0.05 * true.random_walk / np.sqrt(INTERVAL)
    return np.asarray(readings + amplitude * np.sin(0.2 * np.pi * INTERVAL * np.arange(len(readings))))


def _quantization(readings: Array, true: TrueNoise, bias: float) -> Array:
    step = 2.0 * true.random_walk * np.sqrt(INTERVAL)
    counted = np.round(np.cumsum(readings) * INTERVAL / step) * step
    return np.asarray(np.diff(counted, prepend=0.0) / INTERVAL)


def _stuck(readings: Array, true: TrueNoise, bias: float) -> Array:
    held = readings.copy()
    begin = len(readings) // 3
    held[begin : begin + len(readings) // 100] = readings[begin]
    return held


DISTURBANCES: Final[Mapping[str, Callable[[Array, TrueNoise, float], Array]]] = {
    "drift": _drift, "line": _line, "quantization": _quantization, "stuck": _stuck,
}  # fmt: skip
"""Disturbances that no grade has, by name."""


def _noticed(name: str, noise: IdentifiedNoise) -> bool:
    """Tell whether a disturbance is noticed: quantization by the model, the others by the test of fit.

    A line is noticed where no model fits the whole spectrum as well.
    """
    if name == "quantization":
        return any(each.name == name and each.identified for each in noise.estimates)
    return noise.goodness.rejected or (noise.of_all is not None and noise.of_all.rejected)
