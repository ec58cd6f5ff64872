"""The manifest of a run as typed records: written and read as such, because a run folder may come from anywhere.

Keys that an earlier version wrote and this one does not know are ignored; optional keys have the value that applied
before they existed. Only fields that were set are written.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.quantities import Of
from mcnav.contract.scenario import ScenarioError
from mcnav.files.records import Json, Matrices, Matrix, Number, Record, Vector
from mcnav.sampler.designs import DESIGNS, SamplingDesign
from mcnav.store.chunk_files import MOST_SAMPLES, ChunkFile, Count, Digest, SampleSchema, Words
from mcnav.store.run_files import FORMAT, json_digest, validate
from mcnav.systems.user.settings import check_unit

MOST_KEYS: Final = 250_000
"""Keys of a campaign: a file of a million bytes, the longest that is read, cannot have more."""

Positive = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,199}$")]


class Variable(Record):
    """An error source or an output: its name, SI unit, and the unit in which it is shown.

    ``limit``, ``of`` and ``size_of`` are those of `mcnav.contract.quantities.Output`, ``group`` that of `Source`.
    """

    name: Name
    unit: Words
    shown_in: Words
    limit: Annotated[float, Field(gt=0.0)] | None = None
    of: Of = "navigation"
    size_of: tuple[Name, ...] = ()
    group: Words | None = None

    @model_validator(mode="after")
    def _units(self) -> Self:
        try:
            check_unit(self.name, self.unit, self.shown_in)
        except ScenarioError as wrong:
            raise ValueError(str(wrong)) from None
        return self


class PartialsRecord(Record):
    """Partial derivatives at many times; see `mcnav.contract.linear.LinearSystem`.

    ``processes`` are the variances that each process of noise has added, shape (n, outputs). ``covariance`` is the
    whole linear covariance, where it is not that of the sources alone, shape (n, outputs, outputs). ``nominal`` are the
    errors of a system without errors, shape (n, outputs), where it has some. ``process_pairs`` are the covariances that
    each process has added between the ``pairs`` of outputs that requirements over time limit together, shape
    (n, pairs). ``origin``, shape (n, outputs), is there where some output is measured from the nominal flight.
    """

    label: Words
    times: Vector
    partials: Matrices
    nominal: Matrix | None = None
    origin: Matrix | None = None
    processes: Mapping[Name, Matrix] = {}
    covariance: Matrices | None = None
    pairs: tuple[tuple[Count, Count], ...] = ()
    process_pairs: Mapping[Name, Matrix] = {}


class FilterPredictionRecord(Record):
    """Linear analysis of a filter; see `mcnav.contract.filter_record.FilterPrediction`.

    ``state_true`` are the true mean squares of the errors of the filter's other states, shape (m, q).
    """

    covariance: Matrices
    state_variance: Matrix
    state_true: Matrix
    believed: Mapping[Words, float] = {}


class FilterRecord(Record):
    """The filter of a scenario; see `mcnav.contract.filter_record.FilterSchema`.

    ``times`` are the epochs of its records, and ``label`` is what they are, as ``name [unit]``.
    """

    label: Words
    times: Vector

    groups: Annotated[Mapping[Name, Annotated[int, Field(ge=1)]], Field(min_length=1)]
    outputs: Annotated[int, Field(ge=1)]
    states: tuple[Name, ...] = ()
    units: tuple[tuple[Words, Words], ...] = ()
    sensors: Mapping[Name, Annotated[int, Field(ge=1)]] = {}
    considered: tuple[Words, ...] = ()
    own_outputs: tuple[Annotated[int, Field(ge=0)], ...] = ()
    prediction: FilterPredictionRecord | None = None

    @model_validator(mode="after")
    def _shapes(self) -> Self:
        if self.own_outputs and not max(self.own_outputs) < self.outputs:
            raise ValueError("own_outputs: names an output that there is not")
        if len(self.units) != len(self.states):
            raise ValueError("units: is not of the length of the states")
        prediction = self.prediction
        if prediction is None:
            return self
        instants, outputs, states = len(self.times), self.outputs, len(self.states)
        shapes = {"covariance": (outputs, outputs), "state_variance": (states,), "state_true": (states,)}
        for name, shape in shapes.items():
            if getattr(prediction, name).shape != (instants, *shape):
                raise ValueError(f"prediction.{name}: is not of the shape that {instants} epochs ask for")
        return self

    @property
    def columns(self) -> FilterSchema:
        """Columns of the filter's records."""
        return FilterSchema(
            self.groups, self.outputs, self.states, self.units, self.sensors, self.considered, self.own_outputs
        )


class SmootherRecord(Record):
    """The smoother behind the filter: its claims as those of a filter, and the linear errors behind it."""

    claims: FilterRecord
    errors: PartialsRecord


