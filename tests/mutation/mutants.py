"""Random choice of mutants."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

from tests.mutation import ROOMS
from tests.mutation.sites import Site, find_sites


@dataclass(frozen=True)
class Mutant:
    """Change at a place of a module."""

    path: str
    site: Site
    choice: str

    def __str__(self) -> str:
        """Return place and change in a line."""
        return f"{self.path}:{self.site.row}: {self.site.was} -> {self.choice}"


def candidates(tree: Path, only: str = "") -> list[tuple[str, Site]]:
    """List all places of `ROOMS` whose module's path contains a text."""
    paths = sorted(str(path.relative_to(tree)) for room in ROOMS for path in (tree / room).glob("*.py"))
    return [(path, site) for path in paths if only in path for site in find_sites((tree / path).read_text())]


def choose(tree: Path, count: int, seed: int, only: str = "") -> list[Mutant]:
    """Choose mutants at different places, uniform over places and then over the changes of each."""
    chance = random.Random(seed)
    return [
        Mutant(path, site, chance.choice(site.choices)) for path, site in chance.sample(candidates(tree, only), count)
    ]
