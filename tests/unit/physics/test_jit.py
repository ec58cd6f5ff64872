"""Compiled code on disk is used only with the sources it was made of."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests.processes import run_to_end

CODE = """
import sys
import mcnav.physics.jit as jit

jit.sources_digest = lambda: sys.argv[1]
sys.path.insert(0, sys.argv[2])
import doubled
doubled.doubled(1.0)
print(sum(doubled.doubled.stats.cache_hits.values()))
"""


@pytest.mark.parametrize(("sources", "hits"), [("as before", "1"), ("changed", "0")])
def test_compiled_code_belongs_to_its_sources(sources: str, hits: str, tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text(
        "from mcnav.physics.jit import compiled\n\n\n@compiled\ndef doubled(x):\n    return 2.0 * x\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for digest, expected in (("as before", "0"), (sources, hits)):
        command = [sys.executable, "-c", CODE, digest, str(tmp_path)]
        assert run_to_end(command, env=environment).stdout.strip() == expected
