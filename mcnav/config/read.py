"""Campaigns from files and dictionaries: a `Campaign`, or a list of all mistakes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcnav.config.campaign import Campaign, check_stored_samples
from mcnav.config.documents import SI, Description, document_of
from mcnav.config.ranges import quote_ranges, split_ranges, with_values
from mcnav.config.requirement_times import with_epochs
from mcnav.config.requirements import check_requirements, read_requirements
from mcnav.config.resolved import campaign_of
from mcnav.config.scenario import read_scenario
from mcnav.config.schema import CampaignFile, CampaignTable, UntilTable
from mcnav.config.sources import KnownSources, check_names, read_correlations, read_errors, read_joint, with_units
from mcnav.config.start_times import read_start_times
from mcnav.config.stopping import read_stopping_rule
from mcnav.config.table_of_values import stored_table
from mcnav.config.toml import load_file
from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.entries.context import EarlierFile, FileContext
from mcnav.entries.inputs import SourceFile
from mcnav.entries.validation import validate
from mcnav.errors import CampaignError, Problem
from mcnav.physics.units import PlainNumbers, numbers_in_si
from mcnav.sampler.designs import DESIGNS
from mcnav.sampler.distributions import Distribution, Normal
from mcnav.sampler.error_model import Correlation, CorrelationError, ErrorModel, JointError
from mcnav.sampler.multivariate_t import MultivariateT
from mcnav.sampler.scipy_and_tables import EmpiricalDistribution
from mcnav.store.manifest import RequirementRecord
from mcnav.store.summaries import SUMMARY
from mcnav.systems.registry import (
    FURTHER_NAMES,
    ScenarioSpec,
    further_tables,
    is_code,
    scenario_type,
)  # fmt: skip
from mcnav.systems.timeouts import time_limit

__all__ = ["Campaign", "campaign_from", "parse_campaign", "read_campaign"]


def read_campaign(
    path: str | Path,
    overrides: Mapping[str, Any] | None = None,
    execute: bool = True,
    earlier: Mapping[str, EarlierFile] | None = None,
) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    overrides : mapping, optional
        Top-level entries that replace those of the file.
    execute : bool
        Whether the code of a user-defined scenario may be executed, and files outside of the campaign's folder read.
    earlier : mapping of str to EarlierFile, optional
        Files of an earlier run by setting; they replace files that have changed since.

    Raises
    ------
    CampaignError
        Lists every mistake that was found.
    """
    path = Path(path)
    content = load_file(path)
    entries = content.get("scenario")
    kind = entries.get("type") if isinstance(entries, dict) else None
    if not execute and is_code(kind):
        message = f"got {kind!r}, which is code; nothing in a run folder is executed, so name the run's --campaign"
        raise CampaignError([Problem(str(path), "scenario.type", message)])
    return parse_campaign(content, str(path), path.stem, overrides, earlier, confined=not execute)


def campaign_from(described: Description, overrides: Mapping[str, Any] | None = None) -> Campaign:
    """Return the campaign of a file, of one that has been read, of objects, or of a dictionary.

    Parameters
    ----------
    described : str, Path, Campaign, mcnav.Campaign or mapping
        Paths in a mapping are relative to the current folder.
    overrides : mapping, optional
        Top-level entries that replace those described; for a `Campaign`, ``samples`` and ``seed`` only.

    Raises
    ------
    CampaignError
        Lists every mistake that was found.
    """
    if isinstance(described, Campaign):
        return described.with_overrides(overrides) if overrides else described
    if isinstance(described, (str, Path)):
        return read_campaign(described, overrides)
    document = document_of(described)
    campaign = parse_campaign(document.content, document.file, document.stem, overrides, code=document.code)
    return replace(campaign, ranges=document.ranges)


def parse_campaign(
    content: Mapping[str, Any],
    file: str,
    stem: str,
    overrides: Mapping[str, Any] | None = None,
    earlier: Mapping[str, EarlierFile] | None = None,
    confined: bool = False,
    code: Mapping[str, SourceFile] | None = None,
) -> Campaign:
    """Check the content of a campaign file, with code that is given besides; see `read_campaign`.

    Ranges stand for their upper ends.
    """
    content, ranges = split_ranges({**content, **(overrides or {})}, file)
    context = FileContext(file, Path(file).parent, earlier or {}, content, confined, code or {})
    try:
        with numbers_in_si(content.get("units") == SI) as numbers:
            campaign = replace(_parse(context, stem, numbers), ranges=ranges, content=content)
            if lowest := {spec.place: spec.lower for spec in ranges if spec.span.low <= 0.0}:  # which sizes refuse
                _parse(replace(context, content=with_values(content, lowest), problems=[]), stem, numbers)
            return campaign
    except CampaignError as wrong:
        if not ranges:
            raise
        raise CampaignError([quote_ranges(problem, ranges) for problem in wrong.problems]) from None


def _parse(context: FileContext, stem: str, numbers: PlainNumbers) -> Campaign:
    """Read all tables of a file; see `parse_campaign`."""
    content = context.content
    whole = validate(CampaignFile, content, context)
    table = whole or _readable_part(content, context)
    if whole is not None:
        check_stored_samples(whole, context)
    with time_limit(table.sample_timeout):  # for a user's code, which is executed
        return _read_tables(table, context, stem, numbers)


