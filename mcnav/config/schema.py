"""The tables of a campaign file as pydantic models: structure, units and ranges.

The tables of ``[scenario]`` are in `mcnav.systems.registry`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, Field, create_model

from mcnav.config.toml import Content
from mcnav.entries.mistakes import told
from mcnav.entries.quantities import (
    Duration,
    Number,
    OutputName,
    Pair,
    Probability,
    SourceName,
    Table,
    Text,
    Written,
)
from mcnav.entries.rules import OneOfTwo, Rule
from mcnav.entries.unions import ByForm
from mcnav.sampler.designs import DESIGNS
from mcnav.systems.registry import FURTHER_NAMES

QUANTITIES: Final = ("sigma_ratio", "sigma_ratio_paired")
"""Quantities with a precision, named as in ``summary.json``: Monte Carlo over linear sigma, plain or paired."""

OUTAGES: Final = "outages"

Span = Annotated[
    Literal["outages"]
    | Annotated[list[Duration], Pair('expected a begin and an end such as ["1200 s", "1500 s"], or "outages"')],
    ByForm(),
]
"""A begin and an end, s, or the outages of all sensors."""

Point = Annotated[list[Written], Pair('expected a pair ["start time", "one sigma"]')]
"""A start time and a sigma; read later."""
After = Annotated[Duration | None, Field(description="Time from which on the requirement holds, to the end.")]
During = Annotated[Span | None, Field(description='Begin and end between which it holds, or "outages" of all sensors.')]
At = Annotated[Duration | None, Field(description="Time of the one epoch at which the requirement holds.")]


Of = Annotated[
    Literal["smoother"] | None,
    Field(description="Of the errors behind the smoother, in place of the filter's: in lincov."),
]


About = Annotated[
    Literal["nominal"] | None,
    Field(description="Limits departures from the nominal flight, in place of a state of the truth itself."),
]


class CorrelationTable(Table):
    """An entry of ``[[correlations]]``."""

    rules: ClassVar[tuple[Rule, ...]] = (
        OneOfTwo(
            "coefficient", "rank_coefficient", "expected coefficient (Pearson's) or rank_coefficient (Spearman's)"
        ),
    )
    between: Annotated[list[SourceName], Field(min_length=2, max_length=2, description="Names of two error sources.")]
    coefficient: Annotated[Number, Field(ge=-1.0, le=1.0, description="Pearson's coefficient.")] | None = None
    rank_coefficient: Annotated[Number, Field(ge=-1.0, le=1.0, description="Spearman's coefficient.")] | None = None


class JointTable(Table):
    """An entry of ``[[joint]]``: sources that share their tails."""

    sources: Annotated[
        list[SourceName], Field(min_length=2, description="Names of sources whose large errors coincide.")
    ]
    distribution: Annotated[Literal["student-t"], Field(description="Multivariate distribution of the sources.")]
    degrees_of_freedom: Annotated[Number, Field(gt=2.0, description="Of the distribution; fewer make longer tails.")]


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
        dict[OutputName, Written],
        Field(description="Sigma of each output that counts as one unit of harm; omitted outputs do not count."),
    ] = {}
    errors: Annotated[
        dict[SourceName, Annotated[list[Point], Field(min_length=1)]],
        Field(description="Sigmas that change with the start time: pairs of start time and sigma, by source."),
    ] = {}


class QuantileTable(Table):
    """``[[accept.quantile]]``: a quantile of an output's absolute value lies below a limit."""

    output: Annotated[OutputName, Field(description="Name of the output.")]
    probability: Annotated[Probability, Field(description="Probability with which its magnitude is below the limit.")]
    below: Annotated[Written, Field(description="Limit, in a unit of the output.")]
    after: After = None
    during: During = None
    at: At = None
    of: Of = None
    about: About = None


class CircularTable(Table):
    """``[[accept.cep]]`` and ``[[accept.r95]]``: 50 or 95 % of all errors in two outputs lie within a circle."""

    outputs: Annotated[list[OutputName], Field(min_length=2, max_length=2, description="Names of outputs of one unit.")]
    below: Annotated[Written, Field(description="Largest radius, in a unit of the outputs.")]
    after: After = None
    during: During = None
    at: At = None
    of: Of = None
    about: About = None


class SphericalTable(CircularTable):
    """``[[accept.sep]]``: half of all errors in three outputs lie within a sphere."""

    outputs: Annotated[list[OutputName], Field(min_length=3, max_length=3, description="Names of outputs of one unit.")]


