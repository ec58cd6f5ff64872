"""What was measured on: processor, cores, versions, date; nothing that names a machine or its owner."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

VECTORS = ("sse2", "avx", "avx2", "avx512f")


def described(packages: Iterable[str]) -> dict[str, Any]:
    """The machine, and the versions of packages (None where one is not installed)."""
    processor = _processor()
    flags = processor.get("flags", "").split()
    return {
        "processor": processor.get("model name", platform.machine()),
        "model": "/".join(processor[key] for key in ("cpu family", "model", "stepping") if key in processor),
        "vectors": [name for name in VECTORS if name in flags][-1:],
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 2),
        "system": platform.system(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in sorted(set(packages))},
        "date": datetime.now(UTC).date().isoformat(),
    }


def sentence(record: Mapping[str, Any]) -> str:
    """Say on what a chapter was measured, and under what load; earlier records lack the processor's model."""
    model = f" {record['model']}" if record.get("model") else ""
    processor = f"{record['processor']}{model} ({', '.join(record['vectors'])}), {record['cores']} cores"
    return (
        f"Measured on {record['date']}: {processor}, Python {record['python']}; load of the machine before the first "
        f"run {record['load']}."
    )


def _processor() -> dict[str, str]:
    """The first processor's entry in /proc/cpuinfo."""
    try:
        lines = Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines()
    except OSError:
        return {}
    return {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
