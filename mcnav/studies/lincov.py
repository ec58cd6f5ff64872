"""Linear covariance of a campaign as ``lincov.json`` and a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.answer_times import as_read
from mcnav.analysis.box import Box, Extreme, Spread
from mcnav.analysis.examination import Examination
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, Order
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.remedies import Remedies
from mcnav.analysis.vector_sizes import linear_sizes
from mcnav.analysis.what_if import WhatIf
from mcnav.arrays.types import Array
from mcnav.config.ranges import SpecRange
from mcnav.config.read import Campaign
from mcnav.config.toml import Content
from mcnav.config.what_if import bands_of
from mcnav.contract.quantities import kinds_of
from mcnav.files.whole import indented_json, to_json, write_texts
from mcnav.report.columns.gates import gates_entry
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Page
from mcnav.report.pages.lincov_page import page
from mcnav.report.statements.lincov import final_nominal
from mcnav.studies.changeable_content import changeable_content
from mcnav.studies.linear_covariance import linear_covariance, outages_of
from mcnav.workflow.what_if import what_if_of_answer

FILE: Final = "lincov.json"
PAGE: Final = "lincov.html"


def write_lincov(
    campaign: Campaign,
    path: Path,
    times: Array | None = None,
    all_remedies: bool = False,
    examine: bool | None = None,
    gates: bool | None = None,
) -> tuple[LinearAnswer, list[Path]]:
    """Write the linear covariance of a campaign as ``lincov.json`` and a page; see `linear_covariance`.

    ``all_remedies``: whether all that would help is computed where something fails, and not the first alone.
    """
    covariance, remedies = linear_covariance(campaign, times, examine, gates), None
    if covariance.fails:
        from mcnav.studies.remedies import remedies_of_answer  # half a second, which answers that hold do without

        remedies = remedies_of_answer(campaign, covariance, all_remedies, examine=examine)
    written = page_html(lincov_page(campaign, covariance, remedies))
    files = {FILE: indented_json(to_json(lincov_table(covariance))) + "\n", PAGE: written}
    return covariance, write_texts(path, files)


def lincov_page(
    campaign: Campaign, answer: LinearAnswer, remedies: Remedies | None = None, changeable: Changeable | None = None
) -> Page:
    """Return the page on a campaign's linear covariance, with what its reader can change.

    Parameters
    ----------
    changeable : Changeable, optional
        Content whose numbers can be changed, with its ranges; by default that of the campaign's file.
    """
    return page(answer, outages_of(campaign), _what_if(answer, changeable or Changeable.of(campaign)), remedies)


@dataclass(frozen=True)
class Changeable:
    """Content of a campaign file whose numbers can be changed.

    Attributes
    ----------
    beside : str
        Where a changed file is to be saved.
    ranges : tuple of SpecRange
        Numbers that lie between two ends, within which the content has one value.
    """

    content: Content
    beside: str
    ranges: tuple[SpecRange, ...] = ()

    @classmethod
    def of(cls, campaign: Campaign) -> Changeable:
        """Return that of a campaign's file."""
        return cls(*changeable_content(campaign), campaign.ranges)


def _what_if(answer: LinearAnswer, changeable: Changeable) -> WhatIf | None:
    what_if = what_if_of_answer(as_read(answer), changeable.content, changeable.beside)
    return None if what_if is None else replace(what_if, bands=bands_of(what_if.campaign, changeable.ranges))


