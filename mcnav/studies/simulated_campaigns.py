"""Changed campaigns simulated to confirm advice: their requirements, and their filter, as samples show them."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mcnav.analysis.summary import Summary
from mcnav.config.read import Campaign
from mcnav.execution.progress import SILENT, Progress
from mcnav.workflow.run import run_campaign

MOST_SAMPLES: Final = 10_000
"""Samples of each simulation, of campaigns that have more."""


def samples_of(campaign: Campaign) -> int:
    """Return the samples with which changes of a campaign are simulated: its own, at most `MOST_SAMPLES`."""
    return min(campaign.samples, MOST_SAMPLES)


def simulated(campaign: Campaign, samples: int, jobs: int, progress: Progress = SILENT) -> Summary:
    """Run a campaign with so many samples and return its summary; nothing is kept."""
    with TemporaryDirectory(prefix="mcnav-") as folder:
        counted = campaign.with_overrides({"samples": samples})
        return run_campaign(counted, Path(folder) / "run", None, jobs, progress=progress, report=False).results
