"""Simulated static records of white noise and one or two slow processes: what is said of each, and how often rightly.

A record has `READINGS` readings, one a second, of `tests.calibration.static_records`; its white noise has N = 1. Sizes
are such that each process stands out of the white noise at some hundred of the lowest ordinates.

Coverage is that of intervals of identified parameters whose process is certain. Where it is not, the program says that
it cannot tell, which is counted as such. A second process moves N or K where the best model without it misses N or K by
more than half its interval: then the second one is to be found, in the model or by the test of fit.

With 300 records a rate of 95 % leaves 93.5 to 96.5 % by chance in about a quarter of the cases. A low rate is thus
measured again with other records: ``count_records(case, range(100_000, 100_600), Tally())``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.identify import IdentifiedNoise, identify_noise
from mcnav.identification.processes import CORRELATION_TIME
from tests.calibration.cells import Cell, Tally, tally
from tests.calibration.identification_trials import IDENTIFY
from tests.calibration.static_records import TrueNoise, simulate_record

if TYPE_CHECKING:
    import pandas as pd

READINGS: Final = 8_192
INTERVAL: Final = 1.0

CASES: Final[Mapping[str, TrueNoise]] = {
    "white noise": TrueNoise(1.0),
    "flicker": TrueNoise(1.0, flicker=0.3),
    "faint flicker": TrueNoise(1.0, flicker=0.12),
    "walk": TrueNoise(1.0, rate_random_walk=0.02),
    "faint walk": TrueNoise(1.0, rate_random_walk=0.004),
    "Gauss-Markov": TrueNoise(1.0, 0.3, 100.0),
    "slow Gauss-Markov": TrueNoise(1.0, 0.3, 1000.0),
    "flicker and walk": TrueNoise(1.0, flicker=0.3, rate_random_walk=0.02),
    "flicker and Gauss-Markov": TrueNoise(1.0, 0.5, 30.0, flicker=0.3),
    "walk and Gauss-Markov": TrueNoise(1.0, 0.5, 20.0, rate_random_walk=0.02),
}
"""Noise of the records by name."""

SLOW: Final = ("flicker", "rate_random_walk", "instability")
"""Sizes of slow processes."""

SHOWN: Final = ("random walk", "flicker", "rate random walk", "instability", "correlation time")
"""Intervals whose coverage the documentation states."""

FEWEST: Final = 100
"""Certain values from which a rate of coverage is stated."""

CANNOT: Final = "cannot tell the slow processes"
FALSE: Final = "a process that is not there is certain"
FIT: Final = "test of fit, of the whole spectrum"
SECOND: Final = "a second process that moves N or K is found"

Statement = tuple[str, str, bool]


def run_slow_trials(trials: int, jobs: int) -> Tally:
    """Simulate so many records of each case, with seeds 0, 1, ..."""
    return tally(trials, jobs, list(CASES), count_records)


def simulate(case: str, seed: int) -> Array:
    """Simulate a record, shape (`READINGS`,)."""
    key = list(CASES).index(case), 7
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))
    return simulate_record(generator, READINGS, INTERVAL, CASES[case])


def count_records(case: str, seeds: Sequence[int], result: Tally) -> None:
    """Count the statements on records of a case."""
    for seed in seeds:
        noise = identify_noise(simulate(case, seed), INTERVAL)
        for statement, kind, hit in statements(noise, CASES[case]):
            result.add(Cell(kind, f"{IDENTIFY}, {case}", statement, "normal", "random", READINGS), hit)


def statements(noise: IdentifiedNoise, true: TrueNoise) -> Iterator[Statement]:
    """Yield what is said of a record, and whether it is right."""
    estimates = {estimate.name: estimate for estimate in noise.estimates}
    certain = {name for name, estimate in estimates.items() if estimate.identified and estimate.certain}
    real = {name for name in ("random_walk", *SLOW) if getattr(true, name) > 0.0}
    for name in real | ({CORRELATION_TIME} if "instability" in real else set()):
        yield f"{name.replace('_', ' ')} is certain", "power", name in certain
        if name in certain:
            held = estimates[name].low <= getattr(true, name) <= estimates[name].high
            yield name.replace("_", " "), "coverage", held
    if len(real) > 1:
        yield CANNOT, "power", not set(estimates) <= certain
    yield FALSE, "power", not certain <= real | {CORRELATION_TIME}
    rejected = (noise.of_all or noise.goodness).rejected
    yield FIT, "false alarm", rejected
    if len(real) > 2 and _moves(noise, true):
        yield SECOND, "power", rejected or sum(name in estimates for name in SLOW) > 1


def rate_lines(table: pd.DataFrame) -> list[str]:
    """Return the documentation's table of a table of rates, in per cent."""
    lines = [
        "| records | N | B | K | σ | τ | cannot tell | wrongly certain | rejected by the test of fit |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for case in CASES:
        own = table[table["system"] == f"{IDENTIFY}, {case}"]
        stated = own[(own["kind"] != "coverage") | (own["campaigns"] >= FEWEST)]
        measured = dict(zip(stated["statement"], stated["measured"], strict=True))
        rates = (measured.get(statement) for statement in (*SHOWN, CANNOT, FALSE, FIT))
        cells = ["" if rate is None else f"{100.0 * rate:.1f}" for rate in rates]
        lines.append(f"| {' | '.join([case, *cells])} |".replace("  ", " "))
    return lines


def _moves(noise: IdentifiedNoise, true: TrueNoise) -> bool:
    """Tell whether N or K of the best model with a slow process less is off by more than its interval reaches."""
    single = next(
        candidate for candidate in noise.fitted.candidates
        if len(candidate.model.processes) == 2 and "quantization" not in candidate.model.parameters
    )  # fmt: skip
    return any(
        not estimate.low <= getattr(true, estimate.name) <= estimate.high
        for estimate in single.estimates(names=("random_walk", "rate_random_walk"))
        if getattr(true, estimate.name) > 0.0
    )
