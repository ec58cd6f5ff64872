"""What must be noticed of a loop before its samples are compared with its linear system."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.simulation import simulate

SAMPLES: Final = 3
SEED: Final = 1966

SAME: Final = 1e-9
"""Share of an output's size by which a sample may depend on others: the order of a library's sums."""

LARGEST_INNOVATION: Final = 1e-3
"""Nominal innovation, as a share of its believed sigma, from which on gains that differ between samples matter."""

LARGEST_STEP_ERROR: Final = 1e-3
"""Change of X by halved steps, as a share of the quantity's size, over the whole flight."""

GRAZING: Final = 0.1
"""Sigma of the final time as a share of the flight from which on a trigger grazes."""


def check_repeatable(setup: Setup) -> None:
    """Simulate a few samples twice, and one alone.

    Raises
    ------
    ScenarioError
        When identical calls have other outcomes, or a sample depends on others.
    """
    errors = np.random.default_rng(SEED).standard_normal((SAMPLES, len(setup.maps.structure.sources)))
    batch = Batch(np.arange(SAMPLES), errors * np.sqrt(np.maximum(np.diag(setup.true.start), 0.0)), SEED)
    first, second = (simulate(setup, batch, noise=True, over_time=False).values for _ in range(2))
    if not np.array_equal(first, second, equal_nan=True):
        raise ScenarioError(
            "type",
            "answers identical calls differently: is something random, or kept in self from one call to the next?",
        )
    alone = simulate(setup, batch[1:2], noise=True, over_time=False).values
    scale = np.nan_to_num(np.abs(first)).max(axis=0) + np.abs(setup.floor) / SAME
    gaps = np.abs(first[1] - alone[0])
    if np.isnan(first[1]).any() != np.isnan(alone[0]).any() or np.any(gaps > SAME * scale):
        output = setup.readout.outputs[int(np.nanargmax(gaps / np.where(scale > 0.0, scale, 1.0)))].name
        raise ScenarioError(
            "type",
            f"{output} of a sample changes with the samples beside it: is a mean or a sum taken over samples? "
            "A method must treat each by itself",
        )


def remarks_on(setup: Setup, final_time: float) -> list[str]:
    """Return what is to be said of a loop, a clause each.

    Parameters
    ----------
    final_time : float
        Linear sigma of the final time, s; zero without a trigger.
    """
    plan, remarks = setup.plan, []
    for name, share in plan.innovations.items():
        if share > LARGEST_INNOVATION:
            remarks.append(
                f"the innovation of {name} is {share:.2g} of its sigma without any error: the model differs from "
                "what is measured, and gains that differ between samples are not linear"
            )
    if plan.kinks:
        remarks.append(f"{' and '.join(sorted(plan.kinks))} has a kink at the nominal, where there is no derivative")
    for quantity, place in setup.maps.structure.corrections.places():
        if quantity.axes and not plan.instants[plan.end].nominal[place].any():
            remarks.append(
                f"the nominal {quantity.name} is zero: its size has no derivative there, and mean plus three sigma "
                "is no bound of it"
            )
    remarks += _near_updates(setup, final_time)
    remarks += _step_error(setup)
    if final_time > GRAZING * plan.end_time:
        remarks.append(
            f"the trigger grazes: one sigma of the final time is {final_time:.3g} s of {plan.end_time:.4g} s, for "
            "which there is no linear model"
        )
    return remarks


def _near_updates(setup: Setup, final_time: float) -> list[str]:
    """Find measurements, corrections and commands within one sigma of the nominal event."""
    plan = setup.plan
    if setup.maps.end is None:
        return []
    near = max(final_time, SAME * plan.end_time)
    instants = [setup.timeline[max(plan.end - 1, 0)], plan.instants[plan.end].instant]
    remarks = []
    for instant in (each for each in instants if abs(each.time - plan.end_time) <= near):
        what, so = "measurement", "an update may jump over the trigger"
        if not instant.measurements:
            what, so = ("correction", "the correction is made or not") if instant.corrections else (
                "command", "the last command is of one cycle or of the next"
            )  # fmt: skip
            if not instant.corrections and (setup.maps.guide is None or setup.maps.continuous or not instant.guide):
                continue
        remarks.append(
            f"the trigger is met at {plan.end_time:.6g} s, within one sigma of the {what} at {instant.time:.6g} s: "
            f"samples end before or after it, and {so}"
        )
    return remarks


def _step_error(setup: Setup) -> list[str]:
    """Compare each step with two halves of it, about the nominal and one size to its sides.

    The difference of a step goes on as the linear system has it, so that what decays does not add up.
    """
    maps, structure = setup.maps, setup.maps.structure
    inputs, space = structure.white.size + structure.markov.size, structure.space
    sides = np.concatenate([np.zeros((structure.size, 1)), np.diag(setup.steps), -np.diag(setup.steps)], axis=1)
    white = np.zeros((2, inputs, sides.shape[1]))
    error, whole_error = np.zeros_like(sides), np.zeros(structure.size)
    largest, at = np.zeros(structure.size), np.zeros(structure.size)
    for planned in setup.plan.instants:
        length, times = planned.instant.length, planned.instant.step_times()
        for time, before, step in zip(times, planned.before, planned.steps, strict=False):
            x, begin = space.plus(before[:, None], sides), np.full(sides.shape[1], time)
            whole = maps.step(x, begin, length, white)
            half = maps.step(x, begin, 0.5 * length, white)
            added = space.minus(maps.step(half, begin + 0.5 * length, 0.5 * length, white), whole)
            error = step.state @ error + added
            at = np.where(_largest(added) > largest, time, at)
            largest = np.maximum(_largest(added), largest)
            whole_error = np.maximum(whole_error, _largest(error))
        for update in planned.updates:
            error = update.state @ error
    shares = whole_error / setup.steps
    worst = int(np.argmax(shares))
    if not shares[worst] > LARGEST_STEP_ERROR:
        return []
    of = ((quantity.name, place) for block in structure.blocks for quantity, place in block.places())
    name = next(name for name, place in of if place.start <= worst < place.stop)
    return [
        f"halved steps change {name} by {shares[worst]:.2g} of its size, most at {at[worst]:.4g} s: shorten step, or "
        "let the instants of measurements, commands or corrections be those at which rates jump"
    ]


def _largest(change: Array) -> Array:
    return np.asarray(np.nan_to_num(np.abs(change), nan=np.inf).max(axis=1))
