"""Printed numbers of ukfm's benchmark: two printings of 100 runs each.

Its documentation, ``docsource/source/auto_benchmark/inertial_navigation.rst``, was printed twice: on 23 September 2019
(commits 4cc2a5f and 3ea27e5, 79 minutes 6.873 seconds) and on 1 October 2019 (538c513 and later ones, 81 minutes
49.077 seconds).
The model is the same in both.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from mcnav.validation.reproduce.ukfm.kernel import LEFT, RIGHT, STANDARD


class Filter(NamedTuple):
    """A filter as it was run.

    Attributes
    ----------
    name : str
        As ukfm names it.
    definition : int
        Of its error.
    sigma_points : bool
        Whether it updates by them.
    turned : float
        Its covariance at the start is that of (a, dr + s r x a), with this s. A right-invariant error needs 1, others
        0.
    """

    name: str
    definition: int
    sigma_points: bool
    turned: float


MEANT: Final = (
    Filter("EKF", STANDARD, False, 0.0),
    Filter("UKF", STANDARD, True, 0.0),
    Filter("left UKF", LEFT, True, 0.0),
    Filter("right UKF", RIGHT, True, 1.0),
    Filter("IEKF", RIGHT, False, 1.0),
)
"""The filters with the covariances at the start that belong to their errors."""

AS_PRINTED: Final = {
    "September 2019": (*MEANT[:3], Filter("right UKF", RIGHT, True, -1.0), Filter("IEKF", RIGHT, False, -1.0)),
    "October 2019": (
        Filter("EKF", STANDARD, False, 1.0), *MEANT[1:3], Filter("right UKF", RIGHT, True, 0.0), MEANT[4]
    ),
}  # fmt: skip
"""The filters of each printing: its page shows the script, whose covariances at the start are not all those meant."""

RUNS: Final = 100
"""Runs of a printing."""

PRINTINGS: Final = {"September 2019": 79.0 * 60.0 + 6.873, "October 2019": 81.0 * 60.0 + 49.077}
"""Printings, and how long they took, s, all five filters together."""

QUANTITIES: Final = {
    "orientation, RMS error": "deg",
    "position, RMS error": "m",
    "orientation, NEES": "",
    "position, NEES": "",
}
"""Printed quantities and their units, in the order of the first scores of the kernel."""

PRINTED: Final = {
    "September 2019": {
        "EKF": ("3.48", "1.01", "17.70", "438.05"),
        "UKF": ("2.99", "0.31", "2.53", "4.13"),
        "left UKF": ("2.92", "0.24", "1.05", "1.16"),
        "right UKF": ("2.94", "0.26", "1.14", "1.46"),
        "IEKF": ("2.93", "0.25", "1.14", "1.56"),
    },
    "October 2019": {
        "EKF": ("3.20", "0.82", "11.35", "276.29"),
        "UKF": ("2.89", "0.29", "2.16", "3.27"),
        "left UKF": ("2.84", "0.24", "1.07", "1.11"),
        "right UKF": ("2.83", "0.24", "1.08", "1.16"),
        "IEKF": ("2.83", "0.24", "1.14", "1.37"),
    },
}
"""Printed numbers in the order of `QUANTITIES`, by printing and filter."""
