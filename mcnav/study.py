"""The way of the data on one page: campaign, flights, run folder, analysis, report."""

from __future__ import annotations

import hashlib
import json
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare
from mcnav.campaign.file import Campaign
from mcnav.campaign.folder import CAMPAIGN, MANIFEST, REPORT, SUMMARY, Layout, RunFolder, Samples, as_records, plain
from mcnav.campaign.problems import RunFolderError
from mcnav.campaign.runner import Draws, Progress, Work, fly
from mcnav.linear.partials import FlightFailed, partials_by_differences, partials_by_independent_sets
from mcnav.linear.unscented import unscented
from mcnav.report.content import Content
from mcnav.report.page import render
from mcnav.sampling.designs import block_length
from mcnav.scenarios.protocol import Prepared

Array = NDArray[np.float64]

PROBES: Final = 64
"""Samples on which an engine's accuracy is settled: the first of the campaign itself."""

LIBRARIES: Final = ("numpy", "scipy", "numba", "pyarrow")
FORMAT: Final = 1


@dataclass(frozen=True)
class Analysis:
    """A finished run, judged.

    Attributes
    ----------
    manifest : mapping
        What the run says of itself.
    samples : Samples
    model : Model
    criterion : Criterion
    comparison : Comparison
    budget : ErrorBudget
    """

    manifest: Mapping[str, Any]
    samples: Samples
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget


def versions() -> dict[str, str]:
    """The program, the interpreter and the libraries that results depend on."""
    return {
        "mcnav": version("mcnav"),
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }


def run_campaign(
    campaign: Campaign,
    path: Path,
    engine: str,
    jobs: int,
    fresh: bool = False,
    progress: Progress = lambda samples: None,
) -> dict[str, Any]:
    """Fly a campaign into a run folder, analyse it and write its report.

    A run that was broken off goes on where it stopped; chunks that are stored whole are not flown again.

    Parameters
    ----------
    campaign : Campaign
    path : Path
        Run folder.
    engine : str
        One of the scenario's engines.
    jobs : int
        Workers.
    fresh : bool
        Delete what an earlier run left in the folder.
    progress : callable
        Told how many samples have become ready.

    Returns
    -------
    dict
        The content of ``summary.json``.

    Raises
    ------
    RunFolderError
        When the folder holds something else, is in use, or cannot be written to.
    """
    folder = RunFolder(path)
    identity = {"campaign": plain(campaign.resolved), "engine": engine, "versions": versions()}
    digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
    _refuse_foreign(folder)
    with folder.held(), threadpool_limits(1):
        if fresh:
            folder.clear()
        _refuse_changed(folder, identity)
        draws = Draws(campaign.errors, campaign.design, campaign.seed, campaign.samples)
        probes = campaign.errors.draw(
            campaign.design, campaign.seed, campaign.samples, 0, min(PROBES, campaign.samples)
        )
        prepared = campaign.scenario.prepared(engine, probes)
        manifest: dict[str, Any] = {
            "format": FORMAT,
            "campaign": campaign.name,
            "samples": campaign.samples,
            "seed": campaign.seed,
            "design": campaign.design,
            "criterion": {"tolerance": campaign.tolerance, "confidence": campaign.confidence},
            "identity": identity,
            "accuracy": prepared.accuracy,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "model": _model(campaign, prepared),
            "complete": False,
            "parts": [],
        }
        folder.write(CAMPAIGN, campaign.to_toml().encode())
        folder.write_history(campaign.scenario.history())
        folder.write_json(MANIFEST, manifest)
        layout = Layout.of(campaign.scenario.sources, campaign.scenario.outputs)
        began = time.perf_counter()
        try:
            parts = fly(Work(draws, prepared, folder, digest, layout), jobs, progress)
        except OSError as failure:
            raise RunFolderError(
                f"{path}: cannot be written to: {failure.strerror or failure}; what is stored there is kept"
            ) from None
        manifest |= {
            "complete": True,
            "parts": as_records(parts),
            "flight": {"jobs": jobs, "seconds": round(time.perf_counter() - began, 3)},
        }
        folder.write_json(MANIFEST, manifest)
        return _finish(folder, analyse(folder))


def report_run(path: Path) -> dict[str, Any]:
    """Analyse a finished run folder again and write its summary and report.

    Raises
    ------
    RunFolderError
        When the folder holds no finished run, or a part of it is damaged.
    """
    folder = RunFolder(path)
    if folder.manifest() is None:
        raise RunFolderError(f"{path}: holds no run ({MANIFEST} is missing)")
    with folder.held(), threadpool_limits(1):
        return _finish(folder, analyse(folder))


