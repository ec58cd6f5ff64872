"""Scenarios that are given to the four functions as classes, objects, tables or campaigns."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import cloudpickle

from mcnav.config.campaign import Campaign
from mcnav.config.documents import Document, document_of, written
from mcnav.config.read import campaign_from
from mcnav.contract.scenario import Scenario
from mcnav.sampler.errors import Errors
from mcnav.systems.closed_loop.declarations import ClosedLoop
from mcnav.systems.user.stochastic_scenario import takes_noise


def needs_scenario(given: Any) -> bool:
    """Return whether an object has more to it than a function of errors: noise, or a loop of its own."""
    return isinstance(given, ClosedLoop) or (hasattr(given, "fly") and takes_noise(given))


def class_of(given: Any) -> type:
    """Return the class of an object that is as the class makes it.

    Raises `ValueError` for one with settings of its own, which the class does not have.
    """
    kind = type(given)
    try:
        same = bool(cloudpickle.dumps(vars(kind())) == cloudpickle.dumps(vars(given)))
    except Exception:  # of the user's constructor
        same = False
    if not same:
        raise ValueError(
            f"got an object of {kind.__name__} with settings of its own; give the class, and settings by name: "
            f"{{'type': {kind.__name__}, 'setting': value}}"
        )
    return kind


def scenario_of(given: Any, errors: Errors | None) -> Scenario:
    """Return the scenario of a class, a table or a campaign.

    A filter that is given without errors believes those of the draws.

    Parameters
    ----------
    errors : Errors or None
        Of the draws, where they are known.

    Raises
    ------
    CampaignError, ValueError
        When it is none, or has a filter and nothing says which errors it believes.
    """
    if isinstance(given, type) and issubclass(given, ClosedLoop):
        _warn_of_noise(given)
    described = {"scenario": given} if isinstance(given, type) else given
    scenario = campaign_from(described).scenario
    if isinstance(described, Campaign) or not scenario.parts.filter:
        return scenario
    document = written(described) if isinstance(described, Mapping) else document_of(described)
    if document.content.get("errors"):
        return scenario
    if errors is None:
        raise ValueError(
            "the filter needs the sigmas of the errors: draw them by mcnav.Errors, or give a campaign that has them"
        )
    known = {source.name for source in scenario.sources}
    if not set(errors.names) <= known:
        return scenario  # which is refused by name
    return campaign_from(_Described(_with_errors(document, errors))).scenario


def _with_errors(document: Document, errors: Errors) -> Document:
    """Add errors to a document that has none."""
    added = written({"errors": errors}).content
    return replace(document, content={**document.content, **added})


class _Described:
    """A document as something that describes a campaign."""

    def __init__(self, document: Document) -> None:
        self.document = document


def _warn_of_noise(loop: type[ClosedLoop]) -> None:
    """Say that a loop without a campaign is simulated without its processes of noise."""
    names = [*loop.processes, *(correction.name for correction in loop.corrections if correction.noise)]
    if names:
        sizes = ", ".join(f"{name!r}: …" for name in names)
        warnings.warn(
            f"{loop.__name__} is simulated without {', '.join(names)}, whose sizes only a campaign has: "
            f"mcnav.Campaign({loop.__name__}, processes={{{sizes}}})",
            stacklevel=6,
        )


def remedy_for(given: Any) -> str:
    """Name the campaign that gives a closed loop its sizes, as the end of a message; empty for other systems."""
    loop = given if isinstance(given, type) else type(given)
    if not issubclass(loop, ClosedLoop):
        return ""
    sizes = ", ".join(f"{measurement.name!r}: '1 {measurement.unit}'" for measurement in loop.measurements)
    return f"; a campaign has sizes: mcnav.Campaign({loop.__name__}, measurements={{{sizes}}})"
