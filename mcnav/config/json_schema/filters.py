"""Schema of ``[filter]``."""

from __future__ import annotations

from mcnav.config.json_schema.models import of_model
from mcnav.config.json_schema.nodes import Node, every, quantity, suggested, table
from mcnav.config.json_schema.sensors import believed_sensors, error_pattern, error_patterns
from mcnav.systems.ins.filter.model import estimated_kinds
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, GYRO
from mcnav.systems.ins.scenario import SOURCES
from mcnav.systems.ins.tables.filter import ALWAYS, FilterTable


def filter_schema() -> Node:
    """Return the schema of ``[filter]``."""
    node = of_model(FilterTable)
    node["description"] = "Error-state Kalman filter of an aided navigation; needs [[aiding]]."
    kinds, of_sensors = estimated_kinds((*GYRO, *ACCELEROMETER)), error_pattern(kinds=True)
    estimates, considers = node["properties"]["estimates"], node["properties"]["considers"]
    for states, names in ((estimates, (*ALWAYS, *kinds)), (considers, kinds)):
        states["items"] = {"description": states["description"], **suggested(names, of_sensors)}
    estimates |= every(*({"contains": {"enum": [name]}} for name in ALWAYS))
    for states in (estimates, considers):
        states["uniqueItems"] = True
    believes = node["properties"]["believes"]["properties"]
    believes["errors"] = _believed_errors(believes["errors"]["description"])
    believes["aiding"] = believed_sensors()
    return node


def _believed_errors(description: str) -> Node:
    units = {source.group: source.unit for source in SOURCES} | {source.name: source.unit for source in SOURCES}
    told = "Believed sigma of {}."
    node = table({name: quantity(unit, told.format(name)) for name, unit in units.items()}, description=description)
    of_sensors = told.format("a constant error of a sensor")
    node["patternProperties"] = {pattern: quantity(unit, of_sensors) for unit, pattern in error_patterns().items()}
    return node
