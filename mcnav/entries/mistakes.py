"""Mistakes that an annotation or a table of entries finds itself, in words of the campaign file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from mcnav.errors import suggestion

TOLD: Final = "told"
"""Pydantic's type of an error whose message is complete."""


Place = tuple[str | int, ...]
"""Place below an entry: keys, and numbers of entries in lists from zero on."""


@dataclass(frozen=True)
class Mistake:
    """A mistake at a place below an entry."""

    message: str
    place: Place = ()


def told(message: str) -> PydanticCustomError:
    """Return the error that an entry as a whole is wrong, with its whole message."""
    return PydanticCustomError(TOLD, "{message}", {"message": message})


def refuse(mistakes: Iterable[Mistake]) -> ValidationError:
    """Return the error of several mistakes within an entry."""
    lines = [InitErrorDetails(type=told(mistake.message), loc=mistake.place, input=None) for mistake in mistakes]
    return ValidationError.from_exception_data("entry", lines)


def explain_keys(
    invalid: ValidationError, known: Mapping[str, bool], refused: Mapping[str, str], called: str
) -> ValidationError:
    """Return the errors of a table with more to say about its keys.

    Those of unknown keys come first and say why a key is refused, or which may have been meant; those of missing keys
    say what is needed. Where as many are unknown as missing, only the unknown ones are told: each stands for another.

    Parameters
    ----------
    known : mapping of str to bool
        Whether each key is required.
    refused, called
        See `mcnav.entries.quantities.Table`.
    """
    unknown = f"unknown key of {called}" if called else "unknown key"
    needed = " and ".join(key for key, required in known.items() if required)

    def explained(error: ErrorDetails) -> InitErrorDetails:
        kind: str | PydanticCustomError = error["type"]
        key = str(error["loc"][-1]) if error["loc"] else ""
        if kind == "extra_forbidden":
            kind = told(refused.get(key) or f"{unknown}{suggestion(key, list(known))}")
        elif kind == "missing" and called and error["loc"] == (key,):
            kind = told(f"is missing; {called} needs {needed}")
        elif kind == TOLD:
            kind = told(error["msg"])
        return InitErrorDetails(type=kind, loc=error["loc"], input=error["input"], ctx=error.get("ctx", {}))

    errors = sorted(invalid.errors(include_url=False), key=lambda error: error["type"] != "extra_forbidden")
    kinds = [error["type"] for error in errors]
    if not {"extra_forbidden", "missing"} & set(kinds):
        return invalid
    if called and kinds.count("extra_forbidden") == kinds.count("missing"):
        errors = [error for error in errors if error["type"] != "missing"]
    return ValidationError.from_exception_data(invalid.title, [explained(error) for error in errors])