def _read_tables(table: CampaignTable, context: FileContext, stem: str, numbers: PlainNumbers) -> Campaign:
    """Read the tables of a file, of which the top level is known; see `parse_campaign`."""
    content = context.content
    described, known = read_scenario(content.get("scenario"), context)
    if content.get("units") == SI and isinstance(content.get("errors"), dict) and known is not None:
        content["errors"] = with_units(content["errors"], known.sources)
    distributions = _read_distributions(described, known, context)
    _check_use(None if described is None else described.scenario, context)
    if known is not None:
        check_names(content, known, context)
    if outputs := _outputs(described, content):
        check_requirements(content.get("accept"), outputs, context)
    correlations, joint = read_correlations(table.correlations), read_joint(table.joint, context)
    requirements: list[RequirementRecord] = []
    if table.accept is not None and described is not None:
        described = replace(described, scenario=with_epochs(described.scenario, table.accept))
        requirements = read_requirements(table.accept, described.scenario, context)
    until = None
    if isinstance(table.samples, UntilTable):
        until = read_stopping_rule(table.samples, str(table.design), context)
    if isinstance(table.samples, UntilTable) and table.store == SUMMARY:
        context.problem("samples.until", "needs store = 'samples': the blocks of a summary are fixed for one size")
    if described is not None and "start_times" in content:
        _check_start_times(described.scenario, str(table.start_times.axes), context)
    if known is None:
        raise context.error()
    sources = known.sources
    model = None if context.problems else _error_model(sources, distributions, correlations, joint, context)
    start_times = read_start_times(table.start_times, known, outputs, distributions, context)
    if described is None or model is None or context.problems:
        raise context.error()
    if described.complete is not None:
        try:
            described = replace(described, scenario=described.complete(described.scenario, model))
        except ScenarioError as wrong:
            context.problem(wrong.key, str(wrong))
            raise context.error() from None
    columns = {
        source.name: stored_table(source, each)
        for source in sources
        if isinstance(each := distributions.get(source.name), EmpiricalDistribution)
    }
    if not numbers.read:  # then the file without this key is the same campaign
        content.pop("units", None)
    return campaign_of(table, stem, described, model, until, requirements, start_times, columns, context)


def _readable_part(content: Mapping[str, Any], context: FileContext) -> CampaignTable:
    """Return the top-level tables of a file without the entries that have mistakes, so that the others are checked."""
    wrong = {tuple(re.split(r"[. ]", problem.key)[:2]) for problem in context.problems}
    kept = {}
    for key, entry in content.items():
        inside = {place[1] for place in wrong if place[0] == key and len(place) > 1}
        if key in ("accept", "start_times") and inside and isinstance(entry, Mapping):
            kept[key] = {name: value for name, value in entry.items() if name not in inside}
        elif key in CampaignTable.model_fields and not any(place[0] == key for place in wrong):
            kept[key] = entry
    silent = FileContext(context.file, context.folder)
    return validate(CampaignFile, {"scenario": {}, **kept}, silent) or CampaignTable(scenario={})


def _outputs(described: ScenarioSpec | None, content: Mapping[str, Any]) -> Sequence[Output]:
    """Return the outputs of the scenario, or of its type where it cannot be read; none where that does not tell."""
    if described is not None:
        return described.scenario.outputs
    entries = content.get("scenario")
    kind = scenario_type(entries.get("type")) if isinstance(entries, dict) else None
    return () if kind is None else kind.outputs_in(content)


def _read_distributions(
    described: ScenarioSpec | None, known: KnownSources | None, context: FileContext
) -> dict[str, Distribution]:
    """Read the distributions of ``[errors]``, and those that other tables give; mistakes are added to the context."""
    entries, distributions = context.content.get("errors"), dict[str, Distribution]()
    if isinstance(entries, dict) and known is not None:
        distributions = read_errors(entries, known, context)
    if described is None:
        return distributions
    for name in described.sigmas.keys() & distributions.keys():
        context.problem(f"errors.{name}", f"is given in {described.tables[name]} as well; keep one")
    return {**{name: Normal(sigma) for name, sigma in described.sigmas.items()}, **distributions}


def _check_use(scenario: Scenario | None, context: FileContext) -> None:
    """Add mistakes about what the file has, and a scenario of this type cannot use."""
    content, entries = context.content, context.content.get("scenario")
    if content.get("design") == "sobol" and scenario is not None and scenario.noisy:
        others = ", ".join(design for design in DESIGNS if design != "sobol")
        context.problem("design", f"got 'sobol', which cannot draw noise; expected one of {others}")
    kind = scenario_type(entries.get("type")) if isinstance(entries, dict) else None
    if kind is None:
        return
    for name in FURTHER_NAMES:
        if name in content and name not in kind.tables:
            context.problem(name, f"{further_tables()[name].absent}; remove this table")
    for name, further in kind.tables.items():
        if further.needs and content.get(name) not in (None, []) and content.get(further.needs) in (None, []):
            context.problem(name, further.because)


def _error_model(
    sources: Sequence[Source],
    distributions: Mapping[str, Distribution],
    correlations: list[Correlation],
    joint: Sequence[MultivariateT],
    context: FileContext,
) -> ErrorModel | None:
    """Build the model of all errors; mistakes are added to the context."""
    try:
        later = [source.name for source in sources if source.later]
        return ErrorModel([source.name for source in sources], distributions, correlations, joint, later)
    except CorrelationError as wrong:
        context.problem("correlations" + ("" if wrong.entry is None else f" #{wrong.entry + 1}"), str(wrong))
    except JointError as wrong:
        context.problem(f"joint #{wrong.entry + 1}.sources", str(wrong))
    return None


def _check_start_times(scenario: Scenario, axes: str, context: FileContext) -> None:
    """Refuse ``[start_times]`` where the start cannot be chosen."""
    try:
        scenario.check_start_axes(axes)
    except ScenarioError as wrong:
        context.problem("start_times.axes" if wrong.key == "axes" else "start_times", str(wrong))
