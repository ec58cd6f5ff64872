"""Properties that outputs declare: of which others they are the size, and up to where linear analysis holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Named(Protocol):
    """An output with its name, and the names of those whose size it is."""

    @property
    def name(self) -> str:
        """Name."""

    @property
    def size_of(self) -> tuple[str, ...]:
        """Outputs whose root sum of squares it is."""


class LimitedOutput(Named, Protocol):
    """An output with the size on which its system changes; none without one."""

    @property
    def limit(self) -> float | None:
        """See `mcnav.contract.quantities.Output`."""


def components_of(outputs: Sequence[Named]) -> dict[int, tuple[int, ...]]:
    """Return the numbers of the outputs that are sizes, each with those of its components."""
    numbers = {output.name: number for number, output in enumerate(outputs)}
    return {
        number: tuple(numbers[name] for name in output.size_of)
        for number, output in enumerate(outputs)
        if output.size_of
    }
