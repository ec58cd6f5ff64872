"""Measures of accuracy of linear errors: sigmas, and radii of outputs together, at the end or at other times.

A measure is written as the name of an output, for its root mean square error, which is its sigma unless it has a mean
error (`mcnav.analysis.mean_errors`), or as

- ``drms(position_north, position_east)``: root mean square distance from zero, in two or three outputs;
- ``cep``, ``r95`` (two outputs), ``sep`` (three): radius about zero of half or 95 % of normal errors.

Names such as ``position_horizontal`` stand for the DRMS of two outputs. A limit may follow: ``r95(range, cross_range)
< 2 km``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.requirements import (
    Requirement,
    is_rare,
    size_members,
    size_probability,
)
from mcnav.analysis.sized_outputs import components_of
from mcnav.arrays.types import Array
from mcnav.contract.linear import CovarianceReadings
from mcnav.contract.quantities import Of, Output
from mcnav.errors import suggestion
from mcnav.physics.units import UnitError, conversion, quantity
from mcnav.statistics.largest_quantiles import largest_quantiles
from mcnav.statistics.normal_box import normal_box_probability, probability_beyond_box
from mcnav.statistics.normal_size import NormalSize
from mcnav.statistics.refusals import or_withheld

SIGMA, DRMS, BOX = "sigma", "drms", "box"

RADII: Final = {"cep": (0.5, (2,)), "r95": (0.95, (2,)), "sep": (0.5, (3,))}
"""Probability and numbers of outputs of each radius."""

TOGETHER: Final = {
    "position_horizontal": (("position_north", "position_east"), ("range", "cross_range")),
    "velocity_horizontal": (("velocity_north", "velocity_east"), ("range_rate", "cross_range_rate")),
    "position": (("position_north", "position_east", "position_down"),),
    "velocity": (("velocity_north", "velocity_east", "velocity_down"),),
}
"""Names of outputs together, and the outputs: the first of them that a scenario has."""

USUAL: Final = ("position_horizontal", "position_down", "velocity_horizontal", "heading")
"""Measures of a navigation in three dimensions without requirements."""

MOST_USUAL: Final = 6
"""Outputs of other scenarios that are measured without requirements."""

_CALL: Final = re.compile(r"(\w+)\(([^()]*)\)")


class MeasureError(ValueError):
    """A measure that cannot be read; the message states what came and what is expected."""


@dataclass(frozen=True)
class Measure:
    """A measure of accuracy at some readings: the largest of them.

    Attributes
    ----------
    name : str
        Unique in a sweep.
    kind : str
        ``sigma``, ``drms``, ``box``; else a radius or quantile about zero with a probability.
    outputs : tuple of int
    readings : tuple of int
        Numbers of the times; empty for the end, which `at_reading` knows.
    limits : tuple of float
        SI; of a requirement. One, or one for each output of a box, which then has a probability as well.
    unit, shown_in : str
        SI unit of its values, and unit shown.
    requirement : int or None
        Number of the campaign's requirement that it is.
    members : tuple of int
        Outputs whose root sum of squares the only one of its outputs is.
    about : str
        As that of `mcnav.analysis.requirements.Requirement`; sigmas and DRMS are about the nominal.
    of : str
        What the only output of a sigma is of.
    """

    name: str
    kind: str
    outputs: tuple[int, ...]
    unit: str
    shown_in: str
    probability: float = 0.5
    readings: tuple[int, ...] = ()
    limits: tuple[float, ...] = ()
    requirement: int | None = None
    members: tuple[int, ...] = ()
    about: str = ""
    of: Of = "navigation"

    @property
    def bound(self) -> float | None:
        """Value at which it just meets its limit: a probability of a box; none without a limit."""
        if not self.limits:
            return None
        return self.probability if self.kind == BOX else self.limits[0]

    @property
    def falls(self) -> bool:
        """Return whether it falls as errors grow: the probability of a box."""
        return self.kind == BOX

    def at_reading(self, number: int) -> Measure:
        """Return the measure at a reading, unless it has readings of its own."""
        return self if self.readings else replace(self, readings=(number,))

    def value(self, readings: CovarianceReadings) -> float:
        """Compute it for the true errors, SI."""
        return self._value(self._counted(readings), readings.covariance)

    def own_value(self, readings: CovarianceReadings) -> float:
        """Compute it for errors as the filter states them, SI; NaN without a filter, and of a correction's size."""
        if readings.own is None or self.members:
            return float("nan")
        return self._value(np.zeros_like(readings.mean), readings.own)

    def _counted(self, readings: CovarianceReadings) -> Array:
        """Return the means of what is measured: of states of the truth those of their departures, or of themselves."""
        if self.kind == SIGMA and self.of != "navigation":
            nominal = 0.0 if readings.nominal is None else readings.nominal
            return np.asarray(readings.mean - nominal) if self.of == "truth" else np.zeros_like(readings.mean)
        if readings.origin is None or self.about or self.kind in (SIGMA, DRMS):
            return readings.mean
        return np.asarray(readings.mean + readings.origin)

    def beyond(self, readings: CovarianceReadings) -> float:
        """Compute the probability that true errors lie beyond the limits of a requirement, over time the largest.

        NaN where it allows more than `mcnav.analysis.requirements.RARE`, and of other measures.
        """
        if self.requirement is None or not is_rare(self.probability):
            return float("nan")
        picked, limits = np.array(self.members or self.outputs), np.array(self.limits)
        means = self._counted(readings)

        def at(reading: int) -> float:
            mean, covariance = means[reading, picked], readings.covariance[reading][np.ix_(picked, picked)]
            if self.kind == BOX:
                return probability_beyond_box(mean, covariance, limits)
            return NormalSize.of(mean, covariance).beyond(float(limits[0]))

        return or_withheld(lambda: max(map(at, self.readings)))

    def mean_error(self, readings: CovarianceReadings) -> float:
        """Return the mean error of a sigma's output where it is largest, SI; zero of other measures."""
        if self.kind != SIGMA:
            return 0.0
        errors = self._counted(readings)[np.array(self.readings), self.outputs[0]]
        return float(errors[np.argmax(np.abs(errors))])

    def _value(self, means: Array, covariances: Array) -> float:
        at, picked = np.array(self.readings), np.array(self.members or self.outputs)
        mean, covariance = means[np.ix_(at, picked)], covariances[np.ix_(at, picked, picked)]
        if self.kind == SIGMA:
            return float(np.sqrt(max((covariance[:, 0, 0] + mean[:, 0] ** 2).max(), 0.0)))
        if self.kind == DRMS:
            return float(np.sqrt((np.trace(covariance, axis1=1, axis2=2) + (mean**2).sum(axis=1)).max()))
        if self.kind == BOX:
            return or_withheld(normal_box_probability, mean[0], covariance[0], np.array(self.limits))
        return float(largest_quantiles(mean[None], covariance[None], self.probability, np.zeros(1), math.nan)[0][0])


