"""Results of a judged record: sentences, tables, lines to paste, and the content of ``judge.json``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from mcnav.judgement.assessment import LEVEL
from mcnav.judgement.findings import CauseVerdict, Finding, OffsetVerdict
from mcnav.judgement.naming import CLOCK, DELAY
from mcnav.judgement.profile import Factor
from mcnav.judgement.verdict import Judgement, NeesVerdict, SensorVerdict, Statistic
from mcnav.judgement.whitened_records import FACTORS
from mcnav.physics.units import conversion
from mcnav.report.document.parts import Lines, Note, Part, Sentence, Verdict, joined
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.report.statements.words import several
from mcnav.statistics import proportions

NAMED: Final = 2
"""Numbers that a sentence names; the table has all."""

CONFIDENCE: Final = 0.95
MORE: Final = 1_000
"""Confidence of an interval, and records to simulate at least where few do not decide."""

TWICE: Final = FACTORS.index(2.0)


def in_unit(value: float, unit: str, shown_in: str, digits: int = 3) -> str:
    """Write a size with the unit in which it is shown.

    >>> in_unit(0.005, "rad", "mrad")
    '5.00 mrad'
    """
    if shown_in == "1":
        return number(value, digits)
    return f"{number(value * conversion(unit, shown_in), digits)} {shown_in}"


INITIAL: Final = ("position", "velocity", "tilt", "heading")
"""Initial errors, whose number in a campaign is a sigma."""


def plain_name(name: str) -> str:
    """Return the words for a number.

    >>> plain_name("gnss_position_correlated"), plain_name("gyro_bias")
    ('correlated gnss position error', 'gyro bias')
    """
    measured = name.removesuffix("_correlated")
    return humanize(name) if measured == name else f"correlated {humanize(measured)} error"


def named(number_: CauseVerdict | OffsetVerdict) -> str:
    """Return the number with its place in the campaign.

    The size of a cause is given as well.
    """
    words = plain_name(number_.name)
    if isinstance(number_, OffsetVerdict):
        return words
    if number_.name in INITIAL:
        words = f"initial {words} sigma"
    if number_.absent or (number_.size == 1.0 and number_.unit == "1"):
        return words
    return f"{words} of {in_unit(number_.size, number_.unit, number_.shown_in)}"


def factor_words(number_: CauseVerdict) -> str:
    """Say by how much a size is wrong, with the 95 % interval."""
    factor = number_.factor
    if factor is None:
        return f"the {named(number_)} is wrong"
    if number_.absent:
        return _absent_words(number_, factor)
    if factor.value >= 1.0:
        value, low, high, side = factor.value, factor.low, factor.high, "small"
    else:
        value, low, high = (1.0 / bound if bound > 0.0 else np.inf for bound in (factor.value, factor.high, factor.low))
        side = "large"
    interval = f"at least {number(low, 3)}" if np.isinf(high) else f"{number(low, 3)} to {number(high, 3)}"
    return f"the {named(number_)} is {number(value, 3)} times too {side}: {interval}"


def _absent_words(number_: CauseVerdict, factor: Factor) -> str:
    """Say how large a process is that the campaign does not have, with the 95 % interval."""
    size, low, high = (
        in_unit(number_.size * value, number_.unit, number_.shown_in)
        for value in (factor.value, factor.low, factor.high)
    )
    text = f"there is {_article(named(number_))} that the campaign does not have: {size} ({low} to {high})"
    if number_.correlation_time > 0.0:
        text += f", with a correlation time of {number_.correlation_time:g} s"
    return text


def _article(words: str) -> str:
    return f"an {words}" if words[:1] in "aeiou" else f"a {words}"


def offset_words(number_: OffsetVerdict) -> str:
    """Say how large an error is that the campaign does not have, with the 95 % interval of each axis."""
    scale = 1.0 if number_.shown_in == "1" else conversion(number_.unit, number_.shown_in)
    if number_.name.endswith(DELAY):
        return _delay_words(number_, scale)
    if number_.name.endswith(CLOCK):
        return _clock_words(number_, scale)
    parts = []
    for place, axis in enumerate(number_.axes):
        if not number_.seen[place]:
            continue
        value, error = signed_estimate(number_, place), 1.959964 * number_.sigma[place]
        parts.append(f"{axis} {number(value * scale, 3)} ± {number(error * scale, 2)}".strip())
    unit = "" if number_.shown_in == "1" else f" {number_.shown_in}"
    if number_.used is not None:
        return f"the {humanize(number_.name)} is wrong: true are {', '.join(parts)}{unit}"
    return f"there is {_article(humanize(number_.name))} that the campaign does not have: {', '.join(parts)}{unit}"


def _delay_words(number_: OffsetVerdict, scale: float) -> str:
    """Say how late a sensor is."""
    value, error = number_.estimate[0] * scale, 1.959964 * number_.sigma[0] * scale
    sensor = humanize(number_.name.removesuffix(DELAY))
    size = f"{number(abs(value), 3)} ± {number(error, 2)} {number_.shown_in}"
    if number_.beside_arm is not None:
        free, error = (part * scale for part in number_.beside_arm)
        size += f" ({number(abs(free), 3)} ± {number(1.959964 * error, 2)} with the lever arm free as well)"
    if value >= 0.0:
        return f"the {sensor} measurements are late: they were taken {size} before their stamps"
    return f"the {sensor} measurements are early, or the readings late: they were taken {size} after their stamps"


def _moves(judgement: Judgement) -> list[str]:
    """Say how stamps are moved where a delay is too long for a campaign."""
    result = []
    for number_ in (finding.number for finding in judgement.findings):
        if isinstance(number_, OffsetVerdict) and number_.too_long:
            scale, late = conversion(number_.unit, number_.shown_in), number_.estimate[0] >= 0.0
            size = f"{number(abs(number_.estimate[0]) * scale, 4)} {number_.shown_in}"
            sensor = humanize(number_.name.removesuffix(DELAY))
            what = f"Subtract {size} from" if late else f"Add {size} to"
            result.append(
                f"{what} the {sensor} stamps: this delay is too long for a campaign, because the innovations are not "
                "linear in it."
            )
    return result


def _clock_words(number_: OffsetVerdict, scale: float) -> str:
    """Say how fast the clock of a sensor runs, and how its stamps are corrected."""
    rate, error = number_.estimate[0], 1.959964 * number_.sigma[0]
    sensor, side = humanize(number_.name.removesuffix(CLOCK)), "fast" if rate > 0.0 else "slow"
    size = f"{number(abs(rate) * scale, 3)} ± {number(error * scale, 2)} {number_.shown_in}"
    moved = f"{'subtract' if number_.at_start >= 0.0 else 'add'} {number(1e3 * abs(number_.at_start), 4)} ms"
    return (
        f"the {sensor} clock runs {size} {side} against the readings: multiply its stamps, counted from the first "
        f"reading, by {1.0 / (1.0 + rate):.8f} and {moved}"
    )


def signed_estimate(number_: OffsetVerdict, place: int) -> float:
    """Return the estimate of a constant error along an axis; of a lever arm the true one, as it is pasted."""
    value = number_.estimate[place]
    return value if number_.used is None else number_.used[place] - value


def words(finding: Finding) -> str:
    """Say what is wrong, without a full stop; of numbers that are not told apart, each as if it were it."""
    first, *others = (
        factor_words(number_) if isinstance(number_, CauseVerdict) else offset_words(number_)
        for number_ in finding.alternatives
    )
    if not others:
        return first
    return f"either {first}, or {', or '.join(others)}; this record does not tell which"


def verdict(judgement: Judgement) -> Verdict:
    """Return the verdict in large type and the sentences below it."""
    chance = _share(judgement.probability, judgement.simulated)
    compared = f"of {judgement.simulated:,} records simulated by the campaign, {chance} are as unusual as this one"
    few = _too_few(judgement)
    if not judgement.alarm:
        headline = "Nothing in this record is at odds with the campaign."
        usual = f"{_capital(compared)}; below 5 % would be an alarm."
        return Verdict(headline, "agrees", (usual, *few, *power(judgement)))
    if judgement.findings and not judgement.explained:
        return _unexplained(judgement, f"{_capital(compared)}.")
    if not judgement.findings:
        headline = "This record is at odds with the campaign, and no single number of the campaign explains it."
        told = [f"{_capital(compared)}.", *few, *_farthest(judgement), *correlated(judgement)]
        return Verdict(headline, "differs", (*told, *power(judgement)))
    first = judgement.findings[0]
    sentences = [*_moves(judgement), f"{_capital(compared)}.", *few]
    sentences += [f"Besides, {words(finding)}." for finding in judgement.findings[1:]]
    sentences.append(_left(judgement.findings[-1], len(judgement.findings), judgement.simulated))
    if judgement.findings[-1].left <= LEVEL:
        sentences += correlated(judgement)
    return Verdict(f"{_capital(words(first))}.", "differs", (*sentences, *power(judgement)))


def _too_few(judgement: Judgement) -> list[str]:
    """Say that simulated records do not decide between an alarm and none; nothing where they do.

    They are as unusual as the record with a probability whose interval has the level of an alarm in it.
    """
    count, unusual = judgement.simulated, round(judgement.probability * (judgement.simulated + 1.0)) - 1
    low, high = proportions.probability_interval(max(unusual, 0), count, CONFIDENCE)
    if not low < LEVEL < high:
        return []
    ends = f"{number(100.0 * low, 2)} to {number(100.0 * high, 2)} %"
    return [
        f"That is {ends} at {100.0 * CONFIDENCE:g} % confidence: judge again with --records {max(MORE, 10 * count)}."
    ]


def _farthest(judgement: Judgement) -> list[str]:
    """Name the size whose interval is farthest from what the campaign has; nothing where all contain it."""
    known = [(cause, cause.factor) for cause in judgement.causes if cause.factor is not None and not cause.absent]
    off = [(cause, factor) for cause, factor in known if not factor.low <= 1.0 <= factor.high and factor.low > 0.0]
    if not off:
        return []
    cause, factor = max(off, key=lambda pair: abs(math.log(pair[1].value)) / math.log(pair[1].high / pair[1].low))
    ends = f"{number(factor.low, 3)} to {number(factor.high, 3)}"
    return [f"Farthest off is {plain_name(cause.name)}, {number(factor.value, 3)} times ({ends})."]


def _unexplained(judgement: Judgement, compared: str) -> Verdict:
    """Say that a record is not explained by what comes nearest, of which no interval is given."""
    nearest = [plain_name(finding.number.name) for finding in judgement.findings]
    tried = "this number" if len(nearest) == 1 else f"these {len(nearest)} numbers"
    return Verdict(
        "This record is at odds with the campaign, and no number of the campaign explains it.", "differs",
        (
            compared, f"Nearest come the {', then the '.join(nearest)}.",
            f"With {tried} changed, still none of the simulated records is as unusual: do not change the campaign by "
            "this record. Check units, axes, signs and clocks of the files first.",
            *correlated(judgement), *power(judgement),
        ),
    )  # fmt: skip


def correlated(judgement: Judgement) -> list[str]:
    """Say of which sensors the innovations are more correlated than in simulated records."""
    return [
        f"Innovations of {humanize(sensor.name)} are correlated from one to the next: "
        f"{number(sensor.autocorrelation.value, 2)}, where simulated records have {_range(sensor.autocorrelation)}. "
        "What is named does not explain it."
        for sensor in judgement.sensors if not sensor.autocorrelation.usual
    ]  # fmt: skip


def _share(probability: float, simulated: int) -> str:
    """Say how many of the simulated records are as unusual.

    >>> _share(0.394, 1000), _share(1.0 / 1001.0, 1000)
    ('39 %', 'none')
    """
    if probability * (simulated + 1.0) < 1.5:
        return "none"
    return f"{number(100.0 * probability, 2)} %"


def _left(last: Finding, count: int, simulated: int) -> str:
    """Say what is left once the numbers are changed."""
    changed = "this number" if count == 1 else f"these {count} numbers"
    chance = _share(last.left, simulated)
    if last.left > 0.05:
        return f"With {changed} changed, {chance} of simulated records are as unusual: nothing else is at odds."
    return f"With {changed} changed, {chance} of simulated records are as unusual: something else is wrong, too."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def power(judgement: Judgement) -> tuple[str, ...]:
    """Say what this record could have shown, a sentence for what it shows and one for what it does not."""
    noticed = sorted((cause.noticed, humanize(cause.name)) for cause in judgement.causes if cause.noticed is not None)
    shown = [f"{name} × {factor:g}" for factor, name in noticed]
    hidden = [humanize(cause.name) for cause in judgement.causes if cause.noticed is None]
    sentences = []
    if shown:
        sentences.append(f"Found in 9 of 10 records of this length: {several(shown, NAMED)}.")
    if hidden:
        sentences.append(f"Not found even {FACTORS[-1]:g} times as large in 9 of 10 records: {several(hidden, NAMED)}.")
    return tuple(sentences)


def _range(statistic: Statistic) -> str:
    return f"{number(statistic.low, 3)} to {number(statistic.high, 3)}"


def _toned(statistic: Statistic) -> Cell:
    return Cell(number(statistic.value, 3), tone=None if statistic.usual else "differs")


def _rejected(verdict: SensorVerdict) -> str:
    """Say how many measurements the gate rejected, and how many it does of a consistent filter."""
    if verdict.expected_rejected is None:
        return f"{verdict.rejected:,}"
    return f"{verdict.rejected:,} ({number(verdict.expected_rejected, 2)} expected)"


def sensor_table(judgement: Judgement) -> Table[SensorVerdict]:
    """Tabulate the innovations of each sensor."""
    columns: list[Column[SensorVerdict]] = [
        Column("Sensor", lambda row: humanize(row.name), "sensor", "label"),
        Column("updates", lambda row: f"{row.updates:,}"),
        Column("rejected", _rejected),
        Column("mean NIS", lambda row: _toned(row.nis)),
        Column("95 % of records", lambda row: _range(row.nis)),
        Column("autocorrelation", lambda row: _toned(row.autocorrelation)),
        Column("95 % of records", lambda row: _range(row.autocorrelation)),
        Column("correlation length", lambda row: number(row.correlation_length.value, 2), unit="s"),
    ]
    caption = (
        "Innovations as the filter whitens them: mean square over the number of components, autocorrelation at lag 1. "
        "Each range holds 95 % of simulated records, so that one of twenty entries is outside of its range by chance."
    )
    return Table(caption, columns, judgement.sensors, "Innovations")


def nees_table(judgement: Judgement) -> Table[NeesVerdict] | None:
    """Tabulate the errors against the reference; none without one."""
    if not judgement.nees:
        return None
    columns: list[Column[NeesVerdict]] = [
        Column("Errors", lambda row: row.group, "errors", "label"),
        Column("mean NEES / 3", lambda row: _toned(row.nees)),
        Column("95 % of records", lambda row: _range(row.nees)),
    ]
    caption = "Errors against the reference, whose variances are added to the filter's."
    return Table(caption, columns, judgement.nees, "Errors against the reference")


def cause_table(judgement: Judgement) -> Table[CauseVerdict]:
    """Tabulate the sizes of the campaign: what the record says of each, and what it could say."""

    def factor(verdict: CauseVerdict) -> str:
        if verdict.factor is None:
            return "–"
        if verdict.factor.low == 0.0 and np.isinf(verdict.factor.high):
            return "not told"
        if verdict.factor.low == 0.0:
            return f"at most {number(verdict.factor.high, 3)}"
        if np.isinf(verdict.factor.high):
            return f"at least {number(verdict.factor.low, 3)}"
        return (
            f"{number(verdict.factor.value, 3)} ({number(verdict.factor.low, 3)} to {number(verdict.factor.high, 3)})"
        )

    columns: list[Column[CauseVerdict]] = [
        Column("Number", lambda row: humanize(row.name), "number", "label"),
        Column("in the campaign", lambda row: in_unit(row.size, row.unit, row.shown_in)),
        Column("factor by this record (95 %)", factor, "factor (95 %)"),
        Column("found if 2 times as large", lambda row: f"{100.0 * row.found[TWICE]:.0f} %", "found at 2x"),
        Column("and named", lambda row: f"{100.0 * row.named[TWICE]:.0f} %", "named at 2x"),
        Column("found in 9 of 10 from", lambda row: "–" if row.noticed is None else f"{row.noticed:g} x"),
    ]
    caption = (
        "Each number alone, with what is named changed and all others as in the campaign. Its factor is by maximum "
        "likelihood, with the interval of the likelihood ratio. Found: share of simulated records in which it is found."
    )
    return Table(caption, columns, judgement.causes, "Numbers of the campaign")


def offset_table(judgement: Judgement) -> Table[tuple[OffsetVerdict, int]] | None:
    """Tabulate constant errors that the campaign does not have; none where there are none."""
    rows = [(offset, place) for offset in judgement.offsets for place in range(len(offset.axes))]
    if not rows:
        return None

    def shown(row: tuple[OffsetVerdict, int], values: Sequence[float], digits: int) -> str:
        each, place = row
        value = values[place]
        return "–" if not np.isfinite(value) else in_unit(value, each.unit, each.shown_in, digits)

    def estimated(row: tuple[OffsetVerdict, int]) -> str:
        if not row[0].seen[row[1]]:
            return "not seen in this record"
        return shown(row, [signed_estimate(row[0], place) for place in range(len(row[0].axes))], 3)

    columns: list[Column[tuple[OffsetVerdict, int]]] = [
        Column("Error", lambda row: f"{humanize(row[0].name)} {row[0].axes[row[1]]}".strip(), "error", "label"),
        Column("by this record", estimated),
        Column("sigma", lambda row: shown(row, row[0].sigma, 2) if row[0].seen[row[1]] else "–"),
        Column("found in 9 of 10 from", lambda row: shown(row, row[0].noticed, 2) if row[0].seen[row[1]] else "–"),
    ]
    caption = (
        "Constant errors that the campaign does not have, each alone, with what is named changed. Of a lever arm, the "
        "true one is given."
    )
    return Table(caption, columns, rows, "Errors that the campaign does not have")


def to_paste(judgement: Judgement) -> str:
    """Return the entries of the campaign that change, as TOML in which each table stands once; empty for none.

    Nothing is to be changed where what is named does not explain the record, or stamps have to be corrected first.
    """
    if not judgement.explained or any(_of_stamps(finding.number) for finding in judgement.findings):
        return ""
    tables: dict[str, list[str]] = {}
    for finding in judgement.findings:
        place, _, key = finding.number.key.partition("] ")
        sensor, _, measured = key.rpartition(": ")
        if finding.number.name.endswith(DELAY):
            place, sensor, measured = "[errors", "", finding.number.name
        header = f"{place}]" + (f"  # {sensor}" if sensor else "")
        if changed := _new_value(finding.number):
            entries = tables.setdefault(header, [])
            entries[:] = [entry for entry in entries if not entry.startswith(f"{measured} = ")]
            entries.append(f"{measured} = {changed}")
    return "\n\n".join("\n".join([header, *entries]) for header, entries in tables.items())


def _of_stamps(number_: CauseVerdict | OffsetVerdict) -> bool:
    """Return whether stamps have to be corrected, and not the campaign."""
    return isinstance(number_, OffsetVerdict) and (number_.name.endswith(CLOCK) or number_.too_long)


def _new_value(number_: CauseVerdict | OffsetVerdict) -> str:
    def quoted(value: float) -> str:
        scale = 1.0 if number_.shown_in == "1" else conversion(number_.unit, number_.shown_in)
        return f'"{value * scale:.4g} {number_.shown_in}"'

    if isinstance(number_, CauseVerdict):
        return _new_size(number_, quoted)
    if number_.name.endswith(DELAY):
        return f'{{ distribution = "fixed", value = {quoted(number_.estimate[0])} }}'
    if number_.used is not None:
        return f"[{', '.join(quoted(signed_estimate(number_, place)) for place in range(len(number_.axes)))}]"
    size = float(np.sqrt(np.mean(np.square(np.compress(number_.seen, number_.estimate)))))
    return f"{quoted(size)}  # a sigma, from the size that this record shows"


def _new_size(number_: CauseVerdict, quoted: Callable[[float], str]) -> str:
    if number_.factor is None or number_.unit == "1":
        return ""
    factor = number_.factor.value
    if number_.correlation_time > 0.0:
        time = f'correlation_time = "{number_.correlation_time:g} s"'
        return f"{{ sigma = {quoted(number_.size * factor)}, {time} }}"
    if number_.absent:
        return quoted(number_.size * factor)
    if number_.log_factor is not None:
        return f"{number_.log_factor * factor:.4g}  # {factor:.3g} times {number_.log_factor:.4g}"
    return f"{quoted(number_.size * factor)}  # {factor:.3g} times {quoted(number_.size)}"


def terminal(judgement: Judgement) -> list[Part]:
    """List what the terminal shows: the verdict, what to change, then all tables."""
    pasted = to_paste(judgement)
    notes = [Note(f"note: {note}") for note in judgement.notes]
    changed: list[Part] = [Lines(pasted, "Tables to paste")] if pasted else []
    tables = joined(sensor_table(judgement), nees_table(judgement), cause_table(judgement), offset_table(judgement))
    return [verdict(judgement), *changed, *notes, *tables]


def basis(judgement: Judgement) -> Sentence:
    """Say what was compared."""
    return Sentence(
        f"{judgement.measurements:,} measurements in {number(judgement.duration, 4)} s, compared with "
        f"{judgement.simulated:,} simulated records. These are of the campaign's linear system along the recorded "
        "flight, with the gains that the filter used."
    )


def content(judgement: Judgement) -> Mapping[str, Any]:
    """Return the content of ``judge.json``, SI."""
    table = asdict(judgement)
    del table["predicted"]
    table["alarm"], table["sentence"] = judgement.alarm, verdict(judgement).headline
    table["factors"] = list(FACTORS)
    for finding in table["findings"]:
        finding["number"] = finding["number"]["name"]
        finding["rivals"] = [rival["name"] for rival in finding["rivals"]]
    return table
