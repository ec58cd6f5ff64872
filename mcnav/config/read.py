"""The campaign file: TOML in, a `Campaign` or a list of all its mistakes out."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import tomli_w
from pydantic import ValidationError

from mcnav.config.empirical import resolved_table
from mcnav.config.requirements import read_requirements
from mcnav.config.scenarios import KINDS, OWN, FileContext, Kept, ScenarioSpec, ScenarioType, scenario_type
from mcnav.config.schema import (
    AcceptTable,
    BoxTable,
    CampaignTable,
    CircularTable,
    CorrelationTable,
    JointTable,
    QuantileTable,
    StartTimesTable,
    Table,
    UntilTable,
)
from mcnav.config.sources import read_correlations, read_errors, read_joint
from mcnav.config.start_times import StartTimesPlan, read_start_times
from mcnav.config.stopping import StoppingRule, read_stopping_rule
from mcnav.errors import MOST_PROBLEMS, CampaignError, Problem, suggestion
from mcnav.sampling.distributions import Distribution
from mcnav.sampling.error_model import CorrelationError, ErrorModel, JointError
from mcnav.sampling.scipy_and_tables import EmpiricalDistribution
from mcnav.scenarios.inputs import InputFile
from mcnav.scenarios.protocol import Scenario, ScenarioError, Source, VariableStart
from mcnav.scenarios.user import SourceFile, UserScenario
from mcnav.store.summaries import SUMMARY

MOST_STORED: Final = 1_000_000_000
"""Samples that may be stored one by one."""

DOTTED: Final = re.compile(rb"(?:[\w-]{1,100}[ \t]?\.[ \t]?){200}")
"""More names in one dotted key than any campaign has."""

LARGEST_FILE: Final = 1_000_000
"""Bytes; a campaign is a page of text."""

CALLED: Final = "campaign"
"""What stands for the file of a campaign that is none."""


@dataclass(frozen=True)
class Campaign:
    """A campaign, read and checked.

    Attributes
    ----------
    name : str
    samples, seed : int
        Samples at most, when ``until`` says when to stop.
    until : StoppingRule or None
    design : str
        One of `mcnav.sampling.designs.DESIGNS`.
    tolerance, confidence : float
        What counts as agreement between linear and Monte Carlo.
    sample_timeout : float or None
        Time that one sample may take, s.
    scenario : Scenario
    errors : ErrorModel
    start_times : StartTimesPlan
        What a study of start times is to do; a run takes no notice of it.
    requirements : tuple of mapping
        Of ``[accept]``; see `mcnav.config.requirements.read_requirements`.
    tables : mapping of str to bytes
        Files that the resolved campaign reads, by their path beside it.
    resolved : mapping
        The file's content with every default spelled out; written as TOML it runs the same campaign again.
    code : Code, optional
        The file of the user's own that the scenario is made of.
    store : str
        ``samples``: every sample is stored. ``summary``: what the analysis needs, bounded whatever their number.
    file : str
        Path of the campaign file as it was given, for messages.
    """

    name: str
    samples: int
    seed: int
    until: StoppingRule | None
    design: str
    tolerance: float
    confidence: float
    scenario: Scenario
    errors: ErrorModel
    start_times: StartTimesPlan
    requirements: tuple[Mapping[str, Any], ...]
    tables: Mapping[str, bytes]
    resolved: Mapping[str, Any]
    code: SourceFile | None = None
    sample_timeout: float | None = None
    store: str = "samples"
    file: str = ""

    def to_toml(self) -> str:
        """The resolved campaign as a file."""
        return tomli_w.dumps(dict(self.resolved))

    def inputs(self) -> tuple[InputFile, ...]:
        """Files that a scenario of the user's own reads; it is linearised to find them.

        Raises
        ------
        CampaignError
            When it cannot be linearised.
        """
        if not isinstance(self.scenario, UserScenario):
            return ()
        try:
            return self.scenario.inputs()
        except ScenarioError as wrong:
            raise CampaignError([Problem(self.name, f"scenario.{wrong.key}", str(wrong))]) from None


def read_campaign(
    path: Path,
    overrides: Mapping[str, Any] | None = None,
    execute: bool = True,
    kept: Mapping[str, Kept] | None = None,
) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    path : Path
    overrides : mapping, optional
        Top-level entries that take the place of the file's.
    execute : bool
        Whether a scenario of the user's own, which is code, may be executed.
    kept : mapping of str to Kept, optional
        Files of an earlier run by the setting that names them; they take the place of files that changed since.

    Raises
    ------
    CampaignError
        With every mistake that was found.
    """
    content = _load(path)
    entries = content.get("scenario")
    kind = entries.get("type") if isinstance(entries, dict) else None
    if not execute and scenario_type(kind) is OWN:
        message = f"got {kind!r}, which is code; nothing in a run folder is executed, so name the run's --campaign"
        raise CampaignError([Problem(str(path), "scenario.type", message)])
    return parse_campaign(content, str(path), path.stem, overrides, kept)


