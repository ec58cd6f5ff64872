"""Units in which errors of the instruments are shown, and their usual sizes: those of type ``ins``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from mcnav.contract.quantities import Source
from mcnav.systems.closed_loop.strapdown.merged import navigator_of
from mcnav.systems.closed_loop.strapdown.navigator import ERRORS


def instrument_sources(instance: Any) -> Mapping[str, Source]:
    """Return the constant errors that a navigator brings, by name; empty without one."""
    return {} if navigator_of(instance) is None else _brought()[0]


def shown_units(instance: Any) -> Mapping[str, str]:
    """Return the units in which errors of a navigator's instruments are shown, by name; empty without one."""
    return {} if navigator_of(instance) is None else _brought()[1]


@cache
def _brought() -> tuple[Mapping[str, Source], Mapping[str, str]]:
    from mcnav.systems.ins.scenario import NOISE, SOURCES  # only a loop with a navigator needs it

    sources = {source.name: source for source in SOURCES if source.group in ERRORS}
    processes = {process.name: process.shown_in for process in NOISE}
    return sources, {name: source.shown_in for name, source in sources.items()} | processes
