"""New campaigns and scenarios from skeletons that run as they stand."""

from __future__ import annotations

import keyword
import re
from importlib.resources import files
from pathlib import Path
from typing import Final

from mcnav.errors import CampaignError, Problem
from mcnav.files import write_whole

TYPES: Final = ("reentry", "cruise", "hover")

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")


def _skeleton(name: str, changes: dict[str, str]) -> str:
    text = files("mcnav.config.templates").joinpath(name).read_text(encoding="utf-8")
    for before, after in changes.items():
        text = text.replace(before, after)
    return text


def _write(folder: Path, contents: dict[str, str]) -> list[Path]:
    """Write files that are all not there yet."""
    paths = {folder / name: text for name, text in contents.items()}
    there = [path for path in paths if path.exists()]
    if there:
        raise CampaignError([Problem(str(path), "", "is there already; choose another name") for path in there])
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in paths.items():
        write_whole(path, text.encode())
    return list(paths)


def _checked(name: str) -> None:
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise CampaignError([Problem(name, "", "is no name for files: a letter, then letters, digits and _")])


def new_campaign(name: str, folder: Path, kind: str) -> list[Path]:
    """Write a campaign file of one of `TYPES`; the paths written.

    Raises
    ------
    CampaignError
        When the name will not do, or the file is there already.
    """
    _checked(name)
    return _write(folder, {f"{name}.toml": _skeleton(f"{kind}.toml", {"NAME": name})})


def new_scenario(name: str, folder: Path) -> list[Path]:
    """Write a scenario, a campaign that flies it and a test of it; the paths written, the campaign second.

    Raises
    ------
    CampaignError
        When the name will not do, or a file is there already.
    """
    _checked(name)
    changes = {"NAME": name, "CLASS": "".join(part[:1].upper() + part[1:] for part in name.split("_"))}
    contents = {
        f"{name}.py": "scenario.py.txt",
        f"{name}.toml": "scenario.toml",
        f"test_{name}.py": "test_scenario.py.txt",
    }
    return _write(folder, {file: _skeleton(skeleton, changes) for file, skeleton in contents.items()})
