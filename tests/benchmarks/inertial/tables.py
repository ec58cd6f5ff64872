"""The chapter as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from tests.benchmarks import machine
from tests.benchmarks.inertial.peers import LOOP, OWN, PYINS
from tests.benchmarks.inertial.targets import Target, targets
from tests.benchmarks.markdown import number, table

METHOD: Final = """\
    make bench BENCH="--only inertial"    # this chapter alone; its record is inertial.json

All fly the same ten minutes of an airliner, a climb and a turn of 90 degrees, with a navigation-grade unit (biases
and white noise) read at 100 Hz and GNSS position and velocity once a second. The filter has 15 states and believes
the true sizes. Errors are measured on the reference engine's samples with the same constant errors and the same noise
of every reading and every measurement, at ten epochs, in the filter's own sigmas; a peer's states are compared with
its own states without errors and noise, so that its model of gravity does not count. Shared gains are those along the
truth: the difference from the reference is that of the gains, not of the numerics. The reference engine itself has
steps of 0.1 s here, over which noise is constant. Times are of one core, in processor time, of five runs (three,
where a run takes more than two seconds), one of every peer in turns; each peer is a process of its own, and draws its
noise itself. python-ins at its default step flies two minutes, which counts five times (× 5). gnss-ins-sim has no
filter of this kind.

The loop is what one writes by hand to be compiled: strapdown in earth-fixed axes with corrections for coning and
sculling, the blocks of the transition matrix, scalar updates, noise by numpy's fastest generator. It runs sample by
sample, as do filterpy's filter with the same compiled strapdown, and python-ins.\
"""
"""How the measurements are made and read."""


def chapter(record: Mapping[str, Any]) -> list[str]:
    """Return the parts of the chapter."""
    return [
        "## Inertial navigation in three dimensions",
        METHOD,
        machine.sentence(record["machine"]),
        "### What must hold",
        targets_table(list(targets(record))),
        f"### {record['case']['seconds'] / 60.0:.0f} minutes with GNSS",
        _peers(record["peers"]),
        "### Samples a second",
        _engines(record["engines"], record["hour"]),
        "### What bounds the kernels in three dimensions",
        *_bounds(record["bounds"]),
        *_growth(record),
    ]


def targets_table(found: Sequence[Target]) -> str:
    """Show targets and measurements side by side."""
    rows = [
        [
            each.name, f"{'≥' if each.at_least else '≤'} {_figure(each.wanted)} {each.unit}",
            "not measured" if each.measured != each.measured else f"{_figure(each.measured)} {each.unit}",
            "yes" if each.holds else "no",
        ]
        for each in found
    ]  # fmt: skip
    return table(["", "target", "measured", "holds"], rows)


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def _peers(rows: Sequence[Mapping[str, Any]]) -> str:
    """Compare the peers: times of one core, and what they are to ours."""
    least = {row["peer"]: row["processor_milliseconds"]["least"] for row in rows if "processor_milliseconds" in row}
    head = [
        "", "method", "ms of one core per sample", "median, largest", "against own gains", "largest error, σ",
        "mean square, σ", "samples/s, two cores", "start-up", "memory",
    ]  # fmt: skip
    return table(head, [_peer(row, least.get(OWN)) for row in rows])


def _peer(row: Mapping[str, Any], ours: float | None) -> list[str]:
    for wrong in ("missing", "failed"):
        if wrong in row:
            said = "not installed" if wrong == "missing" else "failed"
            return [row["peer"], f"{said}: {row[wrong]}", *["–"] * 8]
    spent, both = row["processor_milliseconds"], row.get("two_cores", {}).get("wall_milliseconds")
    share = "" if row["share"] == 1.0 else f" (× {1.0 / row['share']:.0f})"
    against = None if ours is None else spent["least"] / ours
    return [
        row["peer"],
        row["method"],
        f"{spent['least']:.3g}{share}",
        f"{spent['median']:.3g}, {spent['largest']:.3g}",
        "–" if against is None else f"{against:,.0f} ×" if against >= 10.0 else f"{against:.2g} ×",
        *(["–"] * 2 if row.get("error") is None else _errors(row)),
        "–" if both is None else number(1e3 / both["median"], "–"),
        f"{row['start_up']:.1f} s",
        f"{row['megabytes']:.0f} MB",
    ]


def _errors(row: Mapping[str, Any]) -> list[str]:
    return [f"{row['error']:.0e} ({row['compared']} samples)", f"{row['root_mean_square']:.0e}"]


