"""Closed loops of the tests, as a user's file has them, and campaigns of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mcnav import Attitude, ClosedLoop, Correction, Filter, GaussMarkov, Measurement, Phase, Trigger, White
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign, read_campaign


class Still(ClosedLoop):
    """A constant that is measured; nothing is steered."""

    truth = {"x": "m"}
    measurements = (Measurement("fix", "m", interval=1.0, truth=lambda truth: truth.x),)
    filter = Filter()
    cycle, end = 1.0, 1.0
    settings = {"until": "s"}

    def __init__(self, until=1.0):
        self.end = until

    def rates(self, truth):
        return {"x": 0.0 * truth.x}


class Scalar(ClosedLoop):
    """x+ = x - L x_hat + w each second, z = x+ + v."""

    truth = {"x": "m"}
    processes = {"walk": White("m/sqrt(s)")}
    measurements = (Measurement("position", "m", interval=1.0, truth=lambda truth: truth.x),)
    filter = Filter()
    cycle, end = 1.0, 100.0
    settings = {"gain": "1"}

    def __init__(self, gain=1.0):
        self.gain = gain

    def rates(self, command, noise):
        return {"x": command + noise.walk}

    def guide(self, estimate):
        return -self.gain * estimate.x


class DoubleIntegrator(ClosedLoop):
    truth = {"position": "m", "velocity": "m/s"}
    processes = {"disturbance": White("m/s^2/sqrt(Hz)")}
    measurements = (Measurement("ranging", "m", interval=1.0, truth=lambda truth: truth.position),)
    filter = Filter()
    cycle, end = 1.0, 200.0
    settings = {"of_position": "1", "of_velocity": "1"}

    def __init__(self, of_position=0.213023288, of_velocity=0.652722433):
        self.law = of_position, of_velocity

    def rates(self, truth, command, noise):
        return {"position": truth.velocity, "velocity": command + noise.disturbance}

    def guide(self, estimate):
        return -self.law[0] * estimate.position - self.law[1] * estimate.velocity


class Remembering(DoubleIntegrator):
    """The filter written out: P = F P F^T + W since the last second, K = P H^T / (H P H^T + R)."""

    filter = None
    memory = {"p": ("1", ("rr", "rv", "vv"))}

    def start(self):
        return {"p": np.array([9.0, 0.0, 0.0])}

    def update(self, innovation, estimate, memory):
        rr, rv, vv = memory.p.T
        rr, rv, vv = rr + 2.0 * rv + vv + 0.01 / 3.0, rv + vv + 0.01 / 2.0, vv + 0.01
        of_position, of_velocity = rr / (rr + 4.0), rv / (rr + 4.0)
        after = np.stack([rr - of_position * rr, rv - of_position * rv, vv - of_velocity * rv], axis=1)
        position, velocity = estimate.position + of_position * innovation, estimate.velocity + of_velocity * innovation
        return {"position": position, "velocity": velocity, "p": after}

    def covariance(self, memory):
        return memory.p[:, [0, 1, 1, 2]].reshape(-1, 2, 2)

    def outputs(self, truth):
        return {"energy": (0.5 * truth.velocity**2 + truth.position, "m")}


class ConstantGain(Remembering):
    """The same with the gains of the steady state, of what is measured in place of the innovation."""

    memory = {}

    def start(self):
        return {}

    def update(self, measured, estimate, name):
        innovation = (measured - estimate.position) * (name == "ranging")
        return {
            "position": estimate.position + 0.271106383 * innovation,
            "velocity": estimate.velocity + 0.042687633 * innovation,
        }

    def covariance(self):
        steady = 4.0 * np.array([0.271106383, 0.042687633])  # K R = P H^T
        return np.array([[steady[0], steady[1]], [steady[1], 0.241887060**2]])

    def outputs(self, truth, estimate):
        moved = np.stack([estimate.position - truth.position, truth.velocity], axis=1)
        return {"moved": (moved, "m"), "fuel": (np.abs(truth.velocity + 3.0), "m/s", "control")}


class Biased(DoubleIntegrator):
    """A model that is wrong by a metre."""

    measurements = (
        Measurement("ranging", "m", interval=1.0, truth=lambda truth: truth.position,
                    model=lambda estimate: estimate.position + 1.0),
    )  # fmt: skip


class Continuous(DoubleIntegrator):
    cycle, step, end = None, 0.5, 60.0


class Fine(Continuous):
    step, end = 0.05, 120.0


class Nominal(DoubleIntegrator):
    filter = Filter(gains="nominal")


class Corrected(DoubleIntegrator):
    """An impulse among measurements, each sample with its own gains."""

    corrections = (Correction("push", at=20.0, target=lambda estimate: -0.5 * estimate.velocity),)
    end = 40.0


class Trim(ClosedLoop):
    """A correction of zero in the nominal, with the covariance of the rendezvous' burn."""

    truth = {"velocity": ("m/s", 3)}
    corrections = (Correction("burn", at=5.0, target=lambda estimate: -estimate.velocity),)
    step, end = 5.0, 10.0

    def rates(self):
        return {}


