"""A process keeps the memory that it has freed, and needs no new pages for the next piece of the same size."""

from __future__ import annotations

import os
import platform
import sys

from mcnav.runner.memory import keep_freed_memory
from tests.conftest import ROOT
from tests.processes import run_to_end

PAGES = """
import sys, threading, resource, mmap
import numpy as np
from mcnav.runner.memory import keep_freed_memory

if sys.argv[1] == "keep":
    assert keep_freed_memory()

def work():
    for _ in range(20):
        [np.ones(400_000) for _ in range(4)]  # numpy asks for large pages from 4 MB on

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

pages()
print(pages() * mmap.PAGESIZE / (40 * 4 * 3_200_000))
"""


def test_freed_memory_is_kept() -> None:
    """Forty times four pieces in two threads, which need new pages for a tenth of the pieces at most.

    Without it they need them for all pieces: glibc is told not to change by itself what it gives back.
    """
    if platform.libc_ver()[0] != "glibc":
        assert not keep_freed_memory()  # and says so
        return
    shares, environment = {}, os.environ | {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    for mode in ("keep", "give back"):
        done = run_to_end([sys.executable, "-c", PAGES, mode], cwd=ROOT, env=environment)
        assert done.returncode == 0, done.stderr
        shares[mode] = float(done.stdout)
    assert shares["keep"] <= 0.1
    assert shares["give back"] >= 0.9
