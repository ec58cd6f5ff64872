"""A closed loop has dozens of outputs: its vectors stand as their worst component."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

AXES: Final = re.compile(r" (?:north|east|down|x|y|z|roll|pitch|yaw)\b")
"""What a component's name has beside that of its vector."""


def vector_of(name: str) -> str:
    """Return the name of the vector of which an output is a component.

    >>> vector_of("true position north"), vector_of("position, ±1σ"), vector_of("sink rate")
    ('true position', 'position, ±1σ', 'sink rate')
    """
    return AXES.sub("", name)


def departures(content: RunAnalysis) -> dict[str, float]:
    """Return by how much the paired sigma of each output departs from the linear one; nothing of what does not move."""
    ratios = [output.paired.ratio for output in content.comparison.outputs]
    names = content.output_names
    known = {names[i]: ratios[i] for i in content.moving}
    return {name: np.inf if ratio is None else abs(ratio - 1.0) for name, ratio in known.items()}


FOREMOST: Final = 8
"""Outputs of a closed loop that a figure of all outputs shows; its folded table has the others."""


def foremost_outputs(content: RunAnalysis) -> list[int]:
    """Return the outputs that requirements limit and, of other vectors, those that depart the most, `FOREMOST` in all.

    They keep the order of the outputs. Of what is no closed loop they are all outputs.
    """
    places = worst_components(content)
    if not content.looped or len(places) <= FOREMOST:
        return places
    away, names = departures(content), content.output_names
    asked = {name for entry in content.summary.requirements or [] for name in entry.outputs}
    limited = [i for i in content.moving if content.summary.names[i] in asked]
    others = sorted((i for i in places if i not in limited), key=lambda i: -away[names[i]])
    return sorted([*limited, *others][:FOREMOST])


def filter_departures(content: RunAnalysis) -> dict[str, float]:
    """Return the largest logarithm of true over filter sigma of each output over time; empty without a filter."""
    outputs = (
        [] if content.filter is None else [output for output in content.filter.outputs if output.ratio.known.any()]
    )
    return {
        humanize(output.name): float(np.abs(np.log(output.ratio.value[output.ratio.known])).max()) for output in outputs
    }


def worst_components(content: RunAnalysis, departing: Mapping[str, float] | None = None) -> list[int]:
    """Return the output of each vector that departs the most, in the order of the vectors; all of what is no loop.

    ``departing``: by how much each output departs, by default that of `departures`.
    """
    names = content.output_names
    if not content.looped:
        return list(range(len(names)))
    away = departures(content) if departing is None else departing
    return [names.index(name) for name in worst_of_vectors(names, away)]


def worst_of_vectors(names: Sequence[str], away: Mapping[str, float]) -> list[str]:
    """Return the output of each vector that departs the most, of those of which it is known.

    >>> worst_of_vectors(["velocity x", "velocity y", "range"], {"velocity x": 0.1, "velocity y": 0.3, "range": 0.0})
    ['velocity y', 'range']
    """
    chosen: dict[str, str] = {}
    for name in (name for name in names if name in away):
        vector = vector_of(name)
        if vector not in chosen or away[name] > away[chosen[vector]]:
            chosen[vector] = name
    return list(chosen.values())