class Descent(ClosedLoop):
    """Sixty metres a second along, twenty down, for 50 seconds."""

    truth = {"x": "m", "altitude": "m", "vx": "m/s", "vz": "m/s"}
    step, end = 1.0, Trigger(lambda truth: truth.altitude, latest=100.0)

    def start(self):
        return {"x": 0.0, "altitude": 1000.0, "vx": 60.0, "vz": 20.0}

    def rates(self, truth):
        return {"x": truth.vx, "altitude": -truth.vz}


class FixedDescent(Descent):
    end = 50.0


class Landing(ClosedLoop):
    """A guided fall with gusts, an altimeter, and an end by the altitude that the navigator indicates."""

    truth = {"altitude": "m", "rate": "m/s"}
    processes = {"gusts": White("m/s^2/sqrt(Hz)")}
    measurements = (Measurement("altimeter", "m", interval=2.0, truth=lambda truth: truth.altitude),)
    filter = Filter()
    cycle, step, end = 1.0, 0.5, Trigger(lambda estimate: estimate.altitude - 10.0, latest=60.0)

    def start(self):
        return {"altitude": 500.0, "rate": -15.0}

    def rates(self, truth, command, noise):
        return {"altitude": truth.rate, "rate": command + noise.gusts}

    def guide(self, estimate):
        return -0.3 * (estimate.rate + 15.0)


class Kicked(Descent):
    """A kick along x where the true altitude is 400 m, half of what the navigator takes for its speed."""

    corrections = (
        Correction("kick", at=Trigger(lambda truth: truth.altitude - 400.0, latest=80.0),
                   target=lambda estimate: 0.5 * estimate.vx, apply="vx", known="executed"),
    )  # fmt: skip


class Braking(Landing):
    """Brakes where the navigator indicates 200 m, within a step and between measurements."""

    corrections = (
        Correction("brake", at=Trigger(lambda estimate: estimate.altitude - 200.0, latest=40.0),
                   target=lambda estimate: 0.4 * (-5.0 - estimate.rate), apply="rate"),
    )  # fmt: skip

    def guide(self, estimate):
        return -0.3 * (estimate.rate + 0.03 * estimate.altitude + 5.0)


class Lander(ClosedLoop):
    """A fall of 100 s that is braked from 900 m on, where the navigator indicates it, and held from 90 s on."""

    truth = {"altitude": "m", "rate": "m/s"}
    phases = (
        Phase("fall"),
        Phase("brake", begins=Trigger(lambda estimate: estimate.altitude - 900.0, latest=80.0)),
        Phase("hold", begins=90.0),
    )
    step, end = 1.0, 100.0

    def start(self):
        return {"altitude": 2_000.0, "rate": -5.0}

    def rates(self, truth, phase):
        if phase == "fall":
            return {"altitude": truth.rate, "rate": -1.62}
        if phase == "brake":
            return {"altitude": truth.rate, "rate": 0.9 + 0.0 * truth.rate}
        return {"altitude": 0.5 * truth.rate}


