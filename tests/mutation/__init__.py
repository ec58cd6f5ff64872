"""Mutation trial: random small changes of the code, each of which the test suite should notice.

``python -m tests.mutation COUNT SEED`` makes so many changes, uniform over all places where one is possible in
`ROOMS`, and runs the tests that reach each: those that cost least first, all of them before it is said to survive.
The trial runs in a copy of the tree and is no part of the test suite.
"""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]

ROOMS: Final = ("mcnav/linear/", "mcnav/statistics/", "mcnav/systems/ins/")
"""Folders whose modules are mutated."""
