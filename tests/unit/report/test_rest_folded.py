"""Figures of dozens of outputs: the worst component of each vector stands first, the rest is folded."""

from __future__ import annotations

from mcnav.report.drawing.figure import THIRD, Figure
from mcnav.report.drawing.marks import Axis, Panel
from mcnav.report.pages.run.folded import with_rest_folded

AWAY = {"position x": 0.1, "position y": 0.4, "velocity x": 0.9, "velocity y": 0.2, "range": 0.0}


def test_the_worst_component_of_each_vector_comes_first() -> None:
    """Sorted by how far each output departs; what does not fit beside them is folded, nothing is lost."""
    panels = [Panel(name, Axis(), Axis(), []) for name in AWAY]
    folded = with_rest_folded(Figure("sigmas", "", "", panels, (), {}, THIRD), AWAY)
    assert [panel.title for panel in folded.panels] == ["velocity x", "position y", "range", "velocity y", "position x"]
    assert folded.folded == 3
