"""The boost phase of a ballistic missile with a stable platform, and where the missile comes down.

A missile is boosted for three minutes in a plane, at a constant acceleration that its thrust gives, along a direction
that turns linearly with time; then it falls freely. Guidance cuts off at the planned indicated speed and holds the
planned attitude relative to the platform, so that a misalignment turns the thrust itself. The outputs are the
deviations of the actual cutoff, and of the point of impact by Kepler's laws, from the planned ones.

"Ballistic missiles may also be guided by inertial systems during the boost phase. Since this boost phase lasts only for
about three minutes, the 84 minute pendulum effect is of less importance" (The Story of 84 Minutes, 1966).
"""

import numpy as np
from scipy.integrate import solve_ivp

from mcnav import History, Output, Panel, Source

MU, EARTH = 3.986004e14, 6_371_000.0
STEPS = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-6}


class Boost:
    """One missile at a time."""

    sources = (
        Source("misalignment", "rad", "arcsec", 5e-5),
        Source("gyro_drift", "rad/s", "deg/h", 5e-8),
        Source("bias", "m/s^2", "ug", 1e-3),
        Source("scale_factor", "1", "ppm", 1e-4),
        Source("thrust", "1", "%", 5e-4),
    )
    outputs = (
        Output("altitude", "m", "m"),
        Output("downrange", "m", "m"),
        Output("climb_rate", "m/s", "m/s"),
        Output("speed_downrange", "m/s", "m/s"),
        Output("impact", "m", "km"),
    )
    settings = {"burn_time": "s", "acceleration": "m/s^2"}

    def __init__(self, burn_time=180.0, acceleration=40.0):
        self.burn_time, self.acceleration = burn_time, acceleration
        self.planned = self._flown(np.zeros(5))

    def _attitude(self, time):
        """Planned thrust direction over the horizontal at launch, rad."""
        return np.radians(90.0 - 55.0 * np.minimum(time / self.burn_time, 1.0))

    def _flight(self, errors, **options):
        misalignment, drift, bias, scale, thrust = errors
        push = self.acceleration * (1.0 + thrust)

        def rates(time, state):
            x, y, vx, vy, _ = state
            angle = self._attitude(time) + misalignment + drift * time
            fall = MU / np.hypot(x, y) ** 3
            felt = push * (1.0 + scale) + bias
            return [vx, vy, push * np.cos(angle) - fall * x, push * np.sin(angle) - fall * y, felt]

        def cutoff(time, state):
            return state[4] - self.acceleration * self.burn_time

        cutoff.terminal = True
        return solve_ivp(
            rates, (0.0, 2.0 * self.burn_time), [0.0, EARTH, 0.0, 0.0, 0.0], events=cutoff, **STEPS, **options
        )

    def _flown(self, errors):
        """Altitude, downrange, their rates at cutoff, and the distance of impact."""
        flight = self._flight(errors)
        if flight.status != 1:
            raise ValueError("the missile never reaches its cutoff speed")
        x, y, vx, vy, _ = flight.y[:, -1]
        r, angle = np.hypot(x, y), np.arctan2(x, y)
        up, along = (vx * x + vy * y) / r, (vx * y - vy * x) / r
        momentum, energy = r * along, 0.5 * (up**2 + along**2) - MU / r
        if energy >= 0.0:
            raise ValueError("the missile leaves the earth")
        parameter = momentum**2 / MU
        eccentricity = np.sqrt(1.0 + 2.0 * energy * momentum**2 / MU**2)
        at_cutoff = np.arccos(np.clip((parameter / r - 1.0) / eccentricity, -1.0, 1.0)) * np.sign(up)
        at_impact = 2.0 * np.pi - np.arccos(np.clip((parameter / EARTH - 1.0) / eccentricity, -1.0, 1.0))
        return np.array([r - EARTH, EARTH * angle, up, along, EARTH * (angle + at_impact - at_cutoff)])

    def fly(self, errors):
        """Errors of one missile, shape (5,), to its deviations from the plan, shape (5,)."""
        return self._flown(errors) - self.planned

    def history(self):
        """The planned boost."""
        flight = self._flight(np.zeros(5), dense_output=True)
        times = np.linspace(0.0, flight.t[-1], 181)
        x, y, vx, vy, _ = flight.sol(times)
        columns = {
            "time [s]": times,
            "downrange [km]": x / 1e3,
            "altitude [km]": (np.hypot(x, y) - EARTH) / 1e3,
            "speed [km/s]": np.hypot(vx, vy) / 1e3,
        }
        panels = (
            Panel("Boost", "downrange [km]", ("altitude [km]",)),
            Panel("Speed", "time [s]", ("speed [km/s]",)),
        )
        return History(columns, {"cutoff": float(flight.t[-1])}, panels)
