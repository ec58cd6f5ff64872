"""The tables of NASA TN D-1772 (1963) as printed, transcribed in ``data/``."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Final

COLUMNS: Final = ("h_ef_km", "range_ef_km", "hdot_ef_m_s", "range_rate_ef_m_s")
NAMES: Final = ("altitude", "range", "altitude rate", "range rate")
UNITS: Final = ("km", "km", "m/s", "m/s")
TO_PRINTED: Final = (1e-3, 1e-3, 1.0, 1.0)
"""From SI units to those of the tables."""

SUMS: Final = ("algebraic", "ic", "equipment", "all")


@dataclass(frozen=True)
class Correction:
    """A printed number that the transcription changes, and why."""

    table: str
    row: str
    column: str
    scanned: str
    used: str
    reason: str


CORRECTIONS: Final = (
    Correction("II(b)", "3: altitude rate", "altitude", "-0.46", "0.46",
               "only with this sign do the ten runs sum to the printed 10.58, and near run 11 (10.56)"),
    Correction("II(b)", "3: altitude rate", "range", "2.91", "-2.91",
               "only with this sign do the ten runs sum to the printed −23.40, and near run 11 (−23.39)"),
)  # fmt: skip


def _rows(name: str) -> list[dict[str, str]]:
    text = files("mcnav.validation.reproduce.tn_d1772").joinpath("data", name).read_text(encoding="utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


@lru_cache
def final_errors(table: str) -> tuple[tuple[str, ...], ...]:
    """Read a table of final errors: a row for each run from 1 on, four entries each, as printed."""
    rows = [row for row in _rows("tn_d1772_final_errors.csv") if row["table"] == table]
    if [int(row["run"]) for row in rows] != list(range(1, len(rows) + 1)):
        raise ValueError(f"table {table} of the transcription has not every run once")
    return tuple(tuple(row[column] for column in COLUMNS) for row in rows)


@lru_cache
def sums(table: str) -> dict[str, tuple[str, ...]]:
    """Read the summary rows under a table: `SUMS` to four entries, as printed."""
    rows = [row for row in _rows("tn_d1772_printed_sums.csv") if row["table"] == table]
    return {row["sum"]: tuple(row[column] for column in COLUMNS) for row in rows}


@lru_cache
def trajectories() -> dict[int, dict[str, str]]:
    """Read Table I and the lift laws by trajectory."""
    return {int(row["trajectory"]): row for row in _rows("tn_d1772_trajectories.csv")}
