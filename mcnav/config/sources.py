"""The tables ``[errors]``, ``[[correlations]]`` and ``[[joint]]`` of a campaign file, in the units of its sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mcnav._dataclasses import dataclass
from mcnav.config.distributions import ENTRY, KIND, implausible
from mcnav.config.schema import CorrelationTable, JointTable
from mcnav.config.table_of_values import ValuesError
from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.validation import validate_entry
from mcnav.errors import MOST_PROBLEMS, suggestion
from mcnav.sampling.distributions import Distribution
from mcnav.sampling.error_model import Correlation
from mcnav.sampling.multivariate_t import MultivariateT


@dataclass(frozen=True)
class Entry:
    """The entry of a source, and the key under which it is written."""

    value: Any
    key: str


def expand_groups(entries: Mapping[str, Any], sources: Sequence[Source], context: FileContext) -> Mapping[str, Entry]:
    """Give the entry of a group, such as ``position``, to each of its sources that has no entry of its own.

    It holds for all of them, or is a list or a table by axis. Mistakes are added to the context.
    """
    groups: dict[str, list[str]] = {}
    for source in sources:
        if source.group and source.group != source.name:
            groups.setdefault(source.group, []).append(source.name)
    given: dict[str, Entry] = {}
    for group, entry in entries.items():
        if group in groups:
            given |= _by_source(group, groups[group], entry, context)
    return {**given, **{name: Entry(entry, name) for name, entry in entries.items() if name not in groups}}


def _by_source(group: str, members: Sequence[str], entry: object, context: FileContext) -> dict[str, Entry]:
    """Return the entries of the sources of a group; one by axis names them as they go on after the group's name."""
    axes = {name.removeprefix(f"{group}_"): name for name in members}
    if isinstance(entry, list):
        if len(entry) != len(axes):
            message = f"got a list of {len(entry)}; expected {len(axes)}, for {', '.join(axes)}"
            context.problem(f"errors.{group}", message)
            return {}
        pairs = zip(members, entry, strict=True)
        return {name: Entry(value, f"{group} #{number}") for number, (name, value) in enumerate(pairs, start=1)}
    if isinstance(entry, dict) and entry.keys() & axes.keys():
        for axis in entry.keys() - axes.keys():
            context.problem(f"errors.{group}.{axis}", f"unknown axis; expected {', '.join(axes)}")
        return {axes[axis]: Entry(value, f"{group}.{axis}") for axis, value in entry.items() if axis in axes}
    return {name: Entry(entry, group) for name in members}


def read_errors(entries: Mapping[str, Any], sources: Sequence[Source], context: FileContext) -> dict[str, Distribution]:
    """Read the distributions of ``[errors]``, by source; mistakes are added to the context.

    A mistake in the entry of a group is told once.
    """
    known = {source.name: source for source in sources}
    distributions: dict[str, Distribution] = {}
    wrong: set[str] = set()
    for name, entry in expand_groups(entries, sources, context).items():
        key = f"errors.{entry.key}"
        if len(context.problems) > MOST_PROBLEMS:
            break
        if name not in known:
            context.problem(key, f"unknown error source{suggestion(name, list(known))}")
        elif key not in wrong:
            distribution = _read_distribution(entry.value, known[name], key, context)
            if distribution is None:
                wrong.add(key)
            else:
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
