"""Gates by linear analysis: errors that they stop, as a table, and what they make of good measurements."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Final

from mcnav.analysis.gates import SIGMAS
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.rejections import FlownRejections, OnLinear, RejectionAnswer
from mcnav.report.columns.result_table import in_units
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.format import number, probability
from mcnav.report.names import humanize

DOUBTS: Final = {
    "faults": "Sensors have faults, and linear analysis accepts every measurement: run samples to see what the gates "
    "reject",
    "considers": "The filter considers errors without estimating them, so its innovations are not independent. Run "
    "samples to see how many good measurements its gates reject, and what that does",
    "planned": "The filter's gains are planned and know of no rejection. Run samples to see how many good measurements "
    "its gates reject, and what that does",
    "steered": "The vehicle is steered by what it estimates, so a rejected measurement changes its path. Run samples "
    "to see how many good measurements its gates reject, and what that does",
    "inconsistent": "The filter is not consistent, so only samples show how many good measurements its gates reject, "
    "and what that does",
}
"""Sentences of why linear analysis says nothing of rejections."""

TONES: Final = {OnLinear.HOLDS: "", OnLinear.FAILS: "differs", OnLinear.REFUSED: "undecided"}
"""Tones of the verdicts."""


def rejection_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say how many good measurements gates reject, and what that can do; nothing without a gate."""
    if answer.rejections is not None:
        names = [output.name for output in answer.outputs]
        yield rejection_line(answer.rejections, names), TONES[answer.rejections.verdict]


def rejection_line(rejections: RejectionAnswer, outputs: Sequence[str]) -> str:
    """Put the verdict on rejections of good measurements in words."""
    expected, without = rejections.expected_least, rejections.accepted_by_all
    if expected is None or without is None:
        return DOUBTS[rejections.doubt]
    count = rejections.measurements
    said = (
        f"Gates reject about {number(expected, 2)} of {count:,} good measurement{'s' * (count != 1)} in each flight "
        f"(probability of none: {number(without, 3)})"
    )
    name, ratio = humanize(outputs[rejections.output]), number(rejections.ratio, 3)
    if rejections.by_flights is not None:
        return f"{said}. {_flown_words(rejections, rejections.by_flights, name, ratio)}"
    if rejections.verdict == OnLinear.HOLDS:
        return f"{said}. Linear sigmas hold: rejections multiply no rms by more than {ratio}"
    if rejections.verdict == OnLinear.FAILS:
        return f"{said}. Linear sigmas do not hold: a single rejection already multiplies the rms of {name} by {ratio}"
    again = rejections.largest_next
    lockout = ""
    if again is not None:
        percent = number(100.0 * again, 2)
        lockout = f". A rejection can start a lockout: the next measurement is rejected too with up to {percent} %"
    return f"{said}{lockout}. Linear analysis cannot say what that does to {name}: run samples, or mcnav lincov --gates"


def _flown_words(rejections: RejectionAnswer, flown: FlownRejections, name: str, ratio: str) -> str:
    """Say what flights that begin with a rejection make of linear analysis."""
    by = f"By {flown.flights:,} flights that begin with a rejection, weighted by its probability,"
    if rejections.verdict == OnLinear.HOLDS:
        seen = f"They cannot see a lockout that follows fewer than one first rejection in {flown.flights // 5:,}"
        return f"{by} linear sigmas hold: rejections multiply no rms by more than {ratio}. {seen}"
    times = f"the rms of {name} is {ratio} ± {number(flown.ratio_error, 2)} times the linear one"
    if rejections.verdict == OnLinear.FAILS:
        return f"{by} linear sigmas do not hold: {times}"
    return f"{by} {times}, which leaves open whether linear sigmas hold: run samples"


def gates_entry(answer: LinearAnswer) -> Mapping[str, object]:
    """Return what ``lincov.json`` has of gates: good measurements that they reject, and errors that they stop; SI."""
    rejections = answer.rejections
    assert rejections is not None
    return {
        "accepted_by_all": rejections.accepted_by_all,
        "expected_rejections_least": rejections.expected_least,
        "first": [asdict(each) for each in rejections.first],
        "rms_one_rejection": rejections.rms_once,
        "rms_never_again": rejections.rms_never,
        **({} if rejections.by_flights is None else {"by_flights": asdict(rejections.by_flights)}),
        "verdict": rejections.verdict.value,
        "line": rejection_line(rejections, [output.name for output in answer.outputs]),
        "stops": [asdict(row) for row in gate_rows(answer)],
    }


