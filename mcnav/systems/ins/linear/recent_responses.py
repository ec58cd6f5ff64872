"""Responses along a truth that variations of a navigation share: they depend on no size of an error and no filter."""

from __future__ import annotations

from typing import Final

from mcnav.arrays.types import Array
from mcnav.caches.recent import Recent
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.truth.trajectory import Platform, Truth

LARGEST: Final = 256_000_000
"""Bytes of the responses that are kept: some 16,000 steps."""

_RECENT: Final = Recent[tuple[Truth, StepResponses]](most=2)


def recent_responses(truth: Truth, platform: Platform, times: Array, imu: Imu) -> StepResponses:
    """Return the responses over steps as `respond` computes them; the last ones are not computed again.

    They are the same for the same truth and times, correlation times and lengths, and presence of quantization.
    """
    memory = imu.gyro.correlation_time.tobytes() + imu.accelerometer.correlation_time.tobytes()
    memory += imu.gravity.lengths.tobytes()
    key = (id(truth), platform, times.tobytes(), memory, imu.quantized)  # what is kept holds on to the truth

    def compute() -> tuple[Truth, StepResponses]:
        return truth, respond(truth, platform, times, imu)

    return _RECENT.get(key, compute, lambda result: _size(result[1]) <= LARGEST)[1]


def _size(responses: StepResponses) -> int:
    *tables, gravity = responses
    return sum(table.nbytes for table in (*tables, *gravity))
