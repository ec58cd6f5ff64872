"""The analysis: a linear covariance compared with the samples of a nonlinear simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.comparison import Comparison as PairedComparison
from mcnav.analysis.comparison import Criterion
from mcnav.analysis.comparison import compare as compare_paired
from mcnav.analysis.covariance_comparison import CovarianceComparison, compare_covariance
from mcnav.analysis.model import Model
from mcnav.analysis.verdict import Judgement, Verdict
from mcnav.arrays.types import Array
from mcnav.execution.threads import one_thread
from mcnav.frames.covariance_verdict import CovarianceVerdict
from mcnav.frames.linear import MEAN, WITHOUT
from mcnav.frames.simulation import REASON
from mcnav.sampler.designs import SamplingDesign
from mcnav.sampler.errors import SAMPLING

UNLIKE: Final = 10.0
"""Times ``1 / sqrt(n)`` by which the sigma of P times the draws may be off: fourteen standard errors if normal."""

UNRELATED: Final = 0.25
"""Correlation of an output with its linear outcome below which the two are of different draws: half of the least."""


def compare(
    covariance: pd.DataFrame | Array,
    outputs: pd.DataFrame | Array,
    draws: pd.DataFrame | Array | None = None,
    partials: pd.DataFrame | Array | None = None,
    tolerance: float = 0.05,
    confidence: float = 0.95,
) -> CovarianceVerdict:
    """Compare a linear covariance with the outputs of simulated samples.

    With the draws and P, the sampling noise that samples and linear analysis share is taken out: ``cov(y) -
    cov(P s) + P S P'``. The intervals are then those of what linear analysis leaves out.

    Parameters
    ----------
    covariance : DataFrame or ndarray, shape (outputs, outputs)
        P S P', SI, as `mcnav.propagate_covariance` makes it.
    outputs : DataFrame or ndarray, shape (n, outputs)
        Outputs of the samples, SI, as `mcnav.simulate` makes them; a row with NaN is a sample that failed.
    draws : DataFrame or ndarray, shape (n, sources), optional
        Errors of the same samples, SI.
    partials : DataFrame or ndarray, shape (outputs, sources), optional
        P, SI.
    tolerance : float
        Departure of a sigma ratio from one that counts as agreement.
    confidence : float
        Of all verdicts together (Bonferroni).

    Returns
    -------
    CovarianceVerdict
        It prints as a table; numbers are in ``.frame``.

    Raises
    ------
    ValueError
        When names or shapes do not fit together, or draws come without P or the other way round.

    Examples
    --------
    >>> import mcnav as mc
    >>> samples = np.random.default_rng(1).normal(size=(20_000, 2)) * [1.0, 1.2]
    >>> verdict = mc.compare(np.eye(2), samples)
    >>> verdict.frame["sigma_plain"].round(3).to_dict(), verdict.frame["verdict"].to_dict()
    ({'y1': 0.989, 'y2': 1.199}, {'y1': 'agrees', 'y2': 'differs'})
    """
    if (draws is None) != (partials is None):
        raise ValueError("a paired comparison needs both draws and partials; got one of them")
    _check_share("tolerance", tolerance)
    _check_share("confidence", confidence)
    known, named = _labelled(covariance, outputs)
    given = _numbers(known, "covariance")
    if not np.isfinite(given).all() or np.linalg.eigvalsh(given)[0] < -1e-9 * max(np.trace(given), 1e-300):
        raise ValueError("covariance must be finite and positive semidefinite")
    outcomes = _numbers(named, "outputs")
    if np.isfinite(outcomes).all(axis=1).sum() < 2:
        raise ValueError("fewer than two samples succeeded, so that there is nothing to compare")
    sampling = outputs.attrs.get(SAMPLING, {}) if isinstance(outputs, pd.DataFrame) else {}
    design = SamplingDesign.of(
        sampling.get("design", "random"), sampling.get("samples", len(outcomes)), sampling.get("normal", True),
        sampling.get("heavy_tailed", False),
    )  # fmt: skip
    with one_thread():
        if draws is None or partials is None:
            mean = known.attrs.get(MEAN)
            centre = None if mean is None else np.array([mean[name] for name in known.columns])
            plain = compare_covariance(given, outcomes, centre, (tolerance, confidence), design)
            return _of_plain(known, plain, tolerance, confidence)
        model, errors = _paired_model(known, draws, partials, outcomes)
        paired = compare_paired(model, errors, outcomes, Criterion(tolerance, confidence), design)
    return _of_paired(known, paired, tolerance, confidence)


def _check_share(name: str, value: float) -> None:
    if not (isinstance(value, (int, float)) and 0.0 < value < 1.0):
        raise ValueError(f"{name} must be between 0 and 1; got {value!r}")


def _array(given: Any, name: str) -> Array:
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a frame or an array of numbers; got {type(given).__name__}") from None


def _numbers(table: pd.DataFrame, name: str) -> Array:
    try:
        return np.asarray(table.to_numpy(float))
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers; got {table.dtypes.iloc[0]}") from None


def _labelled(covariance: pd.DataFrame | Array, outputs: pd.DataFrame | Array) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return covariance and outputs as frames with the same names in the same order; `ValueError` when they differ."""
    if isinstance(outputs, pd.DataFrame):
        if list(outputs.index) == list(outputs.columns):
            raise ValueError("outputs must be samples, a row a sample, as mcnav.simulate makes them; got a covariance")
        samples = outputs.drop(columns=REASON, errors="ignore")
    else:
        array = _array(outputs, "outputs")
        array = array[:, None] if array.ndim == 1 else array
        names = list(covariance.columns) if isinstance(covariance, pd.DataFrame) else None
        samples = pd.DataFrame(array, columns=names or [f"y{number + 1}" for number in range(array.shape[1])])
    if not isinstance(covariance, pd.DataFrame):
        matrix = np.atleast_2d(_array(covariance, "covariance"))
        if matrix.shape != (samples.shape[1],) * 2:
            raise ValueError(f"covariance of shape {matrix.shape} does not fit outputs of shape {samples.shape}")
        covariance = pd.DataFrame(matrix, index=samples.columns, columns=samples.columns)
    if covariance.shape[0] != covariance.shape[1]:
        raise ValueError(
            f"covariance must be square, outputs by outputs; got shape {covariance.shape} (it comes first, then the "
            "outputs)"
        )
    if set(covariance.columns) != set(samples.columns) or list(covariance.index) != list(covariance.columns):
        raise ValueError(
            f"covariance and outputs must list the same outputs; got {', '.join(map(str, covariance.columns))} and "
            f"{', '.join(map(str, samples.columns))}"
        )
    return covariance, samples[list(covariance.columns)]