class GuidedLander(Landing):
    """The landing with a stiffer law and more gusts below 193 m, as the truth has it."""

    phases = (Phase("high"), Phase("low", begins=Trigger(lambda truth: truth.altitude - 193.0, latest=40.0)))

    def rates(self, truth, command, noise, phase):
        gusts = noise.gusts if phase == "high" else 2.0 * noise.gusts - 0.1 * (truth.rate + 15.0)
        return {"altitude": truth.rate, "rate": command + gusts}

    def guide(self, estimate, phase):
        return (-0.3 if phase == "high" else -0.6) * (estimate.rate + 15.0)


class Pendulum(ClosedLoop):
    """A bent truth with a bias of the sensor that is estimated, a drag that is considered, and held guidance."""

    truth = {"angle": "rad", "rate": "rad/s"}
    estimate = {"angle": "rad", "rate": "rad/s", "bias": "rad"}
    parameters = {"drag": "1"}
    processes = {"gusts": White("rad/s^2/sqrt(Hz)"), "bias": GaussMarkov("rad")}
    measurements = (
        Measurement("encoder", "rad", interval=1.0, truth=lambda truth, noise: np.sin(truth.angle) + noise.bias,
                    model=lambda estimate: np.sin(estimate.angle) + estimate.bias),
    )  # fmt: skip
    filter = Filter(considers=("drag",))
    cycle, step, end = 1.0, 0.25, 20.0

    def start(self):
        return {"angle": 0.5, "rate": 0.0}

    def rates(self, truth, command, noise, parameters):
        torque = -np.sin(truth.angle) - (0.1 + parameters.drag) * truth.rate
        return {"angle": truth.rate, "rate": torque + command + noise.gusts}

    def guide(self, estimate):
        return -0.5 * estimate.rate


class Satellite(ClosedLoop):
    """A gyroscope with drift and a star tracker on a satellite that turns about z, by 8.6 turns in 9 minutes."""

    truth = {"attitude": Attitude("body"), "drift": ("rad/s", 3)}
    processes = {"walk": White("rad/sqrt(s)", 3), "drift_walk": White("rad/s/sqrt(s)", 3)}
    measurements = (Measurement("tracker", "rad", interval=5.0, truth=lambda truth: truth.attitude),)
    filter = Filter()
    cycle, step, end = 5.0, 2.5, 540.0
    rate = np.array([0.0, 0.0, 0.1])

    def start(self):
        return {"attitude": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}

    def rates(self, noise):
        return {"attitude": self.rate, "drift": noise.drift_walk}

    def sense(self, truth, noise):
        return self.rate + truth.drift + noise.walk

    def navigate(self, estimate, sensed):
        return {"attitude": sensed - estimate.drift}


class Gyroscopes(ClosedLoop):
    """Three gyroscopes alone, errors in reference axes; half a turn every 50 seconds."""

    truth = {"attitude": Attitude()}
    parameters = {"drift": ("rad/s", 3)}
    processes = {"walk": White("rad/sqrt(s)", 3)}
    step, end = 2.5, 525.0
    rate = np.array([0.0, 0.0, np.pi / 50.0])

    def rates(self):
        return {"attitude": self.rate}

    def sense(self, parameters, noise):
        return self.rate + parameters.drift + noise.walk

    def navigate(self, sensed):
        return {"attitude": sensed}


