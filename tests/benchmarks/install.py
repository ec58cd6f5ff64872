"""Installs the extras that benchmarks need, each peer by itself, and notes what would not install, and why.

    python -m tests.benchmarks.install NOTES

NOTES is a JSON file: requirement to reason, empty where all went well. One that fails does not stop the others.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parent.parent.parent
EXTRAS: Final = ("bench", "bench-from-source")
UNPUBLISHED: Final = ("gnss-ins-sim",)
"""What the registry does not have: measured where it was installed by hand, otherwise named with the reason."""

LONGEST_REASON: Final = 200


def requirements(project: Path = ROOT / "pyproject.toml") -> list[str]:
    """Return those of all extras, and what no extra can name."""
    extras = tomllib.loads(project.read_text())["project"]["optional-dependencies"]
    return [*(requirement for extra in EXTRAS for requirement in extras[extra]), *UNPUBLISHED]


def install(requirement: str) -> str | None:
    """Install one; None, or why it would not."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    command += ["--constraint", str(ROOT / ".ci" / "constraints.txt"), requirement]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return None if done.returncode == 0 else reason(done.stderr + done.stdout)


def reason(said: str) -> str:
    """The first error in what pip said, with the line that follows a bare heading, paths left out.

    >>> reason("Building\\n  CMake Error at CMakeLists.txt:3 (project):\\n    No Fortran compiler\\n  more")
    'CMake Error at CMakeLists.txt:3 (project): No Fortran compiler'
    """
    lines = [line.strip() for line in said.splitlines() if line.strip() and not line.startswith("WARNING")]
    first = next((place for place, line in enumerate(lines) if re.search(r"\w+ Error\b|^ERROR", line)), None)
    if first is None:
        return "pip gave no reason"
    told = " ".join(lines[first : first + 2]) if lines[first].endswith(":") else lines[first]
    return without_paths(told)[:LONGEST_REASON]


def without_paths(told: str) -> str:
    """A message that names no place on this machine."""
    return re.sub(r"(?<![\w.])/\S+", "…", told)


def main(notes: Path) -> None:
    """Install everything and write the notes."""
    reasons = {requirement: install(requirement) for requirement in requirements()}
    for requirement, why in reasons.items():
        print(f"{requirement}: {why or 'installed'}")
    notes.write_text(json.dumps({requirement: why for requirement, why in reasons.items() if why}, indent=2) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
