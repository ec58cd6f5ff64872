"""The commands as functions whose results are frames with the column names of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property
from typing import Any

import pandas as pd

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.config.documents import Description
from mcnav.report.lincov import final_rows, reading_rows, requirement_rows
from mcnav.studies.lincov import linear_covariance, read_times


class LinearResult:
    """Linear covariance of a campaign as frames; the last line of a notebook's cell shows it as a card.

    Attributes
    ----------
    answer : LinearAnswer
        All that is known, in SI: moments, budget, history, requirements, gates.
    """

    def __init__(self, answer: LinearAnswer) -> None:
        self.answer = answer

    @cached_property
    def outputs(self) -> pd.DataFrame:
        """A row an output at the end: ``unit``, ``mean_linear``, ``sigma_linear``, with a filter ``sigma_filter``."""
        rows = [
            {"output": row.output, "unit": row.unit, "mean_linear": row.mean, "sigma_linear": row.sigma,
             "sigma_filter": row.sigma_filter}
            for row in final_rows(self.answer)
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("output").dropna(axis="columns", how="all")

    @cached_property
    def epochs(self) -> pd.DataFrame:
        """A row a time and output, as `outputs`; where an update falls on a time, ``update`` tells before from after.

        Raises `ValueError` when the campaign is linearized at its end alone.
        """
        if self.answer.history is None and self.answer.asked is None:
            raise ValueError(f"{self.answer.campaign}: linear covariance is known at the end alone")
        rows = pd.DataFrame(asdict(row) for row in reading_rows(self.answer))
        names = {"mean": "mean_linear", "sigma": "sigma_linear"}
        return rows.rename(columns=names).set_index(["time", "output"]).dropna(axis="columns", how="all")

    @property
    def budget(self) -> pd.DataFrame:
        """Share of each source and process (row) in each output's variance (column), a number without unit."""
        return pd.DataFrame(self.answer.budget.shares.T, index=self.answer.causes, columns=self._outputs)

    @property
    def partials(self) -> pd.DataFrame:
        """The matrix P, outputs by sources, SI."""
        sources = [source.name for source in self.answer.sources]
        table = pd.DataFrame(self.answer.model.partials, index=self._outputs, columns=sources)
        table.attrs["units"] = {output.name: output.unit for output in self.answer.outputs}
        return table

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the outputs at the end: P S P' and what processes of noise add, SI."""
        table = pd.DataFrame(self.answer.covariance, index=self._outputs, columns=self._outputs)
        table.attrs["units"] = {output.name: output.unit for output in self.answer.outputs}
        return table

    @cached_property
    def requirements(self) -> pd.DataFrame:
        """A row a requirement: ``requirement``, ``finding``, ``value`` in SI, ``margin``."""
        columns = ["requirement", "finding", "value", "margin", "exceedance"]
        return pd.DataFrame([asdict(row) for row in requirement_rows(self.answer)], columns=columns)

    @property
    def _outputs(self) -> list[str]:
        return [output.name for output in self.answer.outputs]

    def _repr_html_(self) -> str | None:
        return self.answer._repr_html_()

    def __repr__(self) -> str:
        return repr(self.answer)


def lincov(campaign: Description, at: str | Sequence[float] = ()) -> LinearResult:
    """Compute the linear covariance of a campaign, without samples.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
    at : str or sequence of float
        Further times in the trajectory's time, such as ``"600 s, 25 min"``, or in seconds.

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
    return LinearResult(linear_covariance(campaign, times if len(times) else None))
