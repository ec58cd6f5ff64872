"""Results for other programs: frames, data sets, CSV files, matrices for numpy and MATLAB."""

from __future__ import annotations

import csv
import io
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

import mcnav
from mcnav.config.read import parse_campaign
from mcnav.frames.runs import RunResult
from mcnav.physics.units import conversion
from mcnav.report.columns import tables_over_time as over_time
from mcnav.report.columns.over_time import TimeColumn
from mcnav.report.exports import arrays as matrices
from mcnav.report.exports.arrays import Matrix, as_mat
from mcnav.report.exports.dataset import dataset
from tests.campaigns.test_aided import FOLDER, shortened
from tests.commands import invoke
from tests.conftest import content

MATLAB_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
"""A name of a variable in a file of level 5."""

MATLAB_WORDS = {
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
}  # fmt: skip

HISTORIES = 1e-4
"""Numerical error of errors over the flight, over their sigma: see ARCHITECTURE, *histories have their own nodes*."""

FORMULA_NAME = '=HYPERLINK("http://x","y")'


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """A reentry with a requirement, whose name a spreadsheet would execute."""
    accept = {"quantile": [{"output": "altitude", "probability": 0.9, "below": "100 km"}]}
    folder = tmp_path_factory.mktemp("export") / "plain"
    return mcnav.run(content(4, name=FORMULA_NAME, samples=300, accept=accept), folder, jobs=1)


