"""Consistency of a filter's own covariance with the true errors of all samples, over time.

The mean normalized estimation error squared (NEES) of a group of d states is d when the filter's covariance is that of
its errors, and the root of NEES / d is then one: the sigma of the errors over the filter's, averaged over directions.
The normalized innovation squared (NIS) of a sensor is that of what the filter predicts of its measurements
(Bar-Shalom, Li and Kirubarajan, 2001, section 5.4).

Every statement over epochs has two intervals. *Each* holds at one epoch at the confidence of the campaign;
*together* all of them hold at that confidence (Bonferroni): over all epochs, and over the groups and outputs that
decide; those of the other groups, of the other states and of the sensors are families of their own. Errors of
neighbouring epochs are strongly correlated, so that the actual confidence is higher: these intervals are conservative.

A filter is *optimistic* or *pessimistic* when an interval of the second sort lies beyond the tolerance: with the stated
confidence there is no false alarm. It is *consistent* when all intervals of the first sort, of groups and of single
outputs, lie within the tolerance: were one ratio beyond it at any epoch, this one interval would have to miss it, so
that no correction is needed (an intersection-union test; Berger, 1982). See `mcnav.analysis.filter_decision`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.floor import negligible
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.arrays.types import Array

MEAN: Final = "mean_of_"
"""Beginning of the name of an error whose mean is larger than its sigma."""


def cause_words(name: str) -> str:
    """Name a cause for people.

    >>> cause_words("mean_of_gyro_bias"), cause_words("mean_of_nominal_errors")
    ('mean of gyro bias', 'faults or other errors without a source')
    """
    if name.removeprefix(MEAN) == NOMINAL:
        return "faults or other errors without a source"
    return name.replace("_", " ")


class Honesty(StrEnum):
    """Verdict on the ratio of true sigma to the filter's sigma."""

    CONSISTENT = "consistent"
    OPTIMISTIC = "optimistic"
    PESSIMISTIC = "pessimistic"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Band:
    """A statistic at m epochs, NaN where it is not known, with its intervals.

    Attributes
    ----------
    value : ndarray, shape (m,)
    each : ndarray, shape (m, 2)
        Intervals, each at the confidence.
    together : ndarray, shape (m, 2)
        Intervals that all hold together at the confidence.
    """

    value: Array
    each: Array
    together: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """Return where the statistic is known, shape (m,)."""
        return np.isfinite(self.value)


@dataclass(frozen=True)
class Finding:
    """Verdict on a ratio of sigmas over time.

    Attributes
    ----------
    verdict : Honesty
    factor : float or None
        The ratio at its worst epoch: that of the largest departure that is certain, else the farthest from one.
    interval : (float, float) or None
        Interval of the factor that holds together with those of all other epochs, so that choosing the worst leaves
        its confidence.
    worst : int or None
        That epoch.
    begin, end : int or None
        First and last epoch at which the departure is certain.
    samples_needed : int or None
        Approximate number of samples that would decide an undecided case.
    remark : str
        Reason why nothing could be decided, other than too few samples.
    """

    verdict: Honesty
    factor: float | None = None
    interval: tuple[float, float] | None = None
    worst: int | None = None
    begin: int | None = None
    end: int | None = None
    samples_needed: int | None = None
    remark: str = ""


@dataclass(frozen=True)
class GroupConsistency:
    """NEES of a group of states over time.

    Attributes
    ----------
    name : str
        all, navigation, position, velocity, attitude or sensors.
    size : int
        States of the group: the NEES that is expected.
    nees : Band
        Mean over the samples.
    bounds_each, bounds_together : (float, float)
        Where the mean NEES of so many samples of a consistent filter lies, at one epoch and at all together.
    ratio : Band
        Root of NEES / size.
    linear : ndarray, shape (m,), or None
        The same ratio by linear analysis, without sampling error; NaN where it is not known.
    finding : Finding
    """

    name: str
    size: int
    nees: Band
    bounds_each: tuple[float, float]
    bounds_together: tuple[float, float]
    ratio: Band
    linear: Array | None
    finding: Finding


