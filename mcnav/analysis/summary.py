"""The results of a run as ``summary.json`` holds them: SI units, rows and columns in the order of outputs and sources.

A summary that an earlier version wrote lacks the keys that did not exist then; they have the value that stands for
nothing known. A number that is not finite is null in the file: NaN in an array, none elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import ConfigDict, Field

from mcnav.contract.quantities import Of
from mcnav.files.records import Matrix, Number, Record, Vector
from mcnav.files.whole import to_json

Ends = tuple[float | None, float | None]
"""Ends of an interval."""

Numbers = Sequence[Number]
Gaps = Sequence[float | None]
"""Numbers, none where one is not known."""

Table = Sequence[Sequence[float | None]]


class _Entry(Record):
    """A table of a summary, which is made of numbers of numpy as well."""

    model_config = ConfigDict(strict=False, defer_build=True)


class Named(_Entry):
    """An error source or output; ``of`` is that of `mcnav.contract.quantities.Output`."""

    name: str
    unit: str
    of: Of = "navigation"


class ShownIn(_Entry):
    """Units in which sources and outputs are shown."""

    sources: Sequence[str] = ()
    outputs: Sequence[str] = ()


class Unsettled(_Entry):
    """The reason why there is no valid linear model; see `mcnav.systems.user.soundness.Unsettled`."""

    source: str
    output: str
    disagreement: float | None
    limit: float | None = None
    own: bool
    noise: str = ""


class Beyond(_Entry):
    """Outputs that leave the range of linear analysis; ``begin`` in the unit of the run's histories, as in ``time``."""

    outputs: Sequence[str]
    begin: float | None
    time: str | None


class Stopping(_Entry):
    """Stopping rule, and the precision at the last look."""

    quantity: str
    precision: float
    confidence: float
    at_most: int
    looks: int
    found: float | None = None
    reached: bool


class Excluded(_Entry):
    """See `mcnav.analysis.failed_samples.FailureBias`."""

    samples: int
    sigma_ratio: Vector


class Process(_Entry):
    """A process of noise, and the covariance that it adds to the final errors."""

    name: str
    covariance: Matrix


class CombinationEntry(_Entry):
    """A combination of outputs, in the unit of its lead output; see `mcnav.analysis.combinations.Combination`."""

    lead: str
    weights: Vector
    shares: Vector
    sigma_linear: Number
    sigma_paired: Number
    mean_error: Number
    verdict: str | None = None


class Joint(_Entry):
    """Mean and dispersion of all outputs together; see `mcnav.analysis.ellipsoid.Ellipsoid`."""

    cause: str | None
    nees_verdict: str
    nees_about_mean: Number
    dispersion_verdict: str | None
    dispersion_ratio: float | None
    dispersion_ratio_interval: Ends | None
    samples_needed: int | None
    mean_error: Number
    differing: CombinationEntry | None
    shifted: CombinationEntry | None
    unpredicted: Sequence[CombinationEntry]

    @property
    def foremost(self) -> CombinationEntry | None:
        """The combination that shows why the joint distribution is not the linear one; none where it is."""
        match self.cause:
            case None:
                return None
            case "unpredicted":
                return self.unpredicted[0]
            case "mean":
                return self.shifted
            case _:
                return self.differing


class _Simulated(_Entry):
    """Numbers that are computed with the campaign, or why they could not be; other keys are kept."""

    model_config = ConfigDict(extra="allow")

    failed: str | None = None


class Unscented(_Simulated):
    """Moments by the unscented transform."""

    mean: Gaps | None = None
    covariance: Table | None = None


class SecondOrder(_Simulated):
    """Terms of higher order; see `mcnav.linear.higher_order`."""

    mean_shift: Gaps | None = None
    quadratic: Table | None = None
    third_order: Table | None = None
    skewness: Gaps | None = None


class HigherOrder(_Simulated):
    """Moments of a fitted polynomial in closed form; see `mcnav.linear.nonlinear_corrections`."""

    mean: Gaps | None = None
    covariance: Table | None = None
    skewness: Gaps | None = None
    kurtosis: Gaps | None = None
    sigma: Gaps | None = None