class BoxTable(Table):
    """``[[accept.box]]``: the absolute values of some outputs lie within limits jointly, with a probability."""

    within: Annotated[dict[OutputName, Written], Field(description="Limit of each output, in its unit.")]
    probability: Annotated[Probability, Field(description="Probability with which all lie within their limits.")]
    about: About = None


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


def _with_quantity(until: str) -> str:
    """Refuse a precision without the quantity that it is of."""
    if until.strip().partition(" ")[0] in QUANTITIES:
        return until
    wanted = " or ".join(f'"{quantity} 1 %"' for quantity in QUANTITIES)
    raise told(f"got {until!r}; expected a quantity and its precision: {wanted}")


class UntilTable(Table):
    """``samples = { until = "sigma_ratio 1 %", confidence = 0.95, at_most = 1_000_000 }``."""

    called: ClassVar[str] = "a stopping rule"
    until: Annotated[
        str,
        AfterValidator(_with_quantity),
        Field(
            description='"sigma_ratio" or "sigma_ratio_paired", and the precision at which the run stops.',
            examples=["sigma_ratio 1 %"],
            json_schema_extra={"pattern": rf"^\s*({'|'.join(QUANTITIES)}) "},
        ),
    ]
    confidence: Annotated[
        Number, Field(ge=0.5, lt=1.0, description="Confidence of the intervals of all outputs together.")
    ] = 0.95
    at_most: Annotated[int, Field(ge=2, le=1_000_000_000, description="Largest number of samples.")]


class CampaignTable(Table):
    """The whole file but for tables that only some types of scenario read; see `CampaignFile`.

    `mcnav.config.read` reads ``[scenario]`` and ``[errors]`` by type and units.
    """

    name: Annotated[Text, Field(description="Title of the report; the file's name unless given.")] | None = None
    units: Annotated[
        Literal["SI"], Field(description='units = "SI" reads numbers without a unit as SI; else they are refused.')
    ] | None = None  # fmt: skip
    samples: Annotated[
        UntilTable | Annotated[int, Field(ge=2, le=1_000_000_000_000)],
        ByForm(),
        Field(description="Number of samples, at most 10^12, or a table with the precision at which the run stops."),
    ] = 20_000
    seed: Annotated[
        int, Field(ge=0, lt=2**63, description="Seed of the random numbers. A sample depends on seed and index alone.")
    ] = 0
    design: Annotated[
        Literal[DESIGNS], Field(description="How samples are drawn: random, antithetic, latin-hypercube or sobol.")  # type: ignore[valid-type]
    ] = "random"
    store: Annotated[
        Literal["samples", "summary"], Field(description="samples keeps all, summary keeps sums and the first 100,000.")
    ] = "samples"
    tolerance: Annotated[
        Number,
        Field(
            gt=0.0,
            lt=1.0,
            description="Largest departure of a sigma ratio from one that counts as agreement.",
            examples=["5 %"],
        ),
    ] = 0.05
    confidence: Annotated[Number, Field(ge=0.5, lt=1.0, description="Confidence of all verdicts together.")] = 0.95
    sample_timeout: Annotated[
        Duration,
        Field(ge=0.001, le=1e6, description="Time after which a sample fails; none unless given.", examples=["10 s"]),
    ] | None = None  # fmt: skip
    scenario: Annotated[Content, Field(description="What is simulated; its type decides which other keys there are.")]
    errors: Annotated[
        Content,
        Field(description="One sigma of a normal error by source, or a table with its distribution; others are zero."),
    ] = {}
    correlations: Annotated[
        list[CorrelationTable], Field(max_length=1_000, description="Correlations of pairs of sources.")
    ] = []
    joint: Annotated[
        list[JointTable], Field(max_length=100, description="Groups of sources with a joint distribution.")
    ] = []
    start_times: Annotated[StartTimesTable, Field(description="Study of mcnav sweep --vary start.")] = StartTimesTable()
    accept: Annotated[AcceptTable, Field(description="Requirements, which mcnav run --check tests.")] | None = None

    def most_samples(self) -> int:
        """Return the number of samples, the largest one with a rule for stopping."""
        return self.samples.at_most if isinstance(self.samples, UntilTable) else self.samples


_FURTHER: Final[Content] = dict.fromkeys(FURTHER_NAMES, (Any, None))
CampaignFile: Final = create_model("CampaignFile", __base__=CampaignTable, **_FURTHER)
"""The whole file; further tables are read with the scenario."""
