"""Assessment of a filter: each statistic of its consistency over time, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_causes import Departure, largest_departure, neglected_errors
from mcnav.analysis.filter_consistency import (
    Band,
    FilterConsistency,
    Finding,
    GroupConsistency,
    Honesty,
    SensorConsistency,
    SigmaConsistency,
    Whiteness,
)
from mcnav.analysis.filter_decision import (
    NOT_NAVIGATION,
    Decision,
    certain_departures,
    decide,
    deciding_names,
    outputs_of,
    worst_output,
)
from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares, singular
from mcnav.analysis.filter_judgement import (
    Rates,
    find,
    mean_square_band,
    root_ratio,
    too_many_failed,
    undecidable,
)
from mcnav.analysis.filter_remarks import remarks_on
from mcnav.analysis.floor import filter_floor, negligible
from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE
from mcnav.arrays.types import Array
from mcnav.statistics.filter_sums import FilterMeans, Means
from mcnav.statistics.mean_square import mean_square_bounds, share_bounds, share_intervals

WITHIN: Final = {"within_1": float(special.erf(np.sqrt(0.5))), "within_3": float(special.erf(3.0 * np.sqrt(0.5)))}
"""Probability of a normal error within one and three sigmas."""


HEAVY: Final = "a source that it may depend on has heavy tails: there is no interval"
"""Why nothing is decided of an output, a state or a sensor."""


@dataclass(frozen=True)
class _Basis:
    """Evidence, criterion, rates of the intervals that decide, and why nothing can be decided, if so."""

    evidence: FilterEvidence
    criterion: Criterion
    deciding: Rates
    remark: str

    @property
    def tolerance(self) -> float:
        return self.criterion.tolerance

    @property
    def considered(self) -> tuple[str, ...]:
        return () if self.evidence.means is None else self.evidence.means.schema.considered

    def on(self, outputs: Sequence[int], further: bool = False) -> _Basis:
        """Return the basis of a statement on outputs, and on ``further`` states or innovations.

        It decides nothing on outputs that depend on a source with heavy tails, nor, where there are some, on anything
        further, whose dependence is not known.
        """
        withheld = self.evidence.withheld
        if self.remark or not withheld or not (further or set(outputs) & set(withheld)):
            return self
        everything = tuple(range(len(self.evidence.outputs)))
        return replace(self, evidence=replace(self.evidence, withheld=everything), remark=HEAVY)

    def count(self, samples: Array) -> Array:
        """Return the number of independent samples."""
        return np.asarray(samples * self.evidence.weight)

    def error(self, error: Array) -> Array:
        """Return the standard error of a mean over so many independent samples fewer."""
        weight = self.evidence.weight
        return np.asarray(error / np.sqrt(weight)) if weight else np.full_like(error, np.inf)

    def find(self, ratio: Band, samples: int, rates: Rates, remark: str = "") -> Finding:
        """Judge a ratio over time."""
        return find(ratio, self.tolerance, samples, rates, self.remark or remark)


def assess_filter(evidence: FilterEvidence, criterion: Criterion) -> FilterConsistency:
    """Assess the consistency of a filter; the tolerance is that of the ratio of true sigma to the filter's."""
    remark, means = undecidable(evidence.samples, evidence.failed, evidence.weight), evidence.means
    if means is None:
        return FilterConsistency(
            evidence.label, evidence.times, 0, criterion.confidence, criterion.tolerance, (), (), (), (),
            Honesty.UNDECIDED, remarks=(f"{remark[:1].upper()}{remark[1:]}.",), subject=evidence.subject,
        )  # fmt: skip
    basis = _Basis(evidence, criterion, Rates.of(criterion, _deciding_intervals(evidence, means)), remark)
    outputs = () if evidence.true is None else _outputs(basis, means, evidence.true)
    states, sensors = _states(basis, means), _sensors(basis, means)
    groups = _groups(basis, means, outputs, states)
    outputs = tuple(outputs[number] for number in means.schema.known) if outputs else ()
    of_name = {group.name: group for group in groups}
    deciding = [of_name[name] for name in deciding_names(of_name)]
    decision = decide(deciding, outputs)
    finding, picked = decision.decides.finding, decision.decides
    doubt = "" if decision.departures or remark else _doubt(evidence, means, outputs)
    named, overlooked = worst_output(outputs, decision), None if remark else _overlooked(outputs, criterion.tolerance)
    verdict = Honesty.UNDECIDED if doubt else decision.verdict
    if overlooked is not None:
        doubt = ""
        if verdict != Honesty.OPTIMISTIC:
            verdict, finding, named = Honesty.OPTIMISTIC, Finding(Honesty.OPTIMISTIC), overlooked
    causes = _causes(evidence, decision, criterion.tolerance)

    def time(epoch: int | None) -> float | None:
        return None if epoch is None else float(evidence.times[epoch])

    return FilterConsistency(
        label=evidence.label,
        times=evidence.times,
        samples=evidence.samples,
        confidence=criterion.confidence,
        tolerance=criterion.tolerance,
        groups=groups,
        outputs=outputs,
        states=states,
        sensors=sensors,
        verdict=verdict,
        group="" if finding.factor is None or not picked.size else picked.name,
        factor=finding.factor,
        interval=finding.interval,
        begin=time(finding.begin),
        end=time(finding.end),
        worst=time(finding.worst),
        output="" if named is None else outputs[named].name,
        neglected=() if causes is None or evidence.linear is None else neglected_errors(evidence.linear, causes),
        neglected_at=None if causes is None else time(causes.epoch),
        neglected_output="" if causes is None else evidence.outputs[causes.output].name,
        samples_needed=finding.samples_needed,
        remarks=remarks_on(doubt or finding.remark, means, decision, groups, outputs, states, sensors),
        covariance=means.covariances[-1],
        on_groups=decision.groups,
        on_outputs=decision.outputs,
        departures=certain_departures(decision, evidence.times),
        doubt=doubt,
        overlooked="" if overlooked is None else outputs[overlooked].name,
        subject=evidence.subject,
    )