class HypothesisEntry(_Entry):
    """See `mcnav.statistics.hypothesis_test.HypothesisTest`."""

    statistic: float | None
    degrees_of_freedom: Sequence[float | None]
    p_value: float | None
    rank: int


class ContainedEntry(_Entry):
    """Share of the samples within the linear ellipsoid of a level."""

    level: float
    share: float
    interval: Ends


class Causes(_Entry):
    """See `mcnav.analysis.variance_breakdown.VarianceBreakdown`."""

    terms: Mapping[str, Vector]
    total: Vector
    paired: Vector
    standard_error: Vector
    unscented: Vector


class QuantileEntry(_Entry):
    """See `mcnav.analysis.tails.Quantile`; outputs by name. Summaries before 0.1 have no interval and no verdict."""

    outputs: Sequence[str]
    probability: float
    estimate: float | None
    lower: float | None
    upper: float | None
    linear: float | None
    together: Ends | None = None
    verdict: str | None = None


class SizeEntry(_Entry):
    """The size of a vector by its exact law and by samples; see `mcnav.analysis.vector_sizes`."""

    output: str
    nominal: float
    sigma: float
    median: float | None
    mean: float
    most: float | None
    three_sigma: float
    three_sigma_probability: float | None
    wrong: bool
    median_sample: float | None
    mean_sample: float | None
    most_sample: float | None
    median_interval: Ends | None
    mean_interval: Ends | None
    most_interval: Ends | None


class CauseEntry(_Entry):
    """A cause of errors, and its share in their linear mean square."""

    name: str
    share: float


class ExceedanceEntry(_Entry):
    """See `mcnav.analysis.requirements.Exceedance`."""

    estimate: float | None
    low: Annotated[float | None, Field(alias="from")]
    high: Annotated[float | None, Field(alias="to")]
    flights: int
    method: str
    refusal: str = ""
    way: Mapping[str, float] = {}
    sides: int = 0
    power: float | None = None


class RequirementEntry(_Entry):
    """See `mcnav.analysis.requirements.RequirementResult`; outputs by name."""

    kind: str
    outputs: Sequence[str]
    limits: Sequence[float]
    probability: float | None = None
    when: str = ""
    about: str = ""
    epochs: Sequence[int] = ()
    finding: str
    estimate: float | None
    interval: Ends
    linear: float | None
    linear_meets: bool | None
    samples_needed: int | None
    largest_sigmas: Vector | None
    remark: str = ""
    time: float | None = None
    samples: int | None = None
    causes: Sequence[CauseEntry] = ()
    exceedance: ExceedanceEntry | None = None


class Tally(_Entry):
    """Number of requirements by finding, and of all."""

    met: int
    not_met: int
    undecided: int
    of: int
    met_as_known: int = 0


def tally(findings: Iterable[str]) -> Tally | None:
    """Count requirements by their findings; none without requirements.

    >>> tally(["not met", "undecided"])
    Tally(met=0, not_met=1, undecided=1, of=2, met_as_known=0)
    """
    result = list(findings)
    if not result:
        return None
    met, not_met, undecided, known = map(result.count, ("met", "not met", "undecided", "met for the known ways"))
    return Tally(met=met, not_met=not_met, undecided=undecided, of=len(result), met_as_known=known)


class Variances(_Entry):
    """Variances of outputs (rows) by sources (columns), and their standard errors."""

    variance: Table
    standard_error: Table


class SourcesAlone(_Simulated):
    """Variance with each source alone and without it."""

    samples: int = 0
    degrees_of_freedom: float | None = None
    alone: Variances | None = None
    without: Variances | None = None


class SobolIndices(_Simulated):
    """Sobol indices of outputs (rows) by sources (columns)."""

    replicates: int = 0
    points: int = 0
    first_order: Table | None = None
    first_order_standard_error: Table | None = None
    total: Table | None = None
    total_standard_error: Table | None = None


class SimulatedBudget(_Entry):
    """The budget that was simulated; see `mcnav.linear.nonlinear_corrections`."""

    model_config = ConfigDict(extra="allow")

    alone: SourcesAlone | None = None
    sobol: SobolIndices | None = None


