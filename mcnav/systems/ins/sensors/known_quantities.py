"""Whether linear analysis and both engines have the equations of all that a sensor measures."""

from __future__ import annotations

from mcnav.systems.ins.ensemble.updates import INNOVATED
from mcnav.systems.ins.reference.earth_fixed_sensors import PREDICTED
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.measurements import KINDS, ROWS


def lacks_equations(sensor: Sensor) -> str | None:
    """Say what a sensor measures without equations, and where they are missing; none if nothing is."""
    for component in sensor.components:
        kind = KINDS.get(component.quantity)
        for known, where in (
            (kind in ROWS, "mcnav.systems.ins.sensors.measurements"),
            (kind in INNOVATED, "mcnav.systems.ins.ensemble.updates"),
            (component.quantity in PREDICTED, "mcnav.systems.ins.reference.earth_fixed_sensors"),
        ):
            if not known:
                return f"{where} has no equations for {component.quantity}"
    return None
