"""The reference engine of the three-dimensional navigator against linear theory at rest, and laws of growth.

The linear equations at rest are written here from scratch, in local axes (Titterton and Weston 2004, section 12.3);
they and the engine share no equation.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.imu.fine_noise import draw_noise
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, Noise
from mcnav.systems.ins.reference.mechanization import Mechanization
from tests.flights import rest

DEG_PER_HOUR = np.radians(1.0) / 3600.0
MICRO_G = 9.80665e-6
NONE = np.zeros(len(CONSTANTS))
VERTICAL = [OUTPUTS.index("position_down"), OUTPUTS.index("velocity_down")]
HORIZONTAL = [number for number in range(len(OUTPUTS)) if number not in VERTICAL]

FALSE_ALARM = 1e-4
"""Probability that one correct sample variance lies outside its interval."""


def constants(**values: float) -> Array:
    """Return constant errors of which the named ones are not zero."""
    errors = NONE.copy()
    for name, value in values.items():
        errors[CONSTANTS.index(name)] = value
    return errors


def gravity_gradient(latitude: float) -> Array:
    """Differentiate gravity along north, east, down by a displacement north and down, shape (3, 2), 1/s^2.

    Over 1 km of altitude, where the second derivative is 2e-4 of the first, by central differences.
    """
    step = 500.0

    def gravity(altitude: float) -> Array:
        position = WGS84.from_geodetic(np.array([latitude]), np.zeros(1), np.array([altitude]))
        pull = WGS84.gravitation(position) + WGS84.rotation_rate**2 * position * [1.0, 1.0, 0.0]
        return np.asarray(local_axes(np.array([latitude]), np.zeros(1))[0].T @ pull[0])

    def on_the_ground(north: float) -> float:
        meridian, _ = WGS84.curvature_radii(np.asarray(latitude))
        there = latitude + north / meridian
        position = WGS84.from_geodetic(np.array([there]), np.zeros(1), np.zeros(1))
        pull = WGS84.gravitation(position) + WGS84.rotation_rate**2 * position * [1.0, 1.0, 0.0]
        return float(np.linalg.norm(pull))

    gradient = np.zeros((3, 2))
    gradient[2, 0] = (on_the_ground(step) - on_the_ground(-step)) / (2.0 * step)
    gradient[:, 1] = -(gravity(step) - gravity(-step)) / (2.0 * step)
    return gradient


def rest_dynamics(degrees: float) -> tuple[Array, Array]:
    """Write the linear error equations at rest on the ground, level and heading north.

    Returns
    -------
    tuple of ndarray, shape (9, 9), (9, 6)
        Of the nine errors in the order of `OUTPUTS`, and the inputs of gyros and accelerometers.
    """
    latitude = np.radians(degrees)
    sine, cosine, tangent = np.sin(latitude), np.cos(latitude), np.tan(latitude)
    meridian, prime = (float(each) for each in WGS84.curvature_radii(np.asarray(latitude)))
    gravity = somigliana(degrees)
    spin = WGS84.rotation_rate * np.array([cosine, 0.0, -sine])

    def cross(vector: Array) -> Array:
        return np.cross(vector, np.eye(3)).T

    dynamics = np.zeros((9, 9))
    position, velocity, attitude = slice(0, 3), slice(3, 6), slice(6, 9)
    dynamics[position, velocity] = np.eye(3)
    dynamics[velocity, [0, 2]] = 0.0
    gradient = gravity_gradient(latitude)
    dynamics[velocity, 0], dynamics[velocity, 2] = gradient[:, 0], gradient[:, 1]
    dynamics[velocity, velocity] = -2.0 * cross(spin)
    dynamics[velocity, attitude] = -cross(np.array([0.0, 0.0, -gravity]))
    transport = np.array([[0.0, 1.0 / prime, 0.0], [-1.0 / meridian, 0.0, 0.0], [0.0, -tangent / prime, 0.0]])
    turned = WGS84.rotation_rate * np.array([-sine, 0.0, -cosine]) / meridian
    dynamics[attitude, 0] = -turned
    dynamics[attitude, velocity] = -transport
    dynamics[attitude, attitude] = -cross(spin)
    inputs = np.zeros((9, 6))
    inputs[attitude, :3] = np.eye(3)
    inputs[velocity, 3:] = np.eye(3)
    return dynamics, inputs


def somigliana(degrees: float) -> float:
    """Compute gravity on the ellipsoid with the constants of WGS 84 as printed (NIMA TR8350.2, table 3.4)."""
    square = np.sin(np.radians(degrees)) ** 2
    return float(9.7803253359 * (1.0 + 1.931852652458e-3 * square) / np.sqrt(1.0 - 6.69437999014e-3 * square))


def responses(dynamics: Array, inputs: Array, time: float) -> tuple[Array, Array]:
    """Compute the responses to initial errors and to constant inputs."""
    count, more = inputs.shape
    whole = np.zeros((count + more, count + more))
    whole[:count, :count], whole[:count, count:] = dynamics, inputs
    found = expm(whole * time)
    return found[:count, :count], found[:count, count:]


SOURCES = {
    "accelerometer_bias_x": (100.0 * MICRO_G, [(168.4601, 3.4425), (790.8193, 3.2502)]),
    "gyro_bias_x": (0.01 * DEG_PER_HOUR, [(-0.3850, 16.6428), (-160.0467, 1344.2753)]),
    "gyro_bias_z": (0.01 * DEG_PER_HOUR, [(-0.1299, -0.0024), (-89.5966, -8.6427)]),
    "heading": (1e-3, [(-17.6982, -0.4095), (-1420.6646, -170.2144)]),
}
"""Position errors north and east, m, after 600 s and an hour at 45 degrees, of two horizontal channels alone."""

INPUT = {"gyro_bias_x": 0, "gyro_bias_z": 2, "accelerometer_bias_x": 3}


def linear_position(name: str, size: float, time: float, kept: list[int]) -> Array:
    dynamics, inputs = rest_dynamics(45.0)
    motion, forced = responses(dynamics[np.ix_(kept, kept)], inputs[kept], time)
    column = forced[:, INPUT[name]] if name in INPUT else motion[:, kept.index(OUTPUTS.index(name))]
    return np.asarray(size * column)


@pytest.mark.parametrize("name", SOURCES)
def test_horizontal_channels_are_the_table(name: str) -> None:
    """Without altitude and vertical velocity, to half a unit of the last printed digit."""
    size, rows = SOURCES[name]
    for time, expected in zip((600.0, 3600.0), rows, strict=True):
        assert linear_position(name, size, time, HORIZONTAL)[:2] == pytest.approx(expected, abs=0.5001e-4)


@pytest.mark.parametrize("name", SOURCES)
def test_engine_at_rest_is_linear_theory(name: str) -> None:
    """A hundredth of the table's errors, both signs: all nine errors, with the coupling to the vertical channel.

    What is left is of third order, an eighth of what three times the error changes. The gradient's differences err by
    (500 m / radius)^2, 6e-9, which the vertical channel turns into 4e-8 in an hour; rounding grows to 4e-7 m.
    """
    engine = Mechanization(rest(), "strapdown", 0.0, 3600.0, np.array([600.0, 3600.0]))
    size = SOURCES[name][0] / 100.0

    def odd(multiple: float) -> Array:
        errors = constants(**{name: multiple * size})
        return np.asarray((engine.simulate(errors) - engine.simulate(-errors)) / (2.0 * multiple))

    found, larger = odd(1.0), odd(3.0)
    for row, time in enumerate((600.0, 3600.0)):
        expected = linear_position(name, size, time, list(range(9)))
        scale = np.repeat([np.max(np.abs(expected[:3])), np.max(np.abs(expected[3:6])), 0.0], 3)
        rounding = np.repeat([4e-7, 1e-9, 1e-14], 3)
        allowed = np.abs(larger[row] - found[row]) / 8.0 * 1.1 + 4e-8 * scale + rounding
        assert np.all(np.abs(found[row] - expected) <= allowed)


def test_engine_after_600_s_is_the_table() -> None:
    """The vertical channel has changed the first errors by 1e-4 m, except for the north gyro's 3e-3 m east."""
    engine = Mechanization(rest(), "strapdown", 0.0, 600.0, np.array([600.0]))
    for name, (size, rows) in SOURCES.items():
        coupling = linear_position(name, size, 600.0, list(range(9)))[:2]
        coupling -= linear_position(name, size, 600.0, HORIZONTAL)[:2]
        errors = constants(**{name: size})
        found = (engine.simulate(errors) - engine.simulate(-errors))[0, :2] / 2.0
        assert np.max(np.abs(coupling)) <= 4e-3
        # half a unit of the last printed digit, and the third order: the square of a milliradian of 18 m
        assert found - coupling == pytest.approx(rows[0], abs=0.5e-4 + 2e-5)


