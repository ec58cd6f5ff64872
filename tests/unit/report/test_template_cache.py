"""Compiled templates: the same page, kept only where Python keeps its own compiled files."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from jinja2 import DictLoader, Environment

from mcnav.report.document.template_cache import TemplateCache


def _page(configured_in: Path, template: str) -> str:
    loader = DictLoader({"page.html": template})
    return (
        Environment(loader=loader, bytecode_cache=TemplateCache(str(configured_in))).get_template("page.html").render()
    )


def _kept(place: Path) -> list[Path]:
    return sorted(place.rglob("jinja2-*.cache"))


@pytest.fixture
def configured_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sys, "pycache_prefix", None)
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "page.py").write_text("one = 1\n")
    return tmp_path / "page.py"


def test_a_changed_template_or_configuration_is_compiled_again(configured_in: Path) -> None:
    assert _page(configured_in, "{{ 1 + 1 }}") == "2"
    (kept,) = _kept(configured_in.parent)
    written = kept.stat().st_mtime_ns
    assert _page(configured_in, "{{ 1 + 1 }}") == "2"
    assert kept.stat().st_mtime_ns == written
    assert _page(configured_in, "{{ 1 + 2 }}") == "3"
    configured_in.write_text("one = 2\n")
    assert _page(configured_in, "{{ 1 + 2 }}") == "3"
    assert len(_kept(configured_in.parent)) == 2


def test_a_damaged_file_does_no_harm(configured_in: Path) -> None:
    assert _page(configured_in, "{{ 2 * 2 }}") == "4"
    (kept,) = _kept(configured_in.parent)
    kept.write_bytes(kept.read_bytes()[:-5])
    assert _page(configured_in, "{{ 2 * 2 }}") == "4"


@pytest.mark.parametrize("reason", ["not wanted", "no folder"])
def test_nothing_is_written_where_python_writes_nothing(
    reason: str, configured_in: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if reason == "not wanted":
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
    else:
        (configured_in.parent / "__pycache__").rmdir()
    assert _page(configured_in, "{{ 3 }}") == "3"
    assert not _kept(configured_in.parent)
