"""Dataclasses of the standard library, whose frozen ones cost a seventh at import.

`dataclasses` writes and compiles six functions for each frozen class, 0.7 ms a class, and a command imports some 400.
Here ``__init__`` alone is written; the others are closures over the names of the fields. A field is set once, by
``__init__``: setting it again, or setting what is no field, raises `FrozenInstanceError`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import FrozenInstanceError, fields
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # type checkers know the standard library's by its name
else:

    def dataclass(cls: type | None = None, /, *, frozen: bool = False, eq: bool = True, **options: Any) -> Any:
        """Make a class a dataclass as `dataclasses.dataclass` does, with all its options."""
        if not frozen or options.keys() - {"kw_only"}:
            return dataclasses.dataclass(cls, frozen=frozen, eq=eq, **options)

        def decorate(decorated: type) -> type:
            made = dataclasses.dataclass(eq=False, repr=False, **options)(decorated)
            _freeze(made)
            _add_repr(made)
            if eq:
                _add_comparison(made)
            return made

        return decorate if cls is None else decorate(cls)


def _freeze(cls: type) -> None:
    names = cls.__dataclass_fields__  # type: ignore[attr-defined]

    def __setattr__(self: Any, name: str, value: Any) -> None:  # noqa: N807
        own = self.__dict__
        if name in own or name not in names:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        own[name] = value

    def __delattr__(self: Any, name: str) -> None:  # noqa: N807
        raise FrozenInstanceError(f"cannot delete field {name!r}")

    _set(cls, __setattr__, __delattr__)


def _add_repr(cls: type) -> None:
    shown = [field.name for field in fields(cls) if field.repr]

    @recursive_repr()
    def __repr__(self: Any) -> str:  # noqa: N807
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    if "__repr__" not in cls.__dict__:
        _set(cls, __repr__)


def _add_comparison(cls: type) -> None:
    compared = tuple(field.name for field in fields(cls) if field.compare)
    hashed = tuple(field.name for field in fields(cls) if (field.compare if field.hash is None else field.hash))
    values, parts = _getter(compared), _getter(hashed)

    def __eq__(self: Any, other: object) -> Any:  # noqa: N807
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    def __hash__(self: Any) -> int:  # noqa: N807
        return hash(parts(self))

    own = cls.__dict__
    if own.get("__hash__") is None:
        _set(cls, __hash__)
    if "__eq__" not in own:
        _set(cls, __eq__)


def _getter(names: tuple[str, ...]) -> Callable[[Any], Any]:
    """Return a function of an object: the values of its attributes, always a tuple."""
    match names:
        case ():
            return lambda _: ()
        case (name,):
            value = attrgetter(name)
            return lambda each: (value(each),)
    return attrgetter(*names)


def _set(cls: type, *functions: Callable[..., Any]) -> None:
    for function in functions:
        function.__qualname__ = f"{cls.__qualname__}.{function.__name__}"
        setattr(cls, function.__name__, function)
