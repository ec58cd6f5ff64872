"""Types of calls, resolved once: numba resolves a call anew wherever it stands in what it compiles.

An operator has some twenty definitions, which are tried in turn: a quarter of the time of compiling. What is found
depends on the function, the types of its arguments and the caller's options alone.
"""

from __future__ import annotations

from typing import Any, Final

from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction


class _Options:
    """Numbers of the options that functions are compiled with: equal ones have the same number."""

    def __init__(self) -> None:
        self._last: Any = None
        self._number = 0
        self._known: list[dict[str, Any]] = []

    def number(self) -> int:
        """Return the number of the options of the function that is being compiled.

        numba makes an object of them for each function, and compares all of them at each comparison of such objects.
        """
        options = ConfigStack.top_or_none()
        if options is not self._last or options is None:
            values = {} if options is None else options.values()
            if values not in self._known:
                self._known.append(values)
            self._last, self._number = options, self._known.index(values)
        return self._number


_OPTIONS: Final = _Options()


_resolve: Any = BaseFunction.get_call_type


def _call_type(function: Any, context: Any, arguments: Any, keywords: Any) -> Any:
    """Return the signature of a call, and let the function know how it is implemented."""
    if keywords:
        return _resolve(function, context, arguments, keywords)
    call = context, arguments, _OPTIONS.number()
    found = function.__dict__.setdefault("_found", {})
    if call not in found:
        signature = _resolve(function, context, arguments, keywords)
        found[call] = signature, function.get_impl_key(signature)
    signature, function._impl_keys[signature.args] = found[call]
    return signature


def keep_call_types() -> None:
    """Let numba resolve a call of a function with types of arguments once for each set of options of callers."""
    setattr(BaseFunction, "get_call_type", _call_type)  # noqa: B010
