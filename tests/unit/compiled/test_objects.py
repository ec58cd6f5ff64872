"""Objects of an installation: used where all that they depend on is the same, and otherwise not."""

from __future__ import annotations

import ast
import os
import pickle
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import CodeType, ModuleType

import llvmlite
import numba
import numpy as np
import pytest
from numba.core import config
from numba.core.dispatcher import Dispatcher

from mcnav.compiled import objects
from mcnav.compiled.target import LEVELS, choose_objects, highest_level, target
from mcnav.systems.ins.ensemble.innovations import _compiled
from mcnav.systems.ins.sensors.registry import FILES, KINDS
from tests.conftest import ROOT
from tests.processes import run_to_end

V3 = dict.fromkeys(LEVELS["x86-64-v3"].split(), True)
V4 = V3 | dict.fromkeys(LEVELS["x86-64-v4"].split(), True)


def test_the_level_is_the_highest_of_which_nothing_is_missing() -> None:
    assert highest_level(V4) == "x86-64-v4"
    assert highest_level(V3) == "x86-64-v3"
    for name in V4:
        assert highest_level(V4 | {name: False}) == (None if name in V3 else "x86-64-v3")


def test_a_level_that_the_processor_has_not_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("mcnav.compiled.target._level_here", lambda: "x86-64-v3")
    with pytest.raises(ValueError, match=r"^got x86-64-v4; this processor has x86-64-v3$"):
        choose_objects(tmp_path, "x86-64-v4")


def test_functions_of_another_library_are_another_target(monkeypatch: pytest.MonkeyPatch) -> None:
    here = target()
    monkeypatch.setattr(config, "USING_SVML", True)
    assert target() == f"{here} with SVML"


