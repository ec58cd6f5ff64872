"""Check a file before it is used: a campaign, the code of scenarios, or a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcnav.analysis.heading import heading_remark
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.config.toml import load_file
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError, Problem
from mcnav.execution.threads import one_thread
from mcnav.statistics.demonstration import runs_to_show
from mcnav.systems.user.code import classes_in
from mcnav.systems.user.conformance import Check, check_conformance
from mcnav.systems.user.table import read_code
from mcnav.workflow.cost import cost_check
from mcnav.workflow.trajectory import describe_file

CAMPAIGN, CODE = ".toml", ".py"


@dataclass(frozen=True)
class Checked:
    """Result of a check: what was checked, its checks, and the campaign that it can be run by, if there is one."""

    title: str
    checks: list[Check]
    campaign: Path | None = None


def check_any(path: Path, columns: Mapping[str, str] | None = None) -> list[Checked]:
    """Check a campaign, the code of scenarios, or a trajectory, as the ending of the file says.

    Parameters
    ----------
    columns : mapping of str to str, optional
        Columns of a trajectory file, by the names that mcnav has for them.

    Returns
    -------
    list of Checked
        One for a campaign and a trajectory, one for each class of a file with code.

    Raises
    ------
    CampaignError
        When the file cannot be read.
    """
    if columns and path.suffix in (CAMPAIGN, CODE):
        raise CampaignError([Problem("--column", "", f"{path} is no trajectory file; leave it out")])
    with one_thread():
        if path.suffix == CAMPAIGN:
            return [Checked(f"Checks of the campaign {path}", _campaign_checks(read_campaign(path)), path)]
        return _code_checks(path) if path.suffix == CODE else [_check_trajectory(path, columns)]


def _campaign_checks(campaign: Campaign) -> list[Check]:
    """Check a campaign that could be read, and its scenario with its errors."""
    asked = len(campaign.requirements)
    told = [f"{asked} requirement{'' if asked == 1 else 's'}", *by_counting(campaign)]
    read = Check("keys and values", True, "; ".join(told))
    return [read, *_scenario_checks(campaign)]


def _scenario_checks(campaign: Campaign) -> list[Check]:
    """Check a scenario with the errors of a campaign, and tell what a run costs where nothing is wrong."""
    checks = check_conformance(campaign.scenario, campaign.errors.standard_deviations, thorough=False)
    if not all(check.passed for check in checks):
        return checks
    return [*checks, *cost_check(campaign.scenario, campaign.errors, campaign.samples)]


def by_counting(campaign: Campaign) -> list[str]:
    """Say what counting takes of the requirement that allows the least beyond its limit, where the samples are fewer.

    None without requirements on a probability at the end.
    """
    asked = [0.5 if requirement.probability is None else requirement.probability
             for requirement in campaign.requirements
             if requirement.kind != "sigma_ratio" and not requirement.epochs]  # fmt: skip
    largest = max(asked, default=0.0)
    runs = runs_to_show(largest, campaign.confidence) if 0.0 < largest < 1.0 else 0
    if runs is not None and runs <= campaign.samples:
        return []
    takes = "more than a billion samples" if runs is None else f"{runs:,} samples"
    return [
        f"to show {100.0 * largest:.12g} % by counting takes {takes} with none beyond; there are {campaign.samples:,}"
    ]


def _code_checks(path: Path) -> list[Checked]:
    """Check every scenario class of a file, with the campaign beside it that names the class, if there is one."""
    try:
        names = classes_in(read_code(path))
    except ScenarioError as wrong:
        raise CampaignError([Problem(str(path), "", str(wrong))]) from None
    if not names:
        message = "has no class with a method propagate, fly or rates; mcnav new scenario NAME writes one"
        raise CampaignError([Problem(str(path), "", message)])
    campaigns = _campaigns_beside(path)
    return [_check_class(path, name, campaigns.get(f"{path.name}:{name}")) for name in names]


def _campaigns_beside(path: Path) -> dict[str, Path]:
    """Return the first campaign of each type of scenario in a file's folder."""
    result = dict[str, Path]()
    for file in sorted(path.parent.glob(f"*{CAMPAIGN}")):
        try:
            scenario = load_file(file).get("scenario")
        except CampaignError:
            continue  # it is not what is checked here
        if isinstance(scenario, Mapping):
            result.setdefault(str(scenario.get("type")), file)
    return result


def _check_class(path: Path, name: str, campaign: Path | None) -> Checked:
    """Check a class with the sizes of a campaign; without one, with usual sizes and no noise."""
    title = f"Checks of the class {name} of {path}"
    if campaign is not None:
        return Checked(f"{title}, with {campaign}", _campaign_checks(read_campaign(campaign)), campaign)
    described = {"name": name, "scenario": {"type": f"{path.name}:{name}"}, "errors": {}}
    try:
        read = parse_campaign(described, str(path), path.stem)
    except (CampaignError, ScenarioError) as wrong:
        return Checked(title, [Check("contract", False, line) for line in str(wrong).splitlines()])
    return Checked(title, _scenario_checks(read))


def _check_trajectory(path: Path, columns: Mapping[str, str] | None) -> Checked:
    """Check a trajectory that could be read: its rows, its spline, its velocities, its heading."""
    report = describe_file(path, columns)
    times, steps = report.times, np.diff(report.times)
    checks = [
        Check("rows", True, f"{len(times):,}, from {times[0]:,.6g} s to {times[-1]:,.6g} s"),
        Check("steps", True, f"median {np.median(steps):.6g} s, longest {steps.max():.6g} s"),
    ]
    if report.departure is not None:
        checks.append(Check("spline through positions", True, f"within {report.departure:.3g} m"))
    if report.disagreement_rms is not None:
        checks.append(Check("velocities and positions", True, f"agree to {report.disagreement_rms:.3g} m/s (rms)"))
    remark = heading_remark(report.history)
    checks.append(Check("heading and track", not remark, remark or "belong together"))
    return Checked(f"Checks of the trajectory {path}", checks)
