"""A filter's consistency with given ratios of true to filter sigma, for tests of what is made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from mcnav.analysis.filter_consistency import (
    Band,
    CertainDeparture,
    FilterConsistency,
    Finding,
    GroupConsistency,
    Honesty,
    NeglectedError,
    SensorConsistency,
    SigmaConsistency,
    Whiteness,
)
from mcnav.arrays.types import Array

TIMES = np.linspace(0.0, 60.0, 61)
OUTAGE = (20.0, 25.0)
CONFIDENCE, TOLERANCE = 0.95, 0.05

OUTPUTS = {
    **dict.fromkeys(("position_north", "position_east", "position_down"), ("m", "m", 1.5)),
    **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), ("m/s", "m/s", 0.02)),
    **dict.fromkeys(("tilt_north", "tilt_east", "heading"), ("rad", "mrad", 1e-4)),
}
"""Unit, unit shown and sigma of each output."""

STATES = {
    **dict.fromkeys((f"gyro_bias_{axis}" for axis in "xyz"), ("rad/s", "deg/h", 5e-8)),
    **dict.fromkeys((f"accelerometer_bias_{axis}" for axis in "xyz"), ("m/s^2", "ug", 3e-4)),
}
GROUPS = {"all": 15, "navigation": 9, "position": 3, "velocity": 3, "attitude": 3, "sensors": 6}
SENSORS = {"gnss": 6, "altimeter": 1}


def quantile(probability: float, degrees: float) -> float:
    """Quantile of chi-square over its degrees of freedom."""
    return float(2.0 * special.gammaincinv(0.5 * degrees, probability) / degrees)


def bounds(size: int, samples: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Where the mean of so many chi-square variates lies."""
    tail = 0.5 * (1.0 - confidence)
    return size * quantile(tail, size * samples), size * quantile(1.0 - tail, size * samples)


def band(value: Array, relative: float) -> Band:
    """Intervals of one width relative to the value at each epoch, and of twice that at all together."""
    each, together = (np.column_stack([value * (1.0 - width), value * (1.0 + width)])
                      for width in (relative, 2.0 * relative))  # fmt: skip
    return Band(value, each, together)


def in_outage() -> Array:
    """One in the outage, zero elsewhere."""
    begin, end = OUTAGE
    return ((begin <= TIMES) & (end > TIMES)).astype(float)


def sigma_consistency(
    name: str, unit: str, shown_in: str, sigma: float, ratio: Array, samples: int, shared: bool
) -> SigmaConsistency:
    """Return an output, or another state where nothing is ``shared`` with the samples."""
    grown = sigma * (1.0 + 4.0 * np.exp(-TIMES / 3.0) + 8.0 * in_outage() * (TIMES - OUTAGE[0]) / 5.0)
    within = [special.erf(multiple / np.sqrt(2.0) / ratio) for multiple in (1.0, 3.0)] if shared else [None, None]
    nominal = [float(special.erf(multiple / np.sqrt(2.0))) for multiple in (1.0, 3.0)]
    reach = [3.0 * np.sqrt(p * (1.0 - p) / samples) for p in nominal]
    return SigmaConsistency(
        name, unit, shown_in, true=grown * ratio, filter=grown, ratio=band(ratio, 1.4 / np.sqrt(samples)),
        true_linear=grown * ratio, filter_linear=grown,
        within_1=None if within[0] is None else band(within[0], 0.02),
        within_3=None if within[1] is None else band(within[1], 0.002),
        bounds_1=(nominal[0] - reach[0], nominal[0] + reach[0]),
        bounds_3=(nominal[1] - reach[1], min(nominal[1] + reach[1], 1.0)),
        finding=Finding(Honesty.CONSISTENT, float(ratio[-1])),
    )  # fmt: skip