class FaultRecord(Record):
    """A fault of a sensor, and what linear analysis expects of its gate; see `mcnav.contract.gates.FaultLaw`.

    ``measurements`` are those during it, ``rejections`` those of them that are rejected on average if all before are
    accepted, and ``alarm`` is the probability that any is. ``first`` and ``last`` are the numbers of the epochs after
    the last measurement before it and after its own last one.
    """

    sensor: Name
    kind: Words
    component: Name
    unit: Words
    shown_in: Words
    begin: float
    end: float
    size: float
    measurements: Count
    rejections: float
    alarm: float
    first: Count
    last: Count


class ExceedanceRecord(Record):
    """See `mcnav.analysis.requirements.Exceedance`; ``requirement`` is the number of the requirement, from zero.

    ``point`` is the most likely way to fail in standard normals, shape (d,); none where it is not known. ``by_levels``:
    see `mcnav.rare.estimate.Rare`.
    """

    requirement: Count
    estimate: Number
    low: Number
    high: Number
    flights: Count
    refusal: Words = ""
    way: Mapping[Words, float] = {}
    sides: Count = 0
    point: Vector | None = None
    power: Number = math.nan
    by_levels: bool = False


class ModelRecord(Record):
    """The linear model, SI, and what further simulations add to it (`mcnav.linear.nonlinear_corrections`).

    ``processes`` are the covariances that each process of noise adds; none in a scenario without noise. ``filter`` is
    none in a scenario without a filter, ``smoother`` where none follows it. ``faults`` are those of its sensors.
    ``tail_outputs`` are the outputs that depend on sources with heavy tails; none where that was not examined.
    ``development`` is in a file of its own (`mcnav.store.development`), whose digest the manifest has; in the manifest
    itself where an earlier version wrote it. ``origin`` is that of `mcnav.contract.linear.LinearSystem`; none where all
    outputs are navigation errors, and in runs of earlier versions, whose requirements limit departures. Means up to
    ``mean_rounding`` are rounding. ``gates`` says what good measurements that gates reject do where linear analysis
    does not hold for them; empty where it holds, none in runs of earlier versions.
    """

    sources: Annotated[tuple[Variable, ...], Field(min_length=1, max_length=1_000)]
    outputs: Annotated[tuple[Variable, ...], Field(min_length=1, max_length=1_000)]
    partials: Matrix
    nominal: Vector
    start_mean: Vector
    start_covariance: Matrix
    origin: Vector | None = None
    mean_rounding: Vector | None = None
    processes: Mapping[Name, Matrix] | None = None
    filter: FilterRecord | None = None
    smoother: SmootherRecord | None = None
    faults: tuple[FaultRecord, ...] | None = None
    development: Annotated[PartialsRecord | None, Field(exclude=True)] = None
    development_sha256: Digest | None = None
    unscented: Mapping[str, Any] | None = None
    partials_differences: Mapping[str, Any] | None = None
    second_order: Mapping[str, Any] | None = None
    higher_order: Mapping[str, Any] | None = None
    budget: Mapping[str, Any] | None = None
    exceedance: tuple[ExceedanceRecord, ...] | None = None
    tail_outputs: tuple[Name, ...] | None = None
    gates: Words | None = None

    @model_validator(mode="after")
    def _shapes(self) -> Self:
        rows, columns = len(self.outputs), len(self.sources)
        shapes = (rows, columns), (rows,), (columns,), (columns, columns)
        for name, shape in zip(("partials", "nominal", "start_mean", "start_covariance"), shapes, strict=True):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name}: is not of the shape that {rows} outputs and {columns} sources ask for")
        for name, vector in (("origin", self.origin), ("mean_rounding", self.mean_rounding)):
            if vector is not None and vector.shape != (rows,):
                raise ValueError(f"{name}: is not of the shape that {rows} outputs ask for")
        names = {output.name for output in self.outputs}
        if not all(names.issuperset(output.size_of) for output in self.outputs):
            raise ValueError("outputs: size_of names an output that there is not")
        for name, covariance in (self.processes or {}).items():
            if covariance.shape != (rows, rows):
                raise ValueError(f"processes.{name}: is not of the shape that {rows} outputs ask for")
        if self.filter is not None and self.filter.outputs != rows:
            raise ValueError(f"filter.outputs: is {self.filter.outputs}, not {rows}")
        return self


class CriterionRecord(Record):
    """See `mcnav.analysis.comparison.Criterion`."""

    tolerance: Share
    confidence: Share
    looks: Annotated[int, Field(ge=1)] = 1


class RequirementRecord(Record):
    """See `mcnav.analysis.requirements.Requirement`; outputs by name.

    ``epochs`` are those at each of which it holds, by number from zero, the start, and ``when`` has them in words; a
    requirement without them holds at the end. ``of`` is "smoother" where it is on the errors behind one, ``about`` is
    "nominal" where it is on departures from the nominal flight.
    """

    kind: Words
    outputs: tuple[Words, ...]
    limits: tuple[float, ...]
    probability: float | None
    when: Words | None = None
    epochs: Annotated[tuple[Count, ...], Field(min_length=1)] | None = None
    of: Words | None = None
    about: Words | None = None


