"""Answer of linear analysis for a box of campaigns, whose specs are ranges: the worst and the best of its settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mcnav.analysis.linear_filter import LinearVerdict

Setting = Mapping[str, str | int | float]
"""Values of the ranges by path, as a campaign file has them."""


@dataclass(frozen=True)
class Extreme:
    """A value, SI, and the setting that causes it; NaN where linear analysis cannot tell at some setting."""

    value: float
    setting: Setting


@dataclass(frozen=True)
class Spread:
    """The worst and the best value of a measure over a box."""

    worst: Extreme
    best: Extreme


@dataclass(frozen=True)
class Narrowed:
    """Gain from knowing a range better.

    Attributes
    ----------
    path : str
    low, high : str, int or float
        Ends between which its value would be, a factor of two apart or half of the range, as a file has them.
    worst : float
        Worst value then, with the others as in the worst setting, SI.
    gain : float
        Share of the worst value that it lies below it.
    """

    path: str
    low: str | int | float
    high: str | int | float
    worst: float
    gain: float


@dataclass(frozen=True)
class BoxFilter:
    """Consistency of the filter over a box: true over computed sigma, of any output or group at any reading.

    Attributes
    ----------
    ratio : Spread
        The largest ratio, and the smallest.
    optimistic, pessimistic : LinearVerdict
        Verdicts at the settings of these.
    """

    ratio: Spread
    optimistic: LinearVerdict
    pessimistic: LinearVerdict


@dataclass(frozen=True)
class Box:
    """Linear answer for a box of campaigns.

    Attributes
    ----------
    ranges : mapping of str to str
        By path, as written.
    outputs : tuple of Spread
        Of the final sigmas, in the order of the outputs.
    requirements : tuple of Spread
        Of their values, in the order of the campaign.
    filter : BoxFilter or None
    exact : bool
        Whether every measure is monotone in every range, so that corners are the extremes.
    settings, systems : int
        Settings that were answered, and linear systems that were computed for them.
    held : tuple of str
        Paths of ranges of which the filter believes the upper end, because the campaign states nothing else.
    narrowed : tuple of Narrowed
        The ranges, largest effect first.
    about : int or None
        Number of the requirement that `narrowed` is about: the tightest; none where it is about an output.
    output : int
        Number of this output.
    gated : mapping or None
        A setting at which gates reject good measurements so that linear analysis is not shown to hold: then no
        requirement is judged; none without.
    """

    ranges: Mapping[str, str]
    outputs: tuple[Spread, ...]
    requirements: tuple[Spread, ...]
    filter: BoxFilter | None
    exact: bool
    settings: int
    systems: int
    held: tuple[str, ...] = ()
    narrowed: tuple[Narrowed, ...] = ()
    about: int | None = None
    output: int = 0
    gated: Setting | None = None

    @property
    def varies(self) -> bool:
        """Return whether a range has more than one value."""
        return bool(self.outputs[0].worst.setting)

    @property
    def tightest(self) -> Setting:
        """Setting of what `narrowed` is about: the worst of the tightest requirement, or of an output."""
        spread = self.outputs[self.output] if self.about is None else self.requirements[self.about]
        return spread.worst.setting
