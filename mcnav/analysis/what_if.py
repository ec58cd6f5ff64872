"""Linear covariance with some numbers of a data sheet multiplied: a sum over the numbers and their pairs.

Each source, and each process of noise, is sized by one number n, or by none (number -1). With the numbers multiplied by
factors k_n and what a filter believes, so that its gains, held as they are, mean and covariance of the errors are ::

    m(t) = nominal(t) + sum k_n m_n(t)            C(t) = sum k_n^2 C_nn(t) + sum_{n < q} k_n k_q C_nq(t)

with ``C_nn = P_n S_nn P_n^T + sum Q_j`` over the sources and processes of n, and of correlated sources that different
numbers size ``C_nq = P_n S_nq P_q^T + P_q S_qn P_n^T``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mcnav.analysis.changeable_campaign import ChangeableCampaign
from mcnav.analysis.requirements import Requirement
from mcnav.analysis.sized_outputs import Named, components_of
from mcnav.arrays.types import Array, IndexArray

FIXED: Final = -1
"""Number of what no number of the data sheet sizes."""

Entries = tuple[tuple[int, int], ...]
"""Places of a covariance matrix that are known: pairs of outputs, the first not after the second."""


@dataclass(frozen=True)
class Term:
    """Part of the covariance that is multiplied by the factors of two numbers, or of one twice; SI.

    Attributes
    ----------
    first, second : int
        Numbers from zero, or `FIXED`.
    values : ndarray, shape (r, entries)
    """

    first: int
    second: int
    values: Array


@dataclass(frozen=True)
class ScaledCovariance:
    """Mean and covariance of errors at r readings as functions of the factors of the numbers.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the unit of the label; NaN for an end whose time is not told.
    label : str
        What the times are, as ``name [unit]``.
    entries : tuple of (int, int)
    nominal : ndarray, shape (r, outputs)
    terms : tuple of Term
    means : mapping of int to ndarray, shape (r, outputs)
        Part of the mean that is multiplied by the factor of a number, or `FIXED`.
    own : ndarray, shape (r, outputs), optional
        Sigmas that the filter states; NaN of what it does not know.
    """

    times: Array
    label: str
    entries: Entries
    nominal: Array
    terms: tuple[Term, ...]
    means: Mapping[int, Array]
    own: Array | None = None

    @property
    def crossed(self) -> bool:
        """Return whether different numbers size correlated errors, whose terms may cancel others."""
        return any(term.first != term.second for term in self.terms)

    def covariance(self, factors: Sequence[float]) -> Array:
        """Compute the known places of the covariance with the numbers multiplied, shape (r, entries)."""
        by_number = [*factors, 1.0]  # the last one is that of FIXED
        parts = (by_number[term.first] * by_number[term.second] * term.values for term in self.terms)
        return np.asarray(sum(parts, np.zeros((len(self.times), len(self.entries)))))

    def mean(self, factors: Sequence[float]) -> Array:
        """Compute the mean errors with the numbers multiplied, shape (r, outputs)."""
        by_number = [*factors, 1.0]
        return np.asarray(sum((by_number[number] * mean for number, mean in self.means.items()), self.nominal))

    def sigma(self, factors: Sequence[float]) -> Array:
        """Compute the sigmas with the numbers multiplied, shape (r, outputs)."""
        diagonal = [self.entries.index((i, i)) for i in range(self.nominal.shape[1])]
        return np.asarray(np.sqrt(np.maximum(self.covariance(factors)[:, diagonal], 0.0)))

    def at(self, readings: IndexArray) -> ScaledCovariance:
        """Return the same at some of the readings."""
        return replace(
            self,
            times=self.times[readings],
            nominal=self.nominal[readings],
            terms=tuple(replace(term, values=term.values[readings]) for term in self.terms),
            means={number: mean[readings] for number, mean in self.means.items()},
            own=None if self.own is None else self.own[readings],
        )


@dataclass(frozen=True)
class SizedSystem:
    """A linear system at r readings, with the number that sizes each of its causes.

    Attributes
    ----------
    partials : ndarray, shape (r, outputs, sources)
    nominal : ndarray, shape (r, outputs)
    processes : mapping of str to ndarray, shape (r, entries)
        What each process of noise has added to the places of the covariance.
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Of the sources.
    source_numbers : ndarray of int, shape (sources,)
    process_numbers : mapping of str to int
    """

    partials: Array
    nominal: Array
    processes: Mapping[str, Array]
    mean: Array
    covariance: Array
    source_numbers: IndexArray
    process_numbers: Mapping[str, int]


def entries_of(outputs: int, together: Sequence[Sequence[int]]) -> Entries:
    """Return the places of variances, and of covariances between outputs that requirements limit together.

    >>> entries_of(3, [(2, 0)])
    ((0, 0), (1, 1), (2, 2), (0, 2))
    """
    pairs = {(min(i, j), max(i, j)) for group in together for i in group for j in group if i != j}
    return (*((i, i) for i in range(outputs)), *sorted(pairs))


def pairs_over_time(outputs: Sequence[Named], requirements: Sequence[Requirement]) -> Entries:
    """Return the pairs of outputs that requirements over time limit together; the size of some stands for them."""
    sizes, groups = components_of(outputs), list[Sequence[int]]()
    for requirement in requirements:
        if requirement.epochs and not requirement.of:
            alone = len(requirement.outputs) == 1
            groups.append(sizes.get(requirement.outputs[0], requirement.outputs) if alone else requirement.outputs)
    return entries_of(len(outputs), groups)[len(outputs) :]


def picked_entries(covariance: Array, entries: Entries) -> Array:
    """Return the entries of covariances of shape (..., outputs, outputs), shape (..., entries)."""
    rows, columns = np.array(entries).T
    return np.asarray(covariance[..., rows, columns])


def scaled_covariance(system: SizedSystem, times: Array, label: str, entries: Entries,
                      own: Array | None = None) -> ScaledCovariance:  # fmt: skip
    """Split mean and covariance of a linear system over the numbers that size its causes."""
    members = {
        int(number): np.flatnonzero(system.source_numbers == number) for number in np.unique(system.source_numbers)
    }
    known: dict[tuple[int, int], Array] = {}
    for first, second in _sharing(system.covariance, system.source_numbers):
        ours, theirs = members[first], members[second]
        block = system.covariance[np.ix_(ours, theirs)]
        part = system.partials[:, :, ours] @ block @ system.partials[:, :, theirs].swapaxes(1, 2)
        whole = part if first == second else part + part.swapaxes(1, 2)
        known[first, second] = picked_entries(whole, entries)
    for name, added in system.processes.items():
        number = system.process_numbers[name]
        known[number, number] = known[number, number] + added if (number, number) in known else added
    means = {
        number: system.partials[:, :, ours] @ system.mean[ours]
        for number, ours in members.items()
        if system.mean[ours].any()
    }
    terms = tuple(Term(*pair, values) for pair, values in sorted(known.items()) if values.any())
    return ScaledCovariance(times, label, entries, system.nominal, terms, means, own)


def _sharing(covariance: Array, cells: IndexArray) -> list[tuple[int, int]]:
    """Return the pairs of cells, the first not above the second, whose sources have a covariance; few of all pairs."""
    rows, columns = np.nonzero(covariance)
    pairs = set(zip(cells[rows].tolist(), cells[columns].tolist(), strict=True))
    return sorted(pair for pair in pairs if pair[0] <= pair[1])


@dataclass(frozen=True)
class GroupTerm:
    """Part of a variance that a group of causes contributes, and the factors of two numbers multiply.

    Attributes
    ----------
    group : int
        From zero, or `FIXED` of what correlates two groups.
    first, second : int
        Numbers from zero, or `FIXED`.
    values : ndarray, shape (r,)
    """

    group: int
    first: int
    second: int
    values: Array


def grouped_terms(system: SizedSystem, groups: Sequence[Sequence[int]]) -> list[GroupTerm]:
    """Split the sum of the variances of all outputs by group of causes and by number.

    With ``g`` the group of a cause, the terms are ``tr P_gn S_gn,gq P_gq^T + sum Q_j``, and for causes of two groups
    that are correlated twice ``tr P_gn S_gn,hq P_hq^T``.

    Parameters
    ----------
    system : SizedSystem
        Its processes by output, shape (r, outputs).
    groups : sequence of sequence of int
        Causes, sources before processes, in the order of the system.
    """
    count, group_of = len(system.covariance), {cause: g for g, members in enumerate(groups) for cause in members}
    cells: dict[tuple[int, int], list[int]] = {}
    for source in range(count):
        if source in group_of:
            cells.setdefault((group_of[source], int(system.source_numbers[source])), []).append(source)
    known: dict[tuple[int, int, int], Array] = {}

    def add(key: tuple[int, int, int], values: Array) -> None:
        known[key] = known[key] + values if key in known else values

    listed, cell_of = list(cells.items()), np.full(count, FIXED)
    for place, members in enumerate(cells.values()):
        cell_of[members] = place
    for first, last in _sharing(system.covariance, cell_of):
        if first >= 0:
            ((group, number), ours), ((other, second), theirs) = listed[first], listed[last]
            block = system.covariance[np.ix_(ours, theirs)]
            part = np.einsum("tij,jk,tik->t", system.partials[:, :, ours], block, system.partials[:, :, theirs])
            key = group if group == other else FIXED, min(number, second), max(number, second)
            add(key, part if first == last else 2.0 * part)
    for place, (name, added) in enumerate(system.processes.items(), count):
        if place in group_of:
            number = system.process_numbers[name]
            add((group_of[place], number, number), added.sum(axis=1))
    return [GroupTerm(*key, values) for key, values in known.items() if values.any()]


@dataclass(frozen=True)
class LimitedErrors:
    """Errors that a requirement limits: outputs, or those whose size one output is, at some readings.

    ``origin``, shape (readings, members), is what it counts besides: the nominal of states of the truth.
    """

    requirement: Requirement
    members: tuple[int, ...]
    readings: tuple[int, ...]
    origin: Array


@dataclass(frozen=True)
class WhatIf:
    """Linear covariance of a campaign as a function of the numbers of its data sheet.

    Attributes
    ----------
    campaign : ChangeableCampaign
    covariance : ScaledCovariance
        The last reading is the end.
    requirements : tuple of LimitedErrors
        In the order of the campaign, without those that need samples.
    unsized : tuple of str
        Causes that no number sizes.
    beside : str
        Where the file with changed numbers is to be saved, as the end of a sentence.
    estimable : tuple of str
        Kinds of errors that the campaign's filter does not model, and could.
    scales : tuple of float
        By requirement, what linear errors are multiplied by for linear analysis to state the bound of a run
        (`mcnav.analysis.simulated_requirements`), NaN where it bounds nothing; empty without a run.
    bands : mapping of str to (float, float)
        By the path of a number that is a range, the factors that lead to its ends.
    gates : str
        What gates do by rejecting good measurements, in words, where linear analysis does not hold for that; then no
        requirement is judged.
    bends : tuple of Term
        What two numbers add to the variances of the outputs at the end to second order, shape (outputs,): multiplied by
        the *squares* of their factors. Empty where flights have not shown it.
    departure : float
        Of a sigma ratio from one, from which linear analysis is not said to hold.
    """

    campaign: ChangeableCampaign
    covariance: ScaledCovariance
    requirements: tuple[LimitedErrors, ...]
    unsized: tuple[str, ...]
    beside: str
    estimable: tuple[str, ...] = ()
    scales: tuple[float, ...] = ()
    gates: str = ""
    bands: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    bends: tuple[Term, ...] = ()
    departure: float = 0.0

    @property
    def known_scales(self) -> tuple[float, ...]:
        """Scales of the requirements; one where none is known."""
        scales = self.scales or (1.0,) * len(self.requirements)
        return tuple(scale if scale > 0.0 else 1.0 for scale in scales)
