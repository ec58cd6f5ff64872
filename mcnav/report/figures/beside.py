"""Figures drawn by two processes: half of the plots by a copy of this one, which hands them back as text."""

from __future__ import annotations

import multiprocessing
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, Final, Self

from markupsafe import Markup

from mcnav._subprocess import end_with_parent
from mcnav.report.figures.figure import Figure

PATIENCE: Final = 20.0
"""Seconds that the copy may take longer than this process, which then draws everything itself."""


def draw(drawings: Sequence[Figure]) -> None:
    """Have all plots ready as SVG; where there is no second processor, they are drawn when they are asked for."""
    plots = [(k, number) for k, drawing in enumerate(drawings) for number in range(len(drawing.plots))]
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2:
        return

    def drawn(some: Sequence[tuple[int, int]]) -> list[Markup]:
        return [drawings[k].svg(number) for k, number in some]

    with _Copy(partial(drawn, plots[1::2])) as copy:
        made = dict(zip(plots[::2], drawn(plots[::2]), strict=True))
        made |= zip(plots[1::2], copy.result() or drawn(plots[1::2]), strict=True)
    for k, drawing in enumerate(drawings):
        vars(drawing)["svgs"] = [made[k, number] for number in range(len(drawing.plots))]


class _Copy:
    """A fork of this process at some work: it has all that it needs already, and nothing is sent to it."""

    def __init__(self, work: Callable[[], object]) -> None:
        self._process: Any = None
        self._connection, there = multiprocessing.Pipe(duplex=False)
        arguments = (work, there, self._connection, os.getpid())
        process = multiprocessing.get_context("fork").Process(target=_send, args=arguments, daemon=True)
        with suppress(OSError, AssertionError), warnings.catch_warnings():
            # other threads of this process rest meanwhile; should one hold a lock for ever, patience ends it
            warnings.simplefilter("ignore", DeprecationWarning)
            process.start()
            self._process = process
        there.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        if self._process is not None:
            self._process.kill()
            self._process.join()

    def result(self) -> Any:
        """Return the result; none when there is none."""
        with suppress(EOFError, OSError):
            if self._connection.poll(PATIENCE):
                return self._connection.recv()
        return None


def _send(work: Callable[[], object], there: Connection, here: Connection, parent: int) -> None:
    end_with_parent(parent)
    here.close()  # it is the other's: when that ends, sending must fail, not wait
    with suppress(Exception):  # what is missing is made again by the other, and fails there in the open
        there.send(work())
