"""Campaigns from files and dictionaries: a `Campaign`, or a list of all mistakes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter

from mcnav.config.campaign import Campaign, check_stored_samples
from mcnav.config.requirement_times import with_epochs
from mcnav.config.requirements import read_requirements
from mcnav.config.schema import CampaignFile, CampaignTable, UntilTable
from mcnav.config.sources import read_correlations, read_errors, read_joint
from mcnav.config.start_times import StartTimesPlan, read_start_times
from mcnav.config.stopping import StoppingRule, read_stopping_rule
from mcnav.config.table_of_values import StoredTable, stored_table
from mcnav.config.toml import Content, load_file, load_mapping
from mcnav.contract.members import lacks_scenario
from mcnav.contract.quantities import Source
from mcnav.contract.scenario import Scenario, ScenarioError, can_have_noise, has_start_times
from mcnav.entries.context import EarlierFile, FileContext
from mcnav.entries.validation import validate, validate_entry
from mcnav.errors import CampaignError, Problem
from mcnav.sampling.distributions import Distribution, Normal
from mcnav.sampling.error_model import Correlation, CorrelationError, ErrorModel, JointError
from mcnav.sampling.multivariate_t import MultivariateT
from mcnav.sampling.scipy_and_tables import EmpiricalDistribution
from mcnav.store.manifest import RequirementRecord
from mcnav.store.summaries import SUMMARY
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.registry import (
    FURTHER_NAMES,
    SCENARIO_TYPES,
    ScenarioSpec,
    further_tables,
    is_code,
    scenario_type,
)  # fmt: skip

UNNAMED: Final = "campaign"
"""Name of a campaign without a file, and of its file in messages."""

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


def campaign_from(
    described: str | Path | Campaign | Mapping[str, Any], overrides: Mapping[str, Any] | None = None
) -> Campaign:
    """Return the campaign of a file, a `Campaign`, or a dictionary shaped like a file.

    Parameters
    ----------
    described : str, Path, Campaign or mapping
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
    if isinstance(described, Mapping):
        return parse_campaign(load_mapping(described, UNNAMED), UNNAMED, UNNAMED, overrides)
    return read_campaign(Path(described), overrides)


def parse_campaign(
    content: Mapping[str, Any],
    file: str,
    stem: str,
    overrides: Mapping[str, Any] | None = None,
    earlier: Mapping[str, EarlierFile] | None = None,
    confined: bool = False,
) -> Campaign:
    """Check the content of a campaign file and build the campaign; see `read_campaign`."""
    content = {**content, **(overrides or {})}
    context = FileContext(file, Path(file).parent, earlier or {}, content, confined)
    table = validate(CampaignFile, content, context)
    described, sources = _read_scenario(content.get("scenario"), context)
    distributions = _read_distributions(described, sources, context)
    if described is not None:
        _check_use(described, context)
    if table is None or sources is None:
        raise context.error()
    check_stored_samples(table, context)
    correlations = read_correlations(table.correlations, sources, context)
    joint = read_joint(table.joint, sources, context)
    requirements: list[RequirementRecord] = []
    if table.accept is not None and described is not None:
        if is_ins(described.scenario):
            described = replace(described, scenario=with_epochs(described.scenario, table.accept))
        requirements = read_requirements(table.accept, described.scenario, context)
    until = None
    if isinstance(table.samples, UntilTable):
        until = read_stopping_rule(table.samples, str(table.design), context)
    if isinstance(table.samples, UntilTable) and table.store == SUMMARY:
        context.problem("samples.until", "needs store = 'samples': the blocks of a summary are fixed for one size")
    model = None if context.problems else _error_model(sources, distributions, correlations, joint, context)
    if described is None:
        raise context.error()
    if "start_times" in content:
        _check_start_times(described.scenario, str(table.start_times.axes), context)
    start_times = read_start_times(table.start_times, sources, described.scenario.outputs, distributions, context)
    if model is None or context.problems:
        raise context.error()
    if described.complete is not None:
        described = replace(described, scenario=described.complete(described.scenario, model))
    columns = {
        source.name: stored_table(source, each)
        for source in sources
        if isinstance(each := distributions.get(source.name), EmpiricalDistribution)
    }
    return _campaign(table, stem, described, model, until, requirements, start_times, columns, context)


