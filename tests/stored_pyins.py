"""Import this to have pyins' compiled integration stored on disk; each worker would compile it for seconds."""

from __future__ import annotations

from numba.core.dispatcher import Dispatcher
from pyins import _numba_integrate

for each in vars(_numba_integrate).values():
    if isinstance(each, Dispatcher):
        each.enable_caching()