@pytest.mark.parametrize(
    ("degrees", "minutes"),
    [
        (0.0, (84.28307, 84.56660)),
        (30.0, (81.99147, 86.96101)),
        (45.0, (81.01501, 88.04050)),
        (60.0, (80.27635, 88.88240)),
    ],
)
def test_modes_at_rest(degrees: float, minutes: tuple[float, float]) -> None:
    """Schuler's oscillation split by Foucault's rotation, the earth's rate, and the vertical channel.

    The engine's response to each of nine errors over 600 s is the exponential of the equations, so that eigenvalues are
    compared: rounding is 1e-9 of a response, and the gradient's differences err by 6e-9. The printed modes are those of
    the two horizontal channels alone.
    """
    duration = 600.0
    dynamics, _ = rest_dynamics(degrees)
    horizontal = np.sort(np.abs(np.linalg.eigvals(dynamics[np.ix_(HORIZONTAL, HORIZONTAL)]).imag))[::-2]
    assert 2.0 * np.pi / horizontal[:2] / 60.0 == pytest.approx(minutes, abs=0.5001e-5)
    assert 2.0 * np.pi / horizontal[2] / 3600.0 == pytest.approx(23.934472, abs=0.5001e-6)

    engine = Mechanization(rest(degrees, duration), "strapdown", 0.0, duration, np.array([duration]))
    sizes = np.repeat([10.0, 0.01, 1e-5], 3)
    columns = []
    for number, size in enumerate(sizes):
        errors = NONE.copy()
        errors[number] = size
        columns.append((engine.simulate(errors) - engine.simulate(-errors))[0] / (2.0 * size))
    scaled = np.stack(columns, axis=1) * sizes / sizes[:, None]
    found, expected = np.log(np.linalg.eigvals(scaled)) / duration, np.linalg.eigvals(dynamics)
    assert np.sort(found.imag)[:-4:-1] == pytest.approx(np.sort(expected.imag)[:-4:-1], rel=1e-8)
    assert np.max(found.real) == pytest.approx(np.max(expected.real), rel=1e-8)


