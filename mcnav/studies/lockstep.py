"""Searches that take answers which are cheaper by many at once: all of them ask before any is answered.

A search is a function of answers that are known or not. Where one is not, it raises `Unanswered`; it begins again once
that is answered, with all answers that it has had. So many searches advance side by side, each one question at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from mcnav.config.overrides import Value

Values = Mapping[str, Value]
"""Keys of a campaign that are set to other values."""

Result = TypeVar("Result")


class Unanswered(Exception):
    """An answer that a search takes is not known yet."""

    def __init__(self, values: Values) -> None:
        super().__init__(str(values))
        self.values = values


def in_lockstep(searches: Sequence[Callable[[], Result]], answer: Callable[[Sequence[Values]], None]) -> list[Result]:
    """Run searches to their ends, and answer what they ask, once for all of them.

    Examples
    --------
    >>> known = {}
    >>> def search(key):
    ...     if key not in known:
    ...         raise Unanswered({key: 1})
    ...     return known[key]
    >>> in_lockstep([lambda: search("a"), lambda: search("b")], lambda asked: [known.update(each) for each in asked])
    [1, 1]
    """
    while True:
        results, asked = list[Result](), list[Values]()
        for search in searches:
            try:
                results.append(search())
            except Unanswered as question:
                asked.append(question.values)
        if not asked:
            return results
        answer(asked)
