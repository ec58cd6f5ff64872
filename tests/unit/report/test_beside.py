"""Plots drawn by a copy of the process: the same text, also when the copy dies or hangs."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pandas as pd
import pytest
from matplotlib.axes import Axes

from mcnav.report.figures import beside
from mcnav.report.figures.figure import Figure, Plot

HERE = os.getpid()


def _drawings(then: Callable[[], object] = lambda: None) -> list[Figure]:
    """Two figures; what is to happen in another process than this one happens when a plot is drawn there."""

    def draw(axes: Axes) -> None:
        if os.getpid() != HERE:
            then()
        axes.plot([0.0, 1.0], [1.0, 3.0])

    return [
        Figure(
            f"figure-{k}", "Title", "Description", [Plot("one", draw), Plot("two", draw)][: 2 - k], (), pd.DataFrame()
        )
        for k in range(2)
    ]


@pytest.mark.parametrize("then", [lambda: None, lambda: os._exit(3), lambda: 1 / 0, lambda: time.sleep(60.0)],
                         ids=["well", "dies", "fails", "hangs"])  # fmt: skip
def test_every_plot_is_drawn(monkeypatch: pytest.MonkeyPatch, then: Callable[[], object]) -> None:
    monkeypatch.setattr(beside, "PATIENCE", 1.0)
    drawings = _drawings(then)
    beside.draw(drawings)
    assert ["svgs" in vars(drawing) for drawing in drawings] == [True, True]
    assert [drawing.svgs for drawing in drawings] == [drawing.svgs for drawing in _drawings()]


def test_a_plot_that_cannot_be_drawn_says_so() -> None:
    def draw(axes: Axes) -> None:
        raise ValueError("no such plot")

    with pytest.raises(ValueError, match="no such plot"):
        beside.draw([Figure("key", "Title", "", [Plot("", draw)] * 2, (), pd.DataFrame())])
