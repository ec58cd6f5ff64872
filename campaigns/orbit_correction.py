"""The class of `29_orbit_correction.toml`: a satellite is brought to its place in orbit by two impulses."""

import numpy as np

from mcnav import ClosedLoop, Correction, Filter, Measurement, White

PARAMETER = 3.986004418e14  # m^3/s^2
RADIUS = 6_878_137.0  # m, of the circular orbit
RATE = (PARAMETER / RADIUS**3) ** 0.5  # rad/s


def transition(time):
    """Return the transition matrix of Clohessy and Wiltshire; axes radial, along and across."""
    s, c, w = np.sin(RATE * time), np.cos(RATE * time), RATE
    return np.array([
        [4 - 3 * c, 0, 0, s / w, 2 * (1 - c) / w, 0],
        [6 * (s - w * time), 1, 0, 2 * (c - 1) / w, 4 * s / w - 3 * time, 0],
        [0, 0, c, 0, 0, s / w],
        [3 * w * s, 0, 0, c, 2 * s, 0],
        [6 * w * (c - 1), 0, 0, -2 * s, 4 * c - 3, 0],
        [0, 0, -w * s, 0, 0, c],
    ])  # fmt: skip


def targeted(estimate, coast):
    """Return the velocity change after which the satellite arrives at its place, shape (n, 3)."""
    whole = transition(coast)
    wanted = np.linalg.solve(whole[:3, 3:], -whole[:3, :3] @ estimate.position.T).T
    return wanted - estimate.velocity


class OrbitCorrection(ClosedLoop):
    """Position and velocity from its place on a circular orbit, in axes that turn with it: radial, along, across."""

    truth = {"position": ("m", ("radial", "along", "across")), "velocity": ("m/s", ("radial", "along", "across"))}
    processes = {"disturbance": White("m/s^2/sqrt(Hz)", ("radial", "along", "across"))}
    measurements = (Measurement("gnss", "m", interval=60.0, truth=lambda truth: truth.position),)
    filter = Filter(gains="nominal")
    navigator_start = "nominal"  # it is told that it is where it should be
    step = 20.0
    settings = {"begin": "s", "coast": "s"}

    def __init__(self, begin=1_800.0, coast=1_900.0):
        """Take the instant of the first impulse, and the time from it to the second one, a third of a revolution."""
        self.corrections = (
            Correction("transfer", at=begin, target=lambda estimate: targeted(estimate, coast)),
            Correction("arrival", at=begin + coast, target=lambda estimate: -estimate.velocity),
        )
        self.end = begin + coast + 500.0

    def rates(self, truth, noise):
        """Return the derivative of the truth: two-body motion in the turning axes, exact."""
        (x, y, z), (vx, vy, _) = truth.position.T, truth.velocity.T
        cube = ((RADIUS + x) ** 2 + y**2 + z**2) ** 1.5
        gravity = -PARAMETER / cube[:, None] * np.stack([RADIUS + x, y, z], axis=1)
        turning = np.stack([RATE**2 * (RADIUS + x) + 2 * RATE * vy, RATE**2 * y - 2 * RATE * vx, 0 * z], axis=1)
        return {"position": truth.velocity, "velocity": gravity + turning + noise.disturbance}
