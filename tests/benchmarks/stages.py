"""Where the time of a run goes: ``python -m tests.benchmarks.stages ANSWER SAMPLES STORE``, one job.

The functions that are the stages are replaced by ones that keep time and call them.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from tests.benchmarks.growth import CAMPAIGN, STAGED
from tests.benchmarks.spawn import run

STAGES: Final = {
    "read the campaign, fly its truth": ("mcnav.config.read:read_campaign",),
    "prepare: partials, grid, first draws": ("mcnav.workflow.run:prepare_system",),
    "draw": ("mcnav.sampler.error_model:ErrorModel.draw",),
    "fly": ("mcnav.runner.chunks:simulate_batch",),
    "errors at 60 epochs": ("mcnav.systems.reentry.engines:EnsembleEngine.history_sums",),
    "store": (
        "mcnav.runner.chunks:write_chunk",
        "mcnav.linear.sample_reduction:BlockReduction.add",
        "mcnav.workflow.run:tables_over_time",
    ),
    "analyse": ("mcnav.workflow.run:analyse",),
    "write the report": ("mcnav.workflow.run:write_results",),
}
REST: Final = "start, imports and the rest"


def holder_of(place: str) -> tuple[Any, str]:
    """Return the module or class that holds a function, and the function's name; ``module:Class.name``."""
    module, path = place.split(":")
    *classes, name = path.split(".")
    return reduce(getattr, classes, importlib.import_module(module)), name


def watched(spent: dict[str, float]) -> None:
    """Put time-keepers in the places of the stages' functions."""

    def keeper(stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def keep(*arguments: Any, **named: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                spent[stage] += time.perf_counter() - begin

        return keep

    for stage, places in STAGES.items():
        for place in places:
            home, name = holder_of(place)
            setattr(home, name, keeper(stage, getattr(home, name)))


def main(answer: Path, samples: int, store: str, begin: float) -> None:
    """Run a campaign with time-keepers and write what they found."""
    spent: dict[str, float] = defaultdict(float)
    from mcnav.config import read
    from mcnav.workflow.run import run_campaign

    watched(spent)
    campaign = read.read_campaign(CAMPAIGN, {"samples": samples, "store": store})
    with TemporaryDirectory() as folder:
        run_campaign(campaign, Path(folder) / "run", None, 1)
    spent[REST] = time.clock_gettime(time.CLOCK_MONOTONIC) - begin - sum(spent.values())
    answer.write_text(json.dumps({stage: spent[stage] for stage in (*STAGES, REST)}))


def measured(store: str, samples: int = STAGED) -> dict[str, Any]:
    """Seconds of every stage of a run in a process of its own."""
    with TemporaryDirectory() as folder:
        answer = Path(folder) / "stages.json"
        begin = str(time.clock_gettime(time.CLOCK_MONOTONIC))
        status, _, _, said = run(
            [sys.executable, "-m", "tests.benchmarks.stages", str(answer), str(samples), store, begin]
        )
        if status != 0:
            raise RuntimeError(f"the run ended with status {status}: {said[-300:]}")
        return {"store": store, "samples": samples, "seconds": json.loads(answer.read_text())}


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], float(sys.argv[4]))
