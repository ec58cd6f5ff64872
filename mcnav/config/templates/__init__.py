"""Templates of campaigns and scenarios, which run without changes."""

from __future__ import annotations

import keyword
import re
from importlib.resources import files
from pathlib import Path
from typing import Final

from mcnav.errors import CampaignError, Problem
from mcnav.files.whole import write_whole
from mcnav.systems.templates import templates

DIRECTIVES: Final = "#:schema ./mcnav.schema.json\n#:tombi schema.strict = false\n\n"
"""First lines of a campaign file: the schema for editors; tombi is not to refuse keys that it finds in no branch."""

USERS: Final = "systems/user/templates"
"""Templates of systems of the user."""

LOOPS: Final = "systems/closed_loop/templates"
"""Templates of closed loops."""

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")


def fill_in(template: str, changes: dict[str, str]) -> str:
    """Read a template, a file of the package, and replace its placeholders."""
    text = files("mcnav").joinpath(template).read_text(encoding="utf-8")
    for before, after in changes.items():
        text = text.replace(before, after)
    return text


def write_new(folder: Path, contents: dict[str, str]) -> list[Path]:
    """Write files, none of which exists yet."""
    paths = {folder / name: text for name, text in contents.items()}
    existing = [path for path in paths if path.exists()]
    if existing:
        raise CampaignError([Problem(str(path), "", "exists already; choose another name") for path in existing])
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in paths.items():
        write_whole(path, (DIRECTIVES + text if path.suffix == ".toml" else text).encode())
    return list(paths)


def place_of(name: str, folder: Path) -> tuple[Path, str]:
    """Return the folder and the stem of new files from a name, or a path with or without ``.toml``.

    Raises `CampaignError` when the name cannot be used.
    """
    inside, _, file = name.rpartition("/")
    stem = file.removesuffix(".toml")
    _check_name(stem, name)
    return folder / inside, stem


def _check_name(stem: str, name: str | None = None) -> None:
    if not _NAME.fullmatch(stem) or keyword.iskeyword(stem):
        message = "cannot name a file; expected a letter, then letters, digits and _"
        raise CampaignError([Problem(stem if name is None else name, "", message)])


def new_campaign(name: str, folder: Path, kind: str) -> list[Path]:
    """Write a campaign file from the template of a type of scenario; return the path written, in a list.

    Raises `CampaignError` when the name cannot be used, or the file exists.
    """
    _check_name(name)
    return write_new(folder, {f"{name}.toml": templates()[kind].read_text(encoding="utf-8").replace("NAME", name)})


def new_scenario(name: str, folder: Path, stochastic: bool = False, closed_loop: bool = False) -> list[Path]:
    """Write a scenario, with noise or without or a closed loop, its campaign and its test; return the three paths.

    Raises `CampaignError` when the name cannot be used, or a file exists.
    """
    _check_name(name)
    changes = {"NAME": name, "CLASS": "".join(piece[:1].upper() + piece[1:] for piece in name.split("_"))}
    template = "closed_loop" if closed_loop else "stochastic_scenario" if stochastic else "scenario"
    room = LOOPS if closed_loop else USERS
    contents = {
        f"{name}.py": f"{template}.py.txt",
        f"{name}.toml": f"{template}.toml",
        f"test_{name}.py": f"test_{template}.py.txt",
    }
    return write_new(folder, {file: fill_in(f"{room}/{text}", changes) for file, text in contents.items()})
