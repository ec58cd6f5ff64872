"""Runs in notebooks and scripts: tables as pandas, figures as matplotlib, verdicts shown by Jupyter.

Tables label sources and outputs by their keys, such as ``altitude_rate``. Units are in a column ``unit`` where rows
differ in theirs, in a column's name as ``output altitude_rate [m/s]`` where columns do, and in ``.attrs["units"]`` of a
matrix, as ``{"index": {key: unit}, "columns": {key: unit}}``.

>>> import mcnav
>>> run = mcnav.run("campaigns/01_tn_d1772_trajectory_4.toml", "reports/first", samples=1000)  # doctest: +SKIP
>>> run.outputs[["sigma_linear", "ratio_paired", "verdict"]]                                   # doctest: +SKIP
>>> run.figure("scatter").axes[0].set_title("altitude and range")                              # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcnav.config.documents import Description
from mcnav.config.read import campaign_from
from mcnav.config.sweep_values import POINTS
from mcnav.errors import CampaignError, Problem, RunFolderError, reading_file, suggestion
from mcnav.execution.threads import one_thread
from mcnav.frames.covariance_verdict import draw_ratios
from mcnav.report.columns.output_columns import outputs_frame
from mcnav.report.columns.result_table import Units
from mcnav.report.columns.tables_over_time import epochs
from mcnav.report.document.framed import FramedPage
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Page
from mcnav.report.drawing.figure import Figure
from mcnav.report.exports.arrays import arrays
from mcnav.report.exports.dataset import dataset
from mcnav.report.pages.run.card import run_card
from mcnav.report.pages.run.page import figures
from mcnav.report.pages.run.sections.what_if import what_if_section, where_nonlinear
from mcnav.report.pages.sweep import frame
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import verdicts
from mcnav.store.run_folder import RunFolder
from mcnav.studies.boxed_run import campaign_to_run
from mcnav.studies.linear_answers import read_times
from mcnav.studies.run_remedies import advise_run
from mcnav.studies.sweep import JOBS, SweepPlan, run_sweep
from mcnav.systems.user.conformance import Check
from mcnav.workflow import run as workflow
from mcnav.workflow.analyse import analyse, samples_of
from mcnav.workflow.export import result_tables, write_export
from mcnav.workflow.what_if import what_if_of_run

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure as MplFigure


class RunResult:
    """A finished run folder, judged.

    Parameters
    ----------
    path : Path
        Run folder.

    Attributes
    ----------
    content : RunAnalysis
        All that its report shows: the linear model, the comparison, the samples.

    Raises
    ------
    RunFolderError
        When it holds no finished run, or is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> run = mc.open_run("reports/first")
    >>> run.outputs["unit"].to_dict()
    {'altitude': 'km', 'range': 'km', 'altitude_rate': 'm/s', 'range_rate': 'm/s'}
    >>> run.epochs.index.names
    FrozenList(['time from reentry [min]', 'output'])
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        folder = RunFolder(path)
        with one_thread(), reading_file(path):
            self.content: RunAnalysis = analyse(folder)
            _ = self.content.history, self.content.campaign, self.content.envelopes  # refused here when damaged

    @property
    def summary(self) -> Mapping[str, Any]:
        """The content of ``summary.json`` by key, in SI; matrices are arrays."""
        return self.content.summary.as_mapping

    @property
    def verdict(self) -> str:
        """``agrees``, ``partly``, ``differs`` or ``undecided``."""
        return verdicts.tone(self.content.summary)

    @cached_property
    def samples(self) -> pd.DataFrame:
        """A row a sample in SI, checked: ``index``, ``status``, ``error KEY [unit]``, ``output KEY [unit]``."""
        return samples_of(self.path)

    @property
    def outputs(self) -> pd.DataFrame:
        """Linear beside Monte Carlo, a row an output; sigmas and bias in the unit of the column ``unit``.

        ``ratio_paired_from`` and ``ratio_paired_to`` bound the paired ratio. The columns, and their names, are those of
        `mcnav.report.columns.output_columns` that reports and data files have.
        """
        compared = bool(self.content.summary.verdicts)  # not when too few samples succeeded
        table = outputs_frame(self.content.summary)
        return table if compared else table.iloc[:0]

    @cached_property
    def epochs(self) -> pd.DataFrame:
        """Errors over the flight: a row for each epoch and output, in the unit of the column ``unit``.

        Columns are the linear and the plain Monte Carlo mean and sigma, the interval of the latter at the campaign's
        confidence, percentiles of the stored samples and, with a filter, its sigma, the errors' root mean square, their
        ratio with its interval, and shares within one and three of the filter's sigmas.

        >>> run.epochs.xs("altitude", level="output")["sigma_linear"].plot()  # doctest: +SKIP

        Raises `ValueError` when the run has no errors over time.
        """
        known = epochs(self.content)
        if known is None:
            raise ValueError(f"{self.path}: the engine of this run computes no errors over time")
        return known.table.frame(indexed=True)

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All tables by name, a row an entry, as `mcnav export` writes them, in the units of their columns."""
        return {name: table.frame() for name, table in result_tables(self.content).items()}

    @cached_property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """P, S, Q and all covariances, SI; a row and a column a name; see `mcnav.report.exports.arrays`."""
        return arrays(self.content)

    def to_xarray(self, units: Units = "SI") -> xr.Dataset:
        """Return results over time and all matrices as an xarray data set; ``units`` as in `covariance`.

        Dimensions are ``time``, ``output``, ``source``, ``process`` and, with a filter, ``group``, ``state`` and
        ``sensor``; units are in coordinates such as ``output_unit``.

        Raises
        ------
        ImportError
            When xarray is not installed.
        ValueError
            When there are no such units.
        """
        _check_units(units)
        return dataset(self.content, units)

    def export(self, folder: str | Path, units: Units = "shown") -> list[Path]:
        """Write all tables as CSV and the matrices as ``.npz`` and ``.mat``; see `mcnav.workflow.export`."""
        _check_units(units)
        return write_export(self.content, Path(folder), units)

    @property
    def budget(self) -> pd.DataFrame:
        """Share of each source and process (row) in each output's linear variance (column), a number without unit."""
        shares, causes = self.content.budget.shares.T, [*self._keys("sources"), *self.content.model.processes]
        return pd.DataFrame(shares, index=causes, columns=self._keys("outputs"))

    @property
    def partials(self) -> pd.DataFrame:
        """The matrix P, outputs by sources, in SI: the unit of a row divided by that of a column."""
        table = pd.DataFrame(self.content.model.partials, index=self._keys("outputs"), columns=self._keys("sources"))
        table.attrs["units"] = {"index": self._units("outputs", "unit"), "columns": self._units("sources", "unit")}
        return table

    def covariance(self, kind: str = "paired", units: str = "SI") -> pd.DataFrame:
        """Return the final covariance, shape (outputs, outputs): the unit of a row times that of a column.

        Parameters
        ----------
        kind : str
            ``linear``, ``sample`` or ``paired``.
        units : str
            ``SI``, or ``shown``: those of `outputs` and of the report.

        Raises
        ------
        ValueError
            When there is no such kind, or there are no such units.
        """
        kinds = ("linear", "sample", "paired")
        if kind not in kinds:
            raise ValueError(f"kind must be one of {', '.join(kinds)}; got {kind!r}")
        _check_units(units)
        keys, covariance = self._keys("outputs"), getattr(self.content.comparison, f"covariance_{kind}")
        if units == "shown":
            covariance = covariance * np.outer(self.content.output_scale, self.content.output_scale)
        table = pd.DataFrame(covariance, index=keys, columns=keys)
        known = self._units("outputs", "unit" if units == "SI" else "shown_in")
        table.attrs["units"] = {"index": known, "columns": known}
        return table

    def _keys(self, which: str) -> list[str]:
        """Names of ``sources`` or ``outputs`` as files have them."""
        return [entry.name for entry in getattr(self.content.manifest.model, which)]

    def _units(self, which: str, field: str) -> dict[str, str]:
        """Units of ``sources`` or ``outputs`` by their keys."""
        return {entry.name: getattr(entry, field) for entry in getattr(self.content.manifest.model, which)}

    @cached_property
    def drawings(self) -> dict[str, Figure]:
        """The report's figures by name; Jupyter shows each, and ``.data`` is the table behind it."""
        return figures(self.content)

    def figure(self, name: str) -> MplFigure:
        """Draw one of the report's figures by matplotlib; its ``axes`` are free to be changed.

        Parameters
        ----------
        name : str
            A key of ``drawings``.
        """
        if name not in self.drawings:
            raise ValueError(f"the report has no figure {name!r:.60}{suggestion(name, list(self.drawings))}")
        return self.drawings[name].figure()

    def plot(self, ax: Any = None) -> Any:
        """Draw the paired sigma ratio of each output with its interval; returns matplotlib's axes.

        `figure` draws all figures of the report.
        """
        summary = self.content.summary
        return draw_ratios(self.outputs, "paired", summary.tolerance, summary.confidence, ax)

    @property
    def what_if(self) -> FramedPage | None:
        """The report's section "What if", with its sliders; none where nothing can be changed."""
        with one_thread():
            content = self.content
            outputs, fails = content.manifest.model.outputs, where_nonlinear(content.summary)
            section = what_if_section(what_if_of_run(content), outputs, content.looped, fails)
            name = content.summary.campaign
            return None if section is None else FramedPage(name, page_html(Page(name, "What if", name, (), [section])))

    def _repr_html_(self) -> str:
        """Show the verdicts, sigmas, error budget and errors over time, as a card."""
        with one_thread():
            return run_card(self.content)

    def __repr__(self) -> str:
        return f"{self.content.summary.campaign}: {verdicts.headline(self.content.summary)}"


