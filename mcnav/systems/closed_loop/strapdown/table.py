"""``[imu]`` of a closed loop with a `Strapdown`, and what its filter believes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from mcnav.entries.context import FileContext
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.strapdown.navigator import ERRORS, INSTABILITY, PROCESSES, WALKS, Strapdown
from mcnav.systems.closed_loop.structure import Structure
from mcnav.systems.ins.imu.instruments import AXES, Imu
from mcnav.systems.ins.tables.imu import ImuSizes, read_imu

NOT_MODELLED: Final = ("rate_random_walk", "quantization")
"""Processes of an instrument that a closed loop leaves out."""


@dataclass(frozen=True)
class Instruments:
    """Sizes of a navigator's instruments, as they are and as its filter believes them."""

    true: ImuSizes
    believed: ImuSizes

    def sized(self, sizes: LoopSizes, structure: Structure) -> LoopSizes:
        """Return the sizes of a loop with those of the instruments' processes."""
        return LoopSizes(
            _with_processes(sizes.true, structure, self.true.processes),
            _with_processes(sizes.believed, structure, self.believed.processes),
        )


def read_instruments(navigator: Strapdown | None, name: str, context: FileContext) -> Instruments | None:
    """Read ``[imu]`` and ``[filter.believes.imu]`` of a class; mistakes are added to the context.

    Without a navigator, or after a mistake, none is returned.
    """
    if navigator is None:
        for place, content in (("imu", context.content), ("filter.believes.imu", believes_of(context.content))):
            if "imu" in content:
                message = "has no inertial measurement unit; give it navigator = Strapdown(...), or leave this out"
                context.problem(place, f"{name} {message}")
        return None
    before = len(context.problems)
    true = read_imu(context.content.get("imu", {}), context)
    if true is None:
        return None
    believed = read_imu(believes_of(context.content).get("imu", {}), context, "filter.believes.imu", true.processes)
    _check_modelled("imu", true.processes, context)
    if believed is not None:
        _check_modelled("filter.believes.imu", believed.processes, context)
    for prefix, content in (("", context.content), ("filter.believes.", believes_of(context.content))):
        given = content.get("processes")
        for name in PROCESSES.keys() & given.keys() if isinstance(given, dict) else ():
            context.problem(f"{prefix}processes.{name}", f"is sized by [{prefix}imu]; leave it out here")
    if believed is None or len(context.problems) > before:
        return None
    _check_estimated(navigator, true, believed, context)
    return None if len(context.problems) > before else Instruments(true, believed)


def _check_estimated(navigator: Strapdown, true: ImuSizes, believed: ImuSizes, context: FileContext) -> None:
    """Add a mistake for each error that is estimated and has no size along an axis: the covariance is singular."""
    stated = [context.content.get("errors"), believes_of(context.content).get("errors")]
    elsewhere = {name for entries in stated if isinstance(entries, dict) for name in entries}
    for kind in navigator.estimates:
        instrument, _, key = kind.partition("_")
        if key == INSTABILITY:
            sizes = dict(zip(AXES, getattr(believed.processes, instrument).instability, strict=True))
        else:
            known = {**true.sigmas, **believed.sigmas}
            sizes = {axis: known.get(f"{kind}_{axis}", 0.0) for axis in ERRORS[kind][1]}
        without = [axis for axis, size in sizes.items() if not size > 0.0 and f"{kind}_{axis}" not in elsewhere]
        if without and kind not in elsewhere:
            message = f"the navigator estimates {kind}, which needs a size along {', '.join(without)}"
            context.problem(f"imu.{instrument}.{key}", message)


def _check_modelled(place: str, imu: Imu, context: FileContext) -> None:
    """Add a mistake for each process that a closed loop leaves out."""
    for instrument in WALKS:
        for process in NOT_MODELLED:
            if getattr(getattr(imu, instrument), process).any():
                message = "is not modelled in a closed loop; leave it out, or give it the size zero"
                context.problem(f"{place}.{instrument}.{process}", message)


def believes_of(content: Any) -> dict[str, Any]:
    """Return ``[filter.believes]``; empty without one."""
    table = content.get("filter")
    believes = table.get("believes") if isinstance(table, dict) else None
    return believes if isinstance(believes, dict) else {}


def _with_processes(sizes: Sizes, structure: Structure, imu: Imu) -> Sizes:
    white, markov, decay = sizes.white.copy(), sizes.markov.copy(), sizes.decay.copy()
    for instrument, walk in WALKS.items():
        noise = getattr(imu, instrument)
        white[structure.white.of(f"{instrument}_{walk}")] = noise.random_walk
        place = structure.markov.of(f"{instrument}_{INSTABILITY}")
        assert place is not None
        local = slice(place.start - structure.markov.begin, place.stop - structure.markov.begin)
        markov[local], decay[local] = noise.instability, 1.0 / noise.correlation_time
    initial = None if sizes.initial is None else np.where(markov == sizes.markov, sizes.initial, markov)
    return replace(sizes, white=white, markov=markov, decay=decay, initial=initial)
