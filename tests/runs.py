"""Runs of campaigns whose subject is not the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcnav.config.documents import Description, document_of
from mcnav.config.overrides import Value, parse_document
from mcnav.config.read import Campaign
from mcnav.workflow.run import Run, run_campaign


def simulate(campaign: Campaign, folder: Path, engine: str | None, jobs: int, **options: Any) -> Run:
    """Run a campaign as `run_campaign` does, without the report: most tests have runs of milliseconds."""
    return run_campaign(campaign, folder, engine, jobs, report=False, **options)


def vary(campaign: Description, values: Mapping[str, Value]) -> Campaign:
    """Read a campaign with some keys set to other values."""
    return parse_document(document_of(campaign), values)
