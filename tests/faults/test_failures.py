"""Samples that fail: each is a row with its reason, the rest is as if they had never been, and each can be replayed."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError, RunFolderError, TooManyFailures
from mcnav.workflow.replay import as_stored, replay, write_replay
from mcnav.workflow.run import run_campaign
from tests.commands import in_process
from tests.conftest import campaign
from tests.faults.scenarios import VECTORISED, write_campaign
from tests.printed import count_scripts
from tests.runs import simulate

LIMIT = 'sample_timeout = "3 s"'  # flying a sample that is well takes microseconds, whatever else the machine does

REASONS = {
    "raise ValueError('no fuel')": "ValueError: no fuel (line 14)",
    "return np.array([np.nan, 0.0])": "an output is not finite",
    "return np.array([np.inf, 0.0])": "an output is not finite",
    "raise SystemExit(3)": "SystemExit: 3 (line 20)",
    "time.sleep(60)": "took longer than 3 s",
    "return [1.0]": "ValueError: fly must return shape (2,); got (1,)",
    "os._exit(9)": "the worker process died while flying it",
    "ctypes.PyDLL(None).sleep(60)": "took longer than 3 s",  # listens to no signal, keeps the interpreter to itself
}


def test_poison_samples_fail_alone(tmp_path: Path) -> None:
    """Whatever they do, each is one row with its reason; the others come out as they would have without them."""
    calm = read_campaign(write_campaign(tmp_path / "calm", "", samples=60))
    drawn = calm.errors.draw("random", 1, 60, 0, 60)[:, 0]
    chosen = dict(zip(np.sort(drawn)[: len(REASONS)].tolist(), REASONS, strict=True))
    body = "\n".join(f"if a == {value!r}:\n    {act}" for value, act in chosen.items())
    poisoned = read_campaign(write_campaign(tmp_path / "hit", body, samples=60, more=LIMIT))
    summary = simulate(poisoned, tmp_path / "hit" / "run", None, 2).summary
    simulate(calm, tmp_path / "calm" / "run", None, 1)
    hit, other = (mcnav.samples_of(tmp_path / name / "run") for name in ("hit", "calm"))
    expected = [f"failed: {REASONS[chosen[value]]}" if value in chosen else "ok" for value in drawn.tolist()]
    assert hit["status"].tolist() == expected
    assert summary["failed"] == len(REASONS)
    lost = hit["status"] != "ok"
    assert hit.filter(like="output")[lost].isna().all(axis=None)
    pd.testing.assert_frame_equal(hit[~lost], other[~lost], check_exact=True)


def test_flights_on_the_side_may_end_their_process(tmp_path: Path) -> None:
    """The unscented transform's points lie where every flight is deadly, and there is one worker only."""
    run = read_campaign(write_campaign(tmp_path, "if abs(a) > 0.9: os._exit(9)", samples=8))
    summary = simulate(run, tmp_path / "run", None, 1).summary
    samples = mcnav.samples_of(tmp_path / "run")
    assert ((samples["status"] != "ok") == (samples["error a [m]"].abs() > 0.9)).all()
    assert "died while flying it" in (tmp_path / "run" / "manifest.json").read_text()
    assert summary["failed"] > 0


def test_a_vectorised_sample_that_hangs(tmp_path: Path) -> None:
    """With a limit it flies in worker processes; the call is told to stop, and who was at fault is found."""
    calm = read_campaign(write_campaign(tmp_path / "calm", "", VECTORISED, samples=60))
    largest = float(calm.errors.draw("random", 1, 60, 0, 60)[:, 0].max())
    body = f"if (a == {largest!r}).any(): time.sleep(60)"
    run = read_campaign(write_campaign(tmp_path, body, VECTORISED, samples=60, more=LIMIT))
    summary = simulate(run, tmp_path / "run", None, 1).summary
    samples = mcnav.samples_of(tmp_path / "run")
    assert summary["failures"] == {"failed: took longer than 3 s": 1}
    assert ((samples["status"] != "ok") == (samples["error a [m]"] == largest)).all()


def test_too_many_failures_break_off(tmp_path: Path) -> None:
    """What is stored is kept; a run that may go on does."""
    run = read_campaign(write_campaign(tmp_path, "if a > 0.5: raise ValueError('no fuel')", samples=200))
    with pytest.raises(TooManyFailures, match=r"of the \d+ samples flown so far failed, where 5 may"):
        simulate(run, tmp_path / "run", None, 1, most_failures=5)
    assert 0 < len(list((tmp_path / "run" / "samples").glob("part-*.parquet"))) < 8
    done = simulate(run, tmp_path / "run", None, 1, most_failures=199)
    assert 0 < done.simulated < 200
    assert 0 < done.summary["failed"] < 100
    with pytest.raises(TooManyFailures):
        simulate(run, tmp_path / "run", None, 1, most_failures=5)


