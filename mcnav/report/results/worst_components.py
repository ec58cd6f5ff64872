"""A closed loop has dozens of outputs: its vectors stand as their worst component."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

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


def worst_components(content: RunAnalysis) -> list[int]:
    """Return the output of each vector that departs the most, in the order of the vectors; all of what is no loop."""
    names = content.output_names
    if not content.looped:
        return list(range(len(names)))
    away = departures(content)
    chosen: dict[str, str] = {}
    for name in (name for name in names if name in away):
        vector = vector_of(name)
        if vector not in chosen or away[name] > away[chosen[vector]]:
            chosen[vector] = name
    return [names.index(name) for name in chosen.values()]
