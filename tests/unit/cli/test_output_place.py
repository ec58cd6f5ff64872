"""Where ``--out`` leads: a folder, or the one file that a command writes; a mistake has its remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from mcnav.cli.output_place import ENDINGS, output_file, output_folder
from mcnav.errors import CampaignError


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_folder_is_not_named_like_a_file(ending: str) -> None:
    with pytest.raises(CampaignError, match=r"expected a folder, such as reports.answer"):
        output_folder(Path(f"reports/answer{ending}"), Path("reports/default"))


def test_a_folder_that_exists_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / "answer.html"
    folder.mkdir()
    assert output_folder(folder, tmp_path) == folder
    assert output_file(folder, "page.html", [".html"]) == folder / "page.html"


def test_a_file_is_not_taken_for_a_folder(tmp_path: Path) -> None:
    file = tmp_path / "notes"
    file.write_text("mine")
    with pytest.raises(CampaignError, match=r"which is a file; expected a folder$"):
        output_folder(file, tmp_path)
    with pytest.raises(CampaignError, match=r"ends in \.pdf, \.svg or \.png"):
        output_file(file, "scatter.pdf", (".pdf", ".svg", ".png"))


@pytest.mark.parametrize("given", ["scatter.html", "scatter.txt", "flight.kml", "flight.czml", "page.htm"])
def test_a_file_has_an_ending_that_the_command_writes(given: str) -> None:
    with pytest.raises(CampaignError, match=r"ends in \.pdf or \.svg"):
        output_file(Path(given), "scatter.pdf", (".pdf", ".svg"))


def test_a_version_in_the_name_of_a_folder_is_no_ending() -> None:
    assert output_folder(Path("reports/run_1.2"), Path()) == Path("reports/run_1.2")
    assert output_file(Path("reports/run_1.2"), "page.html", [".html"]) == Path("reports/run_1.2/page.html")
