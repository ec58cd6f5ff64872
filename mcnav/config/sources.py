"""The tables ``[errors]``, ``[[correlations]]`` and ``[[joint]]`` of a campaign file, in the units of its sources."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from mcnav.config.empirical import SCIPY, TABLE, read_scipy, read_table
from mcnav.config.schema import CorrelationTable, JointTable
from mcnav.errors import MOST_PROBLEMS, Problem, suggestion
from mcnav.sampling.distributions import Distribution, Fixed, Normal, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.sampling.error_model import Correlation
from mcnav.sampling.multivariate_t import MultivariateT
from mcnav.scenarios.protocol import Source
from mcnav.units import UnitError, quantity

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


def read_errors(
    entries: Mapping[str, Any], file: str, sources: Sequence[Source], problems: list[Problem]
) -> dict[str, Distribution]:
    """The distributions of ``[errors]``; mistakes are added to the list."""
    known = {source.name: source for source in sources}
    found = {}
    for name, entry in entries.items():
        key = f"errors.{name}"
        if len(problems) > MOST_PROBLEMS:
            break
        if name not in known:
            problems.append(Problem(file, key, f"unknown error source{suggestion(name, list(known))}"))
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
    if isinstance(kind, str) and kind.startswith(SCIPY):
        return _sized(read_scipy(table, source, file, key, problems), source, file, key, problems)
    if kind == TABLE:
        return _sized(read_table(table, source, file, key, problems), source, file, key, problems)
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        wanted = ", ".join((*DISTRIBUTIONS, TABLE, f"{SCIPY}NAME"))
        problems.append(Problem(file, f"{key}.distribution", f"got {kind!r}; expected one of {wanted}"))
        return None
    make, keys = DISTRIBUTIONS[kind]
    for extra in table.keys() - keys.keys() - {"distribution"}:
        message = f"unknown key of a {kind} distribution{suggestion(extra, list(keys))}"
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


def _sized(
    found: Distribution | None, source: Source, file: str, key: str, problems: list[Problem]
) -> Distribution | None:
    """A distribution from elsewhere, unless it is larger than makes sense."""
    if found is None:
        return None
    size = max(abs(found.mean), found.standard_deviation)
    if size > LARGEST_MULTIPLE * source.nominal:
        largest = f"{LARGEST_MULTIPLE * source.nominal:.3g} {source.unit if source.unit != '1' else ''}".strip()
        problems.append(Problem(file, key, f"its mean or sigma is {size:.3g}; at most {largest} makes sense"))
        return None
    return found


def read_correlations(
    tables: Sequence[CorrelationTable], file: str, sources: Sequence[Source], problems: list[Problem]
) -> list[Correlation]:
    """The entries of ``[[correlations]]``; mistakes are added to the list."""
    names = [source.name for source in sources]
    found: list[Correlation] = []
    seen: set[frozenset[str]] = set()
    for number, entry in enumerate(tables, start=1):
        key = f"correlations #{number}.between"
        problems += [
            Problem(file, key, f"unknown error source {name!r}{suggestion(name, names)}")
            for name in entry.between
            if name not in names
        ]
        pair = frozenset(entry.between)
        if len(pair) == 1:
            problems.append(Problem(file, key, f"got {entry.between[0]!r} twice; expected two different sources"))
        elif pair in seen:
            problems.append(Problem(file, key, f"{' and '.join(entry.between)} are correlated twice"))
        seen.add(pair)
        given = [each for each in (entry.coefficient, entry.rank_coefficient) if each is not None]
        if len(given) == 1:
            of_ranks = entry.coefficient is None
            found.append(Correlation((entry.between[0], entry.between[1]), given[0], of_ranks))
        else:
            came = "both" if given else "neither"
            message = f"got {came}; expected coefficient (Pearson's) or rank_coefficient (Spearman's)"
            problems.append(Problem(file, f"correlations #{number}", message))
    return found


def read_joint(
    tables: Sequence[JointTable], file: str, sources: Sequence[Source], problems: list[Problem]
) -> list[MultivariateT]:
    """The entries of ``[[joint]]``; mistakes are added to the list."""
    names = [source.name for source in sources]
    found = []
    for number, entry in enumerate(tables, start=1):
        key = f"joint #{number}"
        problems += [
            Problem(file, f"{key}.sources", f"unknown error source {name!r}{suggestion(name, names)}")
            for name in entry.sources
            if name not in names
        ]
        try:
            found.append(MultivariateT(tuple(entry.sources), entry.degrees_of_freedom))
        except ValueError as wrong:
            problems.append(Problem(file, f"{key}.degrees_of_freedom", f"got {entry.degrees_of_freedom:g}; {wrong}"))
    return found
