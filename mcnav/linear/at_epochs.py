"""What linear analysis says over time, and at the epochs of an engine, where it is compared with samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, has_histories
from mcnav.contract.filter_record import FilterPrediction
from mcnav.contract.linear import LinearSystem
from mcnav.contract.scenario import Scenario
from mcnav.linear.partials import partials_throughout
from mcnav.linear.polynomial_engine import exact_part


def same_times(one: Array, other: Array) -> bool:
    """Return whether the times of epochs are the same but for rounding."""
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=1e-9))


def differenced_at_epochs(scenario: Scenario, engine: Engine) -> LinearSystem | None:
    """Compute the linear system at the epochs of an engine by differences; none where it has no histories."""
    exact = exact_part(engine)
    if not has_histories(exact) or exact.epochs is None:
        return None
    partials, nominal = partials_throughout(exact, np.array([source.nominal for source in scenario.sources]))
    return LinearSystem(exact.epochs.times, partials, nominal, label=exact.epochs.label)


def stated_at_epochs(scenario: Scenario, engine: Engine) -> LinearSystem | None:
    """Return the linear system that a scenario states at the epochs of an engine, with its noise, or none."""
    if engine.epochs is None or scenario.parts.readings == "end":
        return None
    system = scenario.linear_over_time()
    return system if same_times(system.times, engine.epochs.times) else None


def linear_at_epochs(scenario: Scenario, engine: Engine) -> LinearSystem | None:
    """Return the linear system at the epochs of an engine; none where it is not known there."""
    differenced = differenced_at_epochs(scenario, engine)
    return stated_at_epochs(scenario, engine) if differenced is None else differenced


def filter_at_epochs(scenario: Scenario, engine: Engine) -> FilterPrediction | None:
    """Return what linear analysis says of the filter at the epochs of an engine; none where it says nothing of them."""
    if engine.filter is None or engine.epochs is None:
        return None
    prediction = scenario.filter_prediction()
    return prediction if prediction is not None and same_times(prediction.times, engine.epochs.times) else None


def linear_throughout(scenario: Scenario, count: int, differenced: LinearSystem | None) -> LinearSystem | None:
    """Return the linear system at about so many times of the flight; by differences where it is not stated, or none."""
    if scenario.parts.readings != "end":
        return scenario.linear_over_time(count)
    return None if differenced is None else replace(differenced, nominal=None)