def lincov_table(answer: LinearAnswer) -> Mapping[str, object]:
    """Arrange a linear covariance as ``lincov.json`` has it: SI units, and two rows where an update falls on a time."""
    names, kinds = [output.name for output in answer.outputs], kinds_of(answer.outputs)
    history, smoothed = answer.asked or answer.history, answer.smoothed_asked or answer.smoothed
    return {
        "campaign": answer.campaign,
        **({"remarks": answer.remarks} if answer.remarks else {}),
        "outputs": names,
        "units": [output.unit for output in answer.outputs],
        **({"kinds": kinds} if any(kinds) else {}),
        **({"nominal": final_nominal(answer)} if any(kinds) else {}),
        "mean": answer.mean,
        "sigma": answer.sigma,
        "covariance": answer.covariance,
        "correlation": answer.correlation,
        "budget": _budget_rows(answer),
        "requirements": [
            {
                "kind": requirement.requirement.kind,
                "outputs": [names[number] for number in requirement.requirement.outputs],
                "limits": requirement.requirement.limits,
                "probability": requirement.requirement.probability,
                "when": requirement.requirement.when,
                **({"about": requirement.requirement.about} if requirement.requirement.about else {}),
                "value": requirement.value,
                "met": requirement.met if requirement.judged else None,
                **_order_entry(requirement),
                "margin": requirement.margin,
                **({"exceedance": requirement.beyond} if math.isfinite(requirement.beyond) else {}),
                **({"exceedance_curved": requirement.curved} if math.isfinite(requirement.curved) else {}),
                "time": requirement.time,
                "causes": [asdict(cause) for cause in answer.requirement_causes(number)],
                **({} if answer.box is None else _spread_entry(answer.box.requirements[number])),
            }
            for number, requirement in enumerate(answer.requirements)
        ],
        **_size_rows(answer, names),
        "mean_by_cause": answer.means,
        **({} if answer.box is None else box_entry(answer.box, names)),
        "filter": None if answer.filter is None else _filter_entry(answer.filter),
        **({} if answer.smoother is None else {"smoother": _filter_entry(answer.smoother)}),
        **({"gates": gates_entry(answer)} if answer.rejections is not None else {}),
        **({} if answer.examination is None else {"linearity": examination_entry(answer.examination, names)}),
        "beyond_range": None if answer.beyond is None else {
            "outputs": [names[output] for output in answer.beyond.outputs],
            "begin": answer.beyond.time,
        },
        "time": None if history is None else history.readings.label,
        "rows": [] if history is None else _rows(history, answer.readings_beyond(history), smoothed),
    }  # fmt: skip


def _order_entry(requirement: LinearRequirement) -> Mapping[str, object]:
    """Return by which order a requirement is judged, the uncertainty of its value, and why it is not judged."""
    second = requirement.order == Order.SECOND
    return {
        "order": requirement.order.value if math.isfinite(requirement.value) else None,
        **({"uncertainty": requirement.share * requirement.value} if second else {}),
        **({"doubt": requirement.doubt} if requirement.doubt else {}),
    }


def box_entry(box: Box, names: Sequence[str]) -> Mapping[str, object]:
    """Arrange what ranges do as ``lincov.json`` has it: the worst and the best of each output, and their settings."""

    def side(extremes: Sequence[Extreme], ratio: Extreme | None, verdict: LinearVerdict | None) -> dict[str, object]:
        settings = {name: dict(extreme.setting) for name, extreme in zip(names, extremes, strict=True)}
        entry: dict[str, object] = {"sigma": [extreme.value for extreme in extremes], "setting": settings}
        if ratio is not None and verdict is not None:
            entry["filter"] = {"ratio": ratio.value, "setting": dict(ratio.setting), **_filter_entry(verdict)}
        return entry

    filtered = box.filter
    known = None if filtered is None else filtered.ratio
    return {
        "ranges": dict(box.ranges),
        "worst": side([spread.worst for spread in box.outputs], None if known is None else known.worst,
                      None if filtered is None else filtered.optimistic),
        "best": side([spread.best for spread in box.outputs], None if known is None else known.best,
                     None if filtered is None else filtered.pessimistic),
        "exact": box.exact,
        "settings": box.settings,
        "systems": box.systems,
        "held": list(box.held),
        **({} if box.gated is None else {"gated": dict(box.gated)}),
        "narrowed": [asdict(row) for row in box.narrowed],
    }  # fmt: skip