def _check_units(units: str) -> None:
    if units not in ("SI", "shown"):
        raise ValueError(f"units must be one of SI, shown; got {units!r}")


OPTIONS: Final = {
    "--fresh replaces": "fresh=True replaces", "--out writes elsewhere": "another folder keeps both",
    "--force": "force=True", "--vary": "varied", "--against": "against", "--points": "points", "--at": "at",
}  # fmt: skip
"""Options of the program that messages name, and what a function of Python has in their place."""


@contextmanager
def _named_as_here() -> Iterator[None]:
    """Name arguments of Python in place of the program's options in what is refused."""
    try:
        yield
    except CampaignError as refused:
        raise CampaignError(
            [Problem(problem.file, _renamed(problem.key), _renamed(problem.message)) for problem in refused.problems]
        ) from None
    except RunFolderError as refused:
        raise RunFolderError(_renamed(str(refused))) from None


def _renamed(text: str) -> str:
    for option, argument in OPTIONS.items():
        text = text.replace(option, argument)
    return text


def open_run(path: str | Path) -> RunResult:
    """Open a finished run folder.

    Parameters
    ----------
    path : str or Path
        The folder.

    Raises
    ------
    RunFolderError
        When there is no such folder, or it holds no run, one that is not finished, or one that is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.open_run("reports/first").summary["samples"]
    200
    """
    return RunResult(Path(path))


