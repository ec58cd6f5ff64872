"""Numbers of a data sheet with which requirements are just met, as frames."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from mcnav.analysis.allocation import Allocation, Goal, GradeSearch, NumberChange
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.simulated_requirements import Basis
from mcnav.config.documents import Description
from mcnav.frames.answers import requirements_frame, unit_of
from mcnav.report.pages.allocate import examined_words, goal_title, grade_rows, standing
from mcnav.runner.executors import JOBS
from mcnav.studies.allocate import CONFIRMED
from mcnav.studies.allocate import allocate as allocate_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class AllocationResult:
    """Numbers that would meet a campaign's requirements, or how much larger each may be.

    Attributes
    ----------
    allocation : Allocation
        All that is known; its attributes ``goals``, ``grades``, ``answer``, ``basis`` and ``numbers`` are those of this
        object, too.

    Examples
    --------
    >>> import mcnav as mc
    >>> limit = {"output": "altitude", "probability": 0.95, "below": "20 km"}
    >>> campaign = mc.Campaign({"type": "reentry", "trajectory": 1}, {"altitude": "5 km"}, accept=[{"quantile": limit}])
    >>> found = mc.allocate(campaign, confirm=0)
    >>> found.requirements.loc[0, "finding"], round(float(found.changes["factor"].iloc[-1]), 2)
    ('met', 1.66)
    """

    def __init__(self, allocation: Allocation) -> None:
        self.allocation = allocation

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Each requirement that is not met, and all of them together; where all are met, that they stay so."""
        return self.allocation.goals

    @property
    def grades(self) -> GradeSearch | None:
        """Changes by one grade of the catalogue; none of a campaign without inertial measurement unit."""
        return self.allocation.grades

    @property
    def answer(self) -> LinearAnswer:
        """Linear answer of the campaign as it is."""
        return self.allocation.answer

    @property
    def basis(self) -> Basis | None:
        """Simulation of the campaign as it is, which scales linear answers; none where they stand alone."""
        return self.allocation.basis

    @property
    def numbers(self) -> int:
        """Numbers of the data sheet."""
        return self.allocation.numbers

    @cached_property
    def changes(self) -> pd.DataFrame:
        """A row a goal and number, the smallest change first.

        ``now`` and ``needed``, as a campaign file has them; ``factor``, needed over present size, NaN where the number
        alone does not do and infinite where any size does; ``reached``; the requirement with the least margin then:
        ``requirement``, ``unit``, ``linear`` (its linear value), ``margin``; ``upper_bound`` by samples, in the same
        unit, where the change was simulated; ``linearity``, whether linear analysis holds then, where flights have
        examined it.
        """
        rows = [self._row(goal, change) for goal in self.goals for change in goal.changes]
        return pd.DataFrame(rows).set_index(["goal", "number"])

    def _row(self, goal: Goal, change: NumberChange) -> dict[str, Any]:
        judged = requirements_frame(self.answer, [change.result]).iloc[0]
        bound = np.nan if change.simulated is None else change.simulated.interval[1]
        return {
            "goal": goal_title(self.allocation, goal), "number": change.label, "now": change.now,
            "needed": change.needed, "factor": change.factor, "reached": change.reached,
            "requirement": judged["requirement"], "unit": judged["unit"], "linear": judged["linear"],
            "margin": judged["margin"],
            "upper_bound": np.nan if bound is None else bound * unit_of(self.answer, change.result)[0],
            "linearity": change.linearity,
        }  # fmt: skip

    @cached_property
    def grade_changes(self) -> pd.DataFrame:
        """A row a change by one grade of the catalogue: ``moves``, ``finding``, ``value``, ``limit``: text."""
        columns = ["moves", "finding", "value", "limit", "requirement", "simulated", "linearity"]
        return pd.DataFrame([vars(row) for row in grade_rows(self.allocation)], columns=columns)

    @cached_property
    def requirements(self) -> pd.DataFrame:
        """A row a requirement of the campaign as it is, with the units of `LinearResult.requirements`.

        With a simulation, ``finding`` is that of its samples, ``at_most`` the linear value times what they bound it
        by, as all advice here is scaled, and ``margin`` the limit over it.
        """
        table = requirements_frame(self.answer, self.answer.requirements)
        if self.basis is None:
            return table
        scales = np.array(self.basis.scales)
        finding = [entry.finding for entry in self.basis.entries]
        return table.assign(finding=finding, at_most=table["linear"] * scales, margin=table["margin"] / scales)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the factors of the last goal's numbers, on a logarithmic axis; returns matplotlib's axes."""
        import matplotlib.pyplot as plt

        factors = self.changes.xs(self.changes.index[-1][0], level="goal")["factor"]
        known = factors[np.isfinite(factors) & (factors > 0.0)]
        ax = ax or plt.subplots(figsize=(7.0, 1.0 + 0.4 * max(len(known), 1)))[1]
        places = np.arange(len(known))[::-1]
        ax.plot(known.to_numpy(float), places, "o")
        ax.axvline(1.0, color="0.7")
        ax.set_xscale("log")
        ax.set_yticks(places, list(known.index))
        ax.set_xlabel("needed / present size")
        return ax

    def __repr__(self) -> str:
        """Write the verdict, and the changes as a table."""
        lines = [f"{self.answer.campaign}: {standing(self.allocation)[0]}"]
        lines += examined_words(self.allocation)
        for goal, rows in self.changes.groupby(level="goal", sort=False):
            shown = rows.droplevel("goal")[["now", "needed", "factor", "unit", "linear", "margin"]]
            lines += ["", str(goal), shown.to_string()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        verdict = pd.Series([standing(self.allocation)[0]]).to_frame(self.answer.campaign)
        return str(verdict.to_html(index=False)) + str(self.changes.to_html())


def allocate(
    campaign: Description, *, confirm: int = CONFIRMED, jobs: int = JOBS, samples: int | None = None,
    basis: Basis | None = None, examine: bool | None = None,
) -> AllocationResult:  # fmt: skip
    """Find the numbers of a campaign's data sheet with which its requirements are just met.

    Advice is scaled by a simulation of the campaign as it is, and the smallest changes are simulated.

    For each requirement that is not met, every number is changed alone and all together, and each size that a filter
    believes; where all are met, each number is loosened until one is not.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
    confirm : int
        Changes to the last goal, the smallest first, that are simulated, and left out unless simulation confirms them.
        With none, and no basis, the answer is that of linear analysis alone, for normal errors.
    jobs : int
        Workers of a simulation.
    samples : int, optional
        Samples of a simulation; by default those of the campaign, at most
        `mcnav.studies.simulated_campaigns.MOST_SAMPLES`.
    basis : Basis, optional
        Simulation of the campaign as it is that linear answers are scaled by; by default one is made where changes
        are to be confirmed.
    examine : bool, optional
        Whether flights examine changes that no samples confirm; by default, of linear analysis alone, where that is
        quick.

    Returns
    -------
    AllocationResult
        ``.changes`` is a frame.

    Raises
    ------
    CampaignError
        When the campaign has mistakes, no linear model, no requirements that linear analysis can judge, or no numbers;
        or when the simulation bounds no requirement.

    Examples
    --------
    >>> import mcnav as mc
    >>> limit = {"output": "altitude", "probability": 0.95, "below": "12 km"}
    >>> campaign = mc.Campaign({"type": "reentry", "trajectory": 1}, {"altitude": "5 km", "gyro_drift": "0.2 deg/h"},
    ...                        accept=[{"quantile": limit}])
    >>> changes = mc.allocate(campaign, confirm=0).changes.droplevel("goal")
    >>> changes.loc["errors.altitude", ["now", "needed", "unit"]].tolist()
    ['5 km', '3.81 km', 'km']
    >>> changes["reached"].to_dict()
    {'all numbers': True, 'errors.altitude': True, 'errors.gyro_drift': False}
    """
    return AllocationResult(allocate_numbers(
        campaign, confirm=confirm, jobs=jobs, samples=samples, basis=basis, examine=examine
    ))  # fmt: skip
