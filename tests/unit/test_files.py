"""What is converted to JSON."""

from __future__ import annotations

import json

import numpy as np

from mcnav.files import to_json


def test_numbers_that_are_not_finite_are_null() -> None:
    array = np.array([[1.0, np.nan], [np.inf, 2.0], [3.0, 4.0]])
    expected = {"a": [[1.0, None], [None, 2.0], [3.0, 4.0]], "b": [[], [1, 2.5]], "c": [None, "x"]}
    found = to_json({"a": array, "b": ((), (1, np.float64(2.5))), "c": (np.float64(np.nan), "x")})
    assert json.dumps(found) == json.dumps(expected)
