"""The table ``[accept]`` of a campaign file: requirements on the system, in the units of the scenario's outputs."""

from __future__ import annotations

from collections.abc import Sequence

from mcnav.config.context import FileContext
from mcnav.config.schema import AcceptTable
from mcnav.scenarios.protocol import Output
from mcnav.store.manifest import RequirementRecord


def read_requirements(table: AcceptTable, outputs: Sequence[Output], context: FileContext) -> list[RequirementRecord]:
    """Read all requirements; mistakes are added to the context."""
    units = {output.name: output.unit for output in outputs}
    found: list[RequirementRecord] = []

    def require(kind: str, names: list[str], limits: list[float], probability: float | None) -> None:
        found.append(RequirementRecord(kind=kind, outputs=tuple(names), limits=tuple(limits), probability=probability))

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
            require("quantile", [entry.output], [largest], entry.probability)
    for number, circle in enumerate(table.cep, start=1):
        key = f"accept.cep #{number}"
        if not known(circle.outputs, f"{key}.outputs"):
            continue
        first, second = circle.outputs
        if first == second:
            context.problem(f"{key}.outputs", f"got {first!r} twice; expected two different outputs")
        elif units[first] != units[second]:
            context.problem(f"{key}.outputs", f"{first} and {second} have different units; a circle needs two of one")
        else:
            require("cep", [first, second], [limit(circle.below, first, f"{key}.below")], 0.5)
    for number, box in enumerate(table.box, start=1):
        key = f"accept.box #{number}"
        if not box.within:
            context.problem(f"{key}.within", "is empty; expected a limit for at least one output")
        elif known(list(box.within), f"{key}.within"):
            limits = [limit(written, name, f"{key}.within.{name}") for name, written in box.within.items()]
            require("box", list(box.within), limits, box.probability)
    return found
