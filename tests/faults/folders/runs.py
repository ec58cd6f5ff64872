"""Finished runs, and what lies outside of their folders: see `Outside`."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.workflow.run import run_campaign
from tests.conftest import TWO_ERRORS, campaign
from tests.faults import grammar
from tests.faults.scenarios import VECTORISED, write_campaign

SEGMENTS: Final = {
    "rate": "1 Hz",
    "start": {"latitude": "45 deg", "longitude": "9 deg", "altitude": "500 m", "course": "80 deg", "speed": "90 m/s"},
    "segments": [{"straight": "40 s"}, {"turn": "45 deg"}],
}


FREE: Final[dict[str, Any]] = {
    "samples": 70,
    "scenario": {"type": "ins", "trajectory": SEGMENTS},
    "imu": {
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.003 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug"},
    },
    "errors": {"position": "5 m"},
}


AIDED: Final = FREE | {
    "aiding": [{"type": "gnss", "interval": "5 s", "position": "3 m", "outages": [["20 s", "30 s"]]}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias"]},
    "accept": {"r95": [{"outputs": ["position_north", "position_east"], "below": "20 m", "during": "outages"}]},
}


def finished_runs(
    place: Path, names: Sequence[str] = ("reentry", "summary", "free", "aided", "own")
) -> dict[str, Path]:
    """Run small campaigns of some sorts into folders, and return these by name."""
    reads = f"open({str(place / 'own' / 'table.txt')!r}).close()\n\nclass Mine:"
    own = write_campaign(place / "own", "pass", VECTORISED.replace("class Mine:", reads), samples=70)
    (place / "own" / "table.txt").write_text("2")
    (place / "flight.csv").write_bytes(grammar.csv_of(grammar.flight(random.Random(4), 61, 1.0), ","))
    file = {"scenario": {"type": "ins", "trajectory": "flight.csv"}, "store": "summary"}
    campaigns: dict[str, Callable[[], Campaign]] = {
        "reentry": lambda: campaign(4, errors=TWO_ERRORS, samples=70),
        "summary": lambda: campaign(4, errors=TWO_ERRORS, samples=300, store="summary"),
        "free": lambda: parse_campaign(FREE | file, str(place / "free.toml"), "free"),
        "aided": lambda: parse_campaign(AIDED, str(place / "aided.toml"), "aided"),
        "own": lambda: read_campaign(own),
    }
    for name in names:
        run_campaign(campaigns[name](), place / "runs" / name, "reference" if name == "reentry" else None, 1)
    return {name: place / "runs" / name for name in names}


@dataclass(frozen=True)
class Outside:
    """Files beside a run folder that nothing may read or write, and a mark of what was executed."""

    folder: Path

    @property
    def mark(self) -> Path:
        """File that code from a hostile folder makes when it is executed."""
        return self.folder.with_name("executed")

    @property
    def code(self) -> str:
        """Python code that leaves the mark."""
        return f"open({str(self.mark)!r}, 'w').close()\n"

    def files(self) -> list[Path]:
        """Files, a folder and a run folder's manifest."""
        return sorted(self.folder.iterdir())

    def fill(self) -> None:
        """Write the files."""
        self.folder.mkdir()
        (self.folder / "secret.csv").write_text("a\n1\n2\n3\n")
        (self.folder / "secret.json").write_text('{"secret": 1}')
        (self.folder / "evil.py").write_text(self.code)
        (self.folder / "inner").mkdir()
        (self.folder / "inner" / "secret.html").write_text("secret")
