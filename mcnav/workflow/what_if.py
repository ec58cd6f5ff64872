"""Linear covariance as a function of the numbers of a campaign's data sheet: of a linear answer, and of a run."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.analysis.examination import HOLDS
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.model import Model
from mcnav.analysis.rejections import OnLinear
from mcnav.analysis.requirements import Requirement, counted, size_members
from mcnav.analysis.simulated_requirements import measured_scale
from mcnav.analysis.what_if import (
    Entries,
    LimitedErrors,
    SizedSystem,
    Term,
    WhatIf,
    entries_of,
    picked_entries,
    scaled_covariance,
)
from mcnav.arrays.types import Array, IndexArray
from mcnav.config.what_if import changeable_campaign, estimable_kinds, unsized_causes
from mcnav.contract.quantities import Source
from mcnav.report.columns.gates import rejection_line

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

MOST_READINGS: Final = 160
"""Readings that a page has; of more, some are left out, and none of a requirement."""


@dataclass(frozen=True)
class _Throughout:
    """A linear system over time; ``processes`` by entry, and ``settled`` the numbers of the readings after updates."""

    times: Array
    label: str
    partials: Array
    nominal: Array | None
    processes: Mapping[str, Array]
    own: Array | None
    settled: IndexArray
    believed: Mapping[str, float]
    origin: Array | None


def what_if_of_answer(answer: LinearAnswer, content: Mapping[str, Any], beside: str) -> WhatIf | None:
    """Return what `WhatIf` describes of a linear answer; none where no number sizes anything.

    Parameters
    ----------
    content : mapping
        Of the campaign file.
    beside : str
        See `WhatIf`.
    """
    gates = ""
    if answer.rejections is not None and answer.rejections.verdict != OnLinear.HOLDS:
        gates = rejection_line(answer.rejections, [output.name for output in answer.outputs])
    requirements = _judged([requirement.requirement for requirement in answer.requirements if not gates])
    entries, throughout = _entries(requirements, answer.model), None
    if answer.history is not None:
        readings = answer.history.readings
        added = {name: picked_entries(process, entries) for name, process in readings.processes.items()}
        throughout = _Throughout(
            readings.times, readings.label, readings.partials, readings.nominal, added, answer.history.sigma_filter,
            answer.history.settled, readings.believed, readings.origin,
        )  # fmt: skip
    what_if = _what_if(content, answer.sources, answer.model, requirements, entries, throughout, beside)
    return None if what_if is None else _with_bends(replace(what_if, gates=gates), answer)


def _with_bends(what_if: WhatIf, answer: LinearAnswer) -> WhatIf:
    """Add what numbers add to the variances to second order, of independent sources about their nominal values."""
    examined, model = answer.examination, answer.model
    independent = not np.any(model.covariance - np.diag(np.diag(model.covariance))) and not model.mean.any()
    if examined is None or examined.corrected is None or not independent:
        return what_if
    owners, added = what_if.campaign.source_numbers[np.diag(model.covariance) > 0.0], examined.corrected.added_by_pairs
    bends = tuple(
        Term(first, second, (1.0 if first == second else 2.0)
             * added[:, owners == first][:, :, owners == second].sum(axis=(1, 2)))
        for first, second in combinations_with_replacement(np.unique(owners).tolist(), 2)
    )  # fmt: skip
    return replace(what_if, bends=bends, departure=HOLDS * examined.tolerance)


def what_if_of_run(content: RunAnalysis) -> WhatIf | None:
    """Return what `WhatIf` describes of a run; none where no number sizes anything, or nothing is dispersed."""
    if not content.dispersed:
        return None
    record = content.manifest.model
    campaign = tomllib.loads(content.campaign)
    gates = _gates(campaign) if record.gates is None else record.gates
    requirements = _judged([requirement.requirement for requirement in content.requirements if not gates])
    entries = _entries(requirements, content.model)
    sources = tuple(
        Source(source.name, source.unit, source.shown_in, 0.0, group=source.group or "") for source in record.sources
    )
    throughout = _throughout(content, entries)
    if throughout is None or any(np.isnan(process).any() for process in throughout.processes.values()):
        requirements = [
            requirement for requirement in requirements if not requirement.epochs
        ]  # an earlier manifest knows no more
    else:
        settled = throughout.settled
        known = {epoch for epoch in range(len(settled)) if settled[epoch] >= 0}
        requirements = [requirement for requirement in requirements if known.issuperset(requirement.epochs)]
    beside = "in the folder of this report"
    what_if = _what_if(campaign, sources, content.model, requirements, entries, throughout, beside)
    measured = {
        result.requirement: measured_scale(entry)
        for result, entry in zip(content.requirements, content.summary.requirements, strict=True)
    }
    scales = tuple(measured[required] for required in requirements)
    return None if what_if is None else replace(what_if, scales=scales, gates=gates)


def _gates(campaign: Mapping[str, Any]) -> str:
    """Say of a run by an earlier version that it does not know what its gates do; nothing without a gate."""
    gated = [table for table in (campaign.get("filter", {}), *campaign.get("aiding", ())) if "gate" in table]
    return "An earlier version made this run, and did not note what its gates do to linear analysis" if gated else ""


def _throughout(content: RunAnalysis, entries: Entries) -> _Throughout | None:
    """Return the linear system of a run over time; none where it is not known."""
    record = content.manifest.model
    known, filtered = record.development, record.filter
    if known is None or not len(known.times) or bool(known.processes) != bool(record.processes):
        return None
    count, believed, own = len(record.outputs), dict[str, float](), None
    if filtered is not None and filtered.prediction is not None:
        believed = dict(filtered.prediction.believed)
        if filtered.times.shape == known.times.shape and np.allclose(filtered.times, known.times, rtol=1e-9):
            stated = np.diagonal(filtered.prediction.covariance, axis1=1, axis2=2)
            own = np.sqrt(np.maximum(stated, 0.0))
    added = {}
    for name, variances in known.processes.items():
        by_entry = np.full((len(known.times), len(entries)), np.nan)
        by_entry[:, :count] = variances
        for place, pair in enumerate(known.pairs):
            by_entry[:, entries.index(pair)] = known.process_pairs[name][:, place]
        for place, pair in enumerate(entries[count:], count):
            if pair not in known.pairs and not _over_time(content, pair):
                by_entry[:, place] = 0.0  # a requirement at the end alone
        added[name] = by_entry
    epochs = known.times if content.histories is None else content.histories.times
    settled = _readings_at(known.times, epochs)
    return _Throughout(
        known.times, known.label, known.partials, known.nominal, added, own, settled, believed, known.origin
    )


def _readings_at(times: Array, epochs: Array) -> IndexArray:
    """Return the number of the reading at each epoch, -1 where there is none."""
    nearest = np.abs(times - epochs[:, None]).argmin(axis=1)
    return np.where(np.isclose(times[nearest], epochs, rtol=1e-9, atol=0.0), nearest, -1)


def _over_time(content: RunAnalysis, pair: tuple[int, int]) -> bool:
    """Return whether a requirement over time limits two outputs together."""
    sizes = content.model.sizes
    return any(
        set(pair) <= set(size_members(requirement.requirement.outputs, sizes) or requirement.requirement.outputs)
        for requirement in content.requirements
        if requirement.requirement.epochs and not requirement.requirement.of
    )


def _entries(requirements: Sequence[Requirement], model: Model) -> Entries:
    limited = [size_members(requirement.outputs, model.sizes) or requirement.outputs for requirement in requirements]
    return entries_of(len(model.partials), limited)


def _judged(requirements: Sequence[Requirement]) -> list[Requirement]:
    """Return the requirements that sums of the filter's errors judge: not those behind a smoother over time."""
    return [
        requirement
        for requirement in requirements
        if requirement.kind != "sigma_ratio" and not (requirement.of and requirement.epochs)
    ]


