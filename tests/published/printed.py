"""The printed tables of NASA TN D-1772 (1963), transcribed; rows are runs, columns the four final errors."""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
COLUMNS = ("h_ef_km", "range_ef_km", "hdot_ef_m_s", "range_rate_ef_m_s")
NAMES = ("altitude", "range", "altitude rate", "range rate")
TO_PRINTED = np.array([1e-3, 1e-3, 1.0, 1.0])
"""From SI units to those of the tables."""


def _rows(name: str) -> list[dict[str, str]]:
    with (DATA / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@lru_cache
def final_errors(table: str) -> np.ndarray:
    """A table of final errors, shape (runs, 4), in the units printed."""
    rows = [row for row in _rows("tn_d1772_final_errors.csv") if row["table"] == table]
    assert [int(row["run"]) for row in rows] == list(range(1, len(rows) + 1))
    return np.array([[float(row[column]) for column in COLUMNS] for row in rows])


@lru_cache
def trajectories() -> dict[int, dict[str, str]]:
    """Table I by trajectory."""
    return {int(row["trajectory"]): row for row in _rows("tn_d1772_trajectories.csv")}


TABLE_II = {1: "II(a)", 2: "II(b)", 3: "II(c)", 4: "II(d)", 5: "II(e)", 6: "II(f)", 7: "II(g)"}