def _deciding_intervals(evidence: FilterEvidence, means: FilterMeans) -> int:
    """Count the intervals that decide: of each group and each output, at the epochs at which there is one.

    They share the error rate equally.
    """
    deciding = deciding_names(means.schema.groups)
    columns = [number for number, name in enumerate(means.schema.groups) if name in deciding]
    of_groups = np.count_nonzero(np.isfinite(means.at("nees").value[:-1, columns]))
    of_outputs = 0 if evidence.true is None else np.count_nonzero(means.variances.value[:-1] > 0.0)
    return int(of_groups + of_outputs)


def _causes(evidence: FilterEvidence, decision: Decision, tolerance: float) -> Departure | None:
    """Return where linear analysis names the causes of an optimistic filter: in the group that departs.

    Of an output that departs by itself it is the smallest group that holds it, so that chance does not name the error.
    """
    if decision.verdict != Honesty.OPTIMISTIC or evidence.linear is None or evidence.means is None:
        return None
    names, decides = [output.name for output in evidence.outputs], decision.decides
    if decides.size:
        return largest_departure(evidence.linear, outputs_of(decides.name, names), tolerance)
    groups = (outputs_of(group, names) for group in deciding_names(evidence.means.schema.groups))
    holding = (members for members in groups if names.index(decides.name) in members)
    return largest_departure(evidence.linear, min(holding, key=len), tolerance)


def _overlooked(outputs: Sequence[SigmaConsistency], tolerance: float) -> int | None:
    """Return an output whose error the filter believes to be zero where it is not; none where no filter does.

    Errors below the tolerance, as a share of the largest over time, are left to `_doubt`: at a start without errors
    they are of second order.
    """
    for number, output in enumerate(outputs):
        if np.any(output.overlooked & (output.true > tolerance * output.true.max(initial=0.0))):
            return number
    return None


def _doubt(evidence: FilterEvidence, means: FilterMeans, outputs: Sequence[SigmaConsistency]) -> str:
    """Return why a filter is not called consistent, although its ratios are; empty when there is no reason."""
    if too_many_failed(evidence.samples, evidence.failed):
        return "too many samples failed"
    counts = means.at("nees").count[:-1]
    if np.any((counts > 0.0) & (means.samples - counts > LARGEST_FAILED_SHARE * means.samples)):
        return "the filter's covariance is singular in too many samples"
    if any(output.overlooked.any() for output in outputs):
        return "the filter believes in no error where there is one"
    return ""