def _refuse_foreign(folder: RunFolder) -> None:
    foreign = folder.foreign()
    if foreign and folder.manifest() is None:
        raise RunFolderError(
            f"{folder.path}: holds {foreign[0]!r}, which is not of a run; choose another folder with --out"
        )


def _refuse_changed(folder: RunFolder, identity: Mapping[str, Any]) -> None:
    """Results of another campaign, engine or program are neither mixed with nor overwritten."""
    earlier = folder.manifest()
    if earlier is None:
        return
    before, now = _flat(earlier.get("identity", {})), _flat(plain(identity))
    changed = [
        f"{key} was {before.get(key, 'absent')}, is {now.get(key, 'absent')}"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key)
    ]
    if changed:
        more = f" and {len(changed) - 3} more" if len(changed) > 3 else ""
        raise RunFolderError(
            f"{folder.path}: holds the results of another run ({'; '.join(changed[:3])}{more}); "
            "--fresh replaces them, --out writes elsewhere"
        )


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, Mapping):
        return {key: leaf for name, entry in value.items() for key, leaf in _flat(entry, f"{prefix}{name}.").items()}
    return {prefix.removesuffix(".").removeprefix("campaign."): value}


def _model(campaign: Campaign, prepared: Prepared) -> dict[str, Any]:
    """The linear model and what goes with it, as the manifest keeps it."""
    scenario, errors = campaign.scenario, campaign.errors
    linear = scenario.linearised()
    model: dict[str, Any] = {
        "sources": [
            {"name": source.name, "unit": source.unit, "shown_in": source.shown_in} for source in scenario.sources
        ],
        "outputs": [
            {"name": output.name, "unit": output.unit, "shown_in": output.shown_in} for output in scenario.outputs
        ],
        "partials": linear.partials,
        "nominal": linear.nominal,
        "start_mean": errors.mean,
        "start_covariance": errors.covariance,
    }
    try:
        mean, covariance = unscented(prepared.propagate, errors.mean, errors.covariance)
        model["unscented"] = {"mean": mean, "covariance": covariance}
    except FlightFailed as failure:
        model["unscented"] = {"failed": str(failure)}
    return model


