"""Last results of a computation: what variations of a campaign have in common is computed once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Recent(Generic[Result]):
    """The last results of a computation by key; they are shared and must not be changed.

    Parameters
    ----------
    most : int
        Results kept.

    Examples
    --------
    >>> recent = Recent[int](most=1)
    >>> recent.get("a", lambda: 1), recent.get("a", lambda: 2)
    (1, 1)
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, Result] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable, compute: Callable[[], Result], fits: Callable[[Result], bool] | None = None) -> Result:
        """Return the result of a key, computed unless it is known; one that does not fit is not kept."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        result = compute()
        if fits is None or fits(result):
            with self._lock:
                self._kept[key] = result
                self._kept.move_to_end(key)
                while len(self._kept) > self._most:
                    self._kept.popitem(last=False)
        return result
