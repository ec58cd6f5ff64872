"""The tables ``[errors]``, ``[[correlations]]`` and ``[[joint]]`` of a campaign file, in the units of its sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mcnav.config.distributions import ENTRY, KIND, implausible
from mcnav.config.schema import CorrelationTable, JointTable
from mcnav.config.table_of_values import ValuesError
from mcnav.config.toml import Content
from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.validation import validate_entry
from mcnav.errors import MOST_PROBLEMS, suggestion
from mcnav.sampling.distributions import Distribution
from mcnav.sampling.error_model import Correlation
from mcnav.sampling.multivariate_t import MultivariateT


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
    table = validate_entry(ENTRY, entry, context, key, source)
    if table is None:
        return None
    try:
        distribution = table.build(source, context)
    except ValuesError as wrong:
        context.problem(f"{key}.{wrong.key}", str(wrong))
        return None
    except ValueError as wrong:
        given = {name: value for name, value in entry.items() if name != KIND} if isinstance(entry, dict) else {}
        written = ", ".join(f"{name} = {value!r}" for name, value in given.items()) or repr(entry)
        context.problem(key, f"got {written}; {wrong}")
        return None
    size = max(abs(distribution.mean), distribution.standard_deviation)
    if too_large := implausible(size, source):
        context.problem(key, f"its mean or sigma is {size:.3g}; {too_large}")
        return None
    return distribution


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
        size = entry.rank_coefficient if entry.coefficient is None else entry.coefficient
        correlations.append(Correlation((first, second), size or 0.0, of_ranks=entry.coefficient is None))
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
