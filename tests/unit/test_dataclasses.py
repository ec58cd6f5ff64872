"""Frozen dataclasses of `mcnav._dataclasses` against those of the standard library: the same class, made by both."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, field, fields, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
import pytest

from mcnav._dataclasses import dataclass

T = TypeVar("T")


def point(make: Callable[..., Any], **options: Any) -> Any:
    """Return a class with a default, a list, fields left out of equality, hash or text, and a value computed once."""

    @make(frozen=True, **options)
    class Point(Generic[T]):
        """A point."""

        x: T
        y: float = 2.0
        tags: list[str] = field(default_factory=list, hash=False)
        note: str = field(default="", compare=False)
        secret: int = field(default=0, repr=False)

        @cached_property
        def norm(self) -> float:
            """Distance."""
            return abs(complex(self.x, self.y))  # type: ignore[call-overload, no-any-return]

    return Point


OWN, STANDARD = point(dataclass), point(dataclasses.dataclass)
ARGUMENTS = [((1.0,), {}), ((1.0, 3.0, ["a"]), {"note": "n"}), ((1.0,), {"secret": 1}), ((np.float64(1.0),), {})]


def test_text_is_that_of_the_standard_library() -> None:
    for values, named in ARGUMENTS:
        assert repr(OWN(*values, **named)) == repr(STANDARD(*values, **named))
    ring = OWN([])
    ring.x.append(ring)
    assert repr(ring).startswith("point.<locals>.Point(x=[...], y=2.0")


def test_equality_and_hash_are_those_of_the_standard_library() -> None:
    own, standard = ([make(*values, **named) for values, named in ARGUMENTS] for make in (OWN, STANDARD))
    for i in range(len(ARGUMENTS)):
        for j in range(len(ARGUMENTS)):
            assert (own[i] == own[j]) == (standard[i] == standard[j])
        assert hash(own[i]) == hash(standard[i])
    assert own[0] != standard[0]
    assert len({*own}) == len({*standard}) == 3
    assert dataclass(frozen=True)(type("Empty", (), {}))() is not None


@pytest.mark.parametrize("names", [(), ("a",), ("a", "b")])
def test_any_number_of_fields(names: tuple[str, ...]) -> None:
    def made(make: Callable[..., Any]) -> Any:
        return make(frozen=True)(type("Made", (), {"__annotations__": dict.fromkeys(names, "int"), "__doc__": "."}))

    values = range(len(names))
    own, standard = made(dataclass), made(dataclasses.dataclass)
    assert hash(own(*values)) == hash(standard(*values))
    assert own(*values) == own(*values)
    assert own.__match_args__ == standard.__match_args__


def test_what_is_set_stays() -> None:
    own = OWN(1.0)
    for name in ("x", "norm", "other"):
        with pytest.raises(FrozenInstanceError, match=f"cannot assign to field '{name}'"):
            setattr(own, name, 5.0)
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'x'"):
        del own.x
    assert own.norm == vars(own)["norm"] == abs(1 + 2j)
    with pytest.raises(FrozenInstanceError):
        own.norm = 3.0


def test_the_functions_of_the_module_know_it() -> None:
    own, standard = OWN(1.0, 3.0), STANDARD(1.0, 3.0)
    assert [each.name for each in fields(own)] == [each.name for each in fields(standard)]
    assert repr(replace(own, y=4.0)) == repr(replace(standard, y=4.0))
    assert dataclasses.asdict(own) == dataclasses.asdict(standard)
    assert copy.deepcopy(own) == own
    assert dataclasses.is_dataclass(own)


@dataclass(frozen=True)
class Base:
    """At the top of the module, so that it can be pickled."""

    a: int


@dataclass(frozen=True, eq=False)
class Derived(Base):
    """One with a second field; its equality is that of `Base`, as in the standard library."""

    b: int = 2

    def __post_init__(self) -> None:
        """Change what was given."""
        object.__setattr__(self, "b", self.b + 1)


def test_it_is_pickled_and_inherited() -> None:
    assert pickle.loads(pickle.dumps(Base(1))) == Base(1) != Derived(1)
    derived = Derived(1)
    assert (derived.a, derived.b, derived == Derived(1, 5)) == (1, 3, True)
    assert vars(pickle.loads(pickle.dumps(derived))) == {"a": 1, "b": 3}


def test_own_equality_stays() -> None:
    class Always:
        """Equal to everything."""

        a: int

        def __eq__(self, other: object) -> bool:
            return True

    assert dataclass(frozen=True)(Always)(a=1) == 3  # type: ignore[call-arg]


def test_others_are_the_standard_library() -> None:
    @dataclass
    class Plain:
        """Not frozen."""

        a: int

    @dataclass(frozen=True, order=True)
    class Ordered:
        """Ordered."""

        a: int

    plain = Plain(1)
    plain.a = 2
    assert plain == Plain(2)
    assert Ordered(1) < Ordered(2)
