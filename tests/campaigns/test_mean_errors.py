"""A mean error above one sigma is said first, and comparisons use root mean squares.

Trajectory 4 of NASA TN D-1772 with accelerometers off above 80 km: the atmosphere above decelerates the vehicle, and
nothing measures it. Sigmas fall, and the errors grow.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mcnav.config.read import parse_campaign, read_campaign
from mcnav.report.columns.output_columns import outputs_frame
from mcnav.report.figures.lincov import sigmas
from mcnav.report.pages.lincov import statements as said_by_linear_analysis
from mcnav.report.statements.means import large_means_of, mean_sentence
from mcnav.report.statements.verdicts import standing, statements, tone
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.run import run_campaign
from tests.commands import in_process
from tests.conftest import ROOT

ERRORS = {
    "altitude": "5 km", "range": "0.5 km", "altitude_rate": "0.5 m/s", "range_rate": "0.02 m/s",
    "misalignment": "0.2 mrad", "gyro_drift": "1e-6 rad/s", "bias_x": "100 ug", "bias_z": "100 ug",
}  # fmt: skip
PLAIN = """
from mcnav import Output, Source


class Plain:
    sources = (Source("a", "m", "m", 1.0), Source("b", "m", "m", 1.0))
    outputs = (Output("y", "m", "m"),)

    def propagate(self, errors):
        return 2.0 * errors.sum(axis=1, keepdims=True)
"""

ALTITUDE = 386.97
"""Mean altitude error, km, by a simulation of the navigator without errors along the flight."""

VERDICT = "Every sigma is right. The samples do not decide on the full covariance matrix."
FIRST = "The mean error of altitude is +387 km, "


def reentry(off_above: str | None = None, **changes: Any) -> dict[str, Any]:
    """Return trajectory 4, with accelerometers off above an altitude."""
    off = {} if off_above is None else {"accelerometers_off_above": off_above}
    scenario = {"type": "reentry", "trajectory": 4, **off}
    return {"samples": 1_000, "seed": 5, "scenario": scenario, "errors": ERRORS} | changes


def written(folder: Path, content: dict[str, Any], name: str = "switched") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(tomli_w.dumps({"name": name, **content}), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def switched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a run of each: ``off`` above 80 km, and ``on``."""
    folder = tmp_path_factory.mktemp("means")
    for name, off_above in (("off", "80 km"), ("on", None)):
        done = in_process("run", written(folder, reentry(off_above), name), "--out", folder / name, "--jobs", "1")
        assert done.exit_code == 0, done.output
    return folder


def test_a_run_says_the_mean_first(switched: Path) -> None:
    summary = json.loads((switched / "off" / "summary.json").read_text(encoding="utf-8"))
    low, high = summary["mean_error_interval"][0]
    assert low <= summary["mean_error"][0] <= high
    assert summary["mean_error"][0] / 1e3 == pytest.approx(ALTITUDE, abs=0.1)  # less what second-order terms add
    for command in (("show", switched / "off"), ("run", switched / "off.toml", "--out", switched / "off")):
        lines = in_process(*command).output.splitlines()
        said = next(place for place, line in enumerate(lines) if line.startswith(FIRST))
        assert said < next(place for place, line in enumerate(lines) if line.startswith(VERDICT))
        assert "mean error" in next(line for line in lines if line.startswith("final error"))
    page = (switched / "off" / "report.html").read_text(encoding="utf-8")
    assert page.index(FIRST) < page.index(VERDICT)
    assert "Mean errors above one sigma" in page  # its title


def test_other_pages_say_the_mean_first(switched: Path) -> None:
    in_process("report", "--index", switched)
    page = (switched / "index.html").read_text(encoding="utf-8")
    assert page.index(FIRST) < page.index(VERDICT)
    assert "means above one sigma" in page
    done = in_process("brief", switched / "off", "--out", switched / "brief")
    assert done.exit_code == 0, done.output
    page = (switched / "brief" / "brief.html").read_text(encoding="utf-8").partition("<body")[2]
    assert page.index(FIRST) < page.index("Share of each cause")
    lincov = in_process("lincov", switched / "off.toml", "--out", switched / "lincov").output.splitlines()
    assert lincov[0].startswith(FIRST)
    limit = {"quantile": [{"output": "altitude", "probability": 0.9, "below": "400 km"}]}
    path = written(switched, reentry("80 km", accept=limit), "limited")
    assert in_process("allocate", path, "--confirm", 0, "--out", switched / "allocate").output.startswith(FIRST)


