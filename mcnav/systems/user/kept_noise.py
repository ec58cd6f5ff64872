"""Measured covariances of noise that are kept: one command measures, the others read.

A file is named after the digest of what a measurement depends on and is known beforehand: text, class and settings,
with the content of files that settings name; how is measured; versions of Python, mcnav, and packages that the text
imports; the processor. It is read on where all that was noticed while it was measured is unchanged: files that the
class opened, and modules outside of installed packages. Then the first simulations are repeated, and must have the
same bits as before. Whatever else the class depends on, such as variables of the environment, so shows itself: each
probe has all variates of the noise.
"""

from __future__ import annotations

import ast
import hashlib
import json
import platform
import time
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import ValidationError

from mcnav.cache import VARIABLE, Cache, DamagedError
from mcnav.compiled.target import target
from mcnav.entries.inputs import InputFile, content_of, own_modules
from mcnav.progress import duration, note
from mcnav.records import Record
from mcnav.systems.user import noise_measurement
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.noise_measurement import MeasuredNoise, Probes, measure, respond
from mcnav.systems.user.stochastic_engine import SCALE, StochasticUserEngine

CACHE: Final = Cache("noise")

FORMAT: Final = 1
"""Version of the content of a file."""

KEPT_FROM: Final = 1.0
"""Seconds of a measurement from which on it is kept."""

TOLD_FROM: Final = 10.0
"""Seconds of a measurement from which on they are told beforehand."""

ANEW: Final = "the covariance of the noise is measured anew"

NUMBERS: Final = np.dtype("<f8")


class KeptNoise(Record):
    """Description of a measurement, the first line of a file; the numbers of `MeasuredNoise` follow it.

    Attributes
    ----------
    key : dict
        What the name of the file is a digest of.
    read : dict
        SHA-256 of the files that the class opened, and of modules, by path.
    """

    key: dict[str, object]
    read: dict[str, str]
    shape: tuple[int, int]
    variates: int | None


def noise_of(loaded: Loaded, spec: UserScenarioSpec, engine: StochasticUserEngine, sources: int) -> MeasuredNoise:
    """Return the covariance of the noise of a user's class: measured now, in this process before, or by an earlier one.

    Raises
    ------
    ScenarioError
        When a simulation fails, or a file changes that the class reads.
    """
    if loaded.noise is None:
        loaded.noise = _noise_of(loaded, spec, engine, sources)
    return loaded.noise


def _noise_of(loaded: Loaded, spec: UserScenarioSpec, engine: StochasticUserEngine, sources: int) -> MeasuredNoise:
    key = _key(spec)
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()
    with loaded.recording(spec.code.file):
        probes = Probes.of(engine, sources)
    kept = _read(name, key, loaded.inputs)
    began = time.perf_counter()
    with loaded.recording(spec.code.file):
        if kept is not None:
            if _same(probes, kept):
                return kept
            note(f"{spec.code.file} no longer simulates what it did when the covariance was kept; {ANEW}")
        measured = measure(probes, _tell)
    if time.perf_counter() - began >= KEPT_FROM:
        read = {path: file.digest for path, file in loaded.inputs.items()} | _digests_of_modules()
        described = KeptNoise(key=key, read=read, shape=measured.first.shape, variates=measured.variates)
        header = json.dumps(described.to_json() | {"variates": measured.variates}).encode()
        CACHE.write(name, header + b"\n" + _numbers(measured.covariance) + _numbers(measured.first))
    return measured


def _numbers(values: np.ndarray) -> bytes:
    return values.astype(NUMBERS).tobytes()


def _tell(seconds: float) -> None:
    """Print how long the measurement will take, where that is long."""
    if seconds < TOLD_FROM:
        return
    kept = "kept for the next commands" if CACHE.writable else f"not kept: {_nowhere()}"
    note(f"measuring the covariance of the noise: about {duration(seconds)} on this machine, {kept}")


def _nowhere() -> str:
    place = "there is no home folder" if CACHE.folder is None else f"{CACHE.folder} is not writable"
    return f"{place}; set {VARIABLE} to a folder that is"


def _same(probes: Probes, kept: MeasuredNoise) -> bool:
    """Simulate the first probe again, and compare bits; also compare the number of variates."""
    if kept.variates is None:
        probes = noise_measurement.independent(probes)
    if kept.variates != probes.variates or kept.first.shape != probes.nominal.shape:
        return False
    if not probes.count:
        return True
    try:
        response = respond(probes, 0)
    except noise_measurement.OtherVariates:
        return False
    return isinstance(response, np.ndarray) and response.tobytes() == kept.first.tobytes()


def _read(name: str, key: Mapping[str, object], inputs: Mapping[str, InputFile]) -> MeasuredNoise | None:
    """Read a kept measurement; none where there is none, or what was noticed during it has changed."""
    try:
        content = CACHE.read(name)
        if content is None:
            return None
        header, _, numbers = content.partition(b"\n")
        described = KeptNoise.model_validate_json(header)
        if described.key != key or not _unchanged(described.read, inputs):
            return None
        epochs, outputs = described.shape
        values = np.frombuffer(numbers, NUMBERS).astype(float)
        covariance, first = np.split(values, [epochs * outputs**2])
        return MeasuredNoise(
            covariance.reshape(epochs, outputs, outputs), first.reshape(epochs, outputs), described.variates
        )
    except DamagedError as damaged:
        note(f"{damaged}; {ANEW}")
    except (ValidationError, ValueError):  # of another version
        pass
    return None


def _unchanged(read: Mapping[str, str], inputs: Mapping[str, InputFile]) -> bool:
    """Return whether files have these digests, and those noticed in this process are among them."""
    try:
        return all(content_of(path)[0] == digest for path, digest in read.items()) and all(
            read.get(path) == file.digest for path, file in inputs.items()
        )
    except OSError:
        return False


def _digests_of_modules() -> dict[str, str]:
    digests = {}
    for path in own_modules():
        try:
            digests[path] = content_of(path)[0]
        except OSError:
            continue
    return digests


def _key(spec: UserScenarioSpec) -> dict[str, object]:
    """Collect what a measurement depends on and is known before it, as JSON."""
    settings = {name: _described(value) for name, value in spec.settings}
    packages = {name: _version(name) for name in _imported(spec.code.text)}
    return {
        "format": FORMAT,
        "code": spec.code.digest,
        "file": spec.code.file,
        "class": spec.name,
        "settings": settings,
        "measured": [noise_measurement.SEED, noise_measurement.INDEPENDENT, noise_measurement.EVERY, SCALE],
        "program": [version("mcnav"), _program()],
        "python": [
            platform.python_implementation(),
            platform.python_version(),
            platform.system(),
            platform.machine(),
            target(),
        ],
        "packages": {name: _version(name) for name in ("numpy", "scipy")} | packages,
    }


def _described(value: object) -> str:
    """Describe a setting: a file by its place and content, others as they are."""
    return f"{value.path} {value.digest}" if isinstance(value, InputFile) else repr(value)


@cache
def _program() -> str:
    """Digest the files by which a class is called."""
    room = Path(__file__).parent
    files = [*sorted(room.glob("*.py")), room.parent / "sample_loop.py"]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


@cache
def _imported(text: str) -> tuple[str, ...]:
    """Return the packages that a text imports, wherever in it."""
    names = set[str]()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {each.name.partition(".")[0] for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition(".")[0])
    return tuple(sorted(names))


def _version(package: str) -> str:
    """Return the version of an installed package; empty for modules of Python, and what is named differently."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