def _paired_model(
    covariance: pd.DataFrame, draws: pd.DataFrame | Array, partials: pd.DataFrame | Array, outcomes: Array
) -> tuple[Model, Array]:
    """Return the linear model of a paired comparison, and the errors of its samples.

    P and the covariance determine the spread of the linear outcomes; nothing else of S is used. `ValueError` when draws
    and partials do not list the same sources, the spread of P times the draws is far from the covariance, or the
    outputs are of other draws.
    """
    samples = len(outcomes)
    if isinstance(partials, pd.DataFrame):
        partials = partials.loc[list(covariance.columns)]
        if isinstance(draws, pd.DataFrame):
            if set(draws.columns) != set(partials.columns):
                raise ValueError(
                    f"draws and partials must list the same sources; got {', '.join(map(str, draws.columns))} and "
                    f"{', '.join(map(str, partials.columns))}"
                )
            draws = draws[list(partials.columns)]
    matrix, errors = np.asarray(partials, dtype=float), np.asarray(draws, dtype=float)
    if matrix.shape != (len(covariance), errors.shape[1]) or len(errors) != samples:
        raise ValueError(
            f"partials of shape {matrix.shape} and draws of shape {errors.shape} do not fit {samples} samples of "
            f"{len(covariance)} outputs"
        )
    nominal = getattr(partials, "attrs", {}).get("nominal", {})
    offset = np.array([nominal.get(name, 0.0) for name in covariance.columns])
    linear = errors @ matrix.T
    spread = np.sqrt(np.diag(covariance.to_numpy(float)))
    sampled = linear.std(axis=0, ddof=1)
    unlike = np.abs(sampled - spread) > UNLIKE / np.sqrt(samples) * np.maximum(spread, sampled)
    if unlike.any():
        names = ", ".join(str(name) for name, wrong in zip(covariance.columns, unlike, strict=True) if wrong)
        raise ValueError(
            f"covariance is not P S P' of these partials and draws for {names}. P times the draws has sigmas that no "
            "sample of this size has by chance"
        )
    if _unrelated(linear, outcomes):
        raise ValueError("the outputs are not correlated with P times the draws: give the draws that were simulated")
    # The sources of the comparison are the linear outcomes themselves, so that S need not be known: P is one.
    mean = covariance.attrs.get(MEAN)
    centre = linear.mean(axis=0) if mean is None else np.array([mean[n] for n in covariance.columns]) - offset
    return Model(np.eye(len(covariance)), offset, centre, covariance.to_numpy(float)), linear