def _engines(rows: Sequence[Mapping[str, Any]], hour: float) -> str:
    """Show engines over their accuracy."""
    head = [
        "", "steps", "µs of one core per sample", "median, largest", "samples/s, two cores", "two cores against one",
        "largest error, σ", "mean square, σ",
    ]  # fmt: skip
    body = [
        [
            row["name"], f"{row['steps']:,}{' (the engine’s choice)' if row['accuracy'] else ''}",
            f"{row['processor_microseconds']['least']:,.3g}",
            f"{row['processor_microseconds']['median']:,.3g}, {row['processor_microseconds']['largest']:,.3g}",
            f"{row['two_threads_per_second']['median']:,.0f}",
            f"{row['speed_up']['median']:.2f} × ({row['speed_up']['least']:.2f} to {row['speed_up']['largest']:.2f})",
            *_errors(row),
        ]
        for row in rows
    ]  # fmt: skip
    return (
        f"{hour / 60.0:.0f} minutes of the same flight. Free: all constant errors and processes of a navigation-grade "
        "unit; without noise the final errors alone, with noise the errors at 61 epochs and the linear twin as well. "
        "Aided: GNSS once a second and 15 states, with twin and records of the filters at 61 epochs. Errors are at all "
        "epochs, against reference samples with the same noise.\n\n" + table(head, body)
    )


def _bounds(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Show what of a kernel's time random numbers, memory and operations take at least."""
    head = ["", "µs", "steps", "normal variates", "their share", "operations", "their share", "kB moved", "their share"]
    body = [
        [
            row["name"], f"{row['microseconds']:,.3g}", f"{row['steps']:,}", f"{row['normals']:,}",
            f"{row['normals_share']:.0%}", f"{row['operations']:,}", f"{row['operations_share']:.0%}",
            f"{row['bytes'] / 1e3:,.0f}", f"{row['memory_share']:.0%}",
        ]
        for row in rows
    ]  # fmt: skip
    if not rows:
        return []
    first = rows[0]
    return [
        table(head, body),
        f"A normal variate takes {first['normal_nanoseconds']:.1f} ns, one core does "
        f"{first['peak_operations_per_second'] / 1e9:.0f} billion operations a second as fused multiply-adds, and a "
        f"copy moves {first['peak_bytes_per_second'] / 1e9:.0f} GB/s: the shares are those of the time if nothing else "
        "were done. Operations are the products with a step's tables and the filter's covariance with its structure "
        "used; what else a step does is not counted. Memory is a block's pass over the tables and what is written of a "
        "sample.",
    ]


def _growth(record: Mapping[str, Any]) -> list[str]:
    """Show engines and whole runs as they grow."""
    parts = []
    if record["growth"]:
        pairs: dict[tuple[Any, ...], dict[str, float]] = {}
        for row in record["growth"]:
            key = (row["varied"], row["seconds"], row["interval"], row["states"])
            pairs.setdefault(key, {})[row["engine"]] = row["microseconds"]
        engines = sorted({row["engine"] for row in record["growth"]})
        body = [
            [varied, f"{seconds:,.0f} s", f"{interval:g} s", str(states), *(f"{found[each]:,.3g}" for each in engines)]
            for (varied, seconds, interval, states), found in pairs.items()
        ]
        head = ["varied", "duration", "between updates", "states", *(f"{each}: µs per sample" for each in engines)]
        parts += ["### Growth of aided navigation", table(head, body)]
    if record["commands"]:
        body = [
            [
                f"mcnav {row['command']}", "–" if row["samples"] is None else f"{row['samples']:,}", str(row["jobs"]),
                row["engine"] or "–", f"{row['seconds']['median']:.1f} s", f"{row['seconds']['least']:.1f}",
                f"{row['seconds']['largest']:.1f}", f"{row['processor_seconds']['median']:.1f} s",
                f"{row['megabytes']:.0f} MB",
            ]
            for row in record["commands"]
        ]  # fmt: skip
        head = ["command", "samples", "jobs", "engine", "seconds", "least", "largest", "processor", "memory"]
        parts += [
            f"### Whole runs of {record['hour'] / 60.0:.0f} aided minutes, from file to report",
            table(head, body),
        ]
    truth = record["truth"]
    if truth:
        parts.append(
            f"A trajectory of {truth['rows']:,.0f} rows is read in {truth['read']:.2f} s. Along it the tables of the "
            f"free ensemble take {truth['tables']:.2f} s, those of the aided one {truth['aided_tables']:.2f} s, and "
            f"all that a free run prepares, with the number of steps settled, {truth['engine']:.2f} s."
        )
    return parts


def sentence(record: Mapping[str, Any]) -> str:
    """Return the chapter's sentence in the README."""
    least = {
        row["peer"]: row["processor_milliseconds"]["least"]
        for row in record["peers"]
        if "processor_milliseconds" in row
    }
    if OWN not in least:
        return ""
    others = [
        f"{name} {_duration(least[each])}"
        for each, name in ((LOOP, "a compiled loop"), (PYINS, PYINS))
        if each in least
    ]
    compared = f" ({', '.join(others)})" if others else ""
    minutes = record["case"]["seconds"] / 60.0
    return (
        f"{minutes:.0f} minutes with GNSS once a second and a filter take {_duration(least[OWN])} a sample{compared}."
    )


def _duration(milliseconds: float) -> str:
    return f"{milliseconds:.2g} ms" if milliseconds < 100.0 else f"{1e-3 * milliseconds:.2g} s"
