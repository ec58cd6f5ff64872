"""Linear side of the samples of the aided reference engine: their noise as the closed loop takes it.

The twin of a sample has the closed loop's gains along the truth and the sample's own noise: what the instruments' noise
adds to psi, v, x over each step of the loop, and the errors of each measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.aided_mechanization import AidedMechanization
from mcnav.physics.ins.closed_loop import ClosedLoop
from mcnav.physics.ins.linear_noise import NoiseResponse
from mcnav.physics.ins.sample_noise import SampleNoise


@dataclass(frozen=True)
class TwinNoise:
    """Noise of samples on the grid of a closed loop, K steps and U updates of at most M components.

    Attributes
    ----------
    begins : ndarray of int, shape (K + 1,)
        Steps of the reference engine that begin at the loop's times.
    sensors, rows : ndarray of int, shape (U,)
        Sensor of each update, and the number of its measurement.
    most : int
        M.
    """

    engine: AidedMechanization
    response: NoiseResponse
    begins: IndexArray
    sensors: IndexArray
    rows: IndexArray
    most: int

    @classmethod
    def along(cls, engine: AidedMechanization, loop: ClosedLoop) -> TwinNoise:
        """Prepare it for a loop whose times are among those of the engine's steps."""
        times = engine.step_times
        response = NoiseResponse.along(engine.truth, engine.platform, times, loop.times[-1:])
        begins = np.searchsorted(times, loop.times - 1e-9)
        if not np.allclose(times[begins], loop.times, rtol=0.0, atol=1e-6):
            raise ValueError("each time of the loop must be the boundary of a step of the reference engine")
        sensors = loop.measurements.sensors
        rows = np.zeros(len(sensors), dtype=np.int64)
        for number in range(len(engine.sensors)):
            own = np.flatnonzero(sensors == number)
            rows[own] = np.arange(len(own))
        return cls(engine, response, begins, sensors, rows, loop.measurements.components.shape[1])

    def arrange(self, noise: SampleNoise, width: int) -> tuple[Array, Array]:
        """Arrange the noise of one sample.

        Parameters
        ----------
        width : int
            Numbers that a step adds: those to psi, v, x, and to biases of processes, which are zero here.

        Returns
        -------
        tuple of ndarray, shape (K, width), (U, M)
            Biases act through psi, v, x.
        """
        added = np.zeros((len(self.begins) - 1, width))
        added[:, :9] = self.response.respond_from_rest(self.begins, noise.gyro, noise.accelerometer)
        measured = np.zeros((len(self.sensors), self.most))
        for number, sensor in enumerate(self.engine.sensors):
            updates = np.flatnonzero(self.sensors == number)
            if sensor.name in noise.measurements:
                given = noise.measurements[sensor.name]
                measured[updates, : given.shape[1]] = given[self.rows[updates]]
        return added, measured
