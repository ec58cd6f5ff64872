"""The flight of this chapter, as a trajectory file and campaigns that anyone can run.

An airliner climbs, turns three times and descends within an hour; a GNSS receiver gives position and velocity once a
second. The unit has constant biases and white noise, so that a filter of 15 states, which believes the true sizes,
models every error there is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.read import read_campaign
from mcnav.systems.ins.scenario import Ins, Navigation
from tests.flights import flight

ROWS_PER_SECOND: Final = 1.0
HOUR: Final = 3600.0


@dataclass(frozen=True)
class Setup:
    """What a campaign of this chapter consists of.

    Attributes
    ----------
    grade : str
        ``navigation`` or ``tactical``: what a filter can model. ``all``: everything that a navigation-grade unit of the
        catalogue has, with bias instabilities and misalignments.
    start, end : float
        Of navigation, s.
    interval : float
        Between GNSS updates, s.
    states : int
        Of the filter: 15, or 9 without biases and 21 with scale factors; zero without aiding.
    samples : int
    """

    grade: str = "navigation"
    start: float = 0.0
    end: float = HOUR
    interval: float = 1.0
    states: int = 15
    samples: int = 1_000


PEERS: Final = Setup(start=300.0, end=900.0)
"""Ten minutes with a climb and a turn of 90 degrees."""

FREE: Final = Setup(grade="all", states=0)
"""An hour without aiding."""

ALL: Final = """\
[imu]
grade = "navigation"

[imu.gyro]
bias_instability = { sigma = "0.003 deg/h", correlation_time = "1 h" }
misalignment = "5 arcsec"

[imu.accelerometer]
misalignment = "10 arcsec"
"""

GRADES: Final = {
    "navigation": (
        ('bias = "0.008 deg/h"', 'scale_factor = "5 ppm"', 'angle_random_walk = "0.002 deg/sqrt(h)"'),
        ('bias = "25 ug"', 'scale_factor = "100 ppm"', 'velocity_random_walk = "20 ug/sqrt(Hz)"'),
    ),
    "tactical": (
        ('bias = "1 deg/h"', 'scale_factor = "150 ppm"', 'angle_random_walk = "0.125 deg/sqrt(h)"'),
        ('bias = "1000 ug"', 'scale_factor = "300 ppm"', 'velocity_random_walk = "50 ug/sqrt(Hz)"'),
    ),
}
"""Bias, scale factor and white noise of gyros and accelerometers."""

ESTIMATES: Final[dict[int, tuple[str, ...]]] = {9: (), 15: ("bias",), 21: ("bias", "scale_factor")}
"""Errors of gyros and accelerometers that filters of so many states estimate."""

INSTRUMENTS: Final = ("gyro", "accelerometer")

INITIAL: Final = {"position": "5 m", "velocity": "0.05 m/s", "tilt": "0.05 mrad", "heading": "0.5 mrad"}


def _instruments(setup: Setup, kinds: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the unit with the constant errors that are estimated."""
    for name, (bias, scale, noise) in zip(INSTRUMENTS, GRADES[setup.grade], strict=True):
        yield f"[imu.{name}]"
        if "bias" in kinds:
            yield bias
        if "scale_factor" in kinds:
            yield scale
        yield from (noise, "")


def campaign_text(setup: Setup, trajectory: str = "flight.csv") -> str:
    """Return the campaign's file.

    >>> 'interval = "1.0 s"' in campaign_text(PEERS)
    True
    """
    kinds = ESTIMATES[setup.states or 15]
    instruments = [ALL] if setup.grade == "all" else list(_instruments(setup, kinds))
    estimated = ["position", "velocity", "attitude", *(f"{name}_{kind}" for kind in kinds for name in INSTRUMENTS)]
    aiding = [
        "[[aiding]]", 'type = "gnss"', f'interval = "{setup.interval!r} s"', 'position = "3 m"', 'velocity = "0.1 m/s"',
        "", "[filter]", f"estimates = {estimated!r}",
    ]  # fmt: skip
    return "\n".join([
        'name = "Benchmark"', f"samples = {setup.samples}", "seed = 1901", "", "[scenario]", 'type = "ins"',
        f'trajectory = "{trajectory}"', f'start = "{setup.start!r} s"', f'end = "{setup.end!r} s"', "", *instruments,
        "[errors]", *(f'{kind} = "{size}"' for kind, size in INITIAL.items()), "",
        *(aiding if setup.states else []), "",
    ])  # fmt: skip


def write_trajectory(path: Path, rate: float = ROWS_PER_SECOND) -> None:
    """Write the flight with so many rows a second."""
    truth = flight()
    times = np.linspace(0.0, HOUR, round(HOUR * rate) + 1)
    latitude, longitude, altitude = truth.geodetic(times).T
    heading, pitch, roll = np.degrees(truth.angles(times)).T
    columns = np.column_stack(
        [times, np.degrees(latitude), np.degrees(longitude), altitude, roll, pitch, np.mod(heading, 360.0)]
    )
    header = "time,lat,lon,alt,roll,pitch,heading"
    np.savetxt(path, columns, "%.15g", delimiter=",", header=header, comments="")


def write_campaign(folder: Path, setup: Setup, name: str = "campaign") -> Path:
    """Write a campaign, and its trajectory where there is none yet."""
    if not (folder / "flight.csv").exists():
        write_trajectory(folder / "flight.csv")
    path = folder / f"{name}.toml"
    path.write_text(campaign_text(setup), encoding="utf-8")
    return path


def read(folder: Path, setup: Setup) -> Campaign:
    """Read a campaign."""
    return read_campaign(write_campaign(folder, setup))


def navigation_of(campaign: Campaign) -> Navigation:
    """Return the navigation of a campaign, its filter included."""
    scenario = campaign.scenario
    if not isinstance(scenario, Ins):
        raise TypeError(f"expected inertial navigation; got {type(scenario).__name__}")
    return scenario.navigation


def draws(campaign: Campaign, count: int) -> Array:
    """Draw the constant errors of the first samples, shape (count, sources)."""
    return np.asarray(campaign.errors.draw(campaign.design, campaign.seed, max(count, campaign.samples), 0, count))