def campaign_from(
    described: str | Path | Campaign | Mapping[str, Any], overrides: Mapping[str, Any] | None = None
) -> Campaign:
    """Take a campaign as a file, as one already read, or as a dictionary of a file's shape.

    Parameters
    ----------
    described : str, Path, Campaign or mapping
        Files that a mapping names are found from the current folder; its mistakes are those of ``campaign``.
    overrides : mapping, optional
        Top-level entries that take the place of those described; of a `Campaign`, ``samples`` and ``seed``.

    Raises
    ------
    CampaignError
        With every mistake that was found.
    """
    if isinstance(described, Campaign):
        return _changed(described, overrides) if overrides else described
    if isinstance(described, Mapping):
        return parse_campaign(_as_file(described), CALLED, CALLED, overrides)
    return read_campaign(Path(described), overrides)


def _as_file(described: Mapping[str, Any]) -> dict[str, Any]:
    """What a file of a mapping would say."""
    try:
        return tomllib.loads(tomli_w.dumps(described))
    except (TypeError, ValueError, RecursionError) as failure:
        words = f"holds what no campaign file can ({failure}); use text, numbers, true or false, lists and dictionaries"
        raise CampaignError([Problem(CALLED, "", words)]) from None


def _changed(campaign: Campaign, overrides: Mapping[str, Any]) -> Campaign:
    """Put other samples or another seed into a campaign; the files it names are not read again."""
    unknown = [
        Problem(campaign.name, key, "cannot take the place of a Campaign's; samples and seed can")
        for key in overrides.keys() - {"samples", "seed"}
    ]
    if unknown:
        raise CampaignError(unknown)
    resolved = {**campaign.resolved, **overrides}
    until = None if "samples" in overrides else campaign.until
    try:
        table = CampaignTable.model_validate(resolved if until is None else {**resolved, "samples": campaign.samples})
    except ValidationError as invalid:
        raise CampaignError(
            [_problem(campaign.name, dict(error), CampaignTable) for error in _first(invalid)]
        ) from None
    if table.store == "samples" and table.samples > MOST_STORED:
        raise CampaignError([Problem(campaign.name, "samples", _too_many(table.samples))])
    return replace(campaign, samples=table.samples, seed=table.seed, until=until, resolved=resolved)


def _too_many(samples: int) -> str:
    return f"got {samples}; more than {MOST_STORED} need store = 'summary'"


def _load(path: Path) -> dict[str, Any]:
    def problem(message: str) -> CampaignError:
        return CampaignError([Problem(str(path), "", message)])

    try:
        if path.is_dir():
            raise problem("is a folder; expected a campaign file in TOML")
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise problem(f"is larger than the {LARGEST_FILE} bytes that a campaign file has at most")
        if DOTTED.search(content):
            raise ValueError  # the parser takes the square of their number
        return tomllib.loads(content.decode("utf-8-sig"))
    except FileNotFoundError:
        raise problem("no such file; expected a campaign file in TOML") from None
    except OSError as failure:
        raise problem(f"cannot be read: {failure.strerror or failure}") from None
    except UnicodeDecodeError as failure:
        raise problem(f"is not UTF-8 text (byte {failure.start})") from None
    except tomllib.TOMLDecodeError as failure:
        raise problem(f"is not TOML: {failure}") from None
    except (RecursionError, ValueError):
        raise problem(
            "is not TOML that can be read: it is nested too deeply, or holds a number of too many digits"
        ) from None


