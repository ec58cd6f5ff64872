"""What the pages of documentation name is there: paths, links, identifiers, commands and make targets."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import pytest

from mcnav.cli.start import docs
from mcnav.docs.pages import PAGES
from tests.conftest import ROOT

PACKAGE = ROOT / "mcnav"
FILES = [ROOT / "README.md", ROOT / ".github" / "CONTRIBUTING.md", *sorted(PACKAGE.rglob("*.md"))]
EXACT = [*(PACKAGE / "docs" / f"{page}.md" for page in ("ARCHITECTURE", "NOTATION", "THEORY")), FILES[1]]


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def quoted(text: str) -> list[str]:
    """What stands between backticks outside of blocks of code."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


@lru_cache
def words_of(path: Path) -> frozenset[str]:
    """Every word of a file or of all files of a folder."""
    files = [path] if path.is_file() else [each for each in path.rglob("*") if each.suffix in {".py", ".toml", ".html"}]
    return frozenset(word for file in files for word in re.findall(r"\w+", file.read_text(encoding="utf-8")))


def known() -> frozenset[str]:
    """Every word of the source and of the commands that work on it."""
    sources = [PACKAGE, ROOT / "tests", ROOT / "campaigns", ROOT / "Makefile", ROOT / "pyproject.toml"]
    return frozenset().union(*(words_of(each) for each in sources))


def is_path(name: str) -> bool:
    return bool(re.fullmatch(r"[\w.*-]*(/[\w.*-]*)+|[\w*-]+\.(py|md|toml|json|html|css|js)", name))


def exists(name: str) -> bool:
    return any(any(base.glob(name.rstrip("/"))) for base in (PACKAGE, ROOT))


def written(name: str) -> bool:
    """Whether a name is that of a file in a run folder, or a pattern for one."""
    return name in {"manifest.json", "summary.json", "report.html", "campaign.toml"} or "NAME" in name


@pytest.mark.parametrize("page", EXACT, ids=named)
def test_every_path_and_name_exists(page: Path) -> None:
    missing = []
    for each in quoted(page.read_text(encoding="utf-8")):
        if is_path(each):
            found = exists(each) or written(each) or (page.name == "CONTRIBUTING.md" and exists(f"**/{each}"))
        elif re.fullmatch("[A-Z]{2,5}:", each):
            found = True  # the prefix of a commit
        elif each.startswith("mcnav "):
            found = each.split()[1] in known() or each.split()[1].replace("-", "_") in known()
        else:
            words = re.findall(r"[A-Za-z_]\w*", re.sub(r"[\"'].*?[\"']", "", each))
            found = all(word in known() for word in words)
        if not found:
            missing.append(each)
    assert not missing


def test_a_symbol_is_where_the_notation_says() -> None:
    """Names in the second column occur in a file of the last one."""
    where: list[str] = []
    rows, wrong = 0, []
    for line in (PACKAGE / "docs" / "NOTATION.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|") or len(cells) != 4 or cells[0] in {"symbol", "---"}:
            continue
        rows += 1
        where = where if cells[3] == "the same" else [each for each in quoted(cells[3]) if is_path(each)]
        words = frozenset().union(*(words_of(PACKAGE / each) for each in where)) if where else known()
        for name in quoted(cells[1]):
            parts = re.findall(r"[A-Za-z_]\w*", name)
            wrong += [f"{part} in {where}" for part in parts if words.isdisjoint({part, part.upper()})]
    assert not wrong
    assert rows > 50


@pytest.mark.parametrize("page", FILES, ids=named)
def test_every_link_leads_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", text):
        assert (page.parent / target).exists(), target
    headings = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in re.findall(r"^#+ (.*)$", text, re.M)}
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= headings


@pytest.mark.parametrize("page", FILES, ids=named)
def test_every_target_of_make_exists(page: Path) -> None:
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    asked = re.findall(r"(?:`|^ {4})make ([a-z]+)", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert set(asked) <= set(targets)


@pytest.mark.parametrize("page", FILES, ids=named)
def test_every_page_that_is_named_exists(page: Path) -> None:
    named = re.findall(r"`mcnav docs ([\w-]+)`", page.read_text(encoding="utf-8"))
    assert {name for name in named if name != "PAGE"} <= {*PAGES, "imu"}


@pytest.mark.parametrize("page", PAGES)
def test_every_page_is_shown(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    docs(page)
    assert capsys.readouterr().out.strip() == (PACKAGE / PAGES[page]).read_text(encoding="utf-8").strip()


def test_every_page_has_a_name_and_is_in_the_lists_of_pages() -> None:
    assert {PACKAGE / file for file in PAGES.values()} == set(PACKAGE.rglob("*.md"))
    guide = (PACKAGE / "docs" / "GUIDE.md").read_text(encoding="utf-8")
    assert all(f"`{page}`" in guide for page in PAGES if page != "guide")
    assert "(mcnav/docs/GUIDE.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_is_short() -> None:
    """A screen and a half; everything else is in the pages that the guide lists."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= 90
    picture = ROOT / re.findall(r"!\[.*?\]\((.*?)\)", readme)[0]
    assert picture.stat().st_size < 200_000
