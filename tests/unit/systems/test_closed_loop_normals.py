"""Normal variates of closed loops: numpy's, bit for bit, from layers that are computed."""

from __future__ import annotations

import hashlib

import numpy as np

from mcnav.systems.closed_loop.normals import compute_layers, draw_normals

DIGESTS = (
    "33c6472209e1d09ea3548f0291e5e1ad67fb4f1d0305e9f1086689584b7bb7fa",
    "565295797825931547a1036f5b012a247be54abbe077c39fe06c8ed1e9d0a5a9",
    "acd898d9d87e212f657755ba43b21e40958090a7ff2103c9e79f4ea1b0fe2bc5",
)
"""SHA-256 of `wi_double`, `ki_double` and `fi_double` of numpy/random/src/distributions/ziggurat_constants.h."""


def test_layers_are_numpy_s_to_the_last_bit() -> None:
    assert tuple(hashlib.sha256(table.tobytes()).hexdigest() for table in compute_layers()) == DIGESTS


def test_variates_are_those_of_numpy_s_generator() -> None:
    """Of 400,000 each layer has some 1,600, and some 5,000 need more than one word."""
    seed, sample, stream, count = 5, 3, 2, 400_000
    numpy_s = np.random.Generator(np.random.Philox(counter=[0, 0, 0, stream], key=[seed, sample]))
    variates = draw_normals(seed, np.array([sample], dtype=np.uint64), stream, np.zeros(1, dtype=np.int64), count)
    np.testing.assert_array_equal(variates[:, 0], numpy_s.standard_normal(count))
