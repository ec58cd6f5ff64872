"""The class of `28_cruise_missile.toml`: the missile of "The Story of 84 Minutes", steered by its navigator."""

import numpy as np

from mcnav import ClosedLoop, Trigger, White

RADIUS = 3960 * 1609.344  # m, of a spherical earth that does not turn
GRAVITY = 32.2 * 0.3048  # m/s^2
SPEED = 2640 * 0.3048  # m/s, half a statute mile a second
DISTANCE = 5060 * 1609.344  # m

LAG = 25.0  # s, from a command to the force
STIFFNESS, DAMPING = 0.01, 0.7  # rad/s and 1, of the steering across the track
HOLD = 0.01  # 1/s, of the speed along it


def axes_at(along, across):
    """Return the directions along, to the right and down at two position angles, in those at the start: (n, 3, 3)."""
    c, s, of_c, of_s, none = np.cos(along), np.sin(along), np.cos(across), np.sin(across), np.zeros_like(along)
    rows = [[c, none, s], [-of_s * s, of_c, of_s * c], [-of_c * s, -of_s, of_c * c]]
    return np.array(rows).transpose(2, 0, 1)


def accelerations(state, force):
    """Return the second derivatives of range and cross range, m/s^2, under the force (n, 2) along and to the right.

    The altitude is held: R theta'' cos phi = f_x + 2 R theta' phi' sin phi, R phi'' = f_y - R theta'^2 sin phi cos phi,
    with range R theta, cross range R phi.
    """
    across, rate, rate_across = state.cross_range / RADIUS, state.range_rate / RADIUS, state.cross_range_rate / RADIUS
    along = force[:, 0] / np.cos(across) + 2.0 * RADIUS * rate * rate_across * np.tan(across)
    return along, force[:, 1] - RADIUS * rate**2 * np.sin(across) * np.cos(across)


class CruiseMissile(ClosedLoop):
    """It keeps its speed and a great circle by what it navigates, and dives where it indicates the target.

    The accelerometers are kept level at the indicated position, so that the navigator is Schuler's pendulum. The
    platform's misalignment, a rotation vector in the directions along, to the right and down at the start, changes by
    the drift of its gyros alone. The altitude is an altimeter's.
    """

    truth = {
        "range": "m", "cross_range": "m", "range_rate": "m/s", "cross_range_rate": "m/s",
        "steering": ("m/s^2", ("along", "across")), "platform": ("rad", ("roll", "pitch", "azimuth")),
    }  # fmt: skip
    estimate = {"range": "m", "cross_range": "m", "range_rate": "m/s", "cross_range_rate": "m/s"}
    parameters = {"drift": ("rad/s", ("roll", "pitch")), "bias": ("m/s^2", "xy")}
    processes = {"gusts": White("m/s^2/sqrt(Hz)", ("along", "across"))}
    command = ("m/s^2", ("along", "across"))
    cycle, end = 12.0, Trigger(lambda estimate: estimate.range - DISTANCE, latest=1.05 * DISTANCE / SPEED)

    def start(self):
        """Return the nominal state: level, along the great circle to the target."""
        return {"range_rate": SPEED}

    def rates(self, truth, command, parameters, noise):
        """Return the derivative of the truth; the air's force follows the command with a lag."""
        along, across = accelerations(truth, truth.steering + noise.gusts)
        local = axes_at(truth.range / RADIUS, truth.cross_range / RADIUS)
        return {
            "range": truth.range_rate, "cross_range": truth.cross_range_rate, "range_rate": along,
            "cross_range_rate": across, "steering": (command - truth.steering) / LAG,
            "platform": np.einsum("nij,ni->nj", local[:, :2], parameters.drift),
        }  # fmt: skip

    def sense(self, truth, parameters, noise):
        """Return the specific force as the platform has it, in the directions at the start, shape (n, 3)."""
        across = truth.cross_range / RADIUS
        lift = GRAVITY - ((truth.range_rate * np.cos(across)) ** 2 + truth.cross_range_rate**2) / RADIUS
        force = np.column_stack([truth.steering + noise.gusts + parameters.bias, -lift])
        force = np.einsum("nij,ni->nj", axes_at(truth.range / RADIUS, across), force)
        return force + np.cross(force, truth.platform)  # turned by a small angle

    def navigate(self, estimate, sensed):
        """Return the derivative of the estimate: the force along the indicated directions moves it over the sphere."""
        level = axes_at(estimate.range / RADIUS, estimate.cross_range / RADIUS)[:, :2]
        along, across = accelerations(estimate, np.einsum("nij,nj->ni", level, sensed))
        return {
            "range": estimate.range_rate, "cross_range": estimate.cross_range_rate, "range_rate": along,
            "cross_range_rate": across,
        }  # fmt: skip

    def guide(self, estimate):
        """Return the force along, which holds the speed, and across, which returns to the great circle."""
        along = -HOLD * (estimate.range_rate - SPEED)
        across = -(STIFFNESS**2) * estimate.cross_range - 2.0 * DAMPING * STIFFNESS * estimate.cross_range_rate
        return np.column_stack([along, across])
