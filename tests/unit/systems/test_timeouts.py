"""Limits of the time of a call, with the system's alarm and without one."""

from __future__ import annotations

import signal
import time

import pytest

from mcnav.systems.timeouts import SampleTimeout, time_limit, within_limit, within_reading_limit


@pytest.mark.parametrize("alarm", [True, False])
def test_a_call_is_limited(alarm: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python code ends, also where it swallows the first exception; what is in time returns."""
    if not alarm:
        for name in ("SIGALRM", "setitimer", "getitimer", "ITIMER_REAL"):
            monkeypatch.delattr(signal, name)
    number = signal.SIGALRM if alarm else signal.SIGTERM
    handler = signal.getsignal(number)

    def swallow() -> None:
        for _ in range(2):
            try:
                time.sleep(0.002)
                while True:
                    pass
            except SampleTimeout:
                last.append(time.monotonic())
        raise SampleTimeout("swallowed")

    last: list[float] = []
    with time_limit(0.3):
        began = time.monotonic()
        with pytest.raises(SampleTimeout):
            within_limit(lambda: [None for _ in iter(int, 1)])
        assert time.monotonic() - began >= 0.3
        assert within_limit(lambda: within_reading_limit(lambda: 3)) == 3
    with time_limit(0.2), pytest.raises(SampleTimeout):
        within_limit(swallow)
    assert len(last) >= 1
    assert signal.getsignal(number) is handler
