"""The measurements as Markdown: the page of benchmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from tests.benchmarks import machine, slopes, waits
from tests.benchmarks.compare import TARGETS
from tests.benchmarks.inertial.tables import chapter
from tests.benchmarks.kernel import sentence
from tests.benchmarks.markdown import number, table

METHOD: Final = """\
    make bench                      # all chapters with all peers and whole runs: a quarter of an hour, idle machine
    make bench BENCH="1 7 --full"   # other trajectories, and 10^8 samples; python -m tests.benchmarks --help
    make bench BENCH="--only inertial"    # one chapter: waits, whole-runs, reentry, or inertial
    .venv/bin/python -m tests.benchmarks.kernel    # the ensemble's kernel alone, all seven trajectories
    .venv/bin/python -m tests.benchmarks.readme    # this page and the lines of the README again, from the record

`make bench` writes this page, `work_precision.svg` and the records `benchmarks.json`, `inertial.json`,
`whole_runs.json` and `waits.json`, which have every number in full. Each chapter says on what, when and under what load
it was measured; figures of different chapters are not compared, as they are of different days and machines.

All peers integrate the same equations along the same truth for the same samples of the TN's errors, in stretches
between the kinks of the truth and in canonical units, which suit their step controls better than SI. The accuracy of
every peer is swept. Its error is measured on 200 samples against the reference engine, as a share of each output's
sigma, and the cheapest setting within 1e-6 of sigma counts. Each peer runs in a process of its own: the sweep on one
core (least processor time of several runs, peak memory), the chosen setting again on two. Start-up is the time from
the start of the process to the first final error, with compiled code cached where the library does so. Peers are
installed one by one, and one that fails is listed with its reason. numbalsoda has no wheel for Python 3.11 and needs
a Fortran compiler; once there is one, `rm .venv/benched` and run `make bench` again.

