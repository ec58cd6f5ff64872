"""Runs in notebooks and scripts: tables as pandas, figures as matplotlib, verdicts shown by Jupyter.

>>> import mcnav
>>> run = mcnav.fly("campaigns/01_tn_d1772_trajectory_4.toml", "reports/first", samples=1000)  # doctest: +SKIP
>>> run.outputs[["sigma linear", "paired ratio", "verdict"]]                                   # doctest: +SKIP
>>> run.figure("scatter").axes[0].set_title("altitude and range")                              # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from mcnav.campaign.file import read_campaign
from mcnav.campaign.folder import RunFolder
from mcnav.judging import analyse, content_of, samples_of
from mcnav.report import wording
from mcnav.report.content import Content
from mcnav.report.drawings.drawing import Drawing
from mcnav.report.page import drawings
from mcnav.study import run_campaign

SHOWN = """<div><p><strong>{{ name }}</strong>: {{ headline }}</p><p>{{ explanation }}</p>
<table><thead><tr><th></th>{% for column in table.columns %}<th>{{ column }}</th>{% endfor %}</tr></thead>
<tbody>{% for index, row in table.iterrows() %}<tr><th>{{ index }}</th>
{% for value in row %}<td>{{ "%.5g" | format(value) if value is number else value }}</td>{% endfor %}</tr>{% endfor %}
</tbody></table></div>"""


class FlownRun:
    """A finished run folder, judged.

    Parameters
    ----------
    path : Path
        Run folder.

    Attributes
    ----------
    path : Path
    content : Content
        All that its report shows: the linear model, the comparison, the samples.

    Raises
    ------
    RunFolderError
        When it holds no finished run, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        folder = RunFolder(path)
        with threadpool_limits(1):
            self.content: Content = content_of(folder, analyse(folder))

    @property
    def summary(self) -> Mapping[str, Any]:
        """What ``summary.json`` holds."""
        return self.content.summary

    @property
    def verdict(self) -> str:
        """``agrees``, ``partly``, ``differs`` or ``undecided``."""
        return wording.tone(self.summary)

    @cached_property
    def samples(self) -> pd.DataFrame:
        """Every sample: index, status, errors and outputs in SI, their checksums verified."""
        return samples_of(self.path)

    @property
    def outputs(self) -> pd.DataFrame:
        """Linear beside Monte Carlo, a row an output, in the units shown; ``from``, ``to`` bound the paired ratio."""
        content = self.content
        rows = []
        for i, output in enumerate(content.comparison.outputs):
            scale = float(content.output_scale[i])
            (low, high), plain = output.paired.interval or (np.nan, np.nan), output.plain
            plain_low, plain_high = plain.interval or (np.nan, np.nan)
            rows.append(
                {
                    "unit": content.output_units[i],
                    "sigma linear": output.sigma_linear * scale,
                    "sigma paired": output.sigma_paired * scale,
                    "paired ratio": np.nan if output.paired.ratio is None else output.paired.ratio,
                    "from": low,
                    "to": high,
                    "bias": output.bias.value * scale,
                    "verdict": wording.output_words(output.sigma_linear, output.paired.verdict.value),
                    "sigma plain": output.sigma_sample * scale,
                    "plain ratio": np.nan if plain.ratio is None else plain.ratio,
                    "plain from": plain_low,
                    "plain to": plain_high,
                }
            )
        return pd.DataFrame(rows, index=pd.Index(content.output_names[: len(rows)], name="output"))

    @property
    def budget(self) -> pd.DataFrame:
        """Share of each source (row) in each output's linear variance (column)."""
        content = self.content
        return pd.DataFrame(content.budget.shares.T, index=content.source_names, columns=content.output_names)

    @property
    def partials(self) -> pd.DataFrame:
        """The matrix P, SI: outputs by sources."""
        content = self.content
        return pd.DataFrame(content.model.partials, index=content.output_names, columns=content.source_names)

    def covariance(self, kind: str = "paired") -> pd.DataFrame:
        """Final covariance, SI.

        Parameters
        ----------
        kind : str
            ``linear``, ``sample`` or ``paired``.
        """
        kinds = ("linear", "sample", "paired")
        if kind not in kinds:
            raise ValueError(f"kind must be one of {', '.join(kinds)}; got {kind!r}")
        names = self.content.output_names
        return pd.DataFrame(getattr(self.content.comparison, f"covariance_{kind}"), index=names, columns=names)

    @cached_property
    def drawings(self) -> dict[str, Drawing]:
        """The report's figures by name; Jupyter shows each, and ``.data`` is the table behind it."""
        return drawings(self.content)

    def figure(self, name: str) -> Figure:
        """One of the report's figures, drawn by matplotlib; its ``axes`` are free to be changed.

        Parameters
        ----------
        name : str
            A key of ``drawings``.
        """
        if name not in self.drawings:
            raise ValueError(f"name must be one of {', '.join(self.drawings)}; got {name!r}")
        return self.drawings[name].figure()

    def _repr_html_(self) -> str:
        """The verdict, and linear beside Monte Carlo."""
        return (
            Environment(autoescape=True)
            .from_string(SHOWN)
            .render(
                name=self.summary["campaign"],
                headline=wording.headline(self.summary),
                explanation=wording.explanation(self.summary),
                table=self.outputs,
            )
        )

    def __repr__(self) -> str:
        return f"{self.summary['campaign']}: {wording.headline(self.summary)}"


def open_run(path: str | Path) -> FlownRun:
    """A finished run folder.

    Raises
    ------
    RunFolderError
        When it holds no finished run, or is damaged.
    """
    return FlownRun(Path(path))


def fly(
    campaign: str | Path,
    folder: str | Path,
    *,
    engine: str | None = None,
    jobs: int = 2,
    fresh: bool = False,
    force: bool = False,
    **instead: int,
) -> FlownRun:
    """Fly a campaign file into a run folder and write its report there; what is stored is not flown again.

    Parameters
    ----------
    campaign, folder : str or Path
    engine : str, optional
    jobs : int
        Workers.
    fresh : bool
        Replace an earlier run in the folder.
    force : bool
        Go on where partial derivatives are not settled; the run says so.
    **instead
        ``samples`` and ``seed`` in place of the file's.

    Raises
    ------
    CampaignError, RunFolderError
        As `mcnav.study.run_campaign`.
    """
    run_campaign(read_campaign(Path(campaign), instead), Path(folder), engine, jobs, fresh, force=force)
    return FlownRun(Path(folder))
