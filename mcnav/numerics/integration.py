"""The integrator of the truth and of what is computed along it once: scipy's DOP853.

Samples of the reference engines are integrated by its steps in compiled code (`mcnav.numerics.dop853`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from mcnav.arrays.types import Array
from mcnav.numerics.dense_output import DenseOutput

Tolerances = tuple[float, float | Array]
"""Relative, and absolute in the units of the state."""


class Diverged(ArithmeticError):
    """An indicated flight that cannot be integrated to its end; the message says why."""


def integrate(
    rates: Callable[..., Array],
    span: tuple[float, float],
    state: Array,
    tolerances: Tolerances,
    args: Sequence[object] = (),
    **options: Any,
) -> Any:
    """Integrate a state over a span of time (s).

    Returns scipy's solution, with ``options`` of its `solve_ivp`; its ``sol``, if there is one, is a `DenseOutput`.
    """
    from scipy.integrate import DOP853, solve_ivp  # slow to import: a tenth of a second

    relative, absolute = tolerances
    solution = solve_ivp(rates, span, state, method=DOP853, rtol=relative, atol=absolute, args=args, **options)
    if solution.sol is not None:
        solution.sol = DenseOutput.of(solution.sol)
    return solution
