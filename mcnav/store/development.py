"""Partial derivatives over time as a file of the run folder: ``development.parquet``, whose digest the manifest has.

A row for each time and output, in this order. Columns: the time; ``output``; ``partial SOURCE`` of every error source;
and where the record has them ``nominal``, ``origin``, ``noise PROCESS`` (the variance that a process has added) and
``covariance OUTPUT``; SI. Covariances between the pairs of outputs that requirements limit together, few, are metadata.
"""

from __future__ import annotations

import json
from typing import Final

import numpy as np
import pyarrow as pa

from mcnav.arrays.types import Array
from mcnav.files.parquet import arrow_array, arrow_texts, numbers_in, parquet_bytes
from mcnav.files.parquet_reading import table_from
from mcnav.files.records import Json
from mcnav.files.whole import to_json
from mcnav.store.manifest import ModelRecord, PartialsRecord

OUTPUT: Final = "output"
MARK: Final = "mcnav.development"
NOMINAL: Final = ("nominal", "origin")
"""Columns of the flight without errors."""


def development_table(model: ModelRecord, known: PartialsRecord) -> bytes:
    """Tabulate the partial derivatives over time of a linear model."""
    names = [output.name for output in model.outputs]
    outputs, count = len(names), len(known.times)
    columns = {known.label: arrow_array(np.repeat(known.times, outputs)), OUTPUT: arrow_texts(names * count)}
    blocks = {f"partial {source.name}": known.partials[:, :, k] for k, source in enumerate(model.sources)}
    blocks |= {name: values for name in NOMINAL if (values := getattr(known, name)) is not None}
    blocks |= {f"noise {name}": variances for name, variances in known.processes.items()}
    if known.covariance is not None:
        blocks |= {f"covariance {name}": known.covariance[:, :, j] for j, name in enumerate(names)}
    columns |= {name: arrow_array(block.ravel()) for name, block in blocks.items()}
    pairs = json.dumps(to_json({"pairs": known.pairs, "process_pairs": known.process_pairs}))
    table = pa.Table.from_arrays(list(columns.values()), names=list(columns))
    return parquet_bytes(table.replace_schema_metadata({MARK: pairs}), [OUTPUT])


def development_in(content: bytes, model: ModelRecord) -> PartialsRecord:
    """Read the partial derivatives over time of a linear model.

    Raises what pyarrow raises, or `ValueError`, `LookupError`, `TypeError`, when the file holds none of this model.
    """
    names = [output.name for output in model.outputs]
    table = table_from(content)
    if table.column_names[1] != OUTPUT or table.column(OUTPUT).to_pylist() != names * (len(table) // len(names)):
        raise ValueError("its rows are not those of the outputs")
    columns = {
        name: numbers_in(table.column(name)).astype(float).reshape(-1, len(names))
        for name in table.column_names
        if name != OUTPUT
    }
    label, times = next(iter(columns.items()))
    fields: Json = {"label": label, "times": times[:, 0]}
    fields["partials"] = np.stack([columns[f"partial {source.name}"] for source in model.sources], axis=2)
    fields |= {name: columns[name] for name in NOMINAL if name in columns}
    if noise := _block(columns, "noise "):
        fields["processes"] = noise
    if _block(columns, "covariance "):
        fields["covariance"] = np.stack([columns[f"covariance {name}"] for name in names], axis=2)
    described = json.loads((table.schema.metadata or {})[MARK.encode()])
    if described["pairs"]:
        fields |= {"pairs": tuple(map(tuple, described["pairs"])), "process_pairs": described["process_pairs"]}
    return PartialsRecord.model_validate(fields)


def _block(columns: dict[str, Array], kind: str) -> dict[str, Array]:
    return {name.removeprefix(kind): values for name, values in columns.items() if name.startswith(kind)}