def sensor_consistency(name: str, size: int, ratio: Array, samples: int, rejected: float = 0.0) -> SensorConsistency:
    """Return a sensor with 60 updates between two epochs, none in the outage."""
    silent = (in_outage() > 0.0) | (TIMES == 0.0)
    ends = np.tile(bounds(size, 60 * samples), (len(TIMES), 1))
    nis = np.where(silent, np.nan, size * ratio**2)
    return SensorConsistency(
        name, size, accepted=np.where(silent, 0.0, 60.0 - rejected), rejected=np.where(silent, 0.0, rejected),
        nis=band(nis, 0.01), bounds=np.where(silent[:, None], np.nan, ends), nis_whole=float(np.nanmean(nis)),
        interval_whole=(0.99 * float(np.nanmean(nis)), 1.01 * float(np.nanmean(nis))),
        bounds_whole=bounds(size, 60 * samples * 54), beyond=bool(np.nanmean(nis) > 1.05 * size),
        whiteness=Whiteness(0.0012, (-0.001, 0.0034), 0.0025, beyond=False),
        finding=Finding(Honesty.CONSISTENT, float(np.sqrt(np.nanmean(nis) / size))),
    )  # fmt: skip


def group_consistency(name: str, size: int, ratio: Array, samples: int) -> GroupConsistency:
    """Return a group whose NEES is that of a ratio of sigmas."""
    relative = np.sqrt(2.0 / (size * samples))
    return GroupConsistency(
        name, size, band(size * ratio**2, 2.0 * relative), bounds(size, samples),
        bounds(size, samples, 1.0 - (1.0 - CONFIDENCE) / (6 * len(TIMES))), band(ratio, relative), ratio,
        Finding(Honesty.CONSISTENT, float(ratio[-1])),
    )  # fmt: skip


def consistency(
    factor: float = 1.0,
    samples: int = 500,
    outputs: Mapping[str, tuple[str, str, float]] = OUTPUTS,
    neglected: Sequence[NeglectedError] = (),
    rejected: float = 0.0,
) -> FilterConsistency:
    """Return the consistency of a filter whose sigmas are right except in the outage, where errors are larger."""
    ratio = 1.0 + (factor - 1.0) * in_outage()
    wavy = ratio * (1.0 + 0.01 * np.sin(TIMES))
    verdict = Honesty.OPTIMISTIC if factor > 1.0 else Honesty.PESSIMISTIC if factor < 1.0 else Honesty.CONSISTENT
    found = {} if factor == 1.0 else {"begin": OUTAGE[0], "end": 24.0, "worst": 24.0}
    departures = tuple(
        CertainDeparture(verdict, name, size, each, (0.9 * each, 1.1 * each), OUTAGE[0], 24.0, 24.0)
        for name, size, each in (("position", 3, factor), ("position_north", 0, factor * (1.0 + 0.01 * np.sin(24.0))))
    )
    return FilterConsistency(
        "time [min]", TIMES, samples, CONFIDENCE, TOLERANCE,
        groups=tuple(group_consistency(name, size, wavy, samples) for name, size in GROUPS.items()),
        outputs=tuple(
            sigma_consistency(name, *each, wavy * (1.0 + 0.004 * k), samples, shared=True)
            for k, (name, each) in enumerate(outputs.items())
        ),
        states=tuple(
            sigma_consistency(name, *each, wavy * (1.0 + 0.01 * k), samples, shared=False)
            for k, (name, each) in enumerate(STATES.items())
        ),
        sensors=tuple(sensor_consistency(name, size, wavy, samples, rejected) for name, size in SENSORS.items()),
        verdict=verdict, group="position" if found else "", factor=factor, output="position_north" if found else "",
        neglected=tuple(neglected), neglected_at=24.0 if neglected else None,
        neglected_output="position_north" if neglected else "",
        covariance=np.diag([each[2] ** 2 for each in outputs.values()]), on_groups=verdict, on_outputs=verdict,
        departures=departures if found else (), **found,
    )  # fmt: skip
