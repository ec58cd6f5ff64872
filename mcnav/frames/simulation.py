"""The runner: draws through a system, by workers of joblib."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.contract.errors import ScenarioError
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.execution.threads import one_thread
from mcnav.frames.system import System
from mcnav.frames.systems import Simulatable, system_of
from mcnav.runner.worth import worth_from
from mcnav.sampler.errors import SAMPLING, errors_of

REASON: Final = "reason"
"""Column of results that says why a sample failed; there is one where any did."""

COST: Final = {"loky": 2.0, "threading": 0.1}
"""Time that workers take until they simulate, s: processes import for more than a second."""


def simulate(
    system: Simulatable,
    draws: pd.DataFrame,
    jobs: int = 2,
    outputs: str | Sequence[str | Output] = (),
) -> pd.DataFrame:
    """Run every draw through a system: the nonlinear truth and indicated trajectories of each sample.

    Parameters
    ----------
    system : callable, object, class, mapping, str, Path or Campaign
        A function of errors, shape (n, sources) to (n, outputs); an object with ``propagate`` or ``fly``; a class of
        these, or a subclass of `mcnav.ClosedLoop`; the table of a scenario, ``{"type": "reentry", "trajectory": 4}``;
        or a campaign. Sizes of noise are in campaigns alone: `mcnav.Campaign`. A filter whose campaign has no errors
        believes those of the draws.
    draws : DataFrame, shape (n, sources)
        Errors, SI, by the names of their sources; of `mcnav.Errors.draw` or one's own. A function gets its columns in
        this order; other systems find them by name, and sources without a column are zero.
    jobs : int
        Workers. They are started where the samples take some seconds; results have the same bits for any number.
    outputs : str, or sequence of str or Output, optional
        Names of what a function returns; by default its attribute ``outputs``, the columns of the frame that it
        returns, or y1, y2, …

    Returns
    -------
    DataFrame, shape (n, outputs)
        SI, with the index of the draws. A sample that failed is a row of NaN; a further column ``reason`` then says
        why. ``attrs`` has ``units`` by output, and ``failed``, the number of such samples.

    Raises
    ------
    TypeError, ValueError, CampaignError
        When it is no system, or has no source of a column, or has it in another unit; when an error is not finite, or
        a function returns another shape than (n, outputs), changes the current folder, or closes files.
    RuntimeError
        When what is simulated ends a worker. The first samples run in this process, which ``os._exit`` would end.

    Examples
    --------
    >>> import mcnav as mc
    >>> draws = mc.Errors({"angle": 0.01, "speed": 0.5}).draw(1000, seed=1)
    >>> def impact(errors):
    ...     return ((100.0 + errors[:, 1]) ** 2 * np.sin(1.2 + 2.0 * errors[:, 0]) / 9.80665)[:, None]
    >>> mc.simulate(impact, draws, outputs=["range"]).std().round(1)["range"]
    np.float64(11.7)
    """
    errors = _checked(draws)
    if isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1:
        raise ValueError(f"jobs must be a whole number of at least 1; got {jobs!r}")
    names = tuple(map(str, draws.columns))
    known = draws.attrs.get("units", {})
    sources = {name: known.get(name, "") for name in names}
    prepared = system_of(system, sources, errors[:64], outputs, errors_of(draws))
    placed = np.zeros((len(errors), len(prepared.sources)))
    placed[:, [prepared.sources.index(name) for name in names]] = errors
    seed = draws.attrs.get(SAMPLING, {}).get("seed", 0)
    try:
        result = _run(prepared, Batch(np.arange(len(placed)), placed, seed), jobs)
    except ScenarioError as refused:
        raise ValueError(str(refused)) from None
    table = pd.DataFrame(result.values, index=draws.index, columns=[output.name for output in prepared.outputs])
    if result.failures:
        table[REASON] = ["" if row not in result.failures else str(result.failures[row]) for row in range(len(table))]
    table.attrs = {
        "units": {output.name: output.unit for output in prepared.outputs},
        "failed": len(result.failures),
        **({SAMPLING: draws.attrs[SAMPLING]} if SAMPLING in draws.attrs else {}),
    }
    return table


def _checked(draws: Any) -> Array:
    """Return the errors of draws, shape (n, sources); `TypeError` or `ValueError` when they are none."""
    if not isinstance(draws, pd.DataFrame) or draws.empty:
        got = "an empty frame" if isinstance(draws, pd.DataFrame) else type(draws).__name__
        raise TypeError(
            "draws must be a frame with a row a sample and a column an error source, such as errors.draw(20_000); got "
            f"{got}"
        )
    if not draws.columns.is_unique:
        raise ValueError(f"draws must have a column a source; got {', '.join(map(str, draws.columns))}")
    for name, column in draws.items():
        if column.dtype.kind not in "biuf":
            raise ValueError(f"draws: {name} must be numbers; got dtype {column.dtype}")
        if not np.isfinite(column).all():
            raise ValueError(f"draws: {name} is not finite in row {column.index[~np.isfinite(column)][0]}")
    return np.asarray(draws.to_numpy(float))


def _run(system: System, samples: Batch, jobs: int) -> SimulationResult:
    """Simulate samples in chunks of the system; the first one tells whether further workers are worth their start.

    Before it one sample is simulated, so that what happens once, such as compilation, is not taken for its cost.
    """
    places = [slice(begin, begin + system.chunk) for begin in range(0, len(samples.errors), system.chunk)]
    if jobs > 1 and len(places) > 2:
        _simulate(system, samples[:1])
    begun = time.perf_counter()
    results = [_simulate(system, samples[places[0]])]
    left = places[1:]
    if time.perf_counter() - begun > worth_from(jobs, len(left), COST[system.backend]):
        results += _by_workers(system, [samples[place] for place in left], jobs)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("once")
            results += [_simulate(system, samples[place]) for place in left]
    failures: dict[int, Any] = {}
    for place, result in zip(places, results, strict=True):
        failures |= {place.start + row: failure for row, failure in result.failures.items()}
    return SimulationResult(np.concatenate([result.values for result in results]), failures)


def _by_workers(system: System, chunks: Sequence[Batch], jobs: int) -> list[SimulationResult]:
    """Simulate chunks by workers of joblib; `RuntimeError` when the code of the system ends one."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import BrokenProcessPool

    try:
        workers = Parallel(n_jobs=jobs, backend=system.backend)
        return list(workers(delayed(_simulate)(system, chunk) for chunk in chunks))
    except BrokenProcessPool:
        first, last = int(chunks[0].index[0]), int(chunks[-1].index[-1])
        raise RuntimeError(
            f"what was simulated ended its process within samples {first:,} to {last:,}: it exits, crashes, closes "
            "files or takes too much memory; raise an exception instead"
        ) from None


def _simulate(system: System, samples: Batch) -> SimulationResult:
    """Simulate one chunk, with one thread for linear algebra, on whose number sums depend."""
    with one_thread():
        return system.simulate(samples)