def _groups(
    basis: _Basis, means: FilterMeans, outputs: Sequence[SigmaConsistency], states: Sequence[SigmaConsistency]
) -> tuple[GroupConsistency, ...]:
    """Compare the mean NEES of each group with its size, at every epoch at which the filter believes in its errors.

    Bounds of a consistent filter hold for all groups together.
    """
    nees, evidence = means.at("nees"), basis.evidence
    epochs, sizes = len(evidence.times), means.schema.groups
    known = np.isfinite(nees.value[:-1])
    bounding, deciding = Rates.of(basis.criterion, int(np.count_nonzero(known))), deciding_names(sizes)
    others = [number for number, name in enumerate(sizes) if name not in deciding]
    aside = Rates.of(basis.criterion, int(np.count_nonzero(known[:, others])))
    names = [output.name for output in evidence.outputs]
    consistencies = []
    for number, (name, size) in enumerate(sizes.items()):
        picked = [i for i in outputs_of(name, names) if i in means.schema.known]
        based = basis.on(picked, further=len(picked) != size)
        members = [*(() if name == "sensors" else (outputs[i] for i in picked if outputs))]
        members += states if name in NOT_NAVIGATION else ()
        unknown = np.zeros(epochs, dtype=bool)
        for member in members:
            unknown = unknown | member.disbelieved | member.negligible
        if len(picked) > 1:
            unknown |= _singular(means.covariances[:epochs][:, np.array(picked)[:, None], picked], unknown)
        rates, count = basis.deciding if name in deciding else aside, based.count(nees.count[:epochs, number])
        band = mean_square_band(
            np.where(unknown, np.nan, nees.value[:epochs, number]),
            based.error(nees.standard_error[:epochs, number]),
            count,
            count * size,
            rates,
        )
        ratio = root_ratio(band, float(size))
        freedom = np.array(means.samples * based.evidence.weight * size)
        bounds_each, bounds_together = (
            _pair(mean_square_bounds(float(size), freedom, each)) for each in (bounding.each, bounding.together)
        )
        linear = None if name == "sensors" else _linear_ratio(evidence.linear, tuple(picked), size)
        consistencies.append(
            GroupConsistency(
                name,
                size,
                band,
                bounds_each,
                bounds_together,
                ratio,
                linear,
                based.find(ratio, means.samples, rates),
            )
        )
    return tuple(consistencies)


def _singular(covariances: Array, unknown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where the filters' mean covariance of a group, shape (m, k, k), has no inverse, shape (m,)."""
    sigma = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    known = ~unknown & np.isfinite(covariances).all(axis=(1, 2)) & (sigma > 0.0).all(axis=1)
    scale = np.where(known[:, None], sigma, 1.0)
    correlations = covariances / (scale[:, :, None] * scale[:, None, :])
    return known & singular(np.where(known[:, None, None], correlations, np.eye(sigma.shape[1])))


def _linear_ratio(linear: LinearFilter | None, outputs: tuple[int, ...], size: int) -> Array | None:
    """Return the root of the mean NEES of some outputs by linear analysis over their number, shape (m,).

    With T the true mean squares and P the filter's covariance, the mean NEES is the trace of P^-1 T; NaN where P is
    singular. None where the outputs are not the whole group.
    """
    if linear is None or linear.true is None or len(outputs) != size:
        return None
    picked = np.ix_(range(len(linear.covariance)), outputs, outputs)
    own, true = linear.covariance[picked], linear.true[picked]
    sigma = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2), 0.0))
    regular = np.asarray((sigma > 0.0).all(axis=1))
    scale = np.where(regular[:, None], sigma, 1.0)
    scales = scale[:, :, None] * scale[:, None, :]
    own, true = np.where(regular[:, None, None], own / scales, np.eye(size)), true / scales
    regular &= np.linalg.eigvalsh(own)[:, 0] > size * np.finfo(float).eps
    own[~regular] = np.eye(size)
    nees = np.trace(np.linalg.solve(own, true), axis1=1, axis2=2)
    return np.asarray(np.where(regular, np.sqrt(np.maximum(nees, 0.0) / size), np.nan))


