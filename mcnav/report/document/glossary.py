"""Meanings of words of a report, as `GLOSSARY.md` has them; a page shows them where the words stand."""

from __future__ import annotations

import json
import re
from functools import cache
from typing import Final

from markupsafe import Markup

from mcnav.docs.pages import page_text

HINTED: Final = (
    "NEES", "NIS", "CEP", "R95", "SEP", "DRMS", "paired", "plain", "white", "innovation", "consistent", "optimistic",
    "pessimistic", "dispersion", "exceedance", "common random numbers", "beyond the range",
)  # fmt: skip
"""Words that a page explains: those that a reader of another field would look up."""

ROW: Final = re.compile(r"^\| (?P<words>[^|]+) \| (?P<meaning>.+) \|$", re.MULTILINE)


@cache
def glossary() -> dict[str, str]:
    """Read the meaning of every word; words that stand in one row have the same.

    >>> glossary()["SEP"]
    'radius of the sphere about zero within which half of the errors in three outputs lie'
    >>> glossary()["optimistic"] == glossary()["pessimistic"]
    True
    """
    return {
        word: row["meaning"].replace("`", "")
        for row in ROW.finditer(page_text("glossary"))
        for word in row["words"].split(", ")
    }


@cache
def hints() -> Markup:
    """Return the words that a page explains and their meanings, as JSON for its script."""
    known = glossary()
    text = json.dumps({word: known[word] for word in HINTED}, ensure_ascii=False)
    return Markup(text.replace("<", "\\u003c"))
