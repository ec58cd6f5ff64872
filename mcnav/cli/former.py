"""Former names of commands: what one types today in their place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

Words = list[str]
"""Words of a command line, without the program's name."""


def current(words: Sequence[str]) -> Words:
    """Return the words that do today what a former command did; the same ones where its name is today's.

    >>> current(["figure", "reports/mine", "scatter", "--out", "scatter.pdf"])
    ['export', 'reports/mine', '--figure', 'scatter', '--out', 'scatter.pdf']
    >>> current(["partials", "mine.toml", "--start-times"])
    ['sweep', '--vary', 'start', '--confirm', '0', 'mine.toml']
    """
    rename = FORMER.get(words[0]) if words else None
    return list(words) if rename is None else rename(list(words[1:]))


def _as(*begin: str) -> Callable[[Words], Words]:
    """Return how the name of a command is replaced by words before the others."""
    return lambda words: [*begin, *words]


def _figure(words: Words) -> Words:
    """Let the second word that is neither an option nor its value be the value of ``--figure``."""
    places = [
        place
        for place, word in enumerate(words)
        if not word.startswith("-") and (place == 0 or not words[place - 1].startswith("--") or "=" in words[place - 1])
    ]
    return ["export", *words] if len(places) < 2 else ["export", *words[: places[1]], "--figure", *words[places[1] :]]


def _partials(words: Words) -> Words:
    if "--start-times" not in words:
        return _as("lincov", "--partials")(words)
    others = [word for word in words if word != "--start-times"]
    return ["sweep", "--vary", "start", "--confirm", "0", *others]


def _index(words: Words) -> Words:
    """Let the folder be the value of ``--index``; it was ``reports`` where none was named."""
    folder = next((word for word in words if not word.startswith("-")), "reports")
    return ["report", "--index", folder, *(word for word in words if word != folder)]


FORMER: Final[dict[str, Callable[[Words], Words]]] = {
    "check-scenario": _as("check"),
    "trajectory": _as("check", "--trajectory"),
    "partials": _partials,
    "linearity": _as("sweep", "--scale"),
    "start-times": _as("sweep", "--vary", "start"),
    "figure": _figure,
    "index": _index,
    "imu": _as("docs", "imu"),
    "record": _as("judge", "--record"),
    "schema": _as("dev", "schema"),
    "compile": _as("dev", "compile"),
}
"""Functions that turn the words after a former name into those of today, by that name."""
