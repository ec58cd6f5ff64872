"""Geodetic altitude of the unit, ``h(r + x) - h(r)`` with the deviation x of position; and altimeters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, uncontracted_subroutine
from mcnav.compiled.vectors import Vector
from mcnav.entries.context import FileContext
from mcnav.systems.ins.earth import geodetic_altitude
from mcnav.systems.ins.reference.axes import POSITION
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, store_three
from mcnav.systems.ins.sensors.quantity import FurtherKey, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the response to x, which is up."""
    down = along.level[:, :, 2]
    return Geometry(down, x=-down, true=along.altitude)


@uncontracted_subroutine
def _altitude_change(constants: Array, u: int, places: Array, x: Vector, y: Vector, z: Vector) -> Vector:
    """Compute the change of the altitude by deviations; exactly zero without one."""
    a, b, c = places[u, 0], places[u, 1], places[u, 2]
    here = geodetic_altitude(constants, 0.0 * x + a, 0.0 * y + b, 0.0 * z + c)
    return geodetic_altitude(constants, a + x, b + y, c + z) - here


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``h(r + x) - h(r)``."""
    value += _altitude_change(tables.earth, u, tables.places, errors.x, errors.y, errors.z)
    if wanted:
        zero = 0.0 * errors.x
        dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
        store_three(rows, c, 6, zero - dx, zero - dy, zero - dz)
    return value


def compare(at: Comparison) -> Difference:
    """Return the indicated altitude less the true one."""
    true, navigation = np.array([at.true.altitude]), responses(1)
    navigation[0, POSITION] = -at.indicated.frame.axes[:, 2]
    return Difference(at.indicated.frame.altitude - true, navigation, true=true)


QUANTITY: Final = QuantityDefinition(
    name="altitude",
    axes=("",),
    unit="m",
    shown_in="m",
    usual=10.0,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    scaled=True,
)

KINDS: Final = ("barometric", "radar")


def select(entry: Mapping[str, Any], times: Array, truth: Truth, key: str, context: FileContext) -> Array:
    """Leave out the instants at which a radar altimeter is too high."""
    kind = entry.get("kind", "barometric")
    if kind not in KINDS:
        context.problem(f"{key}.kind", f"got {kind!r}; expected 'barometric' or 'radar'")
    elif kind == "barometric" and truth.earth.body == "moon":
        context.problem(f"{key}.kind", 'is barometric, and the moon has no air; expected kind = "radar"')
    elif "ceiling" in entry and kind == "barometric":
        context.problem(f"{key}.ceiling", 'is of a radar; leave it out, or add kind = "radar"')
    elif "ceiling" in entry:
        ceiling = context.quantity(entry["ceiling"], "m", f"{key}.ceiling")
        if ceiling is None or not len(times):
            return times
        altitudes = truth.geodetic(times)[:, 2]
        if np.any(altitudes <= ceiling):
            return np.asarray(times[altitudes <= ceiling])
        lowest = f"the lowest altitude at its instants is {altitudes.min():.6g} m"
        context.problem(f"{key}.ceiling", f"got {entry['ceiling']!r}; {lowest}")
    return times


SENSOR: Final = SensorType(
    name="altimeter",
    words="Altitude above the ellipsoid.",
    quantities={"altitude": "altitude"},
    interval=10.0,
    estimated=("bias",),
    further={
        "kind": FurtherKey("A radar is silent above its ceiling.", choices=KINDS),
        "ceiling": FurtherKey("Altitude above the ellipsoid up to which a radar measures.", "m"),
    },
    select=select,
    template="""\
altitude = "3 m"  # sigma of white noise, m
bias = "30 m"  # sigma of a constant error, m
# scale_factor = "0.1 %"  # sigma of a constant error in proportion to the altitude
# correlated = { sigma = "10 m", correlation_time = "20 min" }  # Gauss-Markov error, m and s
# kind = "radar"  # silent above its ceiling, if it has one: ceiling = "2 km", m above the ellipsoid
""",
)
