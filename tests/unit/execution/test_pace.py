"""The pace of simulations by a few of them, with a clock that they move."""

from __future__ import annotations

import pytest

from mcnav.execution import pace


class _Clock:
    """Simulations that take a start and so much each, s."""

    def __init__(self, start: float, each: float) -> None:
        self.start, self.each, self.now, self.simulated = start, each, 0.0, 0

    def perf_counter(self) -> float:
        return self.now

    def simulate(self, count: int) -> None:
        self.now += self.start + self.each * count
        self.simulated += count


@pytest.mark.parametrize(("start", "each"), [(0.1, 0.0), (0.1, 1e-4), (1e-4, 1e-5), (0.0, 0.2), (0.5, 0.01)])
def test_simulations_in_one_call_take_a_start_and_so_much_each(
    start: float, each: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = _Clock(start, each)
    monkeypatch.setattr(pace, "time", clock)
    measured = pace.measure_pace(clock.simulate, 3_200, together=True)
    assert measured.seconds(3_200) == pytest.approx(start + 3_200 * each, rel=1e-6)
    assert clock.simulated <= 1 + sum(pace.GROWTH**power for power in range(3)) + 3_200 // pace.FEW


@pytest.mark.parametrize("each", [1e-6, 1e-3, 0.7])
def test_simulations_one_after_another_take_as_long_each(each: float, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = _Clock(0.0, each)
    monkeypatch.setattr(pace, "time", clock)
    measured = pace.measure_pace(clock.simulate, 3_200, together=False)
    assert measured.seconds(3_200, calls=4) == pytest.approx(3_200 * each)
    assert clock.now <= 10.0 * pace.LEAST + each
