"""Files that a path to none may have been meant for: in its folder, in ``campaigns/``, and among the examples."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from mcnav.entries.examples import FOLDER, begins_with_number, example_name, examples
from mcnav.errors import CampaignError, did_you_mean, near_names

MOST_FILES: Final = 1_000
"""Files and folders of a folder that are looked at."""


def near_file(path: Path, endings: Sequence[str]) -> str:
    """Ask for the file that may have been meant, as the end of a message; empty when none is near.

    A number means the file that begins with it, ``19`` for ``campaigns/19_flight_with_gnss.toml``, and a name may be
    without its ending or its folder.

    Parameters
    ----------
    path : Path
        Without a file.
    endings : sequence of str
        Of the files that would do, such as ``.toml``.
    """
    folders = dict.fromkeys((path.parent, Path(FOLDER)))
    files = [folder / name for folder in folders for name in _names(folder, tuple(endings))]
    name = path.name
    same = [file for file in files if name in (file.name, file.stem) or begins_with_number(file.stem, name)]
    near = [file for file in files if file.stem in near_names(path.stem, [file.stem for file in files])]
    if chosen := (same or near)[:1]:
        return did_you_mean([str(chosen[0])])
    if ".toml" not in endings:
        return ""
    try:
        known = example_name(path.name.removesuffix(".toml"), list(examples()))
    except CampaignError:
        return ""
    return "" if known is None else f"; mcnav demo {path.stem} runs the example {known}, --copy FOLDER copies it"


def _names(folder: Path, endings: tuple[str, ...]) -> list[str]:
    """List the files of a folder with one of the endings; none where it cannot be read."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in islice(entries, MOST_FILES) if entry.name.endswith(endings))
    except (OSError, ValueError):
        return []
