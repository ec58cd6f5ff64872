"""Runs from Python: campaigns in three forms, tables with one label for one thing, folders that hold no run."""

from __future__ import annotations

import doctest
import inspect
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w

import mcnav
from mcnav.config.read import read_campaign
from mcnav.frames.runs import RunResult
from mcnav.store.run_folder import RunFolder
from tests.docstrings import unsaid

OUTPUTS = ["altitude", "range", "altitude_rate", "range_rate"]
SOURCES = ["altitude", "misalignment", "gyro_drift"]


def described(**more: Any) -> dict[str, Any]:
    errors = {"misalignment": "1 mrad", "gyro_drift": "0.1 deg/h", "altitude": "100 m"}
    scenario = {"type": "reentry", "trajectory": 4}
    return {"samples": 300, "seed": 5, "scenario": scenario, "errors": errors} | more


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return mcnav.run(described(), tmp_path_factory.mktemp("api") / "run", jobs=1)


def test_a_file_a_campaign_and_a_dictionary_are_one(run: RunResult, tmp_path: Path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(tomli_w.dumps(described()))
    for number, campaign in enumerate((path, str(path), mcnav.read_campaign(str(path)))):
        again = mcnav.run(campaign, tmp_path / str(number), jobs=1)
        pd.testing.assert_frame_equal(again.samples, run.samples, check_exact=True)
        pd.testing.assert_frame_equal(again.outputs, run.outputs, check_exact=True)
    assert mcnav.run_campaign(described(), tmp_path / "0", None, 1).simulated == 0  # the run that the file's was


@pytest.mark.parametrize("form", ["file", "campaign", "dictionary"])
def test_other_samples_and_another_seed(form: str, run: RunResult, tmp_path: Path) -> None:
    """In the run folder's own campaign too, which runs the same again."""
    path = tmp_path / "campaign.toml"
    path.write_text(tomli_w.dumps(described(samples=100, seed=1)))
    forms = {"file": path, "campaign": mcnav.read_campaign(path), "dictionary": described(samples=100, seed=1)}
    again = mcnav.run(forms[form], tmp_path / "run", jobs=1, samples=300, seed=5)
    pd.testing.assert_frame_equal(again.samples, run.samples, check_exact=True)
    kept = mcnav.read_campaign(tmp_path / "run" / "campaign.toml")
    assert (kept.samples, kept.seed) == (300, 5)
    with pytest.raises(mcnav.CampaignError, match=r"samples: got 1; expected"):
        mcnav.run(forms[form], tmp_path / "none", samples=1)
    assert not (tmp_path / "none").exists()


def test_a_campaign_refuses_what_it_cannot_change(tmp_path: Path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(tomli_w.dumps(described()))
    with pytest.raises(
        mcnav.CampaignError, match=r"store: cannot be replaced in a Campaign; only samples and seed can"
    ):
        mcnav.run(read_campaign(path), tmp_path / "run", store="summary")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ({"seed": "one"}, r"^campaign: seed: got 'one'; expected a whole number$"),
        ({"errors": {"altitud": "1 m"}}, r"^campaign: errors.altitud: "),
        ({"name": None}, r"^campaign: contains what no campaign file can \(.*NoneType.*\); use text, numbers"),
        ({"scenario": {"type": "nowhere.py:Mine"}}, r"^campaign: scenario.type: nowhere.py does not exist"),
    ],
)
def test_a_dictionary_with_a_mistake(more: dict[str, Any], line: str, tmp_path: Path) -> None:
    """Its lines begin with ``campaign`` in place of a file."""
    with pytest.raises(mcnav.CampaignError, match=line):
        mcnav.run(described(**more), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_files_of_a_dictionary_are_found_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(
        "from mcnav import Output, Source\n\nclass Mine:\n    sources = (Source('a', 'm', 'm', 1.0),)\n"
        "    outputs = (Output('b', 'm', 'm'),)\n\n    def propagate(self, errors):\n        return 2.0 * errors\n"
    )
    table = {"distribution": "table", "file": "a.csv", "column": "a", "unit": "m"}
    (tmp_path / "a.csv").write_text("a\n" + "\n".join(map(str, range(50))))
    campaign = {"samples": 50, "seed": 1, "scenario": {"type": "mine.py:Mine"}, "errors": {"a": "1 m"}}
    monkeypatch.chdir(tmp_path)
    assert len(mcnav.run(campaign, "run", jobs=1).samples) == 50
    assert all(check.passed for check in mcnav.check_scenario(campaign))
    found = mcnav.run(campaign | {"errors": {"a": table}}, "table", jobs=1)
    assert set(found.samples["error a [m]"]) <= set(range(50))


def test_one_label_for_one_thing(run: RunResult) -> None:
    """Keys, in every table; units in the column ``unit``, in names of columns, or in ``attrs`` of a matrix."""
    matrices = (run.partials, run.covariance())
    assert [list(table.index) for table in (run.outputs, *matrices)] == [OUTPUTS] * 3
    assert list(run.budget.columns) == list(run.covariance().columns) == OUTPUTS
    assert list(run.budget.index) == list(run.partials.columns)
    assert set(SOURCES) <= set(run.budget.index)
    assert run.outputs.loc["altitude_rate", "unit"] == "m/s"
    assert [f"output {key} [{unit}]" for key, unit in run.partials.attrs["units"]["index"].items()] == list(
        run.samples.filter(like="output")
    )
    assert [f"error {key} [{unit}]" for key, unit in run.partials.attrs["units"]["columns"].items()] == list(
        run.samples.filter(like="error")
    )
    effect = run.partials.loc["range_rate", "gyro_drift"] * np.deg2rad(0.1) / 3600.0
    share = effect**2 / run.covariance("linear").loc["range_rate", "range_rate"]
    assert share == pytest.approx(run.budget.loc["gyro_drift", "range_rate"], rel=1e-9)


def test_covariance_in_either_units(run: RunResult) -> None:
    si, shown = run.covariance("paired"), run.covariance("paired", units="shown")
    assert si.attrs["units"]["index"] == dict(zip(OUTPUTS, ["m", "m", "m/s", "m/s"], strict=True))
    assert shown.attrs["units"]["columns"] == dict(run.outputs["unit"])
    np.testing.assert_allclose(np.sqrt(np.diag(shown)), run.outputs["sigma_paired"], rtol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(si)), run.summary["sigma_paired"], rtol=1e-12)
    with pytest.raises(ValueError, match="units must be one of SI, shown; got 'km'"):
        run.covariance(units="km")


