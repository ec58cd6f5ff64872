"""A campaign as the rest of the program uses it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import tomli_w

from mcnav.config.ranges import SpecRange
from mcnav.config.schema import CampaignFile, CampaignTable, UntilTable
from mcnav.config.start_times import StartTimesPlan
from mcnav.config.stopping import StoppingRule
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.entries.context import FileContext
from mcnav.entries.inputs import InputFile, SourceFile
from mcnav.entries.validation import validate
from mcnav.errors import CampaignError, Problem
from mcnav.sampler.error_model import ErrorModel
from mcnav.store.manifest import RequirementRecord
from mcnav.store.run_files import CAMPAIGN
from mcnav.systems.user.scenario import is_users

MOST_STORED: Final = 1_000_000_000
"""Samples that can be stored one by one."""


@dataclass(frozen=True)
class Campaign:
    """A campaign, read and checked.

    Attributes
    ----------
    samples, seed : int
        With a stopping rule, samples are the largest number.
    design : str
        One of `mcnav.sampler.designs.DESIGNS`.
    tolerance, confidence : float
        Criterion of agreement between linear covariance and Monte Carlo.
    start_times : StartTimesPlan
        Plan of ``mcnav sweep --vary start``; a run does not use it.
    tables : mapping of str to bytes
        Files that the resolved campaign reads, by their relative path.
    resolved : mapping
        Content of the file with every default spelled out; written as TOML it defines the same campaign.
    code : SourceFile, optional
        File of a user-defined scenario.
    sample_timeout : float, optional
        Time limit of one sample, s.
    store : str
        ``samples``: all samples are stored; ``summary``: sums for the analysis, of a size independent of their number.
    file : str
        Path of the campaign file as given, for messages.
    files : tuple of InputFile
        Files that its keys name and this program reads.
    ranges : tuple of SpecRange
        Ranges of its file, each of which is at its upper end here.
    remarks : tuple of str
        Clauses on where in a box it lies, for its results.
    content : mapping
        Content of the file as it was given, with ranges at their upper ends: of a campaign without a file.
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
    requirements: tuple[RequirementRecord, ...]
    tables: Mapping[str, bytes]
    resolved: Mapping[str, Any]
    code: SourceFile | None = None
    sample_timeout: float | None = None
    store: str = "samples"
    file: str = ""
    files: tuple[InputFile, ...] = ()
    ranges: tuple[SpecRange, ...] = ()
    remarks: tuple[str, ...] = ()
    content: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)

    def to_toml(self) -> str:
        """Write the resolved campaign as a campaign file."""
        return tomli_w.dumps(dict(self.resolved))

    def stored_files(self) -> dict[str, bytes]:
        """Return the files that define the campaign in a run folder, by their path there: campaign, tables and code."""
        code = {} if self.code is None else {self.code.file: self.code.text.encode()}
        return {**self.tables, CAMPAIGN: self.to_toml().encode(), **code}

    def inputs(self) -> tuple[InputFile, ...]:
        """Return the files that the scenario reads; a user-defined one is linearized to find them.

        Raises `CampaignError` when it cannot be linearized.
        """
        if not is_users(self.scenario):
            return self.files
        try:
            return self.scenario.inputs()
        except ScenarioError as wrong:
            raise CampaignError([Problem(self.file, f"scenario.{wrong.key}", str(wrong))]) from None

    def with_overrides(self, overrides: Mapping[str, Any]) -> Campaign:
        """Replace ``samples`` or ``seed``; files that the campaign names are not read again.

        Raises `CampaignError` when another key is given, or a value is wrong.
        """
        context = FileContext(self.file, Path())
        for key in overrides.keys() - {"samples", "seed"}:
            context.problem(key, "cannot be replaced in a Campaign; only samples and seed can")
        if context.problems:
            raise context.error()
        resolved, content = {**self.resolved, **overrides}, {**self.content, **overrides} if self.content else {}
        until = None if "samples" in overrides else self.until
        table = validate(CampaignFile, resolved if until is None else {**resolved, "samples": self.samples}, context)
        if table is not None and isinstance(table.samples, UntilTable):
            context.problem("samples", "got a table; expected a whole number")
        elif table is not None:
            check_stored_samples(table, context)
        if table is None or context.problems:
            raise context.error()
        return replace(
            self, samples=table.most_samples(), seed=table.seed, until=until, resolved=resolved, content=content
        )


def check_stored_samples(table: CampaignTable, context: FileContext) -> None:
    """Add a mistake when more samples are to be stored one by one than `MOST_STORED`."""
    if table.store == "samples" and table.most_samples() > MOST_STORED:
        context.problem("samples", f"got {table.most_samples()}; more than {MOST_STORED} need store = 'summary'")