class Budget(_Entry):
    """See `mcnav.analysis.budget.ErrorBudget`."""

    shares: Matrix
    cross_terms: Vector
    contributions: Matrix
    saved: Matrix
    flown: SimulatedBudget | None = None


class NeglectedEntry(_Entry):
    """An error that a filter neglects: mean squares, and the share in the sum of all differences."""

    name: str
    true: float
    believed: float
    share: float


class Departure(_Entry):
    """The time and place where the ratio of true to filter sigma is certain to depart from one."""

    verdict: str
    of: str
    name: str
    factor: float | None
    factor_interval: Ends | None
    begin: float | None
    end: float | None
    worst: float | None


class FilterRatio(_Entry):
    """A ratio of true to filter sigma at the end, and the finding on it over time.

    Of a group of states there is the NEES, of an output or state the sigmas, and the shares of samples within them.
    """

    unit: str = ""
    sigma_true: float | None = None
    sigma_filter: float | None = None
    size: int = 0
    nees_mean: float | None = None
    nees_interval: Ends | None = None
    nees_bounds: Ends | None = None
    ratio: float | None
    ratio_interval: Ends
    ratio_linear: float | None = None
    within_1: float | None = None
    within_1_bounds: Ends | None = None
    within_3: float | None = None
    within_3_bounds: Ends | None = None
    verdict: str
    factor: float | None
    factor_interval: Ends | None
    begin: float | None
    end: float | None
    worst: float | None
    samples_needed: int | None
    remark: str = ""


class SensorEntry(_Entry):
    """Updates, NIS and whiteness of a sensor over the whole flight, and the finding on it."""

    size: int
    accepted: float
    rejected: float
    nis_mean: float | None
    nis_interval: Ends | None
    nis_bounds: Ends | None
    nis_beyond: bool
    correlation: float | None
    correlation_interval: Ends | None
    correlation_bound: float | None
    correlation_beyond: bool
    verdict: str
    factor: float | None
    factor_interval: Ends | None
    samples_needed: int | None
    remark: str = ""


class FaultEntry(_Entry):
    """A fault of a sensor: measurements that were rejected in a sample, with the interval, and as expected; SI."""

    sensor: str
    kind: str
    component: str
    unit: str
    shown_in: str
    begin: float
    end: float
    size: float
    measurements: int
    rejected: float | None
    rejected_interval: Ends | None
    expected: float
    alarm: float


class FilterSummary(_Entry):
    """The verdict on the filter, and of every table what holds at the end or over the whole flight."""

    verdict: str
    group: str = ""
    output: str = ""
    factor: float | None = None
    factor_interval: Ends | None = None
    time: str = ""
    begin: float | None = None
    end: float | None = None
    worst: float | None = None
    samples: int = 0
    tolerance: float | None = None
    confidence: float | None = None
    samples_needed: int | None = None
    neglected: Sequence[NeglectedEntry] = ()
    neglected_at: float | None = None
    neglected_output: str = ""
    remarks: Sequence[str] = ()
    verdict_groups: str = ""
    verdict_outputs: str = ""
    departures: Sequence[Departure] = ()
    groups: Mapping[str, FilterRatio] = {}
    outputs: Mapping[str, FilterRatio] = {}
    states: Mapping[str, FilterRatio] = {}
    sensors: Mapping[str, SensorEntry] = {}