def test_where_there_is_no_run(tmp_path: Path, run: RunResult) -> None:
    """No folder, a file, a folder without a run, one that is not finished: each is said, and nothing is made there."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    mcnav.run(described(), tmp_path / "broken off", jobs=1)
    broken = RunFolder(tmp_path / "broken off")
    broken.finish(broken.existing_manifest().model_copy(update={"complete": False}), {})
    said = {
        "nowhere": r"nowhere: holds no run \(there is no such folder\); mcnav run CAMPAIGN makes one$",
        "file": r"file: holds no run \(it is a file\); mcnav run CAMPAIGN makes one$",
        "empty": r"empty: holds no run \(manifest.json is missing\)$",
        "broken off": r"broken off: the run is not finished; run the campaign again",
    }
    for name, line in said.items():
        for opened in (mcnav.open_run, mcnav.report_run, mcnav.samples_of):
            with pytest.raises(mcnav.RunFolderError, match=line):
                opened(str(tmp_path / name))
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted({*said} - {"nowhere"})


def test_the_names_of_the_package_are_the_public_ones() -> None:
    assert dir(mcnav) == sorted(mcnav.__all__)
    assert all(hasattr(mcnav, name) for name in dir(mcnav))


@pytest.mark.parametrize("name", mcnav.__all__)
def test_every_public_object_states_shapes_units_and_errors_and_has_an_example_that_is_run(name: str) -> None:
    """Examples are run by ``--doctest-modules``, unless they are skipped."""
    described = getattr(mcnav, name)
    documentation = inspect.getdoc(described) or ""
    examples = doctest.DocTestParser().get_examples(documentation)
    run = [example.source for example in examples if not example.options.get(doctest.SKIP)]
    assert [source for source in run if not source.startswith(("import ", "from "))]
    if inspect.isfunction(described):
        assert "Raises" in documentation
    assert unsaid(described) == []


def test_cards_of_a_notebook_do_not_disturb_each_other(run: RunResult) -> None:
    """Every name on a card is its own and is there; its style applies within it; nothing is loaded or executed."""
    answer = mcnav.linear_covariance(described())
    cards = [run._repr_html_(), answer._repr_html_() or ""]
    names = [re.findall(r' id="([^"]+)"', card) for card in cards]
    assert all(names)
    every = [*names[0], *names[1]]
    assert len(set(every)) == len(every)
    for card, known in zip(cards, names, strict=True):
        assert set(re.findall(r"url\(#([^)]+)\)", card)) | set(re.findall(r'aria-\w+="(\S+-d-\w+)"', card)) <= set(
            known
        )
        assert "<script" not in card
        assert not re.search(r"(src|href)=|@import|url\((?!#)", card)
        style = card.partition("<style>")[2].partition("</style>")[0]
        assert style.startswith(".mcnav { ")
        depths = np.cumsum([{"{": 1, "}": -1}.get(character, 0) for character in style.rstrip()])
        assert depths[-1] == 0
        assert depths[style.index("{") : -1].min() >= 1


def test_linear_covariance_in_a_notebook(run: RunResult) -> None:
    """It is shown with its requirements and causes, survives a pickle, and is one line where there is no page."""
    accept = {"quantile": [{"output": "altitude", "probability": 0.95, "below": "1000 km"}]}
    answer = mcnav.linear_covariance(described(name="<b>some</b>", accept=accept))
    again = pickle.loads(pickle.dumps(answer))
    assert again._repr_html_() == answer._repr_html_()
    shown = answer._repr_html_() or ""
    assert "<strong>&lt;b&gt;some&lt;/b&gt;</strong>" in shown
    assert shown.count("<figure ") == 2
    assert repr(answer) == "<b>some</b>: linear covariance of 4 outputs, 1 of 1 requirements met"
    assert replace(answer, card=None)._repr_html_() is None
