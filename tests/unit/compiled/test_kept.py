"""Results of mcnav's own code kept between commands: the same bits, and for the same inputs and program alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.compiled import kept
from mcnav.compiled.kept import keep, program


class Counted:
    """A computation that counts how often it is made."""

    def __init__(self, result: Any) -> None:
        self.result, self.count = result, 0

    def __call__(self) -> Any:
        self.count += 1
        return self.result


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)
    return tmp_path / "trials"


def test_a_kept_result_has_the_same_bits() -> None:
    rng = np.random.default_rng(1)
    arrays = {
        "cube": rng.standard_normal((3, 4, 5)),
        "view": rng.standard_normal((4, 6)).T[::2],
        "none": np.ones((2, 0)),
    }
    compute = Counted({"arrays": arrays, "number": 0.1 + 0.2, "absent": float("nan"), "words": ["a", None, True]})
    first, second = (keep("trials", ("inputs", 1), compute) for _ in range(2))
    assert compute.count == 1
    for result in (first, second):
        for name, array in arrays.items():
            assert result["arrays"][name].shape == array.shape
            assert result["arrays"][name].tobytes() == np.ascontiguousarray(array).tobytes()
        assert result["number"] == 0.1 + 0.2
        assert np.isnan(result["absent"])
        assert result["words"] == ["a", None, True]


def test_other_inputs_and_another_program_are_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    compute, array = Counted(1.0), np.arange(3.0)
    for inputs in (array, np.nextafter(array, 9.0), array.reshape(3, 1), (array, "a"), (array, "b")):
        keep("trials", inputs, compute)
    assert compute.count == 5
    before = program()
    monkeypatch.setattr(kept, "program", lambda: before + b"changed")
    keep("trials", array, compute)
    assert compute.count == 6


def test_the_program_is_all_files_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    before, read = program.__wrapped__(), Path.read_bytes
    assert before == program()
    for changed in ("kernel.py", "higher_order.py", "products.py", "sobol.py"):
        monkeypatch.setattr(Path, "read_bytes", lambda file, of=changed: read(file) + b"#" * (file.name == of))
        assert program.__wrapped__() != before


def test_what_is_quick_or_damaged_is_computed_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    compute = Counted([1.0])
    monkeypatch.setattr(kept, "KEPT_FROM", np.inf)
    assert [keep("trials", "inputs", compute) for _ in range(2)] == [[1.0]] * 2
    assert (compute.count, folder.exists()) == (2, False)
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)
    keep("trials", "inputs", compute)
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes().replace(b"1.0", b"2.0"))
    assert keep("trials", "inputs", compute) == [1.0]
    assert capsys.readouterr().err == f"note: {file} is damaged; it is computed again\n"
    assert keep("trials", "inputs", compute) == [1.0]
    assert compute.count == 4
