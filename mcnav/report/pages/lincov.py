"""Linear covariance of a campaign: its headline, and rows of its tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from mcnav.analysis.answer_times import as_read
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, Order, causes_at
from mcnav.analysis.mean_errors import departures, nominal_values
from mcnav.arrays.types import Array
from mcnav.contract.quantities import KINDS, Output, end_words, kinds_of
from mcnav.physics.units import conversion
from mcnav.report.columns.gates import rejection_words
from mcnav.report.columns.requirements import TONES, NamedRequirement, stated
from mcnav.report.document.parts import Findings
from mcnav.report.drawing.axis_groups import stem
from mcnav.report.figures.lincov import cause_labels
from mcnav.report.format import number
from mcnav.report.names import scale_of, unit_words
from mcnav.report.statements.box import box_words
from mcnav.report.statements.examination import corrected_words, examination_words
from mcnav.report.statements.lincov import (
    cause_words,
    filter_words,
    final_means,
    final_nominal,
    large_mean_words,
    mean_words,
    range_words,
    size_words,
    worst_first,
)
from mcnav.report.statements.requirements import limited_in_brief

COARSEST_SHARE: Final = 0.001
"""Smallest share of a variance that is listed."""

MONTE_CARLO: Final = "needs Monte Carlo"
"""Finding on a requirement that linear analysis cannot judge."""

INITIAL: Final = "initial"
"""Beginning of the names of initial errors; alone it is no kind of causes."""


def units_shown(outputs: Sequence[Output]) -> dict[str, tuple[float, str]]:
    """Return for each output, by name, the factor from SI and the unit shown."""
    return {output.name: (conversion(output.unit, output.shown_in), unit_words(output.shown_in)) for output in outputs}


def finding(row: LinearRequirement) -> str:
    """Return the finding on a requirement in words."""
    return ("met" if row.met else "not met") if row.judged else MONTE_CARLO


def headline(answer: LinearAnswer) -> tuple[str, str]:
    """State how many requirements are met, or else the largest causes; return the words and their tone."""
    judged = [requirement.met for requirement in answer.requirements if requirement.judged]
    if judged:
        failed, count = judged.count(False), len(judged)
        second = any(requirement.order == Order.SECOND for requirement in answer.requirements)
        known = " that are judged without samples" if second else " that linear analysis can judge"
        partly = known if count < len(answer.requirements) else ""
        if count == 1:
            words = f"The requirement{partly.replace(' are ', ' is ')} is {'not ' * failed}met"
        elif not failed:
            words = f"{'Both' if count == 2 else f'All {count}'} requirements{partly} are met"
        elif failed == count:
            words = (
                f"{'Neither' if count == 2 else f'None of the {count}'} requirement{'s' * (count > 2)}{partly} is met"
            )
        else:
            words = f"{failed} of {count} requirements{partly} {'is' if failed == 1 else 'are'} not met"
        where = " at the upper ends of the ranges" if answer.box is not None and answer.box.varies else ""
        return f"{words}{where}", TONES["not met" if failed else "met"]
    names = largest_causes(answer)
    if not names:
        return f"No {end_words(answer.outputs).one} has any dispersion", "undecided"
    return f"Largest {'cause' if len(names) == 1 else 'causes'} at the end: {' and '.join(names)}", ""


def statements(answer: LinearAnswer) -> list[tuple[str, str]]:
    """List what linear analysis says, in sentences with their tones: what fails, mean errors above one sigma, the rest.

    Requirements that are met follow what fails; they are not green where linear analysis was not examined.
    """
    answer = as_read(answer)
    large = list(large_mean_words(answer))
    examined = [*examination_words(answer), *corrected_words(answer)]
    said = [*box_words(answer), *examined, *range_words(answer), *rejection_words(answer), *filter_words(answer)]
    said += [*([] if large else mean_words(answer)), *size_words(answer)]
    judged = any(requirement.judged for requirement in answer.requirements)
    if judged or answer.beyond is None:
        words, tone = headline(answer)
        if judged and tone == "agrees" and not (answer.box is not None and answer.box.varies):
            failing, others = parted(worst_first([*large, *said]))
            return [*failing, (words, "" if answer.unexamined else tone), *others]
        said.append((words, tone))
    return worst_first([*large, *said])


def parted(sentences: Sequence[tuple[str, str]]) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return the sentences on what fails or is undecided, and the others."""
    failing = [sentence for sentence in sentences if sentence[1] not in ("", "agrees")]
    return failing, [sentence for sentence in sentences if sentence not in failing]