def _ratio(basis: _Basis, squares: Means, variances: Means, rates: Rates, floor: float) -> Band:
    """Return the roots of mean squares over mean variances; their errors add up, whatever their correlation."""
    small = negligible(_root(squares.value), _root(variances.value), floor) | (variances.value <= floor**2)
    known = ~small & np.isfinite(variances.standard_error)
    relative = np.where(known, variances.standard_error / np.where(known, variances.value, 1.0), 0.0)
    error = basis.error(squares.standard_error + squares.value * relative)
    count = basis.count(squares.count)
    expected = np.where(small, 0.0, variances.value)
    return root_ratio(mean_square_band(squares.value, error, count, count, rates), expected)


def _outputs(basis: _Basis, means: FilterMeans, true: MeanSquares) -> tuple[SigmaConsistency, ...]:
    """Compare the true sigma of each output with the filters', and count the samples within."""
    evidence, epochs = basis.evidence, len(basis.evidence.times)
    variances, linear = means.variances, evidence.linear
    shares = {name: means.at(name) for name in WITHIN}
    halves = Rates.of(basis.criterion, 2 * len(evidence.outputs) * epochs)
    independent = means.samples * evidence.weight
    bounds_1, bounds_3 = (share_bounds(each, independent, halves.together) for each in WITHIN.values())
    floors = filter_floor(
        _root(true.value),
        _root(variances.value[:epochs]),
        [output.unit for output in evidence.outputs],
        evidence.floor,
        limits_of(output.limit for output in evidence.outputs),
    )
    consistencies = []
    for i, output in enumerate(evidence.outputs):
        squares = Means(true.value[:, i], true.standard_error[:, i], np.full(epochs, float(true.samples)))
        own = Means(variances.value[:epochs, i], variances.standard_error[:epochs, i], variances.count[:epochs, i])
        based = basis.on([i])
        ratio = _ratio(based, squares, own, basis.deciding, floors[i])
        within_1, within_3 = (
            _share_band(shares[name].value[:epochs, i], based.count(shares[name].count[:epochs, i]), halves)
            for name in WITHIN
        )
        linear_true = None if linear is None or linear.true is None else _root(linear.true[:, i, i])
        consistencies.append(
            SigmaConsistency(
                output.name,
                output.unit,
                output.shown_in,
                _root(squares.value),
                _root(own.value),
                ratio,
                linear_true,
                None if linear is None else _root(linear.covariance[:, i, i]),
                within_1,
                within_3,
                bounds_1,
                bounds_3,
                based.find(ratio, means.samples, basis.deciding),
                float(floors[i]),
            )
        )
    return tuple(consistencies)


def _states(basis: _Basis, means: FilterMeans) -> tuple[SigmaConsistency, ...]:
    """Compare the sigma of the errors of the filter's other states with the filters'."""
    basis = basis.on((), further=True)
    evidence, epochs, schema = basis.evidence, len(basis.evidence.times), means.schema
    squares, variances = means.squared_state_errors, means.at("state_variance")
    rates = Rates.of(basis.criterion, int(np.count_nonzero(variances.value[:-1] > 0.0)))
    units = [unit for unit, _ in schema.units]
    floors = filter_floor(_root(squares.value[:epochs]), _root(variances.value[:epochs]), units)
    consistencies = []
    for i, (name, (unit, shown_in)) in enumerate(zip(schema.states, schema.units, strict=True)):
        true, own = (
            Means(each.value[:epochs, i], each.standard_error[:epochs, i], each.count[:epochs, i])
            for each in (squares, variances)
        )
        ratio, linear = _ratio(basis, true, own, rates, floors[i]), evidence.linear
        consistencies.append(
            SigmaConsistency(
                name,
                unit,
                shown_in,
                _root(true.value),
                _root(own.value),
                ratio,
                None if linear is None else _root(linear.state_true[:, i]),
                None if linear is None else _root(linear.state_variance[:, i]),
                None,
                None,
                (0.0, 1.0),
                (0.0, 1.0),
                basis.find(ratio, means.samples, rates),
                float(floors[i]),
            )
        )
    return tuple(consistencies)


