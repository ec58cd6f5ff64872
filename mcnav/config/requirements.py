"""The table ``[accept]`` of a campaign file: requirements on the system, in the units of the scenario's outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from mcnav.config.requirement_times import RequirementEpochs, read_epochs
from mcnav.config.schema import AcceptTable
from mcnav.contract.quantities import Output
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.physics.units import UnitError, quantity
from mcnav.store.manifest import RequirementRecord

RADII: Final = {"cep": 0.5, "r95": 0.95, "sep": 0.5}
"""Probability of the errors within a radius, by the kind of requirement."""


def read_requirements(table: AcceptTable, scenario: Scenario, context: FileContext) -> list[RequirementRecord]:
    """Read all requirements; mistakes but those that `check_requirements` finds are added to the context."""
    units = {output.name: output.unit for output in scenario.outputs}
    departing = {output.name for output in scenario.outputs if output.departs}
    records: list[RequirementRecord] = []
    filtered = context.content.get("filter")
    smoothed = isinstance(filtered, Mapping) and "smoother" in filtered

    def require(
        kind: str, names: Sequence[str], limits: list[float], probability: float | None,
        epochs: RequirementEpochs | None = None, of: str | None = None, key: str = "", about: str | None = None,
    ) -> None:  # fmt: skip
        record = RequirementRecord(kind=kind, outputs=tuple(names), limits=tuple(limits), probability=probability)
        if epochs is not None:
            record = record.completed({"when": epochs.words, "epochs": epochs.numbers})
        if of is not None:
            when = "behind the smoother" if record.when is None else f"{record.when}, behind the smoother"
            record = record.completed({"of": of, "when": when})
            if not smoothed:
                context.problem(f"{key}.of", f'got {of!r}; it needs smoother = "fixed-interval" in [filter]')
        if about is not None:
            record = record.completed({"about": about})
            for name in (name for name in names if name not in departing):
                context.problem(f"{key}.about", f"got {about!r}; {name} is no departure from the nominal flight")
        records.append(record)

    def known(names: Sequence[str]) -> bool:
        return set(names) <= units.keys()

    def limit(written: object, name: str) -> float:
        try:
            return quantity(written, units[name])
        except UnitError:
            return 1.0  # `check_requirements` adds the mistake

    if table.sigma_ratio is not None:
        require("sigma_ratio", list(units), [table.sigma_ratio], None)
    for number, entry in enumerate(table.quantile, start=1):
        key = f"accept.quantile #{number}"
        if known([entry.output]):
            largest = limit(entry.below, entry.output)
            epochs = read_epochs(entry, scenario, key, context)
            require("quantile", [entry.output], [largest], entry.probability, epochs, entry.of, key, entry.about)
    for kind, probability in RADII.items():
        for number, radius in enumerate(getattr(table, kind), start=1):
            key = f"accept.{kind} #{number}"
            if known(radius.outputs):
                largest = limit(radius.below, radius.outputs[0])
                epochs = read_epochs(radius, scenario, key, context)
                require(kind, radius.outputs, [largest], probability, epochs, radius.of, key, radius.about)
    for number, box in enumerate(table.box, start=1):
        if known(list(box.within)):
            limits = [limit(written, name) for name, written in box.within.items()]
            require("box", list(box.within), limits, box.probability, key=f"accept.box #{number}", about=box.about)
    return records


def check_requirements(entries: object, outputs: Sequence[Output], context: FileContext) -> None:
    """Add the mistakes in names and limits of ``[accept]`` as it is written, whatever else is wrong with it."""
    units = {output.name: output.unit for output in outputs}
    for kind in ("quantile", *RADII, "box"):
        tables = entries.get(kind) if isinstance(entries, Mapping) else None
        for number, table in enumerate(tables if isinstance(tables, list) else (), start=1):
            if isinstance(table, Mapping):
                _check_requirement(table, f"accept.{kind} #{number}", units, context)


def _check_requirement(table: Mapping[str, Any], key: str, units: Mapping[str, str], context: FileContext) -> None:
    """Add the mistakes in names and limits of one requirement."""
    if isinstance(within := table.get("within"), Mapping):
        if not within:
            context.problem(f"{key}.within", "is empty; expected a limit for at least one output")
        context.check_names(within, list(units), f"{key}.within", "output")
        for name in within.keys() & units.keys():
            _check_limit(within[name], units[name], f"{key}.within.{name}", context)
        return
    named = "output" if "output" in table else "outputs"
    written = table.get(named)
    names = [name for name in (written if isinstance(written, list) else [written]) if isinstance(name, str)]
    known = [name for name in names if name in units]
    alike = context.check_names(names, list(units), f"{key}.{named}", "output")
    if alike and len(names) > 1:
        alike = _alike(names, units, f"{key}.{named}", context)
    if known and (alike or len(known) < len(names)) and "below" in table:
        _check_limit(table["below"], units[known[0]], f"{key}.below", context)


def _check_limit(written: object, unit: str, key: str, context: FileContext) -> None:
    value = context.quantity(written, unit, key)
    if value is not None and value <= 0.0:
        context.problem(key, f"got {written!r}; expected a limit above zero")


def _alike(names: Sequence[str], units: Mapping[str, str], key: str, context: FileContext) -> bool:
    """Add a mistake when outputs are not different ones of one unit; return whether they are."""
    twice = next((name for name in names if names.count(name) > 1), None)
    other = next((name for name in names if units[name] != units[names[0]]), None)
    shape = "a circle needs two" if len(names) == 2 else "a sphere needs three"
    if twice is not None:
        context.problem(key, f"got {twice!r} twice; expected {'two' if len(names) == 2 else 'three'} different outputs")
    elif other is not None:
        context.problem(key, f"{names[0]} and {other} have different units; {shape} of one")
    return twice is None and other is None
