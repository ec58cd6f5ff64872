"""A page within a frame of a notebook, where its script runs and its style applies to nothing else."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup


@dataclass(frozen=True)
class FramedPage:
    """An HTML page that Jupyter displays: its title, its text, and the height of its frame in pixels."""

    title: str
    text: str
    height: int = 900

    def _repr_html_(self) -> str:
        frame = Markup('<iframe title="{}" srcdoc="{}" style="width:100%;height:{}px;border:0"></iframe>')
        return str(frame.format(self.title, self.text, self.height))
