"""The file of partial derivatives over time."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mcnav.files.whole import to_json
from mcnav.store.development import development_in, development_table
from mcnav.store.manifest import ModelRecord, PartialsRecord, Variable

RNG = np.random.default_rng(7)
MODEL = ModelRecord(
    sources=tuple(Variable(name=name, unit="m", shown_in="m") for name in ("bias", "drift", "walk")),
    outputs=tuple(Variable(name=name, unit="m", shown_in="m") for name in ("east", "north")),
    partials=np.zeros((2, 3)),
    nominal=np.zeros(2),
    start_mean=np.zeros(3),
    start_covariance=np.eye(3),
)
PLAIN = PartialsRecord(label="time [s]", times=np.linspace(0.0, 60.0, 4), partials=RNG.standard_normal((4, 2, 3)))


def _with_noise() -> PartialsRecord:
    """Return a record with all that one may have; a process of noise may have the name of a column."""
    return PLAIN.completed(
        {
            "nominal": RNG.standard_normal((4, 2)),
            "processes": {"gyro": RNG.standard_normal((4, 2)), "nominal": np.full((4, 2), np.nan)},
            "covariance": RNG.standard_normal((4, 2, 2)),
            "pairs": ((0, 1),),
            "process_pairs": {"gyro": RNG.standard_normal((4, 1)), "nominal": np.zeros((4, 1))},
        }
    )


@pytest.mark.parametrize("record", [PLAIN, _with_noise()], ids=["plain", "with noise"])
def test_the_file_gives_back_what_was_written(record: PartialsRecord) -> None:
    again = development_in(development_table(MODEL, record), MODEL)
    assert json.dumps(to_json(again.model_dump())) == json.dumps(to_json(record.model_dump()))


def test_a_file_of_other_outputs_is_refused() -> None:
    other = MODEL.model_copy(update={"outputs": tuple(reversed(MODEL.outputs))})
    with pytest.raises(ValueError, match="outputs"):
        development_in(development_table(MODEL, PLAIN), other)
