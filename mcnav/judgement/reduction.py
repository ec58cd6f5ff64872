"""A record without some of its causes, and with numbers changed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord, Part


def present(record: FilteredRecord) -> tuple[int, ...]:
    """Return the numbers of the causes that the campaign has."""
    return tuple(number for number, cause in enumerate(record.causes) if not cause.absent)


def without_idle(record: FilteredRecord) -> FilteredRecord:
    """Return the record, for its covariances alone, without the errors that stay zero.

    Neither their start nor a process nor another error moves them. The sources at the start are all left.
    """
    moved = (record.mean != 0.0) | np.any((record.to_states @ record.initial) != 0.0, axis=1)
    for stage in record.stages:
        for part in stage.processes:
            moved[part.places] = True
    count = -1
    while count != np.count_nonzero(moved):
        count = int(np.count_nonzero(moved))
        for stage in record.stages:
            if stage.transition is not None:
                moved |= np.any(stage.transition[:, moved] != 0.0, axis=1)
    if moved.all():
        return record
    places, new_places = np.flatnonzero(moved), np.cumsum(moved) - 1
    stages = tuple(
        replace(
            stage, transition=None if stage.transition is None else stage.transition[np.ix_(places, places)],
            response=stage.response[:, places],
            processes=tuple(replace(part, places=new_places[part.places]) for part in stage.processes),
        )
        for stage in record.stages
    )  # fmt: skip
    return replace(record, stages=stages, offsets=(), mean=record.mean[places], to_states=record.to_states[places])


def with_causes(record: FilteredRecord, kept: Collection[int]) -> FilteredRecord:
    """Return the record with some of its causes alone, in order, and without the states of the others.

    Parameters
    ----------
    kept : collection of int
        All causes that the campaign has, and some that it does not have.
    """
    chosen = sorted(kept)
    numbers = np.full(len(record.causes) + 1, -1)
    numbers[chosen] = np.arange(len(chosen))
    gone = (record.initial_causes >= 0) & (numbers[record.initial_causes] < 0)
    places = np.flatnonzero(~gone)
    new_places = np.cumsum(~gone) - 1

    def renumbered(parts: tuple[Part, ...], of_states: bool) -> tuple[Part, ...]:
        return tuple(
            Part(int(numbers[part.cause]), new_places[part.places] if of_states else part.places, part.covariance)
            if not of_states or not gone[part.places].any()
            else _without(part, int(numbers[part.cause]), gone, new_places)
            for part in parts
            if numbers[part.cause] >= 0
        )

    stages = tuple(
        replace(
            stage, transition=None if stage.transition is None else stage.transition[np.ix_(places, places)],
            response=stage.response[:, places], processes=renumbered(stage.processes, True),
            noise=renumbered(stage.noise, False),
        )
        for stage in record.stages
    )  # fmt: skip
    return replace(
        record, stages=stages, causes=tuple(record.causes[number] for number in chosen),
        offsets=tuple(replace(offset, states=new_places[offset.states]) for offset in record.offsets),
        mean=record.mean[places], initial=record.initial[np.ix_(places, places)],
        initial_causes=numbers[record.initial_causes[places]], to_states=record.to_states[np.ix_(places, places)],
    )  # fmt: skip


def _without(part: Part, cause: int, gone: NDArray[np.bool_], new_places: IndexArray) -> Part:
    """Return a part without the states that are gone."""
    left = np.flatnonzero(~gone[part.places])
    return Part(cause, new_places[part.places[left]], part.covariance[np.ix_(left, left)])


def with_size(record: FilteredRecord, number: int, factor: float) -> FilteredRecord:
    """Return the record of a campaign with a size multiplied; one that it did not have is now among its sizes."""

    def scaled(parts: tuple[Part, ...]) -> tuple[Part, ...]:
        return tuple(
            replace(part, covariance=part.covariance * factor**2) if part.cause == number else part for part in parts
        )

    cause = record.causes[number]
    causes = list(record.causes)
    causes[number] = replace(cause, size=cause.size * factor, absent=False)
    scale = np.where(record.initial_causes == number, factor, 1.0)
    stages = tuple(
        replace(stage, processes=scaled(stage.processes), noise=scaled(stage.noise)) for stage in record.stages
    )
    return replace(record, causes=tuple(causes), initial=record.initial * np.outer(scale, scale), stages=stages)


def with_error(record: FilteredRecord, states: IndexArray, values: Array) -> FilteredRecord:
    """Return the record of a campaign with a constant error of known size."""
    mean = record.mean.copy()
    mean[states] += values
    return replace(record, mean=mean)
