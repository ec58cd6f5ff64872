"""Annotations of entries: each reads what it describes, and its schema refuses the mistakes of form that it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal
from unittest.mock import patch

import numpy as np
import pytest
from jsonschema import Draft7Validator
from pydantic import Field

from mcnav.arrays.types import Array
from mcnav.config.json_schema.models import of_model
from mcnav.entries.axes import AxisSizes, OrSizes, units_of
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Distinct, Later, Length, OneOf, Speed, Suggested, Table
from mcnav.entries.rules import ExactlyOne, NotBoth, Rule, SomeButOne, SomeOf
from mcnav.entries.unions import ByKey, ByType, Either
from mcnav.entries.validation import validate

Lengths = Annotated[Array, AxisSizes("m", ("x", "y"))]


class SizeTable(Table):
    """A size, in one of two ways, and a speed."""

    rules: ClassVar[tuple[Rule, ...]] = (ExactlyOne(("sigma", "step")),)
    expected: ClassVar[str] = "expected a sigma or a step"
    sigma: Annotated[Lengths | None, Field(description="Sigma.")] = None
    step: Annotated[Lengths | None, Field(description="Step.")] = None
    speed: Annotated[Speed | None, Field(description="Speed.")] = None


class HopTable(Table):
    """A hop."""

    hop: Annotated[Length, Field(description="Length.")]


class SpinTable(Table):
    """A spin."""

    rules: ClassVar[tuple[Rule, ...]] = (NotBoth("left", "right"),)
    spin: Annotated[int, Field(description="Turns.")]
    left: Annotated[int, Field(description="To the left.")] = 0
    right: Annotated[int, Field(description="To the right.")] = 0


class RoundTable(Table):
    """A form."""

    type: Literal["round"]
    radius: Annotated[Length, Field(description="Radius.")]


class SquareTable(Table):
    """Another form."""

    type: Literal["square"]
    side: Annotated[Length, Field(description="Side.")]


class SomeTable(Table):
    """Some of two keys, not both."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeButOne(("one", "other")),)
    one: int = 0
    other: int = 0


