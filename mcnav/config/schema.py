"""The tables of a campaign file as pydantic models: structure, units and ranges.

The tables of ``[scenario]`` are in `mcnav.systems.registry`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema

from mcnav.entries.quantities import UNIT, Duration, Number, Probability, Table, Text, Written
from mcnav.sampling.designs import DESIGNS

Span = Annotated[
    Any,
    WithJsonSchema(
        {"anyOf": [{"enum": ["outages"]}, {"type": "array", "items": {UNIT: "s"}, "minItems": 2, "maxItems": 2}]}
    ),
]
"""A begin and an end, or the outages of all sensors; read later."""

Point = Annotated[Any, WithJsonSchema({"type": "array", "items": {UNIT: ""}, "minItems": 2, "maxItems": 2})]
"""A start time and a sigma; read later."""
After = Annotated[Duration | None, Field(description="Time from which on the requirement holds, to the end.")]
During = Annotated[Span, Field(description='Begin and end between which it holds, or "outages" of all sensors.')]
At = Annotated[Duration | None, Field(description="Time of the one epoch at which the requirement holds.")]


class CorrelationTable(Table):
    """An entry of ``[[correlations]]``."""

    between: Annotated[list[str], Field(min_length=2, max_length=2, description="Names of two error sources.")]
    coefficient: Annotated[Number, Field(ge=-1.0, le=1.0, description="Pearson's coefficient.")] | None = None
    rank_coefficient: Annotated[Number, Field(ge=-1.0, le=1.0, description="Spearman's coefficient.")] | None = None


class JointTable(Table):
    """An entry of ``[[joint]]``: sources that share their tails."""

    sources: Annotated[list[str], Field(min_length=2, description="Names of sources whose large errors coincide.")]
    distribution: Annotated[Literal["student-t"], Field(description="Multivariate distribution of the sources.")]
    degrees_of_freedom: Annotated[Number, Field(description="Of the distribution; fewer make longer tails.")]


class StartTimesTable(Table):
    """``[start_times]``; `mcnav.config.start_times` reads weights and errors with their units."""

    count: Annotated[int, Field(ge=2, le=100_000, description="Number of start times over the trajectory.")] = 241
    axes: Annotated[
        Literal["start", "trajectory"],
        Field(description="Where the reference axes are aligned: at each start, or at the trajectory's own."),
    ] = "start"
    check: Annotated[
        list[Duration], Field(max_length=100, description="Start times at which Monte Carlo checks the dispersion.")
    ] = []
    samples: Annotated[int, Field(ge=100, le=1_000_000, description="Samples of each check.")] = 4_000
    weights: Annotated[
        dict[str, Written],
        Field(description="Sigma of each output that counts as one unit of harm; omitted outputs do not count."),
    ] = {}
    errors: Annotated[
        dict[str, Annotated[list[Point], Field(min_length=1)]],
        Field(description="Sigmas that change with the start time: pairs of start time and sigma, by source."),
    ] = {}


class QuantileTable(Table):
    """``[[accept.quantile]]``: a quantile of an output's absolute value lies below a limit."""

    output: Annotated[str, Field(description="Name of the output.")]
    probability: Annotated[Probability, Field(description="Probability with which its magnitude is below the limit.")]
    below: Annotated[Written, Field(description="Limit, in a unit of the output.")]
    after: After = None
    during: During = None
    at: At = None


class CircularTable(Table):
    """``[[accept.cep]]`` and ``[[accept.r95]]``: 50 or 95 % of all errors in two outputs lie within a circle."""

    outputs: Annotated[list[str], Field(min_length=2, max_length=2, description="Names of outputs of one unit.")]
    below: Annotated[Written, Field(description="Largest radius, in a unit of the outputs.")]
    after: After = None
    during: During = None
    at: At = None


class SphericalTable(CircularTable):
    """``[[accept.sep]]``: half of all errors in three outputs lie within a sphere."""

    outputs: Annotated[list[str], Field(min_length=3, max_length=3, description="Names of outputs of one unit.")]


class BoxTable(Table):
    """``[[accept.box]]``: the absolute values of some outputs lie within limits jointly, with a probability."""

    within: Annotated[dict[str, Written], Field(description="Limit of each output, in its unit.")]
    probability: Annotated[Probability, Field(description="Probability with which all lie within their limits.")]


