"""Commands as the shell at hand reads them."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from collections.abc import Iterable
from typing import Final

_PLAIN: Final = re.compile(r"[\w+=:./\\-]+", re.ASCII)
"""Words that mean themselves in cmd and in PowerShell."""


def quote_word(word: str, system: str = os.name) -> str:
    """Quote a word of a command: for a POSIX shell, or for cmd and PowerShell.

    >>> quote_word("my runs/a", "posix"), quote_word("my runs/a", "nt"), quote_word("a&b", "nt")
    ("'my runs/a'", '"my runs/a"', '"a&b"')
    """
    if system != "nt":
        return shlex.quote(word)
    quoted = subprocess.list2cmdline([word])
    return quoted if _PLAIN.fullmatch(word) or quoted.startswith('"') else f'"{quoted}"'


def join_words(words: Iterable[str], system: str = os.name) -> str:
    """Join the words of a command.

    >>> join_words(["mcnav", "run", "my campaigns/one.toml"], "nt")
    'mcnav run "my campaigns/one.toml"'
    """
    return " ".join(quote_word(word, system) for word in words)
