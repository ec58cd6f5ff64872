"""MATLAB's files: what variables within variables hold, and files that state more than they hold."""

from __future__ import annotations

import struct
import zlib
from functools import reduce
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from mcnav.logs.binary_tables import _exceeds
from mcnav.logs.imu_log import read_imu_log
from tests.unit.logs.test_imu_log import readings, refused, same


def matlab_part(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def matlab_variable(what: int, rows: int, rest: bytes = b"", name: bytes = b"a") -> bytes:
    head = matlab_part(6, struct.pack("<II", what, 0)) + matlab_part(5, struct.pack("<ii", rows, 1))
    return matlab_part(14, head + matlab_part(1, name) + rest)


SHORT_NAMES = struct.pack("<HHi", 5, 4, 8) + matlab_part(1, b"x".ljust(16, b"\0"))
MANY = 2**31 - 1


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    ("variable", "reason"),
    [
        (matlab_variable(1, MANY), "holds over 3,360,000,000 bytes of variables"),
        (matlab_variable(2, MANY // 8, SHORT_NAMES), "holds over 3,360,000,000 bytes of variables"),
        (matlab_variable(3, MANY, matlab_part(1, b"c") + SHORT_NAMES), "holds over 3,360,000,000 bytes of variables"),
        (matlab_variable(1, 1, matlab_variable(1, MANY)), "holds over 3,360,000,000 bytes of variables"),
        (matlab_variable(16, 1, matlab_variable(1, MANY)), "holds over 3,360,000,000 bytes of variables"),
        (reduce(lambda inner, _: matlab_variable(1, 1, inner), range(99), b""), "more than 30 deep"),
        (matlab_variable(1, 1)[:-20], "is no MATLAB file that can be read"),
        (matlab_variable(2, 1, struct.pack("<HHi", 5, 4, 0)), "is no MATLAB file that can be read"),
    ],
)
def test_matlab_files_that_state_more_than_they_hold(
    tmp_path: Path, variable: bytes, reason: str, compressed: bool
) -> None:
    """Cells and structures of two thousand million entries in some hundred bytes: nothing is made for them."""
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    content = zlib.compress(variable)
    tag = struct.pack("<II", 15, len(content))
    (tmp_path / "imu.mat").write_bytes(head + (tag + content if compressed else variable))
    with patch("scipy.io.loadmat", side_effect=ValueError("not read")) as read:
        assert reason in refused(tmp_path / "imu.mat")
    assert read.called == ("can be read" in reason)


def test_nested_variables_of_matlab_are_read(tmp_path: Path) -> None:
    """Beside cells, texts and arrays of structures, which hold no columns."""
    from scipy.io import savemat

    rows = readings()
    cells = np.array([rows, "text", np.zeros((3, 3))], dtype=object)
    many = np.array([(1.0, "a"), (2.0, "b")], dtype=[("x", object), ("longer_name", object)])
    log = {"gyro": rows[:, 1:4], "inner": {"acc": rows[:, 4:], "cells": cells}, "many": many}
    for compressed in (False, True):
        savemat(tmp_path / "imu.mat", {"log": log, "time": rows[:, 0], "empty": []}, do_compression=compressed)
        same(read_imu_log(tmp_path / "imu.mat"), rows, 0.0)
        least = 2 * rows.nbytes
        assert _exceeds(tmp_path / "imu.mat", least)
        assert not _exceeds(tmp_path / "imu.mat", least + 3_000)