class AcceptTable(Table):
    """``[accept]``."""

    sigma_ratio: Annotated[
        Number, Field(gt=0.0, lt=1.0, description="Largest departure of any output's paired sigma ratio from one.")
    ] | None = None  # fmt: skip
    quantile: Annotated[
        list[QuantileTable], Field(max_length=100, description="Limits of an output's magnitude, with a probability.")
    ] = []
    cep: Annotated[
        list[CircularTable], Field(max_length=100, description="Circles that hold half of all errors in two outputs.")
    ] = []
    r95: Annotated[
        list[CircularTable], Field(max_length=100, description="Circles that hold 95 % of all errors in two outputs.")
    ] = []
    sep: Annotated[
        list[SphericalTable],
        Field(max_length=100, description="Spheres that hold half of all errors in three outputs."),
    ] = []
    box: Annotated[
        list[BoxTable], Field(max_length=100, description="Limits within which several outputs lie together.")
    ] = []


class UntilTable(Table):
    """``samples = { until = "sigma_ratio 1 %", confidence = 0.95, at_most = 1_000_000 }``."""

    until: Annotated[
        str,
        Field(
            description='"sigma_ratio" or "sigma_ratio_paired", and the precision at which the run stops.',
            examples=["sigma_ratio 1 %"],
        ),
    ]
    confidence: Annotated[
        Number, Field(ge=0.5, lt=1.0, description="Confidence of the intervals of all outputs together.")
    ] = 0.95
    at_most: Annotated[int, Field(ge=2, le=1_000_000_000, description="Largest number of samples.")]


class CampaignTable(Table):
    """The whole file; `mcnav.config.read` reads ``[scenario]`` and ``[errors]`` by type and units.

    ``[[aiding]]`` and ``[filter]`` are read with the scenario.
    """

    name: Annotated[Text, Field(description="Title of the report; the file's name unless given.")] | None = None
    samples: Annotated[int, Field(ge=2, le=1_000_000_000_000, description="Number of samples.")] = 20_000
    seed: Annotated[int, Field(ge=0, lt=2**63, description="Seed of the random numbers.")] = 0
    design: Annotated[
        Literal[DESIGNS], Field(description="How samples are drawn.")  # type: ignore[valid-type]
    ] = "random"
    store: Annotated[
        Literal["samples", "summary"], Field(description="Keep every sample, or sums and the first 100,000 samples.")
    ] = "samples"
    tolerance: Annotated[
        Number,
        Field(
            gt=0.0,
            lt=1.0,
            description="Departure of a sigma ratio from one that counts as agreement.",
            examples=["5 %"],
        ),
    ] = 0.05
    confidence: Annotated[Number, Field(ge=0.5, lt=1.0, description="Confidence of all verdicts together.")] = 0.95
    sample_timeout: Annotated[
        Duration, Field(ge=0.001, le=1e6, description="Time after which a sample fails.", examples=["10 s"])
    ] | None = None  # fmt: skip
    scenario: Annotated[dict[str, Any], Field(description="What is simulated; its type decides about the other keys.")]
    imu: Annotated[
        dict[str, Any], Field(description="Inertial measurement unit of type ins: a grade, or a data sheet.")
    ] | None = None  # fmt: skip
    aiding: Annotated[Any, Field(description="Sensors that aid a navigation of type ins.")] = None
    filter: Annotated[
        Any, Field(description="Error-state Kalman filter of an aided navigation; beliefs of a closed loop's filter.")
    ] = None
    processes: Annotated[
        Any, Field(description="Sizes of a closed loop's processes of noise and of its corrections' errors.")
    ] = None
    measurements: Annotated[Any, Field(description="Sigmas of the noise of a closed loop's measurements.")] = None
    errors: Annotated[
        dict[str, Any],
        Field(description="One sigma of a normal error by source, or a table with its distribution; others are zero."),
    ] = {}
    correlations: Annotated[
        list[CorrelationTable], Field(max_length=1_000, description="Correlations of pairs of sources.")
    ] = []
    joint: Annotated[
        list[JointTable], Field(max_length=100, description="Groups of sources with a joint distribution.")
    ] = []
    start_times: Annotated[StartTimesTable, Field(description="Study of mcnav start-times.")] = StartTimesTable()
    accept: Annotated[AcceptTable, Field(description="Requirements, which mcnav run --check tests.")] | None = None
