"""Linear covariance of a loop from its plan: partial derivatives and the covariance by process, at the epochs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import Plan, Transition
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.sizes import Sizes


@dataclass(frozen=True)
class LinearReadings:
    """The linear system at some epochs, m of them.

    Attributes
    ----------
    partials : ndarray, shape (m, outputs, sources)
    nominal : ndarray, shape (m, outputs)
    processes : mapping of str to ndarray, shape (m, outputs, outputs)
    """

    times: Array
    partials: Array
    nominal: Array
    processes: Mapping[str, Array]


def process_names(maps: Maps) -> tuple[str, ...]:
    """Return the names of all processes of noise: white, Gauss-Markov, of sensors, of corrections."""
    structure = maps.structure
    sensors = tuple(sensor.declared.name for sensor in maps.sensors)
    return (*structure.white.names, *structure.markov.names, *sensors, *structure.corrections.names)


def _entering(maps: Maps, true: Sizes, transition: Transition) -> Iterator[tuple[str, Array]]:
    """Return what enters a map by process: name, and ``G`` in sizes of the process, shape (size, k)."""
    structure = maps.structure
    if transition.kind == "step":
        inputs = structure.white.size + structure.markov.size
        sized = transition.inputs * np.tile(true.inputs, 2)
        begin = 0
        for quantity in (*structure.white.quantities, *structure.markov.quantities):
            columns = np.arange(begin, begin + quantity.size)
            yield quantity.name, sized[:, np.concatenate([columns, inputs + columns])]
            begin += quantity.size
        for number, inputs_of in transition.corrections.items():
            yield structure.corrections.quantities[number].name, inputs_of * true.corrections[number]
    elif transition.kind == "measure":
        yield maps.sensors[transition.number].declared.name, transition.inputs * true.measurements[transition.number]
    elif transition.kind == "correct":
        name = structure.corrections.quantities[transition.number].name
        yield name, transition.inputs * true.corrections[transition.number]


def read_plan(plan: Plan, maps: Maps, true: Sizes, readout: Readout, epochs: Sequence[int]) -> LinearReadings:
    """Propagate partial derivatives and covariances along a plan and read them out at instants by number."""
    structure = maps.structure
    partials = structure.start_partials.copy()
    covariances = {name: np.zeros((structure.size, structure.size)) for name in process_names(maps)}
    begin = structure.markov.begin
    for quantity, place in structure.markov.places():
        local = slice(place.start - begin, place.stop - begin)
        covariances[quantity.name][place, place] = np.diag(true.markov[local] ** 2)
    present = {name: bool(matrix.any()) for name, matrix in covariances.items()}
    rows: list[tuple[float, Array, Array, dict[str, Array]]] = []
    wanted = set(epochs)
    for number, planned in enumerate(plan.instants[: plan.end + 1]):
        for transition in (*planned.steps, *planned.updates):
            state = transition.state
            partials = state @ partials
            for name, covariance in covariances.items():
                if present[name]:
                    covariances[name] = state @ covariance @ state.T
            for name, entering in _entering(maps, true, transition):
                if entering.any():
                    present[name] = True
                    covariances[name] = covariances[name] + entering @ entering.T
        if number in wanted:
            time = plan.end_time if number == plan.end else planned.instant.time
            matrix = readout.partials(planned.nominal, plan.steps, time)
            nominal = readout.read_nominal(planned.nominal, time)
            added = {name: matrix @ each @ matrix.T for name, each in covariances.items() if present[name]}
            rows.append((time, matrix @ partials, nominal, added))
    floor = readout.floor(plan)
    steps = np.array([plan.steps[source.moves[0]] for source in structure.sources])
    rows = [_without_rounding(row, true.start, floor, steps) for row in rows]
    none = np.zeros((len(readout.outputs),) * 2)
    names = rows[-1][3]
    return LinearReadings(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        {name: np.array([row[3].get(name, none) for row in rows]) for name in names},
    )


def _without_rounding(
    row: tuple[float, Array, Array, dict[str, Array]], start: Array, floor: Array, steps: Array
) -> tuple[float, Array, Array, dict[str, Array]]:
    """Return a reading in which outputs that are rounding alone are not dispersed at all.

    Partial derivatives by sources without a size are kept where the step of a difference moves the output.
    """
    time, partials, nominal, processes = row
    variance = np.einsum("ij,jk,ik->i", partials, start, partials)
    variance += sum((np.diag(each) for each in processes.values()), np.zeros(len(floor)))
    kept = variance > floor**2
    moved = (np.diag(start) == 0.0) & (np.abs(partials) * steps > floor[:, None])
    sizes = {name: _kept(each, kept) for name, each in processes.items()}
    return time, np.where(kept[:, None] | moved, partials, 0.0), nominal, sizes


def _kept(covariance: Array, kept: NDArray[np.bool_]) -> Array:
    """Return a process's covariance of the outputs that are kept, without variances that rounding makes negative."""
    own = kept & (np.diag(covariance) > 0.0)
    return np.where(np.outer(own, own), covariance, 0.0)