SIZES: Mapping[str, Mapping[str, Any]] = {
    "Still": {"errors": {"x": "5 m"}, "measurements": {"fix": "2 m"}},
    "Scalar": {"processes": {"walk": "1 m/sqrt(s)"}, "measurements": {"position": "1 m"}},
    "DoubleIntegrator": {
        "errors": {"true_position": "10 m", "position": "3 m"},
        "processes": {"disturbance": "0.1 m/s^2/sqrt(Hz)"},
        "measurements": {"ranging": "2 m"},
    },
    "Trim": {
        "errors": {
            "true_velocity_x": "0.0336119023630829 m/s", "true_velocity_y": "0.043291158546284986 m/s",
            "true_velocity_z": "0.09082802475163287 m/s",
        },
        "correlations": [{"between": ["true_velocity_x", "true_velocity_z"], "coefficient": 0.13732618}],
    },
    "Descent": {
        "errors": {"true_x": "30 m", "true_altitude": "25 m", "true_vx": "0.5 m/s", "true_vz": "0.4 m/s"},
    },
    "Landing": {
        "errors": {"true_altitude": "2 m", "true_rate": "0.1 m/s", "altitude": "2 m", "rate": "0.1 m/s"},
        "processes": {"gusts": "0.1 m/s^2/sqrt(Hz)"},
        "measurements": {"altimeter": "1 m"},
    },
    "Lander": {"errors": {"true_altitude": "20 m", "true_rate": "0.5 m/s", "altitude": "10 m", "rate": "0.2 m/s"}},
    "Kicked": {
        "errors": {
            "true_x": "30 m", "true_altitude": "25 m", "true_vx": "0.5 m/s", "true_vz": "0.4 m/s", "vx": "1 m/s",
        },
        "processes": {"kick": "0.2 m/s"},
    },
    "Braking": {
        "errors": {"true_altitude": "2 m", "true_rate": "0.1 m/s", "altitude": "2 m", "rate": "0.1 m/s"},
        "processes": {"gusts": "0.1 m/s^2/sqrt(Hz)", "brake": "0.05 m/s"},
        "measurements": {"altimeter": "1 m"},
    },
    "Pendulum": {
        "errors": {"true_angle": "20 mrad", "angle": "10 mrad", "rate": "5 mrad/s", "drag": "2 %"},
        "processes": {
            "gusts": "10 mrad/s^2/sqrt(Hz)", "bias": {"sigma": "5 mrad", "correlation_time": "10 s"},
        },
        "measurements": {"encoder": "5 mrad"},
    },
    "Satellite": {
        "errors": {"true_attitude": "0.2 rad", "attitude": "1 mrad", "true_drift": "20 urad/s"},
        "processes": {"walk": "0.1 mrad/sqrt(s)", "drift_walk": "5 urad/s/sqrt(s)"},
        "measurements": {"tracker": "0.5 mrad"},
    },
    "Gyroscopes": {
        "errors": {"true_attitude": "0.2 rad", "attitude": "1 mrad", "drift": "20 urad/s"},
        "processes": {"walk": "0.1 mrad/sqrt(s)"},
    },
}  # fmt: skip
"""Sizes of the loops' errors, and of those that inherit from them."""

FILE = Path(__file__)
CAMPAIGNS = FILE.resolve().parent.parent / "campaigns"
SHIPPED = {
    "Rendezvous": "24_rendezvous",
    "CruiseMissile": "28_cruise_missile",
    "OrbitCorrection": "29_orbit_correction",
}
"""Loops of campaigns of the project."""

OF = {
    "GuidedLander": "Landing",
    "Biased": "DoubleIntegrator",
    "Continuous": "DoubleIntegrator", "Fine": "DoubleIntegrator", "Remembering": "DoubleIntegrator",
    "ConstantGain": "DoubleIntegrator", "Nominal": "DoubleIntegrator", "Corrected": "DoubleIntegrator",
    "FixedDescent": "Descent",
}  # fmt: skip


def tables(name: str, **changes: Any) -> dict[str, Any]:
    """Return the tables of a loop's campaign; ``changes`` replace some, and ``settings`` are added to its scenario."""
    settings = changes.pop("settings", {})
    scenario = {"type": f"{FILE.name}:{name}", **settings}
    return {"samples": 64, "seed": 5, "scenario": scenario, **SIZES[OF.get(name, name)], **changes}


def campaign(name: str, **changes: Any) -> Campaign:
    """Return the campaign of a loop of this file, or of one of the project's campaigns, which nothing changes.

    Without changes it is read once: its plan, and what is looked at before its samples, are then computed once.
    """
    return _read(name, **changes) if changes else _unchanged(name)


@cache
def _unchanged(name: str) -> Campaign:
    return _read(name)


def _read(name: str, **changes: Any) -> Campaign:
    if name in SHIPPED:
        return read_campaign(CAMPAIGNS / f"{SHIPPED[name]}.toml")
    return parse_campaign(tables(name, **changes), str(FILE.with_name("x.toml")), "x")
