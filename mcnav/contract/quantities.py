"""Quantities of a system: errors going in and errors coming out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Of = Literal["navigation", "truth", "control", "time"]
"""What a quantity is of: navigation error, dispersion of the truth, control effort, or time of an event."""


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
    later : bool
        Whether the scenario had other sources before this one: see `mcnav.sampling.error_model.ErrorModel`.
    group : str
        Sources that belong together; an entry of ``[errors]`` with this name holds for each.
    of : str
        What it is of; see `Of`.
    """

    name: str
    unit: str
    shown_in: str
    nominal: float
    later: bool = False
    group: str = ""
    of: Of = "navigation"


@dataclass(frozen=True)
class Output:
    """An error that comes out; name and units as those of `Source`.

    Attributes
    ----------
    limit : float, optional
        Size of the error, SI, beyond which the linear system that it belongs to has lost its meaning.
    of : str
        What it is of; see `Of`. A filter states the covariance of navigation errors alone.
    size_of : tuple of str
        Outputs in its unit whose root sum of squares it is: it is not normal, and not linear where they are zero.
    """

    name: str
    unit: str
    shown_in: str
    limit: float | None = None
    of: Of = "navigation"
    size_of: tuple[str, ...] = ()


def source_labels(sources: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Name error sources for people.

    A source that shares its name with an output is an initial error of it; it is called so, to tell them apart.

    Parameters
    ----------
    sources, outputs : sequence of str
        Names, as files have them.

    >>> source_labels(["altitude", "gyro_drift"], ["altitude", "range"])
    ['initial altitude', 'gyro drift']
    """
    taken = {*sources, *outputs}

    def label(name: str) -> str:
        if name not in outputs:
            return name
        return f"initial_{name}" if f"initial_{name}" not in taken else f"{name}_(error source)"

    return [label(name).replace("_", " ") for name in sources]