def read_measure(written: str, outputs: Sequence[Output]) -> Measure:
    """Read a measure of final errors.

    Raises `MeasureError` when it names no output or measure, or its limit is no quantity.
    """
    text, less, limit = written.partition("<")
    text = text.strip()
    unlimited = _read_unlimited(text, outputs)
    if not less:
        return unlimited
    try:
        value = quantity(limit.strip(), unlimited.unit)
    except UnitError as wrong:
        raise MeasureError(f"{text}: {wrong}") from None
    if value <= 0.0:
        raise MeasureError(f"{text}: got {limit.strip()!r}; expected a limit above zero")
    return replace(unlimited, limits=(value,), name=f"{text} < {' '.join(limit.split())}")


def _read_unlimited(text: str, outputs: Sequence[Output]) -> Measure:
    names = [output.name for output in outputs]
    if text in names:
        return _of(text, SIGMA, (names.index(text),), outputs)
    together = _together(names)
    if text in together:
        return _of(text, DRMS, together[text], outputs)
    call = _CALL.fullmatch(text)
    kinds = (DRMS, *RADII)
    if call is None or call[1] not in kinds:
        known = [*names, *together]
        hint = suggestion(text, known) if call is None else suggestion(call[1], list(kinds))
        raise MeasureError(f"unknown output or measure {text!r}{hint}, or {', '.join(kinds)} of outputs")
    kind, of = call[1], [piece.strip() for piece in call[2].split(",")]
    if len(of) == 1 and of[0] in together:
        picked = together[of[0]]
    else:
        for name in of:
            if name not in names:
                raise MeasureError(f"{kind}: unknown output {name!r}{suggestion(name, [*names, *together])}")
        picked = tuple(names.index(name) for name in of)
    probability, sizes = RADII.get(kind, (0.5, (2, 3)))
    if len(picked) not in sizes or len(set(picked)) < len(picked):
        wanted = " or ".join(map(str, sizes))
        raise MeasureError(f"{kind}: got {', '.join(of)}; expected {wanted} different outputs")
    if len({outputs[number].unit for number in picked}) > 1:
        raise MeasureError(f"{kind}: {', '.join(of)} have different units")
    return replace(_of(text, kind, picked, outputs), probability=probability)


