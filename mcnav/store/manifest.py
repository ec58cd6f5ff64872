"""What a manifest must be like before anything in it is used: a run folder may come from anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from mcnav.sampling.designs import DESIGNS

Words = Annotated[str, StringConstraints(max_length=2_000)]
Digest = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
MOST_SAMPLES: Final = 1_000_000_000_000

Count = Annotated[int, Field(ge=0, le=MOST_SAMPLES)]
Row = list[float | None]


class _Entries(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class _Named(_Entries):
    name: Words
    unit: Words
    shown_in: Words


class _Model(_Entries):
    sources: Annotated[list[_Named], Field(min_length=1, max_length=1_000)]
    outputs: Annotated[list[_Named], Field(min_length=1, max_length=1_000)]
    partials: list[Row]
    nominal: Row
    start_mean: Row
    start_covariance: list[Row]


class _Criterion(_Entries):
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)]
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)]


class _Code(_Entries):
    file: Words
    sha256: Digest


class _File(_Entries):
    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_+-][A-Za-z0-9_ .+-]{0,199}$")]
    bytes: Annotated[int, Field(ge=0)]
    sha256: Digest
    kept: bool
    setting: Words | None = None


class _Identity(_Entries):
    campaign: dict[str, Any]
    engine: Words
    versions: dict[str, Words]
    code: _Code | None = None
    files: dict[Words, Digest] = {}


class _Part(_Entries):
    file: Annotated[str, StringConstraints(pattern=r"^part-[0-9]{5,9}\.parquet$")]
    begin: Count
    end: Count
    sha256: Digest


class _Flight(_Entries):
    jobs: Count
    seconds: Annotated[float, Field(ge=0.0)]
    samples: Count


class _Unsettled(_Entries):
    source: Words
    output: Words
    disagreement: float | None
    limit: float
    own: bool


class _Manifest(_Entries):
    campaign: Words
    samples: Annotated[int, Field(ge=2, le=MOST_SAMPLES)]
    seed: int
    design: Literal[DESIGNS]  # type: ignore[valid-type]
    criterion: _Criterion
    identity: _Identity
    accuracy: Words
    started: Words
    heavy_tailed: list[Words]
    long_tailed: list[Words] = []
    requirements: list[dict[str, Any]] = []
    model: _Model
    complete: bool
    parts: list[_Part]
    files: list[_File] = []
    flight: _Flight | None = None
    unsettled: _Unsettled | None = None


def find_fault(content: Mapping[str, Any]) -> str | None:
    """What makes a table no manifest of this program; none when it is one."""
    try:
        read = _Manifest.model_validate(content)
    except ValidationError as invalid:
        first = invalid.errors(include_url=False, include_input=False)[0]
        return f"{'.'.join(map(str, first['loc']))}: {str(first['msg']).lower()}"
    rows, columns = len(read.model.outputs), len(read.model.sources)
    shapes = (
        ("partials", [len(row) for row in read.model.partials], [columns] * rows),
        ("nominal", [len(read.model.nominal)], [rows]),
        ("start_mean", [len(read.model.start_mean)], [columns]),
        ("start_covariance", [len(row) for row in read.model.start_covariance], [columns] * columns),
    )
    for name, found, expected in shapes:
        if found != expected:
            return f"model.{name}: is not of the shape that {rows} outputs and {columns} sources ask for"
    if not read.complete:
        return None
    begins, ends = [part.begin for part in read.parts], [part.end for part in read.parts]
    if (
        begins != [0, *ends[:-1]]
        or ends[-1:] != [read.samples]
        or any(b >= e for b, e in zip(begins, ends, strict=True))
    ):
        return f"parts: do not hold the samples from 0 to {read.samples - 1} in order"
    return None if read.flight is not None else "flight: is missing"
