"""What every scenario offers to the rest of the program, whatever it flies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """An error that goes in.

    Attributes
    ----------
    name : str
    unit : str
        SI unit of its values.
    shown_in : str
        Unit in which tables and reports show it.
    nominal : float
        A usual size, in the SI unit: the scale of the steps that differences take.
    """

    name: str
    unit: str
    shown_in: str
    nominal: float


@dataclass(frozen=True)
class Output:
    """An error that comes out; attributes as those of `Source`."""

    name: str
    unit: str
    shown_in: str


@dataclass(frozen=True)
class Outcomes:
    """What became of a chunk of samples.

    Attributes
    ----------
    values : ndarray, shape (n, outputs)
        SI; a row that failed is NaN throughout.
    failures : mapping of int to str
        Row of each failed sample, and why.
    handed_over : int
        How many samples left the fast engine's validity and were flown on the reference path instead.
    """

    values: Array
    failures: Mapping[int, str] = field(default_factory=dict)
    handed_over: int = 0


@dataclass(frozen=True)
class LinearModel:
    """Final errors as a linear function of the errors going in: ``nominal + partials @ errors``.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
        SI units: the matrix P of NASA TN D-1772, eq. (13).
    nominal : ndarray, shape (outputs,)
        Final errors of a system without errors.
    """

    partials: Array
    nominal: Array


@dataclass(frozen=True)
class History:
    """What was flown, for figures: named columns over time.

    Attributes
    ----------
    columns : mapping of str to ndarray
        Keyed ``name [unit]``; all of one length, the first being time.
    events : mapping of str to float
        Named instants, in the unit of the first column.
    """

    columns: Mapping[str, Array]
    events: Mapping[str, float]


class Scenario(Protocol):
    """A system whose error propagation is studied."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """Errors going in, in the order of the columns of P."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Errors coming out, in the order of the rows of P."""

    @property
    def engines(self) -> tuple[str, ...]:
        """Names of the ways to fly, the default first."""

    def prepared(self, engine: str, probes: Array) -> Prepared:
        """A flyer for one engine, its accuracy settled on probe samples, shape (n, sources)."""

    def linearised(self) -> LinearModel:
        """Partial derivatives by the scenario's best method."""

    def history(self) -> History:
        """The truth over time."""


@runtime_checkable
class StartTimes(Protocol):
    """A scenario whose navigation may start at any time of its flight."""

    def start_times(self, count: int) -> Array:
        """Evenly spaced start times from the first possible one on, shape (count,), s from the scenario's own event."""

    def partials_at(self, times: Array, axes: str) -> Array:
        """Partial derivatives for navigation started at each time, shape (n, outputs, sources)."""


class Prepared(Protocol):
    """One engine, ready to fly; it is sent to the workers and must survive pickling."""

    @property
    def parallel(self) -> str:
        """``threads`` when propagation runs free of the interpreter lock, else ``processes``."""

    @property
    def chunk(self) -> int:
        """Samples per chunk: part of the engine, never of the number of workers."""

    @property
    def accuracy(self) -> str:
        """What is known of its numerical error, in words for the report."""

    def propagate(self, errors: Array) -> Outcomes:
        """Fly samples, shape (n, sources), SI."""


class ScenarioError(ValueError):
    """A scenario that cannot be flown as described; `key` names the entry that would have to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key