@pytest.fixture(scope="module")
def aided(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """Two minutes of campaign 20: noise, a filter with states of its own, and neglected errors."""
    folder = tmp_path_factory.mktemp("export") / "aided"
    described = shortened(20, 120.0, (60.0, 90.0)) | {"samples": 40}
    return mcnav.run(parse_campaign(described, str(FOLDER / "small.toml"), "small"), folder, jobs=1)


@pytest.fixture(scope="module")
def without_epochs(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return mcnav.run(FOLDER / "14_polar.toml", tmp_path_factory.mktemp("export") / "polar", jobs=1, samples=200)


def read(path: Path) -> dict[str, list[str]]:
    """Read the columns of a CSV file as text."""
    heading, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8")))
    return {name: [row[place] for row in rows] for place, name in enumerate(heading)}


def floats(cells: list[str]) -> np.ndarray:
    return np.array([float(cell or "nan") for cell in cells])


def test_the_last_epoch_is_the_end(plain: RunResult, aided: RunResult) -> None:
    for run in (plain, aided):
        time, output = run.epochs.index.names
        assert re.fullmatch(r"time.* \[min\]", time)
        assert output == "output"
        last = run.epochs.loc[run.epochs.index.get_level_values(0)[-1]]
        assert list(last["unit"]) == list(run.outputs["unit"])
        for kind in ("linear", "plain"):
            sigma = run.outputs[f"sigma_{kind}"]
            np.testing.assert_allclose(last[f"sigma_{kind}"], sigma, rtol=HISTORIES)
        assert (last["sigma_plain_from"] < last["sigma_plain"]).all()
        assert (last["sigma_plain"] < last["sigma_plain_to"]).all()


def test_sigmas_of_the_filter_are_at_every_epoch(aided: RunResult, plain: RunResult) -> None:
    found = aided.epochs
    np.testing.assert_allclose(found["rms"], np.hypot(found["mean_plain"], found["sigma_plain"] * np.sqrt(39 / 40)))
    np.testing.assert_allclose(found["ratio_filter"], found["rms"] / found["sigma_filter"], rtol=1e-9)
    last = found.loc[found.index.get_level_values(0)[-1]]
    own = [entry["sigma_filter"] for entry in aided.summary["filter"]["outputs"].values()]
    np.testing.assert_allclose(last["sigma_filter"], own * aided.content.output_scale, rtol=1e-12)
    assert found["within_1_sigma"].between(found["within_1_sigma_from"], found["within_1_sigma_to"]).all()
    assert not {"sigma_filter", "rms"} & set(plain.epochs)


def test_the_budget_over_time_ends_in_the_budget(plain: RunResult, aided: RunResult) -> None:
    for run in (plain, aided):
        table = run.tables["budget_over_time"].set_index(["output", "cause"])
        time = table.columns[0]
        last = table[table[time] == table[time].iloc[-1]]["share"].unstack()
        final = run.budget.T[last.columns].loc[last.index]
        np.testing.assert_allclose(last, final, atol=HISTORIES)


def test_every_table_is_a_file(plain: RunResult, aided: RunResult, tmp_path: Path) -> None:
    """Read back in full precision, with every table and figure listed."""
    for run in (plain, aided):
        folder = tmp_path / run.path.name
        files = run.export(folder)
        assert sorted(files) == sorted(path for path in folder.rglob("*") if path.is_file())
        listed = read(folder / "contents.csv")
        figures = {f"figures/{name}.csv" for name in run.drawings}
        assert set(listed["file"]) == {f"{name}.csv" for name in run.tables} | figures
        for name, table in run.tables.items():
            columns = read(folder / f"{name}.csv")
            assert list(columns) == list(table)
            assert {len(cells) for cells in columns.values()} == {len(table)}
            for column in table.select_dtypes("float"):
                expected = table[column].where(np.isfinite(table[column]))
                np.testing.assert_array_equal(floats(columns[column]), expected.to_numpy())
    expected = {"nees", "nis", "filter_states", "filter_groups", "filter_sigmas", "filter_sensors"}
    assert expected <= set(aided.tables)
    assert not expected & set(plain.tables)
    assert {"epochs", "requirements", "allowed_sigmas", "percentiles", "covariance"} <= set(plain.tables)


def test_tables_in_si(plain: RunResult, aided: RunResult, tmp_path: Path) -> None:
    """Sigmas differ by the units of their rows, ratios and shares do not."""
    for run in (plain, aided):
        run.export(tmp_path, units="SI")
        for name, sigma, same in (("epochs", "sigma_linear", None), ("outputs", "sigma_paired", "ratio_paired"),
                                  ("budget", "sigma", "share")):  # fmt: skip
            shown, si = run.tables[name], read(tmp_path / f"{name}.csv")
            factors = [conversion(unit, other) for unit, other in zip(si["unit"], shown["unit"], strict=True)]
            assert {"m", "rad"} & set(si["unit"])
            np.testing.assert_allclose(floats(si[sigma]) * factors, shown[sigma], rtol=1e-12)
            if same:
                np.testing.assert_array_equal(floats(si[same]), shown[same])
    with pytest.raises(ValueError, match="units must be one of SI, shown; got 'km'"):
        run.export(tmp_path, units="km")  # type: ignore[arg-type]


def test_no_cell_is_a_formula(plain: RunResult, tmp_path: Path) -> None:
    plain.export(tmp_path)
    for path in tmp_path.rglob("*.csv"):
        for row in csv.reader(io.StringIO(path.read_text(encoding="utf-8"))):
            for cell in row:
                assert not cell.startswith(("=", "+", "@", "\t", "\r"))
                assert not cell.startswith("-") or np.isfinite(float(cell))
    assert read(tmp_path / "verdict.csv")["campaign"] == [f"'{FORMULA_NAME}"]


def test_matrices_read_back(plain: RunResult, aided: RunResult, without_epochs: RunResult, tmp_path: Path) -> None:
    """From both files, with the identity C = P S P' + sum of Q to rounding."""
    for run in (plain, aided, without_epochs):
        run.export(tmp_path)
        with np.load(tmp_path / "matrices.npz", allow_pickle=False) as file:
            found = dict(file)
        other = scipy.io.loadmat(tmp_path / "matrices.mat", squeeze_me=False)
        assert set(found) == {name for name in other if not name.startswith("__")} == set(run.arrays)
        for name, array in found.items():
            assert MATLAB_NAME.fullmatch(name)
            assert name not in MATLAB_WORDS
            np.testing.assert_array_equal(array, run.arrays[name])
            if array.dtype.kind == "U":
                texts = [str(cell[0]) for cell in np.ravel(other[name])] if array.ndim else [str(other[name][0])]
                assert texts == np.ravel(array).tolist()
            elif array.ndim == 1:
                np.testing.assert_array_equal(other[name], array[:, None])
            elif name in ("Q", "P_t", "C_plain_t", "C_linear_t", "C_filter_t"):
                np.testing.assert_array_equal(np.moveaxis(other[name], -1, 0), array)
            else:
                np.testing.assert_array_equal(other[name], array)
        assert found["outputs"].tolist() == list(run.outputs.index)
        assert found["P"].shape == (len(found["outputs"]), len(found["sources"]))
        assert found["Q"].shape == (len(found["processes"]), *found["C_linear"].shape)
        whole = found["P"] @ found["S"] @ found["P"].T + found["Q"].sum(axis=0)
        scale = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
        np.testing.assert_allclose(found["C_linear"] / scale, whole / scale, atol=1e-12)


def test_matrices_over_time_end_in_the_final_ones(aided: RunResult, plain: RunResult) -> None:
    for run in (aided, plain):
        found = run.arrays
        sigma = np.sqrt(np.diag(found["C_linear"]))
        for name, final in (("C_linear_t", "C_linear"), ("C_plain_t", "C_plain")):
            last = found[name][-1] / np.outer(sigma, sigma)
            np.testing.assert_allclose(last, found[final] / np.outer(sigma, sigma), atol=4.0 * HISTORIES)
        np.testing.assert_allclose(np.sqrt(np.diag(found["C_plain_t"][-1])), found["sigma_plain_t"][-1], rtol=1e-12)
        assert found["Q_variance_t"].shape == (len(found["processes"]), len(found["t_P"]), len(found["outputs"]))
    assert aided.arrays["C_filter_t"].shape == aided.arrays["C_plain_t"].shape
    assert "C_filter" not in plain.arrays


def test_an_export_is_the_same_bytes_again(plain: RunResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A MATLAB file that scipy writes has the time in it."""
    first = [path.read_bytes() for path in plain.export(tmp_path / "one")]
    monkeypatch.setattr("time.asctime", lambda *_: "another time")
    assert [path.read_bytes() for path in plain.export(tmp_path / "two")] == first
    assert as_mat({"x": np.array(["µg"])}, "µ" * 200)[:116].startswith(b"MATLAB 5.0 MAT-file")


def test_names_of_any_alphabet_are_kept() -> None:
    found = scipy.io.loadmat(io.BytesIO(as_mat({"units": np.array(["µg", "°/√h"]), "unit": np.array("µ")})))
    assert [str(cell[0]) for cell in found["units"][:, 0]] == ["µg", "°/√h"]
    assert str(found["unit"][0]) == "µ"


def test_a_data_set(plain: RunResult, aided: RunResult) -> None:
    """Labels select what frames and arrays have."""
    for run in (plain, aided):
        found, shown = run.to_xarray(), run.to_xarray("shown")
        for output in run.outputs.index:
            frame = run.epochs.xs(output, level="output")
            np.testing.assert_array_equal(found["time"], frame.index)
            np.testing.assert_allclose(shown["sigma_plain"].sel(output=output), frame["sigma_plain"], rtol=1e-12)
        np.testing.assert_array_equal(found["covariance_linear"], run.arrays["C_linear"])
        np.testing.assert_array_equal(found["partials_over_time"], run.arrays["P_t"])
        np.testing.assert_allclose(shown["covariance_plain"], run.covariance("sample", "shown"), rtol=1e-12)
        assert shown["source_unit"].values.tolist() == run.content.source_units
        of_sources, of_outputs = run.content.source_scale, run.content.output_scale
        factors = {"partials": np.outer(of_outputs, 1.0 / of_sources)}
        factors["covariance_sources"] = np.outer(of_sources, of_sources)
        for name, factor in factors.items():
            np.testing.assert_allclose(shown[name], found[name] * factor, rtol=1e-12)
        assert found["time"].attrs["units"] == "min"
        assert (found.attrs["units"], shown.attrs["units"]) == ("SI", "shown")
    noise = np.diagonal(aided.arrays["Q"], axis1=1, axis2=2)
    last = found["variance_noise_over_time"].isel(time_of_partials=-1)
    np.testing.assert_allclose(last, noise, atol=1e-9 * noise.max())
    assert {"group", "state", "sensor"} <= set(found.dims)
    assert found["nees"].sel(group="attitude").shape == found["time"].shape
    with pytest.raises(ValueError, match="units must be one of SI, shown; got 'km'"):
        aided.to_xarray("km")  # type: ignore[arg-type]


def test_a_new_column_and_a_new_matrix_are_seen_everywhere(aided: RunResult, monkeypatch: pytest.MonkeyPatch) -> None:
    """As CONTRIBUTING says they are added: one line in the definition."""
    updates = TimeColumn[Any]("updates", lambda all_of: np.column_stack([each.accepted + each.rejected
                                                                        for each in all_of]))  # fmt: skip
    linear = Matrix("S_root", "root", ("source", "other_source"), lambda run: np.sqrt(run.model.covariance), "root")
    monkeypatch.setattr(over_time, "NIS", (*over_time.NIS, updates))
    monkeypatch.setattr(matrices, "MATRICES", (*matrices.MATRICES, linear))
    table, found = over_time.tables_over_time(aided.content)["nis"].frame(), dataset(aided.content)
    np.testing.assert_array_equal(table["updates"], table["accepted"] + table["rejected"])
    np.testing.assert_array_equal(found["updates"], found["accepted"] + found["rejected"])
    known = matrices.arrays(aided.content)
    np.testing.assert_array_equal(known["S_root"] ** 2, np.sqrt(known["S"]) ** 2)
    np.testing.assert_array_equal(found["root"], known["S_root"])
    assert found["root"].attrs == {"long_name": "root"}


def test_a_run_without_epochs(without_epochs: RunResult) -> None:
    with pytest.raises(ValueError, match=r"polar: the engine of this run computes no errors over time$"):
        _ = without_epochs.epochs
    assert "epochs" not in without_epochs.tables
    assert set(without_epochs.to_xarray().dims) == {"output", "other_output", "source", "other_source", "process"}


def test_without_xarray(plain: RunResult, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=re.escape("to_xarray needs xarray: pip install 'mcnav[xarray]'")):
        plain.to_xarray()


def test_the_command(plain: RunResult, tmp_path: Path) -> None:
    """The default folder is beside the run; the function of Python writes the same."""
    expected = {path.name: path.read_bytes() for path in mcnav.export_run(plain.path, tmp_path / "python", "SI")}
    done = invoke("export", "plain", "--units", "SI", cwd=plain.path.parent)
    assert done.returncode == 0, done.stderr
    written = [Path(file) for file in re.findall("^written: (.*)$", done.stdout, re.MULTILINE)]
    assert {path.parts[0] for path in written} == {"plain_export"}
    assert {path.name: (plain.path.parent / path).read_bytes() for path in written} == expected
    inside = invoke("export", ".", cwd=plain.path)
    assert "written: " + str(plain.path.with_name("plain_export") / "outputs.csv") in inside.stdout


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("nowhere",), r"error: nowhere: holds no run \(there is no such folder\); mcnav run CAMPAIGN makes one"),
        (
            ("plain", "--out", "plain/manifest.json"),
            r"error: --out: got plain/manifest.json; expected a folder, such as plain/manifest",
        ),
    ],
)
def test_bad_input(arguments: tuple[str, ...], line: str, plain: RunResult) -> None:
    done = invoke("export", *arguments, cwd=plain.path.parent)
    assert done.returncode == 2
    assert re.fullmatch(line, done.stderr.strip())


@pytest.mark.parametrize("name", ["epochs.parquet", "manifest.json", "history.parquet", "samples/part-00000.parquet"])
def test_a_damaged_run_is_one_line(name: str, plain: RunResult, tmp_path: Path) -> None:
    shutil.copytree(plain.path, tmp_path / "run")
    (tmp_path / "run" / name).write_bytes(b"PAR1")
    done = invoke("export", "run", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: run")
    assert not (tmp_path / "out").exists()
