"""Campaigns from files and dictionaries: a `Campaign`, or a list of all mistakes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from mcnav.config.campaign import Campaign, check_stored_samples
from mcnav.config.empirical import stored_table
from mcnav.config.requirement_times import with_epochs
from mcnav.config.requirements import read_requirements
from mcnav.config.schema import CampaignTable, UntilTable
from mcnav.config.sources import expand_groups, read_correlations, read_errors, read_joint
from mcnav.config.start_times import read_start_times
from mcnav.config.stopping import read_stopping_rule
from mcnav.config.toml import load_file, load_mapping
from mcnav.contract.quantities import Source
from mcnav.contract.scenario import Scenario, ScenarioError, can_have_noise, has_start_times
from mcnav.entries.context import EarlierFile, FileContext
from mcnav.entries.validation import validate
from mcnav.errors import CampaignError, Problem
from mcnav.sampling.distributions import Distribution, Normal
from mcnav.sampling.error_model import CorrelationError, ErrorModel, JointError
from mcnav.sampling.scipy_and_tables import EmpiricalDistribution
from mcnav.store.manifest import RequirementRecord
from mcnav.store.summaries import SUMMARY
from mcnav.systems.ins.scenario import is_ins
from mcnav.systems.registry import SCENARIO_TYPES, USER, ScenarioSpec, scenario_type

FURTHER_TABLES: Final = {
    "imu": "this scenario has no inertial measurement unit",
    "aiding": "this scenario cannot be aided, which those of type ins can",
    "filter": "this scenario cannot be aided, which those of type ins can",
    "processes": "this scenario has no processes of its own, which closed loops have",
    "measurements": "this scenario has no measurements of its own, which closed loops have",
}
"""Tables besides ``[scenario]`` that some types read, and what is wrong with one where the type does not."""


UNNAMED: Final = "campaign"
"""Name of a campaign without a file, and of its file in messages."""

__all__ = ["Campaign", "campaign_from", "parse_campaign", "read_campaign"]


def read_campaign(
    path: Path,
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
    content = load_file(path)
    entries = content.get("scenario")
    kind = entries.get("type") if isinstance(entries, dict) else None
    if not execute and scenario_type(kind) is USER:
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
    rule: UntilTable | None = None
    plain = content
    if isinstance(content.get("samples"), dict):
        rule = validate(UntilTable, content["samples"], context, "samples")
        plain = {**content, "samples": rule.at_most if rule else 2}
    table = validate(CampaignTable, plain, context)
    described, sources = _read_scenario(content.get("scenario"), context)
    distributions: dict[str, Distribution] = {}
    if isinstance(content.get("errors"), dict) and sources is not None:
        distributions = read_errors(expand_groups(content["errors"], sources), sources, context)
    sigmas = {} if described is None else described.sigmas
    for name in sigmas.keys() & distributions.keys():
        other = "another table" if described is None else described.tables[name]
        context.problem(f"errors.{name}", f"is given in {other} as well; keep one")
    distributions = {**{name: Normal(sigma) for name, sigma in sigmas.items()}, **distributions}
    if (
        described is not None
        and can_have_noise(described.scenario)
        and described.scenario.noisy
        and content.get("design") == "sobol"
    ):
        context.problem("design", "got 'sobol'; a net has no place for noise, so choose another design")
    if described is not None:
        read = scenario_type(content["scenario"]["type"])
        for name, why in FURTHER_TABLES.items():
            if name in content and read is not None and name not in read.tables:
                context.problem(name, f"{why}; leave it out")
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
    until = read_stopping_rule(rule, str(table.design), context) if rule else None
    if rule and table.store == SUMMARY:
        context.problem("samples.until", "needs store = 'samples': the blocks of a summary are fixed for one size")
    model: ErrorModel | None = None
    if not context.problems:
        try:
            later = [source.name for source in sources if source.later]
            model = ErrorModel([source.name for source in sources], distributions, correlations, joint, later)
        except CorrelationError as wrong:
            context.problem("correlations" + ("" if wrong.entry is None else f" #{wrong.entry + 1}"), str(wrong))
        except JointError as wrong:
            context.problem(f"joint #{wrong.entry + 1}.sources", str(wrong))
    if described is None:
        raise context.error()
    scenario: Scenario = described.scenario
    if "start_times" in content:
        _check_start_times(scenario, str(table.start_times.axes), context)
    start_times = read_start_times(table.start_times, sources, scenario.outputs, distributions, context)
    if model is None or context.problems:
        raise context.error()

    if described.complete is not None:
        scenario = described.complete(scenario, model)
    columns = {
        source.name: stored_table(source, each)
        for source in sources
        if isinstance(each := distributions.get(source.name), EmpiricalDistribution)
    }
    errors = {**content.get("errors", {}), **{source: dict(column.entry) for source, column in columns.items()}}
    return Campaign(
        name=table.name or stem,
        samples=table.samples,
        seed=table.seed,
        until=until,
        design=str(table.design),
        tolerance=table.tolerance,
        confidence=table.confidence,
        scenario=scenario,
        errors=model,
        requirements=tuple(requirements),
        start_times=start_times,
        tables={column.path: column.content for column in columns.values()},
        resolved=_resolve({**content, "errors": errors}, table, table.name or stem, described),
        code=described.code,
        sample_timeout=table.sample_timeout,
        store=str(table.store),
        file=file,
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
        return None, kind.sources
    before = len(context.problems)
    try:
        described = kind.read(table, entries, context)
    except ScenarioError as wrong:
        context.problem(f"scenario.{wrong.key}", str(wrong))
        described = None
    if "aiding" in context.content and len(context.problems) > before:
        return described, None  # sources of sensors are not known
    return described, kind.sources if described is None else described.scenario.sources


def _resolve(content: Mapping[str, Any], table: CampaignTable, name: str, described: ScenarioSpec) -> dict[str, Any]:
    """Return the entries of the file with all defaults; numbers keep their full precision."""
    resolved = {
        "name": name,
        "samples": content["samples"] if isinstance(content.get("samples"), dict) else table.samples,
        "seed": table.seed,
        "design": str(table.design),
        "tolerance": content.get("tolerance", table.tolerance),
        "confidence": content.get("confidence", table.confidence),
        **({"store": table.store} if table.store != "samples" else {}),
        **({"sample_timeout": content["sample_timeout"]} if "sample_timeout" in content else {}),
        "scenario": dict(described.resolved),
        **{key: content[key] for key in FURTHER_TABLES if key in content},
        "errors": content["errors"],
        "correlations": content.get("correlations", []),
        **({"joint": content["joint"]} if table.joint else {}),
        **({"start_times": content["start_times"]} if "start_times" in content else {}),
    }
    return resolved | ({"accept": content["accept"]} if table.accept else {})
