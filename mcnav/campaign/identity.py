"""What a run's numbers depend on: two runs with one identity have the same samples, bit for bit."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

from mcnav.campaign.file import Campaign
from mcnav.campaign.files import plain
from mcnav.campaign.folder import RunFolder
from mcnav.campaign.problems import RunFolderError

LIBRARIES: Final = ("numpy", "scipy", "numba", "pyarrow")
SHOWN: Final = 3
"""Differences that a refusal names."""


def versions() -> dict[str, str]:
    """The program, the interpreter and the libraries that results depend on."""
    return {
        "mcnav": version("mcnav"),
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }


def identity_of(campaign: Campaign, engine: str) -> dict[str, Any]:
    """The resolved campaign, the engine and the versions, as the manifest keeps them."""
    return {"campaign": plain(campaign.resolved), "engine": engine, "versions": versions()}


def digest(identity: Mapping[str, Any]) -> str:
    """SHA-256 of an identity: every stored chunk carries it."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def refuse_foreign(folder: RunFolder) -> None:
    """Raise `RunFolderError` when a folder holds files but no run of this program."""
    foreign = folder.foreign()
    if foreign and folder.manifest() is None:
        raise RunFolderError(
            f"{folder.path}: holds {foreign[0]!r}, which is not of a run; choose another folder with --out"
        )


def refuse_changed(folder: RunFolder, identity: Mapping[str, Any]) -> None:
    """Raise `RunFolderError` when a folder holds another run: its results are neither mixed with nor overwritten."""
    earlier = folder.manifest()
    if earlier is None:
        return
    before, now = _flat(earlier.get("identity", {})), _flat(plain(identity))
    changed = [
        f"{key} was {before.get(key, 'absent')}, is {now.get(key, 'absent')}"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key)
    ]
    if changed:
        more = f" and {len(changed) - SHOWN} more" if len(changed) > SHOWN else ""
        raise RunFolderError(
            f"{folder.path}: holds the results of another run ({'; '.join(changed[:SHOWN])}{more}); "
            "--fresh replaces them, --out writes elsewhere"
        )


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, Mapping):
        return {key: leaf for name, entry in value.items() for key, leaf in _flat(entry, f"{prefix}{name}.").items()}
    return {prefix.removesuffix(".").removeprefix("campaign."): value}
