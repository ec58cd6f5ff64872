"""The peers beside each other: every one measured in processes of its own, and its cheapest setting at an accuracy."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.install import without_paths
from tests.benchmarks.peers import PEERS, Entry
from tests.benchmarks.spawn import measured

TARGETS: Final = (1e-5, 1e-6)
"""Largest errors, as shares of sigma, at which peers are compared."""

NOTES: Final = Path(sys.prefix) / "benched"
"""What `tests.benchmarks.install` noted."""

CORES: Final = 2


def cheapest(settings: Iterable[Mapping[str, Any]], target: float) -> Mapping[str, Any] | None:
    """The setting that costs least of those whose error is at most a target; None when there is none."""
    good = [each for each in settings if each.get("error") is not None and each["error"] <= target]
    return min(good, key=lambda each: each["microseconds"], default=None)


def reason(entry: Entry, found: str, notes: Mapping[str, str]) -> str:
    """Why a peer is missing: what its installation said, or else its import."""
    return next(
        (why for requirement, why in notes.items() if requirement.startswith(entry.package)), without_paths(found)
    )


def installation_notes(path: Path = NOTES) -> dict[str, str]:
    """Requirement to reason, of what would not install."""
    return dict(json.loads(path.read_text())) if path.exists() else {}


def measure(
    name: str, case: Path, folder: Path, seconds: float, notes: Mapping[str, str], measure_in_child: Any = measured
) -> dict[str, Any]:
    """Everything about one peer: its sweep on one core; then, on two, start-up and throughput at its best setting."""
    entry = PEERS[name]
    row: dict[str, Any] = {"peer": name, "package": entry.package, "method": entry.method}
    sweep = measure_in_child(folder, name, case, 1, seconds)
    if "missing" in sweep:
        return row | {"missing": reason(entry, sweep["missing"], notes)}
    if "failed" in sweep:
        return row | {"failed": without_paths(sweep["failed"])}
    chosen = {target: cheapest(sweep["settings"], target) for target in TARGETS}
    settings = [each["setting"] for each in chosen.values() if each is not None][-1:]
    # compiled code is on the disk by now, for those that keep it there: a start as it is from the second time on
    both = measure_in_child(folder, name, case, CORES, seconds, settings or [sweep["settings"][-1]["setting"]])
    on_both = {each["setting"]: each for each in both.get("settings", ())}
    at = {f"{target:.0e}": None if each is None else _at(each, on_both) for target, each in chosen.items()}
    return row | {
        "knob": sweep["knob"],
        "settings": sweep["settings"],
        "at": at,
        "first_start_up": sweep["start_up"],
        "start_up": both.get("start_up"),
        "megabytes": sweep["megabytes"],
    }


def _at(chosen: Mapping[str, Any], on_both: Mapping[float, Mapping[str, Any]]) -> dict[str, Any]:
    """A chosen setting, with its throughput on all cores."""
    spent = on_both.get(chosen["setting"], {}).get("microseconds")
    return {**chosen, "two_cores_samples_per_second": None if spent is None else 1e6 / spent}


def measure_all(
    cases: Mapping[int, Path], folder: Path, names: Sequence[str], seconds: float, told: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Rows of all peers on all cases."""
    notes, rows = installation_notes(), []
    for number, case in cases.items():
        for name in names:
            row = measure(name, case, folder, seconds, notes) | {"trajectory": number}
            rows.append(row)
            told(f"trajectory {number}, {name}: {_outcome(row)}")
    return rows


def _outcome(row: Mapping[str, Any]) -> str:
    for wrong in ("missing", "failed"):
        if wrong in row:
            return f"{wrong}: {row[wrong]}"
    found = row["at"][f"{TARGETS[-1]:.0e}"]
    return "does not reach 1e-6 of sigma" if found is None else f"{found['microseconds']:.3g} us a sample"
