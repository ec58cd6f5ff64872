"""Rules about the keys of a table: each is checked when the table is read, and is part of its JSON schema."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Protocol

from mcnav.entries.mistakes import Mistake


class Rule(Protocol):
    """A rule about which keys a table has."""

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """Return the mistake of a table with some keys; ``expected`` is what the table should be."""

    @property
    def schema(self) -> Mapping[str, object]:
        """Keywords of a JSON schema."""


def _got(given: Set[str], expected: str) -> Mistake:
    return Mistake(f"got {', '.join(sorted(given)) or 'nothing'}; {expected}")


@dataclass(frozen=True)
class ExactlyOne:
    """Exactly one of several keys, and all of some others."""

    keys: tuple[str, ...]
    further: tuple[str, ...] = ()

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        complete = len(given & set(self.keys)) == 1 and given >= set(self.further)
        return None if complete else _got(given, expected)

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        further = {"required": list(self.further)} if self.further else {}
        return {"oneOf": [{"required": [key]} for key in self.keys], **further}


@dataclass(frozen=True)
class SomeButOne:
    """At least one key, and at most one of several."""

    keys: tuple[str, ...]

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        return None if given and len(given & set(self.keys)) <= 1 else _got(given, expected)

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        return {"minProperties": 1, "not": {"required": list(self.keys)}}


@dataclass(frozen=True)
class SomeOf:
    """All of several keys, or at least one."""

    keys: tuple[str, ...]
    least: int

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        return None if len(given & set(self.keys)) >= self.least else _got(given, expected)

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        return {"required": list(self.keys)} if self.least == len(self.keys) else {"minProperties": self.least}


@dataclass(frozen=True)
class OneOfTwo:
    """One of two keys, and not both; ``expected`` says which they are."""

    first: str
    second: str
    expected: str

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        count = len(given & {self.first, self.second})
        return None if count == 1 else Mistake(f"got {'both' if count else 'neither'}; {self.expected}")

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        return {"oneOf": [{"required": [self.first]}, {"required": [self.second]}]}


@dataclass(frozen=True)
class NotBoth:
    """At most one of two keys."""

    first: str
    second: str

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        both = {self.first, self.second} <= given
        return Mistake(f"got with a {self.first}; keep one", (self.second,)) if both else None

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        return {"not": {"required": [self.first, self.second]}}