def run(
    campaign: Description,
    folder: str | Path,
    *,
    engine: str | None = None,
    jobs: int = 2,
    fresh: bool = False,
    force: bool = False,
    **instead: int,
) -> RunResult:
    """Run a campaign into a run folder and write its report there; stored samples are not simulated again.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        A file, what `mcnav.read_campaign` made of one, or a dictionary of a file's shape, whose relative paths are
        found from the current folder.
    folder : str or Path
        Run folder; it is made.
    engine : str, optional
        ``ensemble`` (the default) or ``reference``.
    jobs : int
        Workers; they are started where the samples take some seconds.
    fresh : bool
        Replace an earlier run in the folder.
    force : bool
        Go on where partial derivatives are not settled; the report states it.
    **instead
        ``samples`` and ``seed`` in place of the campaign's.

    Raises
    ------
    CampaignError, RunFolderError
        As `mcnav.workflow.run.run_campaign`.

    Examples
    --------
    >>> import mcnav as mc
    >>> errors = {"altitude": "5 km", "misalignment": 2e-4}
    >>> campaign = mc.Campaign({"type": "reentry", "trajectory": 1}, errors, samples=200)
    >>> run = mc.run(campaign, "reports/mine")
    >>> run.outputs.index.tolist()
    ['altitude', 'range', 'altitude_rate', 'range_rate']
    """
    if isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1:
        raise ValueError(f"jobs must be a whole number of at least 1; got {jobs!r}")
    with _named_as_here():
        described = campaign_to_run(campaign_from(campaign, instead), None, instead)
        workflow.run_campaign(described, Path(folder), engine, jobs, fresh, force=force, advise=advise_run)
    return RunResult(Path(folder))


