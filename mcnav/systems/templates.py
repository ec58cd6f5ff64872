"""Templates of campaigns: files ``new_TYPE.toml`` in the folders of the systems.

The command line lists their types whenever it starts, so that this module imports nothing else.
"""

from __future__ import annotations

from pathlib import Path


def templates() -> dict[str, Path]:
    """Return the template of each type of scenario that has one, by type."""
    paths = sorted(Path(__file__).parent.glob("*/new_*.toml"))
    return {path.stem.removeprefix("new_"): path for path in paths}