def test_tracebacks_are_kept_and_replayed(tmp_path: Path) -> None:
    """The traceback is that of the user's own line; the history of such a scenario is its errors and outcomes."""
    path = write_campaign(tmp_path, "if a > 2.2:\n    raise ValueError(f'no fuel at {a}')", samples=60)
    run_campaign(read_campaign(path), tmp_path / "run", None, 1)
    samples = mcnav.samples_of(tmp_path / "run")
    index = int(np.flatnonzero(samples["status"] != "ok")[0])
    with pytest.raises(CampaignError, match=r"which is code; nothing in a run folder is executed"):
        replay(tmp_path / "run", index)
    found = replay(tmp_path / "run", index, path)
    assert as_stored(found)
    assert "no fuel at" in found.outcomes[0].status
    assert found.traceback.startswith("Traceback")
    assert "line 14, in fly\n    raise ValueError(f'no fuel at {a}')" in found.traceback
    page, table = write_replay(found, tmp_path / "elsewhere")
    assert "no fuel at" in page.read_text()
    assert [row["flown"] for row in csv.DictReader(table.read_text().splitlines())] == ["stored", "again, single"]
    other = write_campaign(tmp_path / "other", "if a > 2.3: raise ValueError('no fuel')", samples=60)
    with pytest.raises(RunFolderError, match="is not the campaign that was flown"):
        replay(tmp_path / "run", index, other)


def test_replay_of_a_reentry(tmp_path: Path) -> None:
    """A sample that failed, to where it failed; one that did not, to its final errors; what there is none of."""
    run = campaign(4, samples=32, errors={"altitude": {"distribution": "uniform", "half_width": "40000 km"}})
    run_campaign(run, tmp_path / "run", "ensemble", 1)
    samples = mcnav.samples_of(tmp_path / "run")
    for failed in (True, False):
        index = int(np.flatnonzero((samples["status"] != "ok") == failed)[2])
        done = in_process("replay", tmp_path / "run", index)
        assert done.exit_code == 0, done.output
        assert f"sample {index}" in done.output
        found = replay(tmp_path / "run", index)
        assert [outcome.label for outcome in found.outcomes] == ["stored", "again, ensemble", "again, reference"]
        assert found.errors[0] == samples["error altitude [m]"][index]
        page = (tmp_path / "run" / f"replay_{index}.html").read_text()
        assert count_scripts(page) == 1  # its own
        history = pd.read_csv(tmp_path / "run" / f"replay_{index}.csv")
        if len(history):
            last = history["altitude error [km]"].iloc[-1]
        if not failed:
            assert "<svg" in page
            assert 1e3 * last == pytest.approx(samples["output altitude [m]"][index], rel=1e-6)
    refused = in_process("replay", tmp_path / "run", "32")
    assert refused.exit_code == 2
    assert run_campaign(run, tmp_path / "run", "ensemble", 1).simulated == 0


def test_replay_of_a_cruise(tmp_path: Path) -> None:
    from mcnav.config.read import parse_campaign

    described = {"scenario": {"type": "cruise", "speed": "250 m/s", "duration": "1 h", "altitude": "10 km"}}
    described |= {"samples": 100, "seed": 1, "errors": {"misalignment": "1 mrad", "gyro_drift": "0.1 deg/h"}}
    simulate(parse_campaign(described, "test.toml", "test"), tmp_path / "run", "ensemble", 1)
    found = replay(tmp_path / "run", 7)
    assert as_stored(found)
    stored, _, reference = found.outcomes
    np.testing.assert_allclose(stored.values, reference.values, rtol=1e-4, atol=1e-6 * abs(stored.values).max())
    ends = [column[-1] for name, column in found.history.columns.items() if name.startswith("range error")]
    assert 1e3 * ends[0] == pytest.approx(reference.values[0], rel=1e-9)


def test_a_million_samples_one_in_a_hundred_failing(tmp_path: Path) -> None:
    """The covariance of the rest is exactly that of the rest; the report counts the others and says why."""
    body = """
    lost = np.abs(a) > 2.575829
    values = np.column_stack([2.0 * a, a + a**2])
    return Outcomes(values, {int(row): f"ran dry at {a[row]:.6f}" for row in np.flatnonzero(lost)})
    """
    path = write_campaign(
        tmp_path,
        body,
        VECTORISED.replace("import Output", "import Outcomes, Output"),
        1_000_000,
    )
    summary = run_campaign(read_campaign(path), tmp_path / "run", None, 2).summary
    samples = pd.read_parquet(tmp_path / "run" / "samples", columns=["status", "error a [m]"])
    a = samples["error a [m]"].to_numpy()
    rest = a[np.abs(a) <= 2.575829]
    failed = 1_000_000 - len(rest)
    assert summary["failed"] == failed
    assert abs(failed - 10_000) < 5.0 * 100.0
    assert summary["failures"] == {"failed: ran dry at …": failed}
    kept = samples["status"] == "ok"
    np.testing.assert_array_equal(a[kept], rest)
    outputs = np.column_stack([2.0 * rest, rest + rest**2])
    np.testing.assert_allclose(summary["covariance_sample"], np.cov(outputs.T), rtol=1e-12)
    whole = np.cov(np.column_stack([2.0 * a, a]).T, bias=True)
    expected = np.sqrt(np.cov(np.column_stack([2.0 * rest, rest]).T, bias=True).diagonal() / whole.diagonal())
    np.testing.assert_allclose(summary["excluded"]["sigma_ratio"], expected, rtol=1e-9)
    page = (tmp_path / "run" / "report.html").read_text()
    assert f"{failed:,} of 1,000,000 samples failed" in page
    assert f'<th scope="row" class="words">ran dry at …</th><td>{failed:,}</td>' in page
    for index in np.flatnonzero(~kept)[[0, -1]]:
        found = replay(tmp_path / "run", int(index), path)
        assert as_stored(found)
        assert found.outcomes[0].status == f"failed: ran dry at {a[index]:.6f}"
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["failed"] == failed
