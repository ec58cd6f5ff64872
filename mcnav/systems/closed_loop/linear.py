"""Linear covariance of a loop from its plan: partial derivatives and the covariance by process, at the epochs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.contract.linear import Update
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import Begin, Plan, Transition
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.sizes import Sizes


@dataclass(frozen=True)
class LinearReadings:
    """The linear system at some epochs, m of them.

    Attributes
    ----------
    partials : ndarray, shape (m, outputs, sources)
    nominal, origin : ndarray, shape (m, outputs)
        As those of a `LinearSystem`.
    processes : mapping of str to ndarray, shape (m, outputs, outputs)
    updates : tuple of str or None
        As those of a `LinearSystem`.
    seen : tuple of (ndarray, ndarray)
        X of the nominal, shape (size,), and the filter's covariance, shape (k, k).
    """

    times: Array
    partials: Array
    nominal: Array
    origin: Array
    processes: Mapping[str, Array]
    updates: tuple[Update, ...] = ()
    seen: tuple[tuple[Array, Array], ...] = ()


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
        sized = transition.inputs * true.modes
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


@dataclass
class LinearState:
    """Deviations of X: partial derivatives, shape (size, sources), and covariances by process, shape (size, size)."""

    partials: Array
    covariances: dict[str, Array]
    present: dict[str, bool]

    @classmethod
    def at_start(cls, maps: Maps, true: Sizes, waits: bool = False) -> LinearState:
        """Return those at the start, without errors of a navigator that waits."""
        structure = maps.structure
        covariances = {name: np.zeros((structure.size, structure.size)) for name in process_names(maps)}
        begin = structure.markov.begin
        for quantity, place in structure.markov.places():
            local = slice(place.start - begin, place.stop - begin)
            covariances[quantity.name][place, place] = np.diag(true.markov[local] ** 2)
        present = {name: bool(matrix.any()) for name, matrix in covariances.items()}
        partials = structure.start_partials.copy()
        if waits:
            partials[structure.navigator] = 0.0
        return cls(partials, covariances, present)

    def after(self, maps: Maps, true: Sizes, transition: Transition) -> LinearState:
        """Return those after a transition."""
        state, present, covariances = transition.state, dict(self.present), dict(self.covariances)
        for name, covariance in covariances.items():
            if present[name]:
                covariances[name] = state @ covariance @ state.T
        for name, entering in _entering(maps, true, transition):
            if entering.any():
                present[name] = True
                covariances[name] = covariances[name] + entering @ entering.T
        return LinearState(state @ self.partials, covariances, present)

    def begun(self, begin: Begin) -> LinearState:
        """Return those after the start of a navigator that has waited."""
        covariances = {name: begin.state @ each @ begin.state.T for name, each in self.covariances.items()}
        return LinearState(begin.state @ self.partials + begin.errors, covariances, self.present)

    def covariance(self, start: Array) -> Array:
        """Return the covariance of X, shape (size, size), for sources of a covariance."""
        total = self.partials @ start @ self.partials.T
        return np.asarray(total + sum(self.covariances[name] for name, there in self.present.items() if there))


Row = tuple[float, Array, Array, dict[str, Array]]
"""A reading: time, partial derivatives and nominal of the outputs, and their covariance by process."""


def read_plan(
    plan: Plan, maps: Maps, true: Sizes, readout: Readout, epochs: Sequence[int], around: bool = False
) -> LinearReadings:
    """Propagate partial derivatives and covariances along a plan and read them out at instants by number.

    Parameters
    ----------
    around : bool
        Whether to read out before and after updates at the epochs, and before and after all corrections.
    """
    linear, wanted = LinearState.at_start(maps, true, plan.begin is not None), set(epochs)
    rows: list[Row] = []
    labels: list[Update] = []
    seen: list[tuple[Array, Array]] = []

    def read(time: float, x: Array, state: LinearState, label: Update, own: Array) -> None:
        matrix = readout.partials(x, plan.steps, time)
        added = {name: matrix @ each @ matrix.T for name, each in state.covariances.items() if state.present[name]}
        rows.append((time, matrix @ state.partials, readout.read_nominal(x, time), added))
        labels.append(label)
        seen.append((x, own))

    for number, planned in enumerate(plan.instants[: plan.end + 1]):
        for transition in planned.steps:
            for moment in transition.moments if around else ():
                read(
                    moment.time, moment.x, linear.after(maps, true, moment.transition), moment.label, moment.covariance
                )
            linear = linear.after(maps, true, transition)
        if plan.begin is not None and number == plan.begin.number:
            linear = linear.begun(plan.begin)
        corrects = around and any(each.kind == "correct" for each in planned.updates)
        changes = around and (number in wanted or corrects) and planned.changed
        time = plan.end_time if number == plan.end else planned.instant.time
        if changes:
            read(time, planned.before[-1], linear, "before", planned.covariance_before)
        for transition in planned.updates:
            linear = linear.after(maps, true, transition)
        known = around and bool(rows) and rows[-1][0] == time and not changes  # after a correction at the same time
        if (number in wanted or changes) and not known:
            read(time, planned.nominal, linear, "after" if changes else None, planned.covariance)
    floor = readout.floor(plan)
    steps = np.array([plan.steps[source.moves[0]] for source in maps.structure.sources])
    rows = [_without_rounding(row, true.start, floor, steps) for row in rows]
    origins = [readout.origin(x, floor) for x, _ in seen]
    none = np.zeros((len(readout.outputs),) * 2)
    names = list(dict.fromkeys(name for row in reversed(rows) for name in row[3]))
    return LinearReadings(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array(origins).reshape(len(rows), len(readout.outputs)),
        {name: np.array([row[3].get(name, none) for row in rows]) for name in names},
        tuple(labels),
        tuple(seen),
    )


def _without_rounding(row: Row, start: Array, floor: Array, steps: Array) -> Row:
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
