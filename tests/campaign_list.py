"""The page of the campaigns, ``campaigns/README.md``, from their headers: ``python -m tests.campaign_list``.

`make examples` calls this.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Final

from mcnav.entries.examples import question_and_answer

FOLDER: Final = Path(__file__).parent.parent / "campaigns"
PAGE: Final = FOLDER / "README.md"

GROUPS: Final = (
    "NASA TN D-1772",
    "The Story of 84 Minutes",
    "Inertial units, aiding and filters",
    "Functions and closed loops of your own",
)
"""Headings: the two documents' questions first."""

SHORTEST: Final = 24
"""Characters below which the first sentence of an answer takes the second along."""

HEAD: Final = """\
# Campaigns by their question

Each file opens with its question and the whole answer, and is a template: change any line. `mcnav demo NUMBER` runs a
campaign, `mcnav demo --copy FOLDER` copies them all. Written from the files by `python -m tests.campaign_list`.
"""


def group_of(text: str) -> str:
    """Return the heading under which a campaign stands, from its header and the type of its scenario."""
    header, kind = " ".join(question_and_answer(text)), str(tomllib.loads(text)["scenario"]["type"])
    if "Story of 84 Minutes" in header or kind in ("cruise", "hover"):
        return GROUPS[1]
    if "TN D-1772" in header or kind == "reentry":
        return GROUPS[0]
    return GROUPS[3] if ".py:" in kind else GROUPS[2]


def first_sentence(answer: str) -> str:
    """Return the beginning of an answer.

    >>> first_sentence("no. It grows, 12.5 m in all. More.")
    'No. It grows, 12.5 m in all.'
    """
    sentences = re.split(r"(?<=[.?!])\s+(?=[A-Z])", answer)
    chosen = sentences[0] if len(sentences[0]) >= SHORTEST else " ".join(sentences[:2])
    return chosen[:1].upper() + chosen[1:]


def page() -> str:
    """Write the page."""
    rows: dict[str, list[str]] = {group: [] for group in GROUPS}
    for file in sorted(FOLDER.glob("*.toml")):
        text = file.read_text(encoding="utf-8")
        question, answer = question_and_answer(text)
        cells = (f"[{file.stem[:2]}]({file.name})", question[:1].upper() + question[1:], first_sentence(answer))
        rows[group_of(text)].append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    tables = ["\n".join((f"## {group}\n", "| | Question | Answer |", "| --- | --- | --- |", *rows[group]))
              for group in GROUPS]  # fmt: skip
    return "\n\n".join([HEAD.rstrip(), *tables]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"written: {PAGE.relative_to(FOLDER.parent)}")
