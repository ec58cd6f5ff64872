"""Beliefs of a filter whose covariance bounds the true errors at every setting of a box of campaigns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from mcnav.analysis.box import Box, Setting
from mcnav.analysis.remedies import DOUBTED

ROUNDING: Final = 1e-9
"""Ratio above one that is rounding."""


@dataclass(frozen=True)
class TunedBelief:
    """A belief that is proposed: the key below ``[filter.believes]``, its entry, and why.

    Attributes
    ----------
    path : str
        Such as ``processes.drift``.
    entry : str or mapping
        As a campaign file has it.
    factor : float
        By how much its sigma lies above the upper end of what is true.
    why : str
        A clause.
    """

    path: str
    entry: str | Mapping[str, str]
    factor: float
    why: str


@dataclass(frozen=True)
class Candidate:
    """Beliefs that were tried.

    Attributes
    ----------
    name : str
    beliefs : tuple of TunedBelief
    ratio : float
        Largest true over computed sigma at the settings that were looked at.
    cost : float
        What it costs, in the measure of the tuning.
    """

    name: str
    beliefs: tuple[TunedBelief, ...]
    ratio: float
    cost: float


@dataclass(frozen=True)
class BoundingModel:
    """A Gauss-Markov process whose filter bounds the errors by another one of unknown correlation time.

    Attributes
    ----------
    sigma, initial : float
        Stationary, and at the start.
    correlation_time : float
        s.
    """

    sigma: float
    initial: float
    correlation_time: float


def bounding_model(sigma: float, shortest: float, longest: float) -> BoundingModel:
    """Return the model that bounds a process of at most a sigma, whose correlation time lies between two, s.

    ``sigma^2 longest / shortest``, at the start ``2 sigma^2 / (1 + shortest / longest)``; Langel, Garcia Crespillo and
    Joerger, NAVIGATION 68(2), 2021.
    """
    ratio = longest / shortest
    return BoundingModel(sigma * math.sqrt(ratio), sigma * math.sqrt(2.0 / (1.0 + 1.0 / ratio)), longest)


@dataclass(frozen=True)
class Tuning:
    """A filter for a box.

    Attributes
    ----------
    campaign : str
    measure : str
        What costs are, in words.
    before : float
        Largest true over computed sigma over the box with the filter as it is.
    chosen : Candidate or None
        The cheapest whose ratio is at most one at all settings; none where nothing that was tried bounds the errors.
    candidates : tuple of Candidate
        All that were tried.
    box : Box or None
        The box with the chosen beliefs.
    known : float
        Mean over the outputs of the true sigma at the worst setting, over that of a filter that knows this setting.
    worst : mapping
        The setting at which the chosen filter is closest to being optimistic.
    confirmed : str
        Verdict of samples on the filter there; empty where none was asked for.
    samples : int
    linearity : str
        Whether linear analysis holds with the chosen beliefs, where they are closest to optimistic and at the upper
        ends, by flights; empty where it was not examined.
    unexamined : str
        Why it was not, a clause; empty where it was, or nobody asked.

    Examples
    --------
    >>> import mcnav as mc
    >>> tuning = mc.Tuning("a campaign", "mean filter sigma", 1.2, None, (), None, float("nan"), {})
    >>> tuning.believes, tuning.doubted
    ({}, False)
    """

    campaign: str
    measure: str
    before: float
    chosen: Candidate | None
    candidates: tuple[Candidate, ...]
    box: Box | None
    known: float
    worst: Setting
    confirmed: str = ""
    samples: int = 0
    linearity: str = ""
    unexamined: str = ""

    @property
    def closest(self) -> str:
        """Instant at which the chosen filter is closest to optimistic, such as ``time 12 s``; empty if unknown."""
        if self.box is None or self.box.filter is None:
            return ""
        verdict = self.box.filter.optimistic
        name, _, unit = verdict.label.partition(" [")
        return f"{name} {verdict.largest[1]:.6g} {unit.rstrip(']')}".rstrip()

    @property
    def doubted(self) -> bool:
        """Return whether neither flights nor samples show that the chosen beliefs are right."""
        return self.linearity in DOUBTED and self.confirmed not in ("consistent", "pessimistic")

    @property
    def believes(self) -> Mapping[str, Any]:
        """The table ``[filter.believes]`` to be pasted."""
        table: dict[str, Any] = {}
        for belief in () if self.chosen is None else self.chosen.beliefs:
            *names, key = belief.path.split(".")
            inside = table
            for name in names:
                inside = inside.setdefault(name, {})
            inside[key] = belief.entry
        return table
