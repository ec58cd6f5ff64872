"""Recognition of scenarios of inertial navigation, for those who import its equations only then."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeGuard

from mcnav.contract.scenario import Capability, Scenario

if TYPE_CHECKING:
    from mcnav.systems.ins.scenario import Ins


def is_ins(scenario: Scenario) -> TypeGuard[Ins]:
    """Return whether a scenario is an inertial navigation along a trajectory."""
    return Capability.TRAJECTORY in scenario.can