def test_vertical_channel_doubles_faster_than_with_simplified_gravity() -> None:
    """The printed growth, 1.751532e-3 /s, is that of gravity falling by 2 g h / a; the ellipsoid's falls faster."""
    dynamics, _ = rest_dynamics(45.0)
    exact = np.max(np.linalg.eigvals(dynamics).real)
    dynamics[3:6, 2] = [0.0, 0.0, 2.0 * somigliana(45.0) / WGS84.radius]
    dynamics[3:6, 0] = 0.0
    simplified = np.max(np.linalg.eigvals(dynamics).real)
    assert simplified == pytest.approx(1.751532e-3, abs=0.5001e-9)
    assert np.log(2.0) / simplified == pytest.approx(395.74, abs=0.5001e-2)
    # Bruns: the gradient is g (1 / M + 1 / N) + 2 w^2, larger by 0.35 %, and its root by half of that
    assert exact / simplified == pytest.approx(1.0 + 0.0035 / 2, abs=5e-5)


ARW = np.radians(0.1) / 60.0
VRW = 0.03 / 60.0
STANDARD_GRAVITY = 9.80665


def process_covariance(process: str, size: float, correlation_time: float, gyro: bool, time: float) -> Array:
    """Compute the covariance of the nine errors at rest from one process on three axes, by Van Loan's exponential."""
    dynamics, inputs = rest_dynamics(45.0)
    entering = inputs[:, :3] if gyro else inputs[:, 3:]
    whole, noise, start = np.zeros((12, 12)), np.zeros((12, 12)), np.zeros((12, 12))
    whole[:9, :9], whole[:9, 9:] = dynamics, entering
    if process == "white":
        noise[:9, :9] = size**2 * entering @ entering.T
    elif process == "instability":
        whole[9:, 9:] = -np.eye(3) / correlation_time
        noise[9:, 9:] = 2.0 * size**2 / correlation_time * np.eye(3)
        start[9:, 9:] = size**2 * np.eye(3)
    else:
        noise[9:, 9:] = size**2 * np.eye(3)
    # scaled so that no entry of the exponential hides another's digits
    scale = np.repeat([1e3, 1.0, 1e-3, 1e-6], 3)
    whole, noise = whole * scale / scale[:, None], noise / np.outer(scale, scale)
    block = expm(np.block([[-whole, noise], [np.zeros((12, 12)), whole.T]]) * time)
    motion = block[12:, 12:].T
    found = motion @ block[:12, 12:] + motion @ (start / np.outer(scale, scale)) @ motion.T
    return np.asarray((found * np.outer(scale, scale))[:9, :9])


