"""Pages of the documentation, by the names that ``mcnav docs`` has for them."""

from __future__ import annotations

from importlib.resources import files
from typing import Final

_NAMES: Final = (
    "guide", "tutorial-reentry", "tutorial-cruise", "tutorial-flight", "tutorial-aided", "tutorial-scenario",
    "tutorial-noise", "tutorial-closed-loop", "tutorial-record", "questions", "howto-instruments", "howto-logs",
    "howto-filter", "howto-landing", "howto-judge", "howto-requirements", "howto-ranges", "howto-rare", "howto-samples",
    "howto-compare", "howto-export", "howto-failures", "method", "examination", "rare-events", "theory", "report",
    "glossary", "notation", "campaigns", "scenarios", "trajectories", "commands", "notebook", "scaling",
    "architecture", "decisions", "kernels", "security",
    "tn-d1772", "story", "textbook", "ukfm", "other-tools",
)  # fmt: skip

_ELSEWHERE: Final[dict[str, str]] = {
    "tn-d1772": "validation/reproduce/tn_d1772/TN_D1772.md",
    "story": "validation/reproduce/story_of_84_minutes/STORY_OF_84_MINUTES.md",
    "textbook": "validation/reproduce/textbook/TEXTBOOK.md",
    "ukfm": "validation/reproduce/ukfm/UKFM.md",
}


def _file(page: str) -> str:
    """Find the file of a page.

    >>> _file("tutorial-noise"), _file("guide")
    ('docs/tutorials/NOISE.md', 'docs/GUIDE.md')
    """
    for prefix, folder in (("tutorial-", "docs/tutorials"), ("howto-", "docs/howto")):
        if page.startswith(prefix):
            return f"{folder}/{page.removeprefix(prefix).upper().replace('-', '_')}.md"
    return _ELSEWHERE.get(page, f"docs/{page.upper().replace('-', '_')}.md")


PAGES: Final[dict[str, str]] = {page: _file(page) for page in _NAMES}
"""Files of the pages, from the folder of this package; the guide, which lists them, is first."""


def page_text(page: str) -> str:
    """Read a page, in Markdown."""
    return files("mcnav").joinpath(PAGES[page]).read_text(encoding="utf-8")
