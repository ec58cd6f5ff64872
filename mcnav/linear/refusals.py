"""Errors of scenarios and engines as errors of the campaign that names them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mcnav.contract.errors import ScenarioError, SimulationFailed
from mcnav.errors import CampaignError, Problem
from mcnav.linear.polynomial import PolynomialFitError


@contextmanager
def scenario_errors(file: str, place: Callable[[str], str] = "scenario.{}".format) -> Iterator[None]:
    """Convert errors of scenarios and engines into `CampaignError` of a campaign's file.

    ``place`` returns where a key that a `ScenarioError` names is in the file.
    """
    try:
        yield
    except ScenarioError as wrong:
        raise CampaignError([Problem(file, place(wrong.key), str(wrong))]) from None
    except SimulationFailed as wrong:
        raise CampaignError([Problem(file, "scenario", str(wrong))]) from None
    except PolynomialFitError as wrong:
        raise CampaignError([Problem(file, "engine", str(wrong))]) from None
