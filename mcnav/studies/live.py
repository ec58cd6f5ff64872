"""A campaign that is changed and answered again and again: its file is watched, and settings are kept side by side."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final

import tomli_w

from mcnav.config.data_sheet import DataSheetNumber, data_sheet_numbers
from mcnav.config.overrides import Value, override, parse_document
from mcnav.config.ranges import SpecRange
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.config.toml import Content
from mcnav.errors import CampaignError, Problem
from mcnav.report.document.html import page_html
from mcnav.report.pages.live import Setting, live_page, live_state
from mcnav.store.run_files import REPORT
from mcnav.studies.boxed_run import at_worst
from mcnav.studies.changeable_content import changeable_content
from mcnav.studies.lincov import Changeable, lincov_page
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.live_run import REFUSED, RunningCampaign, in_one_line
from mcnav.studies.shared_derivatives import SharedDerivatives

MOST: Final = 6
"""Settings that are kept besides the campaign itself."""

READINGS: Final = 3
"""Times that a file is read which is written meanwhile."""

CHANGED: Final = "the file has changed in the meantime"
"""Reason why a setting of an earlier content of the file is refused."""


@dataclass(frozen=True)
class _Tried:
    """A setting with the campaign that it is, the entries of that campaign, and its run, if there is one."""

    setting: Setting
    campaign: Campaign
    content: Content
    run: RunningCampaign | None = None


class LiveCampaign:
    """A campaign's file, the linear answers to it and to settings of its numbers, and Monte Carlo runs of these.

    Raises `CampaignError` where the file cannot be answered at first; later its mistakes are told by `state`.

    Parameters
    ----------
    file : Path
        Campaign file.
    folder : Path
        Folder in which run folders are made, one a setting, named by its content.
    jobs : int
        Workers of a run.
    """

    def __init__(self, file: Path, folder: Path, jobs: int) -> None:
        self._file, self._folder, self._jobs = file, folder, jobs
        self._inputs: tuple[Path, ...] = ()
        self._ranges: tuple[SpecRange, ...] = ()
        self._error, self._revision = "", 0
        self._counted, self._tuned = 0, 0
        self._tried: list[_Tried] = []
        self._answer()
        self._seen = self._signature()

    def watch(self) -> None:
        """Answer again if the file, or one that it names, has changed; a mistake leaves the last answer standing.

        A file that is written while it is read is read again, at once or the next time.
        """
        for _ in range(READINGS):
            before = self._signature()
            if before == self._seen:
                return
            self._error = ""
            try:
                self._answer()
            except REFUSED as wrong:
                self._error = in_one_line(wrong)
            now = self._signature()
            self._seen = now | {path: state for path, state in before.items() if path in now}
            if self._seen == now:
                return

    def page(self) -> str:
        """Return the page as HTML."""
        first = self._tried[0]
        beside = f"beside {self._file.name}"
        changeable = Changeable(first.content, beside, self._ranges) if self._ranges else None
        shown = lincov_page(first.campaign, first.setting.answer, changeable=changeable)
        return page_html(live_page(shown, self.state()))

    def state(self) -> dict[str, object]:
        """Return what the page shows of the settings, as JSON has it."""
        settings = [
            each.setting if each.run is None else replace(each.setting, confirmation=each.run.look())
            for each in self._tried
        ]
        return live_state(settings, self._revision, self._error)

    def tune(self, revision: int, factors: Mapping[str, float]) -> None:
        """Compute the linear answer with some numbers multiplied and the filter re-tuned, and keep it.

        Parameters
        ----------
        revision : int
            Number of the file's content to which the factors belong.
        factors : mapping of str to float
            By the keys of the numbers.

        Raises
        ------
        CampaignError
            When the file has changed, there is no such number, or the campaign is refused.
        """
        first = self._tried[0]
        if revision != self._revision:
            raise CampaignError([Problem(str(self._file), "", CHANGED)])
        numbers = {
            data_sheet_number.path: data_sheet_number
            for data_sheet_number in data_sheet_numbers(first.content, first.campaign.scenario.sources)
        }
        for path, factor in factors.items():
            if path not in numbers or not (math.isfinite(factor) and factor > 0.0):
                message = f"got the factor {factor!r}; expected a number of the data sheet and a factor above zero"
                raise CampaignError([Problem(str(self._file), path, message)])
        chosen = [(numbers[path], factor) for path, factor in factors.items() if factor != 1.0]
        content = override(first.content, values_of(chosen), str(self._file))
        read = parse_campaign(content, str(self._file), self._file.stem)
        campaign = SharedDerivatives(first.campaign).along(read)
        changed = [(each.path, replace(each, entry=each.multiplied(factor)[each.path]).text) for each, factor in chosen]
        tried = self._try(campaign, content, dict(factors), changed)
        self._tried = [first, *_shortened([*self._tried[1:], tried])]

    def confirm(self, number: int) -> None:
        """Run the campaign of a setting; `CampaignError` while another one runs."""
        if any(each.run is not None and each.run.running for each in self._tried):
            raise CampaignError([Problem("Monte Carlo", "", "a run is going on; stop it first, or wait for its end")])
        chosen = self._numbered(number)
        name = hashlib.sha256(chosen.campaign.to_toml().encode()).hexdigest()[:10]
        run = RunningCampaign(chosen.content, str(self._file), self._folder / name, self._jobs)
        self._tried = [replace(each, run=run) if each is chosen else each for each in self._tried]

    def stop(self) -> None:
        """End the run that goes on, if there is one."""
        for each in self._tried:
            if each.run is not None:
                each.run.stop()

    def setting_page(self, number: int) -> str:
        """Return the page on the linear covariance of a setting as HTML."""
        chosen = self._numbered(number)
        return page_html(lincov_page(chosen.campaign, chosen.setting.answer))

    def campaign_file(self, number: int) -> str:
        """Return the campaign file of a setting, to be saved beside the watched file."""
        return tomli_w.dumps(self._numbered(number).content)

    def report(self, number: int) -> str:
        """Return the report of a setting's run; `CampaignError` where it has none."""
        run = self._numbered(number).run
        if run is None or run.look().state != "done":
            raise CampaignError([Problem(f"setting {number}", "", "has no finished run")])
        return (Path(run.look().folder) / REPORT).read_text(encoding="utf-8")

    def _answer(self) -> None:
        """Read the file and answer it; runs of settings of the content before go on."""
        campaign = read_campaign(self._file)
        self._inputs = tuple(Path(each.path) for each in campaign.inputs())
        self._ranges = campaign.ranges
        if campaign.ranges:
            document, remarks = at_worst(self._file)
            campaign, content = replace(parse_document(document, {}), remarks=remarks), document.content
        else:
            content, _ = changeable_content(campaign)
        self._revision += 1
        try:
            first = self._try(campaign, content, {}, ())
        except REFUSED:
            self._revision -= 1
            raise
        earlier = [each for each in self._tried if each.setting.factors or each.run is not None]
        self._tried = [first, *_shortened(earlier)]

    def _try(
        self, campaign: Campaign, content: Content, factors: Mapping[str, float], changed: Sequence[tuple[str, str]]
    ) -> _Tried:
        answer = linear_covariance(campaign, examine=None)  # where that costs less than the answer
        self._counted += 1
        self._tuned += bool(factors)
        title, when = f"Setting {self._tuned}" if factors else "Campaign", datetime.now().strftime("%H:%M:%S")
        setting = Setting(self._counted, title, self._revision, when, factors, changed, answer)
        return _Tried(setting, campaign, content)

    def _numbered(self, number: int) -> _Tried:
        chosen = next((each for each in self._tried if each.setting.number == number), None)
        if chosen is None:
            raise CampaignError([Problem(f"setting {number}", "", f"is not among the last {MOST}")])
        return chosen

    def _signature(self) -> dict[Path, tuple[int, int] | None]:
        """Return time and size of the file and of those that it names; none of one that is not there."""
        return {path: _state_of(path) for path in (self._file, *self._inputs)}


def _shortened(tried: list[_Tried]) -> list[_Tried]:
    """Leave out the earliest settings beyond `MOST`, but none whose run goes on."""
    surplus = [each for each in tried if each.run is None or not each.run.running][: max(0, len(tried) - MOST)]
    return [each for each in tried if not any(each is one for one in surplus)]


def values_of(chosen: Sequence[tuple[DataSheetNumber, float]]) -> dict[str, Value]:
    """Return the keys to be set where numbers are multiplied, each by its own factor."""
    values: dict[str, Value] = {}
    for number, factor in chosen:
        values |= number.multiplied(factor)
    return values | {number.path: number.multiplied(factor)[number.path] for number, factor in chosen}


def _state_of(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
