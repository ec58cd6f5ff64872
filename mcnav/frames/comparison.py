"""The analysis: a linear covariance compared with the samples of a nonlinear simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav._threads import one_thread
from mcnav._types import Array
from mcnav.analysis.comparison import Comparison as PairedComparison
from mcnav.analysis.comparison import Criterion, Model
from mcnav.analysis.comparison import compare as compare_paired
from mcnav.analysis.covariance_comparison import CovarianceComparison, compare_covariance
from mcnav.analysis.verdict import Judgement, Verdict
from mcnav.frames.linear import MEAN, WITHOUT
from mcnav.frames.simulation import REASON
from mcnav.sampler.designs import SamplingDesign
from mcnav.sampler.errors import SAMPLING

UNLIKE: Final = 10.0
"""Times ``1 / sqrt(n)`` by which the sigma of P times the draws may be off: fourteen standard errors if normal."""

WORDS: Final = {
    Verdict.AGREES: "The covariance holds: each sigma agrees within {tolerance:.0%}.",
    Verdict.DIFFERS: "Do not use this covariance for {differing}: the simulated sigma differs by more than "
    "{tolerance:.0%}.",
    Verdict.UNDECIDED: "No verdict yet for {undecided}: {remedy}.",
}


PAIRED: Final = """\
Monte Carlo is the sigma of the samples. Paired takes out the scatter of the draws, which both sides share; the
difference is its own."""


@dataclass(frozen=True)
class CovarianceVerdict:
    """Verdict of samples on a covariance.

    Attributes
    ----------
    frame : DataFrame
        A row an output, SI, with the columns of `RunResult.outputs`: ``unit``, ``sigma_linear``, ``sigma_plain`` of
        the samples and, where draws and P were given, ``sigma_paired``; ``ratio_paired``, else ``ratio_plain``, the
        simulated over the linear sigma, with ``_from`` and ``_to`` at the confidence of all verdicts together;
        ``verdict`` and ``samples_needed``.
    verdict : str
        ``agrees``, ``differs`` or ``undecided``, of the sigmas; ``partly`` where these agree and the matrix does not.
    joint : str
        Verdict on the whole matrix, by mean NEES; empty for a matrix of zeros.
    nees, nees_expected : float
        Mean normalised estimation error squared, paired where it can be, and its expectation.
    sample_covariance : DataFrame
        Covariance of the successful samples, SI, as `pandas.DataFrame.cov` has it.
    worst_direction : Series
        Weights, in units of the outputs' sigmas, of the combination with the worst sigma ratio.
    worst_ratio : float
        Its sigma ratio. The worst of all directions was chosen, so it has no interval.
    samples, failed : int
    paired : bool
        Whether the sampling noise that samples and linear analysis share was taken out.
    without : tuple of str
        Processes of noise that the system has and P S P' has not.
    fixed : Series or None
        Weights, in units of the outputs' sigmas, of the combination that linear analysis treats as exact and that
        varies most all the same; none where there is none.
    fixed_sigma : float
        Its simulated sigma, in sigmas of the output with the weight one.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> errors = mc.Errors({"a": 1.0, "b": 2.0})
    >>> draws = errors.draw(4000, seed=1)
    >>> P = mc.partials(lambda e: e, errors)
    >>> verdict = mc.compare(mc.propagate_covariance(P, errors), mc.simulate(lambda e: e, draws), draws, P)
    >>> verdict.verdict, bool(abs(verdict.frame["ratio_paired"] - 1.0).max() < 1e-9)
    ('agrees', True)
    """

    frame: pd.DataFrame
    verdict: str
    joint: str
    nees: float
    nees_expected: float
    sample_covariance: pd.DataFrame
    worst_direction: pd.Series
    worst_ratio: float
    samples: int
    failed: int
    paired: bool
    without: tuple[str, ...]
    tolerance: float
    confidence: float
    fixed: pd.Series | None = None
    fixed_sigma: float = 0.0

    @property
    def sentence(self) -> str:
        """The verdict and its consequence."""
        verdicts = self.frame["verdict"]
        words = WORDS[Verdict.UNDECIDED if self.verdict == "undecided" else Verdict(verdicts_of(self.verdict))]
        open_ = ", ".join(verdicts.index[verdicts == "undecided"]) or "these samples"
        text = words.format(
            tolerance=self.tolerance, differing=", ".join(verdicts.index[verdicts == "differs"]), undecided=open_,
            remedy=self._remedy,
        )  # fmt: skip
        if self.verdict == "partly":
            text = "Each sigma is right; the full covariance matrix is not. Do not gate or fuse with it."
        if self.without:
            text += f" P S P' leaves out the noise of {', '.join(self.without)}; mcnav.linear has it."
        return text + (f" {self.failed:,} of {self.samples + self.failed:,} samples failed." if self.failed else "")

    @property
    def _kind(self) -> str:
        return "paired" if self.paired else "plain"

    @property
    def _ends(self) -> Array:
        """Ends of the intervals of the ratios, shape (outputs, 2)."""
        ends = [f"ratio_{self._kind}_from", f"ratio_{self._kind}_to"]
        return np.asarray(self.frame[ends].to_numpy(float))

    @property
    def _remedy(self) -> str:
        needed = self.frame["samples_needed"].max()
        if np.isfinite(needed):
            return f"simulate about {needed:,.0f} samples"
        if self.failed:
            return "too many samples failed"
        return "there are too few samples for an interval; simulate at least 100"

    def __str__(self) -> str:
        """Write the verdict as a table."""
        shown = pd.DataFrame(
            {
                "unit": self.frame["unit"],
                "P S P'": self.frame["sigma_linear"].map("{:.5g}".format),
                "Monte Carlo": self.frame["sigma_plain"].map("{:.5g}".format),
                **({"paired": self.frame["sigma_paired"].map("{:.5g}".format)} if self.paired else {}),
                "difference": (self.frame[f"ratio_{self._kind}"] - 1.0).map("{:+.2%}".format),
                "interval": [_interval(*ends) for ends in self._ends],
                "verdict": self.frame["verdict"],
            }
        )
        lines = [
            f"{self.verdict.upper()}  {self.sentence}",
            "",
            f"1 sigma, {self.samples:,} samples",
            shown.to_string(),
        ]
        if self.paired:
            lines.append(PAIRED)
        if self.joint:
            nees = (
                f"full matrix: mean normalised error squared (NEES) {self.nees:.4g}, expected {self.nees_expected:.4g}"
            )
            lines += [
                "",
                nees if self.fixed is not None else f"{nees}: {self.joint}",
                f"worst direction: sigma {self.worst_ratio - 1.0:+.2%} along {_weighted(self.worst_direction)} (each in its "
                "sigma)",
            ]
        if self.fixed is not None:
            lines.append(
                f"linear analysis treats {_weighted(self.fixed)} (each in its sigma) as exact; it varies by "
                f"{self.fixed_sigma:.3g} sigma: differs"
            )
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self, ax: Any = None) -> Any:
        """Draw each ratio with its interval, that of the worst direction, and the tolerance as a band.

        Returns matplotlib's axes.
        """
        import matplotlib.pyplot as plt

        ax = ax or plt.subplots(figsize=(7.0, 1.4 + 0.4 * len(self.frame)), layout="constrained")[1]
        rows = np.arange(len(self.frame))[::-1] + 1
        ratio, ends = self.frame[f"ratio_{self._kind}"].to_numpy(float), self._ends
        known = np.isfinite(ends).all(axis=1)
        ax.axvspan(1.0 - self.tolerance, 1.0 + self.tolerance, color="0.9", label=f"within {self.tolerance:.0%}")
        ax.errorbar(
            ratio[known], rows[known], xerr=np.abs(ends[known].T - ratio[known]), fmt="o", capsize=3,
            label=f"simulated over linear sigma, {self.confidence:.0%}",
        )  # fmt: skip
        ax.plot(ratio[~known], rows[~known], "o", fillstyle="none")
        if self.joint:
            ax.plot([self.worst_ratio], [0], "D", color="C1", label="the worst direction of the full matrix")
        ax.set_yticks(
            [*rows, *([0] if self.joint else [])], [*self.frame.index, *(["worst direction"] * bool(self.joint))]
        )
        ax.set_xlabel("simulated sigma / linear sigma")
        ax.legend(loc="best", fontsize="small")
        return ax


def verdicts_of(verdict: str) -> str:
    """Return the verdict on sigmas of one on everything: those that are partly right agree."""
    return "agrees" if verdict == "partly" else verdict


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
        Errors of the same samples.
    partials : DataFrame or ndarray, shape (outputs, sources), optional
        P.
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
        model, errors = _paired_model(known, draws, partials, len(outcomes))
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
    covariance: pd.DataFrame, draws: pd.DataFrame | Array, partials: pd.DataFrame | Array, samples: int
) -> tuple[Model, Array]:
    """Return the linear model of a paired comparison, and the errors of its samples.

    P and the covariance determine the spread of the linear outcomes; nothing else of S is used. `ValueError` when draws
    and partials do not list the same sources, or the spread of P times the draws is far from the covariance.
    """
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
            f"covariance is not P S P' of these partials and draws for {names}: P times the draws has sigmas that no "
            "sample of this size has by chance"
        )
    # The sources of the comparison are the linear outcomes themselves, so that S need not be known: P is one.
    mean = covariance.attrs.get(MEAN)
    centre = linear.mean(axis=0) if mean is None else np.array([mean[n] for n in covariance.columns]) - offset
    return Model(np.eye(len(covariance)), offset, centre, covariance.to_numpy(float)), linear


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
        _matrix(covariance, plain.sample), pd.Series(plain.direction, index=covariance.columns), plain.direction_ratio, plain.samples, plain.failed,
        False, tuple(covariance.attrs.get(WITHOUT, ())), tolerance, confidence,
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


def _weighted(weights: pd.Series) -> str:
    """Write a combination of outputs, without the small terms."""
    shown = weights[weights.abs() > 0.05 * weights.abs().max()]
    return " ".join(f"{weight:+.3f} {name}" for name, weight in shown.items())


def _interval(low: float, high: float) -> str:
    return "–" if not np.isfinite([low, high]).all() else f"{low - 1.0:+.2%} to {high - 1.0:+.2%}"