def run_campaign(
    campaign: Description, path: str | Path, engine: str | None, jobs: int, **options: Any
) -> workflow.Run:
    """Run a campaign as `run` does, and return what was done in place of the results.

    Parameters
    ----------
    campaign, path, engine, jobs, **options
        As `mcnav.workflow.run.run_campaign` takes them; the campaign in any of the forms that `run` takes.

    Raises
    ------
    CampaignError, RunFolderError
        As `run`.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.run_campaign("reports/first/campaign.toml", "reports/first", None, 1).simulated  # all are stored
    0
    """
    return workflow.run_campaign(
        campaign_to_run(campaign_from(campaign), None, {}), Path(path), engine, jobs, **options
    )


def check_scenario(campaign: Description) -> list[Check]:
    """Check the scenario of a campaign against the contract; see `mcnav.systems.user.conformance`.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        In any of the forms that `run` takes.

    Raises
    ------
    CampaignError
        When the campaign cannot be read.

    Examples
    --------
    >>> import mcnav as mc
    >>> class Mine:
    ...     sources = (mc.Source("a", "m", "m", 1.0),)
    ...     outputs = (mc.Output("b", "m", "m"),)
    ...     def propagate(self, errors):
    ...         return 2.0 * errors
    >>> all(check.passed for check in mc.check_scenario(mc.Campaign(Mine, {"a": 1.0})))
    True
    """
    return workflow.check_scenario(campaign_from(campaign))


def sweep(
    campaign: Description,
    varied: Mapping[str, str | Sequence[object]],
    *,
    against: str | Sequence[str] = (),
    points: int = POINTS,
    at: str | Sequence[float] = (),
    jobs: int = JOBS,
    examine: bool | None = None,
) -> pd.DataFrame:
    """Vary one or two keys of a campaign: accuracy by linear analysis at every point of a grid.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        In any of the forms that `run` takes; the file of a `Campaign` is read again.
    varied : mapping of str to str or sequence
        Ranges such as ``"0.001..1 deg/h"``, lists such as ``"1, 2, 5 deg/h"``, or sequences of quantities, by path.
        Without a unit they are SI.
    against : str or sequence of str
        Measures, such as ``position_horizontal`` or ``"r95(range, cross_range) < 2 km"``; by default those of the
        requirements, or the usual ones of the scenario.
    points : int
        Values of each range.
    at : str or sequence of float
        Times in the trajectory's time, such as ``"600 s, 25 min"``, or in seconds; by default the end.
    jobs : int
        Threads.
    examine : bool, optional
        Whether flights examine linear analysis where limits are just met and at the ends; by default where that is
        quick. Where it is not shown to hold there is a column ``linear analysis`` with the verdicts.

    Returns
    -------
    DataFrame, shape (points, measures)
        A row for each point, whose index is the keys that are varied, so that ``.plot(logx=True)`` draws the measures
        over them; of two keys, ``table[measure].unstack()`` is a grid. Units are in the names of columns and index, and
        in ``attrs["units"]``. ``attrs["just_met"]`` lists the values at which each limit is just met.

    Raises
    ------
    CampaignError
        When the campaign cannot be read or has no linear model, or a key, value or measure is wrong.

    Examples
    --------
    >>> import mcnav as mc
    >>> campaign = mc.Campaign({"type": "reentry", "trajectory": 1}, {"altitude": "5 km", "gyro_drift": "0.2 deg/h"})
    >>> table = mc.sweep(campaign, {"errors.altitude": [1e3, "5 km"]}, against="altitude < 5 km")
    >>> table["altitude < 5 km, met"].to_dict(), table.index.name
    ({1.0: True, 5.0: False}, 'errors.altitude [km]')
    >>> [round(value, 2) for value in table.attrs["just_met"][0]["just_met"]]
    [2.5]
    """
    times = read_times(at).tolist() if isinstance(at, str) else list(at)
    measures = (against,) if isinstance(against, str) else tuple(against)
    if not isinstance(varied, Mapping):
        expected = "a mapping of keys to values such as {'errors.altitude': '1..10 km'}"
        raise TypeError(f"varied must be {expected}; got {type(varied).__name__}")
    with _named_as_here():
        swept = run_sweep(campaign, SweepPlan(varied, measures, points, times, jobs, examine))
    return frame(swept).set_index([variable.label for variable in swept.variables])