The machine was a virtual one whose speed varies by half: the same million stored samples took 8.8 to 12.6 s within an
hour, and their report made again from the folder 4.7 to 6.4 s. A thousand samples on the reference engine take 12 to
19 s.\
"""
"""How the measurements are made and read."""

ROUGH, FINE = (f"{target:.0e}" for target in TARGETS)
OURS: Final = "mcnav"


def markdown(
    record: Mapping[str, Any],
    inertial: Mapping[str, Any] | None = None,
    whole_runs: Mapping[str, Any] | None = None,
    commands: Mapping[str, Any] | None = None,
) -> str:
    """Make the page of the records of the chapters: reentries, and those of the others that have been measured."""
    known = [chapter["machine"]["packages"] for chapter in (record, inertial, whole_runs, commands) if chapter]
    packages = {name: version for versions in known for name, version in versions.items()}
    parts = [
        "# Benchmarks",
        "Times and memory of mcnav and its peers, at the same measured accuracy.",
        METHOD,
        *(waits.chapter(commands) if commands else ()),
        *(slopes.chapter(whole_runs) if whole_runs else ()),
        "## Reentries, with peers",
        machine.sentence(record["machine"]),
        *(_trajectory(record, case) for case in record["cases"]),
        "![Work against precision](work_precision.svg)",
        "## The kernel by itself",
        *(_kernel(found) for found in record["kernel"]),
        *_growth(record["growth"], record["stages"]),
        *(chapter(inertial) if inertial else ()),
        "## Versions",
        ", ".join(f"{name} {packages[name] or '(not installed)'}" for name in sorted(packages)),
    ]
    return "\n\n".join(parts) + "\n"


def _trajectory(record: Mapping[str, Any], case: Mapping[str, Any]) -> str:
    rows = [row for row in record["peers"] if row["trajectory"] == case["trajectory"]]
    return (
        f"## Trajectory {case['trajectory']}: {case['minutes']:.0f} minutes, {case['stretches']} stretches\n\n"
        f"{_peers_table(rows)}\n\n"
        f"Error: the largest in any output of {case['compared']} draws, as a share of its sigma, against "
        f"{case['reference']}, from which the ensemble's finest grid differs by {case['disagreement']:.0e}."
    )


def _peers_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """The peers on one trajectory, at the same measured accuracies."""
    ours = next((_spent(row, FINE) for row in rows if row["peer"] == OURS), None)
    head = [
        "", "method", f"µs of one core per sample, at {ROUGH} σ", f"at {FINE} σ", "against mcnav", "error there",
        "samples/s, two cores", "start-up", "memory",
    ]  # fmt: skip
    return table(head, [_peer(row, ours) for row in rows])


def _spent(row: Mapping[str, Any], target: str) -> float | None:
    found = (row.get("at") or {}).get(target)
    return None if found is None else float(found["microseconds"])


def _peer(row: Mapping[str, Any], ours: float | None) -> list[str]:
    for wrong in ("missing", "failed"):
        if wrong in row:
            said = "not installed" if wrong == "missing" else "failed"
            return [row["peer"], f"{said}: {row[wrong]}", *["–"] * 7]
    fine, spent = row["at"][FINE], _spent(row, FINE)
    best = min((each["error"] for each in row["settings"] if each.get("error") is not None), default=None)
    not_reached = "not reached" if best is None else f"not reached (best {best:.0e})"
    both = None if fine is None else fine["two_cores_samples_per_second"]
    return [
        row["peer"],
        row["method"],
        number(_spent(row, ROUGH), "not reached"),
        number(spent, not_reached),
        "–"
        if ours is None or spent is None
        else f"{spent / ours:,.0f} ×"
        if spent > 3 * ours
        else f"{spent / ours:.1f} ×",
        "–" if fine is None else f"{fine['error']:.0e} ({fine['compared']} draws)",
        "–" if both is None else f"{both:,.0f}" if both < 1e5 else f"{both / 1e6:.2g} million",
        number(row["start_up"], "–", " s"),
        f"{row['megabytes']:.0f} MB",
    ]


def _kernel(found: Mapping[str, Any]) -> str:
    nodes = table(
        ["nodes", "µs per sample", "error against the finest grid", "against the reference"],
        [
            [
                str(row["nodes"]),
                f"{row['microseconds']:.3f}",
                f"{row['against_finest']:.0e}",
                f"{row['against_reference']:.0e}",
            ]
            for row in found["nodes"]
        ],
    )
    refined = " ".join(
        f"Refined to {row['tolerance']:.0e}, as a campaign would: {row['nodes']} nodes, {row['microseconds']:.3f} µs, "
        f"error {row['error']:.0e}; two threads {row['two_threads_samples_per_second'] / 1e6:.1f} million samples/s, "
        f"{row['two_threads_efficiency']:.0%} of twice one."
        for row in found["refined"]
    )
    epochs = "; ".join(f"{row['epochs']} epochs: {row['microseconds']:.2f} µs" for row in found["epochs"])
    return (
        f"### Trajectory {found['trajectory']}\n\n{nodes}\n\n{refined}\n\nWith errors read out at epochs, {epochs}.\n\n"
        f"What bounds it: {sentence(found['bound'])}."
    )


def _growth(growth: Mapping[str, Any], stages: Sequence[Mapping[str, Any]]) -> list[str]:
    """Runs by samples and by jobs, and where their time goes."""
    if not growth:
        return []
    head = ["samples", "jobs", "keeps", "seconds", "processor", "memory", "stored"]
    return [
        "## Whole runs: from start to finished report, trajectory 4",
        table(head, [_run(row) for row in (*growth["samples"], *growth["jobs"])]),
        "Seconds of each stage, one job:",
        table(
            ["", *(f"{found['samples']:,} samples, keeps {found['store']}" for found in stages)],
            [[stage, *(f"{found['seconds'][stage]:.2f}" for found in stages)] for stage in stages[0]["seconds"]],
        ),
    ]


def _run(row: Mapping[str, Any]) -> list[str]:
    return [
        f"{row['samples']:,}",
        str(row["jobs"]),
        row["store"],
        f"{row['seconds']:.1f} s",
        f"{row['processor_seconds']:.1f} s",
        f"{row['megabytes']:.0f} MB",
        f"{row['stored_megabytes']:.0f} MB",
    ]