@dataclass(frozen=True)
class GateRow:
    """Errors of one component that the gate of a sensor stops, as ``lincov.json`` has it among ``gates``; SI.

    ``spike`` and ``ramp`` (a second) are the smallest that are stopped with ``probability``, none where the gate stops
    none; ``spike_error`` and ``ramp_error`` are what they add to ``output`` and to ``ramp_output`` where they pass.
    ``worst`` is the spike of the largest probability ``risk`` to pass and leave ``output`` beyond its ``limit``.
    """

    sensor: str
    component: str
    unit: str
    time: float
    probability: float
    spike: float | None
    output: str
    output_unit: str
    spike_error: float | None
    limit: float
    required: bool
    worst: float
    risk: float
    duration: float
    ramp: float | None
    ramp_output: str
    ramp_output_unit: str
    ramp_error: float | None


def gate_rows(answer: LinearAnswer) -> list[GateRow]:
    """List what gates stop; empty without a gate."""

    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return [
        GateRow(
            gate.sensor, gate.component, gate.unit, gate.time, gate.probability, known(gate.spike),
            answer.outputs[gate.output].name, answer.outputs[gate.output].unit, known(gate.spike_error), gate.limit,
            gate.required, gate.worst, gate.risk, gate.duration, known(gate.ramp),
            answer.outputs[gate.ramp_output].name, answer.outputs[gate.ramp_output].unit, known(gate.ramp_error),
        )
        for gate in answer.gates
    ]  # fmt: skip


def gate_table(answer: LinearAnswer) -> Table[GateRow] | None:
    """Tabulate what gates stop; none without a gate."""
    rows = gate_rows(answer)
    if not rows:
        return None
    shown_in = {output.name: output.shown_in for output in answer.outputs}
    scales = {(gate.sensor, gate.component): (gate.unit, gate.shown_in) for gate in answer.gates}

    def of_component(row: GateRow, value: float | None, rate: bool = False) -> str:
        if value is None:
            return "none"
        scale, unit = in_units(*scales[row.sensor, row.component], "shown")
        shown = unit if not rate else unit.replace("/s", "/s²") if unit.endswith("/s") else f"{unit}/s"
        return f"{number(value * scale, 3)} {shown}"

    def of_output(name: str, unit: str, value: float | None) -> Cell:
        if value is None:
            return Cell("–")
        scale, shown = in_units(unit, shown_in[name], "shown")
        return Cell(f"{number(value * scale, 3)} {shown}", below=humanize(name))

    def by_spike(row: GateRow) -> Cell:
        return of_output(row.output, row.output_unit, row.spike_error)

    def by_ramp(row: GateRow) -> Cell:
        return of_output(row.ramp_output, row.ramp_output_unit, row.ramp_error)

    def behind(cell: Cell) -> str:
        return f"{cell.text} in {cell.below}" if cell.below else cell.text

    stated, duration = probability(rows[0].probability), f"{rows[0].duration:g} s"
    columns: list[Column[GateRow]] = [
        Column("Sensor", lambda row: f"{humanize(row.sensor)}: {humanize(row.component)}", "sensor", "label"),
        Column("Spike stopped", lambda row: of_component(row, row.spike), "spike stopped"),
        Column("Its error", by_spike, place="page"),
        Column("", lambda row: behind(by_spike(row)), "its error", place="terminal"),
        Column("Ramp stopped", lambda row: of_component(row, row.ramp, rate=True), "ramp stopped"),
        Column("Its error", by_ramp, place="page"),
        Column("", lambda row: behind(by_ramp(row)), "its error at the end", place="terminal"),
        Column("Limit", lambda row: of_output(row.output, row.output_unit, row.limit), "limit"),
        Column("Worst spike", lambda row: of_component(row, row.worst), "worst spike"),
        Column("Unnoticed and beyond", lambda row: number(row.risk, 3), "unnoticed and beyond"),
    ]
    caption = (
        f"Smallest spike and ramp over {duration} that the gate of each sensor stops with a probability of {stated}, "
        "at its last measurement, and the error that they leave where they pass, in the output that they harm the most "
        f"by its limit: that of a requirement, else {SIGMAS:g} sigma. Unnoticed and beyond: probability that the worst "
        "spike passes and leaves the output beyond the limit."
    )
    return Table(caption, columns, rows, f"Gates: what they stop with {stated}")
