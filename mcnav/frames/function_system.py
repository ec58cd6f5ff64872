"""A function of errors as a system."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.frames.system import Linearized
from mcnav.systems.finite_differences import SHORT, DifferencedModel, differentiate
from mcnav.systems.guard import TRYING, CodeMisbehaved, call_user, in_user_code, raised_by, simulating
from mcnav.systems.sample_loop import simulate_alone, simulate_each
from mcnav.systems.user.returned import numbers_of

PROBES: Final = 10
"""Samples with which a function is called to find out what it returns."""


KINK: Final = 0.01
"""Jump of a slope at no errors, as a share of the largest, that is a kink: curvature as large as the linear effect of
one sigma is taken for one of a thousandth."""


CHUNK: Final = 8_192
"""Samples that a function is given at once: part of the system, so that results do not depend on workers."""


ONE_BY_ONE: Final = 128
"""Samples of a chunk where each is simulated by itself."""


@dataclass(frozen=True)
class FunctionSystem:
    """A function of errors, shape (n, sources) to (n, outputs), or of the errors of one sample.

    Attributes
    ----------
    one_by_one : bool
        Whether it takes one sample, shape (sources,) to (outputs,).
    """

    function: Callable[[Any], Any]
    sources: tuple[str, ...]
    outputs: tuple[Output, ...]
    one_by_one: bool = False
    backend: str = "loky"
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def chunk(self) -> int:
        """See `System`."""
        return ONE_BY_ONE if self.one_by_one else CHUNK

    def simulate(self, batch: Batch) -> SimulationResult:
        """See `System`."""
        with in_user_code("the function", simulating(batch, noise=True)):
            return self._simulate(batch.errors, len(self.outputs))

    def _simulate(self, errors: Array, width: int) -> SimulationResult:
        if not self.one_by_one:
            try:
                return _result(self._call(errors), (len(errors), width))
            except (MemoryError, OutputsError):
                raise
            except Exception as failure:
                warn_repeated(raised_by(failure))
                one = lambda row: _result(self._call(errors[row : row + 1]), (1, width))  # noqa: E731
                return simulate_alone(one, len(errors), width)
        values = np.empty((len(errors), width))
        failures = simulate_each(lambda row: _row(self._call(errors[row]), width), range(len(errors)), values)
        return SimulationResult(values, failures)

    def _call(self, errors: Array) -> Any:
        return call_user(self.function, errors.copy())

    def linearize(self, sizes: Array) -> Linearized:
        """See `System`; by central differences."""
        differences = differentiate(lambda errors: self.simulate(Batch(np.arange(len(errors)), errors, 0)), sizes)
        return Linearized(differences.model, error_of(differences), {})


def error_of(differences: DifferencedModel) -> float:
    """Return the error of differences: between steps, or the jump of a slope at no errors, where there is a kink.

    Central differences see nothing of a kink, which moves an output to the same side both ways by a share `SHORT` of
    its effect; curvature does so by the square of it.
    """
    largest = np.maximum(
        np.nan_to_num(np.abs(differences.contributions)).max(axis=(0, 1)), differences.moved.max(axis=0)
    )
    jump = float((differences.uneven.max(axis=0) / np.where(largest > 0.0, SHORT * largest, np.inf)).max(initial=0.0))
    return max(differences.error, min(jump, 1.0) if jump > KINK else 0.0)


def warn_repeated(failure: BaseException) -> None:
    """Warn once that a call with many samples failed, and that each is simulated by itself."""
    words = " ".join(f"{type(failure).__name__}: {failure}".split())
    warnings.warn(f"a call with many samples failed ({words:.200}); each sample is simulated by itself", stacklevel=2)


class OutputsError(ValueError):
    """Mistake of a function that does not return a row of numbers for each sample. No single sample causes it."""


def _numbers(returned: Any) -> Array:
    """Return what a function returned as an array of its own; `OutputsError` when these are no real numbers."""
    try:
        return numbers_of(returned.to_numpy() if hasattr(returned, "to_numpy") else returned, "the function")
    except ValueError as wrong:
        raise OutputsError(str(wrong)) from None


def _result(returned: Any, shape: tuple[int, int]) -> SimulationResult:
    """Check what a function returned for many samples; `OutputsError` for another shape."""
    if isinstance(returned, SimulationResult):
        return returned
    values = _numbers(returned)
    values = values[:, None] if values.ndim == 1 and shape[1] == 1 else values
    if values.shape != shape:
        raise OutputsError(
            f"the function must return shape {shape}, a row a sample and a column an output; got shape {values.shape}"
        )
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    values[lost] = np.nan
    return SimulationResult(values, {int(row): Failure.of(Reason.NOT_FINITE) for row in lost})


def _row(returned: Any, width: int) -> Array:
    values = np.atleast_1d(_numbers(returned))
    if values.shape != (width,):
        raise ValueError(f"fly must return shape {(width,)}; got {values.shape}")
    return values


def outputs_of(
    function: Callable[[Any], Any], probes: Array, named: str | Sequence[str | Output]
) -> tuple[Output, ...]:
    """Find the names and number of a function's outputs: as given, as it declares, of a frame, or y1, y2, …"""
    stated = named or getattr(function, "outputs", ())
    stated = (stated,) if isinstance(stated, (str, Output)) else stated
    if stated:
        known = tuple(entry if isinstance(entry, Output) else Output(str(entry), "", "") for entry in stated)
        if len({output.name for output in known}) < len(known):
            raise ValueError(f"outputs must have different names; got {', '.join(output.name for output in known)}")
        return known
    reason = ""
    for row in range(min(len(probes), PROBES)):
        try:
            with in_user_code("the function", TRYING):
                returned = call_user(function, probes[row : row + 1].copy())
        except CodeMisbehaved:
            raise
        except Exception as failure:
            raised = raised_by(failure)
            reason = f"{type(raised).__name__}: {raised}"
            continue
        if hasattr(returned, "columns"):
            return tuple(Output(str(name), "", "") for name in returned.columns)
        width = np.atleast_2d(_numbers(returned)).shape[-1]
        return tuple(Output(f"y{number + 1}", "", "") for number in range(width))
    raise ValueError(
        f"the function failed for each of the first {min(len(probes), PROBES)} samples: {reason:.200}; it is given "
        f"errors of shape (n, {probes.shape[1]}), a row a sample"
    )
