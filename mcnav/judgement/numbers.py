"""Numbers of a campaign, and constant errors that it lacks: what a record says of each, and what it could show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import SHARE, Assessment
from mcnav.judgement.findings import CauseVerdict, Changes, Finding, OffsetVerdict
from mcnav.judgement.naming import DELAY
from mcnav.judgement.scan import Scan
from mcnav.judgement.whitened_records import FACTORS


def list_numbers(
    record: FilteredRecord, assessment: Assessment
) -> tuple[tuple[CauseVerdict, ...], tuple[OffsetVerdict, ...]]:
    """List all numbers with what this record could show, without estimates."""
    return _causes(record, assessment), _offsets(record, assessment)


def _causes(record: FilteredRecord, assessment: Assessment) -> tuple[CauseVerdict, ...]:
    critical = assessment.critical
    result = []
    for number, cause in enumerate(record.causes):
        found = np.mean(assessment.power[number] > critical, axis=-1)
        named = np.mean((assessment.power[number] > critical) & (assessment.named[number] == number), axis=-1)
        noticed = next((size for size, share in zip(FACTORS, found, strict=True) if share >= SHARE), None)
        verdict = CauseVerdict(
            cause.name, cause.key, cause.size, cause.unit, cause.shown_in, None, float(assessment.gains[number, 0]),
            noticed, tuple(found.tolist()), tuple(named.tolist()), cause.log_factor,
        )  # fmt: skip
        result.append(verdict)
    return tuple(result)


def _offsets(record: FilteredRecord, assessment: Assessment) -> tuple[OffsetVerdict, ...]:
    gains = assessment.gains[len(record.causes) :, 0].tolist()
    return tuple(
        OffsetVerdict(
            offset.name, offset.key, offset.axes, offset.unit, offset.shown_in, (), (),
            None if offset.used is None else tuple(offset.used.tolist()), gain, tuple(noticed.tolist()),
        )
        for offset, gain, noticed in zip(record.offsets, gains, assessment.sensitivity, strict=True)
    )  # fmt: skip


def with_intervals(
    causes: tuple[CauseVerdict, ...], offsets: tuple[OffsetVerdict, ...], findings: tuple[Finding, ...],
    changes: Changes, drops: Mapping[int, float],
) -> tuple[tuple[CauseVerdict, ...], tuple[OffsetVerdict, ...]]:  # fmt: skip
    """Estimate numbers with those that are named changed, so that a wrong one makes no right one look wrong.

    Parameters
    ----------
    findings : tuple of Finding
        What is named.
    changes : Changes
        What that changes.
    drops : mapping of int to float
        Fall of the log-likelihood at the ends of the interval of each size that is estimated, by cause.
    """
    named = {finding.number.name: _with_doubt(finding) for finding in findings}
    scan = changes.naming.scan
    factors = {scan.record.causes[number].name: factor for number, factor in scan.factors(drops).items()}
    sizes = tuple(
        number if isinstance(number, CauseVerdict) else replace(cause, factor=factors.get(cause.name))
        for cause in causes
        for number in [named.get(cause.name)]
    )
    constants = tuple(
        number if isinstance(number, OffsetVerdict) else _estimated(scan, offset, changes)
        for offset in offsets
        for number in [named.get(offset.name)]
    )
    return sizes, constants


def _with_doubt(finding: Finding) -> CauseVerdict | OffsetVerdict:
    """Return what is named; a size that another number may stand for may be right, so that its interval holds one."""
    number = finding.number
    if not finding.rivals or not isinstance(number, CauseVerdict) or number.factor is None:
        return number
    factor = replace(number.factor, low=min(number.factor.low, 1.0), high=max(number.factor.high, 1.0))
    return replace(number, factor=factor)


def _estimated(scan: Scan, offset: OffsetVerdict, changes: Changes) -> OffsetVerdict:
    """Estimate a constant error alone, beside those that are named; of a clock, the delay at the start is moved."""
    moved_by = changes.delays.get(offset.name.removesuffix(DELAY), (0.0, 0.0))[0]
    free = scan.columns[offset.name]
    together = scan.with_settled(free)
    estimates, covariance = scan.base.estimates(together)[0], scan.base.covariances(together)[0]
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return replace(
        offset, estimate=tuple((moved_by + estimates[: len(free)]).tolist()), sigma=tuple(sigmas[: len(free)].tolist())
    )  # fmt: skip