def parse_campaign(
    content: Mapping[str, Any],
    file: str,
    stem: str,
    overrides: Mapping[str, Any] | None = None,
    kept: Mapping[str, Kept] | None = None,
) -> Campaign:
    """Check the content of a campaign file and build what it describes; see `read_campaign`."""
    content = {**content, **(overrides or {})}
    problems: list[Problem] = []
    table: CampaignTable | None = None
    stop: UntilTable | None = None
    plain = dict(content)
    if isinstance(content.get("samples"), dict):
        plain["samples"] = 2
        try:
            stop = UntilTable.model_validate(content["samples"])
            plain["samples"] = stop.at_most
        except ValidationError as invalid:
            found = invalid.errors(include_url=False)
            problems += [
                _problem(file, {**dict(error), "loc": ("samples", *error["loc"])}, CampaignTable) for error in found
            ]
    try:
        table = CampaignTable.model_validate(plain)
    except ValidationError as invalid:
        problems += [_problem(file, dict(error), CampaignTable) for error in _first(invalid)]

    described, sources = _read_scenario(
        content.get("scenario"), FileContext(file, Path(file).parent, kept or {}), problems
    )
    entries = content.get("errors", {})
    distributions: dict[str, Distribution] = {}
    if isinstance(entries, dict) and sources is not None:
        distributions = read_errors(entries, file, sources, problems)
    if table is None or sources is None:
        raise CampaignError(problems)

    if table.store == "samples" and table.samples > MOST_STORED:
        problems.append(Problem(file, "samples", _too_many(table.samples)))
    correlations = read_correlations(table.correlations, file, sources, problems)
    joint = read_joint(table.joint, file, sources, problems)
    requirements = _read_requirements(table, file, described, problems)
    until = read_stopping_rule(stop, str(table.design), file, problems) if stop else None
    if stop and table.store == SUMMARY:
        problems.append(
            Problem(file, "samples.until", "needs store = 'samples': a summary's blocks are laid down for one size")
        )
    model: ErrorModel | None = None
    if not problems:
        try:
            later = [source.name for source in sources if source.later]
            model = ErrorModel([source.name for source in sources], distributions, correlations, joint, later)
        except CorrelationError as wrong:
            key = "correlations" if wrong.entry is None else f"correlations #{wrong.entry + 1}"
            problems.append(Problem(file, key, str(wrong)))
        except JointError as wrong:
            problems.append(Problem(file, f"joint #{wrong.entry + 1}.sources", str(wrong)))
    start_times = _read_start_times(content, table, file, described, distributions, problems)
    if problems or model is None or described is None:
        raise CampaignError(problems)
    name = table.name or stem
    scenario = described.scenario
    columns = {
        source.name: resolved_table(source, each)
        for source in sources
        if isinstance(each := distributions.get(source.name), EmpiricalDistribution)
    }
    resolved = _resolved(content, table, name, described)
    resolved["errors"] = {**resolved["errors"], **{source: entry for source, (entry, _, _) in columns.items()}}
    return Campaign(
        name=name,
        samples=table.samples,
        seed=table.seed,
        until=until,
        design=str(table.design),
        tolerance=table.tolerance,
        confidence=table.confidence,
        scenario=scenario.with_sigmas(model.standard_deviations) if isinstance(scenario, UserScenario) else scenario,
        errors=model,
        requirements=tuple(requirements),
        start_times=start_times,
        tables={path: written for _, path, written in columns.values()},
        resolved=resolved,
        code=described.code,
        sample_timeout=table.sample_timeout,
        store=str(table.store),
        file=file,
    )


def _read_requirements(
    table: CampaignTable, file: str, described: ScenarioSpec | None, problems: list[Problem]
) -> list[Mapping[str, Any]]:
    """The requirements of ``[accept]``, when the outputs are known that they speak of."""
    if table.accept is None or described is None:
        return []
    return read_requirements(table.accept, file, described.scenario.outputs, problems)


def _read_start_times(
    content: Mapping[str, Any],
    table: CampaignTable,
    file: str,
    described: ScenarioSpec | None,
    distributions: Mapping[str, Distribution],
    problems: list[Problem],
) -> StartTimesPlan:
    """The plan for a study of start times; one of a scenario that has none must not be asked for."""
    if described is None:
        return read_start_times(table.start_times, file, (), (), distributions, [])
    if "start_times" in content and not isinstance(described.scenario, VariableStart):
        problems.append(Problem(file, "start_times", "this scenario has no start times to choose from; leave it out"))
    sources, outputs = described.scenario.sources, described.scenario.outputs
    return read_start_times(table.start_times, file, sources, outputs, distributions, problems)


