"""Campaign files as dictionaries: TOML read within bounds, so that no file takes unbounded time or memory."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import tomli_w

from mcnav.entries.near_files import near_file
from mcnav.errors import CampaignError, Problem
from mcnav.files.whole import TextError, text_of
from mcnav.physics.units import printable

Content = dict[str, Any]
"""Content of a TOML file, or of a table in it."""

DOTTED: Final = re.compile(r"(?:[\w-]{1,100}[ \t]?\.[ \t]?){200}")
"""Dotted key of more names than any campaign needs; the parser takes time proportional to their square."""

LARGEST_FILE: Final = 1_000_000
"""Bytes."""

LONGEST_LINE: Final = 60
"""Characters of a line that messages show."""

NOT_READABLE: Final = "is not TOML that can be read: it is nested too deeply, or holds a number of too many digits"


def load_file(path: Path) -> Content:
    """Read a TOML file; `CampaignError` when it cannot be read, is too large, or is not TOML."""
    try:
        if path.is_dir():
            raise IsADirectoryError
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            message = f"is larger than the {LARGEST_FILE} bytes that a campaign file has at most"
        elif not DOTTED.search(text := text_of(content)):
            return tomllib.loads(text)
        else:
            message = NOT_READABLE
    except IsADirectoryError:
        message = "is a folder; expected a campaign file in TOML"
    except FileNotFoundError:
        message = f"no such file; expected a campaign file in TOML{near_file(path, ('.toml',))}"
    except OSError as failure:
        message = f"cannot be read: {failure.strerror or failure}"
    except TextError as wrong:
        message = str(wrong)
    except tomllib.TOMLDecodeError as failure:
        message = f"is not TOML: {_mistake(failure, text)}"
    except (RecursionError, ValueError):
        message = NOT_READABLE
    raise CampaignError([Problem(str(path), "", message)])


def _mistake(failure: tomllib.TOMLDecodeError, text: str) -> str:
    """Return what a reader of TOML refuses, with the line where it is."""
    said, lines = str(failure).replace("Cannot overwrite a value", "a key is given twice"), text.splitlines()
    found = re.search(r"at line (\d+)", said)
    line = lines[int(found[1]) - 1].strip() if found and int(found[1]) <= len(lines) else ""
    return f"{said}: {printable(line, LONGEST_LINE)}" if line else said


def load_mapping(described: Mapping[str, Any], file: str) -> Content:
    """Convert a mapping to the content of the campaign file with the same entries.

    Raises `CampaignError` when TOML cannot represent an entry.
    """
    try:
        return tomllib.loads(tomli_w.dumps(described))
    except (TypeError, ValueError, RecursionError) as failure:
        message = (
            f"contains what no campaign file can ({failure}); use text, numbers, true or false, lists and dictionaries"
        )
        raise CampaignError([Problem(file, "", message)]) from None
