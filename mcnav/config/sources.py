"""The tables ``[errors]``, ``[[correlations]]`` and ``[[joint]]`` of a campaign file, in the units of its sources."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from mcnav.config.empirical import SCIPY, TABLE, read_scipy, read_table
from mcnav.config.schema import CorrelationTable, JointTable
from mcnav.config.toml import Content
from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.errors import MOST_PROBLEMS, suggestion
from mcnav.sampling.distributions import Distribution, Fixed, Normal, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.sampling.error_model import Correlation
from mcnav.sampling.multivariate_t import MultivariateT

LARGEST_MULTIPLE: Final = 1e9
"""Multiple of a source's usual size above which an error is refused: a slip of the pen, and a risk of overflow."""

OWN_UNIT: Final = "own"
"""Placeholder for the unit of the source itself."""

DISTRIBUTIONS: Final[Mapping[str, tuple[Callable[..., Distribution], Mapping[str, str]]]] = {
    "normal": (Normal, {"sigma": OWN_UNIT}),
    "uniform": (Uniform, {"half_width": OWN_UNIT}),
    "truncated-normal": (TruncatedNormal, {"sigma": OWN_UNIT, "limit": OWN_UNIT}),
    "triangular": (Triangular, {"half_width": OWN_UNIT}),
    "student-t": (StudentT, {"sigma": OWN_UNIT, "degrees_of_freedom": "1"}),
    "fixed": (lambda value: Fixed(value), {"value": OWN_UNIT}),
}
"""Each distribution with its keys and their units."""


def expand_groups(entries: Mapping[str, Any], sources: Sequence[Source]) -> Content:
    """Give the entry of a group, such as ``position``, to each of its sources that has no entry of its own."""
    groups: dict[str, list[str]] = {}
    for source in sources:
        if source.group and source.group != source.name:
            groups.setdefault(source.group, []).append(source.name)
    given = {name: entry for group, entry in entries.items() for name in groups.get(group, ())}
    return {**given, **{name: entry for name, entry in entries.items() if name not in groups}}


def read_errors(entries: Mapping[str, Any], sources: Sequence[Source], context: FileContext) -> dict[str, Distribution]:
    """Read the distributions of ``[errors]``, by source; mistakes are added to the context."""
    known = {source.name: source for source in sources}
    distributions = {}
    for name, entry in entries.items():
        key = f"errors.{name}"
        if len(context.problems) > MOST_PROBLEMS:
            break
        if name not in known:
            context.problem(key, f"unknown error source{suggestion(name, list(known))}")
            continue
        distribution = _read_distribution(entry, known[name], key, context)
        if distribution is not None:
            distributions[name] = distribution
    return distributions


def _read_distribution(entry: object, source: Source, key: str, context: FileContext) -> Distribution | None:
    table: Mapping[str, Any] = entry if isinstance(entry, dict) else {"sigma": entry}
    kind = table.get("distribution", "normal")
    if isinstance(kind, str) and (kind == TABLE or kind.startswith(SCIPY)):
        distribution = (read_table if kind == TABLE else read_scipy)(table, source, key, context)
        if distribution is None:
            return None
        size = max(abs(distribution.mean), distribution.standard_deviation)
        return distribution if _plausible(size, f"its mean or sigma is {size:.3g}", source, key, context) else None
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        wanted = ", ".join((*DISTRIBUTIONS, TABLE, f"{SCIPY}NAME"))
        context.problem(f"{key}.distribution", f"got {kind!r}; expected one of {wanted}")
        return None
    make, units = DISTRIBUTIONS[kind]
    context.check_keys(table, list(units), key, f"a {kind} distribution")
    values: dict[str, float] = {}
    for name, unit in units.items():
        at = f"{key}.{name}" if isinstance(entry, dict) else key
        if name not in table:
            context.problem(at, f"is missing; a {kind} distribution needs {' and '.join(units)}")
            continue
        value = context.quantity(table[name], source.unit if unit == OWN_UNIT else unit, at)
        if value is not None and (unit != OWN_UNIT or _plausible(value, f"got {table[name]!r}", source, at, context)):
            values[name] = value
    if len(values) < len(units):
        return None
    try:
        return make(**values)
    except ValueError as wrong:
        written = ", ".join(f"{name} = {table[name]!r}" for name in units)
        context.problem(key, f"got {written if isinstance(entry, dict) else repr(entry)}; {wrong}")
        return None


def _plausible(value: float, came: str, source: Source, key: str, context: FileContext) -> bool:
    """Add a mistake when an error is larger than `LARGEST_MULTIPLE` allows; return whether it is not."""
    largest = LARGEST_MULTIPLE * source.nominal
    if abs(value) <= largest:
        return True
    context.problem(key, f"{came}; at most {largest:.3g}{'' if source.unit == '1' else f' {source.unit}'} makes sense")
    return False


def read_correlations(
    tables: Sequence[CorrelationTable], sources: Sequence[Source], context: FileContext
) -> list[Correlation]:
    """Read the entries of ``[[correlations]]``; mistakes are added to the context."""
    names = [source.name for source in sources]
    correlations: list[Correlation] = []
    seen: set[frozenset[str]] = set()
    for number, entry in enumerate(tables, start=1):
        key = f"correlations #{number}.between"
        context.check_names(entry.between, names, key, "error source")
        first, second = entry.between
        if first == second:
            context.problem(key, f"got {first!r} twice; expected two different sources")
        elif {first, second} in seen:
            context.problem(key, f"{first} and {second} are correlated twice; expected one entry for each pair")
        seen.add(frozenset((first, second)))
        given = [each for each in (entry.coefficient, entry.rank_coefficient) if each is not None]
        if len(given) == 1:
            correlations.append(Correlation((first, second), given[0], of_ranks=entry.coefficient is None))
        else:
            came = "both" if given else "neither"
            message = f"got {came}; expected coefficient (Pearson's) or rank_coefficient (Spearman's)"
            context.problem(f"correlations #{number}", message)
    return correlations


def read_joint(tables: Sequence[JointTable], sources: Sequence[Source], context: FileContext) -> list[MultivariateT]:
    """Read the entries of ``[[joint]]``; mistakes are added to the context."""
    names = [source.name for source in sources]
    joint = []
    for number, entry in enumerate(tables, start=1):
        key = f"joint #{number}"
        context.check_names(entry.sources, names, f"{key}.sources", "error source")
        try:
            joint.append(MultivariateT(tuple(entry.sources), entry.degrees_of_freedom))
        except ValueError as wrong:
            context.problem(f"{key}.degrees_of_freedom", f"got {entry.degrees_of_freedom:g}; {wrong}")
    return joint