def _unrelated(linear: Array, outcomes: Array) -> bool:
    """Return whether outputs, shape (n, outputs), follow none of their linear outcomes of about the same spread.

    An output whose sigma is at most twice the linear one has a correlation of a half or more with it, if P holds.
    """
    whole = np.isfinite(outcomes).all(axis=1)
    pairs = [
        (first, second)
        for first, second in zip(linear[whole].T, outcomes[whole].T, strict=True)
        if 0.0 < second.std() <= 2.0 * first.std()
    ]
    return bool(pairs) and all(abs(np.corrcoef(first, second)[0, 1]) < UNRELATED for first, second in pairs)


def _row(judgement: Judgement, kind: str, **sigmas: float) -> Mapping[str, Any]:
    low, high = judgement.interval or (np.nan, np.nan)
    bounded = np.isfinite(high)
    return {
        **sigmas,
        f"ratio_{kind}": np.nan if judgement.ratio is None else judgement.ratio,
        f"ratio_{kind}_from": low if bounded else np.nan,
        f"ratio_{kind}_to": high if bounded else np.nan,
        "verdict": str(judgement.verdict),
        "samples_needed": np.nan if judgement.samples_needed is None else float(judgement.samples_needed),
    }


def _frame(covariance: pd.DataFrame, rows: list[Mapping[str, Any]]) -> pd.DataFrame:
    frame = pd.DataFrame(rows, index=list(covariance.columns))
    units = covariance.attrs.get("units", {})
    frame.insert(0, "unit", [units.get(name, "") for name in covariance.columns])
    frame.index.name = "output"
    return frame


def _matrix(covariance: pd.DataFrame, values: Array) -> pd.DataFrame:
    """Label a matrix as the covariance is."""
    return pd.DataFrame(values, index=covariance.index, columns=covariance.columns)


def _of_plain(
    covariance: pd.DataFrame, plain: CovarianceComparison, tolerance: float, confidence: float
) -> CovarianceVerdict:
    sigmas = zip(np.sqrt(np.diag(covariance)), np.sqrt(np.diag(plain.sample)), plain.outputs, strict=True)
    rows = [_row(judged, "plain", sigma_linear=linear, sigma_plain=own) for linear, own, judged in sigmas]
    joint = "" if plain.together is None else str(plain.together.verdict)
    return CovarianceVerdict(
        _frame(covariance, rows), _overall(plain.verdict, joint), joint, plain.nees.value, float(plain.dimension),
        _matrix(covariance, plain.sample), pd.Series(plain.direction, index=covariance.columns), plain.direction_ratio,
        plain.samples, plain.failed, False, tuple(covariance.attrs.get(WITHOUT, ())), tolerance, confidence,
    )  # fmt: skip


def _of_paired(
    covariance: pd.DataFrame, paired: PairedComparison, tolerance: float, confidence: float
) -> CovarianceVerdict:
    rows = [
        _row(output.paired, "paired", sigma_linear=output.sigma_linear, sigma_plain=output.sigma_sample,
             sigma_paired=output.sigma_paired)
        for output in paired.outputs
    ]  # fmt: skip
    whole = paired.ellipsoid
    joint = "" if whole is None else str(whole.verdict)
    direction = np.zeros(len(covariance)) if whole is None else whole.directions[whole.farthest]
    fixed, fixed_sigma = _fixed(covariance, paired)
    return CovarianceVerdict(
        _frame(covariance, rows), _overall(paired.verdict, joint), joint,
        np.nan if whole is None else whole.nees_paired.value, 0.0 if whole is None else float(whole.dimension),
        _matrix(covariance, paired.covariance_sample), pd.Series(direction, index=covariance.columns),
        1.0 if whole is None else float(whole.direction_ratios[whole.farthest]), paired.samples, paired.failed, True,
        tuple(covariance.attrs.get(WITHOUT, ())), tolerance, confidence, fixed, fixed_sigma,
    )  # fmt: skip


def _fixed(covariance: pd.DataFrame, paired: PairedComparison) -> tuple[pd.Series | None, float]:
    """Return the most varied combination that linear analysis treats as exact, and its sigma in those of its lead."""
    for combination in () if paired.ellipsoid is None else paired.ellipsoid.unpredicted:
        if combination.judgement is not None and combination.judgement.verdict == Verdict.DIFFERS:
            lead = paired.outputs[combination.lead]
            sigma = combination.sigma_paired / (lead.sigma_linear or lead.sigma_paired)
            return pd.Series(combination.shares, index=covariance.columns), float(sigma)
    return None, 0.0


def _overall(verdict: Verdict, joint: str) -> str:
    """Join the verdict on sigmas with that on the whole matrix, as runs do."""
    return "partly" if verdict == Verdict.AGREES and joint == "differs" else str(verdict)
