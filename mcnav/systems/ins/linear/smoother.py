"""Linear covariance of a smoother behind an aided navigator: what it claims, and its true errors.

The smoother is the expectation, by the filter's own model, of the errors z of the filter's states at an instant, given
all innovations n of the navigation (Bryson and Ho 1975, *Applied Optimal Control*, section 13.2; Bierman 1973, *Fixed
interval smoothing with discrete measurements*). With the filter's F, H, K, S and P, backwards from the end::

    lambda- = H^T S^-1 n + (I - K H)^T lambda+        lambda+ (before) = F^T lambda-          z - P lambda

is what is left of the errors. By the filter's model lambda has the covariance Lambda, and the smoother claims
``P - P Lambda P``. In truth lambda is linear in the true state X = (y, e^, b) of the closed loop, in later noise and
in constant errors: ``lambda = L X + (later noise) + J c``. L, J and the covariance M of the noise's part run backwards
with the true transition T and the true responses H_t and gains K_t of
`mcnav.systems.ins.linear.closed_loop.TrueLoop`::

    N  = H^T S^-1 - (I - K H)^T L+ K_t                 of an innovation
    L- = N H_t + (I - K H)^T L+                        L+ (before) = F^T L- T
    M- = N R N^T + (I - K H)^T M+ (I - K H)            M+ (before) = F^T (M- + L- Q L-^T) F

so that one pass has the true errors at all instants. Where the filter believes the truth both are the same. A smoother
with a lag has the measurements up to t + lag: a pass from there for each instant t.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray


@dataclass(frozen=True)
class SmoothedLoop:
    """A filter and the true closed loop around it, over K steps and U updates of at most M components.

    Attributes
    ----------
    first : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    sizes : ndarray of int, shape (U,)
        Components of each.
    transitions : ndarray, shape (K, f, f)
        F of the filter's states.
    responses, gains, roots : ndarray, shapes (U, M, f), (U, f, M), (U, M, M)
        H, K, and the Cholesky factor of S.
    true_transitions : ndarray, shape (K, x, x)
        T of the true state X.
    true_responses, true_gains : ndarray, shapes (U, M, x), (U, x, M)
        H_t and K_t.
    inputs, disturbances : ndarray, shapes (K, x, c), (U, M, c)
        What constant errors add to X in steps, and to innovations.
    """

    first: IndexArray
    sizes: IndexArray
    transitions: Array
    responses: Array
    gains: Array
    roots: Array
    true_transitions: Array
    true_responses: Array
    true_gains: Array
    inputs: Array
    disturbances: Array


@dataclass(frozen=True)
class SmoothedProcesses:
    """Processes of noise, p of them, each with b biases of its own that drive the first d elements of X.

    Attributes
    ----------
    responses, decays : tuple of ndarray, shapes (K, d, b), (K, b)
        Of X to the biases in a step, and what is left of them, of each process.
    noise : tuple of ndarray, shape (K, d + b, d + b)
        Covariance that a step adds to X and the biases.
    seen, measured : ndarray, shapes (U, M, p, b), (U, M, p)
        Responses of the innovations to the biases; variance of the measurements' white noise.
    """

    responses: tuple[Array, ...]
    decays: tuple[Array, ...]
    noise: tuple[Array, ...]
    seen: Array
    measured: Array


@dataclass(frozen=True)
class Backward:
    """The backward recursion at m readings.

    Attributes
    ----------
    own : ndarray, shape (m, f, f)
        Lambda.
    state, constants : ndarray, shapes (m, f, x), (m, f, c)
        L and J.
    biases : ndarray, shape (m, p, f, b)
        L of the biases of each process.
    noise : ndarray, shape (m, p, f, f)
        M of each process.
    """

    own: Array
    state: Array
    constants: Array
    biases: Array
    noise: Array


SAME_INSTANT: Final = 1e-6
"""Times that differ by no more, s, are the same: a lag is written to fewer digits."""


def last_times(times: Array, readings: IndexArray, lag: float) -> IndexArray:
    """Return the numbers of the last times whose measurements count at readings, shape (m,)."""
    until = np.searchsorted(times, times[readings] + lag + SAME_INSTANT, side="right") - 1
    return np.asarray(np.maximum(until, readings), dtype=np.int64)


def run_smoother(
    loop: SmoothedLoop, processes: SmoothedProcesses, readings: IndexArray, after: Array, ends: IndexArray
) -> Backward:
    """Run the smoother backwards from the last measurements that count.

    Parameters
    ----------
    readings : ndarray of int, shape (m,)
        Numbers of times, in order, each once after updates and once before at most.
    after : ndarray of bool, shape (m,)
        Whether after the updates at that time, or before.
    ends : ndarray of int, shape (m,)
        Numbers of the last times whose updates count; readings of one end share a pass.
    """
    whole: Backward | None = None
    for end in np.unique(ends):
        of_end = np.flatnonzero(ends == end)
        read = _run_back(loop, processes, readings[of_end], after[of_end], int(end))
        if whole is None:
            whole = Backward(*(np.zeros((len(readings), *each.shape[1:])) for each in vars(read).values()))
        for name, part in vars(read).items():
            getattr(whole, name)[of_end] = part
    if whole is None:
        raise ValueError("readings: got none, expected at least one")
    return whole


def _run_back(
    loop: SmoothedLoop, processes: SmoothedProcesses, readings: IndexArray, after: Array, end: int
) -> Backward:
    """Run back from after the updates at an end to the first of the readings."""
    filtered = loop.transitions.shape[1]
    states, constants, count = loop.true_transitions.shape[1], loop.inputs.shape[2], len(processes.decays)
    own, noise = np.zeros((filtered, filtered)), np.zeros((count, filtered, filtered))
    state, constant = np.zeros((filtered, states)), np.zeros((filtered, constants))
    bias = np.zeros((count, filtered, processes.seen.shape[3]))
    read = Backward(*(np.zeros((len(readings), *each.shape)) for each in (own, state, constant, bias, noise)))
    pairs = zip(readings.tolist(), after.tolist(), strict=True)
    wanted = {(number, bool(updated)): place for place, (number, updated) in enumerate(pairs)}

    def keep(number: int, updated: bool) -> None:
        if (place := wanted.get((number, updated))) is not None:
            read.own[place], read.state[place], read.constants[place] = own, state, constant
            read.biases[place], read.noise[place] = bias, noise

    for k in range(end, int(readings.min()) - 1, -1):
        if k < end:
            # back over step k: F^T ... T
            over, true = loop.transitions[k].T, loop.true_transitions[k]
            added, faded = np.zeros_like(noise), np.zeros_like(bias)
            for p in range(count):
                driven = processes.responses[p].shape[1]
                joint = np.concatenate([state[:, :driven], bias[p]], axis=1)
                added[p] = joint @ processes.noise[p][k] @ joint.T
                faded[p] = state[:, :driven] @ processes.responses[p][k] + bias[p] * processes.decays[p][k]
            own, noise, bias = over @ own @ over.T, over @ (noise + added) @ over.T, over @ faded
            constant, state = over @ (constant + state @ loop.inputs[k]), over @ state @ true
        keep(k, True)
        for u in range(loop.first[k + 1] - 1, loop.first[k] - 1, -1):
            m = loop.sizes[u]
            response, gain, root = loop.responses[u, :m], loop.gains[u, :, :m], loop.roots[u, :m, :m]
            left = (np.eye(filtered) - gain @ response).T
            whitened = np.linalg.solve(root, response)
            weight = np.linalg.solve(root.T, whitened).T  # H^T S^-1
            innovation = weight - left @ state @ loop.true_gains[u, :, :m]
            own = whitened.T @ whitened + left @ own @ left.T
            scaled = innovation * np.sqrt(processes.measured[u, :m].T)[:, None, :]
            noise = scaled @ scaled.swapaxes(1, 2) + left @ noise @ left.T
            bias = np.einsum("fc,cpb->pfb", innovation, processes.seen[u, :m]) + left @ bias
            constant = innovation @ loop.disturbances[u, :m] + left @ constant
            state = innovation @ loop.true_responses[u, :m] + left @ state
        keep(k, False)
    return read
