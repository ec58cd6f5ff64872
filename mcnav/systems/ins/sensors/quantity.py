"""Definition of a quantity that a sensor measures, and of a type of sensor.

A file of this folder defines a quantity (`QUANTITY`), a type of sensor (`SENSOR`), or both;
`mcnav.systems.ins.sensors.registry` lists the files. What is missing in one is refused when it is imported.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.entries.context import FileContext
from mcnav.physics.units import DIMENSIONS, UnitError, quantity
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, Reference
from mcnav.systems.ins.sensors.innovation import Innovation
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth

LEVEL_AXES: Final = ("north", "east", "down")

BEAMS: Final = ("1", "2", "3")
"""Names of the beams of a sensor."""

OFFSETS: Final[Mapping[str, tuple[tuple[str, ...], str, str, float]]] = {
    "boresight": (AXES, "rad", "mrad", 1e-3),
    "map": (LEVEL_AXES, "m", "m", 1.0),
}
"""Constant errors of what a sensor knows of its own place or of others, besides the lever arm: axes, SI unit, unit
shown, usual size."""

MOST_AXES: Final = 3
"""Each axis has a stream of variates of its own (`mcnav.systems.ins.imu.sample_noise`)."""

GIVEN: Final = {
    "geometry": ("along", "axis"),
    "innovation": ("value", "u", "c", "tables", "errors", "rows", "wanted"),
    "compare": ("at",),
    "select": ("entry", "times", "truth", "key", "context"),
    "limit": ("truth", "times"),
    "arrange": ("entry", "truth", "key", "context"),
}
"""Parameters of the functions of a file. The names of those of an innovation are fixed, of others their number."""


def wrong_parameters(name: str, function: object) -> str:
    """Return what is wrong with the parameters of a function of a file; nothing if they are right.

    >>> wrong_parameters("limit", lambda truth: None)
    'limit must have the parameters (truth, times), and has (truth)'
    """
    if not callable(function):
        return f"{name} must be a function"
    signature, wanted = inspect.signature(function), GIVEN[name]
    given = tuple(signature.parameters)
    with suppress(TypeError):
        signature.bind(*wanted)
        if name != "innovation" or given == wanted:
            return ""
    return f"{name} must have the parameters ({', '.join(wanted)}), and has ({', '.join(given)})"


@dataclass(frozen=True)
class Geometry:
    """A component along the truth, at u instants, in inertial axes.

    Attributes
    ----------
    direction : ndarray, shape (u, 3)
        The direction d.
    psi, v, x : ndarray, shape (u, 3), optional
        Responses of the innovation to the errors of a navigator whose attitude is the truth; none for zero.
    parameters : ndarray, shape (u, P), optional
        Whatever else the quantity's innovation needs.
    lever_arm : ndarray, shape (u, 3), optional
        Responses of the innovation to errors of the lever arm.
    true : ndarray, shape (u,), optional
        The true value, of a quantity that may have a scale factor.
    flexure : ndarray, shape (u, 6), optional
        Responses of the measured value to the angles of a flexure about the body's axes, and to their rates, of a
        quantity that a sensor with flexure may measure (`mcnav.systems.ins.sensors.flexure`).
    offsets : mapping of str to ndarray, shape (u, 3), optional
        Responses of the innovation to errors of `OFFSETS`, by their names.
    offset_axes : ndarray, shape (u, 3, 3), optional
        The axes of these errors, by columns.
    """

    direction: Array
    psi: Array | None = None
    v: Array | None = None
    x: Array | None = None
    parameters: Array | None = None
    lever_arm: Array | None = None
    true: Array | None = None
    flexure: Array | None = None
    offsets: Mapping[str, Array] = field(default_factory=dict)
    offset_axes: Array | None = None

    @property
    def row(self) -> Array:
        """Responses to psi, v and x, shape (u, 9)."""
        nothing = np.zeros_like(self.direction)
        return np.concatenate([nothing if each is None else each for each in (self.psi, self.v, self.x)], axis=1)


@dataclass(frozen=True)
class QuantityDefinition:
    """A quantity that sensors measure: its words, its units, and its equations in each of three computations.

    An innovation is what the navigator predicts less what is measured. The functions leave out the measurement's own
    errors: bias, scale factor, correlated error and noise are the same of all quantities.

    Attributes
    ----------
    name : str
        Small letters and _.
    axes : tuple of str
        Names of the components; ``("",)`` of a scalar.
    unit, shown_in : str
        SI unit, and unit shown.
    usual : float
        Usual size of an error, SI.
    geometry : callable
        ``geometry(surroundings, axis)``: a component along the truth, for linear analysis and filters, and for the
        tables of the ensemble.
    innovation : callable
        Kernel of the ensemble, an `allocation_free_part`: ``innovation(value, u, c, tables, errors, rows, wanted)``
        returns the value with the innovation of component c of update u added. If wanted, it writes the responses about
        each sample's own attitude to ``rows[c]``, which are zero before (`store_three`). Of a sensor with errors of
        `OFFSETS` it takes ``errors.offset``, of which the first order is subtracted afterwards, and if wanted it writes
        the responses to them (`store_response`).
    compare : callable
        ``compare(comparison)``: the difference of a navigator of the reference engine and the truth, along all axes.
    scaled : bool
        Whether its measurements may have a scale factor.
    swings : bool
        Whether it depends on the rate of the body where the sensor has a lever arm; its response to an error e of the
        rate is ``d . (e x L)``.
    fixed_row : bool
        Whether its responses do not depend on the attitude where all its parameters are zero: filters then take those
        along the truth.
    by_beam : bool
        Whether its axes are the beams of the sensor, of which there may be fewer.
    reference : str
        Axes against which it is measured, whose turn is part of its change (`mcnav.systems.ins.sensors.delay`).
    of_instruments : bool
        Whether it is measured along the instruments' axes, and not along the body's.
    """

    name: str
    axes: tuple[str, ...]
    unit: str
    shown_in: str
    usual: float
    geometry: Callable[[Surroundings, int], Geometry]
    innovation: Innovation
    compare: Callable[[Comparison], Difference]
    scaled: bool = False
    swings: bool = False
    fixed_row: bool = False
    by_beam: bool = False
    reference: Reference = "earth"
    of_instruments: bool = False

    def __post_init__(self) -> None:
        wrong: str | None = None
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            wrong = "name must be of small letters, digits and _"
        elif not 1 <= len(self.axes) <= MOST_AXES or len(set(self.axes)) < len(self.axes):
            wrong = f'axes must be one to {MOST_AXES} different names, ("",) for a scalar'
        elif not self.usual > 0.0:
            wrong = "usual must be the size of an error above zero"
        elif not hasattr(self.innovation, "py_func"):
            wrong = "innovation must be compiled: decorate it with allocation_free_part"
        elif self.unit not in DIMENSIONS:
            wrong = f"unit {self.unit!r} is not among DIMENSIONS in mcnav/physics/units.py and units.txt beside it"
        else:
            functions = {"geometry": self.geometry, "innovation": self.innovation.py_func, "compare": self.compare}
            wrong = next(filter(None, (wrong_parameters(*each) for each in functions.items())), None)
        if wrong:
            raise ValueError(f"quantity {self.name!r}: {wrong}")
        try:
            quantity(f"1 {self.shown_in}", self.unit)
        except UnitError as problem:
            raise ValueError(f"quantity {self.name!r}: shown_in {self.shown_in!r}: {problem}") from None


@dataclass(frozen=True)
class FurtherKey:
    """A key of a type of sensor besides those of errors: of a length or other size, of some words, or of a form."""

    meaning: str
    unit: str = ""
    choices: tuple[str, ...] = ()
    form: Any = None


def any_motion(truth: Truth, times: Array) -> str | None:
    """Allow the vehicle any motion."""
    return None


Selection: TypeAlias = Callable[[Mapping[str, Any], Array, Truth, str, FileContext], Array]
Arrangement: TypeAlias = Callable[[Mapping[str, Any], Truth, str, FileContext], Array]


@dataclass(frozen=True)
class SensorType:
    """A type of sensor.

    Attributes
    ----------
    name : str
        The ``type`` of ``[[aiding]]``.
    words : str
        What it measures: a sentence.
    quantities : mapping of str to str
        Quantity that it measures, by the key of its noise.
    template : str
        Lines of a new campaign between its instants and its gate, with comments.
    interval : float or None
        Between measurements of a new campaign, s; none for instants at rest.
    errors : bool
        Whether it has a bias and a correlated error.
    delays : bool
        Whether its measurements may be late, and jitter.
    references : mapping of str to str
        Axes against which quantities are measured, of those for which they are not the quantity's own, by quantity.
    lever_arm : bool
        Whether it has an antenna away from the unit.
    flexure : bool
        Whether the structure between the unit and the sensor may bend: all that it measures must have a `flexure`.
    estimated : tuple of str
        Errors that the template gives it, constant ones or a flexure, which the filter of a new campaign estimates.
    bounds_attitude : bool
        Whether a filter keeps the attitude by it, whatever the gyros' bias.
    offsets : tuple of str
        Errors of `OFFSETS` that it has; the key of their sigma is such as ``boresight_error``.
    further : mapping of str to FurtherKey
        Keys of its own besides those of errors.
    arrange : callable, optional
        ``arrange(entry, truth, key, context)``: what its quantities know of it by its further keys, such as its beams,
        as an array; of shape (beams, 4) where its axes are beams.
    select : callable, optional
        ``select(entry, times, truth, key, context)``: the instants at which it measures, by its further keys.
    limit : callable
        ``limit(truth, times)``: what is wrong with the vehicle's motion at its instants; none if nothing is.
    """

    name: str
    words: str
    quantities: Mapping[str, str]
    template: str
    interval: float | None
    errors: bool = True
    delays: bool = True
    references: Mapping[str, Reference] = field(default_factory=dict)
    lever_arm: bool = False
    flexure: bool = False
    estimated: tuple[str, ...] = ()
    bounds_attitude: bool = False
    offsets: tuple[str, ...] = ()
    further: Mapping[str, FurtherKey] = field(default_factory=dict)
    arrange: Arrangement | None = None
    select: Selection | None = None
    limit: Callable[[Truth, Array], str | None] = any_motion

    def __post_init__(self) -> None:
        wrong = None
        if not re.fullmatch(r"[a-z][a-z0-9-]*", self.name):
            wrong = "name must be of small letters, digits and -"
        elif not self.quantities:
            wrong = "quantities must name at least one, by the key of its noise"
        elif not self.words.endswith("."):
            wrong = "words must be a sentence that says what it measures"
        elif lacking := [key for key in self.quantities if f"\n{key} = " not in f"\n{self.template}"]:
            wrong = f"template must give {' and '.join(lacking)}"
        elif unknown := [name for name in self.offsets if name not in OFFSETS]:
            wrong = f"offsets has {unknown[0]!r}; known are {', '.join(OFFSETS)}"
        elif self.further and self.select is None:
            wrong = f"select must read {' and '.join(self.further)}"
        else:
            given = {"limit": self.limit, "select": self.select, "arrange": self.arrange}
            functions = (wrong_parameters(name, each) for name, each in given.items() if each is not None)
            wrong = next(filter(None, functions), None)
        if wrong:
            raise ValueError(f"sensor {self.name!r}: {wrong}")

    def key(self, measured: str, error: str) -> str:
        """Return the key of an error of a quantity: its own, after the quantity's where there are several."""
        return f"{measured}_{error}" if len(self.quantities) > 1 else error

    def label(self, name: str, measured: str) -> str:
        """Return the beginning of the names of a sensor's errors."""
        return f"{name}_{measured}" if len(self.quantities) > 1 else name