@pytest.mark.parametrize(
    ("module", "name", "other"),
    [
        (objects, "target", lambda: "another processor"),
        (objects, "sources_digest", lambda: "other sources"),
        (numba, "__version__", "0.0"),
        (llvmlite, "__version__", "0.0"),
        (np, "__version__", "0.0"),
        (objects, "version", lambda name: "0.0"),
        (sys, "abiflags", "d"),
    ],
)
def test_the_folder_is_another_where_anything_differs(
    module: object, name: str, other: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = objects.objects_folder.__wrapped__()
    monkeypatch.setattr(module, name, other)
    monkeypatch.setattr(objects, "libraries", objects.libraries.__wrapped__)
    assert objects.objects_folder.__wrapped__().name != here.name


PACKAGE = ROOT / "mcnav"
SENSORS = Path("systems/ins/sensors")


def digested(file: Path) -> bool:
    """Whether the content of a file is part of the digest of all sources."""
    place = file.relative_to(PACKAGE)
    within = any(Path(room) in place.parents for room in objects.ROOMS)
    of_a_sensor = place.parent == SENSORS and place.stem in FILES
    within = within and not of_a_sensor and not objects.UNCOMPILED.intersection(place.parts)
    return str(place) in objects.FILES or within


def names_in(code: CodeType) -> Iterator[str]:
    """Yield the names of a function and of those within it."""
    yield from code.co_names
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from names_in(each)


def modules_of_compiled_functions(folder: Path) -> Iterator[tuple[ModuleType, str]]:
    """Yield the modules under a folder that define compiled functions, each with its text."""
    for file in sorted(folder.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "from mcnav.compiled.jit import" in text:
            yield import_module(".".join(file.relative_to(ROOT).with_suffix("").parts)), text


def functions_of(module: ModuleType) -> list[Dispatcher]:
    """List the compiled functions that a module defines."""
    return [
        function
        for function in vars(module).values()
        if isinstance(function, Dispatcher) and function.py_func.__module__ == module.__name__
    ]


def test_compiled_functions_name_nothing_of_files_that_are_not_digested() -> None:
    """But for the function's own file, whose content each object has with it."""
    functions, named = 0, set[tuple[str, str, str]]()
    for module, text in modules_of_compiled_functions(PACKAGE):
        origins = {
            name.asname or name.name: str(node.module)
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("mcnav.")
            for name in node.names
        }
        for function in functions_of(module):
            functions += 1
            for name in origins.keys() & set(names_in(function.py_func.__code__)):
                origin = import_module(origins[name]).__file__
                if origin is not None and not digested(Path(origin)):
                    named.add((module.__name__, function.py_func.__name__, name))
    assert functions > 250
    assert named == set()


def has_code_of_its_own(function: object) -> bool:
    """Whether what is called for itself is machine code that a caller's copy of it may differ from.

    Parts and inlined functions are code of their callers alone; without ``contract`` nothing is fused in either.
    """
    if not isinstance(function, Dispatcher) or function.targetoptions.get("inline") == "always":
        return False
    return isinstance(function._cache, objects.Code) and bool(function.targetoptions["fastmath"])


def test_kernels_of_inertial_navigation_contain_no_copy_of_code_that_is_called_for_itself() -> None:
    """So they have the same bits compiled and loaded; `tests/cross/test_compiled.py` compares the reference engine."""
    functions, copied = 0, set[tuple[str, str]]()
    for module, _ in modules_of_compiled_functions(PACKAGE / "systems" / "ins"):
        for function in functions_of(module):
            functions += 1
            called = {name: vars(module).get(name) for name in names_in(function.py_func.__code__)}
            copied |= {(module.__name__, name) for name, of in called.items() if has_code_of_its_own(of)}
    assert functions > 150
    reference = "mcnav.systems.ins.reference"
    assert copied == {
        (f"{reference}.collocation", "_pushed"),
        (f"{reference}.collocation", "_stepped"),
        (f"{reference}.collocation", "_turned"),
        (f"{reference}.collocation", "normal_gravitation"),
        (f"{reference}.earth_fixed_errors", "normal_gravitation"),
        (f"{reference}.normal_field", "normal_gravitation"),
    }


def test_a_word_of_a_sensor_s_docstring_compiles_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And another sign of its innovation compiles it alone: all else is valid for what it was."""
    shutil.copytree(PACKAGE, tmp_path / "mcnav", ignore=shutil.ignore_patterns("__pycache__", "docs", "*.npz"))
    sensor = tmp_path / "mcnav" / SENSORS / "position.py"
    text = sensor.read_text(encoding="utf-8")
    monkeypatch.setattr(objects, "__file__", str(tmp_path / "mcnav" / "compiled" / "objects.py"))
    of_all, of_sensor = [], []
    for old, new in (("", ""), ("Add ``d . x``", "Add\n    ``d . x``"), ("value += dx * lx", "value -= dx * lx")):
        assert old in text
        sensor.write_text(text.replace(old, new, 1), encoding="utf-8")
        of_all.append(objects.sources_digest.__wrapped__())
        of_sensor.append(objects._digest_of_file.__wrapped__(sensor))
    assert len(set(of_all)) == 1
    assert of_sensor[0] == of_sensor[1] != of_sensor[2]


def test_an_innovation_is_not_valid_for_another_text_of_its_file() -> None:
    """The stamp of its stored code has the file's digest besides that of all sources."""
    innovation = _compiled(KINDS["position"])
    assert isinstance(innovation, Dispatcher)
    file = Path(innovation.py_func.__code__.co_filename)
    stamp = innovation._cache._files(file.parent, ("needs",))._stamp
    assert stamp == ("needs", objects._digest_of_file(file))


CODE = """
import sys
from numba.core import event
from mcnav.compiled import objects

compilations = event.RecordingListener()
event.register("numba:compile", compilations)
import doubled
print(doubled.doubled(1.5), "compiles" if compilations.buffer else "loads")
"""

SOURCE = (
    "from mcnav.compiled.jit import compiled\n\nFACTOR = {}\n\n\n@compiled\ndef doubled(x):\n    return FACTOR * x\n"
)


def test_objects_are_used_without_a_folder_to_write_to_and_not_after_a_change(tmp_path: Path) -> None:
    """In a copy of the package with a file wherever a folder for code would be made; the change is of a constant.

    A home that is not known is ``~`` to Python, a folder in the current one.
    """
    package = tmp_path / "installed" / "mcnav"
    package.mkdir(parents=True)
    for name in ("__init__.py", *objects.FILES):
        (package / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / "mcnav" / name, package / name)
    for room in ("compiled", "files", "execution", "arrays"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "mcnav" / room, package / room, ignore=ignored, dirs_exist_ok=True)
    (package.parent / "__pycache__").touch()
    nowhere = tmp_path / "no_folder"
    nowhere.touch()
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(package.parent), "HOME": str(nowhere), "XDG_CACHE_HOME": str(nowhere / "cache")}

    def call(factor: float, **more: str) -> tuple[str, str]:
        (package.parent / "doubled.py").write_text(SOURCE.format(factor))
        done = run_to_end([sys.executable, "-B", "-c", CODE], cwd=package.parent, env=environment | more)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip(), done.stderr

    homeless = {"HOME": "~", "XDG_CACHE_HOME": "~/.cache"}
    assert call(2.0, **homeless)[0] == "3.0 compiles"
    assert not (package.parent / "~").exists()
    assert call(2.0, MCNAV_OBJECTS_INTO=str(package / "compiled" / "objects")) == ("3.0 compiles", "")
    assert call(2.0) == ("3.0 loads", "")
    printed, told = call(4.0)
    assert printed == "6.0 compiles"
    assert told.startswith("note: compiled code cannot be stored")


def test_code_is_whole_and_says_what_it_is_whoever_writes_it(tmp_path: Path) -> None:
    """Processes that store other types at the same time keep both; a file of another key or source is not read on."""
    first, second = (objects.CodeFiles(tmp_path, "kernel", "sources") for _ in range(2))
    first.save("float64", pickle.dumps("code for a float64"))
    second.save("int64", pickle.dumps("code for an int64"))
    assert (first.load("int64"), second.load("float64")) == ("code for an int64", "code for a float64")
    assert objects.CodeFiles(tmp_path, "kernel", "other sources").load("int64") is None
    first._path("int64").replace(first._path("float64"))
    assert first.load("float64") is None
    assert first.load("int64") is None


def test_code_for_a_type_that_has_moved_is_not_stored(tmp_path: Path) -> None:
    files = objects.CodeFiles(tmp_path, "kernel", "sources")
    files.save("int64", pickle.dumps("code"))
    for gone in (b"cmcnav.gone\nTables\n.", b"cmcnav.compiled.objects\nGone\n."):
        next(tmp_path.glob("*.nbc")).write_bytes(gone)
        assert files.load("int64") is None