def _sensors(basis: _Basis, means: FilterMeans) -> tuple[SensorConsistency, ...]:
    """Compare the mean NIS of each sensor with the size of its measurements, and its innovations with white ones."""
    basis = basis.on((), further=True)
    sensors = list(means.sensors())
    whole = Rates.of(basis.criterion, 2 * len(sensors))
    intervals = sum(np.count_nonzero(consistencies["nis"].value[:-1] > 0.0) for _, _, consistencies in sensors)
    over_time = Rates.of(basis.criterion, int(intervals))
    return tuple(_sensor(basis, means.samples, *sensor, over_time, whole) for sensor in sensors)


def _sensor(
    basis: _Basis, samples: int, name: str, size: int, means: Mapping[str, Means], over_time: Rates, whole: Rates
) -> SensorConsistency:
    """Assess one sensor over the intervals between epochs and over the whole flight (the last row of all columns)."""
    accepted, rejected = means["accepted"].value, means["rejected"].value
    updates = accepted + rejected
    spread = means["accepted"].standard_error + means["rejected"].standard_error
    some = updates > 0.0
    per = np.where(some, updates, 1.0)
    nis = np.where(some, means["nis"].value / per, np.nan)
    error = basis.error((means["nis"].standard_error + np.nan_to_num(nis) * spread) / per)
    count = basis.count(means["nis"].count)
    freedom = count * per * size
    band = mean_square_band(nis[:-1], error[:-1], count[:-1], freedom[:-1], over_time)
    total = mean_square_band(nis[-1:], error[-1:], count[-1:], freedom[-1:], whole)
    bounds = np.where(some[:-1, None], mean_square_bounds(float(size), freedom[:-1], over_time.together), np.nan)
    bounds_whole = mean_square_bounds(float(size), freedom[-1], whole.together)
    bounded = basis.evidence.sampling.normal and not basis.considered
    low, high = bounds_whole if bounded else total.together[0]
    tested = float(nis[-1]) if bounded else float(size)
    remark = ""
    if not some[-1]:
        remark = "never updated"
    elif not accepted[-1] > 0.0:
        remark = "every measurement was rejected"
    return SensorConsistency(
        name=name,
        size=size,
        accepted=accepted[:-1],
        rejected=rejected[:-1],
        nis=band,
        bounds=bounds,
        nis_whole=float(nis[-1]) if some[-1] else None,
        interval_whole=_pair(total.together[0]),
        bounds_whole=_pair(bounds_whole) if some[-1] else (0.0, np.inf),
        beyond=bool(some[-1] and not basis.remark and not low <= tested <= high),
        whiteness=_whiteness(basis, size, float(nis[-1]), means, whole),
        finding=basis.find(root_ratio(total, float(size)), samples, whole, remark),
    )


def _whiteness(basis: _Basis, size: int, nis: float, means: Mapping[str, Means], rates: Rates) -> Whiteness:
    """Estimate the correlation of consecutive innovations over the whole flight.

    With u the whitened innovations, it is the mean of u_k·u_(k-1) over that of u_k·u_k. White ones have a mean product
    with the standard error 1 / sqrt(number of products × size).
    """
    lag, lags = means["lag"], means["lags"]
    pairs = float(lags.value[-1])
    if not pairs > 0.0 or not nis > 0.0:
        return Whiteness(None, (-1.0, 1.0), 1.0, beyond=False)
    mean, count = float(lag.value[-1]) / pairs, float(basis.count(lag.count[-1]))
    spread = float(basis.error(lag.standard_error[-1] + abs(mean) * lags.standard_error[-1])) / pairs
    correlation, tail = mean * size / nis, 0.5 + 0.5 * rates.together
    if basis.remark:
        return Whiteness(correlation, (-1.0, 1.0), 1.0, beyond=False)
    reach = float(special.stdtrit(count - 1.0, tail)) * spread * size / nis
    bound = float(special.ndtri(tail)) / np.sqrt(count * pairs * size)
    interval = max(correlation - reach, -1.0), min(correlation + reach, 1.0)
    return Whiteness(correlation, interval, float(bound), bool(abs(correlation) > bound), bool(basis.considered))


def _share_band(share: Array, count: Array, rates: Rates) -> Band:
    return Band(share, share_intervals(share, count, rates.each), share_intervals(share, count, rates.together))


def _pair(bounds: Array) -> tuple[float, float]:
    return float(bounds[0]), float(bounds[1])


def _root(values: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(values, 0.0)))
