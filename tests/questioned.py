"""Systems of one's own of which `tests.questions` asks everything: small, and with as much as each kind can have."""

from __future__ import annotations

import numpy as np

from mcnav import ClosedLoop, Filter, Measurement, Output, Simulated, Source, Strapdown, White


class Loop(ClosedLoop):
    """A vehicle along a line that is held at a place, by a noisy distance each second."""

    truth = {"position": "m", "velocity": "m/s"}
    processes = {"disturbance": White("m/s^2/sqrt(Hz)")}
    measurements = (Measurement("ranging", "m", interval=1.0, truth=lambda truth: truth.position),)
    filter = Filter(gains="nominal")
    cycle, end = 1.0, 12.0

    def rates(self, truth, command, noise):
        return {"position": truth.velocity, "velocity": command + noise.disturbance}

    def guide(self, estimate):
        return -0.2 * estimate.position - 0.6 * estimate.velocity


class QuietLoop(Loop):
    """The same without noise and measurements."""

    processes = {}
    measurements = ()
    filter = None

    def rates(self, truth, command):
        return {"position": truth.velocity, "velocity": command}


class Hopper(ClosedLoop):
    """A lander that hovers over the moon and turns slowly, with fixes of its position."""

    navigator = Strapdown("moon", (0.4, 0.1), estimates=("gyro_bias", "accelerometer_bias"))
    measurements = (Measurement("fix", "m", interval=5.0, truth=lambda truth: truth.position),)
    filter = Filter(gains="nominal")
    step, end = 2.5, 10.0

    def start(self):
        return {"position": [0.0, 0.0, -500.0], "attitude": np.eye(3)}

    def motion(self, truth):
        return {"force": np.array([0.0, 0.0, -1.6]), "rate": np.array([0.0, 0.01, 0.0])}


class QuietHopper(Hopper):
    """The same with its instruments alone."""

    navigator = Strapdown("moon", (0.4, 0.1))
    measurements = ()
    filter = None


EPOCHS = np.arange(0.0, 5.0)


class Line:
    """A place that wanders by noise, and a filter of it with the gain of the steady state."""

    sources = (Source("start", "m", "m", 1.0), Source("drift", "m/s", "m/s", 0.1))
    outputs = (Output("position", "m", "m"),)
    epochs = EPOCHS

    def fly(self, errors, noise):
        wander = np.concatenate([[0.0], np.cumsum(0.3 * noise.standard_normal(len(EPOCHS) - 1))])
        position = errors[0] + errors[1] * EPOCHS + wander
        own = 1.0 + 0.01 * EPOCHS**2 + 0.09 * EPOCHS
        return Simulated(position[:, None], own[:, None, None])


class QuietLine:
    """The same without noise, and without a filter."""

    sources, outputs, epochs = Line.sources, Line.outputs, EPOCHS

    def fly(self, errors):
        return (errors[0] + errors[1] * EPOCHS)[:, None]
