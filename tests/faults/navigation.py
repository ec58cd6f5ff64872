"""Campaigns of inertial navigation with a trajectory file, whose runs have three chunks and take a second."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import pytest

from mcnav.config.read import read_campaign
from mcnav.workflow.run import Run, run_campaign
from tests.faults.kinds import small_summaries
from tests.faults.remains import digests
from tests.faults.scenarios import OnAdvance
from tests.unit.config.test_trajectory_file import flight, write_csv

SECONDS: Final = 20.0
"""Duration of the flight."""

FREE: Final = """
seed = 5
[scenario]
type = "ins"
trajectory = "flight.csv"
[imu.gyro]
angle_random_walk = "0.01 deg/sqrt(h)"
[errors]
position = "5 m"
velocity = "0.1 m/s"
tilt = "0.1 mrad"
heading = "0.5 mrad"
"""

AIDED: Final = (
    FREE
    + """
[[aiding]]
type = "gnss"
interval = "5 s"
position = "3 m"
[filter]
estimates = ["position", "velocity", "attitude"]
"""
)

KINDS: Final = {
    "free": (FREE, "ensemble", 4_200, "samples"),
    "free, summary": (FREE, "ensemble", 4_200, "summary"),
    "aided": (AIDED, "ensemble", 150, "samples"),
    "aided, summary": (AIDED, "ensemble", 150, "summary"),
}
"""Campaign, engine, samples and store of each kind."""

BOTH: Final = ("free", "aided, summary")
"""Kinds with and without a filter, of stored samples and of a summary, whose chunks are simulated in this process."""

CHUNKS: Final = 3
HALF: Final = 32
"""Half of the samples of a summary's chunk."""


def write_navigation(folder: Path, kind: str) -> Path:
    """Write the campaign of a kind beside its trajectory; return its path."""
    described, _, samples, store = KINDS[kind]
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "flight.csv", flight(SECONDS, rate=2.0))
    (folder / "navigation.toml").write_text(f'samples = {samples}\nstore = "{store}"\n{described}')
    return folder / "navigation.toml"


def run_navigation(campaign: Path, kind: str, folder: Path, **options: Any) -> Run:
    """Run a campaign of `write_navigation` in this process, without its report unless ``report`` is true."""
    with small_summaries(HALF):
        return run_campaign(read_campaign(campaign), folder, KINDS[kind][1], 1, **{"report": False, **options})


def undisturbed_chunks(kind: str, place: Path) -> dict[str, str]:
    """Digest the chunks of a run that nothing happens to."""
    run_navigation(write_navigation(place, kind), kind, place / "run")
    found = digests(place / "run")
    assert len(found) == CHUNKS
    return found


class Stopped(Exception):
    """A run that was broken off."""


def break_off(campaign: Path, kind: str, folder: Path) -> None:
    """Leave a run with one chunk."""

    def stop() -> None:
        raise Stopped

    with pytest.raises(Stopped):
        run_navigation(campaign, kind, folder, progress=OnAdvance(stop))
    assert len(digests(folder)) == 1