NOISES = {
    "angle random walk": ("white", ARW, True, Noise(random_walk=np.full(3, ARW))),
    "velocity random walk": ("white", VRW, False, Noise(random_walk=np.full(3, VRW))),
    "gyro rate random walk": ("walk", 1e-9, True, Noise(rate_random_walk=np.full(3, 1e-9))),
    "accelerometer rate random walk": ("walk", 1e-6, False, Noise(rate_random_walk=np.full(3, 1e-6))),
    "gyro instability": (
        "instability",
        DEG_PER_HOUR,
        True,
        Noise(instability=np.full(3, DEG_PER_HOUR), correlation_time=np.full(3, 300.0)),
    ),
}


@pytest.mark.parametrize("name", NOISES)
def test_noise_grows_as_linear_theory_says(name: str) -> None:
    """Sample variances of nine errors over 600 s at rest: each interval fails once in 10^4 correct engines.

    Errors are so small that those of second order, a tilt of 1e-3 squared, are far within the intervals of 13 %.
    """
    process, size, gyro, noise = NOISES[name]
    imu = Imu(gyro=noise) if gyro else Imu(accelerometer=noise)
    engine = Mechanization(rest(), "strapdown", 0.0, 600.0, np.array([600.0]), longest_step=0.5)
    count = 500
    errors = np.array(
        [engine.simulate(NONE, *draw_noise(imu, engine.step_times, 1963, index))[0] for index in range(count)]
    )
    expected = np.diag(process_covariance(process, size, float(noise.correlation_time[0]), gyro, 600.0))
    low, high = stats.chi2(count).ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2]) / count
    ratio = np.mean(errors**2, axis=0) / expected
    assert np.all((low <= ratio) & (ratio <= high)), ratio


@pytest.mark.parametrize(
    ("name", "output", "flat", "printed", "kernel"),
    [
        ("angle random walk", "position_east", STANDARD_GRAVITY * ARW * 600.0**2.5 / np.sqrt(20.0), 562.4837, 12.0),
        ("velocity random walk", "position_east", VRW * 600.0**1.5 / np.sqrt(3.0), 4.2426, 6.0),
        ("gyro rate random walk", "position_north", STANDARD_GRAVITY * 1e-9 * 600.0**3.5 / np.sqrt(252.0), None, 20.0),
        ("angle random walk", "tilt_north", ARW * np.sqrt(600.0), np.radians(0.040825), 1.0),
        ("velocity random walk", "velocity_north", VRW * np.sqrt(600.0), 0.012247, 2.0),
    ],
)
def test_flat_earth_laws(name: str, output: str, flat: float, printed: float | None, kernel: float) -> None:
    """On a flat earth sigmas grow by powers of time; the earth's curvature takes away less than (w t)^2 / n.

    The response to an impulse, a power of time, is multiplied by 1 - (w t)^2 / n + ... with w^2 = g / R and n from the
    series of the sine and the cosine; what the earth's rotation adds is of the square of its turn, 2e-3.
    """
    process, size, gyro, noise = NOISES[name]
    if printed is not None:
        assert flat == pytest.approx(printed, rel=5e-5)  # five digits
    found = process_covariance(process, size, float(noise.correlation_time[0]), gyro, 600.0)
    sigma = np.sqrt(np.diag(found))[OUTPUTS.index(output)]
    curvature = STANDARD_GRAVITY / 6.37e6 * 600.0**2
    assert 1.0 - curvature / kernel - 2e-3 <= sigma / flat <= 1.0 + 2e-3