def _what_if(
    content: Mapping[str, Any], sources: Sequence[Source], model: Model, requirements: Sequence[Requirement],
    entries: Entries, throughout: _Throughout | None, beside: str,
) -> WhatIf | None:  # fmt: skip
    believed = {} if throughout is None else throughout.believed
    campaign = changeable_campaign(content, sources, list(model.processes), model.mean, model.covariance, believed)
    if not campaign.sliders:
        return None
    numbers = campaign.source_numbers, campaign.process_numbers
    moments = model.mean, model.covariance
    ends = {name: picked_entries(process, entries)[None] for name, process in model.processes.items()}
    end = SizedSystem(model.partials[None], model.nominal[None], ends, *moments, *numbers)
    if throughout is None:
        covariance, kept, settled = scaled_covariance(end, np.array([np.nan]), "", entries), np.array([0]), np.array([])
    else:
        nominal = np.zeros(throughout.partials.shape[:2]) if throughout.nominal is None else throughout.nominal
        over_time = SizedSystem(
            np.concatenate([throughout.partials, end.partials]), np.concatenate([nominal, end.nominal]),
            {name: np.concatenate([process, ends[name]]) for name, process in throughout.processes.items()},
            *moments, *numbers,
        )  # fmt: skip
        times, own, settled = throughout.times, throughout.own, throughout.settled
        if own is not None:
            own = np.concatenate([own, own[-1:]])
        covariance = scaled_covariance(over_time, np.append(times, times[-1]), throughout.label, entries, own)
        kept = _kept(len(times), [int(settled[epoch]) for requirement in requirements for epoch in requirement.epochs])
    origin = _origin(model, throughout)
    limited = tuple(
        LimitedErrors(
            requirement, chosen,
            tuple(int(np.searchsorted(kept, reading)) for reading in readings) or (len(kept) - 1,),
            counted(requirement, np.zeros_like(origin), origin)[np.ix_(readings or [-1], chosen)],
        )
        for requirement in requirements
        for chosen in [size_members(requirement.outputs, model.sizes) or requirement.outputs]
        for readings in [[int(settled[epoch]) for epoch in requirement.epochs]]
    )  # fmt: skip
    without = tuple(unsized_causes(campaign, sources, model.covariance))
    estimable = estimable_kinds(content, sources)
    readings = covariance if len(kept) == len(covariance.times) else covariance.at(kept)
    return WhatIf(campaign, readings, limited, without, beside, estimable)


def _origin(model: Model, throughout: _Throughout | None) -> Array:
    """Return what the outputs are measured from at all readings, the end after them, shape (r + 1, outputs)."""
    readings = 0 if throughout is None else len(throughout.times)
    origin = np.zeros((readings + 1, len(model.partials)))
    if throughout is not None and throughout.origin is not None:
        origin[:-1] = throughout.origin
    if model.origin is not None:
        origin[-1] = model.origin
    return origin


def _kept(count: int, required: Sequence[int]) -> IndexArray:
    """Choose readings out of so many, evenly, and those of requirements; the end after them."""
    if count <= MOST_READINGS:
        return np.arange(count + 1)
    even = np.linspace(0, count - 1, MOST_READINGS).round().astype(np.int64)
    return np.append(np.union1d(even, np.array(required, dtype=np.int64)), count)
