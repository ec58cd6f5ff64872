"""Tables of a filter's errors, sigmas or covariances, and innovations, read from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.files.lines import place_of_row
from mcnav.judgement.error_table import ErrorTable
from mcnav.logs.log_error import LogError, listed
from mcnav.logs.tables import read_table

BEGINNINGS: Final[Mapping[str, tuple[str, ...]]] = {
    "innovation_sigma": ("innovation_sigma_", "s_nu_"),
    "innovation": ("innovation_", "nu_"),
    "sigma": ("sigma_", "s_"),
    "covariance": ("covariance_", "p_"),
    "error": ("error_", "e_"),
}
"""Beginnings of the names of columns, the longest first."""

EXPECTED: Final = "time, error_NAME with sigma_NAME or covariance_NAME_NAME, innovation_NAME with innovation_sigma_NAME"


def read_error_table(path: Path) -> ErrorTable:
    """Read a table of errors.

    Columns are ``time``, ``error_NAME`` with ``sigma_NAME``, ``covariance_NAME_OTHER`` of two errors,
    ``innovation_NAME`` with ``innovation_sigma_NAME``; or ``e_``, ``s_``, ``p_``, ``nu_``, ``s_nu_``.
    """
    table = read_table(path)
    kinds: dict[str, dict[str, Array]] = {kind: {} for kind in BEGINNINGS}
    times: Array | None = None
    for column in table.columns:
        name = str(column).partition("[")[0].strip()
        try:
            values = np.asarray(table[column].to_numpy(), dtype=float)
        except ValueError:
            continue
        if name.lower() in ("time", "t"):
            times = values
            continue
        for kind, beginnings in BEGINNINGS.items():
            beginning = next((beginning for beginning in beginnings if name.lower().startswith(beginning)), None)
            if beginning is not None:
                kinds[kind][name[len(beginning) :]] = values
                break
    if times is None:
        raise LogError(path, f"has no column time; expected {EXPECTED}")
    rising = np.diff(times) > 0.0
    if not np.all(rising):
        raise LogError(path, f"falls or repeats in {place_of_row(path, int(np.argmin(rising)) + 1)}", "time")
    errors, groups = _errors(path, kinds)
    innovations = {
        name: (values, _positive(path, f"innovation_sigma_{name}", kinds["innovation_sigma"].get(name)))
        for name, values in kinds["innovation"].items()
    }
    if not errors and not innovations:
        raise LogError(
            path, f"has the columns {listed([str(column) for column in table.columns])}; expected {EXPECTED}"
        )
    return ErrorTable(times, errors, groups, innovations)


def _errors(
    path: Path, kinds: Mapping[str, Mapping[str, Array]]
) -> tuple[dict[str, tuple[Array, Array]], dict[str, tuple[tuple[str, ...], Array]]]:
    """Return the errors with their sigmas, and those that have covariances as a group."""
    names, covariances = list(kinds["error"]), kinds["covariance"]
    errors = {}
    for name, values in kinds["error"].items():
        sigma = kinds["sigma"].get(name)
        if sigma is None and f"{name}_{name}" in covariances:
            sigma = np.sqrt(np.maximum(covariances[f"{name}_{name}"], 0.0))
        errors[name] = (values, _positive(path, f"sigma_{name}", sigma))
    pairs = {(a, b): f"{a}_{b}" for a in names for b in names if a != b and f"{a}_{b}" in covariances}
    members = tuple(name for name in names if any(name in pair for pair in pairs))
    if not members:
        return errors, {}
    matrix = np.zeros((len(errors[members[0]][0]), len(members), len(members)))
    for row, name in enumerate(members):
        matrix[:, row, row] = errors[name][1] ** 2
        for column, other in enumerate(members):
            if (name, other) in pairs:
                matrix[:, row, column] = matrix[:, column, row] = covariances[pairs[name, other]]
    definite = np.linalg.eigvalsh(matrix)[:, 0] > 0.0
    if not np.all(definite):
        raise LogError(path, f"is not a covariance in {place_of_row(path, int(np.argmin(definite)))}", "covariance")
    return errors, {" and ".join(members): (members, matrix)}


def _positive(path: Path, name: str, values: Array | None) -> Array:
    """Return sigmas that are all above zero."""
    if values is None:
        raise LogError(path, f"has no column {name}; expected {EXPECTED}")
    wrong = ~(values > 0.0) & np.isfinite(values)
    if np.any(wrong):
        row = int(np.argmax(wrong))
        raise LogError(path, f"got {values[row]:g} in {place_of_row(path, row)}; expected sigmas above zero", name)
    return values
