"""``[imu]`` of a closed loop with a `Strapdown`, and what its filter believes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from mcnav.entries.context import FileContext
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.strapdown.navigator import INSTABILITY, PROCESSES, WALKS
from mcnav.systems.closed_loop.structure import Structure
from mcnav.systems.ins.imu.instruments import Imu
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


def read_instruments(context: FileContext) -> Instruments | None:
    """Read ``[imu]`` and ``[filter.believes.imu]``; mistakes are added to the context, and none is returned."""
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
    return None if believed is None or len(context.problems) > before else Instruments(true, believed)


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
    return replace(sizes, white=white, markov=markov, decay=decay)
