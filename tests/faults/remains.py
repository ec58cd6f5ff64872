"""What runs leave behind: files, and processes."""

from __future__ import annotations

import hashlib
import json
import subprocess
import time
from pathlib import Path
from typing import Final

from tests.processes import LONG

TIMES: Final = ("started", "flight", "checksum", "commit")
"""Entries of a manifest that differ from run to run, and what is committed meanwhile."""


def digests(folder: Path) -> dict[str, str]:
    """Digest the chunks of a run folder, by name."""
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


def every_byte(folder: Path) -> dict[str, str]:
    """Digest every file of a folder but the lock, by path."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(files)}


def contents(folder: Path) -> dict[str, str]:
    """Digest all files of a finished run, by path; the manifest without times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        content = path.read_bytes() if path.is_file() else b"folder"
        if path.name == "manifest.json":
            entries = json.loads(content).items()
            content = json.dumps({key: entry for key, entry in entries if key not in TIMES}).encode()
        found[str(path.relative_to(folder))] = hashlib.sha256(content).hexdigest()
    return found


def processes_of(session: int) -> list[int]:
    """List the processes of a session."""
    listed = subprocess.run(["ps", "-o", "pid=", "--sid", str(session)], capture_output=True, text=True)
    return [int(each) for each in listed.stdout.split()]


def workers_of(session: int) -> list[int]:
    """List the worker processes of a session, of joblib and of dask."""
    listed = subprocess.run(["ps", "-ww", "-o", "pid=,args=", "--sid", str(session)], capture_output=True, text=True)
    lines = [line for line in listed.stdout.splitlines() if "LokyProcess" in line or "spawn_main" in line]
    return [int(line.split()[0]) for line in lines]


def left_of(session: int, seconds: float = LONG) -> list[str]:
    """List processes of a session that are still there after some seconds; return as soon as there are none."""
    deadline = time.monotonic() + seconds
    while True:
        listed = subprocess.run(["ps", "-o", "pid=,stat=,args=", "--sid", str(session)], capture_output=True, text=True)
        alive = [line for line in listed.stdout.splitlines() if line.split()[1][0] != "Z"]
        if not alive or time.monotonic() > deadline:
            return alive
        time.sleep(0.05)
