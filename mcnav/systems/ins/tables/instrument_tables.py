"""``[imu.gyro]`` and ``[imu.accelerometer]``: sizes of constant errors and of processes, by axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Generic, TypeVar

from pydantic import Field

from mcnav.arrays.types import Array
from mcnav.entries.axes import AxisSizes, OrSizes, fault_of_size, within
from mcnav.entries.quantities import Table
from mcnav.entries.rules import ExactlyOne, Rule, SomeButOne
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, NEGLECTED

SHORTEST_CORRELATION: Final = 0.1
"""Shortest correlation time, s: below it a process is white noise, and is to be given as such."""

INTERVALS: Final = (1e-3, 1.0)
"""Shortest and longest interval between readings, s."""


def _fault_of_correlation(time: float) -> str:
    short = f"expected at least {SHORTEST_CORRELATION:g} s, white noise is shorter"
    return fault_of_size(time) or (short if time < SHORTEST_CORRELATION else "")


AngularRates = Annotated[Array, AxisSizes("rad/s", AXES)]
Angles = Annotated[Array, AxisSizes("rad", AXES)]
Accelerations = Annotated[Array, AxisSizes("m/s^2", AXES)]
Velocities = Annotated[Array, AxisSizes("m/s", AXES)]
RateWalks = Annotated[Array, AxisSizes("rad/s/sqrt(s)", AXES)]
AccelerationWalks = Annotated[Array, AxisSizes("m/s^2/sqrt(s)", AXES)]
Shares = Annotated[Array, AxisSizes("1", AXES)]
CrossShares = Annotated[Array, AxisSizes("rad", CROSS_AXES, shares=True)]
CorrelationTimes = Annotated[Array, AxisSizes("s", AXES, _fault_of_correlation, complete=True)]
BelievedTimes = Annotated[Array, AxisSizes("s", AXES, _fault_of_correlation)]
Intervals = Annotated[Array, AxisSizes("s", AXES, within(*INTERVALS, "s", "an interval is positive"))]

Sizes = TypeVar("Sizes")
"""Sizes by axis in the unit of an instrument."""


class InstabilityTable(Table, Generic[Sizes]):
    """First-order Gauss-Markov process: ``bias_instability = { sigma = "0.003 deg/h", correlation_time = "1 h" }``."""

    rules: ClassVar[tuple[Rule, ...]] = (ExactlyOne(("sigma", "allan_minimum"), ("correlation_time",)),)
    expected: ClassVar[str] = (
        'expected { sigma = "0.003 deg/h", correlation_time = "1 h" }, or allan_minimum in place of sigma'
    )
    sigma: Annotated[Sizes | None, Field(description="Sigma of the process.")] = None
    allan_minimum: Annotated[
        Sizes | None, Field(description="Bias instability of a data sheet: 0.617 times sigma, which it replaces.")
    ] = None
    correlation_time: Annotated[
        CorrelationTimes | None, Field(description="Correlation time of the process.", examples=["1 h"])
    ] = None


class BelievedInstabilityTable(InstabilityTable[Sizes], Generic[Sizes]):
    """A process that a filter takes another one for: what it does not have is that of the instrument."""

    rules: ClassVar[tuple[Rule, ...]] = (SomeButOne(("sigma", "allan_minimum")),)
    correlation_time: Annotated[
        BelievedTimes | None, Field(description="Correlation time of the process.", examples=["1 h"])
    ] = None


class WalkTable(Table, Generic[Sizes]):
    """Random walk that returns to zero: ``rate_random_walk = { density = "…", correlation_time = "1000 s" }``.

    With the density K of its white noise and the correlation time tau it is the stationary first-order Gauss-Markov
    process whose sigma is K sqrt(tau / 2), as simulators state it; for times far below tau its sigma is K sqrt(t).
    """

    rules: ClassVar[tuple[Rule, ...]] = (ExactlyOne(("density",)),)
    expected: ClassVar[str] = 'expected { density = "0.01 deg/h/sqrt(h)", correlation_time = "1000 s" }'
    density: Annotated[Sizes | None, Field(description="Density K of the white noise that drives the bias.")] = None
    correlation_time: Annotated[
        CorrelationTimes | None,
        Field(description="Correlation time tau, for a bias with the sigma K sqrt(tau / 2).", examples=["1000 s"]),
    ] = None


class QuantizationTable(Table, Generic[Sizes]):
    """``quantization = { sigma = "1e-6 rad", interval = "0.01 s" }``."""

    rules: ClassVar[tuple[Rule, ...]] = (ExactlyOne(("sigma", "step")),)
    expected: ClassVar[str] = 'expected { sigma = "1e-6 rad", interval = "0.01 s" }, or step in place of sigma'
    sigma: Annotated[Sizes | None, Field(description="Sigma of the error of a reading.")] = None
    step: Annotated[
        Sizes | None, Field(description="Smallest increment, in place of sigma: sqrt(12) times it.")
    ] = None  # fmt: skip
    interval: Annotated[Intervals | None, Field(description="Interval between readings.", examples=["0.01 s"])] = None


ScaleFactors = Annotated[Shares | None, Field(description="Sigma of the scale factor.")]
Misalignments = Annotated[
    CrossShares | None, Field(description="Sigma of the share of an input along another axis.")
]  # fmt: skip


RATE_RANDOM_WALK: Final = Field(
    description="Random walk of the bias, K: its sigma is K sqrt(t). Or { density = K, correlation_time = tau }, "
    "as some simulators state it: a stationary process of sigma K sqrt(tau / 2), which replaces bias_instability."
)


class GyroErrors(Table):
    """Errors of the gyros but for their bias instability and quantization."""

    bias: Annotated[AngularRates | None, Field(description="Sigma of the constant bias.")] = None
    scale_factor: ScaleFactors = None
    misalignment: Misalignments = None
    angle_random_walk: Annotated[
        Annotated[Array, AxisSizes("rad/sqrt(s)", AXES)] | None,
        Field(description="White noise of the rates, N, a density per sqrt(Hz): the angle has the sigma N sqrt(t)."),
    ] = None
    rate_random_walk: Annotated[
        Annotated[WalkTable[RateWalks], OrSizes(AxisSizes("rad/s/sqrt(s)", AXES))] | None, RATE_RANDOM_WALK
    ] = None
    g_sensitivity: Annotated[
        Annotated[Array, AxisSizes("rad/s/(m/s^2)", AXES)] | None,
        Field(description="Sigma of the rate per specific force along the axis."),
    ] = None


class AccelerometerErrors(Table):
    """Errors of the accelerometers but for their bias instability and quantization."""

    bias: Annotated[Accelerations | None, Field(description="Sigma of the constant bias.")] = None
    scale_factor: ScaleFactors = None
    misalignment: Misalignments = None
    velocity_random_walk: Annotated[
        Annotated[Array, AxisSizes("m/s/sqrt(s)", AXES)] | None,
        Field(description="White noise of the force, N, a density per sqrt(Hz): the velocity has the sigma N sqrt(t)."),
    ] = None
    rate_random_walk: Annotated[
        Annotated[WalkTable[AccelerationWalks], OrSizes(AxisSizes("m/s^2/sqrt(s)", AXES))] | None, RATE_RANDOM_WALK
    ] = None
    nonlinearity: Annotated[
        Annotated[Array, AxisSizes("(m/s^2)/(m/s^2)^2", AXES)] | None,
        Field(description="Sigma of the error per square of the specific force along the axis."),
    ] = None


CountedAngles = Annotated[QuantizationTable[Angles], OrSizes(AxisSizes("rad", AXES))]
CountedVelocities = Annotated[QuantizationTable[Velocities], OrSizes(AxisSizes("m/s", AXES))]

INSTABILITY: Final = Field(
    description="{ sigma = …, correlation_time = … }: a first-order Gauss-Markov process, stationary from the start; "
    "allan_minimum, a data sheet's bias instability, may replace sigma = allan_minimum / 0.617."
)
QUANTIZATION: Final = Field(
    description="White error Q of the accumulated angle or velocity (IEEE 952): its Allan deviation is sqrt(3) Q / tau."
    " Or { step = …, interval = … }."
)


class GyroTable(GyroErrors):
    """``[imu.gyro]``."""

    bias_instability: Annotated[InstabilityTable[AngularRates] | None, INSTABILITY] = None
    quantization: Annotated[CountedAngles | None, QUANTIZATION] = None


class AccelerometerTable(AccelerometerErrors):
    """``[imu.accelerometer]``."""

    bias_instability: Annotated[InstabilityTable[Accelerations] | None, INSTABILITY] = None
    quantization: Annotated[CountedVelocities | None, QUANTIZATION] = None


class BelievedGyroTable(GyroErrors):
    """``[filter.believes.imu.gyro]``."""

    refused: ClassVar[Mapping[str, str]] = NEGLECTED
    bias_instability: Annotated[BelievedInstabilityTable[AngularRates] | None, INSTABILITY] = None


class BelievedAccelerometerTable(AccelerometerErrors):
    """``[filter.believes.imu.accelerometer]``."""

    refused: ClassVar[Mapping[str, str]] = NEGLECTED
    bias_instability: Annotated[BelievedInstabilityTable[Accelerations] | None, INSTABILITY] = None


INSTRUMENTS: Final[Mapping[str, type[Table]]] = {"gyro": GyroTable, "accelerometer": AccelerometerTable}
"""Tables of the instruments by their keys in ``[imu]``."""
