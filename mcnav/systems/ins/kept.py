"""Results of a navigation that are kept from one command to the next: settled steps, linear errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from mcnav.arrays.types import Array
from mcnav.compiled.kept import keep

if TYPE_CHECKING:
    from mcnav.systems.ins.aided import AidedNavigation
    from mcnav.systems.ins.scenario import Navigation

Tables = TypeVar("Tables")


def keep_of(navigation: Navigation | AidedNavigation, kind: str, further: object, compute: Callable[[], Any]) -> Any:
    """Return a result of a navigation, and of what it depends on besides (`mcnav.compiled.kept.keep`)."""
    own = [getattr(navigation, field.name) for field in fields(navigation)]
    return keep(kind, (type(navigation).__name__, own, further), compute)


def settle(
    navigation: Navigation | AidedNavigation,
    probes: Array,
    search: Callable[[], tuple[int, Tables, float]],
    tabulate: Callable[[int], Tables],
) -> tuple[Tables, float]:
    """Return the tables with the steps that probes allow, and their numerical error.

    Parameters
    ----------
    probes : ndarray, shape (n, sources)
    search : callable
        Finds the number of steps, their tables and their error, by simulating the probes.
    tabulate : callable
        Computes the tables of a number of steps that an earlier command has found.
    """
    found: list[Tables] = []

    def steps() -> tuple[int, float]:
        count, tables, error = search()
        found.append(tables)
        return count, error

    count, error = keep_of(navigation, "steps", probes, steps)
    return (found[0] if found else tabulate(count)), error
