"""Flights for other viewers: what the libraries of their formats read back are the numbers of the run."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from czml3 import Document
from mcap.reader import make_reader
from scipy.spatial.transform import Rotation

from mcnav.config.read import parse_campaign
from mcnav.report.exports.flight import Flight, flight_of
from mcnav.report.exports.viewers import REACH
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.run import run_campaign
from tests.campaigns.test_aided import FOLDER, shortened
from tests.commands import in_process, invoke
from tests.conftest import campaign

DIGITS = 1e-9
"""Share of a position, 6.4e6 m, that fifteen printed digits and sums of it leave: below a hundredth of a millimetre."""


@pytest.fixture(scope="module", params=["aided", "reentry"])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("viewers") / "run"
    if request.param == "reentry":
        run_campaign(campaign(4, samples=50), folder, "ensemble", 1, report=False)
    else:
        described = shortened(20, 120.0, (60.0, 90.0)) | {"samples": 20}
        read = parse_campaign(described, str(FOLDER / "small.toml"), "small")
        run_campaign(read, folder, "ensemble", 1, report=False)
    return folder


@pytest.fixture(scope="module")
def errors(run: Path) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Times, s, and the position errors of all samples along east, north and up, shape (samples, times, 3)."""
    stored = RunFolder(run).histories(1000)
    assert stored is not None
    label, times, values = stored
    own = {name.partition(" [")[0]: each for name, each in values.items()}
    if "range" in own:
        parts = [own["range"], 0.0 * own["range"], own["altitude"]]
    else:
        parts = [own["position_east"], own["position_north"], -own["position_down"]]
    return times * (60.0 if "[min]" in label else 1.0), np.stack(parts, axis=-1)


def test_mcap_has_the_errors_and_sigmas_of_the_run(run: Path, errors: Any, tmp_path: Path) -> None:
    """Errors are along axes at the first position, which two minutes of flight turn by up to 1e-3 rad; sizes do not."""
    finished = invoke("export", run, "--flight", tmp_path / "flight.mcap", cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    times, expected = errors
    found: dict[str, list[Any]] = {}
    for _, channel, message in make_reader(io.BytesIO((tmp_path / "flight.mcap").read_bytes())).iter_messages():
        found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    assert set(found) == {"/true", "/navigated", "/covariance", "/position_error"}
    stamps = np.array([stamp for stamp, _ in found["/true"]])
    np.testing.assert_allclose((stamps - stamps[0]) * 1e-9, times - times[0], atol=1e-6)
    error, sigma = (
        np.array([[content[f"{what}_{axis}"] for axis in "enu"] for _, content in found["/position_error"]])
        for what in ("error", "sigma")
    )
    np.testing.assert_allclose(np.linalg.norm(error, axis=1), np.linalg.norm(expected[0], axis=1), rtol=1e-12)
    np.testing.assert_allclose(error[0], expected[0, 0], rtol=1e-12, atol=1e-9)
    spread = np.sqrt(expected.var(axis=0, ddof=1).sum(axis=1))
    np.testing.assert_allclose(np.linalg.norm(sigma, axis=1), spread, rtol=1e-9, atol=1e-9)
    places = {topic: np.array([list(content["pose"]["position"].values()) for _, content in found[topic]])
              for topic in ("/true", "/navigated")}  # fmt: skip
    np.testing.assert_allclose(places["/navigated"] - places["/true"], error, atol=DIGITS * 6.4e6)


def test_czml_has_the_paths_and_the_ellipsoid(run: Path, errors: Any, tmp_path: Path) -> None:
    finished = invoke("export", run, "--flight", tmp_path / "flight.czml", cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    packets = {packet["id"]: packet for packet in json.loads((tmp_path / "flight.czml").read_text(encoding="utf-8"))}
    assert list(packets) == ["document", "true", "navigated", "covariance"]
    assert Document.model_validate({"packets": list(packets.values())[1:]}) is not None
    times, expected = errors
    true, navigated = (np.reshape(packets[name]["position"]["cartesian"], (-1, 4)) for name in ("true", "navigated"))
    np.testing.assert_allclose(true[:, 0], times, atol=1e-9)
    off = np.linalg.norm(navigated[:, 1:] - true[:, 1:], axis=1)
    np.testing.assert_allclose(off, np.linalg.norm(expected[0], axis=1), atol=DIGITS * 6.4e6)
    radii = np.reshape(packets["covariance"]["ellipsoid"]["radii"]["cartesian"], (-1, 4))[:, 1:]
    turned = Rotation.from_quat(np.reshape(packets["covariance"]["orientation"]["unitQuaternion"], (-1, 5))[:, 1:])
    drawn = turned.as_matrix() @ (np.eye(3) * ((radii / REACH) ** 2)[:, None, :]) @ turned.inv().as_matrix()
    flight = flight_of(RunFolder(run))
    largest = np.abs(flight.covariance).max(axis=(1, 2))[:, None, None]
    np.testing.assert_allclose(drawn / largest, flight.covariance / largest, atol=1e-9)
    assert np.all(np.einsum("ki,ki->k", turned.as_quat()[1:], turned.as_quat()[:-1]) > 0.0)  # no jumps between


def test_axes_of_ellipsoids_follow_each_other() -> None:
    """Of a turning ellipsoid whose sizes cross, each axis keeps its place."""
    angles = np.linspace(0.0, 1.5, 41)
    turns = Rotation.from_euler("z", angles[:, None]).as_matrix()
    sizes = np.stack([1.0 + angles, 2.0 - angles, np.full(41, 0.1)], axis=1)
    covariance = turns @ (np.eye(3) * (sizes**2)[:, None, :]) @ np.swapaxes(turns, 1, 2)
    zeros = np.zeros((41, 3))
    semi, directions = Flight("f", angles, zeros, zeros, covariance, np.eye(3), 0, 2).ellipsoids
    assert np.abs(np.diff(semi, axis=0)).max() < 0.08
    assert np.einsum("kji,kji->ki", directions[1:], directions[:-1]).min() > 0.99


def test_what_cannot_be_written_is_told_in_one_line(run: Path, tmp_path: Path) -> None:
    finished = invoke("export", run, "--flight", tmp_path / "flight.txt", cwd=tmp_path)
    assert finished.returncode == 2
    assert len(finished.stderr.strip().splitlines()) == 1
    assert ".czml" in finished.stderr


def test_a_file_of_another_kind_is_refused_by_the_name_of_the_option(tmp_path: Path) -> None:
    done = in_process("export", tmp_path, "--flight", "flight.docx")
    assert done.exit_code == 2
    assert "--flight: got flight.docx; expected a folder, or a file that ends in .czml or .mcap" in done.output
