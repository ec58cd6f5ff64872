"""heyoka's Taylor integrator with samples in SIMD lanes: one integrator reused, and its ensemble call, which copies it.

The truth is integrated with the indicated state. The constants of a stretch and a sample's errors are parameters of the
compiled system; they are switched where a stretch ends, since step control does not see the kinks there. Lanes for four
registers were measured to be best: more samples share the calls from Python.
"""

from __future__ import annotations

import copy
from typing import Any

import heyoka
import numpy as np

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.peer import Fly, Peer

CONSTANTS, ERRORS = 8, 6
REGISTERS = 4
SETTINGS = (1e-6, 1e-7, 1e-8, 1e-10, 1e-12)


def _integrator(tolerance: float) -> Any:
    """An integrator of actual and indicated state, whose parameters are those of stretch and sample."""
    names = ("r", "theta", "r_rate", "theta_rate")
    variables = heyoka.make_vars(*names, *(f"{name}_i" for name in names))
    phase = [heyoka.par[place] for place in range(CONSTANTS)]
    errors = [heyoka.par[CONSTANTS + place] for place in range(ERRORS)]
    actual, indicated = joint_rates(heyoka)(heyoka.time, variables[:4], variables[4:], phase, errors)
    system = list(zip(variables, [*actual, *indicated], strict=True))
    lanes = REGISTERS * heyoka.recommended_simd_size()
    parameters = np.zeros((CONSTANTS + ERRORS, lanes))
    return heyoka.taylor_adaptive_batch(system, np.zeros((8, lanes)), pars=parameters, tol=tolerance)


def _begin(case: Case, integrator: Any, starts: np.ndarray, errors: np.ndarray) -> None:
    """Give an integrator its samples, as many as it has lanes."""
    integrator.state[:4], integrator.state[4:] = case.truths[0][:, None], starts
    integrator.pars[CONSTANTS:] = errors


def _enter(case: Case, integrator: Any, stretch: int) -> None:
    """Put an integrator at the begin of a stretch."""
    actual, indicated = case.onto_truth(stretch, integrator.state[:4], integrator.state[4:])
    integrator.state[:4], integrator.state[4:] = actual, indicated
    integrator.pars[:CONSTANTS] = case.phases[stretch][:, None]
    integrator.set_time(np.full(integrator.batch_size, case.begins[stretch]))


def _fly(case: Case, integrator: Any, stretches: range) -> None:
    for stretch in stretches:
        _enter(case, integrator, stretch)
        integrator.propagate_until(np.full(integrator.batch_size, case.ends[stretch]))


def prepare_batch(case: Case, tolerance: float, cores: int) -> Fly:
    """Lanes filled, flown and read out, block after block."""
    integrator = _integrator(tolerance)
    lanes = integrator.batch_size

    def fly(draws: np.ndarray) -> np.ndarray:
        own = copy.deepcopy(integrator)  # another thread may fly another chunk
        starts, errors = case.started(np.pad(draws, ((0, -len(draws) % lanes), (0, 0))))
        last = np.empty((8, starts.shape[1]))
        for begin in range(0, starts.shape[1], lanes):
            block = slice(begin, begin + lanes)
            _begin(case, own, starts[:, block], errors[:, block])
            _fly(case, own, range(len(case.ends)))
            last[:, block] = own.state
        return outcomes(last[:4], last[4:])[: len(draws)]

    return fly


def prepare_ensemble(case: Case, tolerance: float, cores: int) -> Fly:
    """Every block an integrator of its own: the ensemble call flies the last stretch, what sets it up those before."""
    integrator = _integrator(tolerance)
    lanes, final = integrator.batch_size, len(case.ends) - 1

    def fly(draws: np.ndarray) -> np.ndarray:
        starts, errors = case.started(np.pad(draws, ((0, -len(draws) % lanes), (0, 0))))

        def set_up(own: Any, number: int) -> Any:
            block = slice(number * lanes, (number + 1) * lanes)
            _begin(case, own, starts[:, block], errors[:, block])
            _fly(case, own, range(final))
            _enter(case, own, final)
            return own

        blocks = starts.shape[1] // lanes
        flown = heyoka.ensemble_propagate_until_batch(integrator, case.ends[final], blocks, set_up, max_workers=cores)
        last = np.concatenate([own.state for own, *_ in flown], axis=1)
        return outcomes(last[:4], last[4:])[: len(draws)]

    return fly


BATCH = Peer(prepare_batch, "tolerance", SETTINGS, 2_048, "threads", 64)
ENSEMBLE = Peer(prepare_ensemble, "tolerance", SETTINGS, 16_384, "own", 64)
