"""The peers, by name. A module is imported only in the process that measures it: its library may not be there."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Final

from tests.benchmarks.peer import Peer


@dataclass(frozen=True)
class Entry:
    """Where a peer is: module and attribute; and the package (as installed) whose version is told."""

    module: str
    attribute: str
    package: str
    method: str

    def load(self) -> Peer:
        """The peer itself; ImportError when its library is missing."""
        peer: Peer = getattr(importlib.import_module(f"{__name__}.{self.module}"), self.attribute)
        return peer


PEERS: Final = {
    "mcnav": Entry("mcnav_engines", "ENSEMBLE", "mcnav", "ensemble engine: variation of constants"),
    "mcnav map": Entry("mcnav_engines", "MAP", "mcnav", "polynomial map fitted to flights"),
    "heyoka batch": Entry("heyoka_taylor", "BATCH", "heyoka", "Taylor, SIMD lanes"),
    "heyoka ensemble": Entry("heyoka_taylor", "ENSEMBLE", "heyoka", "Taylor, ensemble_propagate_until"),
    "numbalsoda": Entry("numbalsoda_dop853", "PEER", "numbalsoda", "DOP853, compiled throughout"),
    "diffrax Dopri8": Entry("diffrax_vmap", "DOPRI8", "diffrax", "vmap, PID steps"),
    "diffrax Tsit5": Entry("diffrax_vmap", "TSIT5", "diffrax", "vmap, PID steps"),
    "numpy DOP853": Entry("numpy_columns", "DOP853", "numpy", "samples in columns, shared steps"),
    "numpy RK4": Entry("numpy_columns", "RK4", "numpy", "samples in columns, shared steps"),
    "scipy + joblib": Entry("scipy_joblib", "PEER", "scipy", "solve_ivp, DOP853, compiled rates"),
    "monaco + scipy": Entry("monaco_scipy", "PEER", "monaco", "solve_ivp, DOP853, compiled rates"),
}
