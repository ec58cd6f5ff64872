"""The site of the documentation: built without a warning, whole, and without a network."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.main import get_command

import mcnav
from mcnav.cli import app
from mcnav.config.schema import CampaignTable
from mcnav.docs.pages import PAGES
from mcnav.systems.registry import FURTHER_NAMES
from tests.conftest import ROOT

pytestmark = pytest.mark.slow


@pytest.fixture
def pages(site: Path) -> dict[str, str]:
    """Every page by its name on the site, without the reports that the gallery leads to."""
    files = (file for file in site.rglob("*.html") if "_downloads" not in file.parts)
    return {str(file.relative_to(site)): file.read_text(encoding="utf-8") for file in files}


def commands(group: object, name: str) -> list[str]:
    """List the commands of a group and of those in it, with their whole names."""
    inside = getattr(group, "commands", {})
    return [name] if not inside else [one for word, each in inside.items() for one in commands(each, f"{name} {word}")]


def test_every_page_is_there_and_in_the_navigation(pages: dict[str, str]) -> None:
    navigation = pages["index.html"].partition("</nav>")[0] + pages["index.html"]
    for page in PAGES:
        assert f"{page}.html" in pages
        assert f'href="{page}.html"' in navigation
    for page in ("contributing", "changelog", "benchmarks"):
        assert f"{page}.html" in pages


def test_nothing_is_fetched_from_a_network(site: Path, pages: dict[str, str]) -> None:
    """Scripts, styles, pictures and fonts are files of the site; links that a reader follows may lead elsewhere."""
    for name, text in pages.items():
        fetched = re.findall(r"<(?:script|link|img|iframe|source|object)\b[^>]*?(?:src|href|data)=\"([^\"]*)\"", text)
        assert len(fetched) > 3
        for target in fetched:
            assert not re.match(r"(\w+:)?//", target), f"{name}: {target}"
            if not target.startswith("data:"):
                assert (site / name).parent.joinpath(re.sub(r"[?#].*", "", target)).exists(), f"{name}: {target}"
        assert "mathjax" not in text.lower(), name
    for style in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", style.read_text(encoding="utf-8")), style.name


def test_equations_are_set(pages: dict[str, str]) -> None:
    source = (ROOT / "mcnav" / "docs" / "THEORY.md").read_text(encoding="utf-8")
    assert pages["theory.html"].count("<math ") == source.count("```math") > 10
    for name, text in pages.items():
        assert "highlight-math" not in text, name


def test_every_link_leads_to_a_page_and_an_anchor(site: Path, pages: dict[str, str]) -> None:
    anchors = {name: set(re.findall(r'\bid="([^"]+)"', text)) for name, text in pages.items()}
    count = 0
    for name, text in pages.items():
        for target in re.findall(r'<a\b[^>]*?href="([^"]+)"', text):
            if re.match(r"\w+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = ((site / name).parent / path).resolve() if path else (site / name).resolve()
            assert file.exists(), f"{name}: {target}"
            if anchor and file.suffix == ".html" and (there := str(file.relative_to(site.resolve()))) in anchors:
                assert anchor in anchors[there], f"{name}: {target}"
            count += 1
    assert count > 1_000


def test_every_public_name_is_documented(pages: dict[str, str]) -> None:
    documented = set(re.findall(r'id="(mcnav\.\w+)"', pages["reference/api.html"]))
    assert documented == {f"mcnav.{name}" for name in mcnav.__all__}


def test_every_key_is_documented(pages: dict[str, str]) -> None:
    page = pages["reference/keys.html"]
    sections = re.split(r"<h2>", page)
    rows = {
        section.partition("<a ")[0]: re.findall(r"<tr[^>]*><td><p><code[^>]*><span class=\"pre\">(\w+)</span>", section)
        for section in sections
    }
    assert set(CampaignTable.model_fields) | {*FURTHER_NAMES} == set(rows["Top level"])
    assert sum(map(len, rows.values())) > 300


def test_every_command_and_every_example_has_a_section(pages: dict[str, str]) -> None:
    headings = re.findall(r"<h2>(.*?)<a ", pages["reference/commands.html"])
    assert headings == commands(get_command(app), "mcnav")
    examples = re.findall(r"<h2>(.*?)<a ", pages["reference/examples.html"])
    assert examples == sorted(file.stem for file in Path(ROOT / "campaigns").glob("*.toml"))


def test_every_example_is_in_the_gallery(site: Path, pages: dict[str, str]) -> None:
    """Its question stands there with its picture, which `.github/site/gallery.py` draws; it leads to the example."""
    page = pages["gallery.html"]
    examples = sorted(file.stem for file in Path(ROOT / "campaigns").glob("*.toml"))
    assert re.findall(r"<h2>(.*?)<a ", page) == examples
    stored = sorted(file.stem for file in (ROOT / ".github" / "site" / "static" / "gallery").glob("*.svg"))
    pictures = dict(re.findall(r'<img alt="Linear analysis of (\w+)" src="([^"]+)"', page))
    assert sorted(pictures) == stored == examples
    for name in examples:
        anchor = name.partition("_")[2].replace("_", "-")  # which begins with a letter
        assert f'href="reference/examples.html#{anchor}"' in page
    assert page.count("?</strong>") + page.count(".</strong>") == len(examples)
    assert page.count(">report<") == len(list((ROOT / "reports" / "examples").glob("*/report.html"))) > 2
