"""gnss-ins-sim: readings with errors along a flight of its own, without a filter, which it has none of.

Its flights are commands to a vehicle, so that the flight is like that of the case, not the same: a climb and a turn of
90 degrees in the same time at the same rates. What it takes is compared, its errors are not.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from gnss_ins_sim.sim import imu_model, ins_sim

from mcnav.arrays.types import Array
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.peer import Peer, Simulate

DEG_PER_HOUR = np.radians(1.0) / 3600.0

MOTION = """\
ini lat (deg),ini lon (deg),ini alt (m),ini vx_body (m/s),ini vy_body (m/s),ini vz_body (m/s),ini yaw (deg),\
ini pitch (deg),ini roll (deg)
45,10,2500,200,0,0,30,2,0
command type,yaw (deg),pitch (deg),roll (deg),vx_body (m/s),vy_body (m/s),vz_body (m/s),command duration (s),\
GPS visibility
1,0,0,0,0,0,0,{first},1
1,1.5,0,0,0,0,0,{turn},1
1,0,0,0,0,0,0,{last},1
"""


def prepare(case: Case, setting: float, cores: int) -> Simulate:
    """All that is done once: nothing."""
    seconds = case.seconds
    motion = MOTION.format(first=0.5 * seconds, turn=0.1 * seconds, last=0.4 * seconds)
    gyro, accelerometer = case.noise[0] / (np.radians(1.0) / 60.0), case.noise[3] * 60.0
    errors = {
        "gyro_b": case.biases[:3] / DEG_PER_HOUR, "gyro_arw": np.full(3, gyro), "gyro_b_stability": np.zeros(3),
        "gyro_b_corr": np.full(3, np.inf), "accel_b": case.biases[3:], "accel_vrw": np.full(3, accelerometer),
        "accel_b_stability": np.zeros(3), "accel_b_corr": np.full(3, np.inf),
    }  # fmt: skip

    def simulate(samples: Samples, seed: int) -> Array:
        np.random.seed(seed)  # noqa: NPY002 - it draws from the global generator
        with TemporaryDirectory() as folder:
            path = Path(folder) / "motion.csv"
            path.write_text(motion, encoding="ascii")
            gps = {"stdp": case.measurement[:3], "stdv": case.measurement[3:]}
            imu = imu_model.IMU(accuracy=errors, axis=6, gps=True, gps_opt=gps)
            simulation = ins_sim.Sim([1.0 / READING, 1.0, 0.0], str(path), ref_frame=0, imu=imu, mode=None)
            simulation.run(len(samples))
        return np.zeros((len(samples), 0, 9))

    return simulate


PEER = Peer(prepare, "none", (0.0,), 4, "processes", errors=True)
