"""A box of campaigns: the settings of a campaign's ranges, each a campaign whose filter believes the nominal one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mcnav.analysis.box import Setting
from mcnav.config.data_sheet import DataSheetNumber, data_sheet_numbers
from mcnav.config.documents import Document, document_of
from mcnav.config.ranges import SpecRange, with_values
from mcnav.config.read import Campaign, parse_campaign
from mcnav.config.toml import Content
from mcnav.config.what_if import held_beliefs, is_tuned
from mcnav.contract.scenario import Scenario
from mcnav.errors import CampaignError, Problem
from mcnav.studies.shared_derivatives import loop_of
from mcnav.systems.user.scenario import is_users

Values = tuple[float, ...]
"""Values of the ranges of a box, in their units."""


class BoxedCampaign:
    """The campaigns of a box.

    Parameters
    ----------
    nominal : Campaign
        Each range is at its upper end.
    document : Document, optional
        That of the campaign; by default its file is read again.

    Attributes
    ----------
    ranges : tuple of SpecRange
        Those with more than one value.
    numbers : tuple of (DataSheetNumber or None)
        Number of the data sheet in whose entry each stands.
    held : tuple of str
        Paths of ranges of which the filter believes the upper end, because the campaign states nothing else.
    """

    def __init__(self, nominal: Campaign, document: Document | None = None) -> None:
        self.nominal, self._document = nominal, document or document_of(nominal)
        if len(self._document.ranges) < len(nominal.ranges):
            message = "its range is not in the file any more; read it again"
            raise CampaignError([Problem(nominal.file, nominal.ranges[0].path, message)])
        self.ranges = tuple(spec for spec in self._document.ranges if spec.span.low < spec.span.high)
        self.sheet = data_sheet_numbers(self._document.content, nominal.scenario.sources)
        self.numbers = tuple(_owner(spec, self.sheet) for spec in self.ranges)
        self._content, self.held = self._with_beliefs(self.numbers)

    @property
    def upper(self) -> Values:
        """Values of the nominal campaign."""
        return tuple(spec.span.high for spec in self.ranges)

    def setting(self, values: Sequence[float]) -> Setting:
        """Return values of the ranges by path, as a campaign file has them."""
        return {spec.path: spec.span.written(value) for spec, value in zip(self.ranges, values, strict=True)}

    def content(self, setting: Setting, held: bool = True) -> Content:
        """Return the content of the campaign file of a setting.

        The filter believes the upper ends unless the file states something else or, without ``held``, the setting.
        """
        written = {spec.place: setting[spec.path] for spec in self.ranges}
        plain = not held or setting == self.setting(self.upper)
        return with_values(self._document.content if plain else self._content, written)

    def at(self, setting: Setting, overrides: Mapping[str, Any] | None = None, held: bool = True) -> Campaign:
        """Read the campaign of a setting, with other top-level entries; `CampaignError` names the setting."""
        document = self._document
        try:
            content = self.content(setting, held)
            return parse_campaign(content, document.file, document.stem, overrides, code=document.code)
        except CampaignError as wrong:
            values = ", ".join(f"{path} = {value}" for path, value in setting.items())
            first = wrong.problems[0]
            message = f"{first.message} (a setting of the ranges: {values})"
            raise CampaignError([replace(first, message=message)]) from None

    def document_at(self, setting: Setting) -> Document:
        """Return the campaign file of a setting, which states beliefs of ranges below their upper ends alone."""
        upper = self.setting(self.upper)
        paired = zip(self.ranges, self.numbers, strict=True)
        moved = tuple(number for spec, number in paired if setting[spec.path] != upper[spec.path])
        content = self._with_beliefs(moved)[0] if moved else self._document.content
        written = {spec.place: setting[spec.path] for spec in self.ranges}
        return replace(self._document, content=with_values(content, written), ranges=())

    def _with_beliefs(self, numbers: Sequence[DataSheetNumber | None]) -> tuple[Content, tuple[str, ...]]:
        """State what the filter believes of numbers; return the ranges of which the campaign itself does not."""
        content, scenario, errors = self._document.content, self.nominal.scenario, self.nominal.errors
        if not is_tuned(content, scenario.sources, _believed(scenario)):
            return content, ()

        def held(numbers: Sequence[DataSheetNumber]) -> Content:
            return held_beliefs(content, numbers, scenario.sources, errors.mean, errors.covariance)

        owned = {number.path: number for number in numbers if number is not None}
        before = held([])
        stated = {path for path, number in owned.items() if held([number]) != before}
        paired = zip(self.ranges, self.numbers, strict=True)
        believed = tuple(spec.path for spec, number in paired if number is not None and number.path in stated)
        return held(list(owned.values())), believed


def _believed(scenario: Scenario) -> Mapping[str, float]:
    """Return what the filter of a user's scenario believes; of a closed loop without its linear system."""
    if (loop := loop_of(scenario)) is not None:
        return {} if loop.filter_schema is None else loop.believed
    prediction = scenario.filter_prediction() if is_users(scenario) else None
    return {} if prediction is None else prediction.believed


def _owner(spec: SpecRange, numbers: Sequence[DataSheetNumber]) -> DataSheetNumber | None:
    """Return the number of the data sheet in whose entry a range stands."""
    return next((number for number in numbers if f"{spec.path}.".startswith(f"{number.path}.")), None)
