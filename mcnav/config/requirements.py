"""The table ``[accept]`` of a campaign file: what the system must do, in the units of the scenario's outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mcnav.config.schema import AcceptTable
from mcnav.errors import Problem, suggestion
from mcnav.scenarios.protocol import Output
from mcnav.units import UnitError, quantity


def read_requirements(
    table: AcceptTable, file: str, outputs: Sequence[Output], problems: list[Problem]
) -> list[Mapping[str, Any]]:
    """The requirements, SI; mistakes are added to the list.

    Returns
    -------
    list of mapping
        ``kind`` (``sigma_ratio``, ``quantile``, ``cep`` or ``box``), ``outputs`` (their names), ``limits`` (one for
        each of them, or a single one), ``probability`` (none for a sigma ratio).
    """
    known = {output.name: output for output in outputs}

    def limit(written: Any, name: str, key: str) -> float:
        try:
            value = quantity(written, known[name].unit)
        except UnitError as wrong:
            problems.append(Problem(file, key, str(wrong)))
            return 1.0
        if value <= 0.0:
            problems.append(Problem(file, key, f"got {written!r}; expected a limit above zero"))
        return value

    def missing(names: Sequence[str], key: str) -> bool:
        wrong = [name for name in names if name not in known]
        problems.extend(Problem(file, key, f"unknown output {name!r}{suggestion(name, list(known))}") for name in wrong)
        return bool(wrong)

    found: list[Mapping[str, Any]] = []
    if table.sigma_ratio is not None:
        found.append(_requirement("sigma_ratio", list(known), [table.sigma_ratio], None))
    for number, entry in enumerate(table.quantile, start=1):
        key = f"accept.quantile #{number}"
        if not missing([entry.output], f"{key}.output"):
            most = limit(entry.below, entry.output, f"{key}.below")
            found.append(_requirement("quantile", [entry.output], [most], entry.probability))
    for number, circle in enumerate(table.cep, start=1):
        key = f"accept.cep #{number}"
        if missing(circle.outputs, f"{key}.outputs"):
            continue
        first, second = circle.outputs
        if first == second:
            problems.append(Problem(file, f"{key}.outputs", f"got {first!r} twice; expected two different outputs"))
        elif known[first].unit != known[second].unit:
            message = f"{first} and {second} have different units; a circle needs two of one"
            problems.append(Problem(file, f"{key}.outputs", message))
        else:
            found.append(_requirement("cep", [first, second], [limit(circle.below, first, f"{key}.below")], 0.5))
    for number, box in enumerate(table.box, start=1):
        key = f"accept.box #{number}"
        if not box.within:
            problems.append(Problem(file, f"{key}.within", "is empty; expected a limit for at least one output"))
        elif not missing(list(box.within), f"{key}.within"):
            limits = [limit(written, name, f"{key}.within.{name}") for name, written in box.within.items()]
            found.append(_requirement("box", list(box.within), limits, box.probability))
    return found


def _requirement(kind: str, outputs: list[str], limits: list[float], probability: float | None) -> Mapping[str, Any]:
    return {"kind": kind, "outputs": outputs, "limits": limits, "probability": probability}
