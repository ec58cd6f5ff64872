"""Copy of the tree in which mutations are tried, and its compiled code."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Final

from tests.mutation import ROOT
from tests.mutation.references import Node

STAMPED: Final = "stamp = (*stored._source_stamp, libraries(), sources_digest())"
"""Line of `mcnav.compiled.jit` by which a change of any file makes all compiled code invalid."""


def copy_tree(to: Path) -> None:
    """Copy the files of the tree whose compiled code `drop_compiled` makes invalid, and nothing else does."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    jit = to / "mcnav" / "compiled" / "jit.py"
    source = jit.read_text()
    assert source.count(STAMPED) == 1, "the stamp of compiled code is made in another way"
    jit.write_text(source.replace(STAMPED, "stamp = ('mutants',)"))


def drop_compiled(warm: Path, to: Path, functions: set[Node]) -> None:
    """Make a copy of the compiled code without that of some functions.

    Files of a function are named ``module.function-line.version.digest.nbc``.
    """
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(warm, to, copy_function=os.link)  # files are replaced and never changed
    names = {f"{Path(path).stem}.{name}" for path, name in functions}
    for file in to.rglob("*.nbc"):
        if file.name.rsplit("-", 1)[0] in names:
            file.unlink()


def environment(tree: Path, cache: Path) -> dict[str, str]:
    """Return the environment in which the copy is imported, with its compiled code."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(cache)}