def largest_causes(answer: LinearAnswer) -> list[str]:
    """Name the kinds of causes that are the largest of most outputs, at most two."""
    labels, shares = cause_labels(answer), np.nan_to_num(answer.budget.attributed)
    kind_of = [label if stem(label) == INITIAL else stem(label) for label in labels]
    kinds = list(dict.fromkeys(kind_of))
    of_kind = np.array([[output_kind == kind for output_kind in kind_of] for kind in kinds], dtype=float)
    summed = shares @ of_kind.T
    leading = [int(np.argmax(row)) for row in summed if row.any()]
    counted = sorted(set(leading), key=lambda k: (-leading.count(k), -summed[:, k].sum(), k))
    return [kinds[k] for k in counted[:2]]


@dataclass(frozen=True)
class RequirementRow:
    """A requirement with its linear value, in SI and in words, as JSON has it."""

    requirement: str
    finding: str
    value: float | None
    shown: str
    margin: float | None
    causes: list[tuple[str, float]]
    at: str
    exceedance: float | None = None
    exceedance_curved: float | None = None
    order: str = ""
    doubt: str = ""

    @property
    def tone(self) -> str:
        """Tone of the finding."""
        return TONES.get(self.finding, "undecided")


@dataclass(frozen=True)
class SizeRow:
    """Mean and sigma of an output at an instant in the unit shown, that of the filter, and causes of the variance.

    Where errors are beyond the range of linear analysis, numbers and causes are none. Moments of second order are those
    that are known to less than half of their correction; ``linearity`` is the verdict of flights on the linear ones.
    """

    output: str
    unit: str
    mean: float | None
    sigma: float | None
    sigma_filter: float | None
    causes: list[tuple[str, float]]
    time: float | None = None
    nominal: float | None = None
    mean_second: float | None = None
    sigma_second: float | None = None
    linearity: str = ""


@dataclass(frozen=True)
class ReadingRow:
    """Mean and sigma of an output at a reading in the unit shown, as CSV and JSON have them."""

    time: float | None
    update: str
    output: str
    unit: str
    sigma: float
    sigma_filter: float | None
    mean: float
    beyond_range: bool
    nominal: float | None = None


@dataclass(frozen=True)
class ContributorRow:
    """Contribution of one cause to the final sigma of an output, in the unit shown, as JSON has it."""

    output: str
    cause: str
    share: float
    sigma: float
    unit: str


def requirement_rows(answer: LinearAnswer) -> list[RequirementRow]:
    """List the requirements with their linear values."""
    units = units_shown(answer.outputs)
    label = "" if answer.history is None else answer.history.readings.label
    rows = []
    for place, requirement in enumerate(answer.requirements):
        entry = named_requirement(requirement, answer)
        rows.append(RequirementRow(
            requirement=stated(entry, units),
            finding=finding(requirement),
            value=requirement.value if requirement.judged else None,
            shown=shown_value(requirement, *units[entry.outputs[0]]),
            margin=requirement.margin if math.isfinite(requirement.margin) else None,
            causes=cause_words(answer, answer.requirement_causes(place)) if requirement.judged else [],
            exceedance=requirement.beyond if math.isfinite(requirement.beyond) else None,
            exceedance_curved=requirement.curved if math.isfinite(requirement.curved) else None,
            at="" if requirement.time is None else instant(requirement.time, label),
            order=requirement.order.value if math.isfinite(requirement.value) else "",
            doubt=requirement.doubt,
        ))  # fmt: skip
    return rows