class CodeRecord(Record):
    """A Python file of the user's."""

    file: Words
    sha256: Digest


class FileRecord(Record):
    """A file that the scenario reads; ``copied`` when the run folder has a copy, ``setting`` when a key names it."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_+-][A-Za-z0-9_ .+-]{0,199}$")]
    bytes: Annotated[int, Field(ge=0)]
    sha256: Digest
    copied: Annotated[bool, Field(alias="kept")]
    setting: Words | None = None


def _count_keys(value: Any) -> int:
    """Count the keys of nested tables.

    >>> _count_keys({"errors": {"altitude": "5 km"}, "aiding": [{"type": "gnss"}]})
    4
    """
    counted, left = 0, [value]
    while left:
        each = left.pop()
        table = isinstance(each, dict)
        counted += len(each) if table else 0
        left += [entry for entry in (each.values() if table else each) if isinstance(entry, (dict, list))]
    return counted


class Identity(Record):
    """Everything that a run's numbers depend on; see `mcnav.runner.identity`."""

    model_config = ConfigDict(extra="allow")

    campaign: Json
    engine: Words
    versions: dict[str, Words]
    chunks: int | None = None
    revision: int | None = None
    code: CodeRecord | None = None
    files: Mapping[Words, Digest] = {}

    @field_validator("campaign")
    @classmethod
    def _bounded(cls, campaign: Json) -> Json:
        if _count_keys(campaign) > MOST_KEYS:
            raise ValueError(f"has more than {MOST_KEYS:,} keys")
        return campaign

    @property
    def digest(self) -> str:
        """SHA-256."""
        return json_digest(self.to_json())


class ExecutionRecord(Record):
    """The last execution of a run: workers, seconds, and samples that were simulated then."""

    jobs: Count
    seconds: Positive
    samples: Count


class StoppingRecord(Record):
    """The stopping rule (`mcnav.config.stopping.StoppingRule`) and the precision found at the last look."""

    quantity: Words
    precision: float
    confidence: Share
    at_most: Count
    looks: Count
    found: Number
    reached: bool


class UnsettledRecord(Record):
    """See `mcnav.systems.user.soundness.Unsettled`."""

    source: Words
    output: Words
    disagreement: Number
    limit: float
    own: bool
    noise: Literal["", "response", "fly_linear", "noise_covariance"] = ""


class Manifest(Record):
    """A run: what it was asked for, what it depends on, its linear model and its chunks.

    Keys of the file that have other names are those of the first version.
    """

    format: Literal[FORMAT] = FORMAT  # type: ignore[valid-type]
    campaign: Words
    samples: Annotated[int, Field(ge=2, le=MOST_SAMPLES)]
    seed: int
    design: Literal[DESIGNS]  # type: ignore[valid-type]
    criterion: CriterionRecord
    requirements: tuple[RequirementRecord, ...] = ()
    identity: Identity
    accuracy: Words
    processor: Words | None = None
    commit: Words | None = None
    started: Words
    heavy_tailed: tuple[Words, ...]
    long_tailed: tuple[Words, ...] = ()
    normal: bool = True
    store: Annotated[str, Field(pattern="^(samples|summary)$")] = "samples"
    stored_rows: Annotated[Count | None, Field(alias="kept")] = None
    unsettled: UnsettledRecord | None = None
    remarks: tuple[Words, ...] = ()
    model: ModelRecord
    complete: bool = False
    chunks: Annotated[tuple[ChunkFile, ...], Field(alias="parts")] = ()
    files: tuple[FileRecord, ...] = ()
    stopping: StoppingRecord | None = None
    execution: Annotated[ExecutionRecord | None, Field(alias="flight")] = None

    @model_validator(mode="after")
    def _finished(self) -> Self:
        if not self.complete:
            return self
        begins, ends = [chunk.begin for chunk in self.chunks], [chunk.end for chunk in self.chunks]
        in_order = begins == [0, *ends[:-1]] and all(begin < end for begin, end in zip(begins, ends, strict=True))
        if not in_order or ends[-1:] != [self.samples]:
            raise ValueError(f"parts: do not hold the samples from 0 to {self.samples - 1} in order")
        if self.execution is None:
            raise ValueError("flight: is missing")
        return self

    @classmethod
    def from_json(cls, content: Mapping[str, Any], text: bytes | None = None) -> Manifest:
        """Read the content of ``manifest.json``, whose text need not be formatted again where it is known.

        Raises `ManifestError` naming the first entry that is not as this program writes it.
        """
        return validate(cls, content, text)

    @property
    def sample_schema(self) -> SampleSchema:
        """Columns of the sample files."""
        model = self.model
        return SampleSchema.of(model.sources, model.outputs, model.processes is not None, model.filter is not None)

    @property
    def sampling_design(self) -> SamplingDesign:
        """Dependence between the samples; which outputs have heavy tails is not of the design."""
        return SamplingDesign.of(self.design, self.samples, self.normal)
