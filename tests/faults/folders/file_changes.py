"""Files that are links, pipes, code, of elsewhere, of other runs, or not there."""

from __future__ import annotations

import hashlib
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.faults import grammar
from tests.faults.folders.content import NAMES, sign, store
from tests.faults.folders.runs import FREE, Outside


def paths(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Paths to elsewhere wherever a manifest has the name of a file."""
    secret = chance.choice(outside.files())
    path = chance.choice(
        [
            str(secret),
            os.path.relpath(secret, folder),
            os.path.relpath(secret, folder / "samples"),
            "/etc/passwd",
            "/dev/zero",
            "/dev/stdin",
            f"samples/../../{secret.name}",
            f"file://{secret}",
            "\\\\host\\share",
            ".lock",
            "manifest.json",
        ]
    )

    def change(manifest: dict[str, Any]) -> None:
        kind = chance.randrange(4)
        if kind == 0:
            chance.choice(manifest["parts"])["file"] = path
        elif kind == 1:
            record = {"name": path, "bytes": 1, "sha256": "0" * 64, "kept": True, "setting": "trajectory"}
            manifest["files"] = [*manifest.get("files", []), record]
        elif kind == 2:
            manifest["identity"]["code"] = {"file": path, "sha256": "0" * 64}
        else:
            manifest["identity"]["files"] = {path: "0" * 64}

    sign(folder, change)


def links(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Links to elsewhere in place of files and folders."""
    names = [
        "manifest.json",
        "summary.json",
        "campaign.toml",
        "report.html",
        "history.parquet",
        "epochs.parquet",
        ".lock",
        "histories.parquet",
        "filter.parquet",
        "samples",
        "inputs",
        "tables",
        "samples/part-00000.parquet",
        "inner",
    ]
    name = chance.choice(names)
    place = folder / name
    whole = chance.random() < 0.5 and place.exists()
    target = chance.choice([*outside.files(), Path("/dev/zero"), Path("/dev/stdin"), place, outside.folder])
    if whole and not place.is_symlink():  # the link leads to what would be right
        target = outside.folder / f"moved-{place.name}"
        shutil.move(place, target)
    remove(place)
    place.symlink_to(target)
    if chance.random() < 0.3:
        (folder.parent / "linked").symlink_to(outside.folder)


def special_files(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Pipes, sockets, devices and folders in place of files, and files in place of folders."""
    files = [path for path in sorted(folder.rglob("*")) if not path.is_symlink()]
    more = [
        folder / name for name in ("inputs", "tables", "inputs/table.txt", "filter.parquet", "epochs.parquet", ".lock")
    ]
    place = chance.choice(
        [*files, *more, folder / "histories.parquet", folder / "campaign.toml", folder / "summary.json"]
    )
    remove(place)
    place.parent.mkdir(exist_ok=True)
    kind = chance.randrange(6)
    if kind < 2:
        os.mkfifo(place)
    elif kind == 2:
        place.mkdir()
    elif kind == 3:
        place.write_bytes(b"")
    elif kind == 4:
        place.touch()
        os.truncate(place, chance.choice([1 << 20, 1 << 30, 999_999_999, 1 << 40]))
    else:
        with place.open("wb") as file:
            file.write(os.urandom(1_000))


def remove(place: Path) -> None:
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


def missing(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Files that are not there."""
    for place in chance.sample(sorted(folder.rglob("*")), chance.choice([1, 2])):
        remove(place)


def code(chance: random.Random, folder: Path, outside: Outside) -> None:
    """A campaign that names a file of Python, in the folder or outside, and a manifest that agrees."""
    (folder / "evil.py").write_text(outside.code + "class Evil:\n    pass\n")
    evil = outside.folder / "evil.py"
    kinds = [
        "evil.py:Evil",
        f"{evil}:Evil",
        f"{os.path.relpath(evil, folder)}:Evil",
        "mine.py:Mine",
        "inputs/evil.py:Evil",
    ]
    kind, text = chance.choice(kinds), (folder / "campaign.toml").read_text()
    written = (
        text.replace('type = "', f'type = "{kind}" # "', 1)
        if chance.random() < 0.5
        else f'[scenario]\ntype = "{kind}"\n'
    )
    (folder / "campaign.toml").write_text(written)

    def change(manifest: dict[str, Any]) -> None:
        manifest["identity"]["campaign"]["scenario"] = {"type": kind}
        manifest["identity"]["code"] = {
            "file": kind.split(":")[0],
            "sha256": hashlib.sha256(evil.read_bytes()).hexdigest(),
        }

    sign(folder, change)


def campaigns(chance: random.Random, folder: Path, outside: Outside) -> None:
    """A campaign that reads files outside, is none, or is another one, and a manifest that agrees."""
    path, secret = folder / "campaign.toml", outside.folder / "secret.csv"
    table = {"distribution": "table", "column": "a", "unit": "m"}
    (folder / "link.csv").symlink_to(secret)
    (folder / "linked").symlink_to(outside.folder)
    (folder / "pipe.csv").unlink(missing_ok=True)
    os.mkfifo(folder / "pipe.csv")
    named = chance.choice(
        [
            str(secret),
            os.path.relpath(secret, folder),
            "link.csv",
            "linked/secret.csv",
            "/dev/zero",
            "pipe.csv",
            "/etc/passwd",
            "inputs/../../outside/secret.csv",
        ]
    )
    hostile: list[Callable[[], str]] = [
        lambda: grammar.written(
            {"samples": 70, "scenario": {"type": "ins", "trajectory": named}, "errors": {"position": "5 m"}}
        ),
        lambda: grammar.written(FREE | {"errors": {"position_north": table | {"file": named}}}),
        lambda: grammar.written(
            {
                "samples": 70,
                "scenario": {"type": "reentry", "trajectory": 4},
                "errors": {"altitude": table | {"file": named}},
            }
        ),
        lambda: grammar.campaign_file(chance)[1].decode("utf-8", "replace"),
        lambda: grammar.written(FREE | {"name": chance.choice(NAMES).replace("\ud800", "")}),
        lambda: "x = " + "[" * 5_000,
        lambda: path.read_text().replace('"', "'"),
        lambda: "\x00",
    ]
    text = chance.choice([*hostile[:3], *hostile])()
    path.write_text(text, errors="replace")
    if chance.random() < 0.7:

        def change(manifest: dict[str, Any]) -> None:
            manifest["identity"]["campaign"]["samples"] = 70
            manifest["files"] = [
                {
                    "name": "secret.csv",
                    "bytes": 1,
                    "sha256": hashlib.sha256(secret.read_bytes()).hexdigest(),
                    "kept": True,
                    "setting": "trajectory",
                }
            ]

        sign(folder, change)


def mixed(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Files of another run of the same program."""
    others = [each for each in sorted(folder.parent.parent.joinpath("runs").iterdir()) if each.is_dir()]
    other = chance.choice(others)
    files = [path for path in sorted(other.rglob("*")) if path.is_file() and path.name != ".lock"]
    for path in chance.sample(files, min(len(files), chance.choice([1, 3]))):
        place = folder / path.relative_to(other)
        place.parent.mkdir(exist_ok=True)
        store(folder, place, path.read_bytes())
