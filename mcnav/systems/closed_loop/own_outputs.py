"""Outputs of the user's own: functions of truth and estimate with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Of
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.methods import Frame, Method
from mcnav.systems.closed_loop.quantities import Quantity, as_kept, read_axes
from mcnav.systems.user.settings import NAME, check_unit

ARGUMENTS: Final = ("time", "truth", "estimate", "command", "parameters", "memory")
"""Arguments that ``outputs`` may name."""

KINDS: Final[Sequence[Of]] = ("navigation", "truth", "control", "time")


@dataclass(frozen=True)
class OwnOutputs:
    """Names and units of what ``outputs`` returns, and what each is of.

    Attributes
    ----------
    of : tuple of Of
        What it says, or what its arguments say: truth and estimate make a navigation error, one of them alone a
        dispersion, a command alone is control.
    """

    method: Method
    quantities: tuple[Quantity, ...]
    of: tuple[Of, ...]

    def values(self, frame: Frame, count: int) -> Array:
        """Compute them for n samples, shape (outputs, n)."""
        returned = _entries(self.method(frame))
        if set(returned) != {quantity.name for quantity in self.quantities}:
            raise ValueError(f"outputs returned {', '.join(returned)}, and other names for other samples")
        rows = []
        for quantity in self.quantities:
            value = as_kept(returned[quantity.name][0], quantity, count, f"{quantity.name} of outputs")
            rows.append(np.broadcast_to(value, (quantity.size, count)))
        return np.concatenate(rows)


def _entries(returned: Any) -> Mapping[str, Sequence[Any]]:
    """Check what ``outputs`` returns; `ValueError` when it is no mapping of names to values with units."""
    if not isinstance(returned, Mapping) or not returned:
        raise ValueError('outputs must return a mapping such as {"miss": (values, "m")}')
    for name, entry in returned.items():
        if not isinstance(entry, tuple) or len(entry) not in (2, 3) or not isinstance(entry[1], str):
            raise ValueError(f"{name} of outputs must be values and a unit, such as (values, 'm')")
    return returned


def read_own_outputs(method: Method, frame: Frame, count: int, taken: Sequence[str]) -> OwnOutputs:
    """Find out what ``outputs`` returns; `ScenarioError` when it is wrong.

    Parameters
    ----------
    count : int
        Samples of the frame.
    taken : sequence of str
        Names of the other outputs.
    """
    try:
        returned = _entries(method(frame))
    except Exception as failure:
        raise ScenarioError("type", f"{method.where}: {failure}") from failure
    both = {"truth", "estimate"} & set(method.names)
    default: Of = "navigation" if len(both) == 2 else "truth" if both or "command" not in method.names else "control"
    quantities, kinds = [], []
    for name, (value, unit, *of) in returned.items():
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ScenarioError("type", f"{method.where}: {name!r} is not a name of letters, digits and _")
        check_unit(f"{method.where}: {name}", unit, unit)
        shape = np.shape(value)
        if len(shape) not in (0, 1, 2) or (shape and shape[0] != count):
            raise ScenarioError("type", f"{method.where}: {name} must have shape (n,) or (n, axes); got {shape}, n = 3")
        axes = read_axes(f"{method.where}: {name}", shape[1]) if len(shape) == 2 else ()
        quantities.append(Quantity(name, unit, axes))
        if of and of[0] not in KINDS:
            raise ScenarioError("type", f"{method.where}: {name} is of {', '.join(KINDS)}; got {of[0]!r:.40}")
        kinds.append(cast(Of, of[0]) if of else default)
    for component in (name for quantity in quantities for name in quantity.names):
        if component in taken:
            raise ScenarioError("type", f"{method.where}: the name {component!r} is taken by another output")
    return OwnOutputs(method, tuple(quantities), tuple(kinds))
