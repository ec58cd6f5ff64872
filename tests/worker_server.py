"""Server that has imported what workers of joblib need, and forks them for runs in the tests' own process.

joblib starts a new interpreter for each worker, which imports for more than a second; there would be some hundred of
them. Tasks and results are pickled and sent all the same. A command that a test starts as a process of its own has the
workers that a user's has.
"""

from __future__ import annotations

import ctypes
import os
import signal
from importlib import import_module
from multiprocessing import forkserver
from pathlib import Path
from typing import Final
from unittest.mock import patch

from joblib.externals.loky.backend import context

from mcnav import _subprocess

SERVING: Final = "MCNAV_WORKER_SERVER"
"""Variable of the environment that only the server has."""


def _end_with_server(_: int) -> None:
    """End this worker when the server ends, which ends with the tests: it, and not they, is the worker's parent."""
    ctypes.CDLL(None).prctl(_subprocess._PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def start() -> None:
    """Start the server, and let joblib's workers of this process be its forks."""
    root = str(Path(__file__).parent.parent)
    alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # as joblib has it with a worker for each processor
    with patch.dict(os.environ, {"PYTHONPATH": root, SERVING: "1", **alone}):
        forkserver.set_forkserver_preload([__name__])
        forkserver.ensure_running()
    context.set_start_method("forkserver", force=True)


if SERVING in os.environ:
    import_module("mcnav.workflow.run")
    _subprocess.end_with_parent = _end_with_server