def _read_distributions(
    described: ScenarioSpec | None, sources: Sequence[Source] | None, context: FileContext
) -> dict[str, Distribution]:
    """Read the distributions of ``[errors]``, and those that other tables give; mistakes are added to the context."""
    entries, distributions = context.content.get("errors"), dict[str, Distribution]()
    if isinstance(entries, dict) and sources is not None:
        distributions = read_errors(entries, sources, context)
    if described is None:
        return distributions
    for name in described.sigmas.keys() & distributions.keys():
        context.problem(f"errors.{name}", f"is given in {described.tables[name]} as well; keep one")
    return {**{name: Normal(sigma) for name, sigma in described.sigmas.items()}, **distributions}


def _check_use(described: ScenarioSpec, context: FileContext) -> None:
    """Add mistakes about what the file has, and this scenario cannot use."""
    content, scenario = context.content, described.scenario
    if content.get("design") == "sobol" and can_have_noise(scenario) and scenario.noisy:
        context.problem("design", "got 'sobol'; a net has no place for noise, so choose another design")
    kind = scenario_type(content["scenario"]["type"])
    for name in FURTHER_NAMES:
        if name in content and kind is not None and name not in kind.tables:
            context.problem(name, f"{further_tables()[name].absent}; leave it out")
    for name, further in () if kind is None else kind.tables.items():
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


def _campaign(
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


def _check_start_times(scenario: Scenario, axes: str, context: FileContext) -> None:
    """Refuse ``[start_times]`` where the start cannot be chosen."""
    if not has_start_times(scenario):
        context.problem("start_times", "this scenario has no start times to choose from; leave it out")
        return
    try:
        scenario.check_start_axes(axes)
    except ScenarioError as wrong:
        context.problem("start_times.axes" if wrong.key == "axes" else "start_times", str(wrong))


def _read_scenario(entries: Any, context: FileContext) -> tuple[ScenarioSpec | None, Sequence[Source] | None]:
    """Read the scenario, and the sources that ``[errors]`` may name; mistakes are added to the context."""
    if not isinstance(entries, dict):
        return None, None  # the validation of the whole file reports it
    kind = scenario_type(entries.get("type"))
    if kind is None:
        known = f"{', '.join(SCENARIO_TYPES)}, or a file and class such as 'my_module.py:Boost'"
        came = f"got {entries['type']!r}; expected" if "type" in entries else "is missing; it is"
        context.problem("scenario.type", f"{came} one of {known}")
        return None, None
    table = validate(kind.table, entries, context, "scenario")
    if table is None:
        for name, further in kind.tables.items():
            if name in context.content:
                validate_entry(TypeAdapter(further.form), context.content[name], context, name)
        return None, kind.sources
    before = len(context.problems)
    try:
        described = kind.read(table, entries, context)
    except ScenarioError as wrong:
        context.problem(f"scenario.{wrong.key}", str(wrong))
        described = None
    if described is not None and (lines := lacks_scenario(described.scenario)):
        for line in lines:
            context.problem("scenario.type", line)
        described = None
    if len(context.problems) > before and any(
        table.source_patterns for name, table in kind.tables.items() if name in context.content
    ):
        return described, None  # sources of sensors are not known
    return described, kind.sources if described is None else described.scenario.sources


def _resolve(content: Mapping[str, Any], table: CampaignTable, name: str, described: ScenarioSpec) -> Content:
    """Return the entries of the file with all defaults; numbers keep their full precision."""
    resolved = {
        "name": name,
        "samples": content["samples"] if isinstance(table.samples, UntilTable) else table.samples,
        "seed": table.seed,
        "design": str(table.design),
        "tolerance": content.get("tolerance", table.tolerance),
        "confidence": content.get("confidence", table.confidence),
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
