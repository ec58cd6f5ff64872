"""What the examination of linear analysis says of campaigns, beside what thousands of samples say.

``python -m tests.calibration.examination_trials FILE`` examines campaigns of the repository and harder variants, runs
each with `SAMPLES`, writes a row for each output and for all together, and prints how often the two agree.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.config.read import read_campaign
from mcnav.execution.threads import one_thread
from mcnav.runner.draws import DrawPlan
from mcnav.runner.soundness import exact_engine
from mcnav.sampler.designs import SamplingDesign
from mcnav.studies.examine import examine_model
from tests.scaled_errors import scaled_errors

CAMPAIGNS: Final = Path(__file__).parents[2] / "campaigns"

SAMPLES: Final = {"quick": 20_000, "slow": 2_000}
"""Samples of a run where an engine takes thousands in a chunk, and elsewhere."""

VARIANTS: Final = (
    *((f"{number:02}", 1.0) for number in (1, 2, 3, 4, 5, 6, 7, 10, 11, 12, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23)),
    *((f"{number:02}", 1.0) for number in (24, 25, 28, 29, 30, 31, 36, 37)),
    *((number, factor) for number in ("01", "02", "05", "07", "15", "16", "17") for factor in (3.0, 10.0)),
    *((number, factor) for number in ("11", "18", "19", "20", "22") for factor in (3.0, 10.0)),
)  # fmt: skip
"""Campaigns by the beginning of their names, and the factor of all their constant errors."""


@dataclass(frozen=True)
class Row:
    """Answer to one output of a campaign, or to all ``together``, by few flights and by samples."""

    campaign: str
    factor: float
    output: str
    noise: bool
    examined: str
    ratio: float
    low: float
    high: float
    by_samples: str
    ratio_of_samples: float


def rows_of(name: str, factor: float) -> Iterator[Row]:
    """Examine and run a campaign whose constant errors are multiplied."""
    (file,) = CAMPAIGNS.glob(f"{name}_*.toml")
    campaign = read_campaign(file)
    campaign = campaign if factor == 1.0 else replace(campaign, errors=scaled_errors(campaign.errors, factor))
    model = Model.of(
        campaign.scenario.linear().end, campaign.errors.mean, campaign.errors.covariance, campaign.scenario.outputs
    )
    draws = DrawPlan(campaign.errors, "antithetic", campaign.seed, SAMPLES["quick"])
    engine = exact_engine(campaign.scenario, draws.probes(), campaign.sample_timeout)
    examined = examine_model(model, campaign.errors, engine, campaign.tolerance)
    count = SAMPLES["quick" if engine.chunk >= 1_024 else "slow"]
    batch = DrawPlan(campaign.errors, "antithetic", campaign.seed, count).batch(0, count)
    result = engine.simulate(batch)
    by_samples = compare(
        model, batch.errors, result.values, Criterion(campaign.tolerance),
        SamplingDesign.of("antithetic", count, campaign.errors.normal), result.linear_values,
    )  # fmt: skip
    names = [output.name for output in campaign.scenario.outputs]
    for output, judged, sampled in zip(names, examined.outputs, by_samples.outputs, strict=True):
        ratio = np.nan if sampled.paired.ratio is None else sampled.paired.ratio
        yield Row(
            file.stem, factor, output, engine.noisy, judged.verdict, judged.ratio, judged.low, judged.high,
            sampled.paired.verdict, ratio,
        )  # fmt: skip
    joint, ellipsoid = examined.joint, by_samples.ellipsoid
    if joint is not None and ellipsoid is not None:
        ratio = np.nan if ellipsoid.judgement.ratio is None else ellipsoid.judgement.ratio
        yield Row(
            file.stem, factor, "together", engine.noisy, joint.verdict, joint.ratio, joint.low, joint.high,
            ellipsoid.verdict, ratio,
        )  # fmt: skip


def counts(rows: list[Row]) -> Counter[tuple[bool, str, str]]:
    """Count rows by noise, answer by few flights and answer by samples."""
    return Counter((row.noise, row.examined, row.by_samples) for row in rows)


def main(file: Path) -> None:
    """Examine all variants and write a file of rows."""
    with one_thread(), file.open("w", encoding="utf-8", newline="") as stream:
        writer, rows = csv.writer(stream), list[Row]()
        writer.writerow(field.name for field in fields(Row))
        for name, factor in VARIANTS:
            for row in rows_of(name, factor):
                rows.append(row)
                writer.writerow(f"{value:.6g}" if isinstance(value, float) else value for value in astuple(row))
            stream.flush()
    for (noise, examined, by_samples), count in sorted(counts(rows).items()):
        print(f"{'with noise' if noise else 'without noise':14}{examined:15}{by_samples:10}{count:4}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
