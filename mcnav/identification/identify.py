"""Identification of an instrument's noise from equally spaced static readings of one axis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Estimate
from mcnav.identification.fit import AxisFit, fit
from mcnav.identification.goodness import Goodness, check_fit
from mcnav.identification.spectrum import Record, transform

if TYPE_CHECKING:
    import pandas as pd

BANDWIDTH: Final = ("line", "shape")
"""Tests of fit of the spectrum, which its lower part alone may pass."""

FEWEST: Final = 1_000
"""Readings of the shortest record that is accepted."""

FEWEST_ORDINATES: Final = 250
"""Ordinates of the spectrum that a model is fitted to."""


@dataclass(frozen=True, repr=False)
class IdentifiedNoise:
    """Noise of one axis, from a static record.

    Attributes
    ----------
    mean : float
        Of the readings: the bias of this turn-on, with what is measured at rest.
    duration : float
        Of the record, s.
    estimates : tuple of Estimate
        Parameters of the model that was chosen, with 95 % intervals, in the units of `mcnav.identification.processes`.
    margin : float
        By how much the criterion of the next model is larger; below 4 the choice means little.
    goodness : Goodness
        Test of fit of that model.
    of_all : Goodness, optional
        Test of fit of the best model of the whole spectrum, where only the lower frequencies have one.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> noise = mc.identify(1e-4 * np.random.default_rng(1).standard_normal(36_000), 0.1)
    >>> noise.frame["identified"].to_dict()
    {'random_walk': True}
    """

    fitted: AxisFit
    goodness: Goodness
    of_all: Goodness | None = None

    @property
    def below(self) -> float:
        """Upper end of the frequencies that the model was fitted to, Hz."""
        return self.fitted.record.below

    @property
    def part(self) -> bool:
        """True if the model was fitted to the lower frequencies alone."""
        return len(self.fitted.record.ordinates) < self.fitted.record.count - 1

    @property
    def mean(self) -> float:
        """Mean of the readings."""
        return self.fitted.record.mean

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.fitted.record.duration

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters of the chosen model."""
        return self.fitted.estimates

    @property
    def margin(self) -> float:
        """By how much the criterion of the next model is larger."""
        return self.fitted.margin

    @property
    def frame(self) -> pd.DataFrame:
        """The estimates, a row a parameter: ``value`` with ``value_from`` and ``value_to`` at 95 %, ``identified``.

        ``certain`` is false where a model without the parameter's process fits the record nearly as well. SI units,
        listed in `mcnav.identification.processes`. An end that the record does not show is zero or infinite.
        """
        import pandas as pd

        rows = [
            {"parameter": estimate.name, "value": estimate.value, "value_from": estimate.low,
             "value_to": estimate.high, "identified": estimate.identified, "certain": estimate.certain}
            for estimate in self.estimates
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("parameter")

    def __str__(self) -> str:
        """Tabulate the estimates, and say whether the model fits."""
        lines = [_line(estimate) for estimate in self.estimates]
        worst = self.goodness.worst
        fits = "the model fits" if not self.goodness.rejected else f"the model does not fit: {worst}"
        lines.append(f"{fits} (p = {self.goodness.p:.2g}); margin over the next model {self.margin:.3g}")
        if self.fitted.rivals:
            lines.append(f"the record cannot tell {' or '.join(self.fitted.ambiguities)}")
        return "\n".join([*lines, *([self.limits] if self.part else [])])

    __repr__ = __str__

    @property
    def limits(self) -> str:
        """Frequencies that the model was fitted to, in words, where they are not all."""
        if not self.part:
            return ""
        why = "" if self.of_all is None else f"; no model fits the whole spectrum: {self.of_all.worst}"
        return f"fitted below {self.below:.3g} Hz{why}"


def _line(estimate: Estimate) -> str:
    if estimate.identified:
        return f"{estimate.name:18} {estimate.value:.4g}  ({estimate.low:.4g} to {estimate.high:.4g}, 95 %)"
    hours = estimate.duration_wanted / 3600.0
    wanted = f"{hours:.3g} hours would do" if np.isfinite(hours) else "no record would show it"
    below = f"below {estimate.high:.4g}; " if np.isfinite(estimate.high) else ""
    return f"{estimate.name:18} not identifiable from this record: {below}{wanted}"


def identify_noise(readings: ArrayLike, interval: float, below: float | None = None) -> IdentifiedNoise:
    """Estimate white noise, quantization, flicker noise, a rate random walk and a Gauss-Markov process.

    The likelihood is that of the cosine transform of readings at rest (Whittle), exact for white noise and random
    walks; intervals are profiles of it, over all models that fit nearly as well. Quantization and at most two slow
    processes are in the model where the likelihood wants them.

    Parameters
    ----------
    readings : array_like, shape (n,)
        Rates (rad/s) or specific forces (m/s^2) of one axis at rest, each the mean over ``interval``.
    interval : float
        Between readings, s.
    below : float, optional
        Upper end of the frequencies that the model is fitted to, Hz. By default all; where no model has the spectrum of
        all, because instruments filter their readings, a half, a quarter, ... of them: half of the first part whose
        spectrum has a model, or the part that comes nearest to having one.

    Returns
    -------
    IdentifiedNoise

    Raises
    ------
    ValueError
        When there are fewer than 1,000 readings, some are not finite, all are equal, or the interval is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> rates = 1e-4 * np.random.default_rng(1).standard_normal(36_000)
    >>> noise = identify_noise(rates, 0.1)
    >>> [each.name for each in noise.estimates]
    ['random_walk']
    >>> noise.frame.columns.tolist()
    ['value', 'value_from', 'value_to', 'identified', 'certain']
    """
    values = np.asarray(readings, dtype=float)
    if values.ndim != 1 or len(values) < FEWEST:
        raise ValueError(f"expected at least {FEWEST:,} readings of one axis; got an array of shape {values.shape}")
    for name, number in (("interval", interval), ("below", below)):
        if number is not None and not (isinstance(number, (int, float)) and np.isfinite(number) and number > 0.0):
            unit = "s" if name == "interval" else "Hz"
            raise ValueError(f"{name} must be a positive number, {unit}; got {number!r}")
    known = np.isfinite(values)
    if not known.all():
        raise ValueError(f"reading {int(np.argmin(known))} is not finite; fit a stretch without gaps")
    if np.ptp(values) == 0.0:
        raise ValueError(f"all readings are {values[0]:g}: the instrument is stuck, or switched off")
    record = transform(values, interval)
    if below is not None:
        kept = int(2.0 * below * record.duration)
        if kept < FEWEST_ORDINATES:
            raise ValueError(f"below {below:g} Hz the record has {kept} ordinates; {FEWEST_ORDINATES} are needed")
        return _identify(replace(record, ordinates=record.ordinates[:kept]), values, record)
    fits, divisor = [_identify(record, values)], 2
    while fits[-1].goodness.rejected_by(BANDWIDTH) and len(record.ordinates) // divisor >= FEWEST_ORDINATES:
        fits.append(_identify(record.up_to(divisor), values, record))
        divisor *= 2
    if fits[-1].goodness.rejected_by(BANDWIDTH):
        return max(fits, key=lambda noise: noise.goodness.p)
    if len(fits) > 1 and len(record.ordinates) // divisor >= FEWEST_ORDINATES:
        fits.append(_identify(record.up_to(divisor), values, record))  # a filter's share that no test can see biases
    return fits[-1] if len(fits) == 1 else replace(fits[-1], of_all=fits[0].goodness)


def _identify(record: Record, values: Array, whole: Record | None = None) -> IdentifiedNoise:
    """Fit a model to the ordinates of a record, or to the lower ones of a ``whole`` record."""
    fitted = fit(record)
    return IdentifiedNoise(fitted, check_fit(fitted.chosen, record, values, whole))
