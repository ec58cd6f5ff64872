"""The campaign file: TOML in, a `Campaign` or a list of all its mistakes out."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import tomli_w
from pydantic import ValidationError

from mcnav.campaign.errors import read_correlations, read_errors
from mcnav.campaign.problems import CampaignError, Problem, suggestion
from mcnav.campaign.tables import CampaignTable, ReentryTable
from mcnav.constants import BALLISTIC_COEFFICIENT, EARTH_RADIUS
from mcnav.physics.vehicle import ConstantLift, LiftLaw, VariableLift, Vehicle
from mcnav.sampling.distributions import Distribution
from mcnav.sampling.errors import CorrelationError, ErrorModel
from mcnav.scenarios.protocol import Scenario, ScenarioError
from mcnav.scenarios.reentry import SOURCES, Flight, Reentry
from mcnav.scenarios.tn_d1772 import TABLE_I, common_start, start_state

LARGEST_FILE: Final = 1_000_000
"""Bytes; a campaign is a page of text."""


@dataclass(frozen=True)
class Campaign:
    """A campaign, read and checked.

    Attributes
    ----------
    name : str
    samples, seed : int
    design : str
        One of `mcnav.sampling.designs.DESIGNS`.
    tolerance, confidence : float
        What counts as agreement between linear and Monte Carlo.
    scenario : Scenario
    errors : ErrorModel
    resolved : mapping
        The file's content with every default spelled out; written as TOML it runs the same campaign again.
    """

    name: str
    samples: int
    seed: int
    design: str
    tolerance: float
    confidence: float
    scenario: Scenario
    errors: ErrorModel
    resolved: Mapping[str, Any]

    def to_toml(self) -> str:
        """The resolved campaign as a file."""
        return tomli_w.dumps(dict(self.resolved))


def read_campaign(path: Path, overrides: Mapping[str, Any] | None = None) -> Campaign:
    """Read a campaign file.

    Parameters
    ----------
    path : Path
    overrides : mapping, optional
        Top-level entries that take the place of the file's.

    Raises
    ------
    CampaignError
        With every mistake that was found.
    """
    return parse_campaign(_load(path), str(path), path.stem, overrides)


def _load(path: Path) -> dict[str, Any]:
    def problem(message: str) -> CampaignError:
        return CampaignError([Problem(str(path), "", message)])

    try:
        if path.is_dir():
            raise problem("is a folder; expected a campaign file in TOML")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise problem(f"is {size} bytes long; a campaign file has at most {LARGEST_FILE}")
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
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
    content: Mapping[str, Any], file: str, stem: str, overrides: Mapping[str, Any] | None = None
) -> Campaign:
    """Check the content of a campaign file and build what it describes; see `read_campaign`."""
    content = {**content, **(overrides or {})}
    problems: list[Problem] = []
    table: CampaignTable | None = None
    try:
        table = CampaignTable.model_validate(content)
    except ValidationError as invalid:
        problems += [_problem(file, dict(error)) for error in invalid.errors(include_url=False)]

    entries = content.get("errors", {})
    distributions: dict[str, Distribution] = {}
    if isinstance(entries, dict):
        distributions = read_errors(entries, file, SOURCES, problems)
    if table is None:
        raise CampaignError(problems)

    correlations = read_correlations(table.correlations, file, SOURCES, problems)
    model: ErrorModel | None = None
    if not problems:
        try:
            model = ErrorModel([source.name for source in SOURCES], distributions, correlations)
        except CorrelationError as wrong:
            key = "correlations" if wrong.entry is None else f"correlations #{wrong.entry + 1}"
            problems.append(Problem(file, key, str(wrong)))
    flight = _read_flight(table.scenario, file, problems)
    scenario: Reentry | None = None
    if flight is not None:
        try:
            scenario = Reentry(flight)
        except ScenarioError as wrong:
            problems.append(Problem(file, f"scenario.{wrong.key}", str(wrong)))
    if problems or model is None or scenario is None or flight is None:
        raise CampaignError(problems)
    name = table.name or stem
    return Campaign(
        name=name,
        samples=table.samples,
        seed=table.seed,
        design=str(table.design),
        tolerance=table.tolerance,
        confidence=table.confidence,
        scenario=scenario,
        errors=model,
        resolved=_resolved(content, table, name, flight),
    )


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


def _problem(file: str, error: dict[str, Any]) -> Problem:
    """One of pydantic's findings in our words."""
    location = [part for part in error["loc"] if part not in ("constant", "variable")]
    key = ""
    for part in location:
        key += f" #{part + 1}" if isinstance(part, int) else f"{'.' if key else ''}{part}"
    came, kind = error["input"], error["type"]
    if kind == "extra_forbidden":
        return Problem(file, key, f"unknown key{suggestion(str(location[-1]), _known_keys(location[:-1]))}")
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


