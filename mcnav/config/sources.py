"""The tables ``[errors]``, ``[[correlations]]`` and ``[[joint]]`` of a campaign file, in the units of its sources."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from mcnav.config.distributions import ENTRY, KIND, implausible
from mcnav.config.schema import CorrelationTable, JointTable
from mcnav.config.table_of_values import ValuesError
from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.validation import validate_entry
from mcnav.errors import MOST_PROBLEMS, suggestion
from mcnav.sampler.distributions import Distribution
from mcnav.sampler.error_model import Correlation
from mcnav.sampler.multivariate_t import MultivariateT


@dataclass(frozen=True)
class Entry:
    """The entry of a source, and the key under which it is written."""

    value: Any
    key: str


@dataclass(frozen=True)
class KnownSources:
    """Sources that a file may name.

    Attributes
    ----------
    sources : sequence of Source
    further : tuple of str
        Patterns of names that others may have: of tables that cannot be read.
    """

    sources: Sequence[Source]
    further: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """Names of the sources."""
        return [source.name for source in self.sources]

    def may_be(self, name: object) -> bool:
        """Return whether a name may be that of a source that is not known."""
        return isinstance(name, str) and any(re.fullmatch(pattern, name) for pattern in self.further)


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


SIZES: Final = ("sigma", "mean", "half_width", "limit", "value", "loc", "scale")
"""Keys of distributions that have the unit of their source."""


def with_units(entries: Mapping[str, Any], sources: Sequence[Source]) -> dict[str, Any]:
    """Write numbers of ``[errors]`` that are SI as text with the unit of their source, or of their group.

    >>> with_units({"altitude": 5e3}, [Source("altitude", "m", "km", 1e3)])
    {'altitude': '5000.0 m'}
    >>> with_units({"altitude": {"mean": 2.0, "sigma": 1.0}}, [Source("altitude", "m", "km", 1e3)])
    {'altitude': {'mean': '2.0 m', 'sigma': '1.0 m'}}
    """
    units = {source.group: source.unit for source in sources} | {source.name: source.unit for source in sources}

    def written(entry: Any, unit: str) -> Any:
        if isinstance(entry, list):
            return [written(value, unit) for value in entry]
        if isinstance(entry, dict):
            stated = entry.keys() & {KIND, *SIZES}
            return {key: written(value, unit if not stated or key in SIZES else "") for key, value in entry.items()}
        number = isinstance(entry, (int, float)) and not isinstance(entry, bool)
        return f"{float(entry)!r} {unit}" if number and unit not in ("", "1") else entry

    return {name: written(entry, units.get(name, "")) for name, entry in entries.items()}


def read_errors(
    entries: Mapping[str, Any], known_sources: KnownSources, context: FileContext
) -> dict[str, Distribution]:
    """Read the distributions of ``[errors]``, by source; mistakes are added to the context.

    A mistake in the entry of a group is told once.
    """
    sources = known_sources.sources
    known = {source.name: source for source in sources}
    distributions: dict[str, Distribution] = {}
    wrong: set[str] = set()
    for name, entry in expand_groups(entries, sources, context).items():
        key = f"errors.{entry.key}"
        if len(context.problems) > MOST_PROBLEMS:
            break
        if name not in known:
            if not known_sources.may_be(name):
                names = list(dict.fromkeys([*(source.group for source in sources if source.group), *known]))
                context.problem(key, f"unknown error source{suggestion(name, names)}")
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
        context.problem(key, f"got {written}; {str(wrong).partition('; got ')[0]}")
        return None
    size = max(abs(distribution.mean), distribution.standard_deviation)
    if too_large := implausible(size, source):
        context.problem(key, f"its mean or sigma is {size:.3g}; {too_large}")
        return None
    return distribution


def check_names(content: Mapping[str, Any], known: KnownSources, context: FileContext) -> None:
    """Add the mistakes in the names of ``[[correlations]]`` and ``[[joint]]`` as written, whatever else is wrong."""
    seen: set[frozenset[str]] = set()
    for key, names in _named_sources(content):
        context.check_names([name for name in names if not known.may_be(name)], known.names, key, "error source")
        if not key.startswith("correlations") or len(names) != 2:
            continue
        first, second = names
        if first == second:
            context.problem(key, f"got {first!r} twice; expected two different sources")
        elif {first, second} in seen:
            context.problem(key, f"{first} and {second} are correlated twice; expected one entry for each pair")
        seen.add(frozenset((first, second)))


def _named_sources(content: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield the names of sources that entries list, by their keys."""
    for table, name in (("correlations", "between"), ("joint", "sources")):
        entries = content.get(table)
        for number, entry in enumerate(entries if isinstance(entries, list) else (), start=1):
            names = entry.get(name) if isinstance(entry, Mapping) else None
            if isinstance(names, list):
                yield f"{table} #{number}.{name}", [name for name in names if isinstance(name, str)]


def read_correlations(tables: Sequence[CorrelationTable]) -> list[Correlation]:
    """Read the entries of ``[[correlations]]``, whose names `check_names` has checked."""
    return [
        Correlation(
            (entry.between[0], entry.between[1]),
            (entry.rank_coefficient if entry.coefficient is None else entry.coefficient) or 0.0,
            of_ranks=entry.coefficient is None,
        )
        for entry in tables
    ]


def read_joint(tables: Sequence[JointTable], context: FileContext) -> list[MultivariateT]:
    """Read the entries of ``[[joint]]``; mistakes but those of names are added to the context."""
    joint = []
    for number, entry in enumerate(tables, start=1):
        try:
            joint.append(MultivariateT(tuple(entry.sources), entry.degrees_of_freedom))
        except ValueError as wrong:
            context.problem(f"joint #{number}.degrees_of_freedom", f"got {entry.degrees_of_freedom:g}; {wrong}")
    return joint
