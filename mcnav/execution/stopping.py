"""Simulations that are stopped between two samples because their results are not needed any more."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_stop = threading.local()


class Stopped(BaseException):
    """Simulations whose results are not needed any more."""


@contextmanager
def stopped_by(event: threading.Event) -> Iterator[None]:
    """Raise `Stopped` in this thread before its next sample once the event is set."""
    _stop.event = event
    try:
        yield
    finally:
        del _stop.event


def check_stopped() -> None:
    """Raise `Stopped` when the event of `stopped_by` is set in this thread."""
    event = getattr(_stop, "event", None)
    if event is not None and event.is_set():
        raise Stopped