def _spread_entry(spread: Spread) -> Mapping[str, object]:
    return {"worst": spread.worst.value, "best": spread.best.value, "setting": dict(spread.worst.setting)}


def examination_entry(examined: Examination, names: Sequence[str]) -> Mapping[str, object]:
    """Arrange an examination as ``lincov.json`` has it; corrected moments are in SI units."""
    rows = [{"name": name, **asdict(output)} for name, output in zip(names, examined.outputs, strict=True)]
    corrected = examined.corrected
    return {
        "flights": examined.flights,
        "failed": examined.failed,
        "tolerance": examined.tolerance,
        "outputs": rows,
        "joint": None if examined.joint is None else asdict(examined.joint),
        "mean_second": None if corrected is None else corrected.mean,
        "sigma_second": None if corrected is None else corrected.sigma,
        "sigma_error": None if corrected is None else corrected.error,
        "mean_second_error": None if corrected is None else corrected.mean_error,
        "nees_second": None if corrected is None else corrected.nees,
        "nees_error": None if corrected is None else corrected.nees_error,
    }


def _size_rows(answer: LinearAnswer, names: Sequence[str]) -> Mapping[str, object]:
    """Return the sizes of corrections by their exact law; nothing where there are none."""
    laws = linear_sizes(answer.model.sizes, answer.mean, answer.covariance)
    rows = [asdict(law) | {"output": names[law.output], "wrong": law.wrong} for law in laws]
    return {"sizes": rows} if rows else {}


def _filter_entry(verdict: LinearVerdict) -> Mapping[str, object]:
    """Return the verdict on the filter; times are those of the readings, and an infinite factor is null."""
    return {
        "verdict": verdict.verdict.value,
        "output": verdict.output,
        "group": verdict.group,
        "factor": verdict.factor if np.isfinite(verdict.factor) else None,
        "begin": verdict.begin,
        "end": verdict.end,
        "worst": verdict.worst,
        "tolerance": verdict.tolerance,
        "readings": len(verdict.times),
        "causes": [asdict(each) for each in verdict.neglected],
    }


def _budget_rows(answer: LinearAnswer) -> list[Mapping[str, object]]:
    """List the causes with the sigma that each contributes to every output and its share of the variance."""
    budget = answer.budget
    rows: list[Mapping[str, object]] = [
        {"cause": name, "sigma": np.abs(budget.contributions[:, number]), "share": budget.shares[:, number]}
        for number, name in enumerate(answer.causes)
        if budget.contributions[:, number].any()
    ]
    return [*rows, {"cause": "correlations", "sigma": None, "share": budget.cross_terms}]


def _rows(
    covariance: LinearCovariance, beyond: NDArray[np.bool_], smoothed: LinearCovariance | None
) -> list[Mapping[str, object]]:
    rows = list[Mapping[str, object]]()
    for number, time in enumerate(covariance.readings.times):
        own = None if covariance.sigma_filter is None else covariance.sigma_filter[number]
        rows.append({
            "time": float(time),
            "update": covariance.readings.updates[number],
            "mean": covariance.mean[number],
            "sigma": covariance.sigma[number],
            "sigma_filter": own,
            **_smoothed_entry(smoothed, number),
            "beyond_range": bool(beyond[number]),
            "variance_by_cause": {name: variance[number] for name, variance in covariance.variances.items()},
            "variance_by_correlations": covariance.correlations[number],
            "mean_by_cause": {name: values[number] for name, values in covariance.means.items()},
        })  # fmt: skip
    return rows


def _smoothed_entry(smoothed: LinearCovariance | None, number: int) -> Mapping[str, object]:
    """Return what a smoother claims at a reading, and what is true of its errors; nothing without a smoother."""
    if smoothed is None or smoothed.sigma_filter is None:
        return {}
    return {
        "sigma_smoother": smoothed.sigma_filter[number],
        "sigma_smoothed": smoothed.sigma[number],
        "smoothed_variance_by_cause": {name: variance[number] for name, variance in smoothed.variances.items()},
    }
