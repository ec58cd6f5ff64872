"""Command of the study: ``python -m tests.calibration`` (`make calibrate`)."""

from __future__ import annotations

import argparse
from pathlib import Path

from tests.calibration.box_trials import CSV as BOXES_CSV
from tests.calibration.box_trials import write_boxes
from tests.calibration.page import ALONE, CSV, write_calibration


def main() -> None:
    """Measure, write the page and its tables, and print how many rates there are of each finding."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.calibration", description="Measure error rates of intervals, tests and verdicts."
    )
    parser.add_argument("--trials", type=int, default=100, help="campaigns of each kind [default: 100]")
    parser.add_argument("--jobs", type=int, default=2, help="parallel processes [default: 2]")
    parser.add_argument("--alone", choices=(*ALONE, "boxes"), default="", help="measure these, keep the other rates")
    parser.add_argument("--out", type=Path, default=Path("reports/calibration"), help="[default: reports/calibration]")
    options = parser.parse_args()
    if options.alone == "boxes":
        write_boxes(options.out / BOXES_CSV)
        return
    if options.alone and not (options.out / CSV).is_file():
        parser.error(
            f"{options.out / CSV}: no such file; --alone keeps the other rates, which a study without it measures"
        )
    table, files = write_calibration(options.out, options.trials, options.jobs, options.alone)
    for finding, count in table[table["finding"] != ""]["finding"].value_counts().items():
        print(f"{count:6} rates {finding}")
    print("\nwritten:", *files, sep="\n  ")


if __name__ == "__main__":
    main()
