"""The command that one would type next, after each command, with the paths at hand."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

from mcnav.execution.shell import join_words, quote_word

if TYPE_CHECKING:
    from mcnav.analysis.allocation import Allocation
    from mcnav.analysis.linear_answer import LinearAnswer
    from mcnav.analysis.summary import Summary


def written(*words: object) -> str:
    """Write a command as a shell reads it.

    >>> written("run", Path("my campaigns/mine.toml"))
    "mcnav run 'my campaigns/mine.toml'"
    """
    return join_words(["mcnav", *map(str, words)])


def program() -> str:
    """Return what one types for mcnav: its name, or its path where the shell does not find it by name."""
    called = Path(sys.argv[0])
    if called.stem != "mcnav" or shutil.which("mcnav") is not None:
        return "mcnav"
    return quote_word(os.path.relpath(called))


def after_run(campaign: Path, folder: Path, summary: Summary, reported: bool, opened: bool) -> str:
    """Return the command after a run: more samples, or other numbers, where a requirement asks for them; or the report.

    Parameters
    ----------
    reported, opened : bool
        Whether the report is written, and shown.
    """
    from mcnav.statistics.power import sensible_step

    if not reported:
        return written("report", folder, "--open")
    findings = {entry.finding for entry in summary.requirements}
    if "not met" in findings:
        return written("allocate", campaign)
    needed = [entry.samples_needed for entry in summary.requirements if entry.finding == "undecided"]
    if "undecided" in findings and all(needed):
        most = max(count for count in needed if count is not None)
        return written(
            "run",
            campaign,
            "--samples",
            sensible_step(most, summary.samples),
            *_into(folder, Path("reports") / campaign.stem),
        )
    return written("show", folder, "--table", "budget") if opened else written("report", folder, "--open")


def _into(folder: Path, default: Path) -> Sequence[object]:
    return () if folder == default else ("--out", folder)


def after_show(folder: Path, table: str | None) -> str:
    """Return the command after a look at a run, or at one table of it: the report, or all tables as files."""
    return written("report", folder, "--open") if table is None else written("export", folder)


def after_comparison(folders: Sequence[Path], page: Path | None) -> str:
    """Return the command after a comparison: its page, or the list of the runs."""
    if page is None:
        return written("compare", *folders, "--out", folders[0].parent)
    return written("report", "--index", folders[0].parent)


def after_index(runs: Sequence[Path]) -> str:
    """Return the command after a list of runs: a comparison of two of one scenario, or else the latest run."""
    if len(runs) > 1:
        return written("compare", *runs[:2])
    return written("show", runs[0]) if runs else written("demo", "--list")


def after_lincov(campaign: Path, answer: LinearAnswer) -> str:
    """Return the command after linear covariance: numbers that meet a requirement that is not met; or a simulation."""
    missed = answer.beyond is None and not answer.met
    return written("allocate" if missed else "run", campaign)


def after_allocation(campaign: Path, result: Allocation) -> str:
    """Return the command after an allocation: the smallest change that a sweep makes, or else a run."""
    change = next((change for goal in result.goals for change in goal.changes if change.swept), None)
    if change is None:
        return written("run", campaign)
    return written("sweep", campaign, "--vary", f"{change.paths[0]}={change.swept}", "--confirm", 2)


def after_sweep(campaign: Path, folder: Path, vary: Sequence[str], against: Sequence[str], confirm: int | None) -> str:
    """Return the command after a sweep: some of its points by Monte Carlo, or the runs of those."""
    if confirm:
        return written("report", "--index", folder)
    words: list[object] = ["sweep", campaign]
    for option, values in (("--vary", vary), ("--against", against)):
        for value in values:
            words += [option, value]
    counts = [10_000 if ".." in values else values.count(",") + 1 for values in vary]
    points = min(max(3, 2 ** len(counts)), prod(counts))
    return written(*words, "--confirm", points, *_into(folder, Path("reports") / f"{campaign.stem}_sweep"))


def after_recording(campaign: Path, files: Sequence[Path]) -> str:
    """Return the command after a record of a sample: its judgement."""
    imu, *others = files
    tracks = {"reference", "start"}
    words: list[object] = ["judge", campaign, "--imu", imu]
    for file in others:
        name = file.stem
        words += [f"--{name}", file] if name in tracks else ["--measurements", f"{name}={file}"]
    return written(*words)


def after_judgement(campaign: Path | None) -> str:
    """Return the command after a judgement: linear covariance of the campaign, or how errors alone are judged."""
    return written("docs", "howto-judge") if campaign is None else written("lincov", campaign)


def after_check(file: Path, campaign: Path | None, passed: bool) -> str:
    """Return the command after a check: its campaign, or the page on what is asked of it."""
    code = file.suffix in (".toml", ".py")
    if not passed:
        return written("docs", "scenarios" if code else "trajectories")
    if campaign is not None:
        return written("run", campaign)
    return written("docs", "scenarios") if code else after_trajectory(file)


def after_trajectory(file: Path) -> str:
    """Return the command after the description of a trajectory: a campaign that flies it."""
    if file.suffix == ".toml":
        return written("lincov", file)
    return written("new", "ins", file.with_suffix("").name, "--out", file.parent, "--trajectory", file)


def after_identification(logs: Sequence[Path], folder: Path | None, campaign: Path | None) -> str:
    """Return the command after an identification: its files, or linear covariance with what is known of a unit."""
    if folder is None:
        return written("identify", *logs, "--out", Path("reports") / f"{logs[0].stem}_identify")
    return written("docs", "howto-instruments") if campaign is None else written("lincov", campaign)
