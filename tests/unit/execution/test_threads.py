"""Threads of linear algebra, and the thread that waits for the end of a parent."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from types import ModuleType, SimpleNamespace
from unittest.mock import patch

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from mcnav.execution import threads
from mcnav.execution.child_processes import _wait_for_end
from mcnav.execution.threads import one_thread


def _threads_of_blas() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_one_thread_within_and_as_many_as_before_afterwards() -> None:
    with threadpool_limits(2):
        before = _threads_of_blas()
        with one_thread():
            assert _threads_of_blas() == {1}
            with one_thread():
                assert _threads_of_blas() == {1}
            assert _threads_of_blas() == {1}
        assert _threads_of_blas() == before


def test_libraries_are_looked_for_when_modules_were_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    with patch.object(threads, "ThreadpoolController", wraps=threads.ThreadpoolController) as looked:
        with one_thread():
            pass
        found = looked.call_count
        with one_thread():
            pass
        assert looked.call_count == found
        monkeypatch.setitem(sys.modules, "an_imported_module", ModuleType("an_imported_module"))
        with one_thread():
            pass
        assert looked.call_count == found + 1


def test_the_end_of_a_parent_is_noticed_though_its_number_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: by what ends with the parent, here a pipe."""
    reader, writer = os.pipe()
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: SimpleNamespace(sentinel=reader))
    waiting = threading.Thread(target=_wait_for_end, args=(os.getppid(), True), daemon=True)
    waiting.start()
    waiting.join(0.05)
    assert waiting.is_alive()
    os.close(writer)
    waiting.join(10.0)
    assert not waiting.is_alive()
    os.close(reader)
