"""The schema as a file beside campaign files, which name it in their first line.

Language servers for TOML look for a comment ``#:schema`` with a path that is relative to the file, so that the schema
goes with the campaigns and needs neither a network nor a setting of the editor.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from mcnav.config.json_schema.campaign import TITLE, campaign_schema
from mcnav.files.whole import write_texts

SCHEMA_FILE: Final = "mcnav.schema.json"


def schema_text() -> str:
    """Return the schema of campaign files as a file."""
    return json.dumps(campaign_schema(), indent=1, ensure_ascii=False) + "\n"


def write_schema(folder: Path) -> list[Path]:
    """Write the schema into a folder of campaigns; return the path in a list, which is empty if nothing changes.

    An earlier version is replaced; a file of this name that is no such schema stays.
    """
    path, text = folder / SCHEMA_FILE, schema_text()
    earlier = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    if earlier == text or (path.exists() and f'"title": "{TITLE}"' not in earlier):
        return []
    return list(write_texts(folder, {path.name: text}))
