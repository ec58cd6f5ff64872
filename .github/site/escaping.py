"""Text in Markdown."""

from __future__ import annotations

import re


def escape(text: str) -> str:
    """Let a text stand in Markdown, and in a cell of its tables, as it is.

    An underscore within a word stands as it is, too.
    """
    return re.sub(r"([\\`*\[\]<>|]|(?<!\w)_|_(?!\w))", r"\\\1", text)
