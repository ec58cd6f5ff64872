"""A figure as the report and a notebook know it: panels side by side, a key to them, and the numbers behind them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from mcnav.errors import suggestion
from mcnav.report.drawing.marks import Panel, Series
from mcnav.report.drawing.palette import VARIABLES
from mcnav.report.drawing.svg import svg

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as MplFigure

HALF, THIRD = (422.0, 260.0), (298.0, 250.0)
"""Sizes of a panel, px: two or three side by side on a wide page, and text of one size in both."""

SEVERAL: Final = 4
"""Panels up to which two stand side by side; more are three."""

ROWS: Final = 200
"""Rows of the table behind a figure, at most: what is plotted more densely is thinned there."""


def side_by_side(panels: int, height: float = 0.0) -> tuple[float, float]:
    """Return the size of so many panels, px: few are large; ``height`` is by default that of the size."""
    width, usual = HALF if panels <= SEVERAL else THIRD
    return width, height or usual


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure.

    ``name`` names it on its page; ``title`` and ``description`` are for those who do not see it. ``key`` is empty where
    the panels speak for themselves. ``columns`` are the numbers behind it, of one length, and ``file`` has them in full
    beside the page. ``shows`` says in a sentence what is to be seen, from the numbers drawn; ``number`` is that on its
    page, where figures are counted. ``size`` is that of a panel, px, as wide as `HALF` or `THIRD`. If ``shown`` is not
    zero, the page shows so many panels until the reader chooses others; if ``folded`` is not, it folds those beyond it.
    """

    name: str
    title: str
    description: str
    panels: Sequence[Panel]
    key: Sequence[Series]
    columns: Mapping[str, Sequence[Any] | NDArray[Any]]
    size: tuple[float, float] = HALF
    caption: str = ""
    file: str = ""
    shown: int = 0
    folded: int = 0
    shows: str = ""
    number: int = 0

    @property
    def layout(self) -> str:
        """Class of the style sheet by the number of panels side by side."""
        return "thirds" if self.beside == 3 else "halves"

    @property
    def beside(self) -> int:
        """Number of panels side by side."""
        return 3 if self.size[0] == THIRD[0] else 2

    @property
    def first(self) -> Sequence[Panel]:
        """Panels of a drawing from which the reader cannot choose."""
        return self.panels[: self.shown or self.folded or None]

    @cached_property
    def svgs(self) -> list[Markup]:
        """Every panel as SVG."""
        return [
            svg(panel, *self.size, f"{self.name}-{number}", ": ".join(filter(None, (self.title, panel.title))),
                f"{self.name}-d")
            for number, panel in enumerate(self.panels)
        ]  # fmt: skip

    @property
    def data(self) -> pd.DataFrame:
        """The numbers behind it as a table."""
        import pandas as pd

        return pd.DataFrame(dict(self.columns))

    @property
    def rows(self) -> int:
        """Rows of that table."""
        return len(next(iter(self.columns.values()), ()))

    @property
    def thinned(self) -> bool:
        """Return whether the page's table leaves rows out."""
        return self.rows > ROWS

    @property
    def table(self) -> Markup:
        """The head and body of the page's table, plain enough for any program to read.

        Cells end where the next one begins, as HTML has it: that is a tenth of a large page.
        """
        every = -(-self.rows // ROWS) or 1
        columns = [_plain(np.asarray(values)[::every]) for values in self.columns.values()]
        head = "".join(f'<th scope="col">{escape(name)}' for name in self.columns)
        body = "\n".join(f"<tr><td>{'<td>'.join(row)}</td></tr>" for row in zip(*columns, strict=True))
        return Markup(f"<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody>")

    def of_panels(self, *titles: str) -> Figure:
        """Return a figure of some of the panels, by their titles, in the order given.

        Raises `ValueError` when it has no such panel.
        """
        by_title = {panel.title: panel for panel in self.panels}
        for title in titles:
            if title not in by_title:
                raise ValueError(f"the figure has no panel {title!r:.60}{suggestion(title, list(by_title))}")
        return replace(self, panels=[by_title[title] for title in titles], shown=0)

    def figure(
        self,
        width: float | None = None,
        font_scale: float = 1.0,
        height: float | None = None,
        columns: int | None = None,
    ) -> MplFigure:
        """Draw the first panels as one matplotlib figure with a legend; its ``axes`` are the panels in order.

        ``width`` and ``height`` are those of the whole figure, cm, by default the page's, and in its proportions where
        only the width is given; ``font_scale`` multiplies its size of text; ``columns`` are panels side by side.
        """
        from mcnav.report.drawing.on_axes import drawn

        return drawn(self.first, self.key, self.size, columns or self.beside, width, font_scale, height)

    def save(
        self,
        path: Path,
        width: float | None = None,
        font_scale: float = 1.0,
        height: float | None = None,
        columns: int | None = None,
    ) -> None:
        """Write that matplotlib figure to a file, whose ending says how; the same bytes every time.

        Raises `ValueError` when panels and text of that size have no room in the figure.
        """
        from mcnav.report.drawing.on_axes import save

        save(self.figure(width, font_scale, height, columns), path)

    def _repr_svg_(self) -> str:
        """Shown by Jupyter: the first panels, and colours as such."""
        panels = list(map(str, self.svgs[: len(self.first)]))
        columns = min(self.beside, len(panels))
        width, height = self.size
        across, down = width * columns, height * -(-len(panels) // columns)
        size = f'width="{width:g}" height="{height:g}"'
        placed = "".join(
            panel.replace("<svg ", f'<svg x="{width * (k % columns):g}" y="{height * (k // columns):g}" {size} ', 1)
            for k, panel in enumerate(panels)
        )
        whole = f'<svg xmlns="http://www.w3.org/2000/svg" width="{across:g}" height="{down:g}">{placed}</svg>'
        colours = {name: colour for colour, name in VARIABLES.items()}
        return re.sub(r"var\(--([\w-]+)\)", lambda result: colours[result[1]], whole)


@dataclass(frozen=True, eq=False)
class MovedFigure(Figure):
    """A figure of one instant, which the page's script moves through time by what ``json`` has of all instants."""

    json: str = ""


def _plain(values: NDArray[Any]) -> list[str]:
    return [
        (f"{value:.6g}" if math.isfinite(value) else "") if isinstance(value, float) else str(escape(value))
        for value in values.tolist()
    ]


def bare(figure: Figure) -> Figure:
    """Return a figure for a notebook's card: its first row of panels, two rows where two stand side by side.

    It has none of the numbers behind it, which tables of a notebook have.
    """
    return replace(figure, panels=figure.panels[: 4 if figure.beside == 2 else 3], shown=0, columns={}, file="")