def named_requirement(requirement: LinearRequirement, answer: LinearAnswer) -> NamedRequirement:
    """Return a requirement with the names of its outputs."""
    required = requirement.requirement
    names = [answer.outputs[i].name for i in required.outputs]
    return NamedRequirement(required.kind, names, required.limits, required.probability, required.when, required.about)


def requirements_in_brief(answer: LinearAnswer) -> Findings:
    """List the requirements in one short row each: what is limited, the linear value, and the limit."""
    units = units_shown(answer.outputs)
    entries = []
    for row, requirement in zip(requirement_rows(answer), answer.requirements, strict=True):
        unit = units[answer.outputs[requirement.requirement.outputs[0]].name]
        value, limit = shown_value(requirement, *unit, digits=3), shown_limit(requirement, *unit)
        what = limited_in_brief(named_requirement(requirement, answer))
        entries.append((row.finding, row.tone, f"{what}: {value}, limit {limit}"))
    return Findings(entries)


def shown_value(row: LinearRequirement, scale: float, unit: str, digits: int = 4) -> str:
    """Format the linear value of a requirement: a probability, or an error in the unit shown."""
    if not math.isfinite(row.value):
        return "–"
    within = f" ± {100.0 * row.share:.2g} %" if row.share else ""
    if row.requirement.kind == "box":
        return f"{100.0 * row.value:.3f} %"
    return f"{number(row.value * scale, 3 if row.share else digits)} {unit}{within}"


def shown_limit(row: LinearRequirement, scale: float, unit: str) -> str:
    """Format the limit that a linear value is compared with."""
    required = row.requirement
    if required.kind == "box":
        return f"{100.0 * (required.probability or 0.5):g} %"
    return f"{required.limits[0] * scale:,.6g} {unit}"


def final_rows(answer: LinearAnswer) -> list[SizeRow]:
    """List the outputs at the end."""
    scale, own = scale_of(answer.outputs), None if answer.history is None else answer.history.sigma_filter
    means, nominal, meaningful = final_means(answer) * scale, final_nominal(answer) * scale, answer.beyond is None
    second_means, second_sigmas = (values * scale for values in _second_order(answer))
    return [
        SizeRow(
            output.name,
            output.shown_in,
            known(means[i]) if meaningful else None,
            float(answer.sigma[i] * scale[i]) if meaningful else None,
            float(own[-1, i] * scale[i]) if meaningful and own is not None else None,
            cause_words(answer, answer.final_causes(i)) if meaningful else [],
            nominal=known(nominal[i]),
            mean_second=known(second_means[i]),
            sigma_second=known(second_sigmas[i]),
            linearity="" if answer.examination is None else answer.examination.outputs[i].verdict.value,
        )
        for i, output in enumerate(answer.outputs)
    ]


def _second_order(answer: LinearAnswer) -> tuple[Array, Array]:
    """Return means and sigmas of second order, shape (outputs,), SI; NaN where they are not known well enough."""
    corrected = None if answer.examination is None else answer.examination.corrected
    if corrected is None:
        unknown = np.full(len(answer.outputs), np.nan)
        return unknown, unknown
    means = departures(answer.outputs, corrected.mean, answer.model.nominal)
    return (
        np.where(corrected.improves_mean(answer.mean), means, np.nan),
        np.where(corrected.improves(answer.sigma), corrected.sigma, np.nan),
    )


def known(value: float) -> float | None:
    """Return a number; none where there is none."""
    return None if math.isnan(value) else float(value)