class PairTable(Table):
    """Both of two keys."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeOf(("one", "other"), 2),)
    called: ClassVar[str] = "a pair"
    one: int = 0
    other: int = 0


class WholeTable(Table):
    """A table with an entry of each kind."""

    refused: ClassVar[dict[str, str]] = {"old": "is no longer a key"}
    sizes: Annotated[Lengths | None, Field(description="Sizes.")] = None
    every: Annotated[Array | None, AxisSizes("m", ("x", "y"), complete=True), Field(description="All.")] = None
    counted: Annotated[SizeTable, OrSizes(AxisSizes("m", ("x", "y"))), Field(description="Counted.")] | None = None
    move: Annotated[HopTable | SpinTable, ByKey("it is one of"), Field(description="A move.")] | None = None
    form: Annotated[RoundTable | SquareTable, ByType(), Field(description="A form.")] | None = None
    some: Annotated[SomeTable | None, Field(description="Some.")] = None
    pair: Annotated[PairTable | None, Field(description="A pair.")] = None
    apart: Annotated[
        Array | None, AxisSizes("m", ("x", "y"), one_by_one="expected a list"), Field(description="Apart.")
    ] = None
    names: Annotated[
        list[Annotated[str, Suggested(("ada",), "^b")]], Distinct(("ada",)), Field(description="Names.")
    ] = Field(default_factory=list)
    name: Annotated[str | None, OneOf(("ada", "bob")), Field(description="A name.")] = None
    later: Annotated[Any, Later(HopTable), Field(description="Read later.")] = None
    either: Annotated[Any, Later(Annotated[HopTable | SpinTable, Either()]), Field(description="A move.")] = None


RIGHT: dict[str, object] = {
    "sizes": "1 km",
    "every": {"x": "1 m", "y": "2 m"},
    "counted": {"step": ["1 m", "2 m"], "speed": "1 m/s"},
    "move": {"hop": "1 m"},
    "form": {"type": "round", "radius": "1 m"},
    "some": {"other": 1},
    "pair": {"one": 1, "other": 2},
    "apart": {"x": "1 m"},
    "names": ["ada", "bob"],
    "name": "ada",
    "later": {"hop": "1 m"},
    "either": {"hop": "1 m"},
}

FORMS: list[tuple[str, object]] = [
    ("sizes", ["1 m", "2 m"]),
    ("sizes", {"y": "1 m"}),
    ("counted", "1 m"),
    ("counted", {"x": "1 m"}),
    ("move", {"spin": 1, "left": 2}),
    ("form", {"type": "square", "side": "1 m"}),
    ("apart", ["1 m", "2 m"]),
]

WRONG: list[tuple[str, object, str]] = [
    ("sizes", {"z": "1 m"}, "sizes.z: unknown axis; expected x, y"),
    ("sizes", ["1 m"], "sizes: got a list of 1; expected 2, for x, y"),
    ("every", {"x": "1 m"}, "every: has none for y; expected one for each axis"),
    ("counted", {"sigma": "1 m", "step": "1 m"}, "counted: got sigma, step; expected a sigma or a step"),
    ("counted", {"speed": "1 m/s"}, "counted: got speed; expected a sigma or a step"),
    ("counted", {"sigmas": "1 m"}, "counted.sigmas: unknown key; did you mean 'sigma'?"),
    ("move", {"hop": "1 m", "spin": 1}, "move: got hop and spin; it is one of hop, spin"),
    ("move", {"hopp": "1 m"}, "move: has no kind: got hopp; did you mean 'hop'?"),
    ("move", {"hop": "1 m", "left": 1}, "move.left: unknown key; expected hop"),
    ("move", {"spin": 1, "left": 1, "right": 1}, "move.right: got with a left; keep one"),
    ("move", 3, "move: got 3; expected a table"),
    ("form", {"type": "rounded"}, "form.type: got 'rounded'; did you mean 'round'?"),
    ("form", {"radius": "1 m"}, "form.type: is missing; it is one of round, square"),
    ("form", {"type": "round", "side": "1 m"}, "form."),
    ("some", {}, "some: got nothing"),
    ("some", {"one": 1, "other": 1}, "some: got one, other"),
    ("pair", {"one": 1}, "pair: got one"),
    ("pair", {"on": 1}, "pair.on: unknown key of a pair; did you mean 'one'?"),
    ("apart", "1 m", "apart: got '1 m'; expected a list"),
    ("name", "bop", "name: got 'bop'; did you mean 'bob'?"),
    ("old", 1, "old: is no longer a key"),
]


def mistakes(content: object) -> list[str]:
    context = FileContext("a.toml", Path())
    assert (validate(WholeTable, content, context) is None) == bool(context.problems)
    return [str(problem).removeprefix("a.toml: ") for problem in context.problems]


def accepted(content: object) -> bool:
    return Draft7Validator(of_model(WholeTable)).is_valid(content)


def test_what_is_read() -> None:
    context = FileContext("a.toml", Path())
    table = validate(WholeTable, RIGHT, context)
    assert table is not None
    assert table.sizes is not None
    assert table.counted is not None
    assert table.sizes.tolist() == [1000.0, 1000.0]
    assert table.counted.step is not None
    assert table.counted.step.tolist() == [1.0, 2.0]
    assert table.move == HopTable(hop="1 m")  # type: ignore[arg-type]
    assert table.later == {"hop": "1 m"}
    counted = validate(WholeTable, {"counted": {"y": "3 m"}}, context)
    assert counted is not None
    assert counted.counted is not None
    np.testing.assert_array_equal(counted.counted.sigma, [np.nan, 3.0])
    assert accepted(RIGHT)


@pytest.mark.parametrize(("key", "entry"), FORMS)
def test_forms(key: str, entry: object) -> None:
    assert mistakes({key: entry}) == []
    assert accepted({key: entry})


@pytest.mark.parametrize(("key", "entry", "line"), WRONG)
def test_mistakes(key: str, entry: object, line: str) -> None:
    assert mistakes({key: entry})[0].startswith(line)
    assert not accepted({key: entry})


@pytest.mark.parametrize(
    ("key", "entry"),
    [
        ("later", {"hopp": "1 m"}),
        ("either", {"hopp": "1 m"}),
        ("names", ["bob"]),
        ("names", ["ada", "ada"]),
        ("names", ["ada", "eve"]),
    ],
)
def test_what_is_read_later_is_described_now(key: str, entry: object) -> None:
    assert mistakes({key: entry}) == []
    assert not accepted({key: entry})


def test_units() -> None:
    keys = ("sizes", "every", "counted", "counted.sigma", "counted.step", "apart")
    assert units_of(WholeTable) == dict.fromkeys(keys, "m")


def test_the_form_of_a_table_is_built_once() -> None:
    """It takes longer than reading a table, and `mcnav sweep` reads hundreds of campaigns."""
    context = FileContext("a.toml", Path())
    assert validate(HopTable, {"hop": "1 m"}, context)
    with patch("mcnav.entries.validation.TypeAdapter", side_effect=AssertionError):
        read = validate(HopTable, {"hop": "2 m"}, context)
    assert read is not None
    assert read.hop == 2.0
