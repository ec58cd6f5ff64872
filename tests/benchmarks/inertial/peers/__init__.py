"""The peers, by name. A module is imported only in the process that measures it: its library may be missing."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Final

from tests.benchmarks.inertial.peer import Peer


@dataclass(frozen=True)
class Entry:
    """Where a peer is, and how it is measured.

    Attributes
    ----------
    module, attribute : str
    package : str
        As installed, whose version is stated.
    method : str
    setting : float
    seconds : float
        Of the flight: less than all of it for one that takes minutes, whose times are multiplied accordingly and which
        is measured on one core alone.
    compared : int
        Largest number of reference samples.
    """

    module: str
    attribute: str
    package: str
    method: str
    setting: float = 0.0
    seconds: float = 600.0
    compared: int = 4

    def load(self) -> Peer:
        """Return the peer itself; ImportError when its library is missing."""
        peer: Peer = getattr(importlib.import_module(f"{__name__}.{self.module}"), self.attribute)
        return peer


OWN: Final = "mcnav, own gains"
SHARED: Final = "mcnav, shared gains"
LOOP: Final = "compiled loop"
PYINS: Final = "python-ins"

PEERS: Final = {
    OWN: Entry("mcnav_engines", "OWN", "mcnav", "ensemble: deviations, each sample its own covariance"),
    SHARED: Entry("mcnav_engines", "SHARED", "mcnav", "ensemble: deviations, gains along the truth"),
    "mcnav, reference": Entry("mcnav_engines", "REFERENCE", "mcnav", "collocation, filterpy at 0.2 s", compared=2),
    LOOP: Entry("compiled_loop", "PEER", "numba", "100 Hz, by hand, covariance each 1 s", 1.0),
    f"{LOOP}, 0.1 s": Entry("compiled_loop", "PEER", "numba", "100 Hz, by hand, covariance each 0.1 s", 0.1),
    "JAX vmap": Entry("jax_vmap", "PEER", "jax", "100 Hz, scan under vmap, covariance each 1 s", 1.0),
    "filterpy + joblib": Entry(
        "filterpy_joblib", "PEER", "filterpy", "100 Hz compiled strapdown, KalmanFilter each 1 s", 1.0
    ),
    PYINS: Entry("pyins_filter", "PEER", "python-ins", "100 Hz, feedback filter, covariance each 1 s", 1.0, compared=1),
    f"{PYINS}, default": Entry(
        "pyins_filter", "PEER", "python-ins", "100 Hz, feedback filter, covariance each 0.1 s", 0.1, 120.0, 1
    ),
    "gnss-ins-sim": Entry(
        "gnss_ins_sim", "PEER", "gnss-ins-sim", "100 Hz readings, no filter", seconds=600.0, compared=0
    ),
}
