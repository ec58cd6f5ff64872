"""The campaign file: TOML in, a `Campaign` or a list of all its mistakes out."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import tomli_w
from pydantic import ValidationError

from mcnav.campaign.problems import CampaignError, Problem
from mcnav.campaign.tables import CampaignTable, ReentryTable
from mcnav.constants import BALLISTIC_COEFFICIENT, EARTH_RADIUS
from mcnav.physics.vehicle import ConstantLift, LiftLaw, VariableLift, Vehicle
from mcnav.sampling.distributions import (
    Distribution,
    Fixed,
    Normal,
    StudentT,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from mcnav.sampling.errors import Correlation, CorrelationError, ErrorModel
from mcnav.scenarios.protocol import Scenario, ScenarioError, Source
from mcnav.scenarios.reentry import SOURCES, Flight, Reentry
from mcnav.scenarios.tn_d1772 import TABLE_I, common_start, start_state
from mcnav.units import UnitError, quantity

LARGEST_FILE: Final = 1_000_000
"""Bytes; a campaign is a page of text."""

LARGEST_MULTIPLE: Final = 1e9
"""An error of more than this many times its usual size is a slip of the pen, and would overflow somewhere."""

OWN_UNIT: Final = "own"
"""Stands for the unit of the source itself."""

DISTRIBUTIONS: Final[Mapping[str, tuple[Callable[..., Distribution], Mapping[str, str]]]] = {
    "normal": (Normal, {"sigma": OWN_UNIT}),
    "uniform": (Uniform, {"half_width": OWN_UNIT}),
    "truncated-normal": (TruncatedNormal, {"sigma": OWN_UNIT, "limit": OWN_UNIT}),
    "triangular": (Triangular, {"half_width": OWN_UNIT}),
    "student-t": (StudentT, {"sigma": OWN_UNIT, "degrees_of_freedom": "1"}),
    "fixed": (lambda value: Fixed(value), {"value": OWN_UNIT}),
}
"""Each distribution with its keys and their units."""


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
        distributions = _read_errors(entries, file, SOURCES, problems)
    if table is None:
        raise CampaignError(problems)

    correlations = _read_correlations(table, file, problems)
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
        return Problem(file, key, f"unknown key{_suggestion(str(location[-1]), _known_keys(location[:-1]))}")
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


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; expected one of {', '.join(known)}" if known else ""


def _read_errors(
    entries: Mapping[str, Any], file: str, sources: tuple[Source, ...], problems: list[Problem]
) -> dict[str, Distribution]:
    """The distributions of ``[errors]``; mistakes are added to the list."""
    known = {source.name: source for source in sources}
    found = {}
    for name, entry in entries.items():
        key = f"errors.{name}"
        if name not in known:
            problems.append(Problem(file, key, f"unknown error source{_suggestion(name, list(known))}"))
            continue
        table = entry if isinstance(entry, dict) else {"distribution": "normal", "sigma": entry}
        before = len(problems)
        distribution = _read_distribution(table, known[name], file, key, isinstance(entry, dict), problems)
        if distribution is not None and len(problems) == before:
            found[name] = distribution
    return found


def _read_distribution(
    table: Mapping[str, Any], source: Source, file: str, key: str, spelled_out: bool, problems: list[Problem]
) -> Distribution | None:
    kind = table.get("distribution", "normal")
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        wanted = ", ".join(DISTRIBUTIONS)
        problems.append(Problem(file, f"{key}.distribution", f"got {kind!r}; expected one of {wanted}"))
        return None
    make, keys = DISTRIBUTIONS[kind]
    for extra in table.keys() - keys.keys() - {"distribution"}:
        message = f"unknown key of a {kind} distribution{_suggestion(extra, list(keys))}"
        problems.append(Problem(file, f"{key}.{extra}", message))
    values: dict[str, float] = {}
    for name, own in keys.items():
        place = f"{key}.{name}" if spelled_out else key
        if name not in table:
            problems.append(Problem(file, place, f"is missing; a {kind} distribution needs {' and '.join(keys)}"))
            continue
        try:
            values[name] = quantity(table[name], source.unit if own == OWN_UNIT else own)
        except UnitError as wrong:
            problems.append(Problem(file, place, str(wrong)))
    if len(values) < len(keys):
        return None
    for name, own in keys.items():
        if own == OWN_UNIT and abs(values[name]) > LARGEST_MULTIPLE * source.nominal:
            largest = f"{LARGEST_MULTIPLE * source.nominal:.3g} {source.unit if source.unit != '1' else ''}".strip()
            place = f"{key}.{name}" if spelled_out else key
            problems.append(Problem(file, place, f"got {table[name]!r}; at most {largest} makes sense"))
            return None
    try:
        return make(**values)
    except ValueError as wrong:
        written = ", ".join(f"{name} = {table[name]!r}" for name in keys)
        problems.append(Problem(file, key, f"got {written if spelled_out else repr(table['sigma'])}; {wrong}"))
        return None


def _read_correlations(table: CampaignTable, file: str, problems: list[Problem]) -> list[Correlation]:
    names = [source.name for source in SOURCES]
    found: list[Correlation] = []
    seen: set[frozenset[str]] = set()
    for number, entry in enumerate(table.correlations, start=1):
        key = f"correlations #{number}.between"
        problems += [
            Problem(file, key, f"unknown error source {name!r}{_suggestion(name, names)}")
            for name in entry.between
            if name not in names
        ]
        pair = frozenset(entry.between)
        if len(pair) == 1:
            problems.append(Problem(file, key, f"got {entry.between[0]!r} twice; expected two different sources"))
        elif pair in seen:
            problems.append(Problem(file, key, f"{' and '.join(entry.between)} are correlated twice"))
        seen.add(pair)
        found.append(Correlation((entry.between[0], entry.between[1]), entry.coefficient))
    return found


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