def largest_rows(answer: LinearAnswer) -> list[SizeRow]:
    """List the largest sigma of each output over time, with the filter's and the causes then."""
    scale, history = scale_of(answer.outputs), answer.meaningful
    if history is None:
        return []
    rows, own = [], history.sigma_filter
    for i, output in enumerate(answer.outputs):
        worst = int(np.argmax(history.sigma[:, i]))
        rows.append(SizeRow(
            output.name,
            output.shown_in,
            mean=None,
            sigma=float(history.sigma[worst, i] * scale[i]),
            sigma_filter=None if own is None else float(own[worst, i] * scale[i]),
            causes=cause_words(answer, causes_at(history, worst, i)),
            time=float(history.readings.times[worst]),
        ))  # fmt: skip
    return rows


def smoothed_rows(answer: LinearAnswer) -> list[SizeRow]:
    """List the largest sigma of each output that the smoother estimates, with what it claims and the causes then."""
    smoothed, scale = answer.smoothed, scale_of(answer.outputs)
    if smoothed is None or smoothed.sigma_filter is None or answer.beyond is not None:
        return []
    worst = np.argmax(smoothed.sigma, axis=0)
    return [
        SizeRow(
            output.name, output.shown_in, None, float(smoothed.sigma[at, i] * scale[i]),
            float(smoothed.sigma_filter[at, i] * scale[i]), cause_words(answer, causes_at(smoothed, at, i)),
            float(smoothed.readings.times[at]),
        )
        for i, (output, at) in enumerate(zip(answer.outputs, worst.tolist(), strict=True))
        if np.isfinite(smoothed.sigma_filter[at, i])
    ]  # fmt: skip


def reading_rows(answer: LinearAnswer) -> list[ReadingRow]:
    """List means and sigmas at all readings, a row for each reading and output; else at the end.

    Where ``beyond_range`` holds they have no meaning.
    """
    scale, history = scale_of(answer.outputs), answer.asked or answer.history
    if history is None:
        nominal = final_nominal(answer) * scale
        return [
            ReadingRow(
                None, "", output.name, output.shown_in, float(answer.sigma[i] * scale[i]), None,
                float(answer.mean[i] * scale[i]), answer.beyond is not None, known(nominal[i]),
            )
            for i, output in enumerate(answer.outputs)
        ]  # fmt: skip
    beyond, own, readings = answer.readings_beyond(history), history.sigma_filter, history.readings
    values = nominal_values(answer.outputs, readings.nominal, readings.origin, history.sigma) * scale
    nominal = np.broadcast_to(values, history.mean.shape)
    return [
        ReadingRow(
            float(time), history.readings.updates[at] or "", output.name, output.shown_in,
            float(history.sigma[at, i] * scale[i]), None if own is None else float(own[at, i] * scale[i]),
            float(history.mean[at, i] * scale[i]), bool(beyond[at]), known(nominal[at, i]),
        )
        for at, time in enumerate(history.readings.times)
        for i, output in enumerate(answer.outputs)
    ]  # fmt: skip


def contributor_rows(answer: LinearAnswer) -> list[ContributorRow]:
    """List the contributions of all causes to the final sigmas, the largest first; none beyond the linear range."""
    if answer.beyond is not None:
        return []
    scale, budget, names = scale_of(answer.outputs), answer.budget, answer.causes
    rows, kinds = [], kinds_of(answer.outputs)
    for i in sorted(range(len(kinds)), key=lambda i: KINDS.index(kinds[i]) if kinds[i] else 0):
        output = answer.outputs[i]
        shares = np.nan_to_num(budget.shares[i])
        for j in np.argsort(-shares, kind="stable"):
            if shares[j] >= COARSEST_SHARE:
                sigma = float(abs(budget.contributions[i, j]) * scale[i])
                rows.append(ContributorRow(output.name, names[j], float(shares[j]), sigma, output.shown_in))
    return rows


def exported(answer: LinearAnswer) -> Mapping[str, Sequence[Mapping[str, object]]]:
    """Return the tables that ``--format json`` prints, the first of them also as CSV."""
    tables = (reading_rows(answer), contributor_rows(answer), requirement_rows(answer))
    return dict(zip(("sigmas", "contributors", "requirements"), ([asdict(row) for row in rows] for rows in tables),
                    strict=True))  # fmt: skip