def analyse(folder: RunFolder) -> Analysis:
    """Judge what a run folder holds; nothing is flown.

    Raises
    ------
    RunFolderError
        When the run is not finished or damaged.
    """
    manifest = folder.manifest()
    if manifest is None or not manifest.get("complete"):
        raise RunFolderError(
            f"{folder.path}: the run is not finished; run the campaign again, it goes on where it stopped"
        )
    try:
        described = manifest["model"]
        model = Model(
            *(
                np.array(described[key], dtype=float)
                for key in ("partials", "nominal", "start_mean", "start_covariance")
            )
        )
        layout = Layout.of(*([SimpleNamespace(**entry) for entry in described[key]] for key in ("sources", "outputs")))
        criterion = Criterion(**manifest["criterion"])
        samples = folder.samples(manifest["parts"], layout)
        length = block_length(manifest["design"], manifest["samples"])
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    comparison = compare(model, samples.errors, samples.outputs, samples.index // length, criterion)
    return Analysis(manifest, samples, model, criterion, comparison, error_budget(model.partials, model.covariance))


def _finish(folder: RunFolder, analysis: Analysis) -> dict[str, Any]:
    summary = summarise(analysis)
    folder.write_json(SUMMARY, summary)
    content = Content(
        summary=summary,
        manifest=analysis.manifest,
        model=analysis.model,
        criterion=analysis.criterion,
        comparison=analysis.comparison,
        budget=analysis.budget,
        outputs=analysis.samples.outputs,
        index=analysis.samples.index,
        status=analysis.samples.status,
        history=folder.history(),
        campaign=(folder.path / CAMPAIGN).read_text(encoding="utf-8"),
    )
    folder.write(REPORT, render(content).encode())
    return summary


def summarise(analysis: Analysis) -> dict[str, Any]:
    """The content of ``summary.json``: SI units, rows and columns in the order of outputs and sources."""
    manifest, comparison, model = analysis.manifest, analysis.comparison, analysis.model
    outputs, ellipsoid = comparison.outputs, comparison.ellipsoid
    named = {
        key: [{"name": e["name"], "unit": e["unit"]} for e in manifest["model"][key]] for key in ("sources", "outputs")
    }
    return {
        "campaign": manifest["campaign"],
        "verdict": comparison.verdict.value,
        "samples": manifest["samples"],
        "failed": comparison.failed,
        "failures": _reasons(analysis.samples.status),
        "engine": manifest["identity"]["engine"],
        "seed": manifest["seed"],
        "design": manifest["design"],
        "tolerance": analysis.criterion.tolerance,
        "confidence": analysis.criterion.confidence,
        "confidence_each": comparison.confidence_each,
        **named,
        "partials": model.partials,
        "start_mean": model.mean,
        "start_covariance": model.covariance,
        "mean_linear": model.outcome_mean,
        "mean_sample": comparison.mean_sample,
        "bias": [output.bias.value for output in outputs],
        "bias_standard_error": [output.bias.standard_error for output in outputs],
        "covariance_linear": comparison.covariance_linear,
        "covariance_sample": comparison.covariance_sample,
        "covariance_paired": comparison.covariance_paired,
        "sigma_linear": np.sqrt(np.diag(comparison.covariance_linear)),
        "sigma_sample": [output.sigma_sample for output in outputs],
        "sigma_paired": [output.sigma_paired for output in outputs],
        "sigma_ratio": [output.plain.ratio for output in outputs],
        "sigma_ratio_interval": [output.plain.interval for output in outputs],
        "sigma_ratio_paired": [output.paired.ratio for output in outputs],
        "sigma_ratio_paired_interval": [output.paired.interval for output in outputs],
        "verdicts": [output.paired.verdict.value for output in outputs],
        "samples_needed": [output.paired.samples_needed for output in outputs],
        "nees_dimension": ellipsoid.dimension if ellipsoid else 0,
        "nees_mean": ellipsoid.nees.value if ellipsoid else None,
        "nees_standard_error": ellipsoid.nees.standard_error if ellipsoid else None,
        "nees_mean_paired": ellipsoid.nees_paired.value if ellipsoid else None,
        "nees_paired_standard_error": ellipsoid.nees_paired.standard_error if ellipsoid else None,
        "direction_ratio": float(ellipsoid.direction_ratios[ellipsoid.farthest]) if ellipsoid else None,
        "direction_weights": ellipsoid.directions[ellipsoid.farthest] if ellipsoid else None,
        "verdict_matrix": ellipsoid.judgement.verdict.value if ellipsoid else None,
        "unscented": manifest["model"]["unscented"],
    }


def _reasons(status: tuple[str, ...]) -> dict[str, int]:
    """How many samples failed for each reason."""
    counts: dict[str, int] = {}
    for reason in status:
        if reason != "ok":
            counts[reason] = counts.get(reason, 0) + 1
    return counts


def summary_of(path: Path) -> dict[str, Any]:
    """The summary of a finished run folder.

    Raises
    ------
    RunFolderError
        When there is none, or it is damaged.
    """
    summary = RunFolder(path).summary()
    if not {"verdict", "outputs", "sigma_linear", "verdict_matrix", "direction_ratio"} <= summary.keys():
        raise RunFolderError(f"{path / SUMMARY}: is not a summary of this program; run mcnav report on the folder")
    return summary


def partials_of(campaign: Campaign, methods: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Partial derivatives by the first of some methods, and how far the others are from them.

    Parameters
    ----------
    campaign : Campaign
    methods : sequence of str
        Of ``variational`` (the equations of variation along the truth), ``differences`` (one error at a time, ensemble
        engine) and ``runs`` (F S^-1 from independent error sets, reference engine).

    Returns
    -------
    partials : ndarray, shape (outputs, sources)
        SI.
    differences : dict of str to ndarray, shape (outputs,)
        For each further method the largest difference in each row, as a share of the row's largest contribution of one
        source at its nominal size.
    """
    scenario = campaign.scenario
    sizes = np.array([source.nominal for source in scenario.sources])
    found = {}
    for method in methods:
        if method == "variational":
            found[method] = scenario.linearised().partials
        elif method == "differences":
            found[method] = partials_by_differences(scenario.prepared("ensemble", np.diag(sizes)).propagate, sizes)
        else:
            found[method] = partials_by_independent_sets(
                scenario.prepared("reference", np.diag(sizes)).propagate, sizes
            )
    first = found.pop(methods[0])
    largest = np.abs(first * sizes).max(axis=1)
    return first, {name: np.abs((other - first) * sizes).max(axis=1) / largest for name, other in found.items()}
