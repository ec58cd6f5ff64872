"""diffrax under `jax.vmap`: an adaptive flight for every sample, compiled by XLA, in double precision.

The truth is integrated with the indicated state. The stretches are scanned over, each a `diffeqsolve` with its own
constants, so that everything is compiled once.
"""

from __future__ import annotations

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.peer import Fly, Peer

jax.config.update("jax_enable_x64", True)

CHUNK = 4_096
MOST_STEPS = 4_096
SETTINGS = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)

rates = joint_rates(jnp)


def _right_side(time, state, constants):  # type: ignore[no-untyped-def]
    actual, indicated = rates(time, state[:4], state[4:], *constants)
    return jnp.stack([*actual, *indicated])


def _flight(solver: diffrax.AbstractSolver, case: Case):  # type: ignore[no-untyped-def]
    term = diffrax.ODETerm(_right_side)
    stretches = (jnp.array(case.begins), jnp.array(case.ends), jnp.array(case.truths), jnp.array(case.phases))

    def fly_one(tolerance, start, errors):  # type: ignore[no-untyped-def]
        def fly_stretch(state, stretch):  # type: ignore[no-untyped-def]
            begin, end, truth, phase = stretch
            drift = truth - state[:4]
            flown = diffrax.diffeqsolve(
                term,
                solver,
                begin,
                end,
                None,
                state + jnp.concatenate([drift, drift]),
                (phase, errors),
                stepsize_controller=diffrax.PIDController(tolerance, tolerance, pcoeff=0.2, icoeff=0.4),
                adjoint=diffrax.ForwardMode(),
                max_steps=MOST_STEPS,
                throw=False,
            )
            return jnp.where(flown.result == diffrax.RESULTS.successful, flown.ys[-1], jnp.nan), None

        first = jnp.concatenate([jnp.array(case.truths[0]), start])
        return jax.lax.scan(fly_stretch, first, stretches)[0]

    return jax.jit(jax.vmap(fly_one, in_axes=(None, 0, 0)))


def _prepared(solver: diffrax.AbstractSolver):  # type: ignore[no-untyped-def]
    compiled: dict[int, object] = {}  # one for all tolerances, which are an argument

    def prepare(case: Case, tolerance: float, cores: int) -> Fly:
        """Samples in chunks of one size: another size would be compiled again."""
        flight = compiled.setdefault(case.number, _flight(solver, case))

        def fly(draws: np.ndarray) -> np.ndarray:
            starts, errors = case.started(np.pad(draws, ((0, CHUNK - len(draws)), (0, 0))))
            last = np.asarray(flight(tolerance, starts.T, errors.T))[: len(draws)].T
            return outcomes(last[:4], last[4:])

        return fly

    return prepare


DOPRI8 = Peer(_prepared(diffrax.Dopri8()), "relative tolerance", SETTINGS, CHUNK, "own", CHUNK)
TSIT5 = Peer(_prepared(diffrax.Tsit5()), "relative tolerance", SETTINGS, CHUNK, "own", CHUNK)
