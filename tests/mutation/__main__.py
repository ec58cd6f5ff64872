"""Command of the trial: ``python -m tests.mutation COUNT SEED [--only TEXT] [--work FOLDER]``."""

import argparse
from pathlib import Path

from tests.mutation import ROOT
from tests.mutation.trial import main

parser = argparse.ArgumentParser(prog="python -m tests.mutation", description="Try random mutations.")
parser.add_argument("count", type=int, help="number of mutants")
parser.add_argument("seed", type=int, help="seed of their choice")
parser.add_argument("--only", default="", metavar="TEXT", help="modules whose path contains this")
parser.add_argument("--work", type=Path, default=ROOT / "build" / "mutants", metavar="FOLDER", help="working folder")
given = parser.parse_args()
main(given.count, given.seed, given.only, given.work.resolve())