@dataclass(frozen=True)
class SigmaConsistency:
    """True and filter sigma of an output, or of another state of the filter, over time; SI.

    Sigmas are roots of mean squares about zero, as the filter's are: a mean error counts.

    Attributes
    ----------
    name, unit, shown_in : str
    true : ndarray, shape (m,)
        Of all samples.
    filter : ndarray, shape (m,)
        Root of the mean variance that the samples' filters state.
    ratio : Band
        True over filter sigma.
    true_linear, filter_linear : ndarray, shape (m,), or None
        By linear analysis, without sampling error.
    within_1, within_3 : Band or None
        Share of samples whose error lies within one and three sigmas of their own filter; none for other states.
    bounds_1, bounds_3 : (float, float)
        Where these shares of so many samples of a consistent filter lie, at all epochs together.
    finding : Finding
    floor : float
        Sigma up to which one counts as none (`mcnav.analysis.floor`).
    """

    name: str
    unit: str
    shown_in: str
    true: Array
    filter: Array
    ratio: Band
    true_linear: Array | None
    filter_linear: Array | None
    within_1: Band | None
    within_3: Band | None
    bounds_1: tuple[float, float]
    bounds_3: tuple[float, float]
    finding: Finding
    floor: float = 0.0

    @property
    def disbelieved(self) -> NDArray[np.bool_]:
        """Return where the filter believes in no error, shape (m,): sigmas up to the floor count as zero."""
        return np.asarray(self.filter <= self.floor)

    @property
    def negligible(self) -> NDArray[np.bool_]:
        """Return where the floor hides the error or the filter's sigma, shape (m,)."""
        return negligible(self.true, self.filter, self.floor)

    @property
    def overlooked(self) -> NDArray[np.bool_]:
        """Return where the filter believes in no error and there is one, shape (m,)."""
        return np.asarray(self.disbelieved & ~self.negligible)

    @property
    def claims(self) -> bool:
        """Return whether there is a ratio to judge at any epoch: not without error and variance."""
        return bool(self.ratio.known.any())

    @property
    def linear(self) -> Array | None:
        """True over filter sigma by linear analysis, shape (m,); NaN where the filter's is zero."""
        if self.true_linear is None or self.filter_linear is None:
            return None
        positive = self.filter_linear > 0.0
        return np.asarray(np.where(positive, self.true_linear / np.where(positive, self.filter_linear, 1.0), np.nan))


@dataclass(frozen=True)
class Whiteness:
    """Correlation of a sensor's consecutive innovations, over the whole flight.

    Attributes
    ----------
    correlation : float or None
        Mean product of whitened innovations that follow one another, over their mean square; none without two.
    interval : (float, float)
    bound : float
        Largest absolute value that so many white innovations have at the confidence.
    beyond : bool
        Whether the correlation is beyond the bound.
    expected : bool
        Whether the filter considers errors without estimating them, which correlate the innovations of a matched filter
        as well.
    """

    correlation: float | None
    interval: tuple[float, float]
    bound: float
    beyond: bool
    expected: bool = False


@dataclass(frozen=True)
class SensorConsistency:
    """Innovations of a sensor, over the intervals that end at the epochs and over the whole flight.

    Attributes
    ----------
    name : str
    size : int
        Components of a measurement: the NIS that is expected.
    accepted, rejected : ndarray, shape (m,)
        Mean number of updates of a sample since the epoch before.
    nis : Band
        Mean over updates and samples; NaN where there was no update.
    bounds : ndarray, shape (m, 2)
        Where it lies for a consistent filter, over all intervals together; NaN where there was no update.
    nis_whole : float or None
        Mean over the whole flight; none without updates.
    interval_whole, bounds_whole : (float, float)
        Its interval, and where it lies for a consistent filter whose innovations are white.
    beyond : bool
        Whether the mean over the whole flight is beyond these bounds; where they do not apply, because sources are not
        normal or the filter considers errors, whether the interval leaves out the size.
    whiteness : Whiteness
    finding : Finding
        On the root of NIS / size over the whole flight.
    """

    name: str
    size: int
    accepted: Array
    rejected: Array
    nis: Band
    bounds: Array
    nis_whole: float | None
    interval_whole: tuple[float, float]
    bounds_whole: tuple[float, float]
    beyond: bool
    whiteness: Whiteness
    finding: Finding

    @property
    def updates(self) -> tuple[float, float]:
        """Mean number of updates accepted and rejected in a sample's flight."""
        return float(np.sum(self.accepted)), float(np.sum(self.rejected))


