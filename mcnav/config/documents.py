"""A campaign as it was described, before it is read: a file, a dictionary, or objects of Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np

from mcnav.config.campaign import Campaign
from mcnav.config.ranges import SpecRange, split_ranges, still_there, with_values
from mcnav.config.toml import Content, load_file, load_mapping
from mcnav.contract.quantities import Output, Source
from mcnav.entries.inputs import SourceFile
from mcnav.errors import CampaignError, Problem
from mcnav.sampler.sizes import ErrorSize, in_si, size_of

UNNAMED: Final = "campaign"
"""Name of a campaign without a file, and of its file in messages."""

SI: Final = "SI"
"""Value of the key ``units`` with which numbers without a unit are SI."""


@dataclass(frozen=True)
class Document:
    """A campaign file: its path for messages and relative paths, its stem, and code given with it.

    Attributes
    ----------
    content : dict
        Of the nominal campaign: each range is at its upper end.
    ranges : tuple of SpecRange
        Those of the file whose upper ends stand there.
    """

    content: Content
    file: str = UNNAMED
    stem: str = UNNAMED
    code: Mapping[str, SourceFile] = field(default_factory=dict)
    ranges: tuple[SpecRange, ...] = ()

    def __post_init__(self) -> None:
        nominal, ranges = split_ranges(self.content, self.file)
        if ranges or self.ranges:
            object.__setattr__(self, "content", nominal)
            object.__setattr__(self, "ranges", (*still_there(nominal, self.ranges), *ranges))

    @property
    def document(self) -> Document:
        """Itself: a document describes a campaign."""
        return self

    @property
    def described(self) -> Content:
        """The content with its ranges as they are written."""
        return with_values(self.content, {spec.place: spec.text for spec in self.ranges})


@runtime_checkable
class Described(Protocol):
    """An object that describes a campaign, such as `mcnav.Campaign`."""

    @property
    def document(self) -> Document:
        """The campaign as a file would have it."""


Description = str | Path | Campaign | Described | Mapping[str, Any]
"""Forms in which a campaign can be given."""


def document_of(campaign: Description) -> Document:
    """Return the document of a campaign file, of one that has been read, of objects or of a dictionary.

    Raises `CampaignError` when it cannot be read, or contains what no campaign file can.
    """
    if isinstance(campaign, Mapping):
        return written(campaign)
    if isinstance(campaign, Campaign):
        if campaign.file in ("", UNNAMED):
            code = {} if campaign.code is None else {campaign.code.file: campaign.code}
            content = load_mapping(campaign.content or campaign.resolved, UNNAMED)
            return Document(content, UNNAMED, campaign.name, code, campaign.ranges)
        campaign = campaign.file
    if isinstance(campaign, Described):
        return campaign.document
    if not isinstance(campaign, (str, Path)):
        message = f"got {type(campaign).__name__}; expected a file, a dictionary or mcnav.Campaign"
        if callable(campaign):
            message += ", such as mcnav.Campaign({'type': function, 'outputs': ['range']}, errors)"
        raise CampaignError([Problem(UNNAMED, "", message)])
    path = Path(campaign)
    return Document(load_file(path), str(path), path.stem)


def written(given: Mapping[str, Any]) -> Document:
    """Write a dictionary that may hold objects of Python as the document of a campaign file.

    ``errors`` may be `mcnav.Errors` or have sizes as these; ``scenario`` may be a class, a table whose ``type`` is
    one, or a table whose ``type`` is a function of errors with the names of its ``outputs``. Numbers are SI.

    Raises `CampaignError` when an entry is none of these.
    """
    content, code = dict(given), dict[str, SourceFile]()
    errors = content.get("errors", {})
    if hasattr(errors, "correlation_entries"):
        content["correlations"] = [*content.get("correlations", []), *errors.correlation_entries]
    sizes = errors.sizes if hasattr(errors, "sizes") else errors
    if isinstance(sizes, Mapping):
        content["errors"] = {name: _size(name, size) for name, size in sizes.items()}
    scenario = content.get("scenario")
    table = dict(scenario) if isinstance(scenario, Mapping) else {"type": scenario}
    kind = table.get("type")
    if not isinstance(kind, type) and any(hasattr(kind, method) for method in ("propagate", "fly", "rates")):
        name = type(kind).__name__
        raise _refuse("scenario", f"got an object of {name}; give the class, and settings by name: {{'type': {name}}}")
    if callable(table.get("type")):
        source = _code_of(table, sizes)
        code[source.file] = source
        content["scenario"] = table
    if isinstance(content.get("accept"), list):
        content["accept"] = _joined(content["accept"])
    plain = {key: _plain(value, key) for key, value in content.items()}
    return Document(load_mapping({"units": SI, **plain}, UNNAMED), code=code)


def _refuse(key: str, message: str) -> CampaignError:
    return CampaignError([Problem(UNNAMED, key, message)])


def _size(name: str, size: Any) -> Any:
    """Return the entry of an error source: text and tables as they are, objects as a campaign file has them."""
    if isinstance(size, (str, Mapping, list)):
        return size
    try:
        entry = size_of(size).entry
    except ValueError as wrong:
        raise _refuse(f"errors.{name}", str(wrong)) from None
    if entry is None:
        raise _refuse(f"errors.{name}", "holds values; a campaign has them in a file: mcnav.table(file, column, unit)")
    return entry


def _code_of(table: dict[str, Any], sizes: Any) -> SourceFile:
    """Keep the code of a scenario that is a class or a function, and name it in its table."""
    from mcnav.systems.user.captured import captured_code, captured_function

    kind = table["type"]
    if isinstance(kind, type):
        source, name = captured_code(kind), kind.__name__
    else:
        name, outputs = "Simulated", table.pop("outputs", ())
        if not outputs or isinstance(outputs, str) or not isinstance(sizes, Mapping):
            raise _refuse("scenario", "a function needs the names of its outputs, and errors by name")
        sources = [_source(key, size) for key, size in sizes.items()]
        named = [output if isinstance(output, Output) else Output(str(output), "1", "1") for output in outputs]
        source = captured_function(kind, name, sources, named)
    table["type"] = f"{source.file}:{name}"
    return source


def _source(name: str, size: Any) -> Source:
    """Return the declaration of an error source of a function; its usual size is its sigma."""
    try:
        known = size_of(size)
    except ValueError as wrong:
        raise _refuse(f"errors.{name}", str(wrong)) from None
    unit, spread = known.unit or "1", known.distribution.standard_deviation or abs(known.distribution.mean) or 1.0
    return Source(name, unit, unit, spread)


def _joined(requirements: Sequence[Any]) -> Content:
    """Join requirements that are listed, each a table with its kind as the only key, into the table ``[accept]``."""
    joined: Content = {}
    for number, entry in enumerate(requirements, start=1):
        if not isinstance(entry, Mapping) or len(entry) != 1:
            raise _refuse(f"accept #{number}", "expected a table of its kind, such as {'r95': {'outputs': [...], ...}}")
        for kind, table in entry.items():
            if isinstance(table, Mapping):
                joined.setdefault(kind, []).append(table)
            else:
                joined[kind] = table
    return joined


def _plain(value: Any, key: str) -> Any:
    """Return a value as TOML has it; quantities of pint become text, and numbers of numpy numbers."""
    if isinstance(value, Mapping):
        return {str(name): _plain(entry, f"{key}.{name}") for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry, f"{key} #{number}") for number, entry in enumerate(value, start=1)]
    if isinstance(value, ErrorSize):
        return _size(key, value)
    if hasattr(value, "to_base_units"):
        number, unit = in_si(value)
        return f"{number!r} {unit}" if unit not in ("", "1") else number
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return str(value) if isinstance(value, Path) else value