class Summary(_Entry):
    """The content of ``summary.json``; lists are empty where nothing was compared."""

    campaign: str
    verdict: str
    unsettled: Unsettled | None = None
    remarks: Sequence[str] = ()
    samples: int
    failed: int
    failures: Mapping[str, int] = {}
    excluded: Excluded | None = None
    engine: str
    seed: int
    design: str
    store: str = "samples"
    kept: int | None = None
    tolerance: float
    confidence: float
    heavy_tailed: Sequence[str] = ()
    stopping: Stopping | None = None
    long_tailed: Sequence[str] = ()
    confidence_each: Number = math.nan
    sources: Sequence[Named]
    outputs: Sequence[Named]
    shown_in: ShownIn = ShownIn()
    partials: Matrix
    start_mean: Vector
    start_covariance: Matrix
    processes: Sequence[Process] = ()
    mean_linear: Vector
    mean_sample: Vector
    bias: Numbers = ()
    bias_standard_error: Numbers = ()
    nominal: Gaps = ()
    mean_error: Gaps = ()
    mean_error_interval: Sequence[Ends | None] = ()
    mean_rounding: Numbers = ()
    covariance_linear: Matrix
    covariance_sample: Matrix
    covariance_paired: Matrix
    sigma_linear: Vector
    sigma_sample: Numbers = ()
    sigma_paired: Numbers = ()
    sigma_ratio: Gaps = ()
    sigma_ratio_interval: Sequence[Ends | None] = ()
    sigma_ratio_paired: Gaps = ()
    sigma_ratio_paired_interval: Sequence[Ends | None] = ()
    verdicts: Sequence[str] = ()
    samples_needed: Sequence[int | None] = ()
    floors: Gaps = ()
    withheld: Sequence[str] | None = None
    not_joint: Sequence[str] = ()
    nees_dimension: int = 0
    nees_mean: float | None = None
    nees_standard_error: float | None = None
    nees_mean_paired: float | None = None
    nees_paired_standard_error: float | None = None
    direction_ratio: float | None = None
    direction_weights: Vector | None = None
    verdict_matrix: str | None = None
    unscented: Unscented | None = None
    detectable_ratio: Numbers = ()
    samples_to_see_tolerance: Numbers = ()
    nees_mean_expected: Ends | None = None
    detectable_ratio_paired: Numbers = ()
    principal_ratios: Vector = np.empty(0)
    principal_directions: Matrix = np.empty((0, 0))
    joint: Joint | None = None
    tests: Mapping[str, HypothesisEntry | None] = {}
    contained: Sequence[ContainedEntry] = ()
    correlation_difference: Matrix | None = None
    correlation_difference_standard_error: Matrix | None = None
    skewness: Numbers = ()
    skewness_standard_error: Numbers = ()
    excess_kurtosis: Numbers = ()
    excess_kurtosis_standard_error: Numbers = ()
    second_order: SecondOrder | None = None
    higher_order: HigherOrder | None = None
    causes: Causes | None = None
    tails: Sequence[QuantileEntry] = ()
    pairs_without_cep: int = 0
    sizes: Sequence[SizeEntry] = ()
    requirements: Sequence[RequirementEntry] = ()
    requirements_met: Tally | None = None
    beyond_range: Beyond | None = None
    budget: Budget
    covariance_filter: Matrix | None = None
    sigma_filter: Vector | None = None
    nees_filter_mean: float | None = None
    nees_filter_dimension: int | None = None
    nis_mean: Mapping[str, float | None] = {}
    filter_verdict: str = ""
    filter: FilterSummary | None = None
    smoother_verdict: str = ""
    smoother: FilterSummary | None = None
    faults: Sequence[FaultEntry] = ()

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """Read the content of ``summary.json``; `ValueError` when it is not as this program writes it."""
        return cls.model_validate(content)

    @property
    def as_stored(self) -> Self:
        """The same as it is read from the file, which has no numbers that are not finite."""
        return self.of(to_json(self.as_mapping))

    @property
    def as_mapping(self) -> dict[str, Any]:
        """The content by key, in the order of the file; matrices are arrays."""
        return self.model_dump(exclude_unset=True)

    @property
    def names(self) -> list[str]:
        """Names of the outputs."""
        return [output.name for output in self.outputs]

    @property
    def causes_of_errors(self) -> list[str]:
        """Names of the sources and, after them, of the processes of noise."""
        return [*(source.name for source in self.sources), *(process.name for process in self.processes)]

    @property
    def units_shown(self) -> Sequence[str]:
        """Units in which the outputs are shown."""
        return self.shown_in.outputs or [output.unit for output in self.outputs]

    @property
    def counts(self) -> Tally | None:
        """Number of requirements by finding; none without requirements."""
        return tally(entry.finding for entry in self.requirements)
