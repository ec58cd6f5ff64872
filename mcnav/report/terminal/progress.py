"""Progress in the terminal: one line per phase, with a bar where the number of samples is known."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Timer
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from mcnav.execution.progress import COMPILATION, MEASUREMENT, Phase, Progress, duration

QUIET_SECONDS: Final = 1.0
"""Time after which progress appears."""

BAR_WIDTH: Final = 30


@dataclass
class _Line:
    """One phase as shown.

    Times are those of the clock, s; ``began`` is earlier by the time spent in the phase before. Of the samples that are
    ``ready``, so many were ``stored`` already.
    """

    phase: Phase
    note: str
    total: int | None
    began: float
    ended: float | None = None
    ready: int = 0
    stored: int = 0

    def cells(self, now: float) -> tuple[RenderableType, ...]:
        """Return phase, bar, count and speed or time."""
        elapsed = (now if self.ended is None else self.ended) - self.began
        words = f"{self.phase.value}, {self.note}" if self.note else self.phase.value
        if self.ended is None and COMPILATION.begun:
            once = ", once" if COMPILATION.stored else ""
            words += f"; compiling for this machine{once}: {COMPILATION.functions} functions so far"
        if self.ended is None and MEASUREMENT.total:
            words += f"; covariance of the noise: {MEASUREMENT.done:,} of {MEASUREMENT.total:,} simulations"
            left = MEASUREMENT.seconds_left
            words += "" if math.isnan(left) else f", {duration(left)} left"
        if self.phase != Phase.SIMULATING:
            return Text(words), Text(), Text(), Text(duration(elapsed))
        count = f"{self.ready:,}" if self.total is None else f"{self.ready:,}/{self.total:,}"
        bar = ProgressBar(total=self.total, completed=self.ready, width=BAR_WIDTH, pulse=False)
        return Text(words), Text() if self.total is None else bar, Text(f"{count} samples"), Text(self._pace(elapsed))

    def _pace(self, elapsed: float) -> str:
        simulated = self.ready - self.stored
        if self.ended is not None or not simulated or elapsed <= 0.0:
            return duration(elapsed)
        rate = simulated / elapsed
        if self.total is None or self.ready >= self.total:
            return f"{rate:,.0f} samples/s"
        return f"{rate:,.0f} samples/s, {duration((self.total - self.ready) / rate)} left"


class Lines:
    """Phases and samples as lines of text that rich can render at any time; ``clock`` returns seconds."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lines: list[_Line] = []

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Begin a phase and end the one before; a phase that was shown before continues."""
        now = self._clock()
        if self._lines:
            self._lines[-1].ended = now
        line = _Line(phase, note, samples, now)
        for before in [line for line in self._lines if line.phase == phase]:
            line.began -= (now if before.ended is None else before.ended) - before.began
            line.ready, line.stored = before.ready, before.stored
            self._lines.remove(before)
        self._lines.append(line)

    def advance(self, samples: int, stored: bool = False) -> None:
        """Count samples that are ready."""
        if self._lines:
            self._lines[-1].ready += samples
            self._lines[-1].stored += samples if stored else 0

    def __rich__(self) -> RenderableType:
        """Return the lines."""
        table = Table.grid(padding=(0, 1))
        now = self._clock()
        for line in list(self._lines):
            table.add_row(*line.cells(now))
        return Group(table)


@contextmanager
def shown(console: Console) -> Iterator[Progress]:
    """Show progress on a terminal after `QUIET_SECONDS` and clear it at the end; elsewhere show nothing."""
    lines = Lines()
    if not console.is_terminal:
        yield lines
        return
    live = Live(lines, console=console, transient=True, refresh_per_second=4, redirect_stdout=False)
    begin = Timer(QUIET_SECONDS, live.start)
    begin.daemon = True
    begin.start()
    try:
        yield lines
    finally:
        begin.cancel()
        begin.join()
        live.stop()
