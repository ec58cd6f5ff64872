"""Responses along a truth in blocks of steps, which are computed where they are asked for.

The tables of a step take 16 kB. The first blocks are kept, as many as there is room for; of others the last two.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from mcnav.arrays.types import Array
from mcnav.caches.recent import Recent
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.linear.response import StepResponses, join_responses, respond, responses_between
from mcnav.systems.ins.truth.trajectory import Platform, Truth

BLOCK: Final = 512
"""Steps of a block."""

KEPT: Final = 64_000_000
"""Bytes of the blocks that are kept: some 3,900 steps, an hour at 1 s."""

LATEST: Final = 2
"""Blocks that are kept beside them: readers in order ask for a block several times, and at its end for the next."""


@dataclass(frozen=True, eq=False)
class Responses:
    """Responses over the K steps between rising times, of which the first is the start of navigation.

    They have the same bits whichever steps are asked for.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
    kept : int
        Bytes of the blocks that are kept.
    """

    truth: Truth
    platform: Platform
    times: Array
    imu: Imu
    kept: int = KEPT
    _first: dict[int, StepResponses] = field(default_factory=dict, repr=False)
    _latest: list[tuple[int, StepResponses]] = field(default_factory=list, repr=False)

    def between(self, first: int, last: int) -> StepResponses:
        """Return the responses over the steps from the first to before the last."""
        begin = min(first, len(self.times) - 2) // BLOCK
        end = max(begin + 1, -(-last // BLOCK))
        offset = begin * BLOCK
        blocks = [self._block(number) for number in range(begin, end)]
        return responses_between(join_responses(blocks), first - offset, last - offset)

    def blocks(self) -> Iterator[tuple[slice, StepResponses]]:
        """Yield all blocks in order, each with its steps."""
        steps = len(self.times) - 1
        for first in range(0, steps, BLOCK):
            yield slice(first, min(first + BLOCK, steps)), self._block(first // BLOCK)

    def _block(self, number: int) -> StepResponses:
        if number in self._first:
            return self._first[number]
        latest = list(self._latest)
        for known, responses in latest:
            if known == number:
                return responses
        times = self.times[number * BLOCK : (number + 1) * BLOCK + 1]
        responses = respond(self.truth, self.platform, times, self.imu, float(self.times[0]))
        if (number + 1) * _size(responses) <= self.kept:
            self._first[number] = responses
        else:
            self._latest[:] = [*latest, (number, responses)][-LATEST:]
        return responses


_RECENT: Final = Recent[Responses](most=2)


def recent_responses(truth: Truth, platform: Platform, times: Array, imu: Imu) -> Responses:
    """Return the responses over steps, of which variations of a navigation share the blocks that are kept.

    They are the same for the same truth and times, correlation times and lengths, and presence of quantization; they
    depend on no size of an error and no filter.
    """
    memory = imu.gyro.correlation_time.tobytes() + imu.accelerometer.correlation_time.tobytes()
    memory += imu.gravity.lengths.tobytes()
    key = (id(truth), platform, times.tobytes(), memory, imu.quantized)  # what is kept holds on to the truth
    return _RECENT.get(key, lambda: Responses(truth, platform, times, imu))


def _size(responses: StepResponses) -> int:
    *tables, gravity = responses
    return sum(table.nbytes for table in (*tables, *gravity))
