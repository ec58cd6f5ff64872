"""Samples of a run, simulated until there are enough: all of them, or as many as the stopping rule asks for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from mcnav.config.stopping import StoppingRule
from mcnav.execution.progress import Phase, Progress
from mcnav.runner.chunks import ChunkJob
from mcnav.runner.runner import ChunkExecutor, run_chunks
from mcnav.statistics.interim_sizes import interim_sizes
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.manifest import Manifest, StoppingRecord
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse


@dataclass(frozen=True)
class Execution:
    """Arguments of `run_chunks` for a run."""

    job: ChunkJob
    jobs: int
    progress: Progress
    notice: Callable[[str], None]
    most_failures: int | None
    executor: ChunkExecutor | None

    def run(self, manifest: Manifest, rule: StoppingRule | None) -> tuple[Manifest, int]:
        """Simulate a campaign's samples, or as many as its stopping rule asks for.

        Returns
        -------
        manifest : Manifest
            With the number of samples, their chunks and the outcome of the stopping rule.
        simulated : int
            Samples that were not stored already.
        """
        if rule is None:
            self.progress.phase(Phase.SIMULATING, manifest.samples)
            chunks, simulated = self._simulate(manifest.samples)
            return manifest.model_copy(update={"chunks": tuple(chunks)}), simulated
        sizes = interim_sizes(self.job.engine.chunk, self.job.draws.samples)
        criterion = manifest.criterion.model_copy(update={"looks": len(sizes)})
        manifest, simulated, before = manifest.model_copy(update={"criterion": criterion}), 0, 0
        for look, size in enumerate(sizes, start=1):
            note = f"look {look} of at most {len(sizes)}"
            self.progress.phase(Phase.SIMULATING, note=note)
            more, now = self._simulate(size, before)
            simulated, before = simulated + now, size
            manifest = manifest.model_copy(update={"samples": size, "chunks": (*manifest.chunks, *more)})
            self.progress.phase(Phase.ANALYSING, note=note)
            precision = _precision(self.job.folder, manifest, rule)
            reached = precision <= rule.precision
            stopping = StoppingRecord(**asdict(rule), looks=len(sizes), found=precision, reached=reached)
            manifest = manifest.model_copy(update={"stopping": stopping})
            if reached:
                break
        return manifest, simulated

    def _simulate(self, samples: int, first: int = 0) -> tuple[list[ChunkFile], int]:
        job = replace(self.job, draws=replace(self.job.draws, samples=samples))
        return run_chunks(job, self.jobs, self.progress, first, self.notice, self.most_failures, self.executor)


def _precision(folder: RunFolder, manifest: Manifest, rule: StoppingRule) -> float:
    """Return half the width of the widest interval of a sigma ratio, at the confidence of the stopping rule."""
    criterion = manifest.criterion.model_copy(update={"confidence": rule.confidence})
    outputs = analyse(folder, manifest.model_copy(update={"criterion": criterion})).comparison.outputs
    ratios = [output.paired if rule.quantity.endswith("paired") else output.plain for output in outputs]
    widths = [0.5 * (ratio.interval[1] - ratio.interval[0]) for ratio in ratios if ratio.interval is not None]
    return max(widths, default=math.inf)
