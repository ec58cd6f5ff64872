"""Linear model of a campaign's final errors, as samples are compared with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.floor import CLEAR, agreement_floor, cancelled
from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.sized_outputs import LimitedOutput, components_of
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.linear.covariance import propagated_covariance
from mcnav.statistics.normal_size import NormalSize
from mcnav.statistics.whitening import Whitening, whitening


@dataclass(frozen=True)
class Model:
    """Linear model and statistics of the start errors, SI.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
    nominal : ndarray, shape (outputs,)
        Final errors without start errors.
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Mean start errors, and start covariance S.
    processes : mapping of str to ndarray, shape (outputs, outputs)
        Covariance Q_j that each process of noise adds, by name.
    sizes : mapping of int to tuple of int
        Outputs that are the root sum of squares of others.
    scales : ndarray, shape (outputs,), optional
        Sizes on which the system of each output changes, its `Output.limit`; infinite without one.
    limits : ndarray, shape (outputs,), optional
        Smallest limit that requirements set to each output; infinite without one.
    withheld : tuple of int
        Outputs without a verdict, since they depend on a source with heavy tails.
    origin : ndarray, shape (outputs,), optional
        What the outputs are measured from; see `mcnav.contract.linear.LinearSystem`.
    """

    partials: Array
    nominal: Array
    mean: Array
    covariance: Array
    processes: Mapping[str, Array] = field(default_factory=dict)
    sizes: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    scales: Array | None = None
    limits: Array | None = None
    withheld: tuple[int, ...] = ()
    origin: Array | None = None

    @classmethod
    def of(cls, linear: LinearModel, mean: Array, covariance: Array, outputs: Sequence[LimitedOutput]) -> Model:
        """Return the linear model for errors of a mean and covariance, with what its outputs state of themselves."""
        return cls(
            linear.partials, linear.nominal, mean, covariance, linear.processes, components_of(outputs),
            limits_of(output.limit for output in outputs), origin=linear.origin,
        )  # fmt: skip

    @cached_property
    def outcome_mean(self) -> Array:
        """Mean of the final errors by the linear model, shape (outputs,)."""
        return self.nominal + self.partials @ self.mean

    @cached_property
    def outcome_covariance(self) -> Array:
        """P S P^T + sum Q_j, shape (outputs, outputs).

        Zero in the rows and columns of outputs whose sigma is only rounding.
        """
        covariance = propagated_covariance(self.partials, self.covariance)
        covariance = covariance + sum(self.processes.values(), np.zeros_like(covariance))
        return _without(covariance, np.diag(covariance) <= self.rounding**2)

    @cached_property
    def judged_covariance(self) -> Array:
        """The same without the outputs whose sigma is within the floor: that of what is judged together."""
        return _without(self.outcome_covariance, ~self.judged)

    @cached_property
    def whitened(self) -> Whitening:
        """Coordinates in which the covariance of what is judged together is the identity."""
        return whitening(self.judged_covariance)

    @cached_property
    def judged(self) -> NDArray[np.bool_]:
        """Outputs that are judged together: not those hardly dispersed, nor those withheld while others are not.

        An output is hardly dispersed up to `CLEAR` floors.
        """
        variances = np.diag(self.outcome_covariance)
        judged = (variances == 0.0) | (variances > (CLEAR * self.floor) ** 2)
        if len(self.withheld) < len(variances):
            judged[list(self.withheld)] = False
        return np.asarray(judged)

    @cached_property
    def laws_of_sizes(self) -> dict[int, NormalSize]:
        """Exact laws of sizes that have no derivative: those of vectors that are zero on average, by number."""
        covariance, mean, laws = self.outcome_covariance, self.outcome_mean, {}
        for number, members in self.sizes.items():
            chosen = np.array(members)
            part = covariance[np.ix_(chosen, chosen)]
            if covariance[number, number] == 0.0 and part.any():
                laws[number] = NormalSize.of(mean[chosen], part)
        return laws

    @cached_property
    def rounding(self) -> Array:
        """Sigma that rounding alone may leave in each output, shape (outputs,)."""
        return cancelled(self._terms, self.outcome_mean)

    @cached_property
    def floor(self) -> Array:
        """Sigma up to which a difference from each output counts as agreement, shape (outputs,)."""
        return agreement_floor(self._terms, self.outcome_mean, self._fixed, self.scales, self.limits)

    @property
    def _fixed(self) -> Array:
        """Mean error that sources of fixed value leave, shape (outputs,)."""
        known = np.diag(self.covariance) <= 0.0
        return np.asarray(self.partials[:, known] @ self.mean[known])

    @property
    def _terms(self) -> Array:
        return np.abs(self.partials) * np.sqrt(np.diag(self.covariance))


def _without(covariance: Array, outputs: NDArray[np.bool_]) -> Array:
    """Return a covariance with zeros in the rows and columns of some outputs, shape (outputs,)."""
    return np.where(outputs[:, None] | outputs, 0.0, covariance)
