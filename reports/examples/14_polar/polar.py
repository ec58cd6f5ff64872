"""From polar to cartesian coordinates: the textbook case of a function that linear analysis gets wrong.

A target's range r and bearing a are measured, x = r cos a and y = r sin a are wanted. With independent normal errors
dr and da about r0 and a0 the moments have a closed form (Julier and Uhlmann, 1997):

    E (x + i y) = r0 e^(i a0) e^(-s^2 / 2)
    E (x + i y)^2 = (r0^2 + s_r^2) e^(2 i a0) e^(-2 s^2),    E (x^2 + y^2) = r0^2 + s_r^2.
"""

import numpy as np

from mcnav import Output, Source


class Target:
    """Errors of the two coordinates of a target at a measured range and bearing."""

    sources = (Source("range", "m", "m", 20.0), Source("bearing", "rad", "deg", 0.1))
    outputs = (Output("x", "m", "m"), Output("y", "m", "m"))
    settings = {"distance": "m", "bearing": "rad"}

    def __init__(self, distance=1000.0, bearing=np.pi / 2.0):
        self.distance, self.bearing = distance, bearing

    def propagate(self, errors):
        """Errors of x and y from those of range and bearing: shape (n, 2) to (n, 2)."""
        r, a = self.distance + errors[:, 0], self.bearing + errors[:, 1]
        at = [self.distance * np.cos(self.bearing), self.distance * np.sin(self.bearing)]
        return np.column_stack([r * np.cos(a), r * np.sin(a)]) - at
