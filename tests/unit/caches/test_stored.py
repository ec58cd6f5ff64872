"""Results kept between commands: whole or not at all, and not without end."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mcnav.caches import stored
from mcnav.caches.stored import Cache, DamagedError


def test_results_are_read_as_written_and_the_oldest_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A result that was read counts as new; a file that is still being written is left, an abandoned one is not."""
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path))
    kept, folder = Cache("trials"), tmp_path / "trials"
    assert kept.read("none") is None
    for age, name in enumerate("dcba"):
        assert kept.write(name, name.encode() * 9)
        os.utime(folder / name, (1e9 - age, 1e9 - age))
    assert kept.read("b") == b"b" * 9
    monkeypatch.setattr(stored, "MOST_FILES", 3)
    for name, time in ((".e.0123456789ab.tmp", 1e9), (".e.ba9876543210.tmp", 4e9)):
        (folder / name).touch()
        os.utime(folder / name, (time, time))
    assert kept.write("e", b"")
    assert sorted(file.name for file in folder.iterdir()) == [".e.ba9876543210.tmp", "b", "d", "e"]
    (folder / "b").write_bytes((folder / "b").read_bytes() + b"b")
    with pytest.raises(DamagedError, match=f"{folder / 'b'} is damaged"):
        kept.read("b")
    monkeypatch.setattr(stored, "LARGEST", 5)
    assert not kept.write("f", b"too long")