@dataclass(frozen=True)
class NeglectedError:
    """Share of one cause in the difference of true mean square and filter variance of an output at an epoch.

    Attributes
    ----------
    name : str
        Of the source or process; ``mean_of_`` and the name where its mean contributes more than its dispersion.
    true, believed : float
        Mean square that it contributes by linear analysis, and what the filter believes of it; SI.
    share : float
        Their difference, over the sum of all differences.
    """

    name: str
    true: float
    believed: float
    share: float


@dataclass(frozen=True)
class CertainDeparture:
    """A certain departure of a group's, or an output's, ratio of true to filter sigma from the tolerance.

    Attributes
    ----------
    verdict : Honesty
        Optimistic or pessimistic.
    name : str
        Of the group, or of the output.
    size : int
        States of the group; zero of an output.
    factor : float
        The ratio at its worst epoch; of a group it is the root of the mean NEES over the number of states.
    interval : (float, float)
        Of the factor; it holds together with those of all groups, outputs and epochs that decide.
    begin, end, worst : float
        Times.
    """

    verdict: Honesty
    name: str
    size: int
    factor: float
    interval: tuple[float, float]
    begin: float
    end: float
    worst: float


@dataclass(frozen=True)
class FilterConsistency:
    """Consistency of the filter of a campaign.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
    samples : int
        Samples that did not fail.
    confidence, tolerance : float
        Of the verdict.
    groups : tuple of GroupConsistency
    outputs, states : tuple of SigmaConsistency
        Outputs of the scenario, and other states of the filter.
    sensors : tuple of SensorConsistency
    verdict : Honesty
        On the groups of navigation errors and on every output.
    group : str
        The group that decides, empty when none does, or when an output does.
    factor : float or None
        Ratio of this group, or of the output, at the worst epoch.
    interval : (float, float) or None
        Of the factor; see `Finding`.
    begin, end : float or None
        First and last time of a certain departure.
    worst : float or None
        Time of the worst epoch.
    output : str
        The output that departs the most where one certainly does; else that of the group with the farthest ratio at
        the worst epoch, empty when none.
    neglected : tuple of NeglectedError
        What makes an optimistic filter optimistic, the largest share first; empty where it is not known.
    neglected_at : float or None
        Time at which the sigma of an output of the group departs the most by linear analysis: the shares are those
        there.
    neglected_output : str
        That output, empty when none.
    samples_needed : int or None
        Approximate number of samples that would decide an undecided case.
    remarks : tuple of str
        What else there is to say, a sentence each.
    covariance : ndarray, shape (outputs, outputs), or None
        Mean covariance that the samples' filters state at the end, after the last update; SI.
    on_groups, on_outputs : Honesty
        Verdict on the groups of navigation errors by themselves, and on the outputs by themselves.
    departures : tuple of CertainDeparture
        The largest ones: the optimistic ones first, and of each direction that of a group before that of an output.
    doubt : str
        Why the filter is not called consistent although all ratios are within the tolerance.
    overlooked : str
        Output of whose error the filter states no variance where there is one: it is optimistic by any factor. Empty
        when none.
    subject : str
        The filter, or the smoother behind it.
    """

    label: str
    times: Array
    samples: int
    confidence: float
    tolerance: float
    groups: tuple[GroupConsistency, ...]
    outputs: tuple[SigmaConsistency, ...]
    states: tuple[SigmaConsistency, ...]
    sensors: tuple[SensorConsistency, ...]
    verdict: Honesty
    group: str = ""
    factor: float | None = None
    interval: tuple[float, float] | None = None
    begin: float | None = None
    end: float | None = None
    worst: float | None = None
    output: str = ""
    neglected: tuple[NeglectedError, ...] = ()
    neglected_at: float | None = None
    neglected_output: str = ""
    samples_needed: int | None = None
    remarks: tuple[str, ...] = ()
    covariance: Array | None = None
    on_groups: Honesty = Honesty.UNDECIDED
    on_outputs: Honesty = Honesty.UNDECIDED
    departures: tuple[CertainDeparture, ...] = ()
    doubt: str = ""
    overlooked: str = ""
    subject: str = "filter"

    @property
    def departing_output(self) -> CertainDeparture | None:
        """Return the largest certain departure of an output in the direction of the verdict."""
        return next(
            (departure for departure in self.departures if departure.verdict == self.verdict and not departure.size),
            None,
        )