def _known_keys(location: list[str | int]) -> list[str]:
    model: Any = CampaignTable
    if location[:1] == ["scenario"]:
        model = ReentryTable if len(location) == 1 else None
    elif location:
        model = None
    return list(model.model_fields) if model is not None else []


def _read_flight(table: ReentryTable, file: str, problems: list[Problem]) -> Flight | None:
    """What to fly: a row of Table I, with whatever is spelled out in its place."""
    row = None if table.trajectory is None else TABLE_I[table.trajectory]
    law: LiftLaw | None = row.lift_law if row else None
    if table.lift_law is not None:
        spelled = table.lift_law
        law = (
            ConstantLift(spelled.lift_to_drag)
            if spelled.type == "constant"
            else VariableLift(spelled.gain, spelled.limit)
        )
    final_altitude = table.final_altitude
    if final_altitude is None and row is not None:
        final_altitude = row.final_altitude
    for key, value in (("lift_law", law), ("final_altitude", final_altitude)):
        if value is None:
            problems.append(
                Problem(file, f"scenario.{key}", "is missing; give it, or a trajectory of Table I by its number")
            )
    if table.first_point is not None and table.trajectory is not None:
        problems.append(
            Problem(file, "scenario.first_point", "got with a trajectory of Table I, which has its own; keep one")
        )
    if law is None or final_altitude is None:
        return None
    if table.first_point is not None:
        at = table.first_point
        first: tuple[float, ...] = (
            EARTH_RADIUS + at.altitude,
            at.range / EARTH_RADIUS,
            at.altitude_rate,
            at.range_rate / EARTH_RADIUS,
        )
    else:
        first = start_state(table.trajectory) if table.trajectory else tuple(common_start())
    ballistic = BALLISTIC_COEFFICIENT if table.ballistic is None else table.ballistic
    return Flight(
        first_point=first,
        vehicle=Vehicle(law, ballistic),
        final_altitude=final_altitude,
        start=table.start,
        axes=table.axes,
        accelerometers_off_above=table.accelerometers_off_above,
    )


def _resolved(content: Mapping[str, Any], table: CampaignTable, name: str, flight: Flight) -> dict[str, Any]:
    """The file's own entries with the defaults beside them; numbers as Python prints them, so that nothing is lost."""
    law = flight.vehicle.lift_law
    lift: dict[str, Any] = (
        {"type": "constant", "lift_to_drag": law.lift_to_drag}
        if isinstance(law, ConstantLift)
        else {"type": "variable", "gain": f"{law.gain!r} s/m", "limit": law.limit}
    )
    defaults = {
        "lift_law": lift,
        "ballistic": f"{flight.vehicle.ballistic_coefficient!r} m^2/kg",
        "final_altitude": f"{flight.final_altitude!r} m",
        "axes": flight.axes,
    }
    return {
        "name": name,
        "samples": table.samples,
        "seed": table.seed,
        "design": str(table.design),
        "tolerance": content.get("tolerance", table.tolerance),
        "confidence": content.get("confidence", table.confidence),
        "scenario": {**defaults, **content["scenario"]},
        "errors": content.get("errors", {}),
        "correlations": content.get("correlations", []),
    }
