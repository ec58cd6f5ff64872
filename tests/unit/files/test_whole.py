"""What is converted to JSON, and how it is formatted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from mcnav.files.whole import indented_json, to_json


def test_numbers_that_are_not_finite_are_null() -> None:
    array = np.array([[1.0, np.nan], [np.inf, 2.0], [3.0, 4.0]])
    expected = {"a": [[1.0, None], [None, 2.0], [3.0, 4.0]], "b": [[], [1, 2.5]], "c": [None, "x"]}
    found = to_json({"a": array, "b": ((), (1, np.float64(2.5))), "c": (np.float64(np.nan), "x")})
    assert json.dumps(found) == json.dumps(expected)


SCALARS = (
    some.none() | some.booleans() | some.integers() | some.floats(allow_nan=False, allow_infinity=False) | some.text()
)
VALUES = some.recursive(
    SCALARS,
    lambda inner: some.lists(inner) | some.dictionaries(some.text(), inner) | some.tuples(inner, inner),
    max_leaves=30,
)


@given(VALUES, some.booleans())
def test_json_is_indented_as_by_python(value: object, ensure_ascii: bool) -> None:
    assert indented_json(value, ensure_ascii) == json.dumps(value, indent=1, ensure_ascii=ensure_ascii)


@pytest.mark.parametrize("value", [[[1.0, np.nan]], {"a": {"b": np.inf}}])
def test_numbers_that_are_not_finite_are_refused_on_request(value: object) -> None:
    assert indented_json(value) == json.dumps(value, indent=1)
    with pytest.raises(ValueError, match="not JSON compliant"):
        indented_json(value, allow_nan=False)
