"""The models that a record may have, and what each costs where one of them is chosen.

Every model has white noise. Quantization and at most two slow processes may come with it: a rate random walk, flicker
noise, a Gauss-Markov process. The model with the smallest ``−2 log L + price`` is chosen. Quantization or a first slow
process that is not there is taken in where it gains more than `PENALTY`: half of the χ² law with one degree, in 0.7 of
100 records. A second slow process is taken in earlier, since left out it spoils the intervals of the first.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final

from mcnav.identification.processes import FLICKER, GAUSS_MARKOV, QUANTIZATION, RATE_RANDOM_WALK, WHITE, Model, Process

SLOW: Final = (RATE_RANDOM_WALK, FLICKER, GAUSS_MARKOV)
"""Processes that stand out of white noise at low frequencies."""

MODELS: Final = tuple(
    Model((WHITE, *fast, *slow))
    for fast in ((), (QUANTIZATION,))
    for number in range(3)
    for slow in combinations(SLOW, number)
)

PENALTY: Final = 6.0
"""Price of quantization, and of a first slow process, in −2 log L."""

BESIDE: Final = 2.0
"""Price of a second slow process."""

TIMED: Final = 4.3
"""Price of a correlation time: a walk is a Gauss-Markov process of a long one, and stands for it until it bends."""

CLOSE: Final = 4.0
"""Margin below which models are not told apart: a second process is certain where it gains `BESIDE` and this, 6."""


def price(model: Model) -> float:
    """Return what a model costs, in −2 log L."""
    slow = len(slow_processes(model))
    timed = TIMED * (GAUSS_MARKOV in model.processes)
    return PENALTY * (QUANTIZATION in model.processes) + PENALTY * (slow > 0) + BESIDE * (slow > 1) + timed


def slow_processes(model: Model) -> tuple[Process, ...]:
    """Return the slow processes of a model."""
    return tuple(process for process in model.processes if process in SLOW)


def ambiguity(chosen: Model, rival: Model) -> str:
    """Say what a record cannot tell where a rival fits it nearly as well.

    >>> ambiguity(Model((WHITE, FLICKER, RATE_RANDOM_WALK)), Model((WHITE, FLICKER)))
    'whether there is rate random walk'
    """
    more, fewer = (
        " and ".join(process.words for process in one.processes if process not in other.processes)
        for one, other in ((chosen, rival), (rival, chosen))
    )
    return f"{more} from {fewer}" if fewer else f"whether there is {more}"
