"""The class of `24_rendezvous.toml`: a rendezvous in orbit with one targeted burn."""

import numpy as np

from mcnav import ClosedLoop, Correction, Filter, White

RATE = 0.00114  # rad/s, of the target's circular orbit
BURN, ARRIVAL = 156.7, 1056.7  # s
TARGET = np.array([500.0, 0.0, 0.0])  # m, ahead of the target


def transition(time):
    """Return the transition matrix of Clohessy and Wiltshire, axes V-bar, H-bar, R-bar."""
    s, c, w = np.sin(RATE * time), np.cos(RATE * time), RATE
    return np.array([
        [1, 0, 6 * (w * time - s), 4 * s / w - 3 * time, 0, 2 * (1 - c) / w],
        [0, c, 0, 0, s / w, 0],
        [0, 0, 4 - 3 * c, 2 * (c - 1) / w, 0, s / w],
        [0, 0, 6 * w * (1 - c), 4 * c - 3, 0, 2 * s],
        [0, -w * s, 0, 0, c, 0],
        [0, 0, 3 * w * s, -2 * s, 0, c],
    ])  # fmt: skip


def burn(estimate):
    """Return the velocity change after which the navigated position arrives at the target, shape (n, 3)."""
    whole = transition(ARRIVAL - BURN)
    wanted = np.linalg.solve(whole[:3, 3:], (TARGET - estimate.position @ whole[:3, :3].T).T).T
    return wanted - estimate.velocity


class Rendezvous(ClosedLoop):
    """A chaser two kilometres behind and one below its target; the navigator integrates the same equations."""

    truth = {"position": ("m", 3), "velocity": ("m/s", 3)}
    processes = {"disturbance": White("m/s^2/sqrt(Hz)", 3)}
    corrections = (Correction("burn", at=BURN, target=burn, noise="m/s"),)
    filter = Filter(gains="nominal")
    step, end = 2.0, ARRIVAL

    def start(self):
        """Return the nominal state."""
        return {"position": [-2000.0, 0.0, 1000.0], "velocity": [1.71, 0.0, 0.0]}

    def rates(self, truth, noise):
        """Return the derivative of the truth."""
        _, y, z = truth.position.T
        vx, _, vz = truth.velocity.T
        gravity = np.stack([2 * RATE * vz, -(RATE**2) * y, 3 * RATE**2 * z - 2 * RATE * vx], axis=1)
        return {"position": truth.velocity, "velocity": gravity + noise.disturbance}
