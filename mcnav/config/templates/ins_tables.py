"""Tables of a new campaign of inertial navigation: its instruments, sensors, filter and faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from mcnav.config.templates import fill_in
from mcnav.config.templates.ins_flight import ROUND, TEMPLATES, Flight, mistake, time_text
from mcnav.physics.units import conversion
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.tables.imu_catalogue import INSTABILITY, CatalogueUnit
from mcnav.systems.ins.tables.instrument_tables import INSTRUMENTS

MOST_UPDATES: Final = 3_600
"""Measurements of a sensor at its usual interval; beyond it the interval is longer."""

AT_INTERVAL: Final = """\
interval = "INTERVAL"  # between measurements, s; or instants = ["MIDDLE", "LATER"]
# begin = "MIDDLE"  # first measurement, in the trajectory's time, s; end = … is the last one
# outages = [["MIDDLE", "LATER"]]  # without measurements: begin included, end not, s
"""

AT_REST: Final = """\
instants = [INSTANTS]  # times at rest, in the trajectory's time, s
"""

LATE: Final = """\
# delay = "20 ms"  # sigma of a constant delay: how late its measurements are stamped, s
# jitter = "2 ms"  # sigma of a further delay of each measurement, s
"""

GATE: Final = """\
# gate = 0.999  # probability with which an expected measurement is accepted
"""

IN_A_ROW: Final = 5
"""Errors of sensors in a row of what a filter estimates."""

CONSIDERED: Final = ("scale_factor", "misalignment", "g_sensitivity", "nonlinearity")
"""Errors of the instruments besides their biases: the filter has their covariance, and does not estimate them."""


def fault_table(sensor: Sensor) -> str:
    """Write a fault of a sensor as a comment: ten times the usual error of what it measures first, amid its flight."""
    component = sensor.components[0]
    measured = QUANTITIES[component.quantity]
    size = 10.0 * measured.usual * conversion(measured.unit, measured.shown_in)
    named = f'# component = "{component.name}"  # of what it measures\n' if len(sensor.components) > 1 else ""
    begin = time_text(float(sensor.times[len(sensor.times) // 2]))
    written = {"SENSOR": sensor.name, "COMPONENT": named, "BEGIN": begin, "SIZE": f"{size:.3g} {measured.shown_in}"}
    return fill_in(f"{TEMPLATES}/faults.toml", written)


def instrument_values(unit: CatalogueUnit, instrument: str) -> str:
    """Write the values of an instrument as comments, each with its meaning and SI unit."""
    lines = []
    for key, entry in unit.table[instrument].items():
        units = {value.key: value.unit for value in unit.values if value.instrument == instrument}
        if isinstance(entry, dict):
            written = "{ " + ", ".join(f'{name} = "{text}"' for name, text in entry.items()) + " }"
            si = " and ".join(dict.fromkeys(units[f"{key}.{name}"] for name in entry))
        else:
            written, si = f'"{entry}"', units[key]
        described = INSTRUMENTS[instrument].model_fields[key].description or key
        meaning = described.partition(":")[0].rstrip(".")
        words = meaning[0].lower() + meaning[1:] + ("" if si == "1" else f", {si}")
        lines.append(f"# {key} = {written}  # {words}\n")
    return "".join(lines)


def sensor_table(kind: SensorType, flight: Flight, times: Mapping[str, str]) -> str:
    """Write the table of a sensor."""
    words = kind.words[0].lower() + kind.words[1:].rstrip(".")
    instants = AT_REST if kind.interval is None else AT_INTERVAL
    bends = "\nflexure = " in kind.template  # how the structure bent before a time stamp is not modelled
    late = LATE if kind.delays and not bends else ""
    text = f'\n[[aiding]]\ntype = "{kind.name}"  # {words}\n{instants}{kind.template}{late}{GATE}'
    for before, after in {**_instants(kind, flight), **times}.items():
        text = text.replace(before, after)
    return text


def _instants(kind: SensorType, flight: Flight) -> dict[str, str]:
    """Return when a sensor measures: at an interval, or at rest."""
    duration = flight.last - flight.first
    if kind.interval is not None:
        least = max(min(kind.interval, duration / 4.0), duration / MOST_UPDATES)
        return {"INTERVAL": time_text(next((time for time in ROUND if least <= time <= duration / 4.0), least))}
    chosen = flight.resting()
    if not len(chosen):
        raise mistake("--aid", f"{kind.name} needs a vehicle at rest, and this one always moves; leave it out")
    return {"INSTANTS": ", ".join(f'"{time_text(time)}"' for time in chosen.tolist())}


def filter_states(unit: CatalogueUnit, aids: Sequence[str]) -> dict[str, str]:
    """Return what the filter estimates, and what it considers."""
    tables = unit.table
    biases = [f"{table}_bias" for table in tables if tables[table].keys() & {"bias", INSTABILITY}]
    of_sensors = [f"{aid.replace('-', '_')}_{error}" for aid in aids for error in SENSOR_TYPES[aid].estimated]
    some = [of_sensors[first : first + IN_A_ROW] for first in range(0, len(of_sensors), IN_A_ROW)]
    rows = [["position", "velocity", "attitude"], biases, *some]
    considered = [f"{table}_{kind}" for table in tables for kind in CONSIDERED if kind in tables[table]]
    return {
        "ESTIMATES": "\n".join(f"    {_listed(row)}," for row in rows if row),
        "CONSIDERS": "".join(f"    {_listed([name])},\n" for name in considered),
    }


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)
