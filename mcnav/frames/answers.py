"""The commands as functions whose results are frames with the column names of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pandas as pd

from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement
from mcnav.config.documents import Description
from mcnav.report.pages.lincov import final_rows, reading_rows, requirement_rows, units_shown
from mcnav.studies.linear_answers import read_times
from mcnav.studies.linear_covariance import linear_covariance

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class LinearResult:
    """Linear covariance of a campaign as frames; the last line of a notebook's cell shows it as a card.

    Attributes
    ----------
    answer : LinearAnswer
        All that is known, in SI: moments, budget, history, requirements, gates.

    Examples
    --------
    >>> import mcnav as mc
    >>> answer = mc.lincov({"scenario": {"type": "reentry", "trajectory": 1}, "errors": {"altitude": 5e3}})
    >>> answer.outputs["sigma_linear"].round(2).to_dict()
    {'altitude': 6.13, 'range': 14.63, 'altitude_rate': 14.21, 'range_rate': 3.36}
    >>> answer.covariance.attrs["units"]["range"]
    'm'
    """

    def __init__(self, answer: LinearAnswer) -> None:
        self.answer = answer

    @cached_property
    def outputs(self) -> pd.DataFrame:
        """A row an output at the end: ``unit``, ``mean_linear``, ``sigma_linear``, with a filter ``sigma_filter``.

        ``mean_second`` and ``sigma_second`` are those of second order, where they are known well enough. Of a campaign
        with ranges the row is of the upper ends; ``sigma_best`` and ``sigma_worst`` are over all their settings, which
        ``answer.box`` names.
        """
        box = self.answer.box
        spreads = box.outputs if box is not None and box.varies else [None] * len(self.answer.outputs)
        scales = [units_shown(self.answer.outputs)[name][0] for name in self._outputs]
        rows = [
            {"output": row.output, "unit": row.unit, "mean_linear": row.mean, "sigma_linear": row.sigma,
             "mean_second": row.mean_second, "sigma_second": row.sigma_second, "sigma_filter": row.sigma_filter,
             "sigma_best": None if spread is None else spread.best.value * scale,
             "sigma_worst": None if spread is None else spread.worst.value * scale}
            for row, spread, scale in zip(final_rows(self.answer), spreads, scales, strict=True)
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("output").dropna(axis="columns", how="all")

    @cached_property
    def epochs(self) -> pd.DataFrame:
        """A row a time and output, with the columns and units of `outputs` and `RunResult.epochs`.

        Where an update falls on a time, ``update`` tells before from after.

        >>> answer.epochs["sigma_linear"].unstack().plot()  # doctest: +SKIP

        Raises `ValueError` when the campaign is linearized at its end alone.
        """
        if self.answer.history is None and self.answer.asked is None:
            raise ValueError(f"{self.answer.campaign}: linear covariance is known at the end alone")
        rows = pd.DataFrame(asdict(row) for row in reading_rows(self.answer))
        history = self.answer.asked or self.answer.history
        label = "time" if history is None else history.readings.label
        names = {"time": label, "mean": "mean_linear", "sigma": "sigma_linear"}
        return rows.rename(columns=names).set_index([label, "output"]).dropna(axis="columns", how="all")

    @property
    def budget(self) -> pd.DataFrame:
        """Share of each source and process (row) in each output's variance (column), a number without unit."""
        return pd.DataFrame(self.answer.budget.shares.T, index=self.answer.causes, columns=self._outputs)

    @property
    def partials(self) -> pd.DataFrame:
        """The matrix P, shape (outputs, sources), SI."""
        sources = [source.name for source in self.answer.sources]
        table = pd.DataFrame(self.answer.model.partials, index=self._outputs, columns=sources)
        table.attrs["units"] = {output.name: output.unit for output in self.answer.outputs}
        return table

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the outputs at the end: P S P' and what noise adds, shape (outputs, outputs), SI."""
        table = pd.DataFrame(self.answer.covariance, index=self._outputs, columns=self._outputs)
        table.attrs["units"] = {output.name: output.unit for output in self.answer.outputs}
        return table

    @cached_property
    def requirements(self) -> pd.DataFrame:
        """A row a requirement: ``requirement``, ``finding``, ``unit``, its value ``linear`` and ``order``, ``margin``.

        The margin is the multiple of all errors at which it is just met. ``exceedance`` is the probability beyond the
        limits of one that allows little.
        """
        return requirements_frame(self.answer, self.answer.requirements)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the sigma of each output over time, or at the end as bars where no other time is known.

        Sigmas are divided by the largest of their output, whose value and unit are in the legend. Returns matplotlib's
        axes.
        """
        import matplotlib.pyplot as plt

        ax = ax or plt.subplots()[1]
        if self.answer.history is None and self.answer.asked is None:
            sigmas = self.outputs["sigma_linear"]
            ax.bar([f"{name} [{unit}]" for name, unit in self.outputs["unit"].items()], sigmas.to_numpy(float))
            ax.set_ylabel("linear sigma")
            return ax
        for output, rows in self.epochs.groupby(level="output", sort=False):
            sigmas, largest = rows["sigma_linear"], rows["sigma_linear"].max()
            times = rows.index.get_level_values(0)
            ax.plot(times, sigmas / (largest or 1.0), label=f"{output}, at most {largest:.3g} {rows['unit'].iloc[0]}")
        ax.set_xlabel(str(self.epochs.index.names[0]))
        ax.set_ylabel("linear sigma / its largest value")
        ax.legend(fontsize="small")
        return ax

    @property
    def _outputs(self) -> list[str]:
        return [output.name for output in self.answer.outputs]

    def _repr_html_(self) -> str | None:
        return self.answer._repr_html_()

    def __repr__(self) -> str:
        return repr(self.answer)


def unit_of(answer: LinearAnswer, row: LinearRequirement) -> tuple[float, str]:
    """Return the factor from SI to the unit in which a requirement is shown, and the unit; none of a probability."""
    if row.requirement.kind == "box" or not row.requirement.outputs:
        return 1.0, ""
    shown: tuple[float, str] = units_shown(answer.outputs)[answer.outputs[row.requirement.outputs[0]].name]
    return shown


def requirements_frame(answer: LinearAnswer, rows: Sequence[LinearRequirement]) -> pd.DataFrame:
    """Tabulate requirements with their linear values, a row each; see `LinearResult.requirements`."""
    words = requirement_rows(replace(answer, requirements=tuple(rows)))
    units = [unit_of(answer, row) for row in rows]
    table = {
        "requirement": [row.requirement for row in words],
        "finding": [row.finding for row in words],
        "unit": [unit for _, unit in units],
        "order": [row.order or None for row in words],
        "linear": [row.value * scale for row, (scale, _) in zip(rows, units, strict=True)],
        "margin": [row.margin for row in rows],
        "exceedance": [row.beyond for row in rows],
    }
    return pd.DataFrame(table).dropna(axis="columns", how="all") if rows else pd.DataFrame(table)


def lincov(
    campaign: Description, at: str | Sequence[float] = (), examine: bool | None = None, gates: bool | None = None
) -> LinearResult:
    """Compute the linear covariance of a campaign, without samples.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
    at : str or sequence of float
        Further times in the trajectory's time, such as ``"600 s, 25 min"``, or in seconds.
    examine : bool, optional
        Whether simulations examine where linear analysis holds; by default where that is quick.
    gates : bool, optional
        Whether flights that begin with a rejection answer what the laws of gates leave open; by default where
        rejections are rare.

    Raises
    ------
    CampaignError
        When the campaign has mistakes or no linear model, or a time lies outside of its navigation.

    Examples
    --------
    >>> import mcnav as mc
    >>> answer = mc.lincov({"scenario": {"type": "reentry", "trajectory": 4}, "errors": {"altitude": 5e3}})
    >>> answer.outputs["sigma_linear"].round(3)["altitude"], answer.outputs["unit"]["altitude"]
    (np.float64(6.631), 'km')
    """
    times: Any = read_times(at) if isinstance(at, str) else pd.Series(list(at), dtype=float).to_numpy()
    return LinearResult(linear_covariance(campaign, times if len(times) else None, examine, gates))
