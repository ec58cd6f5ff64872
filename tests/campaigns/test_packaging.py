"""Wheel and source distribution: built without a network, complete, and run from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.commands import invoke
from tests.conftest import ROOT
from tests.processes import run_to_end

SOURCES = (
    ".ci", ".github", "campaigns", "mcnav", "tests", "reports/benchmarks", "reports/calibration", "reports/examples",
    "CHANGELOG.md", "MANIFEST.in", "Makefile", "README.md", "pyproject.toml", "setup.py",
)  # fmt: skip
"""What a source distribution holds."""

MADE = ("PKG-INFO", "setup.cfg", "mcnav.egg-info/")
"""What its build adds."""

OBJECT = "mcnav/compiled/objects/x86-64-v4/kernel.nbc"
"""Machine code as `mcnav dev compile --out` writes it: of the wheel alone."""

IGNORED = shutil.ignore_patterns("__pycache__", "*.py[co]", ".lock", "objects")

BUILD = "from setuptools import build_meta; build_meta.build_sdist('dist'); build_meta.build_wheel('dist')"


def project() -> dict[str, Any]:
    return dict(tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"])


def files_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources with both distributions in ``dist``."""
    folder = tmp_path_factory.mktemp("packaging") / "checkout"
    for name in SOURCES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copy if (ROOT / name).is_file() else lambda *paths: shutil.copytree(*paths, ignore=IGNORED)
        copy(ROOT / name, folder / name)
    (folder / OBJECT).parent.mkdir(parents=True)
    (folder / OBJECT).touch()
    done = run_to_end([sys.executable, "-c", BUILD], cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(checkout: Path) -> zipfile.ZipFile:
    (path,) = (checkout / "dist").glob("*.whl")
    return zipfile.ZipFile(path)


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_the_examples(checkout: Path, wheel: zipfile.ZipFile) -> None:
    """All of it, with templates, pages, tables and the mark of typed packages; no tests and no reports."""
    expected = {f"mcnav/{name}" for name in files_in(checkout / "mcnav")}
    expected |= {f"mcnav/campaigns/{name}" for name in files_in(checkout / "campaigns")}
    found = {name for name in wheel.namelist() if not re.match(r"mcnav-[^/]*\.dist-info/", name)}
    assert found == expected
    assert {OBJECT, "mcnav/py.typed", "mcnav/docs/GUIDE.md", "mcnav/systems/ins/tables/imu_catalogue.toml"} <= found
    for name in files_in(checkout / "campaigns"):
        assert wheel.read(f"mcnav/campaigns/{name}") == (ROOT / "campaigns" / name).read_bytes()


@pytest.mark.slow
def test_the_source_distribution_holds_what_the_tests_need(checkout: Path) -> None:
    (path,) = (checkout / "dist").glob("*.tar.gz")
    with tarfile.open(path) as archive:
        found = {member.name.partition("/")[2] for member in archive if member.isfile()}
    sources = {file for name in SOURCES for file in (
        {name} if (checkout / name).is_file() else {f"{name}/{each}" for each in files_in(checkout / name)}
    )}  # fmt: skip
    assert {name for name in found if not name.startswith(MADE)} == sources - {OBJECT}


@pytest.mark.slow
def test_the_wheel_says_what_it_needs(wheel: zipfile.ZipFile) -> None:
    (name,) = (each for each in wheel.namelist() if each.endswith("METADATA"))
    said = Parser().parsestr(wheel.read(name).decode())
    assert (said["Version"], said["Requires-Python"]) == (project()["version"], project()["requires-python"])
    assert {"dask", "xarray", "test", "bench"} <= set(said.get_all("Provides-Extra") or ())
    supported = SpecifierSet(project()["requires-python"])
    versions = re.findall(r"Python :: (3\.\d+)", "\n".join(said.get_all("Classifier") or ()))
    assert versions == ["3.11", "3.12", "3.13", "3.14"]
    assert all(f"{version}.0" in supported for version in versions)
    assert "3.10.9" not in supported


@pytest.mark.slow
def test_an_installed_package_runs_in_an_empty_folder(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    """Without the checkout: its examples, templates, pages and catalogue are those of the package."""
    installed, place = tmp_path / "installed", tmp_path / "place"
    wheel.extractall(installed)
    place.mkdir()
    environment = os.environ | {"PYTHONPATH": str(installed)}

    def mcnav(*arguments: str) -> subprocess.CompletedProcess[str]:
        done = run_to_end([sys.executable, "-m", "mcnav", *arguments], cwd=place, env=environment)
        assert done.returncode == 0, done.stderr
        return done

    where = run_to_end([sys.executable, "-c", "import mcnav; print(mcnav.__file__)"], cwd=place, env=environment)
    assert Path(where.stdout.strip()).is_relative_to(installed)
    assert "Report:   reports/14_polar/report.html\n" in mcnav("demo", "14").stdout
    assert (place / "reports" / "14_polar" / "report.html").stat().st_size > 100_000
    assert "15_flight_navigation_grade" in mcnav("demo", "--list").stdout
    mcnav("new", "campaign", "mine")
    assert mcnav("docs", "commands").stdout.startswith("# Commands")
    assert "navigation" in mcnav("imu").stdout
    assert {"mine.toml", "reports"} <= {path.name for path in place.iterdir()}


def test_the_version_is_in_one_place(tmp_path: Path) -> None:
    version = project()["version"]
    assert invoke("--version", cwd=tmp_path).stdout == f"mcnav {version}\n"
    for path in (*(ROOT / "mcnav").rglob("*.py"), ROOT / "setup.py", ROOT / "Makefile"):
        assert f'"{version}"' not in path.read_text(encoding="utf-8"), path


def test_every_requirement_is_in_the_lock() -> None:
    """At a version that satisfies it; what is installed from source alone is there as well."""
    lines = (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}
    assert len(pinned) == len(lines)
    extras = project()["optional-dependencies"].values()
    wanted = [*project()["dependencies"], *(each for extra in extras for each in extra)]
    for requirement in map(Requirement, wanted):
        if requirement.name == project()["name"]:
            continue  # an extra that holds another
        assert pinned[canonicalize_name(requirement.name)] in requirement.specifier, requirement
