"""The class of `27_powered_descent.toml`: from an orbit of the moon to a landing site under thrust."""

import numpy as np

from mcnav import ClosedLoop, Filter, Measurement, Phase, Strapdown, Trigger, White

SITE = (0.4561, 0.0634)  # rad
GATE, OVER = 525.0, 645.0  # s: for which braking and approach aim
GATE_AT, GATE_BY = np.array([0.0, -4800.0, -2430.0]), np.array([0.0, 120.0, 40.0])  # m, m/s: north, east, down
OVER_AT, OVER_BY = np.array([0.0, 0.0, -150.0]), np.array([0.0, 0.0, 8.5])  # over the site
SLOWEST, FLARE = 1.0, 27.0  # m/s, s: rate of the last descent, and altitude over what is added to it before
LOADED, EXHAUST = 15_000.0, 311.0 * 9.80665  # kg, m/s
LEAST, MOST = 0.8, 6.0  # m/s^2, of the thrust per mass
TURNING = 0.35  # 1/s, of the attitude towards the direction of the thrust
SLOWING = np.array([0.1, 0.1, 0.3])  # 1/s, of what a velocity is too large
UP = -np.array([0.0, 0.0, 1.0])  # the thrust, in body axes


def aimed(left, way, velocity, last):
    """Return the acceleration, linear in time, after which way is made and velocity is the last one."""
    return 6.0 * way / left**2 - 2.0 * (2.0 * velocity + last) / left


def aimed_at_rest(left, way, velocity, last):
    """Return the acceleration, quadratic in time, after which there is none (Klumpp 1974)."""
    return 12.0 * way / left**2 - 6.0 * (velocity + last) / left


def height(truth):
    """Return the height above the ground: the site's plain, and further away the moon's figure."""
    near = np.hypot(truth.position[:, 0], truth.position[:, 1]) < 5e3
    return np.where(near, -truth.position[:, 2], Lander.navigator.altitude(truth.position))


class Lander(ClosedLoop):
    """A lander that brakes, aiming at a point over its site, and then sinks upright."""

    navigator = Strapdown("moon", SITE, estimates=("gyro_bias", "accelerometer_bias"))
    truth = {"mass": "kg"}
    parameters = {"throttle": "1", "altimeter_scale": "1", "velocimeter_scale": "1"}
    processes = {"jitter": White("rad/sqrt(s)", 3)}
    phases = (
        Phase("braking"),
        Phase("approach", begins=480.0),
        Phase("descent", begins=626.0),
        Phase("landing", begins=670.0),
    )
    filter = Filter(considers=("altimeter_scale", "velocimeter_scale"), gains="nominal")
    command = ("1", ("thrust", "roll", "pitch", "yaw"))
    cycle, step = 2.0, 1.0
    end = Trigger(height, latest=760.0)
    measurements = (
        Measurement(
            "altimeter", "m", instants=np.arange(340.0, 760.0, 2.0),
            truth=lambda truth, parameters: (
                (1.0 + parameters.altimeter_scale) * Lander.navigator.altitude(truth.position)
            ),
        ),
        Measurement(
            "velocimeter", "m/s", instants=np.arange(440.0, 760.0, 2.0),
            truth=lambda truth, parameters: (
                (1.0 + parameters.velocimeter_scale)[:, None] * Lander.navigator.to_body(truth.attitude, truth.velocity)
            ),
        ),
    )  # fmt: skip

    def start(self):
        """Return the nominal state: 480 km before the site, 15 km high, at the speed of a low orbit."""
        angle, radius = 480e3 / 1737.4e3, 1737.4e3 + 15e3
        position = np.array([0.0, -radius * np.sin(angle), 1737.4e3 - radius * np.cos(angle)])
        velocity = 1690.0 * np.array([0.0, np.cos(angle), -np.sin(angle)])
        push = self.wanted("braking", np.zeros(1), position[None], velocity[None])[0]
        up, along = push / np.linalg.norm(push), np.array([1.0, 0.0, 0.0])
        right = np.cross(-up, along) / np.linalg.norm(np.cross(-up, along))
        return {
            "position": position, "velocity": velocity, "mass": LOADED,
            "attitude": np.stack([np.cross(right, -up), right, -up], axis=1),
        }  # fmt: skip

    def wanted(self, phase, time, position, velocity):
        """Return the thrust per mass that guidance wants, along north, east and down, shape (n, 3)."""
        time = time[:, None]
        if phase == "braking":
            wanted = aimed(GATE - time, GATE_AT - position, velocity, GATE_BY)
        elif phase == "approach":
            wanted = aimed_at_rest(OVER - time, OVER_AT - position, velocity, OVER_BY)
        else:
            added = self.navigator.altitude(position)[:, None] / FLARE if phase == "descent" else 0.0
            wanted = -SLOWING * (velocity + (SLOWEST + added) * UP)
        return wanted - self.navigator.fall(position, velocity)

    def guide(self, phase, time, estimate):
        """Return thrust per mass, and the rates that turn the thrust to where it is wanted, and the body to north."""
        wanted = self.wanted(phase, time, estimate.position, estimate.velocity)
        size = np.linalg.norm(wanted, axis=1)
        direction = self.navigator.to_body(estimate.attitude, wanted) / size[:, None]
        turn = np.cross(UP, direction) + estimate.attitude[:, :1, 1] * np.array([0.0, 0.0, 1.0])
        return np.column_stack([np.clip(size, LEAST, MOST), TURNING * turn])

    def motion(self, truth, command, parameters, noise):
        """Return specific force and angular rate in body axes."""
        thrust = (1.0 + parameters.throttle) * command[:, 0]
        return {"force": thrust[:, None] * UP, "rate": command[:, 1:] + noise.jitter}

    def rates(self, truth, command, parameters):
        """Return the derivative of the mass."""
        return {"mass": -truth.mass * (1.0 + parameters.throttle) * command[:, 0] / EXHAUST}

    def outputs(self, truth):
        """Return the propellant, and the rate of descent; neither is an error."""
        return {
            "propellant": (LOADED - truth.mass, "kg", "control"),
            "sink_rate": (truth.velocity[:, 2], "m/s", "control"),
        }
