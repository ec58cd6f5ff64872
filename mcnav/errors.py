"""Errors whose messages name the file, the key, the value and the remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic_core import ValidationError

from mcnav.physics.units import printable

MOST_PROBLEMS: Final = 50
"""Mistakes of one file that are shown."""

LONGEST: Final = 400
"""Characters of a file name or key that are shown."""

LONGEST_MESSAGE: Final = 1_000
"""Characters of a message that are shown: some list names."""

LONGEST_LINE: Final = 2_000
"""Characters of a message about a run folder that are shown."""

LONGEST_TOLD: Final = 200
"""Characters that are shown of what is wrong within a file."""

LONGEST_VALUE: Final = 40
"""Characters of a value that are shown within a longer message."""

LONGEST_NAME: Final = 100
"""Characters of a name that may have been meant for another."""

VERY_CLOSE: Final = 0.85
CLOSE: Final = 0.6
"""Similarity of a name with one letter of six missing, and of one with a third of its letters wrong (`difflib`)."""

SHORTEST_PART: Final = 3
"""Characters of a part of a name by which it is suggested."""

MOST_NEAR: Final = 3
"""Names that contain a part, and are suggested."""

MOST_NAMES: Final = 20
"""Names that a message lists."""


DIGITS: Final = 12
"""Digits of a digest that are shown."""


@dataclass(frozen=True)
class Problem:
    """One mistake."""

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        parts = (self.file, LONGEST), (self.key, LONGEST), (self.message, LONGEST_MESSAGE)
        return ": ".join(printable(text, most) for text, most in parts if text)


class CampaignError(Exception):
    """A campaign that cannot be run, with its mistakes, one a line.

    Examples
    --------
    >>> import mcnav as mc
    >>> try:
    ...     mc.Campaign({"type": "reentry", "trajectory": 1}, {"altitud": 1.0})
    ... except mc.CampaignError as refused:
    ...     print(refused.problems[0].key)
    errors.altitud
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        lines = [str(problem) for problem in problems[:MOST_PROBLEMS]]
        if len(problems) > MOST_PROBLEMS:
            lines.append(f"{problems[0].file}: and more")
        super().__init__("\n".join(lines))
        self.problems = tuple(problems)


class NumericalError(Exception):
    """A numerical result that its own check contradicts; the message says which."""

    def __init__(self, message: str) -> None:
        super().__init__(f"{message}; mcnav states no result: please report this campaign as a fault of mcnav")


class RunFolderError(Exception):
    """A run folder that cannot be used; the message, of one printable line, names it and the remedy.

    Examples
    --------
    >>> import mcnav as mc
    >>> try:
    ...     mc.open_run("nowhere")
    ... except mc.RunFolderError as refused:
    ...     print(refused)
    nowhere: holds no run (there is no such folder); mcnav run CAMPAIGN makes one
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message.strip(), LONGEST_LINE))


class ClusterError(Exception):
    """A cluster that cannot be used, or has been lost; the message names it and the remedy."""


class RunFolderBusy(RunFolderError):
    """Another process is writing to the run folder."""


class TooManyFailures(Exception):
    """More samples failed than a run was allowed; the message says how many."""


def first_mistake(invalid: ValidationError) -> str:
    """Return the first mistake that pydantic found: its key, what came, and what is expected.

    >>> from pydantic import TypeAdapter
    >>> try:
    ...     TypeAdapter(list[float]).validate_python([1.0, "x"])
    ... except ValidationError as invalid:
    ...     first_mistake(invalid)
    "1: got 'x'; expected a valid number, unable to parse string as a number"
    """
    first = invalid.errors(include_url=False, include_context=False)[0]
    came, message = first["input"], str(first["msg"]).removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if first["type"] == "missing":
        message = "is missing"
    elif message.startswith("input should be "):
        shown = "a table" if isinstance(came, Mapping) else "a list" if isinstance(came, list | tuple) else repr(came)
        message = f"got {printable(shown, LONGEST_VALUE)}; expected {message.removeprefix('input should be ')}"
    return ": ".join(filter(None, (".".join(map(str, first["loc"])), message)))


@contextmanager
def reading_file(path: Path) -> Iterator[None]:
    """Convert parsing errors into `RunFolderError` naming the file.

    Raises `RunFolderError` in place of errors raised for unexpected numbers, names or shapes.
    """
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as failure:
        named = (
            first_mistake(failure) if isinstance(failure, ValidationError) else f"{type(failure).__name__}: {failure}"
        )
        told = printable(named, LONGEST_TOLD)
        raise RunFolderError(f"{path}: is not as this program writes it ({told}); run the campaign again") from failure


def near_names(name: str, known: Sequence[str]) -> list[str]:
    """Return names that another may stand for: the only one that begins with it, a close one, or some that contain it.

    >>> near_names("altitud_", ["altitude", "range"]), near_names("aided", ["tutorial-aided", "guide"])
    (['altitude'], ['tutorial-aided'])
    >>> near_names("position_n", ["position_down", "position_north"])
    ['position_north']
    """
    if not 0 < len(name) <= LONGEST_NAME:
        return []
    folded = {word.casefold(): word for word in reversed(known)}
    containing = [word for word in known if len(name) >= SHORTEST_PART and name.casefold() in word.casefold()]

    def closest(cutoff: float) -> list[str]:
        return [folded[match] for match in difflib.get_close_matches(name.casefold(), list(folded), 1, cutoff)]

    few = containing if len(containing) <= MOST_NEAR else []
    beginning = [word for word in containing if word.casefold().startswith(name.casefold())]
    only = beginning if len(beginning) == 1 else []
    return only or closest(VERY_CLOSE) or few or closest(CLOSE) or containing[:MOST_NEAR]


def did_you_mean(names: Sequence[str]) -> str:
    """Ask for near names, as the end of a message; empty without any.

    >>> did_you_mean(["altitude", "altitude_rate"])
    "; did you mean 'altitude' or 'altitude_rate'?"
    """
    return f"; did you mean {' or '.join(repr(name) for name in names)}?" if names else ""


def suggestion(name: str, known: Sequence[str]) -> str:
    """Suggest what an unknown name may have meant, and list known names, as the end of a message.

    >>> suggestion("altitud", ["altitude", "range"])
    "; did you mean 'altitude'? It is one of altitude, range"
    """
    known = [word for word in known if word.strip()]
    if not known:
        return ""
    listed = ", ".join(known[:MOST_NAMES])
    if len(known) > MOST_NAMES:
        listed += f" and {len(known) - MOST_NAMES} more"
    near = did_you_mean(near_names(name, known))
    if near:
        return f"{near} It is one of {listed}"
    return f"; expected one of {listed}" if len(known) > 1 else f"; expected {listed}"


def reason_of(failure: Exception) -> str:
    """Return the first line of what a library says of a file that it cannot read."""
    return printable(str(failure).splitlines()[0] if str(failure) else type(failure).__name__, LONGEST_TOLD)


def shortened(text: str) -> str:
    """Shorten every digest in a text for people.

    >>> shortened("SHA-256 " + 64 * "5")
    'SHA-256 555555555555'
    """
    return re.sub(r"\b[0-9a-f]{40,64}\b", lambda result: result[0][:DIGITS], text)
