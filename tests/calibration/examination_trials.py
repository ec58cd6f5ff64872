"""What the examination of linear analysis says of campaigns, beside what thousands of samples say.

``python -m tests.calibration.examination_trials FILE [EARLIER]`` examines campaigns of the repository and harder
variants, runs each with `SAMPLES`, writes a row for each output and for all together, and prints how often the two
agree. Where an earlier file is given, its answers of samples are taken and only what it lacks is run.
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
from mcnav.config.read import Campaign, read_campaign
from mcnav.contract.engine import Engine
from mcnav.execution.threads import one_thread
from mcnav.runner.draws import DrawPlan
from mcnav.runner.soundness import exact_engine
from mcnav.sampler.designs import SamplingDesign
from mcnav.sampler.distributions import Normal
from mcnav.sampler.error_model import ErrorModel
from mcnav.studies.examine import examine_model
from tests.scaled_errors import scaled_errors

CAMPAIGNS: Final = Path(__file__).parents[2] / "campaigns"

SAMPLES: Final = {"quick": 20_000, "slow": 2_000}
"""Samples of a run where an engine takes thousands in a chunk, and elsewhere."""

PLAIN: Final = tuple(
    f"{number:02}" for number in (1, 2, 3, 4, 5, 6, 7, 10, 11, 12, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 28,
                                  29, 30, 31, 36, 37)
)  # fmt: skip
"""Campaigns by the beginning of their names."""

LARGER: Final = ("01", "02", "05", "07", "15", "16", "17", "11", "18", "19", "20", "22")
"""Those that are also tried with all constant errors three and ten times as large."""

WITH_HEADING: Final = ("15", "16", "18", "19", "20")
"""Those that are also tried with a heading known to 30 degrees."""

WITH_NOISE: Final = ("15", "16", "18", "19", "20")
"""Those that are also tried with their noise alone."""

VARIANTS: Final = (
    *((number, "as it is") for number in PLAIN),
    *((number, f"errors x {factor}") for number in LARGER for factor in (3, 10)),
    *((number, "heading 30 deg") for number in WITH_HEADING),
    *((number, "noise alone") for number in WITH_NOISE),
)


def varied(errors: ErrorModel, variant: str) -> ErrorModel:
    """Return the errors of a variant."""
    if variant == "heading 30 deg":
        sizes = dict(zip(errors.names, errors.distributions, strict=True))
        return ErrorModel(errors.names, sizes | {"heading": Normal(np.radians(30.0))})
    factor = {"as it is": 1.0, "errors x 3": 3.0, "errors x 10": 10.0, "noise alone": 0.0}[variant]
    return errors if factor == 1.0 else scaled_errors(errors, factor)


@dataclass(frozen=True)
class Row:
    """Answer to one output of a campaign, or to all ``together``, by few flights and by samples."""

    campaign: str
    variant: str
    output: str
    noise: bool
    examined: str
    ratio: float
    low: float
    high: float
    by_samples: str
    ratio_of_samples: float


Answers = dict[str, tuple[str, float]]
"""Verdict of samples, and ratio, by output."""


def rows_of(name: str, variant: str, known: Answers) -> Iterator[Row]:
    """Examine a variant of a campaign, and run it where the answers of samples are not known."""
    (file,) = CAMPAIGNS.glob(f"{name}_*.toml")
    campaign = read_campaign(file)
    campaign = replace(campaign, errors=varied(campaign.errors, variant))
    outputs = campaign.scenario.outputs
    model = Model.of(campaign.scenario.linear().end, campaign.errors.mean, campaign.errors.covariance, outputs)
    draws = DrawPlan(campaign.errors, "antithetic", campaign.seed, SAMPLES["quick"])
    engine = exact_engine(campaign.scenario, draws.probes(), campaign.sample_timeout)
    examined = examine_model(model, campaign.errors, engine, campaign.tolerance)
    known = known or answers_of_samples(campaign, model, engine)
    named = [(output.name, judged) for output, judged in zip(outputs, examined.outputs, strict=True)]
    for output, judged in (*named, ("together", examined.joint)):
        if judged is not None and output in known:
            yield Row(
                file.stem, variant, output, engine.noisy, judged.verdict, judged.ratio, judged.low, judged.high,
                *known[output],
            )  # fmt: skip


def answers_of_samples(campaign: Campaign, model: Model, engine: Engine) -> Answers:
    """Run a campaign, and return what its samples say."""
    count = SAMPLES["quick" if engine.chunk >= 1_024 else "slow"]
    batch = DrawPlan(campaign.errors, "antithetic", campaign.seed, count).batch(0, count)
    result = engine.simulate(batch)
    by_samples = compare(
        model, batch.errors, result.values, Criterion(campaign.tolerance),
        SamplingDesign.of("antithetic", count, campaign.errors.normal), result.linear_values,
    )  # fmt: skip
    answers: Answers = {
        output.name: (sampled.paired.verdict, np.nan if sampled.paired.ratio is None else sampled.paired.ratio)
        for output, sampled in zip(campaign.scenario.outputs, by_samples.outputs, strict=True)
    }
    if by_samples.ellipsoid is not None:
        ratio = by_samples.ellipsoid.judgement.ratio
        answers["together"] = by_samples.ellipsoid.verdict, np.nan if ratio is None else ratio
    return answers


def read_answers(file: Path) -> dict[tuple[str, str], Answers]:
    """Read the answers of samples from the rows of an earlier file, by campaign and variant."""
    answers: dict[tuple[str, str], Answers] = {}
    with file.open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            of_variant = answers.setdefault((row["campaign"][:2], row["variant"]), {})
            of_variant[row["output"]] = row["by_samples"], float(row["ratio_of_samples"])
    return answers


def counts(rows: list[Row]) -> Counter[tuple[bool, str, str]]:
    """Count rows by noise, answer by few flights and answer by samples."""
    return Counter((row.noise, row.examined, row.by_samples) for row in rows)


def main(file: Path, earlier: Path | None) -> None:
    """Examine all variants and write a file of rows; an earlier file has the answers of samples, which are kept."""
    known = {} if earlier is None else read_answers(earlier)
    with one_thread(), file.open("w", encoding="utf-8", newline="") as stream:
        writer, rows = csv.writer(stream, lineterminator="\n"), list[Row]()
        writer.writerow(field.name for field in fields(Row))
        for name, variant in VARIANTS:
            for row in rows_of(name, variant, known.get((name, variant), {})):
                rows.append(row)
                writer.writerow(f"{value:.6g}" if isinstance(value, float) else value for value in astuple(row))
            stream.flush()
    for (noise, examined, by_samples), count in sorted(counts(rows).items()):
        print(f"{'with noise' if noise else 'without noise':14}{examined:15}{by_samples:10}{count:4}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
