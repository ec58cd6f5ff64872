"""Results of simulations by mcnav's own code that are kept from one command to the next.

A result is a function of its inputs and of the program. It is read again where the digest of both is the same: of the
inputs, of all files of the package, of the libraries' versions, and of the processor for which code is compiled.
"""

from __future__ import annotations

import base64
import hashlib
import json
import pickle
import platform
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.caches.stored import Cache, DamagedError
from mcnav.compiled.objects import libraries
from mcnav.compiled.target import target
from mcnav.execution.progress import note

ARRAY: Final = "array of base64"
NUMBERS: Final = np.dtype("<f8")

KEPT_FROM: Final = 0.1
"""Seconds of computing from which on a result is kept; its digest and file take 0.04 s."""


def keep(kind: str, inputs: object, compute: Callable[[], Any]) -> Any:
    """Return a result that an earlier command has kept, or compute it.

    Parameters
    ----------
    kind : str
        Of the results, a name for a folder.
    inputs : object
        All that the result depends on besides the program; it can be pickled, and code of a user's is not among it.
    compute : callable
        Computes the result, of tables, lists, texts, numbers, and arrays of numbers. Kept or not, it is returned as
        JSON has it, but arrays stay arrays.
    """
    results, name = Cache(kind), hashlib.sha256(program() + pickle.dumps(inputs, protocol=5)).hexdigest()
    try:
        content = results.read(name)
        if content is not None:
            return _read(content)
    except DamagedError as damaged:
        note(f"{damaged}; it is computed again")
    began = time.perf_counter()
    content = json.dumps(compute(), default=_described).encode()
    if time.perf_counter() - began >= KEPT_FROM:
        results.write(name, content)
    return _read(content)


def _described(array: Array) -> dict[str, object]:
    numbers = np.ascontiguousarray(array, NUMBERS)
    return {ARRAY: base64.b64encode(numbers.data).decode("ascii"), "shape": array.shape}


def _read(content: bytes) -> Any:
    def known(table: dict[str, Any]) -> Any:
        if ARRAY not in table:
            return table
        return np.frombuffer(base64.b64decode(table[ARRAY]), NUMBERS).astype(float).reshape(table["shape"])

    return json.loads(content, object_hook=known)


@cache
def program() -> bytes:
    """Digest the program: files of the package, versions of interpreter and libraries, the processor."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(f"{platform.python_version()} {libraries()} {target()}".encode())
    for file in sorted(package.rglob("*.py")):
        digest.update(f"{file.relative_to(package)} ".encode() + file.read_bytes())
    return digest.digest()