def _together(names: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Return the names of outputs together that a scenario has, with the numbers of the outputs."""
    result = {}
    for name, choices in TOGETHER.items():
        for choice in choices:
            if name not in names and name not in result and set(choice) <= set(names):
                result[name] = tuple(names.index(each) for each in choice)
    return result


def _of(name: str, kind: str, picked: tuple[int, ...], outputs: Sequence[Output]) -> Measure:
    first = outputs[picked[0]]
    return Measure(name, kind, picked, first.unit, first.shown_in, of=first.of)


def usual_measures(outputs: Sequence[Output]) -> list[Measure]:
    """Return the measures of a scenario without requirements."""
    names = [output.name for output in outputs]
    known = [*names, *_together(names)]
    if all(name in known for name in USUAL):
        return [read_measure(name, outputs) for name in USUAL]
    return [read_measure(name, outputs) for name in names[:MOST_USUAL]]


def requirement_measures(requirements: Sequence[Requirement], outputs: Sequence[Output]) -> list[Measure]:
    """Return the measures that requirements limit, in order; a sigma ratio is none."""
    measures, sizes = list[Measure](), components_of(outputs)
    for number, requirement in enumerate(requirements):
        if requirement.kind == "sigma_ratio":
            continue
        name = _requirement_name(requirement, outputs)
        alike = [other for other in requirements if _requirement_name(other, outputs) == name]
        if len(alike) > 1:
            name = f"{name} below {_limits(requirement, outputs)}"
        if name in [measure.name for measure in measures]:
            name = f"{name} #{number + 1}"
        of = outputs[requirement.outputs[0]]
        unit, shown_in = ("1", "%") if requirement.kind == BOX else (of.unit, of.shown_in)
        members, probability = size_members(requirement.outputs, sizes), size_probability(requirement)
        measure = Measure(
            name,
            requirement.kind,
            requirement.outputs,
            unit,
            shown_in,
            probability,
            requirement.epochs,
            requirement.limits,
            number,
        )
        measures.append(replace(measure, members=members, about=requirement.about))
    return measures


def _requirement_name(requirement: Requirement, outputs: Sequence[Output]) -> str:
    """Return the measure that a requirement limits, in words."""
    names = ", ".join(outputs[place].name for place in requirement.outputs)
    shown = "" if requirement.kind in RADII else f", {size_probability(requirement):g}"
    about = " about nominal" if requirement.about else ""
    return f"{requirement.kind}({names}{shown}){about}" + (f" {requirement.when}" if requirement.when else "")


def _limits(requirement: Requirement, outputs: Sequence[Output]) -> str:
    """Return its limits in the units in which the outputs are shown."""
    shown = []
    for place, limit in zip(requirement.outputs, requirement.limits, strict=False):  # a radius has a limit alone
        of = outputs[place]
        shown.append(f"{limit / conversion(of.shown_in, of.unit):.6g} {of.shown_in}".removesuffix(" 1"))
    return ", ".join(shown)