def _read_scenario(
    entries: Any, place: FileContext, problems: list[Problem]
) -> tuple[ScenarioSpec | None, Sequence[Source] | None]:
    """The scenario, and the sources that ``[errors]`` may name; mistakes are added to the list."""
    file = place.file
    if not isinstance(entries, dict):
        return None, None  # said already, of the whole file
    kind: ScenarioType | None = scenario_type(entries.get("type"))
    if kind is None:
        known = f"{', '.join(KINDS)}, or a file and class such as 'my_module.py:Boost'"
        came = f"got {entries['type']!r}; expected" if "type" in entries else "is missing; it is"
        problems.append(Problem(file, "scenario.type", f"{came} one of {known}"))
        return None, None
    try:
        table = kind.table.model_validate(entries)
    except ValidationError as invalid:
        for error in _first(invalid):
            found: dict[str, Any] = {**error, "loc": ("scenario", *error["loc"])}
            problems.append(_problem(file, found, kind.table))
        return None, kind.sources
    described = kind.describe(table, entries, place, problems)
    return described, kind.sources if described is None else described.scenario.sources


def _first(invalid: ValidationError) -> Sequence[Any]:
    """As many of pydantic's findings as are told."""
    return invalid.errors(include_url=False)[: MOST_PROBLEMS + 1]


_WORDS: Final = {
    "int_type": "expected a whole number",
    "string_type": "expected text in quotes",
    "string_pattern_mismatch": "expected some text without control characters",
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "list_type": "expected a list",
    "model_attributes_type": "expected a table with a type",
    "union_tag_not_found": "expected a table with a type",
}
"""Pydantic's findings whose own words speak of Python rather than of the file."""


def _problem(file: str, error: dict[str, Any], table: type[Table]) -> Problem:
    """One of pydantic's findings on a table in our words."""
    location = [part for part in error["loc"] if part not in ("constant", "variable")]
    key = ""
    for part in location:
        key += f" #{part + 1}" if isinstance(part, int) else f"{'.' if key else ''}{part}"
    came, kind = error["input"], error["type"]
    if kind == "extra_forbidden":
        return Problem(file, key, f"unknown key{suggestion(str(location[-1]), _known_keys(location, table))}")
    if kind == "missing":
        return Problem(file, key, "is missing")
    message = _WORDS.get(kind, str(error["msg"]).removeprefix("Value error, "))
    if kind == "value_error":
        return Problem(file, key, message)
    if kind in ("too_short", "too_long"):
        return Problem(file, key, f"got {len(came)} names; expected two")
    shown = repr(came) if not isinstance(came, (dict, list)) else ("a table" if isinstance(came, dict) else "a list")
    if len(shown) > 80:
        shown = shown[:77] + "..."
    message = re.sub(r"^[Ii]nput should be (?=greater|less)", "expected a number ", message)
    message = re.sub(r"^[Ii]nput should be ", "expected ", message)
    return Problem(file, key, f"got {shown}; {message[0].lower()}{message[1:]}")


_INSIDE: Final[Mapping[tuple[str, ...], type[Table]]] = {
    (): CampaignTable,
    ("samples",): UntilTable,
    ("start_times",): StartTimesTable,
    ("accept",): AcceptTable,
    ("accept", "quantile"): QuantileTable,
    ("accept", "cep"): CircularTable,
    ("accept", "box"): BoxTable,
    ("correlations",): CorrelationTable,
    ("joint",): JointTable,
}
"""Tables of the whole file by the names that lead to them."""


def _known_keys(location: Sequence[str | int], table: type[Table]) -> list[str]:
    """The keys that could have stood where an unknown one did; none for a table inside a scenario's."""
    path = tuple(part for part in location[:-1] if isinstance(part, str))
    inside = _INSIDE.get(path) if table is CampaignTable else table if path == ("scenario",) else None
    return list(inside.model_fields) if inside is not None else []


def _resolved(content: Mapping[str, Any], table: CampaignTable, name: str, described: ScenarioSpec) -> dict[str, Any]:
    """The file's own entries with the defaults beside them; numbers as Python prints them, so that nothing is lost."""
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
        "errors": content.get("errors", {}),
        "correlations": content.get("correlations", []),
        **({"joint": content["joint"]} if table.joint else {}),
        **({"start_times": content["start_times"]} if "start_times" in content else {}),
    }
    return resolved | ({"accept": content["accept"]} if table.accept else {})
