"""A campaign file whose numbers can be changed: the numbers, the causes that each sizes, and the file itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.arrays.types import IndexArray

MARK: Final = "\ue000"
"""Character before and after the place of a size in a campaign file to be completed; it is of nobody's alphabet."""


@dataclass(frozen=True)
class Size:
    """A quantity within the entry of a number: its number and unit; of a plain number the unit is none."""

    value: float
    unit: str | None

    @property
    def text(self) -> str:
        """The size as the file has it."""
        return f"{repr(self.value).removesuffix('.0')} {self.unit or ''}".rstrip()


@dataclass(frozen=True)
class Belief:
    """A line below ``[filter.believes]``: the names of its table, its key, and its value as the file has it.

    ``number`` is that of the changed number with which it is needed; none of a line of the campaign's own.
    """

    table: tuple[str, ...]
    key: str
    value: str
    number: int | None


@dataclass(frozen=True)
class Slider:
    """A number of the data sheet that can be changed.

    Attributes
    ----------
    path : str
        Of its key, such as ``imu.gyro.bias``.
    sizes : tuple of Size
        All its sizes, which change in proportion; the place of each in the file is its own.
    shown : int
        Which of them is shown: the largest of those that are sizes, which a location or a limit is not.
    axes : int
        How many there are of these.
    grades : tuple of (str, float)
        The catalogue's grades, the finest first, and the factor that leads to the value of each.
    """

    path: str
    sizes: tuple[Size, ...]
    shown: int
    axes: int
    grades: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class ChangeableCampaign:
    """A campaign whose numbers can be changed, and its file.

    Attributes
    ----------
    sliders : tuple of Slider
    source_numbers : ndarray of int, shape (sources,)
        Which of them sizes a source; `FIXED` for none.
    process_numbers : mapping of str to int
        Which of them sizes a process.
    text : str
        The file without ``[filter.believes]``. The k-th size of number n stands as ``"n.k"`` with a `MARK` at each end.
    beliefs : tuple of Belief
        In the order in which they are written; those of a table follow each other.
    """

    sliders: tuple[Slider, ...]
    source_numbers: IndexArray
    process_numbers: Mapping[str, int]
    text: str
    beliefs: tuple[Belief, ...]

    def written(self, factors: Sequence[float]) -> str:
        """Write the campaign file with the numbers multiplied and the filter as it was."""
        text = self.text
        for number, slider in enumerate(self.sliders):
            for place, size in enumerate(slider.sizes):
                factor = factors[number]
                value = size if factor == 1.0 else Size(float(f"{size.value * factor:.12g}"), size.unit)
                shown = value.text if value.unit is None else f'"{value.text}"'
                text = text.replace(f'"{MARK}{number}.{place}{MARK}"', shown)
        lines, table = [text.rstrip("\n"), ""], None
        for belief in self.beliefs:
            if belief.number is not None and factors[belief.number] == 1.0:
                continue
            if belief.table != table:
                table = belief.table
                lines += ["", f"[{'.'.join(table)}]"]
            lines.append(f"{belief.key} = {belief.value}")
        return "\n".join(lines) + "\n"
