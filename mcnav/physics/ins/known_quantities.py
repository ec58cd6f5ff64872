"""Whether linear analysis and both engines have the equations of all that a sensor measures."""

from __future__ import annotations

from mcnav.physics.ins.aiding import Sensor
from mcnav.physics.ins.earth_fixed_sensors import PREDICTED
from mcnav.physics.ins.measurements import KINDS, ROWS
from mcnav.physics.ins.update_lanes import INNOVATED


def lacks_equations(sensor: Sensor) -> str | None:
    """Say what a sensor measures without equations, and where they are missing; none if nothing is."""
    for component in sensor.components:
        kind = KINDS.get(component.quantity)
        for known, where in (
            (kind in ROWS, "mcnav.physics.ins.measurements"),
            (kind in INNOVATED, "mcnav.physics.ins.update_lanes"),
            (component.quantity in PREDICTED, "mcnav.physics.ins.earth_fixed_sensors"),
        ):
            if not known:
                return f"{where} has no equations for {component.quantity}"
    return None
