"""A navigation of type ``ins`` along a given flight, and the same as a closed loop whose guidance does nothing."""

from __future__ import annotations

from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from mcnav import ClosedLoop, Filter, Measurement, Strapdown
from mcnav.config.read import parse_campaign

FILE = Path(__file__)
LENGTH = 80.0

FLIGHT = {
    "type": "ins",
    "trajectory": {
        "rate": "1 Hz",
        "start": {
            "latitude": "47 deg",
            "longitude": "9 deg",
            "altitude": "500 m",
            "course": "30 deg",
            "speed": "90 m/s",
        },
        "segments": [{"climb": "60 m"}, {"turn": "50 deg"}, {"straight": "20 km"}],
    },
    "start": "0 s",
    "end": f"{LENGTH} s",
}

IMU = {
    "gyro": {
        "bias": "1 deg/h", "scale_factor": "300 ppm", "misalignment": ["1 mrad", "2 mrad", "3 mrad"] * 2,
        "g_sensitivity": "1 deg/h/g", "angle_random_walk": "0.1 deg/sqrt(h)",
        "bias_instability": {"sigma": "0.5 deg/h", "correlation_time": "100 s"},
    },
    "accelerometer": {
        "bias": "1 mg", "scale_factor": "300 ppm", "misalignment": "1 mrad", "nonlinearity": "10 ug/g^2",
        "velocity_random_walk": "0.05 m/s/sqrt(h)",
        "bias_instability": {"sigma": "0.1 mg", "correlation_time": "60 s"},
    },
}  # fmt: skip
BIASES = ("gyro_bias", "gyro_bias_instability", "accelerometer_bias", "accelerometer_bias_instability")


START = {"position": "10 m", "velocity": "0.1 m/s", "attitude": "0.5 mrad"}
FIXES = {"type": "position-fix", "interval": "10 s", "position": "5 m"}
STATES = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]


def flown(aided: bool = False) -> dict[str, Any]:
    """Return the tables of the flight with type ``ins``."""
    errors = {"position": "10 m", "velocity": "0.1 m/s", "tilt": "0.5 mrad", "heading": "0.5 mrad"}
    added: dict[str, Any] = {"aiding": [FIXES], "filter": {"estimates": STATES}} if aided else {}
    return {"samples": 8, "seed": 1, "scenario": FLIGHT, "imu": IMU, "errors": errors, **added}


@lru_cache
def true_flight() -> Any:
    """Return the navigation of type ``ins``."""
    scenario: Any = parse_campaign(flown(), str(FILE.with_name("x.toml")), "x").scenario
    return scenario.navigation


@cache
def true_motion(time: float) -> dict[str, Any]:
    """Return the specific force and the angular rate of the flight, m/s^2 and rad/s: loops ask for the same again."""
    states = true_flight().truth.states(np.array([time]), "strapdown", 0.0)
    return {"force": states.force[0], "rate": states.rate[0]}


class Free(ClosedLoop):
    """The flight in earth-fixed axes."""

    navigator = Strapdown("earth")
    end = LENGTH
    settings = {"step": "s"}

    def __init__(self, step=1.0):
        self.step = step

    def start(self):
        truth = true_flight().truth
        position, velocity = truth.earth_fixed(np.zeros(1))
        return {"position": position[0], "velocity": velocity[0], "attitude": truth.attitude(0.0).as_matrix()}

    def motion(self, time):
        moments, places = np.unique(time, return_inverse=True)
        motions = [true_motion(float(moment)) for moment in moments]
        return {name: np.array([motion[name] for motion in motions])[places] for name in ("force", "rate")}


class Aided(Free):
    """With fixes of position, and biases that the filter estimates."""

    navigator = Strapdown("earth", estimates=BIASES)
    measurements = (Measurement("fix", "m", interval=10.0, truth=lambda truth: truth.position),)
    filter = Filter(gains="nominal")


class OwnAided(Aided):
    """The same, each sample with gains of its own, and constant biases alone."""

    navigator = Strapdown("earth", estimates=("gyro_bias", "accelerometer_bias"))
    filter = Filter()


class FreeAtASite(Free):
    """The same in axes north, east and down at the place where it begins."""

    navigator = Strapdown("earth", site=(0.82, 0.157, 500.0))

    def start(self):
        there, began = self.navigator.frame, super().start()
        turned = {name: there.to_planet.T @ began[name] for name in ("velocity", "attitude")}
        return {"position": there.to_planet.T @ began["position"] - there.origin, **turned}


class FreeInInertialAxes(Free):
    """The same in axes that do not turn, which are the earth's at the begin."""

    navigator = Strapdown("earth", axes="inertial")

    def start(self):
        began = super().start()
        spin = np.array([0.0, 0.0, true_flight().truth.earth.rotation_rate])
        return {**began, "velocity": began["velocity"] + np.cross(spin, began["position"])}


def tables(name: str, step: float) -> dict[str, Any]:
    """Return the tables of the flight as a closed loop."""
    measured = {"measurements": {"fix": "5 m"}} if name.endswith("Aided") else {}
    scenario = {"type": f"{FILE.name}:{name}", "step": f"{step} s"}
    return {"samples": 8, "seed": 1, "scenario": scenario, "errors": START, "imu": IMU, **measured}
