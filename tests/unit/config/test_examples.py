"""Examples that come with the program."""

from __future__ import annotations

from pathlib import Path

import pytest

from mcnav.config.read import read_campaign
from mcnav.entries.examples import FIRST, copy_examples, example, examples, examples_folder
from mcnav.errors import CampaignError
from tests import campaign_list
from tests.commands import invoke
from tests.conftest import ROOT


def test_every_campaign_is_an_example_with_a_question() -> None:
    assert examples_folder() == ROOT / "campaigns"
    assert list(examples()) == sorted(path.stem for path in (ROOT / "campaigns").glob("*.toml"))
    for question in examples().values():
        assert "?" in question
        assert "#" not in question


def test_the_page_of_the_campaigns_is_current() -> None:
    """Written again from the headers, it is the same: `python -m tests.campaign_list`; every question has an answer."""
    assert campaign_list.page() == campaign_list.PAGE.read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in campaign_list.page().splitlines() if line.startswith("| [")]
    assert len(rows) == len(examples())
    assert all(len(row) == 3 and row[2].removesuffix(" |") for row in rows)


@pytest.mark.parametrize("name", ["1", "01", FIRST])
def test_an_example_by_number_or_name(name: str) -> None:
    assert example(name) == ROOT / "campaigns" / f"{FIRST}.toml"


@pytest.mark.parametrize("name", ["0", "99", "1_", "polar", "../14_polar", "", "²"])
def test_what_is_no_example(name: str) -> None:
    with pytest.raises(CampaignError, match=r"^NAME: no example "):
        example(name)


def test_copies_can_be_read_and_are_made_again(tmp_path: Path) -> None:
    for _ in range(2):
        copies = copy_examples(tmp_path / "campaigns")
    assert {path.name: path.read_bytes() for path in copies} == {
        path.name: path.read_bytes() for path in (ROOT / "campaigns").iterdir() if path.is_file()
    }
    assert read_campaign(tmp_path / "campaigns" / "15_flight_navigation_grade.toml").name


def test_a_changed_copy_is_kept(tmp_path: Path) -> None:
    (tmp_path / "polar.py").write_text("mine")
    (tmp_path / "boost.py").mkdir()
    with pytest.raises(CampaignError) as found:
        copy_examples(tmp_path)
    assert [problem.file for problem in found.value.problems] == [
        str(tmp_path / name) for name in ("boost.py", "polar.py")
    ]
    assert (tmp_path / "polar.py").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 2


def test_the_command(tmp_path: Path) -> None:
    listed = invoke("demo", "--list", cwd=tmp_path)
    assert listed.stdout.partition("\n\nnext: ")[0].splitlines()[::2] == list(examples())
    assert invoke("demo", "--copy", "mine", cwd=tmp_path).stdout.endswith(
        f"written: mine\n\nnext: mcnav run mine/{next(iter(examples()))}.toml\n"
    )
    assert (tmp_path / "mine" / "flight.csv").exists()
    refused = invoke("demo", "polr", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: NAME: no example 'polr'; ")
    done = invoke("demo", "14", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.splitlines()[1] == "NO  The linear sigma is wrong for y."
    assert "\nReport:   reports/14_polar/report.html\nLook:     mcnav report reports/14_polar --open\n" in done.stdout
    assert (tmp_path / "reports" / "14_polar" / "report.html").exists()
