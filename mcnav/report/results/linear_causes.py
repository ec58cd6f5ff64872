"""Linear causes of an output's error at an epoch of a run."""

from __future__ import annotations

import numpy as np

from mcnav.analysis.causes import causes_of
from mcnav.analysis.filter_consistency import MEAN
from mcnav.arrays.products import transformed_variances
from mcnav.report.columns.requirements import NAMED
from mcnav.report.results.model import RunAnalysis


def causes_at(content: RunAnalysis, time: float, output: int) -> list[tuple[str, float]]:
    """List the largest causes of an output's linear mean square at an epoch, for people, with their shares.

    Parameters
    ----------
    time : float
        Of the epoch, in the unit of the run's histories; without linear analysis there the list is empty.
    """
    known, model = content.development, content.model
    if known is None or not len(known.times):
        return []
    at = int(np.argmin(np.abs(known.times - time)))
    if not np.isclose(known.times[at], time, rtol=1e-9):
        return []
    row = known.partials[at, [output]]
    names = [source.name for source in content.manifest.model.sources]
    attributed = row * (row @ model.covariance)  # with half of what correlations add
    variances = {name: attributed[:, k] for k, name in enumerate(names)}
    variances |= {name: process[at, [output]] for name, process in known.processes.items()}
    means = {name: row[:, k] * model.mean[k] for k, name in enumerate(names) if model.mean[k]}
    noise = sum(float(process[at, output]) for process in known.processes.values())
    total = float(transformed_variances(row, model.covariance)[0]) + noise + float((row @ model.mean)[0] ** 2)
    labels = dict(zip([*names, *model.processes], content.cause_names, strict=True))
    return [
        (f"mean of {labels[cause.name.removeprefix(MEAN)]}" if cause.name.startswith(MEAN) else labels[cause.name],
         cause.share)
        for cause in causes_of(variances, means, total)[:NAMED]
    ]  # fmt: skip
