"""The documentation as a site, built once when it is first asked for."""

from __future__ import annotations

import atexit
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path

from tests.conftest import ROOT
from tests.processes import run_to_end


@cache
def built_site() -> Path:
    """Build the site; any warning of Sphinx fails it."""
    folder = Path(tempfile.mkdtemp(prefix="site-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    finished = run_to_end([sys.executable, ROOT / ".github" / "site" / "build.py", folder / "site"], cwd=ROOT)
    assert finished.returncode == 0, finished.stderr
    return folder / "site"
