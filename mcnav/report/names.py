"""Names and units of outputs and sources, for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source, source_labels
from mcnav.physics.units import conversion

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary
    from mcnav.store.manifest import Variable


def scale_of(variables: Sequence[Variable | Source | Output]) -> Array:
    """Return what SI values of outputs or sources are multiplied by to be shown."""
    return np.array([conversion(variable.unit, variable.shown_in) for variable in variables])


def labels_of(sources: Sequence[Variable | Source], outputs: Sequence[Variable | Output]) -> list[str]:
    """Return names of the sources for people."""
    return source_labels([source.name for source in sources], [output.name for output in outputs])


def labels_in(summary: Summary) -> list[str]:
    """Return names for people of the sources of a summary."""
    return source_labels([source.name for source in summary.sources], summary.names)


def unit_words(unit: str) -> str:
    """Return a unit as it stands behind a number: nothing of a pure number.

    >>> unit_words("km"), unit_words("1")
    ('km', '')
    """
    return "" if unit == "1" else unit


def shown_units(summary: Summary) -> dict[str, tuple[float, str]]:
    """Return for each output of a summary the factor from SI and the unit shown."""
    return {
        output.name: (conversion(output.unit, shown), unit_words(shown))
        for output, shown in zip(summary.outputs, summary.units_shown, strict=True)
    }


def humanize(name: str) -> str:
    """Replace the underscores of a key by spaces.

    >>> humanize("gyro_drift")
    'gyro drift'
    """
    return name.replace("_", " ")