def test_a_comparison_ranks_by_root_mean_squares(switched: Path) -> None:
    """Each sigma of the run without accelerometers is smaller, and each error larger."""
    comparison = compare_runs([switched / "on", switched / "off"])
    assert [row.words for row in comparison.rows] == ["larger"] * 4
    change = comparison.rows[0].known
    assert change.about_zero
    off, on = (json.loads((switched / name / "summary.json").read_text(encoding="utf-8")) for name in ("off", "on"))
    assert off["sigma_paired"][0] < on["sigma_paired"][0]
    expected = float(np.hypot(off["sigma_paired"][0], off["mean_error"][0]))
    assert change.after == pytest.approx(expected, rel=1e-3)  # of the variance's degrees of freedom
    printed = in_process("compare", switched / "on", switched / "off").output
    assert printed.index("mean error of altitude") < printed.index("Change from")


def test_a_sweep_ranks_by_root_mean_squares(switched: Path) -> None:
    plan = SweepPlan({"scenario.accelerometers_off_above": "80, 100, 120 km"})
    sweep = run_sweep(switched / "off.toml", plan)
    assert np.argmax(sweep.values[:, 0]) == 0  # by its sigma it would be the best
    assert sweep.means is not None
    assert sweep.means[0, 0] / 1e3 == pytest.approx(ALTITUDE, abs=0.005)
    arguments = ("--vary", "scenario.accelerometers_off_above=80, 100, 120 km", "--out", switched / "sweep")
    printed = in_process("sweep", switched / "off.toml", *arguments).output
    assert printed.startswith("At 1 of 3 points a mean error exceeds its sigma: that of altitude is +387 km")
    assert "altitude, root mean square [km]" in printed
    limited = run_sweep(switched / "off.toml", SweepPlan(plan.varied, against=["altitude < 50 km"]))
    assert limited.margins[0, 0] > 0.0


def test_a_mean_by_sampling_noise_is_not_said(switched: Path) -> None:
    """The plain mean of 1,000 samples is off by some hundredths of a sigma."""
    done = run_campaign(
        parse_campaign(reentry(), "on.toml", "on"), switched / "plain", "ensemble", jobs=1, report=False
    )
    summary = done.results
    assert np.abs(np.array(summary.mean_sample) / np.array(summary.sigma_paired)).max() > 0.01
    assert mean_sentence(summary) == ""
    assert standing(summary) == tone(summary)
    assert "mean_error" not in outputs_frame(summary)
    assert "mean error" not in in_process("show", switched / "on").output


@pytest.mark.parametrize(("multiple", "said"), [(0.5, False), (0.95, False), (1.05, True), (3.0, True)])
def test_a_mean_is_said_from_one_sigma_on(multiple: float, said: bool, tmp_path: Path) -> None:
    """A source's mean, of an output that is linear in it: the paired mean has no sampling noise."""
    (tmp_path / "plain.py").write_text(PLAIN, encoding="utf-8")
    errors = {"a": "3 m", "b": {"distribution": "fixed", "value": f"{3.0 * multiple} m"}}
    content = {"samples": 200, "seed": 1, "scenario": {"type": "plain.py:Plain"}, "errors": errors}
    path = written(tmp_path, content, "plain")
    done = in_process("run", path, "--out", tmp_path / "run", "--jobs", "1")
    assert done.exit_code == 0, done.output
    assert (" times its sigma of 6.00 m" in done.output) == said
    assert in_process("lincov", path, "--out", tmp_path / "lincov").output.startswith("The mean error of y is") == said


def test_statements_begin_with_the_mean(switched: Path) -> None:
    done = run_campaign(
        parse_campaign(reentry("80 km"), "off.toml", "off"), switched / "again", "ensemble", jobs=1, report=False
    )
    first, *others = statements(done.results)
    assert first.subject == "means"
    assert others[0].sentence.startswith(VERDICT)
    assert standing(done.results) == "partly"
    assert [mean.output for mean in large_means_of(done.results)] == [0, 2, 1, 3]
    answer = linear_covariance(reentry("80 km"))
    assert answer.mean[0] / 1e3 == pytest.approx(ALTITUDE, abs=0.005)


def test_a_filter_that_fails_is_said_before_its_mean_errors() -> None:
    """As on the page of a run; the figure shows root mean squares, in which the ramp of the receiver is seen."""
    answer = answer_linearly(read_campaign(ROOT / "campaigns" / "31_flight_with_a_faulty_receiver.toml"))
    first, second, *_ = said_by_linear_analysis(answer)
    assert first[0].startswith("The filter is optimistic by a factor of 13.9 from 41 min on")
    assert second[0].startswith("The mean error of heading")
    figure = sigmas(answer, {})
    assert figure is not None
    assert answer.filter is not None
    own, size = (figure.columns[f"position east, {words} [m]"] for words in ("filter's 1σ", "rms"))
    assert np.max(size / own) == pytest.approx(answer.filter.factor, rel=1e-6)
