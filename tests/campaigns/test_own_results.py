"""Results of a user's class that are no real numbers are refused; calls that are repeated one by one are said."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mcnav.systems.user.returned import real_numbers
from tests.commands import invoke

CLASS = """
import numpy as np
from mcnav import Output, Source
class Mine:
    sources = (Source("a", "1", "1", 1.0), Source("b", "1", "1", 1.0))
    outputs = (Output("y", "1", "1"),)
    def {method}(self, e):
        {body}
"""


def written(folder: Path, body: str, method: str = "propagate", samples: int = 5_000) -> None:
    (folder / "mine.py").write_text(CLASS.format(method=method, body=body), encoding="utf-8")
    text = f'samples = {samples}\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1"\nb = "2"\n'
    (folder / "mine.toml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("returned", "dtype"),
    [
        ("e[:, :1] + 0j", "dtype complex128"),
        ("np.ma.masked_greater(e[:, :1], 1.0)", "a masked array of dtype float64"),
        ("e[:, :1].astype(object)", "dtype object"),
        ("e[:, :1].astype(str)", "dtype <U"),
        ("e[:, :1].astype('S')", "dtype |S"),
        ("e[:, :1].astype('M8[s]')", "dtype datetime64[s]"),
        ("e[:, :1].astype('m8[s]')", "dtype timedelta64[s]"),
        ("[[None]] * len(e)", "dtype object"),
    ],
)
def test_what_is_no_real_number_is_refused_with_its_dtype(tmp_path: Path, returned: str, dtype: str) -> None:
    written(tmp_path, f"return {returned}")
    done = invoke("run", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert f"propagate must return real numbers; got {dtype}" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("returned", ["[e[0] + 0j]", "[str(e[0])]", "np.ma.masked_all(1)"])
def test_so_is_what_a_single_flight_returns(tmp_path: Path, returned: str) -> None:
    written(tmp_path, f"return {returned}", "fly", 100)
    done = invoke("run", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "fly must return real numbers; got " in done.stderr


def test_integers_and_booleans_are_real() -> None:
    assert real_numbers([[True, False]], "y").tolist() == [[1.0, 0.0]]
    assert real_numbers([[1, 2]], "y").dtype == float


def test_calls_that_are_repeated_one_by_one_are_said_once(tmp_path: Path) -> None:
    """With the number of samples, in the terminal, the summary, the report, and again without a simulation."""
    body = "if len(e) > 1: raise ValueError('one at a time')\n        return e.sum(axis=1, keepdims=True)"
    written(tmp_path, body)
    done = invoke("run", "mine.toml", cwd=tmp_path)
    assert done.returncode == 0
    sentence = "propagate failed in calls with several samples, so 5,000 of 5,000 samples were simulated one by one"
    assert (done.stdout + done.stderr).count(sentence) == 1
    assert invoke("show", "reports/mine", cwd=tmp_path).stdout.count(sentence) == 1
    folder = tmp_path / "reports/mine"
    (remark,) = json.loads((folder / "summary.json").read_text("utf-8"))["remarks"]
    assert sentence in remark
    assert sentence in (folder / "report.html").read_text("utf-8")


def test_a_class_that_takes_all_samples_is_not_repeated(tmp_path: Path) -> None:
    written(tmp_path, "return e.sum(axis=1, keepdims=True)")
    assert "one by one" not in invoke("run", "mine.toml", cwd=tmp_path).stdout
