"""Data over the time of a flight: epochs, the truth and its diagrams, the origin of start times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from mcnav.arrays.types import Array


@dataclass(frozen=True)
class Panel:
    """One diagram of what was flown.

    Attributes
    ----------
    title : str
    x : str
        Column of the history along the axis.
    y : tuple of str
        Columns drawn; several share an axis.
    legend : tuple of str
        What each of several columns is called; by default its name.
    y_label : str
        Of that axis, as ``name [unit]``; by default the first column's.
    log : bool
        Whether the upward axis is logarithmic.
    from_zero : bool
        Whether the upward axis begins at zero.
    begin : float, optional
        Where in the first column (time) the diagram begins.
    marks : tuple of str
        Events shown as lines, where x is the first column.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.Panel("height", "time [s]", ("height [m]",)).y
    ('height [m]',)
    """

    title: str
    x: str
    y: tuple[str, ...]
    legend: tuple[str, ...] = ()
    y_label: str = ""
    log: bool = False
    from_zero: bool = False
    begin: float | None = None
    marks: tuple[str, ...] = ()


NOMINAL_FLIGHT: Final = "Nominal flight"


@dataclass(frozen=True)
class History:
    """Flight data for figures: named columns over time, and the diagrams that show them.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (n,)
        Keyed ``name [unit]``; all of one length, the first being time.
    events : mapping of str to float
        Named instants, in the unit of the first column.
    panels : tuple of Panel
        None when there is nothing to show.
    outages : mapping of str to tuple of (float, float)
        Begin and end of the intervals in which an aiding sensor is silent, by its name, in the unit of the first
        column.
    title : str
        What the diagrams show.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> time = np.linspace(0.0, 10.0, 11)
    >>> flight = mc.History({"time [s]": time, "height [m]": 5.0 * time}, {"burnout": 6.0})
    >>> list(flight.columns)
    ['time [s]', 'height [m]']
    """

    columns: Mapping[str, Array] = field(default_factory=dict)
    events: Mapping[str, float] = field(default_factory=dict)
    panels: tuple[Panel, ...] = ()
    outages: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    title: str = NOMINAL_FLIGHT


@dataclass(frozen=True)
class Epochs:
    """Instants of the flight at which errors are read out.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
        Rising.
    events : mapping of str to float
        Named instants, in the same unit.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> epochs = mc.Epochs("time [min]", np.linspace(0.0, 10.0, 3))
    >>> epochs.times
    array([ 0.,  5., 10.])
    """

    label: str
    times: Array
    events: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class StartClock:
    """Origin and label of start times.

    Attributes
    ----------
    label : str
        Unit in which they are shown, such as ``min from reentry``.
    event : str
        What happens at time zero, up to which starts are compared; without an event all are.
    aligned : str
        Where reference axes that all starts share are aligned.
    meaning : str
        What a later start is, in sentences, where it has no reference axes to choose.
    compared : str
        Which starts are compared, in a sentence, where the study would say something else.
    weighs : str
        Kind of the outputs that the weighted dispersion counts unless weights are given, as `kind_of` names it; all
        without it.
    instants : bool
        Whether navigation starts at given instants alone.
    """

    label: str
    event: str = ""
    aligned: str = "at the first point of the trajectory"
    meaning: str = ""
    compared: str = ""
    weighs: str = ""
    instants: bool = False
