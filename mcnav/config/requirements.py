"""The table ``[accept]`` of a campaign file: requirements on the system, in the units of the scenario's outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from mcnav.config.requirement_times import RequirementEpochs, read_epochs
from mcnav.config.schema import AcceptTable
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.store.manifest import RequirementRecord

RADII: Final = {"cep": 0.5, "r95": 0.95, "sep": 0.5}
"""Probability of the errors within a radius, by the kind of requirement."""


def read_requirements(table: AcceptTable, scenario: Scenario, context: FileContext) -> list[RequirementRecord]:
    """Read all requirements; mistakes are added to the context."""
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
            for name in (each for each in names if each not in departing):
                context.problem(f"{key}.about", f"got {about!r}; {name} is no departure from the nominal flight")
        records.append(record)

    def limit(written: object, name: str, key: str) -> float:
        value = context.quantity(written, units[name], key)
        if value is not None and value <= 0.0:
            context.problem(key, f"got {written!r}; expected a limit above zero")
        return value or 1.0

    def known(names: Sequence[str], key: str) -> bool:
        return context.check_names(names, list(units), key, "output")

    if table.sigma_ratio is not None:
        require("sigma_ratio", list(units), [table.sigma_ratio], None)
    for number, entry in enumerate(table.quantile, start=1):
        key = f"accept.quantile #{number}"
        if known([entry.output], f"{key}.output"):
            largest = limit(entry.below, entry.output, f"{key}.below")
            epochs = read_epochs(entry, scenario, key, context)
            require("quantile", [entry.output], [largest], entry.probability, epochs, entry.of, key, entry.about)
    for kind, probability in RADII.items():
        for number, radius in enumerate(getattr(table, kind), start=1):
            key = f"accept.{kind} #{number}"
            if known(radius.outputs, f"{key}.outputs") and _alike(radius.outputs, units, f"{key}.outputs", context):
                largest = limit(radius.below, radius.outputs[0], f"{key}.below")
                epochs = read_epochs(radius, scenario, key, context)
                require(kind, radius.outputs, [largest], probability, epochs, radius.of, key, radius.about)
    for number, box in enumerate(table.box, start=1):
        key = f"accept.box #{number}"
        if not box.within:
            context.problem(f"{key}.within", "is empty; expected a limit for at least one output")
        elif known(list(box.within), f"{key}.within"):
            limits = [limit(written, name, f"{key}.within.{name}") for name, written in box.within.items()]
            require("box", list(box.within), limits, box.probability, key=key, about=box.about)
    return records


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
