"""What is converted to JSON, how it is formatted, and how files are replaced."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from mcnav.files import whole
from mcnav.files.whole import indented_json, to_json, write_whole


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


@pytest.mark.posix
def test_a_file_is_on_the_disk_with_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """First the content, then the folder that names it; a folder that cannot be synced is no failure, a disk is one."""
    synced: list[bool] = []
    monkeypatch.setattr(whole.os, "fsync", lambda file: synced.append((tmp_path / "a").exists()))
    write_whole(tmp_path / "a", b"1")
    assert synced == [False, True]
    for number, refused in ((errno.EINVAL, False), (errno.EACCES, False), (errno.EIO, True)):

        def fail(file: int, number: int = number) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(whole.os, "fsync", fail)
        if refused:
            with pytest.raises(OSError, match="Input/output"):
                whole._sync_folder(tmp_path)
        else:
            whole._sync_folder(tmp_path)


@pytest.mark.parametrize(("refusals", "replaced"), [(2, True), (99, False)])
def test_a_file_that_another_program_has_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusals: int, replaced: bool
) -> None:
    """As on Windows, whose refusals are emulated: some tries, then one line; nothing is left beside the file."""
    left, real, path = [refusals], Path.replace, tmp_path / "a"
    path.write_bytes(b"old")

    def replace(file: Path, target: Path) -> Path:
        left[0] -= 1
        if left[0] >= 0:
            raise PermissionError(errno.EACCES, "Access is denied")
        return real(file, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(whole, "_WINDOWS", True)
    monkeypatch.setattr(whole, "_TRIES", (0.0, 0.0, 0.0))
    if replaced:
        write_whole(path, b"new")
    else:
        with pytest.raises(PermissionError, match="cannot be replaced: close the program"):
            write_whole(path, b"new")
    assert path.read_bytes() == (b"new" if replaced else b"old")
    assert list(tmp_path.iterdir()) == [path]
