"""Identification of an instrument's noise from equally spaced static readings of one axis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Estimate
from mcnav.identification.fit import AxisFit, fit
from mcnav.identification.goodness import Goodness, check_fit, check_spectrum
from mcnav.identification.handling import Hold, filters_show, find_hold, half_power
from mcnav.identification.spectrum import Record, transform

if TYPE_CHECKING:
    import pandas as pd

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
        Test of the shape of the whole spectrum, and of lines, where only the lower frequencies have a model.
    half_power : float, optional
        Frequency above which readings have less than half the density of the model of the lower ones, Hz.
    hold : Hold, optional
        How readings repeat, where they do; the values of a held one are fitted once.

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
    half_power: float | None = None
    hold: Hold | None = None

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
        return "\n".join([*lines, *([self.limits] if self.limits else [])])

    __repr__ = __str__

    @property
    def limits(self) -> str:
        """State what was done to the readings, and the frequencies of a fit to a part of the band."""
        words = [self.hold.words(self.fitted.record.interval / self.hold.rows)] if self.hold is not None else []
        if self.part:
            words.append(f"fitted below {self.below:.3g} Hz")
        if self.half_power is not None:
            words.append(f"low-passed, with half of the power at {self.half_power:.2g} Hz")
        if self.of_all is not None and self.half_power is None:
            words.append(f"no model fits the whole spectrum: {self.of_all.worst}")
        elif self.of_all is not None and self.of_all.worst.name == "line":
            words.append(str(self.of_all.worst))
        return "; ".join(words)


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
    hold = find_hold(values)
    if hold is not None:
        interval, values = interval * len(values) / len(hold.readings), hold.readings
        if len(values) < FEWEST:
            raise ValueError(f"{hold.words(interval / hold.rows)}: {len(values)} readings; {FEWEST:,} are needed")
    record = transform(values, interval)
    if below is not None:
        kept = int(2.0 * below * record.duration)
        if kept < FEWEST_ORDINATES:
            raise ValueError(f"below {below:g} Hz the record has {kept} ordinates; {FEWEST_ORDINATES} are needed")
        part = replace(record, ordinates=record.ordinates[:kept])
        return _tested(fit(part), values, record, None, hold)
    fitted, whole = _fit_lower(record)
    return _tested(fitted, values, record, whole, hold)


def _tested(
    fitted: AxisFit, values: Array, record: Record, of_all: Goodness | None, hold: Hold | None
) -> IdentifiedNoise:
    """Test the fit of a model to a record, or to the lower ordinates of a record."""
    part = len(fitted.record.ordinates) < len(record.ordinates)
    goodness = check_fit(fitted.chosen, fitted.record, values, record if part else None)
    return IdentifiedNoise(fitted, goodness, of_all, half_power(record, fitted.chosen) if part else None, hold)


def _fit_lower(record: Record) -> tuple[AxisFit, Goodness | None]:
    """Fit a model to all ordinates; where none has their spectrum, or a filter's, to the lower half, quarter, ...

    Returns the test of the whole spectrum, too, where only the lower ordinates have a model.
    """
    fits, divisor = [fit(record)], 2
    tests = [check_spectrum(fits[0].chosen, record)]
    while (filtered := _filtered(fits[-1], tests[-1])) and len(record.ordinates) // divisor >= FEWEST_ORDINATES:
        fits.append(fit(record.up_to(divisor)))
        tests.append(check_spectrum(fits[-1].chosen, fits[-1].record))
        divisor *= 2
    if filtered:
        best = int(np.argmax([test.p for test in tests]))
        return fits[best], tests[0] if best else None
    if len(fits) > 1 and len(record.ordinates) // divisor >= FEWEST_ORDINATES:
        fits.append(fit(record.up_to(divisor)))  # a filter's share that no test can see biases
    return fits[-1], tests[0] if len(fits) > 1 else None


def _filtered(fitted: AxisFit, test: Goodness) -> bool:
    """Tell whether a model does not have the spectrum of its ordinates, or has a filter's."""
    return test.rejected or filters_show(fitted.chosen)
