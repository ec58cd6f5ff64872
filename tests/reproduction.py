"""The reproduction of NASA TN D-1772 as its command writes it."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from mcnav.validation.reproduce.tn_d1772 import page
from mcnav.validation.reproduce.tn_d1772.tables import Cell
from tests.commands import invoke


@dataclass(frozen=True)
class Reproduction:
    """One run of the command: its numbers, its folder, and what it printed."""

    cells: list[Cell]
    folder: Path
    printed: str


def reproduce(folder: Path) -> None:
    """Run the command in a folder, and keep beside its files what it computes and prints."""
    cells: list[Cell] = []
    write = page.write_reproduction

    def keep(path: Path) -> tuple[list[Cell], list[Path]]:
        found, files = write(path)
        cells.extend(found)
        return found, files

    (folder / "written").mkdir(parents=True)
    with patch.object(page, "write_reproduction", keep):
        finished = invoke("reproduce", "tn-d1772", "--out", "written", cwd=folder)
    assert finished.returncode == 0, finished.stderr
    (folder / "kept").write_bytes(pickle.dumps((cells, finished.stdout)))


def reproduced(folder: Path) -> Reproduction:
    """Return what `reproduce` has kept."""
    cells, printed = pickle.loads((folder / "kept").read_bytes())
    return Reproduction(cells, folder / "written", printed)
