"""Changes by name, and folders changed by them."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from tests.faults.folders.file_changes import campaigns, code, links, missing, mixed, paths, special_files
from tests.faults.folders.json_changes import (
    json_keys,
    json_large,
    json_numbers,
    json_text,
    json_values,
    renamed,
    units,
)
from tests.faults.folders.parquet_changes import (
    claims,
    parquet_bits,
    parquet_bombs,
    parquet_columns,
    parquet_marks,
    payloads,
)
from tests.faults.folders.runs import Outside

Change = Callable[[random.Random, Path, Outside], object]


CHANGES: Final[dict[str, Change]] = {
    each.__name__: each
    for each in (
        json_values,
        json_keys,
        json_numbers,
        json_large,
        json_text,
        renamed,
        units,
        paths,
        links,
        special_files,
        missing,
        parquet_bits,
        parquet_columns,
        parquet_marks,
        parquet_bombs,
        claims,
        payloads,
        code,
        campaigns,
        mixed,
    )
}
"""Changes by name."""


def make_hostile(chance: random.Random, kind: str, finished: Path, folder: Path, outside: Outside) -> str:
    """Copy a finished run and change it in one way, now and then in a second; return what was done."""
    shutil.copytree(finished, folder, symlinks=True)
    CHANGES[kind](chance, folder, outside)
    if chance.random() < 0.15:
        second = chance.choice(list(CHANGES))
        try:
            CHANGES[second](chance, folder, outside)
            return f"{finished.name}, {kind}, {second}"
        except Exception:  # what the first has left cannot be changed so
            pass
    return f"{finished.name}, {kind}"
