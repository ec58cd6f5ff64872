"""Campaigns as objects: the whole description, of Python objects or of a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import tomli_w

from mcnav.config.campaign import Campaign as CheckedCampaign
from mcnav.config.documents import Document, document_of, written
from mcnav.config.overrides import Value, override, parse_document
from mcnav.sampler.errors import Errors


class Campaign:
    """A campaign described in Python; it is checked when it is made.

    Every argument is a table or key of a campaign file (`mcnav docs campaigns`), with objects where files have text:
    numbers are SI, quantities may be pint's, errors `mcnav.Errors`.

    Parameters
    ----------
    scenario : mapping, class or str
        The table ``[scenario]``, such as ``{"type": "reentry", "trajectory": 4}``; a class with ``propagate`` or
        ``fly``, or a subclass of `mcnav.ClosedLoop`, also of a notebook cell; or a type without further keys. A
        function needs the names of its outputs: ``{"type": function, "outputs": ["range"]}``.
    errors : Errors or mapping, optional
        One sigma or a distribution by error source; others are zero.
    correlations, joint : sequence of mapping, optional
    imu, filter, faults, processes, measurements : mapping or sequence, optional
        Tables that inertial navigation and closed loops have.
    aiding : sequence of mapping, optional
        Sensors.
    accept : mapping, or sequence of mapping, optional
        Requirements: the table ``[accept]``, or a list such as ``[{"r95": {"outputs": [...], "below": "10 m"}}]``.
    samples : int or mapping
    seed : int
    name : str
    **further
        ``design``, ``tolerance``, ``confidence``, ``store``, ``sample_timeout``, ``start_times``, and what else files
        may have.

    Attributes
    ----------
    checked : Campaign
        What the program reads of it: ``scenario``, ``errors`` (statistics of all sources), ``requirements``, … Its
        attributes are those of this object too.

    Raises
    ------
    CampaignError
        Lists every mistake.

    Examples
    --------
    >>> import mcnav as mc
    >>> campaign = mc.Campaign(
    ...     scenario={"type": "reentry", "trajectory": 4},
    ...     errors={"altitude": 5e3, "gyro_drift": "0.2 deg/h"},
    ...     samples=1000,
    ... )
    >>> campaign.samples, campaign.errors.standard_deviations[0]
    (1000, np.float64(5000.0))
    """

    def __init__(
        self,
        scenario: Mapping[str, Any] | type | str,
        errors: Errors | Mapping[str, Any] | None = None,
        *,
        correlations: Sequence[Mapping[str, Any]] | None = None,
        joint: Sequence[Mapping[str, Any]] | None = None,
        imu: Mapping[str, Any] | None = None,
        aiding: Sequence[Mapping[str, Any]] | None = None,
        filter: Mapping[str, Any] | None = None,
        accept: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
        samples: int | Mapping[str, Any] = 20_000,
        seed: int = 0,
        name: str | None = None,
        **further: Any,
    ) -> None:
        given = {
            "name": name, "samples": samples, "seed": seed, "scenario": scenario, "errors": errors,
            "correlations": correlations, "joint": joint, "imu": imu, "aiding": aiding, "filter": filter,
            "accept": accept, **further,
        }  # fmt: skip
        self.document: Document = written({key: value for key, value in given.items() if value is not None})
        _ = self.checked

    @classmethod
    def of(cls, document: Document) -> Campaign:
        """Return the campaign of a document, which is checked."""
        campaign = cls.__new__(cls)
        campaign.document = document
        _ = campaign.checked
        return campaign

    @cached_property
    def checked(self) -> CheckedCampaign:
        """The campaign as the program reads it."""
        return parse_document(self.document, {})

    def vary(self, values: Mapping[str, Value]) -> Campaign:
        """Return it with some keys set to other values, by their paths such as ``imu.gyro.bias``.

        >>> import mcnav as mc
        >>> campaign = mc.Campaign({"type": "reentry", "trajectory": 4}, {"altitude": "5 km"})
        >>> campaign.vary({"errors.altitude": "1 km", "samples": 500}).samples
        500
        """
        return Campaign.of(replace(self.document, content=override(self.document.content, values, self.document.file)))

    def to_toml(self) -> str:
        """Write it as a campaign file, with every default spelled out."""
        return self.checked.to_toml()

    def save(self, file: str | Path) -> None:
        """Write it as a campaign file, as it was described, and code that it holds beside the file."""
        path = Path(file)
        path.write_text(tomli_w.dumps(self.document.described), encoding="utf-8")
        for source in self.document.code.values():
            (path.parent / source.file).write_text(source.text, encoding="utf-8")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name in ("document", "checked"):
            raise AttributeError(name)
        return getattr(self.checked, name)

    def __repr__(self) -> str:
        checked = self.checked
        return f"Campaign {checked.name!r}: {checked.samples:,} samples of {type(checked.scenario).__name__}"


def read_campaign(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    path : str or Path
        The file.
    overrides : mapping, optional
        Top-level entries in place of some of its own.

    Raises
    ------
    CampaignError
        Lists every mistake.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.read_campaign("reports/first/campaign.toml", {"samples": 500}).samples
    500
    """
    document = document_of(path)
    return Campaign.of(replace(document, content={**document.content, **(overrides or {})}))
