"""Plugin of pytest that records which functions of the package each test calls, and the processor time it takes.

``MCNAV_RECORD`` names the file: a line of JSON for each test that passes, with its name, its seconds and its
functions, as ``path:name``. Compilation is not looked at, which would take several times as long.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Generator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

HERE = str(Path.cwd()) + "/mcnav/"
touched: set[Any] = set()
passed: dict[str, bool] = {}
compile_for = Dispatcher.compile


def _record(frame: FrameType, event: str, _: object) -> None:
    if event == "call":
        touched.add(frame.f_code)


def _names() -> list[str]:
    return sorted(
        {
            f"mcnav/{code.co_filename.removeprefix(HERE)}:{code.co_qualname.split('.<locals>')[0]}"
            for code in touched
            if code.co_filename.startswith(HERE)
        }
    )


def _compile(dispatcher: Dispatcher, signature: Any) -> Any:
    profile = sys.getprofile()
    sys.setprofile(None)
    try:
        return compile_for(dispatcher, signature)
    finally:
        sys.setprofile(profile)


Dispatcher.compile = _compile


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    touched.clear()
    began = time.process_time()
    threading.setprofile(_record)
    sys.setprofile(_record)
    try:
        return (yield)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
        seconds = time.process_time() - began
        if passed.get(item.nodeid):
            with Path(os.environ["MCNAV_RECORD"]).open("a") as file:
                file.write(json.dumps([item.nodeid, seconds, _names()]) + "\n")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    passed[report.nodeid] = passed.get(report.nodeid, True) and report.passed
