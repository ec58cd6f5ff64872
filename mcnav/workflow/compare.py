"""Compare several run folders: the inputs that differ, and the outputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.run_comparison import SampleSet, change
from mcnav.analysis.summary import Summary
from mcnav.contract.quantities import end_words
from mcnav.errors import reading_file
from mcnav.execution.threads import one_thread
from mcnav.report.document.html import page_html, parts_html
from mcnav.report.pages.comparison import Row, change_table, input_table, inputs, outputs, ratios
from mcnav.report.pages.comparison import page as comparison_page
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.means import large_means_of
from mcnav.store.manifest import Manifest
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse
from mcnav.workflow.stored_summary import stored_summary, summary_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as MplFigure

SHOWN: Final = ["unit", "sigma_before", "sigma_after", "change_ratio", "change"]
"""Columns of a comparison that its text shows."""


@runtime_checkable
class Stored(Protocol):
    """A run that knows its folder, such as `mcnav.RunResult`."""

    @property
    def path(self) -> Path:
        """Run folder."""


@dataclass(frozen=True, repr=False)
class RunComparison:
    """Several runs, compared with the first.

    Attributes
    ----------
    titles : tuple of str
        Titles of the runs.
    rows : tuple of Row
        One for each output that the first run shares with another, for each of these.
    confidence : float
        Confidence of all intervals together (Bonferroni).
    over_time : tuple of (Envelopes or None)
        Errors over time of each run, where they are known.

    Examples
    --------
    >>> import mcnav as mc
    >>> change = mc.compare_runs(["reports/first", "reports/second"])
    >>> list(change.outputs.xs("altitude", level="output")["change_ratio"].between(0.9, 1.1))
    [True]
    """

    titles: tuple[str, ...]
    summaries: tuple[Summary, ...]
    manifests: tuple[Manifest, ...]
    rows: tuple[Row, ...]
    confidence: float
    over_time: tuple[Envelopes | None, ...] = ()

    @property
    def inputs(self) -> pd.DataFrame:
        """Inputs that differ, as text with units: one row a key, one column a run."""
        return inputs(self.manifests).set_axis(list(self.titles), axis="columns")

    @property
    def outputs(self) -> pd.DataFrame:
        """Change of each output of a later run, in the unit of the column ``unit``: a row a ``run`` and ``output``.

        ``sigma_before``, ``sigma_after``, ``change`` in a word; ``change_ratio`` of the sigmas, with ``_from`` and
        ``_to`` at the confidence of all together; ``change_mean`` with ``change_mean_standard_error``;
        ``common_draws``.
        """
        return outputs(self.rows, self.titles)

    def plot(self) -> MplFigure:
        """Draw the change of each output's sigma with its interval; returns matplotlib's figure.

        Raises `ValueError` when no change has an interval.
        """
        drawn = ratios(self.rows, self.titles)
        if drawn is None:
            raise ValueError("no output of these runs has a change with an interval; run more samples")
        return drawn.figure()

    def __repr__(self) -> str:
        """Write the changes as a table."""
        heading = f"{', '.join(self.titles[1:]) or 'nothing'} compared with {self.titles[0]}"
        changes = self.outputs
        return heading if changes.empty else f"{heading}\n\n{changes[SHOWN].to_string()}"

    def _repr_html_(self) -> str:
        """Show the tables of the page on inputs and outputs."""
        words = end_words(self.manifests[0].model.outputs)
        tables = (
            input_table(self.titles, self.manifests),
            change_table(self.titles, self.rows, self.confidence, words),
        )
        return parts_html(tables)

    @property
    def page(self) -> str:
        """The comparison as one HTML page."""
        known = self.over_time or (None,) * len(self.titles)
        page = comparison_page(self.titles, self.summaries, self.manifests, self.rows, self.confidence, known)
        return page_html(page)


def compared_summary(path: Path) -> dict[str, Any]:
    """Read the summary of a finished run, whose whole manifest is checked: its inputs are compared.

    Raises `RunFolderError` when there is none, or it is damaged.
    """
    summary = summary_of(path)
    RunFolder(path).finished_manifest()
    return summary


def compare_runs(paths: Sequence[str | Path | Stored]) -> RunComparison:
    """Compare finished run folders with the first of them; nothing is simulated.

    Parameters
    ----------
    paths : sequence of str, Path or RunResult
        Run folders, at least one.

    Returns
    -------
    RunComparison
        ``.outputs``, ``.inputs`` and the page.

    Raises
    ------
    RunFolderError
        When one holds no finished run, or is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> change = mc.compare_runs(["reports/first", "reports/second"])
    >>> change.inputs.loc["seed"].tolist()
    ['1', '2']
    >>> change.outputs.index.names
    FrozenList(['run', 'output'])
    """
    if isinstance(paths, (str, Path)) or not paths:
        raise TypeError(f"compare_runs takes a list of run folders, at least one; got {paths!r:.80}")
    folders = [path.path if isinstance(path, Stored) else Path(path) for path in paths]
    with one_thread():
        summaries = tuple(stored_summary(folder) for folder in folders)
        runs, sample_sets = [], []
        for folder in folders:
            with reading_file(folder):
                runs.append(analyse(RunFolder(folder)))
                sample_sets.append(_sample_set(runs[-1]))
    first, confidence = runs[0], runs[0].criterion.confidence
    names = [[(output.name, output.unit) for output in run.manifest.model.outputs] for run in runs]
    pairs = [
        (later, name) for later in range(1, len(runs)) for name in names[0] if name in names[later]
    ]  # an output is the same where name and unit are
    each = 1.0 - (1.0 - confidence) / max(len(pairs), 1)
    large = [{mean.output for mean in large_means_of(run.summary)} for run in runs]
    rows = []
    for later, name in pairs:
        at = (names[0].index(name), names[later].index(name))
        before, after = sample_sets[0], sample_sets[later]
        enough = min(len(before.index), len(after.index)) >= 2
        spread = first.summary.sigma_linear[at[0]] > 0.0 or runs[later].summary.sigma_linear[at[1]] > 0.0
        about_zero = bool(spread) and (at[0] in large[0] or at[1] in large[later])
        common = same_draws(first, runs[later])
        comparison = change(before, after, at, common, each, about_zero) if enough else None
        shown_in = first.manifest.model.outputs[at[0]].shown_in
        nominal = _nominal(first, at[0]), _nominal(runs[later], at[1])
        rows.append(Row(later, *name, shown_in, comparison, nominal))
    manifests, known = tuple(run.manifest for run in runs), tuple(run.envelopes for run in runs)
    return RunComparison(titles(folders), summaries, manifests, tuple(rows), confidence, known)


def _nominal(run: RunAnalysis, output: int) -> float | None:
    """Return the value of an output on the nominal flight; none of a navigation error."""
    values = run.summary.nominal
    value = values[output] if values else None
    return None if value is None or math.isnan(value) else value


def titles(paths: Sequence[str | Path]) -> tuple[str, ...]:
    """Short names of folders: their last parts, or the whole paths where these are not different."""
    short = tuple(Path(path).resolve().name for path in paths)
    return short if len(set(short)) == len(short) else tuple(str(path) for path in paths)


def page_name(paths: Sequence[str | Path]) -> str:
    """Name the page of a comparison in a folder of its choice: by as many last parts of the paths as tell them apart.

    >>> page_name(["reports/mine", "reports/other"]), page_name(["one/run", "other/run"])
    ('mine_and_other.html', 'one-run_and_other-run.html')
    """
    parts = [Path(path).resolve().parts[1:] for path in paths]
    deepest = max(map(len, parts), default=1)
    names = (["-".join(pieces[-count:]) for pieces in parts] for count in range(1, deepest + 1))
    told = [name for name in names if len(set(name)) == len(name)] or [[each[-1] for each in parts]]
    return f"{'_and_'.join(told[0])}.html"


def same_draws(one: RunAnalysis, other: RunAnalysis) -> bool:
    """Return whether samples of one index come from the same random numbers in both runs."""
    first, second = (
        (each.seed, each.design, each.sampling_design.block_length, [source.name for source in each.model.sources])
        for each in (one.manifest, other.manifest)
    )
    return first == second


def _sample_set(run: RunAnalysis) -> SampleSet:
    samples = run.samples
    succeeded = np.isfinite(samples.outputs).all(axis=1)
    index, errors, outputs = samples.index[succeeded], samples.errors[succeeded], samples.outputs[succeeded]
    linear = samples.linear[succeeded] if run.model.processes else None
    quantities = run.manifest.model.outputs
    return SampleSet(run.model, index, errors, outputs, run.manifest.sampling_design, linear, quantities)
