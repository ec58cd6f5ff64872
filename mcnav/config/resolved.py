"""A campaign put together from what was read, and its entries with all defaults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mcnav.config.campaign import Campaign
from mcnav.config.schema import CampaignTable, UntilTable
from mcnav.config.start_times import StartTimesPlan
from mcnav.config.stopping import StoppingRule
from mcnav.config.table_of_values import StoredTable
from mcnav.config.toml import Content
from mcnav.entries.context import FileContext
from mcnav.sampler.error_model import ErrorModel
from mcnav.store.manifest import RequirementRecord
from mcnav.systems.registry import (
    FURTHER_NAMES,
    ScenarioSpec,
)  # fmt: skip


def campaign_of(
    table: CampaignTable,
    stem: str,
    described: ScenarioSpec,
    errors: ErrorModel,
    until: StoppingRule | None,
    requirements: Sequence[RequirementRecord],
    start_times: StartTimesPlan,
    columns: Mapping[str, StoredTable],
    context: FileContext,
) -> Campaign:
    """Put together what was read; ``columns`` are the files of distributions by source."""
    content, name = context.content, table.name or stem
    entries = {**content.get("errors", {}), **{source: dict(column.entry) for source, column in columns.items()}}
    return Campaign(
        name=name,
        samples=table.most_samples(),
        seed=table.seed,
        until=until,
        design=str(table.design),
        tolerance=table.tolerance,
        confidence=table.confidence,
        scenario=described.scenario,
        errors=errors,
        requirements=tuple(requirements),
        start_times=start_times,
        tables={column.path: column.content for column in columns.values()},
        resolved=_resolve({**content, "errors": entries}, table, name, described),
        code=described.code,
        sample_timeout=table.sample_timeout,
        store=str(table.store),
        file=context.file,
        files=described.inputs,
    )


def _resolve(content: Mapping[str, Any], table: CampaignTable, name: str, described: ScenarioSpec) -> Content:
    """Return the entries of the file with all defaults; numbers keep their full precision."""
    resolved = {
        "name": name,
        "samples": content["samples"] if isinstance(table.samples, UntilTable) else table.samples,
        "seed": table.seed,
        "design": str(table.design),
        "tolerance": content.get("tolerance", table.tolerance),
        "confidence": content.get("confidence", table.confidence),
        **({"units": content["units"]} if "units" in content else {}),
        **({"store": table.store} if table.store != "samples" else {}),
        **({"sample_timeout": content["sample_timeout"]} if "sample_timeout" in content else {}),
        "scenario": dict(described.resolved),
        **{key: described.further.get(key, content[key]) for key in FURTHER_NAMES if key in content},
        "errors": content["errors"],
        "correlations": content.get("correlations", []),
        **({"joint": content["joint"]} if table.joint else {}),
        **({"start_times": content["start_times"]} if "start_times" in content else {}),
    }
    return resolved | ({"accept": content["accept"]} if table.accept else {})
